//! Light: what a surface sends out and what arrives at it. Bake, render and reference use these and no others.

pub mod bsdf;
pub mod emitters;
pub mod ggx;
pub mod lambert;
pub mod path;
pub mod punctual;
pub mod sampled;
pub mod surface;

use crate::scene::{Material, Scene};
use crate::trace::{TraceError, Tracer};
use emitters::Emitters;
use surface::SurfaceTable;

/// What one needs to ask about light in a scene: the scene itself, rays, and the means to sample its emitters.
pub struct World<'s> {
    pub scene: &'s Scene,
    pub tracer: Tracer<'s>,
    pub emitters: Emitters,
    pub surfaces: SurfaceTable,
    /// Factor on all punctual lights (some exporters multiply them by 683 and emission not).
    pub punctual_scale: f32,
    /// Largest albedo allowed per channel; larger ones are clamped to it, so that bounces converge.
    pub albedo_max: f32,
}

impl<'s> World<'s> {
    pub fn new(scene: &'s Scene, punctual_scale: f32, albedo_max: f32) -> Result<World<'s>, TraceError> {
        let tracer = Tracer::build(scene)?;
        Ok(World {
            scene,
            tracer,
            emitters: Emitters::new(scene),
            surfaces: SurfaceTable::new(scene),
            punctual_scale,
            albedo_max,
        })
    }

    /// Materials whose albedo can exceed [`World::albedo_max`] by their factors.
    pub fn clamped_materials(&self) -> u64 {
        let exceeds =
            |m: &&Material| !m.unlit && (m.base_color.truncate() * (1.0 - m.metallic)).max_element() > self.albedo_max;
        self.scene.materials.iter().filter(exceeds).count() as u64
    }

    /// Whether anything but punctual lights sends out light.
    pub fn has_emitters(&self) -> bool {
        !self.emitters.is_empty()
    }
}

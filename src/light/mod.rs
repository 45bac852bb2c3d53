//! Light: the radiance that surfaces emit and reflect, and the irradiance that arrives at them. `bake`, `render` and
//! `reference` all use these functions.

#[cfg(test)]
mod appendix_b;
pub mod bsdf;
pub mod contact;
pub mod emitters;
pub mod expected;
pub mod fill_cache;
pub mod ggx;
pub mod incident;
pub mod irradiance_cache;
pub mod lambert;
pub mod layered;
pub mod learn;
pub mod learnt;
pub mod lobe_albedo;
pub mod path;
pub mod places;
pub mod punctual;
mod roulette;
pub mod sampled;
pub mod sides;
pub mod split_sum;
pub mod surface;

use crate::scene::{Material, Scene};
use crate::trace::{TraceError, Tracer};
use contact::Contacts;
use emitters::Emitters;
use places::Places;
use surface::SurfaceTable;

/// A scene with all that light computations need: rays, shading data, and sampling of its emitters.
pub struct World<'s> {
    pub scene: &'s Scene,
    pub tracer: Tracer<'s>,
    pub emitters: Emitters,
    pub surfaces: SurfaceTable,
    pub places: Places,
    /// The punctual lights that lie in a surface.
    pub light_contacts: Contacts,
    /// Factor on all punctual lights. Some exporters multiply punctual lights by 683 but not emission; this undoes it.
    pub punctual_scale: f32,
    /// Largest albedo per channel. Larger albedos are clamped to it, so that the sum over bounces converges.
    pub albedo_max: f32,
}

impl<'s> World<'s> {
    pub fn new(scene: &'s Scene, punctual_scale: f32, albedo_max: f32) -> Result<World<'s>, TraceError> {
        // Embree builds on one thread; the others make the tables meanwhile.
        let tables = || {
            let ((emitters, surfaces), (places, light_contacts)) = rayon::join(
                || (Emitters::new(scene, punctual_scale), SurfaceTable::new(scene)),
                || (Places::new(scene), Contacts::of_lights(scene)),
            );
            (emitters, surfaces, places, light_contacts)
        };
        let (tracer, (emitters, surfaces, places, light_contacts)) = rayon::join(|| Tracer::build(scene), tables);
        Ok(World { scene, tracer: tracer?, emitters, surfaces, places, light_contacts, punctual_scale, albedo_max })
    }

    /// Number of materials whose factors allow an albedo above [`World::albedo_max`].
    pub fn clamped_materials(&self) -> u64 {
        let exceeds =
            |m: &&Material| !m.unlit && (m.base_color.truncate() * (1.0 - m.metallic)).max_element() > self.albedo_max;
        self.scene.materials.iter().filter(exceeds).count() as u64
    }

    /// Whether there is light from emissive surfaces or the sky.
    pub fn has_emitters(&self) -> bool {
        !self.emitters.is_empty()
    }
}

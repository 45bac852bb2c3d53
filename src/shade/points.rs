//! Primary visibility: the surface points that the pixels of a picture show.

use glam::Vec3;
use rayon::prelude::*;

use crate::image::{Picture, auto_exposure};
use crate::light::World;
use crate::light::incident::at_bound;
use crate::light::surface::SurfacePoint;
use crate::math::color::luminance;
use crate::math::random::{Purpose, Random};
use crate::probe::query::QueryPoint;
use crate::probe::store::surface::Facing;
use crate::scene::{AlphaMode, Camera};
use crate::trace::Ray;

/// Rays per pixel in scenes with BLEND surfaces, which stop rays by chance.
const BLEND_SAMPLES: u32 = 16;

/// A surface point in a picture. A pixel has one, or several where translucent surfaces overlap.
#[derive(Debug, Clone, Copy)]
pub struct ImagePoint {
    pub pixel: u32,
    /// Share of the pixel that shows this point.
    pub weight: f32,
    pub surface: SurfacePoint,
    /// Asks with the shading normal after the normal map, on the viewer's side. Ready-made: to make it in every
    /// look-up delays the look-ups that follow.
    pub query: QueryPoint,
    /// Distance from the camera, metres.
    pub depth: f32,
    /// Irradiance from punctual lights, W·m⁻².
    pub irradiance_direct: Vec3,
}

/// Everything a camera sees.
#[derive(Debug, Clone)]
pub struct View {
    pub width: u32,
    pub height: u32,
    pub points: Vec<ImagePoint>,
    /// Per pixel the radiance of the sky × the share of its rays that leave the scene, W·m⁻²·sr⁻¹.
    pub sky: Vec<Vec3>,
}

impl View {
    /// The exposure, EV, that shows the surfaces of a picture of this view at mid grey. A sky behind them does not count:
    /// before a bright one dark things would be black. Where there are no surfaces all of the picture counts.
    pub fn auto_exposure_ev(&self, beauty: &Picture) -> f32 {
        let mut pixels: Vec<u32> = self.points.iter().map(|point| point.pixel).collect();
        pixels.dedup();
        if pixels.is_empty() {
            return beauty.auto_exposure_ev();
        }
        auto_exposure(pixels.into_iter().map(|pixel| luminance(beauty.pixels[pixel as usize])))
    }

    /// How many points get so much from punctual lights that it is clamped, see
    /// [`LIGHT_MAX`](crate::scene::light::LIGHT_MAX).
    pub fn clamped(&self) -> u64 {
        self.points.iter().filter(|point| at_bound(point.irradiance_direct)).count() as u64
    }
}

/// Shoots the picture's primary rays, through pixel centres, and the shadow rays of punctual lights.
pub fn see(world: &World, camera: &Camera, width: u32, height: u32, seed: u64) -> View {
    let samples = if has_blend(world) { BLEND_SAMPLES } else { 1 };
    let pixel = |index: u32| {
        let mut random = Random::new(seed, Purpose::Pixel, u64::from(index), 0);
        see_pixel(world, camera, width, height, index, samples, &mut random)
    };
    let found: Vec<(Vec<ImagePoint>, Vec3)> = (0..width * height).into_par_iter().map(pixel).collect();
    let sky = found.iter().map(|f| f.1).collect();
    View { width, height, points: found.into_iter().flat_map(|f| f.0).collect(), sky }
}

/// Whether the scene has BLEND surfaces, which stop rays by chance.
pub fn has_blend(world: &World) -> bool {
    world.scene.materials.iter().any(|m| m.alpha_mode == AlphaMode::Blend)
}

/// The points that `samples` rays through the centre of pixel `index` hit, each weighted by its share of the rays; and
/// the radiance of the sky × the share of rays that leave the scene.
pub fn see_pixel(
    world: &World,
    camera: &Camera,
    width: u32,
    height: u32,
    index: u32,
    samples: u32,
    random: &mut Random,
) -> (Vec<ImagePoint>, Vec3) {
    let (origin, direction) = camera.pixel_ray(index % width, index / width, width, height);
    let mut points: Vec<ImagePoint> = Vec::with_capacity(1);
    let mut sky = Vec3::ZERO;
    let weight = 1.0 / samples as f32;
    for _ in 0..samples {
        let ray = Ray::new(origin, direction, random.bits());
        let Some(hit) = world.tracer.closest(ray) else {
            sky += world.scene.environment.radiance(direction) * weight;
            continue;
        };
        if let Some(known) = points.iter_mut().find(|p| p.surface.hit == hit) {
            known.weight += weight;
            continue;
        }
        let surface = world.surface_at(hit, direction);
        let normal = world.bent_normal(&surface);
        let (irradiance_direct, _) = world.punctual_irradiance(&surface, normal, random.bits());
        let geometric = surface.geometric_normal;
        let (position, facing) = (surface.position, Facing::of(geometric));
        let query = QueryPoint { position, normal, geometric, facing, view: -direction };
        points.push(ImagePoint { pixel: index, weight, surface, query, depth: hit.t, irradiance_direct });
    }
    (points, sky)
}

impl World<'_> {
    /// The shading normal after the normal map, on the viewer's side. If the map would turn it away from the viewer's
    /// side, the shading normal without the map.
    fn bent_normal(&self, surface: &SurfacePoint) -> Vec3 {
        let side = if surface.front { 1.0 } else { -1.0 };
        let front_normal = surface.shading_normal * side;
        let hit = &surface.hit;
        let bent = self.scene.normal_mapped(hit.triangle, hit.barycentric, front_normal) * side;
        if bent.dot(surface.geometric_normal) > 0.0 { bent } else { surface.shading_normal }
    }
}

//! Which pixels show corners and which flat parts: where interpolation between probes is hard and where it is easy.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::points::{ImagePoint, View};
use crate::light::World;
use crate::math::sampling::cosine_hemisphere;
use crate::trace::Ray;

/// Rays that decide about a point.
const RAYS: u32 = 64;

/// Of these so many must hit something near for the point to lie in a corner: a quarter.
const CORNER_RAYS: usize = 16;

/// What counts as near, as a share of the scene's diagonal.
const NEAR_SHARE: f32 = 0.02;

/// Where a pixel's surface lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Region {
    /// At least 25 % of 64 fixed cosine-distributed rays hit something within 2 % of the scene's diagonal.
    Corner,
    /// Anywhere else.
    Flat,
}

/// The region of every pixel, row 0 at the top; `None` where it shows no surface. Where a pixel shows several surfaces, the region
/// that most of it shows.
pub fn regions(world: &World, view: &View) -> Vec<Option<Region>> {
    let reach = NEAR_SHARE * world.scene.mesh.bounds().map_or(0.0, |(low, high)| high.distance(low));
    let corners: Vec<bool> = view.points.par_iter().map(|point| is_corner(world, point, reach)).collect();
    // Share of the pixel that lies in corners minus the share that does not.
    let mut balance: Vec<Option<f32>> = vec![None; view.width as usize * view.height as usize];
    for (point, corner) in view.points.iter().zip(corners) {
        let share = if corner { point.weight } else { -point.weight };
        *balance[point.pixel as usize].get_or_insert(0.0) += share;
    }
    let region = |b: f32| if b > 0.0 { Region::Corner } else { Region::Flat };
    balance.into_iter().map(|b| b.map(region)).collect()
}

/// Around the geometric normal: the question is about shapes, not about shading.
fn is_corner(world: &World, point: &ImagePoint, reach: f32) -> bool {
    let origin = point.surface.ray_origin();
    let near = |i: &u32| {
        let direction: Vec3 = cosine_hemisphere(point.surface.geometric_normal, hammersley(*i, RAYS));
        world.tracer.occluded(Ray { t_max: reach, ..Ray::new(origin, direction, point.pixel) })
    };
    (0..RAYS).filter(near).count() >= CORNER_RAYS
}

/// Point `i` of the Hammersley set of `count` points in the unit square (J. M. Hammersley 1960), its first coordinate
/// shifted to the middle of the strata.
fn hammersley(i: u32, count: u32) -> Vec2 {
    // 2⁻³² times the reversed bits: the radical inverse in base 2.
    let inverse = f64::from(i.reverse_bits()) / (1u64 << 32) as f64;
    Vec2::new((i as f32 + 0.5) / count as f32, inverse as f32)
}

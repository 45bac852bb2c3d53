//! Division of a picture's pixels into corners and flat parts. Interpolation between probes is harder in corners.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::points::{ImagePoint, View};
use crate::light::World;
use crate::math::sampling::cosine_hemisphere;
use crate::trace::Ray;

/// Number of rays from a point that decide whether it lies in a corner.
const RAYS: u32 = 64;

/// A point lies in a corner if at least this many of its rays hit a near surface. It is a quarter of [`RAYS`].
const CORNER_RAYS: usize = 16;

/// Distance within which a surface is near, as a share of the scene's diagonal.
const NEAR_SHARE: f32 = 0.02;

/// The region of a pixel's surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Region {
    /// At least 25 % of 64 fixed cosine-distributed rays hit something within 2 % of the scene's diagonal.
    Corner,
    /// All other surfaces.
    Flat,
}

/// The region of every pixel, row 0 at the top. `None` for pixels without a surface. A pixel with several surfaces gets
/// the region of the larger share.
pub fn regions(world: &World, view: &View) -> Vec<Option<Region>> {
    let reach = NEAR_SHARE * world.scene.mesh.bounds().map_or(0.0, |(low, high)| high.distance(low));
    let corners: Vec<bool> = view.points.par_iter().map(|point| is_corner(world, point, reach)).collect();
    // Per pixel the share in corners minus the share in flat parts.
    let mut balance: Vec<Option<f32>> = vec![None; view.width as usize * view.height as usize];
    for (point, corner) in view.points.iter().zip(corners) {
        let share = if corner { point.weight } else { -point.weight };
        *balance[point.pixel as usize].get_or_insert(0.0) += share;
    }
    let region = |b: f32| if b > 0.0 { Region::Corner } else { Region::Flat };
    balance.into_iter().map(|b| b.map(region)).collect()
}

/// Whether a point lies in a corner. The rays are distributed about the geometric normal, because a corner is a
/// property of the shape and not of the shading.
fn is_corner(world: &World, point: &ImagePoint, reach: f32) -> bool {
    let origin = point.surface.ray_origin();
    let near = |i: &u32| {
        let direction: Vec3 = cosine_hemisphere(point.surface.geometric_normal, hammersley(*i, RAYS));
        world.tracer.occluded(Ray { t_max: reach, ..Ray::new(origin, direction, point.pixel) })
    };
    (0..RAYS).filter(near).count() >= CORNER_RAYS
}

/// Point `i` of the Hammersley set of `count` points in the unit square (J. M. Hammersley 1960). Its first coordinate
/// is shifted to the middle of its stratum.
fn hammersley(i: u32, count: u32) -> Vec2 {
    // The radical inverse in base 2 is 2⁻³² × the reversed bits.
    let inverse = f64::from(i.reverse_bits()) / (1u64 << 32) as f64;
    Vec2::new((i as f32 + 0.5) / count as f32, inverse as f32)
}

//! The sides of triangles that a scene shades: both of double-sided ones, of others the front. Points on them, uniform by
//! area.

use glam::{Vec2, Vec3};

use super::World;
use super::surface::SurfacePoint;
use crate::math::random::unit_from_bits;
use crate::math::sampling::triangle_barycentric;
use crate::scene::{Scene, TriangleIndex};
use crate::trace::{Hit, Ray};

/// A surface is looked at from this many of its ray offsets away, to find out whether it is seen where it is drawn.
const NEAR: f32 = 4.0;

/// All sides of a scene.
pub struct Sides<'s> {
    scene: &'s Scene,
    /// Area up to each triangle and with it, m².
    areas: Vec<f64>,
}

/// A place on a side.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    triangle: TriangleIndex,
    barycentric: Vec2,
    is_back: bool,
}

impl<'s> Sides<'s> {
    /// `None` where they have no area.
    pub fn of(scene: &'s Scene) -> Option<Sides<'s>> {
        let mut area = 0.0;
        let upto = |t| {
            let triangle = TriangleIndex(t);
            area += sides(scene, triangle) * f64::from(scene.mesh.area(triangle));
            area
        };
        let areas: Vec<f64> = (0..scene.mesh.triangles.len() as u32).map(upto).collect();
        (area > 0.0 && area.is_finite()).then_some(Sides { scene, areas })
    }

    /// The place of four numbers, each uniform over all 32-bit words.
    pub fn place(&self, [along, u, v, side]: [u32; 4]) -> Place {
        let area = self.areas.last().copied().unwrap_or(0.0);
        let wanted = f64::from(along) * (area / 2f64.powi(32));
        let triangle = self.areas.partition_point(|&upto| upto <= wanted).min(self.areas.len() - 1);
        let triangle = TriangleIndex(triangle as u32);
        let is_back = sides(self.scene, triangle) > 1.0 && side >> 31 == 1;
        let barycentric = triangle_barycentric(Vec2::new(unit_from_bits(u), unit_from_bits(v)));
        Place { triangle, barycentric, is_back }
    }
}

fn sides(scene: &Scene, triangle: TriangleIndex) -> f64 {
    if scene.material(triangle).double_sided { 2.0 } else { 1.0 }
}

impl World<'_> {
    /// The surface point of a place. Its normals lie on the side that is meant.
    pub fn point_at(&self, place: &Place) -> SurfacePoint {
        let hit = Hit { t: 0.0, triangle: place.triangle, barycentric: place.barycentric };
        self.surface_at(hit, -self.outwards(place))
    }

    /// Whether the point of a place is what is seen from just outside. Another surface in the same plane, or one that cuts
    /// through there, may be it; or nothing, where the surface lets rays pass. `salt` is of the ray, drawn where there is
    /// one.
    pub fn is_seen(&self, place: &Place, point: &SurfacePoint, salt: impl FnOnce() -> u32) -> bool {
        if self.scene.opacity(place.triangle, place.barycentric) <= 0.0 {
            return false;
        }
        let outwards = self.outwards(place);
        let near = point.position + outwards * (NEAR * point.ray_offset);
        let seen = self.tracer.closest(Ray::new(near, -outwards, salt()));
        seen.is_some_and(|seen| seen.triangle == place.triangle)
    }

    fn outwards(&self, place: &Place) -> Vec3 {
        let front = self.scene.mesh.geometric_normal(place.triangle);
        if place.is_back { -front } else { front }
    }
}

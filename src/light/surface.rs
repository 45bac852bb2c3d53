//! A point on a surface, as the ray sees it that found it.

use glam::Vec3;

use super::World;
use crate::scene::{Scene, TriangleIndex};
use crate::trace::offset::ray_offset;
use crate::trace::{Hit, Ray};

/// Everything that shading at a hit needs. Normals are turned towards the ray's origin.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    pub position: Vec3,
    /// Unit, towards the viewer.
    pub geometric_normal: Vec3,
    /// Unit, interpolated from the vertices, on the same side as the geometric normal.
    pub shading_normal: Vec3,
    /// Whether the ray met the front.
    pub front: bool,
    pub double_sided: bool,
    /// Diffuse albedo, at most [`World::albedo_max`].
    pub albedo: Vec3,
    /// Radiance that this side emits, W·m⁻²·sr⁻¹.
    pub emission: Vec3,
    /// Rays leave from this far off the surface, metres.
    pub ray_offset: f32,
    pub hit: Hit,
}

impl SurfacePoint {
    /// Where rays that leave on the viewer's side start.
    pub fn ray_origin(&self) -> Vec3 {
        self.position + self.geometric_normal * self.ray_offset
    }

    /// Whether the ray met the back of a surface that has one: a sign of being inside geometry.
    pub fn is_back(&self) -> bool {
        !self.front && !self.double_sided
    }
}

impl World<'_> {
    /// The surface that `ray` meets.
    pub fn surface(&self, ray: Ray) -> Option<SurfacePoint> {
        self.tracer.closest(ray).map(|hit| self.surface_at(hit, ray.direction))
    }

    /// The surface of a hit found along `direction`.
    pub fn surface_at(&self, hit: Hit, direction: Vec3) -> SurfacePoint {
        let scene = self.scene;
        let (triangle, barycentric) = (hit.triangle, hit.barycentric);
        let corners = scene.mesh.corners(triangle);
        let outward = scene.mesh.geometric_normal(triangle);
        let front = outward.dot(direction) <= 0.0;
        let geometric_normal = if front { outward } else { -outward };
        let material = scene.material(triangle);
        SurfacePoint {
            position: scene.mesh.interpolate(&scene.mesh.positions, triangle, barycentric),
            geometric_normal,
            shading_normal: shading_normal(scene, &hit, geometric_normal),
            front,
            double_sided: material.double_sided,
            albedo: scene.albedo(triangle, barycentric).min(Vec3::splat(self.albedo_max)),
            emission: if emits(scene, triangle, front) { scene.emission(triangle, barycentric) } else { Vec3::ZERO },
            ray_offset: ray_offset(&corners),
            hit,
        }
    }
}

/// Whether this side of a triangle emits what its material emits.
pub fn emits(scene: &Scene, triangle: TriangleIndex, front: bool) -> bool {
    front || scene.material(triangle).double_sided
}

/// The interpolated vertex normal on the viewer's side, the geometric one where there is none.
fn shading_normal(scene: &Scene, hit: &Hit, geometric_normal: Vec3) -> Vec3 {
    let normal = scene.mesh.interpolate(&scene.mesh.normals, hit.triangle, hit.barycentric);
    let normal = normal.normalize_or(geometric_normal);
    if normal.dot(geometric_normal) < 0.0 { -normal } else { normal }
}

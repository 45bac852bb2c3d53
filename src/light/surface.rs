//! Points on surfaces: all that shading needs at the hit of a ray.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::World;
use super::emitters::receiver::Receiver;
use crate::math::sampling::uniform_sphere;
use crate::scene::{Scene, TriangleIndex};
use crate::trace::offset::ray_offset;
use crate::trace::{Hit, Ray};

/// How far relief bends normals at most: by asin 0.6 = 37°.
const BEND: f32 = 0.6;

/// All data that shading at a hit needs. Normals lie on the side of the ray's origin, which is the viewer's side.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    pub position: Vec3,
    /// Unit, on the viewer's side.
    pub geometric_normal: Vec3,
    /// Unit, interpolated from the vertices, on the same side as the geometric normal.
    pub shading_normal: Vec3,
    /// Whether the ray hit the front.
    pub front: bool,
    pub double_sided: bool,
    /// Diffuse albedo, at most [`World::albedo_max`].
    pub albedo: Vec3,
    /// Radiance that the viewer's side emits, W·m⁻²·sr⁻¹.
    pub emission: Vec3,
    /// Distance from the surface at which rays that leave it start, metres.
    pub ray_offset: f32,
    pub hit: Hit,
}

impl SurfacePoint {
    /// A point in free space. It receives light like a point of a white surface with unit normal `normal`.
    pub fn in_space(position: Vec3, normal: Vec3) -> SurfacePoint {
        SurfacePoint {
            position,
            geometric_normal: normal,
            shading_normal: normal,
            front: true,
            double_sided: false,
            albedo: Vec3::ONE,
            emission: Vec3::ZERO,
            ray_offset: 0.0,
            hit: Hit { t: 0.0, triangle: TriangleIndex(u32::MAX), barycentric: Vec2::ZERO },
        }
    }

    /// A normal as relief bends it: n + [`BEND`]·u, u on the unit sphere, from two numbers uniform in [0,1); `None` where that
    /// points below the surface.
    pub fn bent(&self, numbers: Vec2) -> Option<Vec3> {
        let bent = (self.shading_normal + BEND * uniform_sphere(numbers)).normalize_or(self.shading_normal);
        (bent.dot(self.geometric_normal) > 0.0).then_some(bent)
    }

    /// Start of rays that leave the surface on the viewer's side.
    pub fn ray_origin(&self) -> Vec3 {
        self.position + self.geometric_normal * self.ray_offset
    }

    /// The point as a receiver of light, with this shading normal.
    pub fn receiver(&self, normal: Vec3) -> Receiver {
        Receiver { position: self.ray_origin(), normal, geometric_normal: self.geometric_normal }
    }

    /// Whether the ray hit the back of a surface that is not double-sided. Such a hit suggests that the ray's origin
    /// lies inside geometry.
    pub fn is_back(&self) -> bool {
        !self.front && !self.double_sided
    }
}

/// The shading data of a triangle in one cache line. Hits are scattered over the scene, and reading each vertex from
/// its own place took as long as Embree's search for the hit.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct TriangleRecord {
    corner: Vec3,
    edges: [Vec3; 2],
    /// Unit normal of the front.
    normal: Vec3,
    ray_offset: f32,
    /// Whether the vertex normals differ from the geometric normal.
    smooth: bool,
    emits: bool,
    double_sided: bool,
    /// Index into [`SurfaceTable::constants`].
    material: u32,
}

/// Properties that are constant over a material. `None` if a texture or vertex colours change them.
#[derive(Debug, Clone, Copy)]
struct MaterialConstants {
    albedo: Option<Vec3>,
    emission: Option<Vec3>,
}

/// Shading data of all triangles.
#[derive(Debug)]
pub struct SurfaceTable {
    triangles: Vec<TriangleRecord>,
    constants: Vec<MaterialConstants>,
}

/// A triangle is flat if its vertex normals are within this angle (radians) of the geometric normal. The angle allows
/// for f32 rounding.
const FLAT_ANGLE: f32 = 1e-5;

impl SurfaceTable {
    pub fn new(scene: &Scene) -> SurfaceTable {
        let constants = scene.materials.iter().enumerate().map(|(m, material)| {
            let uniform = material.base_color_texture.is_none() && scene.mesh.colors.is_empty();
            let any = || scene.mesh.materials.iter().position(|t| t.0 as usize == m);
            let triangle = any().map(|t| TriangleIndex(t as u32));
            let albedo = uniform && (material.unlit || material.metallic_roughness_texture.is_none());
            let emission = if material.unlit { uniform } else { material.emission_texture.is_none() };
            MaterialConstants {
                albedo: triangle.filter(|_| albedo).map(|t| scene.albedo(t, Vec2::ZERO)),
                emission: triangle.filter(|_| emission).map(|t| scene.uncovered_emission(t, Vec2::ZERO)),
            }
        });
        let constants: Vec<MaterialConstants> = constants.collect();
        let record = |t: u32| {
            let triangle = TriangleIndex(t);
            let corners = scene.mesh.corners(triangle);
            let normal = scene.mesh.geometric_normal(triangle);
            let vertices = scene.mesh.triangles[t as usize].map(|v| scene.mesh.normals[v as usize]);
            let flat = vertices.iter().all(|n| n.distance(normal) <= FLAT_ANGLE || *n == Vec3::ZERO);
            let material = scene.material(triangle);
            let index = scene.mesh.materials[t as usize].0;
            TriangleRecord {
                corner: corners[0],
                edges: [corners[1] - corners[0], corners[2] - corners[0]],
                normal,
                ray_offset: ray_offset(&corners),
                smooth: !flat,
                emits: constants[index as usize].emission != Some(Vec3::ZERO),
                double_sided: material.double_sided,
                material: index,
            }
        };
        let triangles = (0..scene.mesh.triangles.len() as u32).into_par_iter().map(record).collect();
        SurfaceTable { triangles, constants }
    }
}

impl World<'_> {
    /// The surface that `ray` hits first.
    #[inline]
    pub fn surface(&self, ray: Ray) -> Option<SurfacePoint> {
        self.tracer.closest(ray).map(|hit| self.surface_at(hit, ray.direction))
    }

    /// The surface at a hit of a ray along `direction`.
    #[inline]
    pub fn surface_at(&self, hit: Hit, direction: Vec3) -> SurfacePoint {
        let record = &self.surfaces.triangles[hit.triangle.0 as usize];
        let front = record.normal.dot(direction) <= 0.0;
        let geometric_normal = if front { record.normal } else { -record.normal };
        let albedo = match self.surfaces.constants[record.material as usize].albedo {
            Some(albedo) => albedo,
            None => self.scene.albedo(hit.triangle, hit.barycentric),
        };
        SurfacePoint {
            position: record.corner + record.edges[0] * hit.barycentric.x + record.edges[1] * hit.barycentric.y,
            geometric_normal,
            shading_normal: if record.smooth {
                shading_normal(self.scene, &hit, geometric_normal)
            } else {
                geometric_normal
            },
            front,
            double_sided: record.double_sided,
            albedo: albedo.min(Vec3::splat(self.albedo_max)),
            emission: self.emission_at(&hit, front),
            ray_offset: record.ray_offset,
            hit,
        }
    }

    /// Radiance that the front (`front`) or back of a surface emits at a hit, W·m⁻²·sr⁻¹.
    #[inline]
    fn emission_at(&self, hit: &Hit, front: bool) -> Vec3 {
        let record = &self.surfaces.triangles[hit.triangle.0 as usize];
        if !record.emits || !(front || record.double_sided) {
            return Vec3::ZERO;
        }
        match self.surfaces.constants[record.material as usize].emission {
            Some(emission) => emission,
            // Where something lies in front, rays have passed already or do not come here.
            None => self.scene.uncovered_emission(hit.triangle, hit.barycentric),
        }
    }

    /// Radiance that a hit of a ray along `direction` emits towards the ray's origin, W·m⁻²·sr⁻¹.
    #[inline]
    pub fn emission_towards(&self, hit: &Hit, direction: Vec3) -> Vec3 {
        let record = &self.surfaces.triangles[hit.triangle.0 as usize];
        if !record.emits {
            return Vec3::ZERO;
        }
        self.emission_at(hit, record.normal.dot(direction) <= 0.0)
    }
}

/// The interpolated vertex normal on the viewer's side, or the geometric normal if the vertices have none.
fn shading_normal(scene: &Scene, hit: &Hit, geometric_normal: Vec3) -> Vec3 {
    let normal = scene.mesh.interpolate(&scene.mesh.normals, hit.triangle, hit.barycentric);
    let normal = normal.normalize_or(geometric_normal);
    if normal.dot(geometric_normal) < 0.0 { -normal } else { normal }
}

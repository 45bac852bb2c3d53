//! All triangles of a scene, with one list of vertices.

use std::ops::{Add, Mul};

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{Covers, MaterialIndex};

/// Index of a triangle in [`Mesh::triangles`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TriangleIndex(pub u32);

/// World-space triangles relative to [`super::Scene::origin_world`]. Each instance has its own copy of the triangles.
///
/// The winding is counter-clockwise as seen from the front, also for instances whose transform mirrors.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Metres, one per vertex.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one per vertex. A normal that is missing or degenerate in the file is zero here; the
    /// geometric normal then takes its place.
    pub normals: Vec<Vec3>,
    /// TEXCOORD_0 and TEXCOORD_1, one per vertex, or zero if the file has none.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colours, one per vertex. Empty if no mesh of the scene has colours.
    pub colors: Vec<Vec4>,
    /// Unit tangents (xyz) and handedness (w), one per vertex. Empty if no mesh has tangents; zero for vertices
    /// without.
    pub tangents: Vec<Vec4>,
    /// Vertex indices, opaque triangles first.
    pub triangles: Vec<[u32; 3]>,
    /// One per triangle.
    pub materials: Vec<MaterialIndex>,
    /// Number of triangles that stop every ray that hits them. They come first. The others need an alpha test or lie
    /// in [`Mesh::covers`].
    pub opaque_count: usize,
    /// Parts of triangles that rays pass, because an emitter or its surroundings lie in front in the same plane.
    pub covers: Covers,
}

impl Mesh {
    /// Positions of a triangle's vertices.
    pub fn corners(&self, triangle: TriangleIndex) -> [Vec3; 3] {
        self.triangles[triangle.0 as usize].map(|v| self.positions[v as usize])
    }

    /// Vertex attribute at barycentric coordinates (weights of the second and third vertex).
    pub fn interpolate<T>(&self, attribute: &[T], triangle: TriangleIndex, barycentric: Vec2) -> T
    where
        T: Copy + Add<Output = T> + Mul<f32, Output = T>,
    {
        let [a, b, c] = self.triangles[triangle.0 as usize].map(|v| attribute[v as usize]);
        a * (1.0 - barycentric.x - barycentric.y) + b * barycentric.x + c * barycentric.y
    }

    /// Unit normal of the front side.
    pub fn geometric_normal(&self, triangle: TriangleIndex) -> Vec3 {
        let [a, b, c] = self.corners(triangle).map(|p| p.as_dvec3());
        // f64 is needed: for triangles 10⁴ times as long as wide an f32 cross product has few correct digits.
        (b - a).cross(c - a).normalize_or_zero().as_vec3()
    }

    /// Area in m².
    pub fn area(&self, triangle: TriangleIndex) -> f32 {
        let [a, b, c] = self.corners(triangle).map(|p| p.as_dvec3());
        (0.5 * (b - a).cross(c - a).length()) as f32
    }

    /// Smallest box around all vertices that triangles use. `None` without triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let first = self.positions[*self.triangles.first()?.first()? as usize];
        let of_triangle = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
            (a.min(b).min(c), a.max(b).max(c))
        };
        let join = |a: (Vec3, Vec3), b: (Vec3, Vec3)| (a.0.min(b.0), a.1.max(b.1));
        Some(self.triangles.par_iter().map(of_triangle).reduce(|| (first, first), join))
    }
}

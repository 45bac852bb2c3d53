//! All triangles of a scene in one vertex pool.

use std::ops::{Add, Mul};

use glam::{Vec2, Vec3, Vec4};

use super::MaterialIndex;

/// Index of a triangle in [`Mesh::triangles`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TriangleIndex(pub u32);

/// World-space triangles relative to [`super::Scene::origin_world`]; instances are written out.
///
/// Winding: counter-clockwise seen from the front, also under mirroring transforms.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Metres, one per vertex.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one per vertex; zero where the file gave none or a degenerate one (use the geometric normal).
    pub normals: Vec<Vec3>,
    /// TEXCOORD_0 and TEXCOORD_1, one per vertex; zero where the file gave none.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colours, one per vertex, or empty when no mesh of the scene has any.
    pub colors: Vec<Vec4>,
    /// Unit tangents (xyz) and handedness (w), one per vertex, or empty when no mesh has any; zero where absent.
    pub tangents: Vec<Vec4>,
    /// Vertex indices, opaque triangles first.
    pub triangles: Vec<[u32; 3]>,
    /// One per triangle.
    pub materials: Vec<MaterialIndex>,
    /// The first so many triangles have [`super::AlphaMode::Opaque`] materials; the rest need an alpha test.
    pub opaque_count: usize,
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
        // In f64, because slivers of 10⁴:1 leave an f32 cross product few digits.
        (b - a).cross(c - a).normalize_or_zero().as_vec3()
    }

    /// Area in m².
    pub fn area(&self, triangle: TriangleIndex) -> f32 {
        let [a, b, c] = self.corners(triangle).map(|p| p.as_dvec3());
        (0.5 * (b - a).cross(c - a).length()) as f32
    }

    /// Smallest box around all vertices that triangles use, `None` without triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let mut vertices = self.triangles.iter().flatten().map(|&v| self.positions[v as usize]);
        let first = vertices.next()?;
        Some(vertices.fold((first, first), |(low, high), p| (low.min(p), high.max(p))))
    }
}

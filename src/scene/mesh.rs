//! All triangles of a scene in one vertex pool.

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

//! The scene: triangles, materials, lights, cameras and the sky, in world space. The loader validates it once.
//!
//! Positions are f32 and relative to [`Scene::origin_world`], an f64 point in the middle of the scene. So a scene that
//! stands 10⁶ m from the world's origin keeps its millimetres.

pub mod camera;
mod cover;
pub mod environment;
mod error;
pub mod light;
mod load;
mod lookup;
pub mod material;
pub mod mesh;
mod metal;
mod options;
pub mod range;
mod texture;

pub use camera::Camera;
pub use cover::{Cover, Covers};
pub use environment::Environment;
pub use error::SceneError;
pub use light::{LightKind, PunctualLight};
pub use load::load;
pub use material::{AlphaMode, Material, MaterialIndex, Texels, Texture, TextureIndex, TextureRef, Wrap};
pub use mesh::{Mesh, TriangleIndex};
pub use options::{Detail, EnvironmentSource, EnvironmentSourceError, LoadOptions, Unassigned};

use std::path::PathBuf;

use glam::DVec3;

/// A loaded scene. It does not change after loading. Every index in it is in range, and every number is finite.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Name of the scene file without folder and extension.
    pub name: String,
    /// World-space point to which all positions are relative, metres.
    pub origin_world: DVec3,
    pub mesh: Mesh,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    /// Memory that images do not take because all of their texels are equal, bytes.
    pub collapsed_bytes: u64,
    pub lights: Vec<PunctualLight>,
    pub cameras: Vec<Camera>,
    pub environment: Environment,
    /// The material that meshes without one have. `None` if all meshes have one.
    pub unassigned: Option<Unassigned>,
    /// BLAKE3 over all input bytes that light depends on, in the order of reading: scene file, buffers, images and
    /// environment map.
    pub blake3: String,
    /// The same over the image files that only pictures show: normal maps, and what only gloss needs. `None` if no such
    /// file was read.
    pub pictures_blake3: Option<String>,
    /// The files that were read.
    pub files: Vec<PathBuf>,
    /// One sentence for each thing that the loader left out or replaced.
    pub warnings: Vec<String>,
    pub dropped: DroppedTriangles,
    /// Number of lights, emissive materials and sky texels that are brighter than [`light::LIGHT_MAX`], and clamped to it.
    pub light_clamped: u64,
}

/// Numbers of triangles that the loader dropped because rays cannot hit them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DroppedTriangles {
    /// Triangles with a vertex that is NaN or infinite.
    pub non_finite: u64,
    /// Triangles without area: their vertices coincide or lie on a line.
    pub zero_area: u64,
}

impl Scene {
    /// Whether nothing sends out light.
    pub fn is_dark(&self) -> bool {
        self.lights.is_empty() && self.environment.is_black() && !self.materials.iter().any(Material::emits)
    }
}

impl DroppedTriangles {
    pub fn total(&self) -> u64 {
        self.non_finite + self.zero_area
    }
}

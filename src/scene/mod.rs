//! What is lit: triangles, materials, lights, cameras and the sky, in world space, validated once.
//!
//! Everything is recentred: positions are f32 relative to [`Scene::origin_world`], an f64 point, so that a scene
//! that lies 10⁶ m from the origin keeps its millimetres.

pub mod camera;
pub mod environment;
mod error;
pub mod light;
mod load;
mod lookup;
pub mod material;
pub mod mesh;
mod options;
mod texture;

pub use camera::Camera;
pub use environment::Environment;
pub use error::SceneError;
pub use light::{LightKind, PunctualLight};
pub use load::load;
pub use material::{AlphaMode, Material, MaterialIndex, Texels, Texture, TextureIndex, TextureRef, Wrap};
pub use mesh::{Mesh, TriangleIndex};
pub use options::{EnvironmentSource, EnvironmentSourceError, LoadOptions};

use std::path::PathBuf;

use glam::DVec3;

/// A loaded scene. Immutable after loading; every index in it is in range and every number finite.
#[derive(Debug, Clone)]
pub struct Scene {
    /// File stem of the scene file.
    pub name: String,
    /// World-space point that every position here is relative to, metres.
    pub origin_world: DVec3,
    pub mesh: Mesh,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub lights: Vec<PunctualLight>,
    pub cameras: Vec<Camera>,
    pub environment: Environment,
    /// BLAKE3 of every input byte: scene file, buffers, images and environment map, in the order of reading.
    pub blake3: String,
    /// The files that were read, in that order.
    pub files: Vec<PathBuf>,
    /// What the loader left out or replaced, one sentence each.
    pub warnings: Vec<String>,
    pub dropped: DroppedTriangles,
}

/// Triangles that the loader dropped because nothing can be traced against them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DroppedTriangles {
    /// A vertex is NaN or infinite.
    pub non_finite: u64,
    /// No area: vertices coincide or lie on a line.
    pub zero_area: u64,
}

impl DroppedTriangles {
    pub fn total(&self) -> u64 {
        self.non_finite + self.zero_area
    }
}

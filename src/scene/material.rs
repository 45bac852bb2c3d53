//! Metallic-roughness materials and their textures.

use glam::{Mat3, Vec2, Vec3, Vec4};

/// Index into [`super::Scene::materials`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MaterialIndex(pub u32);

/// Index into [`super::Scene::textures`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TextureIndex(pub u32);

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AlphaMode {
    Opaque,
    /// Rays pass where alpha is below `cutoff`.
    Mask {
        cutoff: f32,
    },
    /// Rays pass with probability 1 − alpha.
    Blend,
}

#[derive(Debug, Clone)]
pub struct Material {
    pub name: String,
    /// Linear factor on base colour texture and vertex colour, with alpha in `w`.
    pub base_color: Vec4,
    pub base_color_texture: Option<TextureRef>,
    pub metallic: f32,
    pub roughness: f32,
    /// Roughness in G, metallic in B.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Radiance factor, W·m⁻²·sr⁻¹: `emissiveFactor` × `KHR_materials_emissive_strength`.
    pub emission: Vec3,
    pub emission_texture: Option<TextureRef>,
    pub normal_texture: Option<TextureRef>,
    pub normal_scale: f32,
    pub alpha_mode: AlphaMode,
    pub double_sided: bool,
    /// The surface emits its base colour as radiance and reflects nothing (`KHR_materials_unlit`).
    pub unlit: bool,
}

impl Material {
    /// Whether the factors allow any emission. Textures may still be black.
    pub fn emits(&self) -> bool {
        self.unlit || self.emission != Vec3::ZERO
    }

    /// The texture slots with the names that they have in glTF.
    pub fn textures(&self) -> [(&'static str, Option<TextureRef>); 4] {
        [
            ("baseColorTexture", self.base_color_texture),
            ("metallicRoughnessTexture", self.metallic_roughness_texture),
            ("emissiveTexture", self.emission_texture),
            ("normalTexture", self.normal_texture),
        ]
    }
}

/// A texture as one material slot uses it.
#[derive(Debug, Clone, Copy)]
pub struct TextureRef {
    pub texture: TextureIndex,
    /// Index of the texture coordinates in [`super::Mesh::uvs`], 0 or 1.
    pub uv_set: usize,
    /// `KHR_texture_transform`: uv′ = (transform · (u, v, 1)).xy.
    pub texture_from_uv: Mat3,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Wrap {
    Repeat,
    MirroredRepeat,
    ClampToEdge,
}

/// A decoded image with its sampler. As in glTF, row 0 is the top row and uv (0, 0) is the top-left corner.
#[derive(Debug, Clone)]
pub struct Texture {
    pub width: u32,
    pub height: u32,
    pub wrap: [Wrap; 2],
    /// Whether the sampler asked for NEAREST magnification.
    pub nearest: bool,
    pub texels: Texels,
}

#[derive(Debug, Clone)]
pub enum Texels {
    /// RGBA, 8 bits each. RGB is sRGB-encoded if `srgb` is true; alpha is always linear.
    Rgba8 { data: Vec<[u8; 4]>, srgb: bool },
    /// RGBA from 16-bit images, decoded to linear.
    Rgba32F(Vec<Vec4>),
}

impl TextureRef {
    pub fn transform(&self, uv: Vec2) -> Vec2 {
        self.texture_from_uv.transform_point2(uv)
    }
}

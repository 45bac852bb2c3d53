//! A material's reference to a texture: coordinate set and `KHR_texture_transform`.

use glam::{Mat3, Vec2, Vec3};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::NormalTexture;
use gltf::json::texture::Info;
use gltf::json::{Index, Texture as Definition};
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::document::Document;
use super::textures::Textures;
use crate::scene::TextureRef;
use crate::scene::error::{RE_EXPORT, SceneError};

/// A texture slot of a material, as it stands in the file.
pub(super) struct Slot {
    texture: Index<Definition>,
    tex_coord: u32,
    transform: Option<TextureTransform>,
}

impl From<&Info> for Slot {
    fn from(info: &Info) -> Slot {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
        Slot { texture: info.index, tex_coord: info.tex_coord, transform }
    }
}

impl Slot {
    /// The slot of a normal texture with its scale. Its transform is parsed here, because `gltf::json` does not parse it.
    pub fn of_normal(document: &Document, normal: &Value, place: &str) -> Result<(Slot, f32), SceneError> {
        let normal: NormalTexture = parse(document, normal, "normalTexture", place)?;
        let extension = normal.extensions.as_ref().and_then(|e| e.others.get("KHR_texture_transform"));
        let transform = extension.map(|e| parse(document, e, "normalTexture", place)).transpose()?;
        Ok((Slot { texture: normal.index, tex_coord: normal.tex_coord, transform }, normal.scale))
    }

    /// Loads the texture. `place` names material and slot in messages.
    pub fn load(
        self,
        document: &Document,
        textures: &mut Textures,
        srgb: bool,
        place: &str,
    ) -> Result<TextureRef, SceneError> {
        let set = self.transform.as_ref().and_then(|t| t.tex_coord).unwrap_or(self.tex_coord);
        if set > 1 {
            let what = format!("it uses TEXCOORD_{set}, but only sets 0 and 1 are read");
            return Err(document.invalid(place, what, "move the coordinates to TEXCOORD_0 or TEXCOORD_1"));
        }
        let texture_from_uv = self.transform.as_ref().map_or(Mat3::IDENTITY, matrix);
        if !texture_from_uv.is_finite() {
            return Err(document.invalid(place, "its KHR_texture_transform is not finite", RE_EXPORT));
        }
        Ok(TextureRef { texture: textures.load(self.texture, srgb, place)?, uv_set: set as usize, texture_from_uv })
    }
}

/// The texture slot under `key` of a material, of its parameters or of an extension.
pub(super) fn slot(document: &Document, object: &Value, key: &str, place: &str) -> Result<Option<Slot>, SceneError> {
    let info = object.get(key).map(|value| parse::<Info>(document, value, key, place)).transpose()?;
    Ok(info.as_ref().map(Slot::from))
}

fn parse<T: DeserializeOwned>(document: &Document, value: &Value, key: &str, place: &str) -> Result<T, SceneError> {
    T::deserialize(value).map_err(|e| document.invalid(format!("{place} {key}"), e.to_string(), RE_EXPORT))
}

/// Translation · rotation · scale. The rotation is counter-clockwise as seen with v pointing down: u′ = u·cos + v·sin.
///
/// The extension's text, its example and its viewers agree on this. The GLSL code in its text turns the other way,
/// because GLSL lists matrices column by column.
fn matrix(transform: &TextureTransform) -> Mat3 {
    let (sin, cos) = transform.rotation.0.sin_cos();
    let scale = Vec2::from_array(transform.scale.0);
    let offset = Vec2::from_array(transform.offset.0);
    Mat3::from_cols(Vec3::new(cos, -sin, 0.0) * scale.x, Vec3::new(sin, cos, 0.0) * scale.y, offset.extend(1.0))
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn the_extension_s_own_example() {
        // "the lower left quadrant of the source image, rotated clockwise 90°"
        let json = serde_json::json!({ "offset": [0, 1], "rotation": FRAC_PI_2, "scale": [0.5, 0.5] });
        let transform: TextureTransform = serde_json::from_value(json).expect("valid");
        let at = |u, v| matrix(&transform).transform_point2(Vec2::new(u, v));
        // Corners of the lower left quadrant in texture space: u ∈ [0, ½], v ∈ [½, 1] (v points down).
        for (uv, expected) in [((0.0, 0.0), (0.0, 1.0)), ((1.0, 0.0), (0.0, 0.5)), ((0.0, 1.0), (0.5, 1.0))] {
            assert!(at(uv.0, uv.1).abs_diff_eq(Vec2::new(expected.0, expected.1), 1e-6));
        }
    }
}

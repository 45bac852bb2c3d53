//! The glTF extensions: those that are read, those that may be ignored, and the remedies for all others.

use std::path::Path;

use serde_json::{Map, Value};

use super::text::short;
use crate::scene::error::SceneError;

/// Extensions that the loader implements.
const READ: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Extensions that are ignored with a warning even if the file requires them. Without them the scene keeps its shape,
/// and its diffuse light hardly changes.
const APPROXIMATED: &[&str] = &[
    "KHR_animation_pointer",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_xmp_json_ld",
];

/// Extensions of compressed geometry.
pub(super) const COMPRESSED_GEOMETRY: &[&str] =
    &["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];
/// Extensions of image formats that are not decoded.
pub(super) const COMPRESSED_IMAGES: &[&str] =
    &["KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds"];

/// The advice to a user whose file needs an extension that is not read. `gltf-transform copy` decodes compressed
/// geometry and writes plain data.
pub(super) fn remedy(extension: &str) -> &'static str {
    match extension {
        "KHR_draco_mesh_compression" => "decode it with `gltf-transform copy IN.glb OUT.glb`",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "decode it with `gltf-transform copy IN.glb OUT.glb` or pack again with `gltfpack` without -c"
        }
        "KHR_texture_basisu" => "convert its KTX2 images with `gltf-transform ktxdecompress IN.glb OUT.glb`",
        "EXT_texture_webp" | "EXT_texture_avif" => {
            "convert its images with `gltf-transform png IN.glb OUT.glb --formats \"*\"`"
        }
        "MSFT_texture_dds" => "convert its images to PNG or JPEG",
        _ => "export the scene without it",
    }
}

/// Refuses a file that requires an extension which is neither in [`READ`] nor in [`APPROXIMATED`].
pub(super) fn check_required(
    file: &Path,
    root: &Map<String, Value>,
    warnings: &mut Vec<String>,
) -> Result<(), SceneError> {
    let required = root.get("extensionsRequired").and_then(Value::as_array).into_iter().flatten();
    for extension in required.filter_map(Value::as_str) {
        if APPROXIMATED.contains(&extension) {
            warnings.push(format!("the file requires {extension}, which is not modelled"));
        } else if !READ.contains(&extension) {
            return Err(SceneError::Unsupported {
                file: file.to_owned(),
                place: "extensionsRequired".to_owned(),
                extension: short(extension),
                remedy: remedy(extension),
            });
        }
    }
    Ok(())
}

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
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_roughness",
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
    "KHR_materials_volume_scatter",
    // The nodes themselves are the finest level of detail.
    "MSFT_lod",
    // Cartoon shading over a material that stands for it elsewhere.
    "VRMC_materials_mtoon",
];

/// Extensions that change nothing of what is seen in a scene at rest. They are ignored even if the file requires them.
///
/// Skies, other lights, billboards and Gaussian splats are seen, so they are not in this list.
const UNSEEN: &[&str] = &[
    // Behaviour, and what a pointer can do with a node. Nodes are loaded in the state that the file gives them.
    "KHR_behavior",
    "KHR_interactivity",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "OMI_link",
    "OMI_personality",
    "OMI_seat",
    "OMI_spawn_point",
    // Bodies, their joints and forces, and the shapes that they collide with, which are not drawn.
    "KHR_collision_shapes",
    "KHR_implicit_shapes",
    "KHR_physics_rigid_bodies",
    "OMI_collider",
    "OMI_physics_body",
    "OMI_physics_gravity",
    "OMI_physics_joint",
    "OMI_physics_shape",
    "OMI_vehicle_body",
    "OMI_vehicle_hover_thruster",
    "OMI_vehicle_thruster",
    "OMI_vehicle_wheel",
    "VRMC_springBone",
    // Motion. A scene is loaded in its rest pose.
    "AGI_articulations",
    "KHR_animation_pointer",
    "VRMC_node_constraint",
    "VRMC_vrm_animation",
    // Sound.
    "KHR_audio",
    "KHR_audio_emitter",
    "KHR_audio_graph",
    "MSFT_audio_emitter",
    "OMI_audio_emitter",
    "OMI_audio_ogg_vorbis",
    "OMI_audio_opus",
    // What things are called and mean.
    "AGI_stk_metadata",
    "EXT_feature_metadata",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_structural_metadata",
    "GODOT_single_root",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "VRM",
    "VRMC_vrm",
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
        "EXT_lights_image_based" | "KHR_lights_environment" | "OMI_environment_sky" => {
            "export the scene without it and give its sky with --env"
        }
        _ => "export the scene without it",
    }
}

/// Refuses a file that requires an extension which is in none of the lists [`READ`], [`APPROXIMATED`] and [`UNSEEN`].
pub(super) fn check_required(
    file: &Path,
    root: &Map<String, Value>,
    warnings: &mut Vec<String>,
) -> Result<(), SceneError> {
    let required = root.get("extensionsRequired").and_then(Value::as_array).into_iter().flatten();
    for extension in required.filter_map(Value::as_str) {
        if APPROXIMATED.contains(&extension) {
            warnings.push(format!("the file requires {extension}, which is not modelled"));
        } else if !READ.contains(&extension) && !UNSEEN.contains(&extension) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_extension_is_in_one_list() {
        let lists = [READ, APPROXIMATED, UNSEEN, COMPRESSED_GEOMETRY, COMPRESSED_IMAGES];
        let mut all = lists.concat();
        all.sort_unstable();
        let count = all.len();
        all.dedup();
        assert_eq!(all.len(), count);
    }
}

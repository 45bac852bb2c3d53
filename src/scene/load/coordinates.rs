//! Whether meshes have the texture coordinates that their materials want.

use std::collections::BTreeSet;

use super::draws::Draws;
use super::materials::Materials;
use crate::scene::error::SceneError;

/// Meshes that the warning names.
const NAMED: usize = 3;

/// Warns of primitives without texture coordinates that their material wants: coordinates 0 stand in for them, so a
/// single texel covers the mesh. `constant` tells of every texture whether all its texels are equal, so that no
/// coordinates matter.
///
/// # Errors
/// Coordinates that a texture wants could not be read.
pub(super) fn check(
    draws: &mut Draws,
    materials: &Materials,
    constant: &[bool],
    warnings: &mut Vec<String>,
) -> Result<(), SceneError> {
    let mut meshes = BTreeSet::new();
    let mut named = Vec::new();
    for primitive in &mut draws.primitives {
        let (material, place) = materials.of_primitive(primitive);
        for (slot, texture) in material.textures() {
            let Some(texture) = texture.filter(|t| !constant[t.texture.0 as usize]) else { continue };
            if let Some(fault) = primitive.uv_faults[texture.uv_set].take() {
                return Err(fault);
            }
            if primitive.uvs[texture.uv_set].is_empty() {
                if meshes.insert(primitive.mesh) && named.len() < NAMED {
                    named.push(format!("{} (TEXCOORD_{} for {place} {slot})", primitive.place, texture.uv_set));
                }
                break;
            }
        }
    }
    if !meshes.is_empty() {
        let more = meshes.len() - named.len();
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let count = match meshes.len() {
            1 => "1 mesh lacks".to_owned(),
            n => format!("{n} meshes lack"),
        };
        warnings.push(format!(
            "{count} texture coordinates that a material wants, which count as 0: \
             {}{more}; unwrap and export again",
            named.join(", ")
        ));
    }
    Ok(())
}

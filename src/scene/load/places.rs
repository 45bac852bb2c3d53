//! The places of meshes: skins in the pose of their joints, and GPU instances.

use glam::{DMat3, DVec3};
use gltf::json::{Accessor as AccessorDefinition, Index};
use serde_json::Value;

use super::accessor::Accessor;
use super::buffers::Buffers;
use super::document::Document;
use super::nodes::{Nodes, node_label};
use super::text::label;
use super::transform::{Local, Placement};
use crate::scene::error::{RE_EXPORT, SceneError};

/// Where a primitive is drawn.
pub(super) enum Place {
    Rigid(Placement),
    /// Index of the skin's joint matrices in [`super::draws::Draws::skeletons`].
    Skinned(usize),
}

/// The joint matrices of a skin. They do not contain the transform of the mesh's own node, because in glTF the joints
/// alone place a skinned mesh.
pub(super) fn skeleton(
    document: &Document,
    buffers: &Buffers,
    nodes: &Nodes,
    node: usize,
    skin: Index<gltf::json::Skin>,
) -> Result<Vec<Placement>, SceneError> {
    let definition = document.parse_at(&document.skins, "skin", skin, &node_label(document, node))?;
    let place = label("skin", skin.value(), definition.name.as_deref());
    if definition.joints.is_empty() {
        return Err(document.invalid(place, "it has no joints", RE_EXPORT));
    }
    let inverse_binds = match definition.inverse_bind_matrices {
        None => None,
        Some(index) => {
            let accessor = Accessor::resolve(document, buffers, index, &format!("{place}: inverseBindMatrices"))?;
            accessor.expect_components(document, &[16])?;
            if accessor.count < definition.joints.len() {
                accessor.expect_count(document, definition.joints.len(), "its list of joints")?;
            }
            Some(accessor.floats([0.0; 16], false))
        }
    };
    let mut joints = Vec::with_capacity(definition.joints.len());
    for (number, &joint) in definition.joints.iter().enumerate() {
        document.get(&document.nodes, "node", joint, &place)?;
        let local = match &inverse_binds {
            Some(matrices) => Local::from_matrix(&matrices[number]),
            None => Local { linear: DMat3::IDENTITY, translation: DVec3::ZERO },
        };
        let matrix = nodes.placements[joint.value()].child(&local);
        if !matrix.is_finite() {
            let what = format!("the matrix of joint {number} is not finite");
            return Err(document.invalid(place, what, "correct its inverse bind matrix"));
        }
        joints.push(matrix);
    }
    Ok(joints)
}

/// The places of GPU instances (`EXT_mesh_gpu_instancing`): the node's transform × that of each instance.
pub(super) fn instances(
    document: &Document,
    buffers: &Buffers,
    node_placement: &Placement,
    node: usize,
    extension: &Value,
) -> Result<Vec<Place>, SceneError> {
    let place = format!("{}: EXT_mesh_gpu_instancing", node_label(document, node));
    let attribute = |name: &str, components: usize| -> Result<Option<Accessor>, SceneError> {
        let Some(value) = extension.get("attributes").and_then(|a| a.get(name)) else { return Ok(None) };
        let Some(index) = value.as_u64().and_then(|v| u32::try_from(v).ok()) else {
            return Err(document.invalid(place.clone(), format!("{name} is not an index"), RE_EXPORT));
        };
        let index: Index<AccessorDefinition> = Index::new(index);
        let accessor = Accessor::resolve(document, buffers, index, &format!("{place} {name}"))?;
        accessor.expect_components(document, &[components])?;
        Ok(Some(accessor))
    };
    let translations = attribute("TRANSLATION", 3)?;
    let rotations = attribute("ROTATION", 4)?;
    let scales = attribute("SCALE", 3)?;
    let present = [&translations, &rotations, &scales];
    let Some(count) = present.iter().find_map(|a| a.as_ref().map(|a| a.count)) else {
        return Ok(vec![Place::Rigid(*node_placement)]);
    };
    for accessor in present.into_iter().flatten() {
        accessor.expect_count(document, count, "the first instance attribute")?;
    }
    let translations = translations.map(|a| a.floats([0.0; 3], false));
    let rotations = rotations.map(|a| a.floats([0.0; 4], false));
    let scales = scales.map(|a| a.floats([0.0; 3], false));
    let mut places = Vec::with_capacity(count);
    for i in 0..count {
        let placement = node_placement.child(&Local::from_trs(
            translations.as_ref().map_or([0.0; 3], |t| t[i]),
            rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |r| r[i]),
            scales.as_ref().map_or([1.0; 3], |s| s[i]),
        ));
        if !placement.is_finite() {
            let what = format!("the transform of instance {i} is not finite");
            return Err(document.invalid(place, what, "correct its attributes"));
        }
        places.push(Place::Rigid(placement));
    }
    Ok(places)
}

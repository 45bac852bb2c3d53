//! The trees of nodes: they are checked, placed in the world, and listed in the order of the scene. No function here
//! recurses, so a chain of a million nodes cannot overflow the stack.

use serde_json::Value;

use glam::DMat3;
use gltf::json::Node;

use super::document::Document;
use super::text::label;
use super::transform::{Local, Placement, Turn};
use crate::scene::error::{RE_EXPORT, SceneError};

pub(super) struct Nodes {
    /// World transforms of all nodes of the file. Nodes outside the scene are included, because they can be joints.
    pub placements: Vec<Placement>,
    /// Orthogonal matrix that turns directions of a light or camera on the node into the world, for all nodes of the
    /// file. Scale has no part in it, except that an ancestor of negative scale mirrors.
    ///
    /// `KHR_lights_punctual`: "the rotation of the node orients the light accordingly"; glTF 2.0, section 3.10: a view
    /// follows from the node's transform "with the scaling ignored".
    pub orientations: Vec<DMat3>,
    /// Nodes of the chosen scene, parents before children, without those that are to be ignored.
    pub visible: Vec<usize>,
}

impl Nodes {
    /// Places all nodes and walks the chosen scene.
    pub fn build(document: &Document, scene: Option<usize>, warnings: &mut Vec<String>) -> Result<Nodes, SceneError> {
        let is_child = check_parents(document)?;
        let top: Vec<usize> = (0..document.nodes.len()).filter(|&node| !is_child[node]).collect();
        let (placements, orientations) = place(document, &top)?;
        let roots = scene_roots(document, scene, top, warnings)?;
        Ok(Nodes { placements, orientations, visible: walk(document, &roots, warnings)? })
    }
}

/// The node's text in messages, for example `node 3 'Wall'`.
pub(super) fn node_label(document: &Document, node: usize) -> String {
    label("node", node, document.nodes.get(node).and_then(|n| n.name.as_deref()))
}

fn children(node: &Node) -> impl DoubleEndedIterator<Item = usize> {
    node.children.iter().flatten().map(|child| child.value())
}

/// For each node, whether it is the child of a node. Fails if a child has two parents or does not exist.
fn check_parents(document: &Document) -> Result<Vec<bool>, SceneError> {
    let mut is_child = vec![false; document.nodes.len()];
    for (index, node) in document.nodes.iter().enumerate() {
        for child in children(node) {
            let what = match is_child.get_mut(child) {
                Some(seen) if !*seen => {
                    *seen = true;
                    continue;
                }
                Some(_) => format!("its child {child} has another parent already"),
                None => format!("its child {child} does not exist"),
            };
            return Err(document.invalid(node_label(document, index), what, RE_EXPORT));
        }
    }
    Ok(is_child)
}

/// World transforms and orientations of all nodes. The walk starts at the nodes without parent (`top`). Each node has at most one
/// parent, so the nodes that the walk does not reach lie on or below a cycle.
fn place(document: &Document, top: &[usize]) -> Result<(Vec<Placement>, Vec<DMat3>), SceneError> {
    let mut placements = vec![None; document.nodes.len()];
    let mut orientations = vec![DMat3::IDENTITY; document.nodes.len()];
    let mut stack: Vec<(usize, Placement, DMat3)> =
        top.iter().map(|&node| (node, Placement::IDENTITY, DMat3::IDENTITY)).collect();
    while let Some((index, parent, inherited)) = stack.pop() {
        let node = &document.nodes[index];
        let placement = parent.child(&Local::of_node(node));
        if !placement.is_finite() {
            let what = "its transform is not finite";
            return Err(document.invalid(
                node_label(document, index),
                what,
                "correct its matrix, translation or scale",
            ));
        }
        placements[index] = Some(placement);
        let turn = Turn::of_node(node);
        orientations[index] = inherited * turn.rotation;
        let inherited = inherited * turn.inherited;
        stack.extend(children(node).map(|child| (child, placement, inherited)));
    }
    let cycle = |index: usize| {
        let what = "is its own ancestor";
        document.invalid(node_label(document, index), what, "remove the cycle from the node tree")
    };
    let placements: Result<_, _> =
        placements.into_iter().enumerate().map(|(index, p)| p.ok_or_else(|| cycle(index))).collect();
    Ok((placements?, orientations))
}

fn scene_roots(
    document: &Document,
    wanted: Option<usize>,
    top: Vec<usize>,
    warnings: &mut Vec<String>,
) -> Result<Vec<usize>, SceneError> {
    let chosen = match wanted.or(document.default_scene) {
        Some(index) => index,
        None if document.scenes.is_empty() => return Ok(top),
        None => 0,
    };
    let Some(roots) = document.scenes.get(chosen) else {
        let what = format!("there is no scene {chosen}; the number of scenes is {}", document.scenes.len());
        return Err(document.invalid("scene", what, "name a scene that exists, or export the file again"));
    };
    if document.scenes.len() > 1 {
        warnings.push(format!("the file has {} scenes; only scene {chosen} is loaded", document.scenes.len()));
    }
    if let Some(missing) = roots.iter().find(|&&node| node >= document.nodes.len()) {
        let what = format!("its node {missing} does not exist");
        return Err(document.invalid(format!("scene {chosen}"), what, RE_EXPORT));
    }
    Ok(roots.clone())
}

/// The visible nodes, depth first in the order of the file, each once.
fn walk(document: &Document, roots: &[usize], warnings: &mut Vec<String>) -> Result<Vec<usize>, SceneError> {
    let mut visible = Vec::new();
    let mut seen = vec![false; document.nodes.len()];
    let mut hidden = 0;
    let mut stack: Vec<usize> = roots.iter().rev().copied().collect();
    while let Some(index) = stack.pop() {
        let node = &document.nodes[index];
        if std::mem::replace(&mut seen[index], true) {
            warnings.push(format!("{} is listed in its scene twice; it is loaded once", node_label(document, index)));
        } else if is_ignored(node) {
            hidden += 1;
        } else {
            visible.push(index);
            stack.extend(children(node).rev());
        }
    }
    if hidden > 0 {
        let what = "marked extras.lightprobe = \"ignore\" or invisible";
        warnings.push(format!("{hidden} nodes {what} are left out with all their descendants"));
    }
    Ok(visible)
}

/// Whether a node and its descendants are to be left out.
fn is_ignored(node: &Node) -> bool {
    let extras = node.extras.as_ref().and_then(|raw| serde_json::from_str::<Value>(raw.get()).ok());
    let marked = extras.is_some_and(|e| e.get("lightprobe").and_then(Value::as_str) == Some("ignore"));
    let visibility = node.extensions.as_ref().and_then(|e| e.others.get("KHR_node_visibility"));
    marked || visibility.and_then(|v| v.get("visible")).and_then(Value::as_bool) == Some(false)
}

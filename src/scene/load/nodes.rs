//! The node forest: checked, placed in the world, and listed in the order of the scene. Nothing here recurses, so a
//! chain of a million nodes is no deeper than one.

use serde_json::Value;

use gltf::json::Node;

use super::document::Document;
use super::text::label;
use super::transform::{Local, Placement};
use crate::scene::error::{RE_EXPORT, SceneError};

pub(super) struct Nodes {
    /// World transform of every node of the file (joints may lie outside the scene).
    pub placements: Vec<Placement>,
    /// Nodes of the scene to render, parents before children, without the ignored ones.
    pub visible: Vec<usize>,
}

impl Nodes {
    /// Places all nodes and walks the chosen scene.
    pub fn build(document: &Document, scene: Option<usize>, warnings: &mut Vec<String>) -> Result<Nodes, SceneError> {
        let is_child = check_parents(document)?;
        let top: Vec<usize> = (0..document.nodes.len()).filter(|&node| !is_child[node]).collect();
        let placements = place(document, &top)?;
        let roots = scene_roots(document, scene, top, warnings)?;
        Ok(Nodes { placements, visible: walk(document, &roots, warnings)? })
    }
}

/// `node 3 'Wall'`.
pub(super) fn node_label(document: &Document, node: usize) -> String {
    label("node", node, document.nodes.get(node).and_then(|n| n.name.as_deref()))
}

fn children(node: &Node) -> impl DoubleEndedIterator<Item = usize> {
    node.children.iter().flatten().map(|child| child.value())
}

/// For each node, whether it is some node's child; an error when it is two nodes' child or does not exist.
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

/// World transforms of all nodes, from the parentless ones down. Nodes not reached lie on a cycle: each has one parent.
fn place(document: &Document, top: &[usize]) -> Result<Vec<Placement>, SceneError> {
    let mut placements = vec![None; document.nodes.len()];
    let mut stack: Vec<(usize, Placement)> = top.iter().map(|&node| (node, Placement::IDENTITY)).collect();
    while let Some((index, parent)) = stack.pop() {
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
        stack.extend(children(node).map(|child| (child, placement)));
    }
    let cycle = |index: usize| {
        let what = "is its own ancestor";
        document.invalid(node_label(document, index), what, "remove the cycle from the node tree")
    };
    placements.into_iter().enumerate().map(|(index, p)| p.ok_or_else(|| cycle(index))).collect()
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
        let what = format!("scene {chosen} is asked for, but the file has {}", document.scenes.len());
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

/// Depth first in the order of the file, each node once.
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
        warnings.push(format!("{hidden} nodes {what} are left out with all below them"));
    }
    Ok(visible)
}

/// Whether a node and all below it are to be left out.
fn is_ignored(node: &Node) -> bool {
    let extras = node.extras.as_ref().and_then(|raw| serde_json::from_str::<Value>(raw.get()).ok());
    let marked = extras.is_some_and(|e| e.get("lightprobe").and_then(Value::as_str) == Some("ignore"));
    let visibility = node.extensions.as_ref().and_then(|e| e.others.get("KHR_node_visibility"));
    marked || visibility.and_then(|v| v.get("visible")).and_then(Value::as_bool) == Some(false)
}

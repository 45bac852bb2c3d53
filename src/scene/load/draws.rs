//! The list of what is drawn: each primitive with each place at which nodes, GPU instances or skins put it.

use std::collections::HashMap;
use std::ops::Range;

use gltf::json::Node;

use super::buffers::Buffers;
use super::document::Document;
use super::nodes::{Nodes, node_label};
use super::places::{Place, instances, skeleton};
use super::primitive::{self, MeshSize, Primitive, Skipped};
use super::transform::{Placement, WorldPoint};
use crate::scene::error::{RE_EXPORT, SceneError};

/// One primitive at one place.
pub(super) struct Draw {
    /// Index into [`Draws::primitives`].
    pub primitive: usize,
    pub place: Place,
}

/// Everything that is drawn.
#[derive(Default)]
pub(super) struct Draws {
    pub primitives: Vec<Primitive>,
    /// Joint matrices of each skin in use, in the bind pose: joint placement × inverse bind matrix.
    pub skeletons: Vec<Vec<Placement>>,
    skeleton_of_skin: HashMap<usize, usize>,
    pub draws: Vec<Draw>,
    pub skipped: Skipped,
}

/// Most vertices of a scene, or as many as the input has bytes if that is more. The limit is needed because each
/// instance gets its own copy of its mesh, so a small file can ask for a huge scene. Scenes without instances never
/// reach it. At 72 bytes per vertex and 16 per triangle a small file takes less than 1 GiB.
const MAX_VERTICES: u64 = 1 << 23;
/// Most triangles of a scene, likewise.
const MAX_TRIANGLES: u64 = 1 << 24;
/// Most pairs of primitive and instance, likewise. Each takes 128 bytes.
const MAX_DRAWS: u64 = 1 << 20;

impl Draws {
    /// Reads the meshes of all visible nodes; their tangents only if `tangents` asks for them.
    pub fn collect(document: &Document, buffers: &Buffers, nodes: &Nodes, tangents: bool) -> Result<Draws, SceneError> {
        let mut draws = Draws::default();
        let mut sizes: HashMap<usize, MeshSize> = HashMap::new();
        let mut decoded: HashMap<usize, Range<usize>> = HashMap::new();
        let mut total = Total::default();
        for &index in &nodes.visible {
            let node = &document.nodes[index];
            let Some(mesh_index) = node.mesh else { continue };
            let mesh = document.get(&document.meshes, "mesh", mesh_index, &node_label(document, index))?;
            let places = draws.places(document, buffers, nodes, index, node)?;

            let mesh_index = mesh_index.value();
            let size = match sizes.get(&mesh_index) {
                Some(size) => *size,
                None => *sizes.entry(mesh_index).or_insert(primitive::mesh_size(document, buffers, mesh_index, mesh)?),
            };
            total.add(document, buffers, index, size, places.len())?;

            let range = match decoded.get(&mesh_index) {
                Some(range) => range.clone(),
                None => {
                    let start = draws.primitives.len();
                    let skipped = &mut draws.skipped;
                    let read = primitive::read(document, buffers, mesh_index, mesh, tangents, skipped)?;
                    draws.primitives.extend(read);
                    decoded.entry(mesh_index).or_insert(start..draws.primitives.len()).clone()
                }
            };
            for place in places {
                draws.add(document, range.clone(), place)?;
            }
        }
        Ok(draws)
    }

    /// A point of the world near the geometry: the position of the first draw.
    pub fn landmark(&self) -> Option<WorldPoint> {
        let first = self.draws.first()?;
        let placement = match first.place {
            Place::Rigid(placement) => placement,
            Place::Skinned(skeleton) => *self.skeletons[skeleton].first()?,
        };
        Some(placement.translation)
    }

    fn add(&mut self, document: &Document, primitives: Range<usize>, place: Place) -> Result<(), SceneError> {
        for primitive in primitives {
            let content = &self.primitives[primitive];
            let place = match place {
                Place::Skinned(skeleton) if !content.influences.is_empty() => {
                    check_influences(document, content, self.skeletons[skeleton].len())?;
                    Place::Skinned(skeleton)
                }
                // The primitive has no joints and weights. It follows the first joint of the skin.
                Place::Skinned(skeleton) => Place::Rigid(self.skeletons[skeleton][0]),
                Place::Rigid(placement) => Place::Rigid(placement),
            };
            self.draws.push(Draw { primitive, place });
        }
        Ok(())
    }

    fn places(
        &mut self,
        document: &Document,
        buffers: &Buffers,
        nodes: &Nodes,
        index: usize,
        node: &Node,
    ) -> Result<Vec<Place>, SceneError> {
        let placement = nodes.placements[index];
        if let Some(skin) = node.skin {
            let known = self.skeleton_of_skin.get(&skin.value()).copied();
            let skeleton = match known {
                Some(known) => known,
                None => {
                    self.skeletons.push(skeleton(document, buffers, nodes, index, skin)?);
                    *self.skeleton_of_skin.entry(skin.value()).or_insert(self.skeletons.len() - 1)
                }
            };
            return Ok(vec![Place::Skinned(skeleton)]);
        }
        let extension = node.extensions.as_ref().and_then(|e| e.others.get("EXT_mesh_gpu_instancing"));
        match extension {
            Some(extension) => instances(document, buffers, &placement, index, extension),
            None => Ok(vec![Place::Rigid(placement)]),
        }
    }
}

/// The size of the scene after each instance has got its own copy of its mesh.
#[derive(Default)]
struct Total {
    size: MeshSize,
    draws: u64,
}

impl Total {
    /// Adds a mesh that is drawn at `places` places. Fails if the sum exceeds the limits.
    fn add(
        &mut self,
        document: &Document,
        buffers: &Buffers,
        node: usize,
        mesh: MeshSize,
        places: usize,
    ) -> Result<(), SceneError> {
        let places = places as u64;
        self.size.vertices = self.size.vertices.saturating_add(mesh.vertices.saturating_mul(places));
        self.size.triangles = self.size.triangles.saturating_add(mesh.triangles.saturating_mul(places));
        self.draws = self.draws.saturating_add(mesh.primitives.max(1).saturating_mul(places));
        let allowed = |limit: u64| limit.max(buffers.input_bytes);
        if self.size.vertices <= allowed(MAX_VERTICES)
            && self.size.triangles <= allowed(MAX_TRIANGLES)
            && self.draws <= allowed(MAX_DRAWS)
        {
            return Ok(());
        }
        let MeshSize { vertices, triangles, .. } = self.size;
        Err(SceneError::TooLarge {
            file: document.file.clone(),
            place: node_label(document, node),
            what: format!(
                "with all its instances the scene has at least {vertices} vertices and {triangles} triangles"
            ),
            remedy: "draw fewer instances or simplify the mesh",
        })
    }
}

fn check_influences(document: &Document, primitive: &Primitive, joints: usize) -> Result<(), SceneError> {
    let bad = primitive.influences.iter().flatten().find(|(joint, weight)| *weight != 0.0 && *joint as usize >= joints);
    match bad {
        Some((joint, _)) => {
            let what = format!("JOINTS_0 refers to joint {joint}, but the skin has {joints}");
            Err(document.invalid(primitive.place.clone(), what, RE_EXPORT))
        }
        None => Ok(()),
    }
}

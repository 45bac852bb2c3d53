//! Mesh primitives: attributes become plain arrays, and strips and fans become lists of triangles.

use glam::{DVec3, Vec2, Vec3, Vec4};
use gltf::json::mesh::{Mesh, Mode, Primitive as Definition, Semantic};
use gltf::json::validation::Checked;

use super::accessor::Accessor;
use super::buffers::Buffers;
use super::document::Document;
use super::extensions::remedy;
use super::text::label;
use crate::scene::error::{RE_EXPORT, SceneError};
use crate::scene::light::LIGHT_MAX;

/// One primitive in its own space. Each list of an attribute is as long as `positions`, or empty if the file has none.
pub(super) struct Primitive {
    /// glTF mesh.
    pub mesh: usize,
    /// glTF material; `None` if the primitive has none.
    pub material: Option<usize>,
    pub positions: Vec<DVec3>,
    pub normals: Vec<Vec3>,
    pub uvs: [Vec<Vec2>; 2],
    /// What is wrong with texture coordinates that could not be read. It counts if a texture wants them.
    pub uv_faults: [Option<SceneError>; 2],
    pub colors: Vec<Vec4>,
    pub tangents: Vec<Vec4>,
    /// Four pairs of joint and weight per vertex.
    pub influences: Vec<[(u32, f32); 4]>,
    pub triangles: Vec<[u32; 3]>,
    /// The primitive's text in messages.
    pub place: String,
}

/// Numbers of primitives that the loader left out or read in part.
#[derive(Default)]
pub(super) struct Skipped {
    pub points_or_lines: usize,
    pub without_positions: usize,
    pub incomplete_triangles: usize,
    pub morph_targets: usize,
    pub more_influences: usize,
}

/// The size of a mesh. The file's bytes contain all these vertices and triangles; the accessors' checks ensure it.
#[derive(Clone, Copy, Default)]
pub(super) struct MeshSize {
    pub primitives: u64,
    pub vertices: u64,
    pub triangles: u64,
}

/// A primitive with triangles. Its accessors are checked, but nothing is decoded yet.
struct Opened<'a> {
    mesh: usize,
    definition: &'a Definition,
    mode: Mode,
    positions: Accessor<'a>,
    indices: Option<Accessor<'a>>,
    place: String,
}

/// The size of a mesh after decoding.
pub(super) fn mesh_size(
    document: &Document,
    buffers: &Buffers,
    index: usize,
    mesh: &Mesh,
) -> Result<MeshSize, SceneError> {
    let mut size = MeshSize::default();
    for opened in open(document, buffers, index, mesh, &mut Skipped::default())? {
        let corners = opened.indices.as_ref().unwrap_or(&opened.positions).count as u64;
        size.primitives += 1;
        size.vertices += opened.positions.count as u64;
        size.triangles += if opened.mode == Mode::Triangles { corners / 3 } else { corners.saturating_sub(2) };
    }
    Ok(size)
}

/// Decodes the primitives of a mesh that have triangles; their tangents only if `tangents` asks for them.
pub(super) fn read(
    document: &Document,
    buffers: &Buffers,
    index: usize,
    mesh: &Mesh,
    tangents: bool,
    skipped: &mut Skipped,
) -> Result<Vec<Primitive>, SceneError> {
    open(document, buffers, index, mesh, skipped)?
        .into_iter()
        .map(|opened| opened.decode(document, buffers, tangents, skipped))
        .collect()
}

fn open<'a>(
    document: &'a Document,
    buffers: &'a Buffers,
    index: usize,
    mesh: &'a Mesh,
    skipped: &mut Skipped,
) -> Result<Vec<Opened<'a>>, SceneError> {
    let mut opened = Vec::new();
    for (number, definition) in mesh.primitives.iter().enumerate() {
        let place = format!("{} primitive {number}", label("mesh", index, mesh.name.as_deref()));
        let Checked::Valid(mode) = definition.mode else {
            return Err(document.invalid(place, "glTF does not define its mode", RE_EXPORT));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            skipped.points_or_lines += 1;
            continue;
        }
        let Some(&positions) = definition.attributes.get(&Checked::Valid(Semantic::Positions)) else {
            skipped.without_positions += 1;
            continue;
        };
        refuse_draco(document, definition, &place)?;
        let positions = Accessor::resolve(document, buffers, positions, &format!("{place}: POSITION"))?;
        positions.expect_components(document, &[3])?;
        let indices = match definition.indices {
            Some(indices) => Some(Accessor::resolve(document, buffers, indices, &format!("{place}: indices"))?),
            None => None,
        };
        opened.push(Opened { mesh: index, definition, mode, positions, indices, place });
    }
    Ok(opened)
}

/// Refuses a Draco primitive, unless its accessors have plain data too.
fn refuse_draco(document: &Document, definition: &Definition, place: &str) -> Result<(), SceneError> {
    const DRACO: &str = "KHR_draco_mesh_compression";
    let has_draco = definition.extensions.as_ref().is_some_and(|e| e.others.contains_key(DRACO));
    let mut accessors = definition.attributes.values().chain(&definition.indices);
    let is_bare = |a: &gltf::json::Accessor| a.buffer_view.is_none() && a.sparse.is_none();
    if has_draco && accessors.any(|a| document.accessors.get(a.value()).is_some_and(is_bare)) {
        return Err(SceneError::Unsupported {
            file: document.file.clone(),
            place: place.to_owned(),
            extension: DRACO.to_owned(),
            remedy: remedy(DRACO),
        });
    }
    Ok(())
}

impl Opened<'_> {
    fn decode(
        self,
        document: &Document,
        buffers: &Buffers,
        tangents: bool,
        skipped: &mut Skipped,
    ) -> Result<Primitive, SceneError> {
        let count = self.positions.count;
        let attribute = |semantic: Semantic, components: &[usize]| -> Result<Option<Accessor>, SceneError> {
            let Some(&index) = self.definition.attributes.get(&Checked::Valid(semantic.clone())) else {
                return Ok(None);
            };
            let place = format!("{}: {}", self.place, semantic.to_string());
            let accessor = Accessor::resolve(document, buffers, index, &place)?;
            accessor.expect_components(document, components)?;
            accessor.expect_count(document, count, "POSITION")?;
            Ok(Some(accessor))
        };
        let uvs = |set| -> (Vec<Vec2>, Option<SceneError>) {
            let uv = |uv: [f32; 2]| finite_or_zero(&uv, Vec2::from_array(uv));
            match attribute(Semantic::TexCoords(set), &[2]) {
                Ok(uvs) => (uvs.into_iter().flat_map(|a| a.floats([0.0; 2], false)).map(uv).collect(), None),
                Err(fault) => (Vec::new(), Some(fault)),
            }
        };
        let ((uvs_0, fault_0), (uvs_1, fault_1)) = (uvs(0), uvs(1));
        let normals = attribute(Semantic::Normals, &[3])?.map(|a| a.floats([0.0; 3], false));
        let tangents = if tangents { attribute(Semantic::Tangents, &[4])? } else { None };
        let tangents = tangents.map(|a| a.floats([0.0; 4], false));
        // Colours without alpha are opaque. A colour with a NaN is replaced by white.
        let colors = attribute(Semantic::Colors(0), &[3, 4])?.map(|a| a.floats([0.0, 0.0, 0.0, 1.0], true));
        let color = |c: [f32; 4]| match c.iter().all(|x| x.is_finite()) {
            true => Vec4::from_array(c).max(Vec4::ZERO).min(Vec3::splat(LIGHT_MAX).extend(1.0)),
            false => Vec4::ONE,
        };
        let joints = attribute(Semantic::Joints(0), &[4])?.and_then(|a| a.integers::<4>());
        let weights = attribute(Semantic::Weights(0), &[4])?.map(|a| a.floats([0.0; 4], true));
        let influences = joints.into_iter().flatten().zip(weights.into_iter().flatten());
        skipped.more_influences +=
            usize::from(self.definition.attributes.contains_key(&Checked::Valid(Semantic::Joints(1))));
        skipped.morph_targets += usize::from(self.definition.targets.as_ref().is_some_and(|t| !t.is_empty()));
        Ok(Primitive {
            mesh: self.mesh,
            material: self.definition.material.map(|m| m.value()),
            normals: normals.into_iter().flatten().map(|n| finite_or_zero(&n, Vec3::from_array(n))).collect(),
            uvs: [uvs_0, uvs_1],
            uv_faults: [fault_0, fault_1],
            colors: colors.into_iter().flatten().map(color).collect(),
            tangents: tangents.into_iter().flatten().map(|t| finite_or_zero(&t, Vec4::from_array(t))).collect(),
            influences: influences.map(|(j, w)| [0, 1, 2, 3].map(|i| (j[i], w[i]))).collect(),
            triangles: self.triangles(document, skipped)?,
            positions: self.positions.floats([0.0; 3], false).into_iter().map(|p| Vec3::from(p).as_dvec3()).collect(),
            place: self.place,
        })
    }

    fn triangles(&self, document: &Document, skipped: &mut Skipped) -> Result<Vec<[u32; 3]>, SceneError> {
        let vertices = self.positions.count;
        let corners: Vec<u32> = match &self.indices {
            None => (0..u32::try_from(vertices).unwrap_or(u32::MAX)).collect(),
            Some(indices) => {
                let place = || format!("{}: indices", self.place);
                indices.expect_components(document, &[1])?;
                let Some(list) = indices.integers::<1>() else {
                    return Err(document.invalid(place(), "they are not unsigned integers", RE_EXPORT));
                };
                if let Some((at, [index])) = list.iter().enumerate().find(|(_, [i])| *i as usize >= vertices) {
                    let what = format!("index {index} (at position {at}) exceeds its {vertices} vertices");
                    return Err(document.invalid(place(), what, RE_EXPORT));
                }
                list.into_iter().map(|[index]| index).collect()
            }
        };
        if self.mode == Mode::Triangles {
            skipped.incomplete_triangles += usize::from(!corners.len().is_multiple_of(3));
        }
        Ok(assemble(self.mode, &corners))
    }
}

/// The triangles of a topology, with the winding of glTF 2.0, section 3.7.2.1.
fn assemble(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => corners
            .windows(3)
            .enumerate()
            .map(|(i, c)| if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] })
            .collect(),
        Mode::TriangleFan => match corners.split_first() {
            Some((&hub, rim)) => rim.windows(2).map(|c| [c[0], c[1], hub]).collect(),
            None => Vec::new(),
        },
        _ => corners.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    }
}

fn finite_or_zero<V: Default>(components: &[f32], value: V) -> V {
    if components.iter().all(|c| c.is_finite()) { value } else { V::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_their_winding() {
        assert_eq!(assemble(Mode::TriangleStrip, &[5, 6, 7, 8]), [[5, 6, 7], [6, 8, 7]]);
        assert_eq!(assemble(Mode::TriangleFan, &[5, 6, 7, 8]), [[6, 7, 5], [7, 8, 5]]);
        assert_eq!(assemble(Mode::Triangles, &[5, 6, 7, 8]), [[5, 6, 7]]);
        for mode in [Mode::Triangles, Mode::TriangleStrip, Mode::TriangleFan] {
            for length in 0..3 {
                assert!(assemble(mode, &vec![0; length]).is_empty());
            }
        }
    }
}

//! The probe file: a volume as tensors, and back.
//!
//! The metadata `query` ([`QueryRecord`]) is all that a look-up needs beside the tensors; `config` tells where the file
//! comes from, and nothing reads it to shade. Files without `query` are older: [`legacy`] derives it once from `config`.

pub mod legacy;
pub mod published;
mod record;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec3, UVec3, Vec3};
use safetensors::Dtype;
use serde_json::Value;

pub use self::record::{GridKind, GridRecord, LightRecord, QUERY_VERSION, QueryRecord, SceneRecord};
use super::container::{Container, EncodingLosses, FileError};
use super::lattice::tree::Tree;
use super::lattice::{Grid, ProbeState};
use super::store::layout::LayoutSettings;
use super::store::radiance::Radiance;
use super::store::volume::Volume;
use super::store::{Irradiance, Occlusion};

/// The tensor that says which probe stands for which point of a mixed grid, see [`Tree`].
const GRID_INDEX: &str = "grid_index";

/// Metadata key of what a fit did.
const FIT_KEY: &str = "fit";

/// Value of the metadata key `format`.
pub const FORMAT: &str = "lightprobe/1";

/// The metadata key that says how a probe's bytes are counted.
const LAYOUT_KEY: &str = "layout";

/// What a volume was made from and how it is asked.
#[derive(Debug, Clone, Copy)]
pub struct Provenance<'a> {
    /// Effective configuration, RON.
    pub config: &'a str,
    pub query: &'a QueryRecord,
    pub scene: &'a SceneRecord,
    pub seed: u64,
    pub plan: &'a Value,
    /// What a fit did, where one gave the light.
    pub fit: Option<&'a Value>,
    /// Border texels of the volume's maps.
    pub border: usize,
}

/// A file's content, decoded.
#[derive(Debug, Clone)]
pub struct ProbeFile {
    /// Relative to its own grid's origin, see [`ProbeFile::volume`].
    volume_in_grid: Volume,
    pub query: QueryRecord,
    pub border: usize,
    /// Effective configuration, RON.
    pub config: String,
    pub scene: SceneRecord,
    /// Seed of the bake's random numbers; `None` where the file does not say.
    pub seed: Option<u64>,
    pub plan: Value,
    /// What the fit did that gave its light; `None` where probes hold the light where they stand.
    pub fit: Option<Value>,
    /// Bytes of every tensor.
    pub tensor_bytes: BTreeMap<String, u64>,
    /// Number type and shape of every tensor, for listings.
    pub tensor_shapes: BTreeMap<String, (String, Vec<usize>)>,
    pub file_bytes: u64,
}

/// The volume as tensors; inverse of [`read`] up to the rounding of its formats.
pub fn encode(volume: &Volume, provenance: &Provenance) -> (Container, EncodingLosses) {
    let mut container = Container::default();
    let mut losses = EncodingLosses::default();
    let probes = volume.states.len();
    let grid = &volume.grid;
    let relative = volume.positions.iter().flat_map(|p| (*p - grid.origin()).to_array());
    container.put("position", Dtype::F32, &[probes, 3], relative.map(f32::to_le_bytes));
    container.put_bytes("state", Dtype::U8, &[probes], volume.states.iter().map(|&s| s as u8).collect());
    volume.irradiance.write(&mut container, &mut losses);
    volume.occlusion.write(&mut container, &mut losses);
    volume.radiance.write(&mut container, &mut losses);
    // Files of the layout that is ours do without.
    if volume.layout != LayoutSettings::default() {
        container.put_json(LAYOUT_KEY, &volume.layout);
    }
    container.put_json(
        "grid",
        &GridRecord {
            kind: if grid.tree().is_some() { GridKind::Mixed } else { GridKind::Uniform },
            origin: grid.origin_world().to_array(),
            spacing: grid.spacing().to_array(),
            divisions: grid.divisions().to_array(),
            levels: grid.tree().map_or(0, Tree::levels),
            border: provenance.border,
        },
    );
    if let Some(tree) = grid.tree() {
        let index = tree.index();
        container.put(GRID_INDEX, Dtype::I32, &[index.len()], index.iter().map(|i| i.to_le_bytes()));
    }
    container.metadata.insert("format".to_owned(), FORMAT.to_owned());
    container.metadata.insert("config".to_owned(), provenance.config.to_owned());
    container.put_json("query", &provenance.query.to_json());
    container.put_json("scene", provenance.scene);
    container.put_json("seed", &provenance.seed);
    container.put_json("plan", provenance.plan);
    if let Some(fit) = provenance.fit {
        container.put_json(FIT_KEY, fit);
    }
    (container, losses)
}

/// Reads a probe file, checking hashes, shapes and ranges.
///
/// # Errors
/// The file cannot be read, is damaged, or is of a newer program.
pub fn read(path: &Path) -> Result<ProbeFile, FileError> {
    let container = Container::read(path)?;
    let found = container.metadata.get("format").cloned().unwrap_or_default();
    if found != FORMAT {
        return Err(FileError::Version { path: path.to_owned(), found, expected: FORMAT });
    }
    let damaged = |what| FileError::Damaged { path: path.to_owned(), what };
    if let Some(version) = record::newer(&container).map_err(damaged)? {
        let found = format!("{FORMAT}, query version {version}");
        return Err(FileError::Version { path: path.to_owned(), found, expected: FORMAT });
    }
    let file_bytes =
        std::fs::metadata(path).map_err(|cause| FileError::Unreadable { path: path.to_owned(), cause })?.len();
    decode(&container, file_bytes).map_err(damaged)
}

/// What [`read`] would give of a file of this content, `path`, that is not written yet.
///
/// # Errors
/// The content is none that [`read`] takes.
pub fn as_read(container: &Container, path: &Path) -> Result<ProbeFile, FileError> {
    let damaged = |what| FileError::Damaged { path: path.to_owned(), what };
    decode(container, container.file_bytes()).map_err(damaged)
}

fn decode(container: &Container, file_bytes: u64) -> Result<ProbeFile, String> {
    let record: GridRecord = container.json("grid")?;
    let spacing = Vec3::from(record.spacing);
    let mut grid = Grid::from_parts(DVec3::from(record.origin), spacing, UVec3::from(record.divisions))
        .ok_or_else(|| format!("metadata 'grid' makes no grid: {:?} probes at spacing {spacing}", record.divisions))?;
    if record.border > 1 || (record.kind == GridKind::Uniform) != (record.levels == 0) {
        let (border, levels) = (record.border, record.levels);
        return Err(format!("metadata 'grid' has the unknown border {border} or levels {levels}"));
    }
    if record.kind == GridKind::Mixed {
        let index = container.tensor(GRID_INDEX, &[Dtype::I32], &[None])?;
        grid = grid.with_index(record.levels, index.u32s().map(|i| i as i32).collect())?;
    }
    let probes = grid.probe_count();
    let positions = container.tensor("position", &[Dtype::F32], &[Some(probes), Some(3)])?.f32s();
    if positions.iter().any(|p| !p.is_finite()) {
        return Err("tensor 'position' holds numbers that are not finite".into());
    }
    let positions = positions.as_chunks::<3>().0.iter().map(|p| Vec3::from(*p)).collect();
    let states = &container.tensor("state", &[Dtype::U8], &[Some(probes)])?.bytes;
    let states: Option<Vec<ProbeState>> = states.iter().map(|&s| ProbeState::from_u8(s)).collect();
    let states = states.ok_or("tensor 'state' holds an unknown state")?;
    let volume_in_grid = Volume {
        irradiance: Irradiance::read(container, probes, record.border)?,
        occlusion: Occlusion::read(container, &grid, record.border)?,
        radiance: Radiance::read(container, probes, record.border)?,
        layout: match container.metadata.contains_key(LAYOUT_KEY) {
            true => container.json(LAYOUT_KEY)?,
            false => LayoutSettings::default(),
        },
        grid,
        states,
        positions,
    };
    let config = container.text("config")?.clone();
    let query: QueryRecord = match container.metadata.contains_key("query") {
        true => container.json("query")?,
        false => legacy::query(&config)?,
    };
    query.check(&volume_in_grid.occlusion)?;
    let shape =
        |(name, t): (&String, &super::container::Tensor)| (name.clone(), (t.dtype.to_string(), t.shape.clone()));
    Ok(ProbeFile {
        volume_in_grid,
        query,
        border: record.border,
        config,
        scene: container.json("scene")?,
        seed: container.metadata.contains_key("seed").then(|| container.json("seed")).transpose()?,
        plan: container.json("plan")?,
        fit: container.metadata.contains_key(FIT_KEY).then(|| container.json(FIT_KEY)).transpose()?,
        tensor_bytes: container.tensors.iter().map(|(n, t)| (n.clone(), t.bytes.len() as u64)).collect(),
        tensor_shapes: container.tensors.iter().map(shape).collect(),
        file_bytes,
    })
}

impl ProbeFile {
    /// The volume relative to a scene's origin.
    pub fn volume(&self, scene_origin_world: DVec3) -> Volume {
        let mut volume = self.volume_in_grid.clone();
        let (grid, shift) = volume.grid.relative_to(scene_origin_world);
        volume.grid = grid;
        volume.positions.iter_mut().for_each(|position| *position += shift);
        volume
    }

    /// The volume relative to its own grid's origin.
    pub fn volume_in_grid(&self) -> &Volume {
        &self.volume_in_grid
    }

    /// Where the file was made from, with another configuration.
    pub fn provenance<'a>(&'a self, config: &'a str) -> Provenance<'a> {
        let ProbeFile { query, scene, plan, fit, border, .. } = self;
        let (seed, border) = (self.seed.unwrap_or(0), *border);
        Provenance { config, query, scene, seed, plan, fit: fit.as_ref(), border }
    }

    /// The volume without what the plan found unnecessary, should the file hold it all the same.
    pub fn volume_as_planned(&self, scene_origin_world: DVec3) -> Volume {
        let mut volume = self.volume(scene_origin_world);
        if !self.plans_visibility() {
            volume.occlusion = Occlusion::None;
        }
        volume
    }

    /// Bytes per probe of what the plan keeps, in the layout that shading uses.
    pub fn runtime_bytes(&self) -> f64 {
        let all = self.volume_in_grid.runtime_bytes(self.query.moved);
        let Volume { occlusion, states, layout, .. } = &self.volume_in_grid;
        let left_out = occlusion.runtime_bytes(states.len(), layout);
        if self.plans_visibility() { all } else { all - left_out }
    }

    fn plans_visibility(&self) -> bool {
        self.plan["visibility"] != Value::Bool(false)
    }
}

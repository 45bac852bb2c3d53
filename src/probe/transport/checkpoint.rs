//! What an interrupted bake leaves behind: the probes' irradiance after the last finished iteration, and what the solver
//! remembers of those before.
//!
//! Captures are traced again on resumption — the same seed gives the same — so only the iterations are saved.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use safetensors::Dtype;

use super::anderson::History;
use super::operator::Field;
use super::solver::{Control, Progress, Solution};
use crate::probe::Volume;
use crate::probe::container::{Container, FileError, Tensor};

/// Value of the metadata key `format`.
const FORMAT: &str = "lightprobe-resume/3";

/// What the names of a solver's own tensors begin with.
const FIELD: &str = "field.";

/// Where the checkpoint of an output lies.
pub fn path_for(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".resume");
    name.into()
}

/// Writes a checkpoint. `identity` names scene, configuration and seed: whatever the result depends on.
pub fn write(path: &Path, identity: &str, progress: &Progress, volume: &Volume) -> Result<(), FileError> {
    let mut container = Container::default();
    container.tensors.insert("irradiance".into(), tensor(volume.irradiance.stored()));
    if let Some(history) = &progress.history {
        let (fields, noise) = history.fields();
        for (i, field) in fields.into_iter().enumerate() {
            container.tensors.insert(field_name(i), tensor(field.iter().copied()));
        }
        let noise: Vec<[f64; 3]> = noise.into_iter().map(|n| n.to_array()).collect();
        container.metadata.insert("history".into(), serde_json::to_string(&noise).unwrap_or_default());
    }
    for (name, values) in &progress.fields {
        container.tensors.insert(format!("{FIELD}{name}"), tensor(values.iter().copied()));
    }
    container.metadata.insert("format".into(), FORMAT.into());
    container.metadata.insert("identity".into(), identity.into());
    // Plain numbers: nothing in them can fail to serialise.
    container
        .metadata
        .insert("progress".into(), serde_json::to_string(&(&progress.solution, &progress.control)).unwrap_or_default());
    container.write(path).map(|_| ())
}

/// What the result of a bake depends on, and so what a checkpoint must have been made of.
pub fn identity(scene_blake3: &str, seed: u64, config: &str) -> String {
    format!("{scene_blake3} seed {seed} {config}")
}

/// Reads a checkpoint into the volume and returns how far it had come.
pub fn read(path: &Path, identity: &str, volume: &mut Volume) -> Result<Progress, FileError> {
    let ((solution, control), container) = load(path, identity)?;
    let unusable = |what: &str| FileError::NoCheckpoint { path: path.to_owned(), what: what.to_owned() };
    if !field(&container, "irradiance").is_some_and(|stored| volume.irradiance.restore(&stored)) {
        return Err(unusable("its irradiance is not that of this grid"));
    }
    let unknowns = volume.active_count() * volume.irradiance.unknowns();
    let group = volume.irradiance.signed().map_or(1, |(group, _)| group);
    let history = match container.metadata.get("history") {
        None => None,
        Some(noise) => Some(
            history(&container, noise, unknowns, group)
                .ok_or_else(|| unusable("its earlier iterations are not of this grid"))?,
        ),
    };
    let mut fields = BTreeMap::new();
    for name in container.tensors.keys().filter_map(|name| name.strip_prefix(FIELD)) {
        let values = field(&container, &format!("{FIELD}{name}"));
        fields.insert(name.to_owned(), values.ok_or_else(|| unusable("a tensor of it is unreadable"))?);
    }
    Ok(Progress { solution, control, history, fields })
}

fn history(container: &Container, noise: &str, unknowns: usize, group: usize) -> Option<History> {
    let noise: Vec<[f64; 3]> = serde_json::from_str(noise).ok()?;
    let fields = (0..).map_while(|i| field(container, &field_name(i))).collect();
    History::from_fields(unknowns, group, fields, noise.into_iter().map(DVec3::from).collect())
}

/// Name of the tensor that holds one of the fields that the solver remembers.
fn field_name(i: usize) -> String {
    format!("history.{i}")
}

fn tensor(values: impl ExactSizeIterator<Item = Vec3>) -> Tensor {
    let shape = vec![values.len(), 3];
    Tensor { dtype: Dtype::F32, shape, bytes: values.flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes).collect() }
}

fn field(container: &Container, name: &str) -> Option<Field> {
    let tensor = container.tensors.get(name).filter(|tensor| tensor.dtype == Dtype::F32)?;
    let numbers: Vec<f32> = tensor.bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    Some(numbers.as_chunks::<3>().0.iter().map(|&t| t.into()).collect())
}

/// Refuses what [`read`] will not be able to go on from, before the captures are traced again.
pub fn check(path: &Path, identity: &str) -> Result<(), FileError> {
    load(path, identity).map(|_| ())
}

/// Deletes a checkpoint; a file of the same name that is none is left alone.
pub fn remove(path: &Path) {
    if Container::read(path).is_ok_and(|container| is_checkpoint(&container)) {
        // What could be resumed from is of no more use, and of little harm.
        let _ = std::fs::remove_file(path);
    }
}

fn is_checkpoint(container: &Container) -> bool {
    container.metadata.get("format").is_some_and(|format| format == FORMAT)
}

fn load(path: &Path, identity: &str) -> Result<((Solution, Control), Container), FileError> {
    let unusable = |what: &str| FileError::NoCheckpoint { path: path.to_owned(), what: what.to_owned() };
    let container = Container::read(path).map_err(|error| match error {
        FileError::Damaged { what, .. } => unusable(&format!("it is damaged or no resume file ({what})")),
        other => other,
    })?;
    if !is_checkpoint(&container) {
        return Err(unusable(&format!("its format is not {FORMAT}")));
    }
    if container.metadata.get("identity").map(String::as_str) != Some(identity) {
        return Err(FileError::OtherBake { path: path.to_owned() });
    }
    let found = container.metadata.get("progress").and_then(|text| serde_json::from_str(text).ok());
    let found = found.ok_or_else(|| unusable("its progress is unreadable"))?;
    if field(&container, "irradiance").is_none() {
        return Err(unusable("it holds no irradiance"));
    }
    Ok((found, container))
}

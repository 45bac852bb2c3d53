//! What an interrupted solution leaves behind, as bytes: the probes' irradiance after the last finished iteration, and what
//! the solver remembers of those before.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use safetensors::Dtype;

use super::anderson::History;
use super::operator::Field;
use super::solver::{Control, Progress, Solution};
use crate::probe::Volume;
use crate::probe::container::{Container, Tensor};

/// What the names of a solver's own tensors begin with.
const FIELD: &str = "field.";

/// A safetensors file of where the iterations have come to. Inverse: [`unpack`].
pub fn pack(progress: &Progress, volume: &Volume) -> Vec<u8> {
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
    // Plain numbers: nothing in them can fail to serialise.
    container
        .metadata
        .insert("progress".into(), serde_json::to_string(&(&progress.solution, &progress.control)).unwrap_or_default());
    container.to_bytes()
}

/// Puts back into the volume what [`pack`] was given, and returns how far it had come. `None` where the bytes are of something
/// else; the volume may then have changed.
pub fn unpack(bytes: &[u8], volume: &mut Volume) -> Option<Progress> {
    let container = Container::of_bytes(bytes).ok()?;
    let (solution, control): (Solution, Control) = serde_json::from_str(container.metadata.get("progress")?).ok()?;
    let unknowns = volume.active_count() * volume.irradiance.unknowns();
    let group = volume.irradiance.signed().map_or(1, |(group, _)| group);
    let history = match container.metadata.get("history") {
        None => None,
        Some(noise) => Some(history(&container, noise, unknowns, group)?),
    };
    let mut fields = BTreeMap::new();
    for name in container.tensors.keys().filter_map(|name| name.strip_prefix(FIELD)) {
        fields.insert(name.to_owned(), field(&container, &format!("{FIELD}{name}"))?);
    }
    let is_restored = volume.irradiance.restore(&field(&container, "irradiance")?);
    is_restored.then_some(Progress { solution, control, history, fields })
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

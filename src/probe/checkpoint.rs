//! What an interrupted bake leaves behind: the probes' irradiance after the last finished sweep.
//!
//! Captures are traced again on resumption — the same seed gives the same — so only the sweeps are saved.

use std::path::{Path, PathBuf};

use glam::Vec3A;
use safetensors::Dtype;

use super::container::{Container, FileError, Tensor};
use super::solver::Solution;
use super::volume::Volume;

/// Value of the metadata key `format`.
const FORMAT: &str = "lightprobe-resume/1";

/// Where the checkpoint of an output lies.
pub fn path_for(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".resume");
    name.into()
}

/// Writes a checkpoint. `identity` names scene, configuration and seed: whatever the result depends on.
pub fn write(path: &Path, identity: &str, progress: &Solution, volume: &Volume) -> Result<(), FileError> {
    let mut container = Container::default();
    let texels = &volume.irradiance.texels;
    let bytes = texels.iter().flat_map(|t| t.to_array()).flat_map(f32::to_le_bytes).collect();
    let tensor = Tensor { dtype: Dtype::F32, shape: vec![texels.len(), 3], bytes };
    container.tensors.insert("irradiance".into(), tensor);
    container.metadata.insert("format".into(), FORMAT.into());
    container.metadata.insert("identity".into(), identity.into());
    // Plain numbers: nothing in them can fail to serialise.
    container.metadata.insert("progress".into(), serde_json::to_string(progress).unwrap_or_default());
    container.write(path).map(|_| ())
}

/// Reads a checkpoint into the volume and returns how far it had come.
pub fn read(path: &Path, identity: &str, volume: &mut Volume) -> Result<Solution, FileError> {
    let container = Container::read(path)?;
    let damaged = |what: &str| FileError::Damaged { path: path.to_owned(), what: what.to_owned() };
    let found = container.metadata.get("format").cloned().unwrap_or_default();
    if found != FORMAT {
        return Err(FileError::Version { path: path.to_owned(), found, expected: FORMAT });
    }
    if container.metadata.get("identity").map(String::as_str) != Some(identity) {
        return Err(FileError::OtherBake { path: path.to_owned() });
    }
    let progress = container.metadata.get("progress").and_then(|text| serde_json::from_str(text).ok());
    let progress = progress.ok_or_else(|| damaged("its progress is unreadable"))?;
    let tensor = container.tensors.get("irradiance").ok_or_else(|| damaged("it holds no irradiance"))?;
    let numbers: Vec<f32> = tensor.bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let texels: Vec<Vec3A> = numbers.as_chunks::<3>().0.iter().map(|t| Vec3A::from(*t)).collect();
    if tensor.dtype != Dtype::F32 || texels.len() != volume.irradiance.texels.len() {
        return Err(damaged("its irradiance is not that of this grid"));
    }
    volume.irradiance.texels = texels;
    Ok(progress)
}

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
    let mut bytes = Vec::with_capacity(texels.len() * 12);
    texels.iter().flat_map(|t| t.to_array()).for_each(|x| bytes.extend(x.to_le_bytes()));
    let tensor = Tensor { dtype: Dtype::F32, shape: vec![texels.len(), 3], bytes };
    container.tensors.insert("irradiance".into(), tensor);
    container.metadata.insert("format".into(), FORMAT.into());
    container.metadata.insert("identity".into(), identity.into());
    // Plain numbers: nothing in them can fail to serialise.
    container.metadata.insert("progress".into(), serde_json::to_string(progress).unwrap_or_default());
    container.write(path).map(|_| ())
}

/// What the result of a bake depends on, and so what a checkpoint must have been made of.
pub fn identity(scene_blake3: &str, seed: u64, config: &str) -> String {
    format!("{scene_blake3} seed {seed} {config}")
}

/// Reads a checkpoint into the volume and returns how far it had come.
pub fn read(path: &Path, identity: &str, volume: &mut Volume) -> Result<Solution, FileError> {
    let (progress, texels) = load(path, identity)?;
    if texels.len() != volume.irradiance.texels.len() {
        let what = "its irradiance is not that of this grid".to_owned();
        return Err(FileError::NoCheckpoint { path: path.to_owned(), what });
    }
    volume.irradiance.texels = texels;
    Ok(progress)
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

fn load(path: &Path, identity: &str) -> Result<(Solution, Vec<Vec3A>), FileError> {
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
    let progress = container.metadata.get("progress").and_then(|text| serde_json::from_str(text).ok());
    let progress = progress.ok_or_else(|| unusable("its progress is unreadable"))?;
    let tensor = container.tensors.get("irradiance").filter(|tensor| tensor.dtype == Dtype::F32);
    let tensor = tensor.ok_or_else(|| unusable("it holds no irradiance"))?;
    let numbers: Vec<f32> = tensor.bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    Ok((progress, numbers.as_chunks::<3>().0.iter().map(|t| Vec3A::from(*t)).collect()))
}

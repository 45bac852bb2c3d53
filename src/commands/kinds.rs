//! Files of one kind where another is expected: swapped arguments are named as such.

use std::path::Path;

use anyhow::{Result, bail};

fn has_extension(path: &Path, names: &[&str]) -> bool {
    path.extension().is_some_and(|extension| names.iter().any(|name| extension.eq_ignore_ascii_case(name)))
}

fn is_scene(path: &Path) -> bool {
    has_extension(path, &["glb", "gltf"])
}

fn is_probes(path: &Path) -> bool {
    has_extension(path, &["probes"])
}

/// Refuses a scene in the place of a probe file. `usage` shows how the command is written.
pub fn expect_probes(path: &Path, usage: &str) -> Result<()> {
    if is_scene(path) {
        bail!("{} is a scene, and a probe file belongs there; write `lightprobe {usage}`", path.display());
    }
    Ok(())
}

/// Refuses a probe file in the place of a scene.
pub fn expect_scene(path: &Path, usage: &str) -> Result<()> {
    if is_probes(path) {
        bail!("{} is a probe file, and a scene belongs there; write `lightprobe {usage}`", path.display());
    }
    Ok(())
}

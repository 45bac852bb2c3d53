//! Where a path leads: through symbolic links, and into which folder.

use std::fs;
use std::path::{Path, PathBuf};

/// Start of the names of temporary files and folders. They lie beside the output until they are renamed.
pub(super) const TEMPORARY_PREFIX: &str = ".lightprobe-";

/// The path at the end of all symbolic links. It need not exist yet.
pub(super) fn link_target(path: &Path) -> PathBuf {
    /// Linux follows as many before it gives up.
    const MOST_LINKS: usize = 40;
    let mut target = path.to_owned();
    for _ in 0..MOST_LINKS {
        if let Ok(existing) = fs::canonicalize(&target) {
            return existing;
        }
        match fs::read_link(&target) {
            Ok(link) => target = folder_of(&target).join(link),
            Err(_) => break,
        }
    }
    target
}

/// The folder that `path` lies in; "." for a bare file name.
pub(super) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

//! Checks of output paths. They run before the work, so that a wrong path does not cost an hour.

use std::fs;
use std::path::{Path, PathBuf};

use super::error::{OutputError, missing_folder};
use super::paths::{folder_of, link_target};

/// A path with the flag or argument that gave it, such as `--report`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Named {
    pub name: &'static str,
    pub path: PathBuf,
}

impl Named {
    pub fn new(name: &'static str, path: impl Into<PathBuf>) -> Named {
        Named { name, path: path.into() }
    }
}

/// Refuses outputs that cannot be written, that would overwrite an input, or that would overwrite each other.
///
/// # Errors
/// As those of [`check_writable`]; [`OutputError::IsInput`], [`OutputError::Twice`].
pub fn check_outputs(outputs: &[Named], inputs: &[Named]) -> Result<(), OutputError> {
    check_apart(outputs, inputs)?;
    outputs.iter().try_for_each(|output| check_writable(&output.path))
}

/// Refuses an output that is the same file as an input or as another output. Files are compared, not paths: `./a`, `a`
/// and a link to `a` are one file.
///
/// # Errors
/// [`OutputError::IsInput`], [`OutputError::Twice`].
pub fn check_apart(outputs: &[Named], inputs: &[Named]) -> Result<(), OutputError> {
    let inputs: Vec<(PathBuf, &Named)> = inputs.iter().map(|input| (identity(&input.path), input)).collect();
    let mut seen: Vec<(PathBuf, &Named)> = Vec::new();
    for output in outputs {
        let same = identity(&output.path);
        if let Some((_, input)) = inputs.iter().find(|(path, _)| *path == same) {
            return Err(OutputError::IsInput { name: output.name, path: output.path.clone(), input: input.name });
        }
        if let Some((_, first)) = seen.iter().find(|(path, _)| *path == same) {
            return Err(OutputError::Twice { first: first.name, second: output.name, path: output.path.clone() });
        }
        seen.push((same, output));
    }
    Ok(())
}

/// Refuses paths that [`super::write_atomically`] could not write.
///
/// # Errors
/// The folder is missing, permission is missing, or the path names something other than a file.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    let target = link_target(path);
    let folder = folder_of(&target);
    if !folder.is_dir() {
        return Err(missing_folder(path, folder));
    }
    if fs::metadata(path).is_ok_and(|existing| !existing.is_file()) {
        return Err(OutputError::NotAFile { path: path.to_owned() });
    }
    check_permission(path, folder)
}

/// Refuses folders that [`super::create_folder`] could not create or that cannot be written into.
///
/// # Errors
/// A file is in the way, or permission is missing.
pub fn check_folder(path: &Path) -> Result<(), OutputError> {
    let above = path.ancestors().map(|part| if part == Path::new("") { Path::new(".") } else { part });
    // Links are not followed here: a link to nowhere is in the way too.
    let Some(existing) = above.into_iter().find(|part| fs::symlink_metadata(part).is_ok()) else { return Ok(()) };
    if !existing.is_dir() {
        return Err(OutputError::FileInTheWay { path: path.to_owned(), blocker: existing.to_owned() });
    }
    check_permission(path, existing)
}

fn check_permission(path: &Path, folder: &Path) -> Result<(), OutputError> {
    use nix::unistd::{AccessFlags, access};
    match access(folder, AccessFlags::W_OK | AccessFlags::X_OK) {
        Err(nix::errno::Errno::EACCES | nix::errno::Errno::EROFS) => {
            Err(OutputError::Denied { path: path.to_owned(), folder: folder.to_owned() })
        }
        // Other errors appear when the file is written.
        _ => Ok(()),
    }
}

/// One path per file: all paths that lead to a file give the same result, also before the file exists.
fn identity(path: &Path) -> PathBuf {
    if let Ok(existing) = fs::canonicalize(path) {
        return existing;
    }
    let target = link_target(path);
    let folder = fs::canonicalize(folder_of(&target)).unwrap_or_else(|_| folder_of(&target).to_owned());
    target.file_name().map_or(target.clone(), |name| folder.join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_file_by_several_paths() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("scene"), "").unwrap();
        std::os::unix::fs::symlink(at("scene"), at("link")).unwrap();
        std::os::unix::fs::symlink(at("new"), at("dangling")).unwrap();
        let scene = [Named::new("SCENE", at("scene"))];
        for name in ["scene", "./scene", "link"] {
            let refused = check_outputs(&[Named::new("-o", at(name))], &scene);
            assert!(matches!(refused, Err(OutputError::IsInput { .. })), "{name}: {refused:?}");
        }
        for (first, second) in [("new", "./new"), ("new", "dangling"), ("other", "other")] {
            let outputs = [Named::new("-o", at(first)), Named::new("--report", at(second))];
            let refused = check_outputs(&outputs, &scene);
            assert!(matches!(refused, Err(OutputError::Twice { .. })), "{first} {second}: {refused:?}");
        }
        let outputs = [Named::new("-o", at("new")), Named::new("--report", at("newer"))];
        check_outputs(&outputs, &scene).unwrap();
    }

    #[test]
    fn impossible_folders_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("file"), "").unwrap();
        check_folder(&at("new/below")).unwrap();
        check_folder(Path::new("new")).unwrap();
        for path in [at("file"), at("file/below/it"), "/dev/full".into()] {
            let message = check_folder(&path).unwrap_err().to_string();
            assert!(message.contains("not a folder"), "{message}");
        }
        let message = check_writable(&at("file/out")).unwrap_err().to_string();
        assert!(message.contains("file is not a folder"), "{message}");
    }
}

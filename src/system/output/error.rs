//! Errors of output files, before and while they are written.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use thiserror::Error;

/// An output cannot be written, or writing it failed. A failed write leaves nothing behind.
#[derive(Debug, Error)]
pub enum OutputError {
    #[error("cannot write {path}: the folder {folder} does not exist; create it or choose another path")]
    NoFolder { path: PathBuf, folder: PathBuf },
    #[error("cannot write {path}: no permission; make {folder} writable or choose another path")]
    Denied { path: PathBuf, folder: PathBuf },
    #[error("cannot write {path}: the disk is full; free some space or choose another disk")]
    Full { path: PathBuf },
    #[error(
        "cannot write {path}: a file of that size is beyond the limit for this process; raise the limit (`ulimit -f unlimited`)"
    )]
    TooLarge { path: PathBuf },
    #[error("cannot write {path}: it exists and is not a regular file; give the name of a file")]
    NotAFile { path: PathBuf },
    #[error("cannot write {path}: {blocker} is not a folder; choose another path")]
    NoSuchFolder { path: PathBuf, blocker: PathBuf },
    #[error("cannot create the folder {path}: {blocker} is not a folder; remove it or choose another path")]
    FileInTheWay { path: PathBuf, blocker: PathBuf },
    #[error("{name}: {path} is {input}, which it would overwrite; choose another path")]
    IsInput { name: &'static str, path: PathBuf, input: &'static str },
    #[error("{first} and {second} are the same file, {path}; choose another path for one of them")]
    Twice { first: &'static str, second: &'static str, path: PathBuf },
    #[error("cannot write {path}: {cause}; choose another path")]
    Other { path: PathBuf, cause: io::Error },
}

/// The error for a file whose folder does not exist or is not a folder.
pub(super) fn missing_folder(path: &Path, folder: &Path) -> OutputError {
    let path = path.to_owned();
    match folder.ancestors().find(|part| part.exists() && !part.is_dir()) {
        Some(blocker) => OutputError::NoSuchFolder { path, blocker: blocker.to_owned() },
        None => OutputError::NoFolder { path, folder: folder.to_owned() },
    }
}

/// The error of the operating system as one that names the path and a remedy. `folder` is the one that holds `path`.
pub(super) fn output_error(path: &Path, folder: &Path, cause: io::Error) -> OutputError {
    let path = path.to_owned();
    let folder = folder.to_owned();
    match cause.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory if !folder.is_dir() => missing_folder(&path, &folder),
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => OutputError::Denied { path, folder },
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => OutputError::Full { path },
        ErrorKind::FileTooLarge => OutputError::TooLarge { path },
        ErrorKind::IsADirectory => OutputError::NotAFile { path },
        _ => OutputError::Other { path, cause },
    }
}

//! Replacing a file or folder by another. After a crash the old or the new one is there, complete.

use std::fs::{self, File, Permissions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use nix::errno::Errno;
use nix::fcntl::{AT_FDCWD, RenameFlags, renameat2};

use super::error::{OutputError, output_error};
use super::paths::{TEMPORARY_PREFIX, folder_of, link_target};
use super::write::write_atomically;

/// Part of the name of the copy that will take a folder's place.
const NEW: &str = "new";

/// Part of the name that the old folder gets for a moment on systems that cannot exchange two folders in one step.
const OLD: &str = "old";

/// Bits of the source folder's mode that its copy takes over.
const FOLDER_MODE: u32 = 0o777;

/// Replaces `old` by a copy of `new`: a file by a file, or a folder by a folder.
///
/// # Errors
/// Those of the disk, and a file and a folder as `old` and `new`. `old` then stays as it was.
pub fn replace(old: &Path, new: &Path) -> Result<(), OutputError> {
    if new.is_dir() {
        return replace_folder(old, new).map_err(|cause| output_error(old, folder_of(old), cause));
    }
    let read = |cause| OutputError::Other { path: new.to_owned(), cause };
    let mut source = File::open(new).map_err(read)?;
    write_atomically(old, |file| io::copy(&mut source, file).map(drop))
}

/// Repairs the state after a crash during [`replace`]: it completes an exchange that stopped between its two renames
/// and removes leftover copies.
///
/// # Errors
/// Those of the disk.
pub fn recover(path: &Path) -> Result<(), OutputError> {
    let target = link_target(path);
    let (new, old) = (beside(&target, NEW), beside(&target, OLD));
    let recovered = (|| {
        if !target.exists() && old.exists() {
            fs::rename(&old, &target)?;
        }
        for left in [new, old] {
            remove(&left)?;
        }
        Ok(())
    })();
    recovered.map_err(|cause| output_error(path, folder_of(&target), cause))
}

/// A hidden path in the same folder.
fn beside(path: &Path, what: &str) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    folder_of(path).join(format!("{TEMPORARY_PREFIX}{what}-{name}"))
}

fn remove(folder: &Path) -> io::Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        done => done,
    }
}

fn replace_folder(old: &Path, new: &Path) -> io::Result<()> {
    let target = link_target(old);
    let copy = beside(&target, NEW);
    remove(&copy)?;
    copy_folder(new, &copy).inspect_err(|_| drop(remove(&copy)))?;
    match renameat2(AT_FDCWD, &copy, AT_FDCWD, &target, RenameFlags::RENAME_EXCHANGE) {
        Ok(()) => sync_folder(folder_of(&target)),
        // Some network and union file systems cannot exchange two folders.
        Err(Errno::EINVAL | Errno::ENOSYS | Errno::EOPNOTSUPP) => {
            let between = beside(&target, OLD);
            remove(&between)?;
            fs::rename(&target, &between)?;
            fs::rename(&copy, &target).inspect_err(|_| drop(fs::rename(&between, &target)))?;
            sync_folder(folder_of(&target));
            return remove(&between);
        }
        Err(error) => {
            remove(&copy)?;
            return Err(error.into());
        }
    }
    // After the exchange `copy` is the old folder.
    remove(&copy)
}

/// Copies a folder with its content. Symbolic links are followed. All of it is on the disk when this returns.
fn copy_folder(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir(to)?;
    fs::set_permissions(to, Permissions::from_mode(FOLDER_MODE & fs::metadata(from)?.permissions().mode()))?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if fs::metadata(&source)?.is_dir() {
            copy_folder(&source, &target)?;
        } else {
            fs::copy(&source, &target)?;
            File::open(&target)?.sync_all()?;
        }
    }
    sync_folder(to);
    Ok(())
}

/// Syncs a folder's list of names. Some file systems cannot; the error is ignored, because the files' content is on the
/// disk already.
fn sync_folder(folder: &Path) {
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_in(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn folders_and_files_are_replaced_whole() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("old/gone")).unwrap();
        fs::create_dir_all(at("new/deep")).unwrap();
        fs::write(at("new/deep/file"), "new").unwrap();
        replace(&at("old"), &at("new")).unwrap();
        assert_eq!(names_in(&at("old")), ["deep"]);
        assert_eq!(fs::read(at("old/deep/file")).unwrap(), b"new");
        assert_eq!(names_in(folder.path()), ["new", "old"], "something was left");
        fs::write(at("a"), "old").unwrap();
        replace(&at("a"), &at("new/deep/file")).unwrap();
        assert_eq!(fs::read(at("a")).unwrap(), b"new");
    }

    #[test]
    fn what_a_crash_left_is_cleared() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        // Between the two renames: the old one is aside, the new one not yet there.
        fs::create_dir_all(beside(&at("base"), OLD)).unwrap();
        fs::write(beside(&at("base"), OLD).join("file"), "old").unwrap();
        fs::create_dir_all(beside(&at("base"), NEW)).unwrap();
        recover(&at("base")).unwrap();
        assert_eq!(names_in(folder.path()), ["base"]);
        assert_eq!(fs::read(at("base/file")).unwrap(), b"old");
        recover(&at("base")).unwrap();
    }
}

//! Writing a file so that it appears whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::check::check_folder;
use super::error::{OutputError, output_error};
use super::paths::{folder_of, link_target};
use super::pending::Pending;

/// What a writer writes into. It can seek, which the table of offsets in an EXR file needs.
pub type OutputFile<'a> = BufWriter<&'a mut File>;

/// Writes `path` through a [`Pending`] file in the same folder. That file is synced to the disk and then gets its name,
/// so readers see the old file or the new one and never a part. An existing file is replaced. If `path` is a
/// symbolic link, the file behind it is replaced and the link stays.
///
/// # Errors
/// Those of the disk, and the error that `write` returns. In each case the temporary file is removed and `path` keeps
/// its content.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut OutputFile<'_>) -> io::Result<()>,
) -> Result<(), OutputError> {
    // Renaming onto /dev/null or a pipe would replace it by a file.
    if fs::metadata(path).is_ok_and(|existing| !existing.is_file()) {
        return Err(OutputError::NotAFile { path: path.to_owned() });
    }
    let target = link_target(path);
    let folder = folder_of(&target);
    let written = (|| {
        let mut pending = Pending::create(folder)?;
        let mut file = BufWriter::new(pending.file());
        write(&mut file)?;
        file.flush()?;
        drop(file);
        pending.file().sync_all()?;
        pending.persist(&target)?;
        // The folder holds the new name, so it is synced too. Some file systems cannot sync a folder; the error is
        // ignored, because the file's content is on the disk already.
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
        Ok(())
    })();
    written.map_err(|cause| output_error(path, folder, cause))
}

/// Creates the folder `path` and its missing parents.
///
/// # Errors
/// A file in the way, no permission, a full disk.
pub fn create_folder(path: &Path) -> Result<(), OutputError> {
    check_folder(path)?;
    fs::create_dir_all(path).map_err(|cause| output_error(path, folder_of(path), cause))
}

#[cfg(test)]
mod tests {
    use std::io::{ErrorKind, Seek};

    use super::*;

    fn names_in(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn replaces_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        fs::write(&path, "old and longer").unwrap();
        write_atomically(&path, |file| {
            file.write_all(b"xew")?;
            file.rewind()?;
            file.write_all(b"n")
        })
        .unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names_in(folder.path()), ["out.bin"]);
    }

    #[test]
    fn failure_leaves_nothing_behind_and_the_old_file_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.bin");
        let fail = |file: &mut OutputFile<'_>| {
            file.write_all(b"half of it")?;
            Err(io::Error::from(ErrorKind::StorageFull))
        };
        assert!(matches!(write_atomically(&path, fail), Err(OutputError::Full { .. })));
        assert!(names_in(folder.path()).is_empty());
        fs::write(&path, "old").unwrap();
        assert!(write_atomically(&path, fail).is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names_in(folder.path()), ["out.bin"]);
    }

    #[test]
    fn errors_name_the_path_and_the_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("nowhere/out.bin");
        let message = write_atomically(&missing, |_| Ok(())).unwrap_err().to_string();
        assert!(message.contains("nowhere/out.bin") && message.contains("create it"), "{message}");
        assert!(matches!(write_atomically(folder.path(), |_| Ok(())), Err(OutputError::NotAFile { .. })));
        assert!(matches!(write_atomically(Path::new("/dev/null"), |_| Ok(())), Err(OutputError::NotAFile { .. })));
        fs::write(folder.path().join("file"), "").unwrap();
        let blocked = create_folder(&folder.path().join("file/below/it")).unwrap_err();
        assert!(matches!(blocked, OutputError::FileInTheWay { .. }), "{blocked}");
        let below_a_file = folder.path().join("file/out.bin");
        assert!(matches!(write_atomically(&below_a_file, |_| Ok(())), Err(OutputError::NoSuchFolder { .. })));
    }

    #[test]
    fn links_stay_links() {
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("target"), folder.path().join("link"));
        fs::write(&target, "old").unwrap();
        std::os::unix::fs::symlink(&target, &link).unwrap();
        write_atomically(&link, |file| file.write_all(b"new")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"new");
        fs::remove_file(&target).unwrap();
        write_atomically(&link, |file| file.write_all(b"again")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&target).unwrap(), b"again");
    }

    #[test]
    fn folders_are_created_and_may_exist() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("a/b");
        create_folder(&deep).unwrap();
        create_folder(&deep).unwrap();
        assert!(deep.is_dir());
    }
}

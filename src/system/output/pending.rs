//! A file on its way to its name.
//!
//! It has no name until it is complete, where the file system can do that: even a process that is killed then leaves nothing
//! behind. Elsewhere it has a hidden name, which an error or a signal removes.

use std::fs::{self, File, Permissions};
use std::io::{self, ErrorKind};
use std::os::fd::AsRawFd;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use nix::errno::Errno;
use nix::fcntl::{AT_FDCWD, AtFlags, OFlag, open};
use nix::sys::stat::Mode;
use nix::unistd::linkat;
use tempfile::NamedTempFile;

use super::paths::{TEMPORARY_PREFIX, folder_of};
use crate::system::interrupt::Unfinished;

/// Mode of a new file, from which the kernel removes the bits of the umask. The temporary-file crate would make the
/// file private to its owner (0600).
const MODE_BEFORE_UMASK: u32 = 0o666;

/// Where the kernel names open files.
const OPEN_FILES: &str = "/proc/self/fd";

pub enum Pending {
    Unnamed(File),
    Named(NamedTempFile, Unfinished),
}

impl Pending {
    /// A file in `folder`.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn create(folder: &Path) -> io::Result<Pending> {
        let flags = OFlag::O_TMPFILE | OFlag::O_RDWR | OFlag::O_CLOEXEC;
        match open(folder, flags, Mode::from_bits_truncate(MODE_BEFORE_UMASK)) {
            Ok(file) if Path::new(OPEN_FILES).is_dir() => Ok(Pending::Unnamed(file.into())),
            // Some file systems give every file a name. Other errors come again.
            _ => Pending::named(folder),
        }
    }

    fn named(folder: &Path) -> io::Result<Pending> {
        let make = || {
            let mut builder = tempfile::Builder::new();
            let permissions = Permissions::from_mode(MODE_BEFORE_UMASK);
            builder.prefix(TEMPORARY_PREFIX).suffix(".tmp").permissions(permissions).tempfile_in(folder)
        };
        let (file, unfinished) = Unfinished::make(make, NamedTempFile::path)?;
        Ok(Pending::Named(file, unfinished))
    }

    pub fn file(&mut self) -> &mut File {
        match self {
            Pending::Unnamed(file) => file,
            Pending::Named(file, _) => file.as_file_mut(),
        }
    }

    /// Gives the file its name, in the place of what has it now.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn persist(self, target: &Path) -> io::Result<()> {
        match self {
            Pending::Unnamed(file) => name(&file, target),
            Pending::Named(file, _unfinished) => file.persist(target).map(drop).map_err(|failed| failed.error),
        }
    }
}

/// Names a file that has no name.
fn name(file: &File, target: &Path) -> io::Result<()> {
    /// More than writers of one file ever meet.
    const TRIES: usize = 100;
    let open = format!("{OPEN_FILES}/{}", file.as_raw_fd());
    let link = |path: &Path| linkat(AT_FDCWD, open.as_str(), AT_FDCWD, path, AtFlags::AT_SYMLINK_FOLLOW);
    match link(target) {
        Err(Errno::EEXIST) => {}
        done => return Ok(done?),
    }
    // A link replaces nothing, but a rename does. The name in between is the same for every writer of the target: what a
    // kill between these two lines leaves, the next writer removes.
    let hash = blake3::hash(target.file_name().unwrap_or_default().as_encoded_bytes()).to_hex();
    let between = folder_of(target).join(format!("{TEMPORARY_PREFIX}{}.tmp", &hash[..16]));
    for _ in 0..TRIES {
        match link(&between) {
            Ok(()) => {}
            Err(Errno::EEXIST) => match fs::remove_file(&between) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
                _ => continue,
            },
            Err(error) => return Err(error.into()),
        }
        match fs::rename(&between, target) {
            // Another writer of the same target took it away.
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            done => return done,
        }
    }
    Err(ErrorKind::ResourceBusy.into())
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    #[test]
    fn both_kinds_take_their_name_over_an_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        for (text, make) in [("one", Pending::create as fn(&Path) -> _), ("two", Pending::named)] {
            for _ in 0..2 {
                let mut pending: Pending = make(folder.path()).unwrap();
                pending.file().write_all(text.as_bytes()).unwrap();
                pending.persist(&path).unwrap();
                assert_eq!(fs::read_to_string(&path).unwrap(), text);
                assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
            }
        }
    }

    #[test]
    fn what_a_kill_left_between_link_and_rename_is_used_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        fs::write(&path, "old").unwrap();
        let hash = blake3::hash(b"out").to_hex();
        fs::write(folder.path().join(format!("{TEMPORARY_PREFIX}{}.tmp", &hash[..16])), "left").unwrap();
        let mut pending = Pending::create(folder.path()).unwrap();
        pending.file().write_all(b"new").unwrap();
        pending.persist(&path).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        // File systems that name every file have no such name.
        if matches!(Pending::create(folder.path()).unwrap(), Pending::Unnamed(_)) {
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        }
    }
}

//! Reading of input files.

use std::fs::{self, File};
use std::io;
use std::path::Path;

/// Content of a regular file. Pipes and devices are refused before they are opened: one may wait for its other end for
/// ever, the other may never end.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    check_regular(path)?;
    fs::read(path)
}

/// The same for what reads a file piece by piece.
pub fn open_file(path: &Path) -> io::Result<File> {
    check_regular(path)?;
    File::open(path)
}

fn check_regular(path: &Path) -> io::Result<()> {
    if fs::metadata(path)?.is_file() {
        return Ok(());
    }
    Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"))
}

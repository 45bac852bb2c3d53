//! Reading of input files.

use std::fs;
use std::io;
use std::path::Path;

/// Content of a regular file. Pipes and devices are refused before they are opened: one may wait for its other end for
/// ever, the other may never end.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
    }
    fs::read(path)
}

//! Reading of input files.

use std::fs::{self, File};
use std::io;
use std::path::Path;

/// Content of a regular file.
///
/// # Errors
/// Those of the disk, and any file that is not regular. Pipes and devices are refused before they are opened, because
/// opening a pipe can wait forever and reading a device can go on forever.
pub fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    check_regular(path)?;
    fs::read(path)
}

/// Text of a regular file.
///
/// # Errors
/// As those of [`read_file`], and bytes that are no text.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_file(path)?).map_err(|_| io::Error::other("it is no text (UTF-8)"))
}

/// Opens a regular file, for callers that read it piece by piece.
///
/// # Errors
/// As those of [`read_file`].
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "content").unwrap();
        assert_eq!(read_file(&file).unwrap(), b"content");
        open_file(&file).unwrap();
        // Reading these would never end, or would wait.
        for path in [Path::new("/dev/zero"), folder.path()] {
            assert_eq!(read_file(path).unwrap_err().kind(), io::ErrorKind::InvalidInput);
            assert_eq!(open_file(path).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        }
        assert_eq!(read_file(&folder.path().join("missing")).unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}

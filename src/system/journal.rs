//! A file that grows by records and may be cut off anywhere: what stands before the cut counts.
//!
//! Layout: [`MAGIC`], the BLAKE3 hash of what the records belong to, then records. A record is its kind and its key (u32
//! each), the length of its payload (u64), a check of these three (u64), the BLAKE3 hash of the payload, and the payload;
//! numbers are little-endian. Opening walks over the heads alone; a payload is checked where it is read.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use super::input::open_file;
use super::output::{OutputError, write_atomically};

/// First bytes of every journal.
const MAGIC: &[u8; 20] = b"lightprobe-resume/4\n";

const HASH_BYTES: u64 = 32;
const HEADER_BYTES: u64 = MAGIC.len() as u64 + HASH_BYTES;
const HEAD_BYTES: u64 = 24 + HASH_BYTES;

/// Where a record's payload lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    offset: u64,
    length: u64,
}

/// A record without its payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Record {
    pub kind: u32,
    pub key: u32,
    pub place: Place,
}

/// Why a journal cannot be opened.
#[derive(Debug)]
pub enum JournalError {
    Unreadable(io::Error),
    /// Another file, or one of another version.
    Foreign,
    /// Its records belong to something else.
    Other,
}

#[derive(Debug)]
pub struct Journal {
    file: File,
    path: PathBuf,
    end: u64,
}

/// Reads payloads of a journal while it grows.
#[derive(Debug)]
pub struct Reader(File);

fn hash(bytes: &[u8]) -> [u8; HASH_BYTES as usize] {
    *blake3::hash(bytes).as_bytes()
}

/// The head of a record, without the hash of its payload.
fn head(kind: u32, key: u32, length: u64) -> [u8; 24] {
    let mut head = [0; 24];
    head[..4].copy_from_slice(&kind.to_le_bytes());
    head[4..8].copy_from_slice(&key.to_le_bytes());
    head[8..16].copy_from_slice(&length.to_le_bytes());
    let check = hash(&head[..16]);
    head[16..].copy_from_slice(&check[..8]);
    head
}

impl Journal {
    /// An empty journal in the place of what `path` is now, a journal or nothing. `identity` is all that the records depend
    /// on.
    ///
    /// # Errors
    /// Those of the disk, and another file at `path`.
    pub fn create(path: &Path, identity: &str) -> Result<Journal, OutputError> {
        if path.exists() && !is_journal(path) {
            let cause = io::Error::new(ErrorKind::AlreadyExists, "another file is there");
            return Err(OutputError::Other { path: path.to_owned(), cause });
        }
        write_atomically(path, |file| {
            file.write_all(MAGIC)?;
            file.write_all(&hash(identity.as_bytes()))
        })?;
        let opened = OpenOptions::new().read(true).write(true).open(path);
        let file = opened.map_err(|cause| OutputError::Other { path: path.to_owned(), cause })?;
        Ok(Journal { file, path: path.to_owned(), end: HEADER_BYTES })
    }

    /// An existing journal with its records, in their order. What follows the last whole one is cut off when the next is
    /// appended.
    ///
    /// # Errors
    /// It is no journal, or one of another identity.
    pub fn open(path: &Path, identity: &str) -> Result<(Journal, Vec<Record>), JournalError> {
        let mut file = open_file(path).map_err(JournalError::Unreadable)?;
        check_header(&mut file, identity)?;
        let length = file.metadata().map_err(JournalError::Unreadable)?.len();
        let (mut records, mut end) = (Vec::new(), HEADER_BYTES);
        let mut bytes = [0; HEAD_BYTES as usize];
        while length - end >= HEAD_BYTES {
            file.read_exact_at(&mut bytes, end).map_err(JournalError::Unreadable)?;
            let number = |at: usize| u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes[at + i]));
            let (kind, key) = (number(0), number(4));
            let payload = u64::from(number(8)) | u64::from(number(12)) << 32;
            if bytes[..24] != head(kind, key, payload) || payload > length - end - HEAD_BYTES {
                break;
            }
            records.push(Record { kind, key, place: Place { offset: end, length: payload } });
            end += HEAD_BYTES + payload;
        }
        let file = OpenOptions::new().read(true).write(true).open(path).map_err(JournalError::Unreadable)?;
        Ok((Journal { file, path: path.to_owned(), end }, records))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes of all whole records and the header.
    pub fn end(&self) -> u64 {
        self.end
    }

    /// Adds a record. It is not waited for the disk: a kill of the process loses nothing that is written, and what a crash of
    /// the machine loses is found out when it is read.
    ///
    /// # Errors
    /// Those of the disk; the journal then ends where it did.
    pub fn append(&mut self, kind: u32, key: u32, payload: &[u8]) -> io::Result<Place> {
        let place = Place { offset: self.end, length: payload.len() as u64 };
        let mut first = head(kind, key, place.length).to_vec();
        first.extend(hash(payload));
        self.file.seek(SeekFrom::Start(self.end))?;
        self.file.write_all(&first)?;
        self.file.write_all(payload)?;
        self.end += HEAD_BYTES + place.length;
        Ok(place)
    }

    /// Forgets all records after the first `end` bytes.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn cut(&mut self, end: u64) -> io::Result<()> {
        self.file.set_len(end)?;
        self.end = end;
        Ok(())
    }

    /// # Errors
    /// Those of the system.
    pub fn reader(&self) -> io::Result<Reader> {
        Ok(Reader(self.file.try_clone()?))
    }
}

impl Reader {
    /// A payload.
    ///
    /// # Errors
    /// Those of the disk, and a payload that is not what was written.
    pub fn read(&self, place: Place) -> io::Result<Vec<u8>> {
        // The file was long enough when the place was found or written.
        let mut bytes = vec![0; HASH_BYTES as usize + place.length as usize];
        self.0.read_exact_at(&mut bytes, place.offset + HEAD_BYTES - HASH_BYTES)?;
        let payload = bytes.split_off(HASH_BYTES as usize);
        match bytes == hash(&payload) {
            true => Ok(payload),
            false => Err(ErrorKind::InvalidData.into()),
        }
    }
}

fn check_header(file: &mut File, identity: &str) -> Result<(), JournalError> {
    let mut header = [0; HEADER_BYTES as usize];
    match file.read_exact(&mut header) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Err(JournalError::Foreign),
        done => done.map_err(JournalError::Unreadable)?,
    }
    let (magic, of) = header.split_at(MAGIC.len());
    match () {
        _ if magic != MAGIC => Err(JournalError::Foreign),
        _ if of != hash(identity.as_bytes()) => Err(JournalError::Other),
        _ => Ok(()),
    }
}

/// Whether a file begins as a journal does.
pub fn is_journal(path: &Path) -> bool {
    let mut magic = [0; MAGIC.len()];
    open_file(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok() && &magic == MAGIC
}

/// Whether a file is a journal with anything behind its header.
pub fn holds_records(path: &Path) -> bool {
    is_journal(path) && fs::metadata(path).is_ok_and(|file| file.len() > HEADER_BYTES)
}

/// Deletes a journal; a file of the same name that is none is left alone.
pub fn remove(path: &Path) {
    if is_journal(path) {
        // What could be gone on from is of no more use, and of little harm.
        let _ = fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(path: &Path) -> Journal {
        let mut journal = Journal::create(path, "mine").unwrap();
        for (key, payload) in [&b"one"[..], b"", b"three"].into_iter().enumerate() {
            journal.append(7, key as u32, payload).unwrap();
        }
        journal
    }

    #[test]
    fn records_come_back_from_every_cut() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let end = written(&path).end();
        let whole = fs::read(&path).unwrap();
        assert_eq!(whole.len() as u64, end);
        for cut in 0..whole.len() {
            fs::write(&path, &whole[..cut]).unwrap();
            let opened = Journal::open(&path, "mine");
            if (cut as u64) < HEADER_BYTES {
                assert!(matches!(opened, Err(JournalError::Foreign)), "{cut}");
                continue;
            }
            let (mut journal, records) = opened.unwrap();
            let ends = [3, 0, 5].iter().scan(HEADER_BYTES, |end, n| {
                *end += HEAD_BYTES + n;
                Some(*end)
            });
            assert_eq!(records.len(), ends.filter(|end| *end <= cut as u64).count(), "{cut}");
            // It goes on after the last whole record.
            journal.append(1, 9, b"next").unwrap();
            let (journal, again) = Journal::open(&path, "mine").unwrap();
            assert_eq!(again.len(), records.len() + 1);
            assert_eq!(journal.reader().unwrap().read(again[records.len()].place).unwrap(), b"next");
        }
    }

    #[test]
    fn damage_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        written(&path);
        let whole = fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 1;
            fs::write(&path, &damaged).unwrap();
            let Ok((journal, records)) = Journal::open(&path, "mine") else { continue };
            let reader = journal.reader().unwrap();
            let good = records.iter().filter(|record| reader.read(record.place).is_ok()).count();
            assert!(good < 3, "byte {at} may be anything");
        }
    }

    #[test]
    fn others_are_told_apart_and_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        written(&path);
        assert!(matches!(Journal::open(&path, "yours"), Err(JournalError::Other)));
        fs::write(&path, "my notes").unwrap();
        assert!(matches!(Journal::open(&path, "mine"), Err(JournalError::Foreign)));
        assert!(Journal::create(&path, "mine").is_err());
        remove(&path);
        assert_eq!(fs::read(&path).unwrap(), b"my notes");
        fs::remove_file(&path).unwrap();
        let mut journal = written(&path);
        journal.cut(HEADER_BYTES).unwrap();
        assert!(Journal::open(&path, "mine").unwrap().1.is_empty());
        remove(&path);
        assert!(!path.exists());
    }
}

//! What a long bake saves of its work in a [`Journal`] beside the output, and takes up again.
//!
//! Saved are captured probes, where the iterations have come to, and the light at the points of a fit. What placement finds is as good as its grid, and is found
//! again. Captures that do not fit into memory are read from the same file.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::Vec2;

use super::circumstances::Checkpoint;
use crate::probe::Volume;
use crate::probe::capture::{ProbeCapture, bytes};
use crate::probe::container::FileError;
use crate::probe::fit;
use crate::probe::transport::checkpoint;
use crate::probe::transport::solver::Progress;
use crate::system::format;
use crate::system::journal::{Journal, JournalError, Place, Reader, Record};

/// What a record holds; its key is the number of a probe or of a block of points, or 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A capture that says where the rays of others are worth most.
    Pilot = 1,
    Capture = 2,
    Progress = 3,
    /// Light at some points of a fit.
    Fit = 4,
}

/// Records of progress take at most this many bytes, or as many as all captures, before the older ones are cut off.
const PROGRESS_BYTES: u64 = 64 << 20;

/// Where the work on an output is saved.
pub fn path_for(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(".resume");
    name.into()
}

/// All that a bake's result depends on, and so what saved work must have been made of.
pub fn identity(scene_blake3: &str, seed: u64, config: &str) -> String {
    format!("{} {scene_blake3} seed {seed} {config}", env!("CARGO_PKG_VERSION"))
}

/// What a file holds of saved work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Saved {
    pub captures: usize,
    /// Whether iterations have begun.
    pub iterates: bool,
    /// Blocks of points of a fit.
    pub blocks: usize,
}

impl Saved {
    fn of(records: &[Record]) -> Saved {
        let count = |kind: Kind| records.iter().filter(|record| record.kind == kind as u32).count();
        let (captures, blocks) = (count(Kind::Capture), count(Kind::Fit));
        Saved { captures, iterates: count(Kind::Progress) > 0, blocks }
    }

    pub fn in_words(&self) -> String {
        let captures = format::counted(self.captures as u64, "captured probe", "captured probes");
        let light = if self.iterates { ", the light of the last saved iteration" } else { "" };
        let points = match self.blocks {
            0 => String::new(),
            blocks => format!(", {} of the fit", format::counted(blocks as u64, "block of paths", "blocks of paths")),
        };
        format!("{captures}{light}{points}")
    }
}

/// What can be gone on from; refuses what cannot, before anything is traced.
///
/// # Errors
/// The file is none of saved work, or of another bake's.
pub fn check(path: &Path, identity: &str) -> Result<Saved, FileError> {
    open(path, identity).map(|(_, records)| Saved::of(&records))
}

fn open(path: &Path, identity: &str) -> Result<(Journal, Vec<Record>), FileError> {
    Journal::open(path, identity).map_err(|error| match error {
        JournalError::Unreadable(cause) => FileError::Unreadable { path: path.to_owned(), cause },
        JournalError::Foreign => {
            FileError::NoCheckpoint { path: path.to_owned(), what: "it is damaged or no resume file".to_owned() }
        }
        JournalError::Other => FileError::OtherBake { path: path.to_owned() },
    })
}

pub struct Saving<'a> {
    checkpoint: Option<&'a Checkpoint>,
    identity: String,
    journal: Option<(Journal, Reader)>,
    /// Of a bake before: by kind and key, the last of each.
    found: BTreeMap<(u32, u32), Place>,
    saved: Saved,
    /// Bytes of the journal up to its last capture.
    captures_end: u64,
    last: Instant,
    /// Why nothing more is saved.
    failure: Option<String>,
}

impl<'a> Saving<'a> {
    /// Takes up what a bake before has saved where the checkpoint asks for that.
    ///
    /// # Errors
    /// As those of [`check`].
    pub fn new(checkpoint: Option<&'a Checkpoint>, identity: String) -> Result<Saving<'a>, FileError> {
        let mut saving = Saving { checkpoint, identity, ..Saving::nothing() };
        if let Some(Checkpoint { path, resume: true, .. }) = checkpoint
            && path.exists()
        {
            let (journal, records) = open(path, &saving.identity)?;
            saving.saved = Saved::of(&records);
            saving.found = records.iter().map(|record| ((record.kind, record.key), record.place)).collect();
            saving.captures_end = journal.end();
            saving.opened(Ok(journal));
        }
        Ok(saving)
    }

    /// Saves nothing.
    pub fn nothing() -> Saving<'static> {
        Saving {
            checkpoint: None,
            identity: String::new(),
            journal: None,
            found: BTreeMap::new(),
            saved: Saved::of(&[]),
            captures_end: 0,
            last: Instant::now(),
            failure: None,
        }
    }

    /// Why work could not be saved; `None` where it could, or needed not be.
    pub fn failure(self) -> Option<String> {
        self.failure
    }

    /// Whether records can be added.
    pub fn is_open(&self) -> bool {
        self.journal.is_some() && self.failure.is_none()
    }

    /// Whether it is time to begin, or to save what changes.
    pub fn is_due(&self) -> bool {
        let is_late = |checkpoint: &Checkpoint| self.last.elapsed() >= checkpoint.interval;
        self.failure.is_none() && self.checkpoint.is_some_and(is_late)
    }

    /// Whether anything may ever be saved.
    pub fn is_wanted(&self) -> bool {
        self.checkpoint.is_some() && self.failure.is_none()
    }

    /// Begins a file where there is none. Returns whether records can be added.
    pub fn begin(&mut self) -> bool {
        if let Some(checkpoint) = self.checkpoint.filter(|_| self.journal.is_none() && self.failure.is_none()) {
            let journal = Journal::create(&checkpoint.path, &self.identity);
            self.captures_end = journal.as_ref().map_or(0, Journal::end);
            self.opened(journal.map_err(|error| error.to_string()));
        }
        self.is_open()
    }

    fn opened(&mut self, journal: Result<Journal, String>) {
        let with_reader = |journal: Journal| match journal.reader() {
            Ok(reader) => Ok((journal, reader)),
            Err(error) => Err(error.to_string()),
        };
        match journal.and_then(with_reader) {
            Ok(opened) => self.journal = Some(opened),
            Err(error) => self.failure = Some(error),
        }
    }

    /// A probe's capture as a bake before has saved it, with its filtered distances, and where it is.
    pub fn capture(&self, kind: Kind, probe: usize) -> Option<(ProbeCapture, Vec<Vec2>, Place)> {
        let place = *self.found.get(&(kind as u32, probe as u32))?;
        let (_, reader) = self.journal.as_ref()?;
        let (capture, filtered) = bytes::unpack(&reader.read(place).ok()?)?;
        Some((capture, filtered, place))
    }

    /// Adds a capture that [`bytes::pack`] has packed. `None` where that is not possible.
    pub fn add_capture(&mut self, kind: Kind, probe: usize, packed: &[u8]) -> Option<Place> {
        let place = self.append(kind, probe as u32, packed)?;
        self.captures_end = self.journal.as_ref().map_or(0, |(journal, _)| journal.end());
        self.saved.captures += usize::from(kind == Kind::Capture);
        Some(place)
    }

    /// Puts the volume where the bake before had come to, and returns how far that was.
    pub fn progress(&self, volume: &mut Volume) -> Progress {
        let mut found = || {
            let (_, reader) = self.journal.as_ref()?;
            let bytes = reader.read(*self.found.get(&(Kind::Progress as u32, 0))?).ok()?;
            checkpoint::unpack(&bytes, volume)
        };
        found().unwrap_or_default()
    }

    /// Saves how far the iterations have come, where it is time to.
    pub fn save_progress(&mut self, progress: &Progress, volume: &Volume) {
        if !self.is_due() || !self.begin() {
            return;
        }
        let most = self.captures_end.max(PROGRESS_BYTES);
        let end = self.captures_end;
        let cut = match &mut self.journal {
            Some((journal, _)) if journal.end() - end > most => journal.cut(end),
            _ => Ok(()),
        };
        self.check(cut);
        if self.append(Kind::Progress, 0, &checkpoint::pack(progress, volume)).is_some() {
            self.saved.iterates = true;
        }
        self.last = Instant::now();
    }

    fn append(&mut self, kind: Kind, key: u32, payload: &[u8]) -> Option<Place> {
        if self.failure.is_some() {
            return None;
        }
        let (journal, _) = self.journal.as_mut()?;
        let appended = journal.append(kind as u32, key, payload);
        self.check(appended)
    }

    fn check<T>(&mut self, done: io::Result<T>) -> Option<T> {
        let error = match done {
            Ok(done) => return Some(done),
            Err(error) => error,
        };
        if let Some((journal, _)) = &mut self.journal {
            // Whatever of the last record is there is of no use, and the disk may be full.
            let _ = journal.cut(journal.end());
            let path = journal.path().display();
            self.failure = Some(match error.kind() {
                io::ErrorKind::FileTooLarge => format!("{path} would be beyond the limit of a file's size"),
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                    format!("no room for {path}, the disk is full")
                }
                _ => format!("{path}: {error}"),
            });
        }
        None
    }

    /// What reads back captures that are in the file only.
    pub fn reader(&self) -> Option<Reader> {
        self.journal.as_ref().and_then(|(journal, _)| journal.reader().ok())
    }
}

impl fit::Traced for Saving<'_> {
    fn known(&mut self, block: u32) -> Option<Vec<u8>> {
        let (_, reader) = self.journal.as_ref()?;
        reader.read(*self.found.get(&(Kind::Fit as u32, block))?).ok()
    }

    fn keep(&mut self, block: u32, bytes: &[u8]) {
        if (self.is_open() || self.is_due() && self.begin()) && self.append(Kind::Fit, block, bytes).is_some() {
            self.saved.blocks += 1;
        }
    }
}

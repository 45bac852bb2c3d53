//! Signals that end the program, Ctrl-C among them: what is half-written is removed, and what is left and how to go on is
//! said before the program ends.
//!
//! The signals are blocked in every thread but one, which waits for them. So nothing runs inside a signal handler.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::SystemTime;

use nix::sys::signal::{SigSet, Signal};

use super::format;

/// Signals by which users and systems end a program.
const ENDING: [Signal; 3] = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];

/// What shells add to the number of the signal that ended a program, for its exit code.
const EXIT_BY_SIGNAL: i32 = 128;

/// How to go on, once there is something to go on from.
#[derive(Debug, Clone)]
struct Left {
    file: PathBuf,
    how: String,
    /// Older files are of another run; `None` where this run goes on from them.
    since: Option<SystemTime>,
}

static LEFT: Mutex<Option<Left>> = Mutex::new(None);

/// Files that have a name already and are not complete yet.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A set of paths is whole whatever panicked beside it.
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Says at an interruption that work done so far lies in `file`, if this run has written it by then, and how to go on from it.
/// `resumed`: the run goes on from what is there already.
pub fn leaves(file: PathBuf, how: &str, resumed: bool) {
    let since = (!resumed).then(SystemTime::now);
    if let Ok(mut left) = LEFT.lock() {
        *left = Some(Left { file, how: how.to_owned(), since });
    }
}

/// Waits for ending signals from now on, in a thread of its own. To be called before other threads are started: they take
/// over which signals are blocked.
///
/// A write beyond the limit of a file's size then fails with an error. Otherwise SIGXFSZ would end the program.
pub fn listen() {
    let ending: SigSet = ENDING.into_iter().filter(|signal| !is_ignored(*signal)).collect();
    let mut blocked = ending;
    blocked.add(Signal::SIGXFSZ);
    if blocked.thread_block().is_err() {
        return;
    }
    let wait = move || {
        if let Ok(signal) = ending.wait() {
            end(signal);
        }
    };
    if thread::Builder::new().name("signals".to_owned()).spawn(wait).is_err() {
        // Without a thread that waits, the signals end the program at once.
        let _ = ending.thread_unblock();
    }
}

/// Whether whoever started the program wants it to ignore a signal, as `nohup` does.
fn is_ignored(signal: Signal) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.unwrap_or(0) >> (signal as i32 - 1) & 1 == 1
}

fn end(signal: Signal) {
    // Held until the end: no other thread gives a file a name any more.
    let unfinished = unfinished();
    for path in unfinished.iter() {
        // Nobody is left to be told where this fails.
        let _ = fs::remove_file(path);
    }
    let left = LEFT.lock().ok().and_then(|left| left.clone());
    let mut error = io::stderr().lock();
    // A progress bar may stand in the line.
    let start = if error.is_terminal() { "\r\u{1b}[K" } else { "" };
    let _ = writeln!(error, "{start}interrupted: {}", in_words(left.as_ref()));
    std::process::exit(EXIT_BY_SIGNAL + signal as i32);
}

/// A file with a name that is not complete. An end by a signal removes it.
pub struct Unfinished(PathBuf);

impl Unfinished {
    /// Makes the file; no signal comes between its name and its entry here.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn make<T>(
        make: impl FnOnce() -> io::Result<T>,
        path: impl FnOnce(&T) -> &Path,
    ) -> io::Result<(T, Unfinished)> {
        let mut unfinished = unfinished();
        let made = make()?;
        let path = path(&made).to_owned();
        unfinished.insert(path.clone());
        Ok((made, Unfinished(path)))
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        unfinished().remove(&self.0);
    }
}

fn in_words(left: Option<&Left>) -> String {
    let nothing = || "nothing is left; the same command starts anew".to_owned();
    let Some(Left { file, how, since }) = left else { return nothing() };
    let Ok(metadata) = std::fs::metadata(file) else { return nothing() };
    if since.is_some_and(|since| metadata.modified().is_ok_and(|written| written < since)) {
        return nothing();
    }
    let size = if metadata.is_file() { format!(", {}", format::bytes(metadata.len())) } else { String::new() };
    format!("the work so far is in {}{size}; {how}", file.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_there_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.resume");
        let mut left = Left { file: file.clone(), how: "go on with --resume".into(), since: None };
        assert!(in_words(Some(&left)).starts_with("nothing is left"));
        std::fs::write(&file, [0; 2048]).unwrap();
        let told = in_words(Some(&left));
        assert!(told.contains("a.resume, 2.00 KiB; go on with --resume"), "{told}");
        left.since = Some(SystemTime::now() + std::time::Duration::from_secs(60));
        assert!(in_words(Some(&left)).starts_with("nothing is left"));
        assert!(in_words(None).starts_with("nothing is left"));
    }

    #[test]
    fn unfinished_files_are_known_until_they_are_done() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("half");
        let make = || fs::write(&path, "half").map(|()| path.clone());
        let (_, half) = Unfinished::make(make, PathBuf::as_path).unwrap();
        assert!(unfinished().contains(&path));
        drop(half);
        assert!(!unfinished().contains(&path));
        assert!(Unfinished::make(|| fs::read_link(&path), PathBuf::as_path).is_err());
        assert!(!unfinished().contains(&path));
    }
}

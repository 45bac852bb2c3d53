//! What Ctrl-C leaves, and how to go on: said before the program ends.

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::SystemTime;

use super::format;

/// Exit code of a program that SIGINT ended, as shells give it.
const EXIT_INTERRUPTED: i32 = 130;

/// How to go on, once there is something to go on from.
#[derive(Debug, Clone)]
struct Left {
    file: PathBuf,
    how: String,
    /// Older files are of another run; `None` where this run goes on from them.
    since: Option<SystemTime>,
}

static LEFT: Mutex<Option<Left>> = Mutex::new(None);

/// Says on Ctrl-C that work done so far lies in `file`, if this run has written it by then, and how to go on from it.
/// `resumed`: the run goes on from what is there already.
pub fn leaves(file: PathBuf, how: &str, resumed: bool) {
    let since = (!resumed).then(SystemTime::now);
    if let Ok(mut left) = LEFT.lock() {
        *left = Some(Left { file, how: how.to_owned(), since });
    }
}

/// Takes Ctrl-C over. Without that it ends the program just as well, and says nothing.
pub fn listen() {
    // It fails where a handler stands already, as when commands run twice in one process.
    let _ = ctrlc::set_handler(|| {
        let left = LEFT.lock().ok().and_then(|left| left.clone());
        let mut error = std::io::stderr().lock();
        // A progress bar may stand in the line.
        let start = if error.is_terminal() { "\r\u{1b}[K" } else { "" };
        // Nobody is left to be told where this fails.
        let _ = writeln!(error, "{start}interrupted: {}", in_words(left.as_ref()));
        std::process::exit(EXIT_INTERRUPTED);
    });
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
}

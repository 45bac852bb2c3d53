//! What every report begins with.

use serde::Serialize;

#[derive(Debug, Clone, Serialize)]
pub struct Header {
    /// Name and version of the report's layout.
    pub schema: &'static str,
    /// Of the program.
    pub version: &'static str,
    pub command: &'static str,
    /// How the program was called: see [`command_line`]. Paths are relative to the folder it was called in.
    pub command_line: String,
    pub seed: u64,
    pub threads: usize,
    /// Of every byte of the scene's files and of its sky.
    pub scene_blake3: String,
    /// Effective configuration, RON.
    pub config: String,
}

/// What called this process, as a POSIX shell reads it back. The program goes by its name alone: where it lies is the machine's
/// affair, and reports are kept with sources. Words that are not UTF-8 are shown as near as UTF-8 comes.
///
/// Only those arguments are told that are `wanted`.
pub fn command_line(wanted: impl Fn(&str) -> bool) -> String {
    let arguments = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    line_of(arguments.filter(|word| wanted(word)))
}

fn line_of(arguments: impl Iterator<Item = String>) -> String {
    let words: Vec<String> = std::iter::once(env!("CARGO_PKG_NAME").to_owned()).chain(arguments).collect();
    // Only a zero byte cannot be quoted, and no argument of a process holds one.
    shlex::try_join(words.iter().map(String::as_str)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_reads_the_words_back() {
        let words = ["bake", "it's; rm -r ~", "", "--set", "grid.spacing_m=0.5", "$(x)", "a\nb", "\u{e9}"];
        let line = line_of(words.iter().map(|word| (*word).to_owned()));
        assert!(line.starts_with("lightprobe bake ") && line.contains(" --set 'grid.spacing_m=0.5' "), "{line}");
        let script = format!("lightprobe() {{ printf '%s\\0' \"$@\"; }}; {line}");
        let said = std::process::Command::new("sh").args(["-c", &script]).output().unwrap().stdout;
        let said = String::from_utf8(said).unwrap();
        assert_eq!(said.split_terminator('\0').collect::<Vec<_>>(), words);
    }
}

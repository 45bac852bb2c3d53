//! Runs the built program.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::common::Folder;
use crate::probe_file::ProbeFile;

/// What a run of the program left behind.
pub struct Run {
    /// `None` where a signal ended it.
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Run {
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("no JSON on stdout ({e}): {}", self.stdout))
    }
}

pub fn command() -> Command {
    Command::new(env!("CARGO_BIN_EXE_lightprobe"))
}

/// The same with the signals that a terminal gives it. Shells have what runs in the background ignore Ctrl-C, and whatever that
/// starts, the tests too.
pub fn interruptible() -> Command {
    let mut env = Command::new("env");
    env.args(["--default-signal=INT,TERM,HUP", env!("CARGO_BIN_EXE_lightprobe")]);
    env
}

/// Runs it to its end, however it ends.
pub fn run<S: AsRef<OsStr>>(arguments: &[S]) -> Run {
    finish(command().args(arguments))
}

pub fn finish(command: &mut Command) -> Run {
    let output = command.output().expect("the program starts");
    let run = Run {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).expect("UTF-8 on stdout"),
        stderr: String::from_utf8(output.stderr).expect("UTF-8 on stderr"),
    };
    assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
    run
}

/// Runs it and expects success.
pub fn succeed<S: AsRef<OsStr>>(arguments: &[S]) -> Run {
    let run = run(arguments);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    run
}

/// Runs it and expects exit code 2 with one error, on one line, which it returns.
pub fn refuse<S: AsRef<OsStr>>(arguments: &[S]) -> String {
    one_error(&run(arguments))
}

/// The one line of error of a run that ended with exit code 2; warnings may stand before it.
pub fn one_error(run: &Run) -> String {
    assert_eq!(run.code, Some(2), "stdout: {}\nstderr: {}", run.stdout, run.stderr);
    let errors: Vec<&str> = run.stderr.lines().filter(|line| !line.starts_with("warning: ")).collect();
    assert_eq!(errors.len(), 1, "not one line of error: {}", run.stderr);
    assert!(errors[0].starts_with("error: "), "{}", run.stderr);
    errors[0].to_owned()
}

/// A scene of the repository.
pub fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(format!("{name}.glb"))
}

pub fn text(path: &Path) -> &str {
    path.to_str().expect("paths of tests are UTF-8")
}

/// A finished bake.
pub struct Bake {
    pub path: PathBuf,
    pub bytes: Vec<u8>,
    pub file: ProbeFile,
    pub report: Value,
}

/// Bakes into a folder of its own under `folder`, with the arguments given; `words` are separated by blanks.
pub fn bake(folder: &Folder, scene: &Path, words: &str) -> Bake {
    let path = folder.path().join(format!("{}.probes", blake3::hash(format!("{}{words}", text(scene)).as_bytes())));
    let mut arguments = vec!["bake", text(scene), "-o", text(&path), "-q", "--json"];
    arguments.extend(words.split_whitespace());
    let report = succeed(&arguments).json();
    let bytes = std::fs::read(&path).expect("the probe file that it wrote");
    Bake { file: ProbeFile::parse(&bytes), path, bytes, report }
}

/// As [`bake`] by the preset `physical`: maps of the light where the probes stand. `words` name no preset.
pub fn bake_physical(folder: &Folder, scene: &Path, words: &str) -> Bake {
    bake(folder, scene, &format!("--preset physical {words}"))
}

/// Renders a small picture into `folder`/`name`; the report.
pub fn render(folder: &Folder, scene: &Path, probes: &Path, name: &str, words: &str) -> Value {
    let output = folder.path().join(name);
    let mut arguments = vec!["render", text(scene), text(probes), "-o", text(&output), "-q", "--json"];
    arguments.extend(words.split_whitespace());
    succeed(&arguments).json()
}

/// The entry of one method in a render report.
pub fn method<'r>(report: &'r Value, name: &str) -> &'r Value {
    let methods = report["methods"].as_array().expect("a list of methods");
    methods.iter().find(|m| m["name"] == name).unwrap_or_else(|| panic!("no method {name}"))
}

/// Names of the files in a folder, sorted.
pub fn names_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|e| e.expect("an entry").file_name().into_string().expect("UTF-8")).collect();
    names.sort();
    names
}

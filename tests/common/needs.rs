//! Tests that need what the repository does not bring: shared scenes, a browser, Python.
//!
//! Where it is missing, a test counts as ignored and its line says why. With `CI=true` it fails instead, unless
//! `LIGHTPROBE_WITHOUT` (names of [`Need`], commas between) says that this machine is known to lack it. With
//! `LIGHTPROBE_IGNORED=FILE` each ignored test appends a line to that file: the name of the need, a tab, its own name.
#![allow(dead_code)] // Each user of these needs another part.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use libtest_mimic::{Arguments, Failed, Trial};

/// What a test needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// The shared folder with its scenes.
    Shared,
    /// Chromium or Chrome.
    Browser,
    /// `python3`.
    Python,
    /// `python3` with the packages safetensors and numpy.
    Safetensors,
}

impl Need {
    const ALL: [Need; 4] = [Need::Shared, Need::Browser, Need::Python, Need::Safetensors];

    /// As `LIGHTPROBE_WITHOUT` and the summary of `scripts/test.sh` call it.
    fn name(self) -> &'static str {
        match self {
            Need::Shared => "shared",
            Need::Browser => "browser",
            Need::Python => "python",
            Need::Safetensors => "safetensors",
        }
    }

    fn is_met(self) -> bool {
        let python = |arguments: &[&str]| {
            Command::new("python3").args(arguments).output().is_ok_and(|output| output.status.success())
        };
        match self {
            Need::Shared => shared_scenes().is_dir(),
            Need::Browser => browser().is_some(),
            Need::Python => python(&["--version"]),
            Need::Safetensors => python(&["-c", "from safetensors.numpy import load_file"]),
        }
    }

    /// What is missing, and what to do about it.
    fn complaint(self) -> String {
        match self {
            Need::Shared => {
                format!("{} is absent: set LIGHTPROBE_SHARED to the shared folder", shared_scenes().display())
            }
            Need::Browser => format!("none of {} is on the path: install one or set CHROME", BROWSERS.join(", ")),
            Need::Python => "python3 is not on the path: install it".to_owned(),
            Need::Safetensors => "python3 has no safetensors.numpy: pip install safetensors numpy".to_owned(),
        }
    }
}

/// The shared scenes, whether or not they are there.
pub fn shared_scenes() -> PathBuf {
    let shared = match std::env::var_os("LIGHTPROBE_SHARED") {
        Some(path) => PathBuf::from(path),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"),
    };
    shared.join("scenes")
}

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// The browser that `CHROME` names, else the first on the path.
pub fn browser() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("CHROME").filter(|named| !named.is_empty()) {
        return Some(PathBuf::from(named));
    }
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    BROWSERS.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name))).find(|file| file.is_file())
}

/// A test and what it needs.
pub struct Test {
    pub name: &'static str,
    pub need: Option<Need>,
    pub run: fn(),
}

/// `test!(module::function)` or `test!(module::function, Need::Browser)`; named as the test runner names functions.
#[macro_export]
macro_rules! test {
    ($function:path) => {
        $crate::needs::Test { name: stringify!($function), need: None, run: $function }
    };
    ($function:path, $need:expr) => {
        $crate::needs::Test { name: stringify!($function), need: Some($need), run: $function }
    };
}

/// What `LIGHTPROBE_WITHOUT` names.
fn lacked() -> Result<Vec<Need>, String> {
    let Some(text) = std::env::var_os("LIGHTPROBE_WITHOUT") else { return Ok(Vec::new()) };
    let text = text.to_string_lossy();
    let need_of = |name: &str| {
        Need::ALL.into_iter().find(|need| need.name() == name).ok_or_else(|| {
            let known = Need::ALL.map(Need::name).join(", ");
            format!("LIGHTPROBE_WITHOUT: there is no need called '{name}'; there are {known}")
        })
    };
    text.split(',').map(str::trim).filter(|name| !name.is_empty()).map(need_of).collect()
}

/// Runs the tests as the standard runner does, its arguments included: the `main` of a test without harness.
pub fn run(tests: Vec<Test>) -> ExitCode {
    let arguments = Arguments::from_args();
    let lacked = match lacked() {
        Ok(lacked) => lacked,
        Err(message) => {
            eprintln!("error: {message}");
            return ExitCode::from(2);
        }
    };
    let must_run = std::env::var_os("CI").is_some_and(|ci| ci == "true");
    let missing: Vec<Need> = Need::ALL
        .into_iter()
        .filter(|need| tests.iter().any(|test| test.need == Some(*need)) && !need.is_met())
        .collect();
    let mut ignored = Vec::new();
    let trial = |test: Test| {
        let passing = move || -> Result<(), Failed> {
            (test.run)();
            Ok(())
        };
        let Some(need) = test.need.filter(|need| missing.contains(need)) else {
            return Trial::test(test.name, passing);
        };
        let complaint = need.complaint();
        let trial = Trial::test(test.name, || Err(complaint.into()));
        if must_run && !lacked.contains(&need) {
            return trial;
        }
        ignored.push((need, test.name));
        trial.with_kind(format!("no {}", need.name())).with_ignored_flag(true)
    };
    let trials = tests.into_iter().map(trial).collect();
    let conclusion = libtest_mimic::run(&arguments, trials);
    if !arguments.list {
        record(&ignored);
    }
    for need in &missing {
        eprintln!("note: {}", need.complaint());
    }
    conclusion.exit_code()
}

fn record(ignored: &[(Need, &str)]) {
    let Some(path) = std::env::var_os("LIGHTPROBE_IGNORED") else { return };
    let lines: String = ignored.iter().map(|(need, name)| format!("{}\t{name}\n", need.name())).collect();
    let file = OpenOptions::new().create(true).append(true).open(&path);
    file.and_then(|mut file| file.write_all(lines.as_bytes()))
        .unwrap_or_else(|e| panic!("cannot write {}: {e}", Path::new(&path).display()));
}

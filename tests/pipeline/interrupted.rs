//! Bakes that are killed, interrupted or run out of room: nothing is left half-written, and what goes on gives the same file.

use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;

use crate::common::Folder;
use crate::program::{command, finish, interruptible, names_in, one_error, run, scene, succeed, text};

const SET: [&str; 6] = ["--set", "grid.spacing_m=1", "--set", "fit.rows.rows_per_probe=40", "--threads", "2"];

/// A bake that saves all of its work.
struct Bake {
    folder: Folder,
    scene: PathBuf,
    words: Vec<&'static str>,
}

impl Bake {
    fn new(name: &str, words: &[&'static str]) -> Bake {
        Bake { folder: Folder::new(), scene: scene(name), words: words.to_vec() }
    }

    fn output(&self) -> PathBuf {
        self.folder.path().join("a.probes")
    }

    fn arguments<'a>(&'a self, output: &'a Path, more: &[&'a str]) -> Vec<&'a str> {
        let first = ["bake", text(&self.scene), "-o", text(output), "--checkpoint-every", "0"];
        first.into_iter().chain(self.words.iter().copied()).chain(more.iter().copied()).collect()
    }

    /// From beginning to end: the file's bytes, and the report.
    fn whole(&self) -> (Vec<u8>, Value) {
        let report = succeed(&self.arguments(&self.output(), &["--json", "-q"])).json();
        (self.take(), report)
    }

    /// The finished file, which is then gone; nothing else is there.
    fn take(&self) -> Vec<u8> {
        assert_eq!(names_in(self.folder.path()), ["a.probes"]);
        let bytes = std::fs::read(self.output()).unwrap();
        std::fs::remove_file(self.output()).unwrap();
        bytes
    }

    fn start(&self, more: &[&str]) -> Child {
        let output = self.output();
        let mut command = interruptible();
        command.args(self.arguments(&output, more)).stdout(Stdio::null()).stderr(Stdio::piped());
        command.spawn().unwrap()
    }

    /// Kills a bake so long after its start, and goes on.
    fn killed_after(&self, delay: Duration, more: &[&str]) {
        let mut child = self.start(more);
        std::thread::sleep(delay);
        child.kill().unwrap();
        child.wait().unwrap();
        let left = names_in(self.folder.path());
        let known = |name: &String| ["a.probes", "a.probes.resume"].contains(&name.as_str());
        assert!(left.iter().all(known), "after {delay:?}: {left:?}");
    }

    fn resumed(&self) -> Vec<u8> {
        succeed(&self.arguments(&self.output(), &["--resume"]));
        self.take()
    }
}

/// Moments of a whole bake: in the middle of every stage, and `others` more, spread evenly.
fn moments(report: &Value, others: usize) -> Vec<Duration> {
    let seconds = |stage: &str| report["time_s"][stage].as_f64().unwrap();
    let mut began = 0.0;
    let mut found = Vec::new();
    for stage in ["load", "accel_build", "survey", "capture", "bounces", "fit", "encode", "write"] {
        found.push(began + 0.5 * seconds(stage));
        began += seconds(stage);
    }
    // Multiples of the golden ratio's fraction are spread evenly, however many there are.
    found.extend((1..=others).map(|i| began * (i as f64 * 0.618_033_988_75).fract()));
    found.into_iter().map(Duration::from_secs_f64).collect()
}

fn check_kills(name: &str, words: &[&'static str], others: usize) {
    let bake = Bake::new(name, words);
    let (whole, report) = bake.whole();
    for (i, moment) in moments(&report, others).into_iter().enumerate() {
        bake.killed_after(moment, &[]);
        // Some are killed again while they go on.
        if i % 3 == 0 {
            bake.killed_after(moment, &["--resume"]);
        }
        assert!(bake.resumed() == whole, "{name} {words:?}: killed after {moment:?}, the file is another");
    }
}

#[test]
fn killed_bakes_go_on_to_the_same_file() {
    check_kills("two_rooms_open", &SET, 2);
}

/// The same of other methods, and more often.
#[test]
#[ignore = "takes minutes"]
fn bakes_killed_fifty_times_go_on_to_the_same_file() {
    check_kills("two_rooms_open", &SET, 42);
    check_kills("cornell", &["--preset", "physical", "--set", "grid.spacing_m=0.6"], 12);
    check_kills("cornell", &["--preset", "threev8-mixed", "--set", "grid.spacing_m=0.6"], 12);
    check_kills("cornell", &["--preset", "ddgi-2019", "--set", "grid.spacing_m=1"], 12);
    check_kills("cornell", &["--memory-budget", "1MiB", "--set", "grid.spacing_m=0.4"], 12);
}

/// Waits until a bake has saved something, and ends it. One that is done before the signal comes is begun again.
fn ended(bake: &Bake, signal: Signal) -> String {
    const TRIES: usize = 10;
    for _ in 0..TRIES {
        let mut child = bake.start(&[]);
        let saved = bake.folder.path().join("a.probes.resume");
        let started = Instant::now();
        while std::fs::metadata(&saved).map_or(0, |file| file.len()) < 1000 && child.try_wait().unwrap().is_none() {
            assert!(started.elapsed() < Duration::from_secs(60), "nothing is saved");
            std::thread::sleep(Duration::from_millis(1));
        }
        if child.try_wait().unwrap().is_none() {
            kill(Pid::from_raw(child.id() as i32), signal).unwrap();
        }
        let output = child.wait_with_output().unwrap();
        if output.status.code() != Some(0) {
            assert_eq!(output.status.code(), Some(128 + signal as i32));
            return String::from_utf8(output.stderr).unwrap();
        }
        bake.take();
    }
    panic!("{TRIES} bakes were done before {signal}");
}

#[test]
fn interruptions_say_what_is_left() {
    let bake = Bake::new("two_rooms_open", &SET);
    let (whole, _) = bake.whole();
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP] {
        let said = ended(&bake, signal);
        let line = said.lines().last().unwrap_or_default();
        for part in ["interrupted: ", "a.probes.resume, ", "--resume goes on from there"] {
            assert!(line.contains(part), "{said}");
        }
        assert_eq!(names_in(bake.folder.path()), ["a.probes.resume"]);
        let resumed = succeed(&bake.arguments(&bake.output(), &["--resume"]));
        assert!(resumed.stderr.contains("going on from") && resumed.stderr.contains("captured probes"));
        assert!(bake.take() == whole, "{signal}: the file is another");
    }
    let unsaved = bake.folder.path().join("b.probes");
    let mut child = interruptible();
    child.args([
        "bake",
        text(&bake.scene),
        "-o",
        text(&unsaved),
        "--preset",
        "physical",
        "--set",
        "grid.spacing_m=0.1",
    ]);
    let child = child.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).unwrap();
    let said = String::from_utf8(child.wait_with_output().unwrap().stderr).unwrap();
    assert!(said.contains("interrupted: nothing is left"), "{said}");
    assert_eq!(names_in(bake.folder.path()), [""; 0]);
}

#[test]
fn signals_that_are_to_be_ignored_are() {
    let bake = Bake::new("furnace", &["--set", "grid.spacing_m=0.5"]);
    let output = bake.output();
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", "trap '' INT HUP; exec \"$@\"", "sh"]).arg(command().get_program());
    let child = shell.args(bake.arguments(&output, &[])).stdout(Stdio::null()).spawn().unwrap();
    for _ in 0..20 {
        std::thread::sleep(Duration::from_millis(5));
        // It may be done already.
        let _ = kill(Pid::from_raw(child.id() as i32), Signal::SIGHUP);
    }
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(0));
}

/// Runs the program with so large files at most, in blocks of 512 bytes or 1 KiB, as the shell has it.
fn with_files_of(blocks: u32, arguments: &[&str]) -> crate::program::Run {
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", "ulimit -f $0; exec \"$@\"", &blocks.to_string()]).arg(command().get_program()).args(arguments);
    finish(&mut shell)
}

#[test]
fn a_limit_of_file_size_is_an_error_like_others() {
    let bake = Bake::new("two_rooms_open", &SET);
    let (whole, _) = bake.whole();
    let output = bake.output();
    // Without saved work.
    let plain = [&["bake", text(&bake.scene), "-o", text(&output), "-q"][..], &SET].concat();
    let message = one_error(&with_files_of(2, &plain));
    assert!(message.contains("a.probes") && message.contains("ulimit -f"), "{message}");
    assert_eq!(names_in(bake.folder.path()), [""; 0]);
    // Room for the result, but not for the work.
    let blocks = (whole.len() / 512 + 2) as u32;
    let tight = with_files_of(blocks, &bake.arguments(&output, &[]));
    if tight.stderr.contains("was not saved") {
        assert!(tight.code == Some(0) && tight.stderr.contains("limit of a file's size"), "{}", tight.stderr);
    }
    assert!(bake.take() == whole);
}

#[test]
fn captures_that_do_not_fit_are_read_from_the_file() {
    let bake = Bake::new("cornell", &["--set", "grid.spacing_m=0.6"]);
    let (whole, _) = bake.whole();
    let output = bake.output();
    for budget in ["0B", "1GiB"] {
        let arguments = ["bake", text(&bake.scene), "-o", text(&output), "--set", "grid.spacing_m=0.6"];
        succeed(&[&arguments[..], &["--memory-budget", budget]].concat());
        assert!(bake.take() == whole, "{budget}");
    }
    let refused = run(&bake.arguments(&output, &["--memory-budget", "512"]));
    assert!(refused.code == Some(2) && refused.stderr.contains("512MiB"), "{}", refused.stderr);
}

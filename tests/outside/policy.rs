//! What becomes of tests whose needs are not met, seen from outside: this program run again without shared scenes.

use std::path::Path;
use std::process::{Command, Output};

use crate::common::Folder;

const TEST: &str = "loader::shared_scenes_load_or_are_refused";

/// Runs one test that needs shared scenes where there are none, with these variables set and no others of its kind.
fn run(variables: &[(&str, &str)], ignored: &Path) -> Output {
    let mut command = Command::new(std::env::current_exe().expect("the path of this program"));
    command.args([TEST, "--exact"]).env_remove("CI").env_remove("LIGHTPROBE_WITHOUT");
    command.env("LIGHTPROBE_SHARED", "/absent").env("LIGHTPROBE_IGNORED", ignored);
    command.envs(variables.iter().copied()).output().expect("this program starts")
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Whether the file lists the test by its need.
fn is_listed(ignored: &Path) -> bool {
    std::fs::read_to_string(ignored).unwrap_or_default().lines().any(|line| line == format!("shared\t{TEST}"))
}

pub fn what_is_missing_is_ignored_and_said() {
    let folder = Folder::new();
    let file = folder.path().join("ignored");
    let output = run(&[], &file);
    assert!(output.status.success(), "{output:?}");
    let told = stdout(&output);
    assert!(told.contains("no shared") && told.contains("0 passed; 0 failed; 1 ignored"), "{told}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("/absent/scenes is absent"), "{output:?}");
    assert!(is_listed(&file));
}

pub fn what_is_missing_fails_in_continuous_integration() {
    let folder = Folder::new();
    let file = folder.path().join("ignored");
    for variables in [&[("CI", "true")][..], &[("CI", "true"), ("LIGHTPROBE_WITHOUT", "browser")]] {
        let output = run(variables, &file);
        assert!(!output.status.success(), "{output:?}");
        let told = stdout(&output);
        assert!(told.contains("/absent/scenes is absent") && told.contains("0 passed; 1 failed; 0 ignored"), "{told}");
        assert!(!is_listed(&file));
    }
}

pub fn a_machine_may_say_what_it_lacks() {
    let folder = Folder::new();
    let file = folder.path().join("ignored");
    let output = run(&[("CI", "true"), ("LIGHTPROBE_WITHOUT", "browser, shared")], &file);
    assert!(output.status.success(), "{output:?}");
    assert!(stdout(&output).contains("0 passed; 0 failed; 1 ignored"), "{output:?}");
    assert!(is_listed(&file));
    // A name that nothing has would hide nothing, or something else than was meant.
    let output = run(&[("LIGHTPROBE_WITHOUT", "sheared")], &file);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("'sheared'"), "{output:?}");
}

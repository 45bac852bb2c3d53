//! `--update-baseline`.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::Folder;
use crate::made::{diff, text};
use crate::program::{one_error, run};

/// Twice as much is beyond the thresholds.
const GIB: u64 = 1 << 30;

fn side(folder: &Folder, name: &str, bytes: u64) -> PathBuf {
    let path = folder.path().join(name);
    fs::create_dir(&path).unwrap();
    let report =
        |bytes: u64| serde_json::json!({"schema": "lightprobe-bake/1", "peak_memory_bytes": bytes}).to_string();
    fs::write(path.join("bake.json"), report(bytes)).unwrap();
    fs::write(path.join("notes.txt"), name).unwrap();
    path
}

fn content(path: &Path) -> String {
    fs::read_to_string(path.join("bake.json")).unwrap()
}

#[test]
fn the_candidate_takes_the_place_of_the_base() {
    let folder = Folder::new();
    let (base, candidate) = (side(&folder, "base", GIB), side(&folder, "candidate", 4 * GIB));
    let other = content(&candidate);
    let before = diff(&folder, &base, &candidate, &[]);
    assert_eq!(before.code, Some(1));
    assert_ne!(content(&base), other);
    // Whatever the verdict.
    assert_eq!(diff(&folder, &base, &candidate, &["--update-baseline"]).code, Some(0));
    assert_eq!((content(&base), content(&candidate)), (other.clone(), other));
    assert_eq!(fs::read(base.join("notes.txt")).unwrap(), b"candidate");
    let mut names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["base", "candidate", "out"], "something was left");
    assert_eq!(diff(&folder, &base, &candidate, &[]).code, Some(0));
    // Files likewise.
    let (a, b) =
        (folder.write("a.json", content(&base)), folder.write("b.json", content(&base).replace("4294967296", "1")));
    assert_eq!(diff(&folder, &a, &b, &["--update-baseline"]).code, Some(0));
    assert_eq!(fs::read(&a).unwrap(), fs::read(&b).unwrap());
}

#[test]
fn what_cannot_be_compared_leaves_the_base_alone() {
    let folder = Folder::new();
    let base = side(&folder, "base", 100);
    let before = content(&base);
    let broken = side(&folder, "broken", 1);
    fs::write(broken.join("bake.json"), "{").unwrap();
    for candidate in [&broken, &folder.path().join("none"), &base, &base.join("bake.json")] {
        one_error(&diff(&folder, &base, candidate, &["--update-baseline"]));
        assert_eq!(content(&base), before);
    }
    let link = folder.path().join("link");
    std::os::unix::fs::symlink(&base, &link).unwrap();
    assert!(one_error(&diff(&folder, &base, &link, &["--update-baseline"])).contains("are one"));
}

/// Killed at any time, base is the old one or the new one.
#[test]
fn a_kill_leaves_the_old_or_the_new_one() {
    let folder = Folder::new();
    let (base, candidate) = (side(&folder, "base", GIB), side(&folder, "candidate", 4 * GIB));
    // Enough that the copy takes a while.
    fs::write(candidate.join("large.bin"), vec![7_u8; 20 << 20]).unwrap();
    let (old, new) = (content(&base), content(&candidate));
    let out = folder.path().join("out");
    for delay_ms in [2, 5, 10, 20, 30, 40, 60] {
        let arguments = ["diff-report", text(&base), text(&candidate), "-o", text(&out), "--update-baseline", "-q"];
        let mut child = crate::program::command().args(arguments).stdout(std::process::Stdio::null()).spawn().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(delay_ms));
        child.kill().unwrap();
        child.wait().unwrap();
        let found = content(&base);
        assert!(found == old || found == new, "{found}");
        let is_whole = fs::metadata(base.join("large.bin")).is_ok_and(|m| m.len() == 20 << 20);
        assert_eq!(is_whole, found == new, "half of a folder");
    }
    // The next run clears what was left.
    let last = run(&["diff-report", text(&base), text(&candidate), "-o", text(&out), "--update-baseline", "-q"]);
    assert_eq!(last.code, Some(0), "{}", last.stderr);
    let hidden = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    assert_eq!(hidden.filter(|name| name.starts_with('.')).count(), 0);
}

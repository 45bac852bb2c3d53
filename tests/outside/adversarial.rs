//! Files made to break loaders: each bakes and renders, or is refused with one line.

use std::path::{Path, PathBuf};
use std::process::Command;

use nix::sys::resource::{UsageWho, getrusage};

use crate::common::Folder;
use crate::needs::shared_scenes;
use crate::program::{Run, command, finish, names_in, one_error, text};

/// What no run may exceed, bytes.
const MOST_MEMORY: u64 = 1 << 30;

/// Scenes in a folder and all below it, sorted.
pub fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files_below(&path, found);
        } else if path.extension().is_some_and(|e| e == "glb" || e == "gltf") {
            found.push(path);
        }
    }
}

/// Runs with a limit of time against hangs: far above what any of these files takes (some tenths of a second).
fn limited(arguments: &[&str]) -> Run {
    finish(Command::new("timeout").arg("120").arg(command().get_program()).args(arguments))
}

pub fn every_file_renders_or_is_refused() {
    let mut files = Vec::new();
    files_below(&shared_scenes().join("adversarial"), &mut files);
    assert!(files.len() > 20, "only {} files", files.len());
    let (mut rendered, mut refused) = (0, 0);
    for file in &files {
        let folder = Folder::new();
        let (probes, pictures) = (folder.path().join("out.probes"), folder.path().join("pictures"));
        let scene = text(file);
        let small = ["--set", "grid.divisions=(4,4,4)", "--set", "solver.max_bounces=3", "--env", "1,1,1"];
        let bake = limited(&[&["bake", scene, "-o", text(&probes)], &small[..]].concat());
        if bake.code != Some(0) {
            let message = one_error(&bake);
            let name = file.file_name().unwrap().to_str().unwrap();
            assert!(message.contains(name), "{scene}: the message does not name the file: {message}");
            assert_eq!(names_in(folder.path()), [""; 0], "{scene}");
            refused += 1;
            continue;
        }
        let arguments =
            ["render", scene, text(&probes), "-o", text(&pictures), "--size", "64x36", "--env", "1,1,1", "--json"];
        let report = limited(&arguments);
        if report.code != Some(0) {
            // A fault in what only pictures show, such as a normal map.
            let message = one_error(&report);
            assert!(message.contains(scene) && message.contains("normalTexture"), "{scene}: {message}");
            assert!(!pictures.exists(), "{scene}");
            refused += 1;
            continue;
        }
        let peak = report.json()["peak_memory_bytes"].as_u64().unwrap();
        assert!(peak < MOST_MEMORY, "{scene}: {peak} bytes");
        rendered += 1;
    }
    assert!(rendered > 10 && refused > 3, "{rendered} rendered, {refused} refused");
    // The largest of all children of this process, the refused ones and those of other tests included; KiB on Linux.
    let peak = getrusage(UsageWho::RUSAGE_CHILDREN).unwrap().max_rss() as u64 * 1024;
    assert!(peak < MOST_MEMORY, "a run took {peak} bytes");
}

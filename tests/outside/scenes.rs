//! The scenes in `scenes/` are what `scripts/make_scenes.py` writes, byte for byte.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Bytes of every GLB in a folder, by file name.
fn scenes_in(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.expect("a folder that can be listed").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "glb"))
        .map(|path| {
            let name = path.file_name().expect("a file").to_string_lossy().into_owned();
            (name, fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
        })
        .collect()
}

pub fn scenes_are_what_the_script_writes() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let script = root.join("scripts/make_scenes.py");
    let run = Command::new("python3").arg(script).arg("--out").arg(folder.path()).output();
    let output = run.expect("python3 that starts");
    assert!(output.status.success(), "make_scenes.py failed:\n{}", String::from_utf8_lossy(&output.stderr));

    let stored = scenes_in(&root.join("scenes"));
    let written = scenes_in(folder.path());
    let names = |scenes: &BTreeMap<String, Vec<u8>>| scenes.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&stored), names(&written), "scenes/ holds other scenes than make_scenes.py writes");
    for (name, bytes) in &written {
        // assert! and not assert_eq!, which would print both files.
        assert!(
            &stored[name] == bytes,
            "scenes/{name} differs: run python3 scripts/make_scenes.py and look at git diff"
        );
    }
}

//! Bevy without a window, on Vulkan in software.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::Vec3;

use crate::agree::{CAMERAS, SIZE, all_agree, baked, exported, scene, shaded};
use crate::album::Entry;
use crate::mutants;

/// The program of tests/engines/bevy.
pub fn program() -> Option<PathBuf> {
    let program = PathBuf::from(std::env::var_os("LIGHTPROBE_BEVY")?);
    program.is_file().then_some(program)
}

/// Irradiance by Bevy of exports, as cameras see it: a white surface shows E/π.
fn shot(scene: &Path, (width, height): (u32, u32), jobs: &[(&Path, &str)]) -> Vec<Vec<Vec3>> {
    let folder = tempfile::tempdir().unwrap();
    let out = |i: usize| folder.path().join(format!("{i}.f32"));
    let mut command = Command::new(program().expect("these tests run where it is"));
    command.arg(scene).args([width.to_string(), height.to_string()]);
    for (i, (export, camera)) in jobs.iter().enumerate() {
        command.arg(export).arg(camera).arg(out(i));
    }
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let picture = |i: usize| {
        let bytes = fs::read(out(i)).expect("a picture");
        let numbers: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        numbers.as_chunks::<3>().0.iter().map(|p| std::f32::consts::PI * Vec3::from(*p)).collect()
    };
    (0..jobs.len()).map(picture).collect()
}

/// The same for each camera of the two rooms.
fn pictures(name: &str, exports: &[PathBuf]) -> Vec<Vec<Vec<Vec3>>> {
    let jobs = exports.iter().flat_map(|export| CAMERAS.map(|camera| (export.as_path(), camera)));
    let found = shot(&scene(name), SIZE, &jobs.collect::<Vec<_>>());
    found.chunks(CAMERAS.len()).map(<[_]>::to_vec).collect()
}

/// The pictures of an album.
pub fn album(entries: &[Entry]) {
    for entry in entries {
        entry.judge(&shot(&entry.scene, entry.size, &[(&entry.export, &entry.camera)])[0]);
    }
}

pub fn pixels_of_bevy_are_those_of_render() {
    let folder = tempfile::tempdir().unwrap();
    let probes = baked("two_rooms_open", folder.path());
    let export = exported("two_rooms_open", &probes, "bevy", "--fit");
    let (expected, unit) = shaded("two_rooms_open", &export);
    let mut exports = vec![export.clone()];
    exports.extend(mutants::write(&mutants::OF_BEVY, &export, folder.path()));
    let found = pictures("two_rooms_open", &exports);
    assert!(all_agree("bevy", &found[0], &expected, unit));
    for (mutant, found) in mutants::OF_BEVY.iter().zip(&found[1..]) {
        assert!(!all_agree(&format!("bevy, {}", mutant.name), found, &expected, unit), "nobody notices");
    }
}

/// Where a driver has no arrays of textures, and so it looks on lavapipe of Mesa 22.3, Bevy reads the texture of the volume that is
/// nearest to the camera for all volumes. So each camera sees one room alone here.
pub fn several_volumes_in_bevy_are_those_of_render() {
    let folder = tempfile::tempdir().unwrap();
    let name = "two_rooms_sealed";
    let probes = baked(name, folder.path());
    let export = exported(name, &probes, "bevy", "--fit --volumes auto");
    let (expected, unit) = shaded(name, &export);
    let found = pictures(name, &[export]);
    assert!(all_agree("bevy, volumes auto", &found[0], &expected, unit));
}

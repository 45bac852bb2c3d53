//! Damaged, truncated, lying and newer probe files: an error of one line, exit code 2, no panic, no large allocation.

use std::path::Path;

use lightprobe::probe::container::Container;
use lightprobe::probe::file;
use serde_json::{Value, json};

use crate::common::Folder;
use crate::program::{bake, command, finish, one_error, refuse, scene, text};

/// A file; coefficients with gradients by the preset default, maps by physical, with surface visibility or distance maps.
fn whole(folder: &Folder, words: &str) -> Vec<u8> {
    bake(folder, &scene("cornell"), &format!("--set grid.divisions=(3,3,3) {words}")).bytes
}

const MAPS: &str = "--preset physical";
const MOMENTS: &str = "--preset physical \
    --set query.visibility={\"moments\":{\"power\":3,\"floor\":0}} --set filter.distance_resolution=4";

fn is_refused(folder: &Folder, bytes: &[u8]) -> bool {
    file::read(&folder.write("damaged.probes", bytes)).is_err()
}

#[test]
fn truncated_files() {
    let folder = Folder::new();
    let bytes = whole(&folder, "");
    assert!(!is_refused(&folder, &bytes));
    let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let around_header = header - 20..header + 20;
    let steps = (0..bytes.len()).step_by(97);
    for length in (0..32).chain(around_header).chain(steps).chain(bytes.len() - 8..bytes.len()) {
        assert!(is_refused(&folder, &bytes[..length]), "cut to {length} of {} bytes", bytes.len());
    }
    let longer = [&bytes[..], b"and more"].concat();
    assert!(is_refused(&folder, &longer));
}

#[test]
fn flipped_bytes() {
    let folder = Folder::new();
    for words in ["", MAPS, MOMENTS] {
        let bytes = whole(&folder, words);
        let header = 8 + u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        // Every byte of the length, and a walk through header and tensors; 0x01 and 0x80 make no blank of a blank.
        for at in (0..8).chain((8..header).step_by(7)).chain((header..bytes.len()).step_by(101)) {
            for bit in [0x01, 0x80] {
                let mut damaged = bytes.clone();
                damaged[at] ^= bit;
                assert!(is_refused(&folder, &damaged), "byte {at} flipped by {bit:#x}");
            }
        }
    }
}

/// Runs `inspect` and `render` with little memory.
fn refuse_in_little_memory(path: &Path) -> String {
    // 1 GiB of address space: the libraries take a fraction of it, and what a header promises is far more.
    let limited = |arguments: &[&str]| {
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", "ulimit -v 1048576; exec \"$0\" \"$@\""]).arg(command().get_program()).args(arguments);
        one_error(&finish(&mut shell))
    };
    let folder = Folder::new();
    let output = folder.path().join("out");
    let rendered = limited(&["render", text(&scene("cornell")), text(path), "-o", text(&output), "--threads", "1"]);
    assert!(!output.exists(), "a refused file left {}", output.display());
    let inspected = limited(&["inspect", text(path)]);
    assert_eq!(rendered, inspected);
    inspected
}

#[test]
fn lying_headers() {
    let folder = Folder::new();
    let with_header = |length: u64, header: &str, data: &[u8]| {
        let bytes = [&length.to_le_bytes()[..], header.as_bytes(), data].concat();
        folder.write("lying.probes", bytes)
    };
    let huge = u64::from(u32::MAX) * 4;
    let shape = format!(
        r#"{{"irradiance":{{"dtype":"F32","shape":[4294967295,4294967295,4294967295],"data_offsets":[0,{huge}]}}}}"#
    );
    let overlapping =
        r#"{"a":{"dtype":"U8","shape":[4],"data_offsets":[0,4]},"b":{"dtype":"U8","shape":[4],"data_offsets":[2,6]}}"#;
    let negative = r#"{"a":{"dtype":"U8","shape":[4],"data_offsets":[4,0]}}"#;
    let deep = "[".repeat(100_000);
    for (length, header) in [
        (u64::MAX, "{}"),
        (u64::MAX - 7, "{}"),
        (1 << 40, "{}"),
        (100_000_001, "{}"),
        (0, ""),
        (2, "{}"),
        (1, "{}"),
        (2, "[]"),
        (4, "null"),
        (shape.len() as u64, &shape),
        (overlapping.len() as u64, overlapping),
        (negative.len() as u64, negative),
        (deep.len() as u64, &deep),
        (2, "\u{fffd}"),
    ] {
        let message = refuse_in_little_memory(&with_header(length, header, b"12345678"));
        assert!(message.contains("lying.probes") && message.contains("bake it again"), "{message}");
    }
}

/// A file whose hashes hold but whose content does not: written by a program with an error in it.
fn altered(folder: &Folder, words: &str, alter: impl FnOnce(&mut Container)) -> std::path::PathBuf {
    let mut container = Container::read(&folder.write("good.probes", whole(folder, words))).unwrap();
    alter(&mut container);
    let path = folder.path().join("altered.probes");
    container.write(&path).unwrap();
    path
}

fn alter_grid(container: &mut Container, key: &str, value: Value) {
    let mut grid: Value = serde_json::from_str(&container.metadata["grid"]).unwrap();
    grid[key] = value;
    container.metadata.insert("grid".into(), grid.to_string());
}

#[test]
fn wrong_content_under_right_hashes() {
    let folder = Folder::new();
    let unaltered = altered(&folder, MAPS, |_| {});
    assert!(file::read(&unaltered).is_ok());
    let grids: [(&str, Value); 11] = [
        ("divisions", json!([4_294_967_295u32, 4_294_967_295u32, 4_294_967_295u32])),
        ("divisions", json!([0, 3, 9])),
        ("divisions", json!([1, 1, 27, 1])),
        ("divisions", json!([2, 2, 2])),
        ("spacing", json!([0.0, 1.0, 1.0])),
        ("spacing", json!([-1.0, 1.0, 1.0])),
        ("spacing", json!([1e300, 1.0, 1.0])),
        ("origin", json!([null, 0.0, 0.0])),
        ("border", json!(1_000_000)),
        ("border", json!(-1)),
        ("kind", json!("spherical")),
    ];
    for (key, value) in grids {
        let path = altered(&folder, MAPS, |c| alter_grid(c, key, value.clone()));
        let message = refuse_in_little_memory(&path);
        assert!(message.contains("altered.probes"), "{key} {value}: {message}");
    }
    for (key, value) in [
        ("scale.irradiance", "0"),
        ("scale.irradiance", "-1"),
        ("scale.irradiance", "1e39"),
        ("scale.irradiance", "much"),
        ("encoding.irradiance", "logarithmic"),
        ("visibility.voxels_per_cell", "0"),
        ("visibility.voxels_per_cell", "4000000000"),
        ("scene", "{}"),
        ("grid", "{}"),
        ("plan", "{"),
        ("format", "lightprobe/2"),
    ] {
        let path = altered(&folder, MAPS, |c| drop(c.metadata.insert(key.into(), value.into())));
        let message = refuse_in_little_memory(&path);
        assert!(message.contains("altered.probes"), "{key} {value}: {message}");
    }
    for key in ["scale.irradiance", "encoding.irradiance", "grid", "scene", "plan", "config", "format"] {
        let path = altered(&folder, MAPS, |c| drop(c.metadata.remove(key)));
        refuse_in_little_memory(&path);
    }
}

#[test]
fn wrong_tensors_under_right_hashes() {
    let folder = Folder::new();
    let set = |name: &'static str, at: usize, bytes: [u8; 4]| {
        move |c: &mut Container| {
            let tensor = c.tensors.get_mut(name).unwrap_or_else(|| panic!("no tensor {name}"));
            let width = bytes.len().min(tensor.bytes.len() - at);
            tensor.bytes[at..at + width].copy_from_slice(&bytes[..width]);
        }
    };
    let nan = f32::NAN.to_le_bytes();
    let infinite = f32::INFINITY.to_le_bytes();
    let refused = |words: &str, alter: Box<dyn FnOnce(&mut Container)>| {
        refuse_in_little_memory(&altered(&folder, words, alter));
    };
    refused(MAPS, Box::new(set("position", 4, nan)));
    refused(MAPS, Box::new(set("position", 4, infinite)));
    refused(MAPS, Box::new(set("state", 0, [7; 4])));
    refused("--preset physical --set encoding.irradiance=f32", Box::new(set("irradiance", 8, nan)));
    // All ones: infinities and NaN of the packed format.
    refused(MAPS, Box::new(set("irradiance", 8, [0xFF; 4])));
    refused(MAPS, Box::new(set("visibility_root", 0, [0xFF; 4])));
    // A plane whose parts never begin.
    refused(MAPS, Box::new(set("visibility_tree", 0, [0; 4])));
    refused(MOMENTS, Box::new(set("distance_scale", 0, nan)));
    refused(MOMENTS, Box::new(set("distance_scale", 0, (-1f32).to_le_bytes())));
    for name in ["position", "state", "irradiance", "visibility_root", "visibility_tree"] {
        refused(MAPS, Box::new(move |c| drop(c.tensors.remove(name))));
        // One element short along the first axis.
        refused(
            MAPS,
            Box::new(move |c| {
                let tensor = c.tensors.get_mut(name).unwrap();
                let row = tensor.bytes.len() / tensor.shape[0];
                tensor.shape[0] -= 1;
                tensor.bytes.truncate(tensor.bytes.len() - row);
            }),
        );
    }
}

/// Trees that no writer of this program makes are refused or give wrong light, but never a panic.
#[test]
fn odd_visibility_trees_do_not_panic() {
    let folder = Folder::new();
    let path = altered(&folder, "", |c| {
        let words = c.tensors.get_mut("visibility_tree").unwrap();
        words.bytes.iter_mut().enumerate().for_each(|(i, b)| *b = (i * 151) as u8);
    });
    let output = folder.path().join("out");
    let run =
        crate::program::run(&["render", text(&scene("cornell")), text(&path), "-o", text(&output), "--size", "32x18"]);
    assert!(matches!(run.code, Some(0 | 2)), "{}", run.stderr);
}

#[test]
fn files_that_are_no_probe_files() {
    let folder = Folder::new();
    for (name, bytes) in [("empty.probes", &b""[..]), ("text.probes", b"not a probe file\n"), ("seven.probes", &[0; 7])]
    {
        let message = refuse(&["inspect", text(&folder.write(name, bytes))]);
        assert!(message.contains(name), "{message}");
    }
    let message = refuse(&["inspect", text(&scene("cornell"))]);
    assert!(message.contains("cornell.glb"), "{message}");
    let message = refuse(&["inspect", text(folder.path())]);
    assert!(message.contains(text(folder.path())), "{message}");
    refuse(&["inspect", text(&folder.path().join("missing.probes"))]);
}

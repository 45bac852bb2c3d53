//! The probe file read by others: by the tests' own decoder, against what `inspect` says.

use std::path::Path;

use serde_json::Value;

use crate::common::{Folder, Gltf};
use crate::probe_file::{ProbeFile, Vector};
use crate::program::{bake_physical, scene, succeed, text};
use crate::shapes::{add, diffuse, quad, room, save};

const AXES: [(&str, Vector); 6] = [
    ("+x", [1.0, 0.0, 0.0]),
    ("-x", [-1.0, 0.0, 0.0]),
    ("+y", [0.0, 1.0, 0.0]),
    ("-y", [0.0, -1.0, 0.0]),
    ("+z", [0.0, 0.0, 1.0]),
    ("-z", [0.0, 0.0, -1.0]),
];

/// A room with walls of six colours, so that no direction looks like another.
fn colourful(folder: &Folder) -> std::path::PathBuf {
    let mut gltf = Gltf::new();
    let triangles = room(1);
    for face in 0..6 {
        let bright = |c: usize| 0.2 + 0.3 * ((face * (c + 2) + c) % 7) as f64;
        let emission = [bright(0), bright(1), bright(2)];
        add(&mut gltf, &triangles[face * 6..face * 6 + 6], diffuse([0.3, 0.4, 0.5], emission));
    }
    save(gltf, folder, "colourful")
}

fn inspect(path: &Path, probe: usize) -> Value {
    succeed(&["inspect", text(path), "--probe", &probe.to_string(), "--json"]).json()
}

fn compare(path: &Path, file: &ProbeFile, probe: usize) {
    let shown = inspect(path, probe);
    let position: Vector = serde_json::from_value(shown["probe"]["position_m"].clone()).unwrap();
    for k in 0..3 {
        // f32 positions relative to the origin.
        assert!((position[k] - file.position(probe)[k]).abs() < 1e-6, "{position:?}");
    }
    for (name, axis) in AXES {
        let ours = file.irradiance(probe, axis);
        let theirs: Vector = serde_json::from_value(shown["probe"]["irradiance"][name].clone()).unwrap();
        for c in 0..3 {
            // Both decode the same bits; theirs in f32.
            assert!((ours[c] - theirs[c]).abs() <= 1e-5 * ours[c].abs() + 1e-7, "{name}: {ours:?} {theirs:?}");
        }
    }
}

#[test]
fn every_encoding_decodes_outside_the_crate() {
    let folder = Folder::new();
    let scene = colourful(&folder);
    let even = "--set grid.spacing_m=0.7 --set capture.rays.octahedral.guided=0";
    let exact = bake_physical(&folder, &scene, &format!("{even} --set encoding.irradiance=f32")).file;
    let shape = |file: &ProbeFile| file.tensors["irradiance"].shape[1..].to_vec();
    for (format, dtype, precision) in [
        ("f32", "F32", 1e-6),
        // Half a step of 10 and of 5 bits of mantissa.
        ("f16", "F16", 0.5 / 1024.0),
        ("r11g11b10f", "U32", 0.5 / 32.0),
    ] {
        for (curve, power) in [("linear", 1.0), ("gamma5_over_2pi", 5.0)] {
            for border in [0, 1] {
                let words = format!(
                    "{even} --set encoding.irradiance={format} --set encoding.curve={curve} \
                     --set encoding.border={border}"
                );
                let baked = bake_physical(&folder, &scene, &words);
                let (file, what) = (&baked.file, format!("{format} {curve} {border}"));
                assert_eq!(file.tensors["irradiance"].dtype, dtype);
                assert_eq!(file.metadata["encoding.irradiance"], curve);
                assert_eq!(file.border(), border);
                let side = 8 + 2 * border;
                assert_eq!(shape(file)[..2], [side, side], "{what}");
                for &probe in file.active().iter().step_by(9) {
                    compare(&baked.path, file, probe);
                    for (a, b) in file.texels(probe).iter().zip(exact.texels(probe)) {
                        for c in 0..3 {
                            // The curve takes the fifth root: relative errors of stored values count five times.
                            // What is fed back through the probes differs a little with curve and border; probes
                            // outside the room hold next to nothing, some 1e-5 of what those inside hold (about 2).
                            let tolerance = (precision * power + 0.02) * b.2[c] + 1e-4;
                            assert!((a.2[c] - b.2[c]).abs() <= tolerance, "{what}: {a:?} {b:?}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn axes_are_those_of_the_world() {
    // A lamp in the direction of +x, and then of +y, +z and −z: the texel that looks there is the brightest, and what
    // faces away is black.
    let directions: [Vector; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for direction in directions {
        let folder = Folder::new();
        let mut gltf = Gltf::new();
        let k = direction.iter().position(|c| *c != 0.0).unwrap();
        let (mut corner, mut u, mut v) = ([-0.1f32; 3], [0.0f32; 3], [0.0f32; 3]);
        corner[k] = 2.0 * direction[k] as f32;
        (u[(k + 1) % 3], v[(k + 2) % 3]) = (0.2, 0.2);
        // u × v looks along +k: swapped, the front looks back at the probes.
        let lamp = if direction[k] > 0.0 { quad(corner, v, u, 1) } else { quad(corner, u, v, 1) };
        add(&mut gltf, &lamp, diffuse([0.0; 3], [50.0; 3]));
        let scene = save(gltf, &folder, "lamp");
        let words = "--set grid.divisions=(2,2,2) --set grid.bounds={\"min\":[-0.1,-0.1,-0.1],\"max\":[0.1,0.1,0.1]} \
                     --set placement.keep_unsampled=true --set encoding.irradiance=f32";
        let file = bake_physical(&folder, &scene, words).file;
        for probe in 0..8 {
            let texels = file.texels(probe);
            let brightest = texels.iter().max_by(|a, b| a.2[0].total_cmp(&b.2[0])).unwrap();
            // Texel centres of an 8² map lie at most 0.25 rad from an axis, and the lamp at most 0.1 rad off it.
            assert!(crate::shapes::dot(brightest.0, direction) > 0.9, "{direction:?}: brightest is {brightest:?}");
            let away = direction.map(|c| -c);
            assert_eq!(file.irradiance(probe, away), [0.0; 3], "{direction:?}");
        }
    }
}

#[test]
fn the_border_continues_the_map() {
    // Edge rows mirror across their middle, corners take the diagonally opposite interior corner.
    let folder = Folder::new();
    let file = bake_physical(&folder, &colourful(&folder), "--set grid.spacing_m=0.7").file;
    let n = file.resolution();
    assert_eq!(file.border(), 1);
    for probe in file.active() {
        let at = |row: usize, column: usize| file.stored(probe, row, column);
        for i in 1..=n {
            let mirrored = n + 1 - i;
            assert_eq!(at(0, i), at(1, mirrored), "top");
            assert_eq!(at(n + 1, i), at(n, mirrored), "bottom");
            assert_eq!(at(i, 0), at(mirrored, 1), "left");
            assert_eq!(at(i, n + 1), at(mirrored, n), "right");
        }
        assert_eq!(at(0, 0), at(n, n));
        assert_eq!(at(0, n + 1), at(n, 1));
        assert_eq!(at(n + 1, 0), at(1, n));
        assert_eq!(at(n + 1, n + 1), at(1, 1));
    }
}

#[test]
fn look_ups_across_the_seam_are_continuous() {
    // Two directions a thousandth of a radian either side of the octahedron's lower edges and around −Z.
    let folder = Folder::new();
    let file =
        bake_physical(&folder, &colourful(&folder), "--set grid.spacing_m=0.7 --set encoding.irradiance=f32").file;
    for probe in file.active() {
        let mean = file.mean_irradiance(probe);
        for k in 0..64 {
            let phi = k as f64 / 64.0 * std::f64::consts::TAU;
            for z in [-0.3, -0.7, -0.95] {
                let r = f64::sqrt(1.0 - z * z);
                let at = |phi: f64| file.irradiance(probe, [r * phi.cos(), r * phi.sin(), z]);
                let (a, b) = (at(phi - 5e-4), at(phi + 5e-4));
                for c in 0..3 {
                    // The map's own slope: at most its range (some 2 of the mean) over a texel of 0.2 rad.
                    assert!((a[c] - b[c]).abs() < 0.02 * mean[c], "probe {probe}, {phi}, {z}: {a:?} {b:?}");
                }
            }
        }
    }
}

#[test]
fn texels_of_inactive_probes_are_zero() {
    let folder = Folder::new();
    let file = bake_physical(&folder, &scene("cornell"), "--set grid.spacing_m=0.3").file;
    let states = file.states();
    assert!(states.contains(&1), "no probe inside geometry");
    for probe in (0..states.len()).filter(|&p| states[p] != 0) {
        assert!(file.texels(probe).iter().all(|t| t.2 == [0.0; 3]), "probe {probe}");
    }
}

#[test]
fn extreme_light_survives_every_format() {
    let folder = Folder::new();
    for strength in [1e9, 1e-9] {
        let mut gltf = Gltf::new();
        add(&mut gltf, &room(1), diffuse([0.5; 3], [1.0; 3]));
        gltf.json["materials"][0]["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] =
            serde_json::json!(strength);
        let scene = save(gltf, &folder, "bright");
        let inside = "--set grid.divisions=(2,2,2) --set grid.bounds={\"min\":[-0.8,-0.8,-0.8],\"max\":[0.8,0.8,0.8]}";
        let exact = std::f64::consts::TAU * strength;
        for format in ["f32", "f16", "r11g11b10f"] {
            let baked = bake_physical(&folder, &scene, &format!("{inside} --set encoding.irradiance={format}"));
            assert_eq!(baked.report["numerics"]["clamped"]["irradiance"], 0);
            let mean = baked.file.mean_irradiance(0);
            for value in mean {
                // Half a step of 5 bits, and the solver's tolerance.
                assert!((value / exact - 1.0).abs() < 0.5 / 32.0 + 1e-3, "{format}: {value} instead of {exact}");
            }
        }
    }
}

//! The presets of Three.V8: what their files hold, read by a decoder of the tests' own.

use std::f64::consts::PI;

use serde_json::Value;

use crate::common::Folder;
use crate::probe_file::ProbeFile;
use crate::program::{bake, method, refuse, render, scene, succeed, text};

/// Few rays, which the published cube maps have many of.
const COARSE: &str = "--set capture.rays.cube.face=10";

fn numbers<const N: usize, T>(file: &ProbeFile, tensor: &str, of: impl Fn([u8; N]) -> T) -> Vec<T> {
    file.tensors[tensor].bytes.as_chunks::<N>().0.iter().map(|b| of(*b)).collect()
}

fn index(file: &ProbeFile) -> Vec<i32> {
    numbers(file, "grid_index", i32::from_le_bytes)
}

fn divisions(file: &ProbeFile) -> [usize; 3] {
    serde_json::from_value(file.grid()["divisions"].clone()).unwrap()
}

/// The probe of a finest cell, by the description of `grid_index`.
fn probe_of(file: &ProbeFile, cell: [usize; 3]) -> usize {
    let (index, levels) = (index(file), file.grid()["levels"].as_u64().unwrap() as usize);
    let probes = file.states().len() as i32;
    let base = divisions(file).map(|n| n >> levels);
    let [x, y, z] = cell.map(|c| c >> levels);
    let mut entry = index[x + base[0] * (y + base[1] * z)];
    for level in (0..levels).rev() {
        if entry < probes {
            break;
        }
        let [x, y, z] = cell.map(|c| c >> level & 1);
        entry = index[base[0] * base[1] * base[2] + (entry - probes) as usize * 8 + x + 2 * y + 4 * z];
    }
    entry as usize
}

/// Irradiance of a probe around a unit direction, from nine coefficients.
fn irradiance(file: &ProbeFile, probe: usize, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let coefficients = numbers(file, "sh", f32::from_le_bytes);
    let functions = [
        1.0 / (4.0 * PI).sqrt(),
        (3.0 / (4.0 * PI)).sqrt() * y,
        (3.0 / (4.0 * PI)).sqrt() * z,
        (3.0 / (4.0 * PI)).sqrt() * x,
        (15.0 / (4.0 * PI)).sqrt() * x * y,
        (15.0 / (4.0 * PI)).sqrt() * y * z,
        (5.0 / (16.0 * PI)).sqrt() * (3.0 * z * z - 1.0),
        (15.0 / (4.0 * PI)).sqrt() * x * z,
        (15.0 / (16.0 * PI)).sqrt() * (x * x - y * y),
    ];
    let of = |c: usize| (0..9).map(|j| f64::from(coefficients[27 * probe + 3 * j + c]) * functions[j]).sum();
    [of(0), of(1), of(2)]
}

const DIRECTIONS: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.48, 0.6, 0.64]];

#[test]
fn the_furnace_has_its_value() {
    let folder = Folder::new();
    let inside = "--set grid.bounds=(min:(-0.9,0.1,-0.9),max:(0.9,1.9,0.9))";
    for (preset, words) in [
        ("threev8-uniform", "--set grid.divisions=(4,4,4)"),
        ("threev8-mixed", "--set grid.divisions=(8,8,8)"),
        // Any bounces do, and so does emission that is sampled.
        ("threev8-uniform", "--set grid.divisions=(3,3,3) --set transport=bounces() --set capture.emission=sampled"),
    ] {
        let words = format!("--preset {preset} {COARSE} {inside} {words}");
        let baked = bake(&folder, &scene("furnace"), &words);
        assert_eq!(baked.report["converged"], true, "{preset}");
        assert_eq!(baked.file.active().len(), baked.file.states().len(), "every probe is baked");
        for probe in 0..baked.file.states().len() {
            for direction in DIRECTIONS {
                for e in irradiance(&baked.file, probe, direction) {
                    // Radiance 1/(1 − 0.5): what the last pass still changes, 1e-3, and as much again after it. Sampled
                    // emission is even noise of four draws a hit, around each of them.
                    let tolerance = if words.contains("sampled") { 0.03 } else { 2.1e-3 };
                    assert!((e / (2.0 * PI) - 1.0).abs() < tolerance, "{words}, probe {probe}, {direction:?}: {e}");
                }
            }
        }
    }
}

#[test]
fn files_hold_what_the_method_stores() {
    let folder = Folder::new();
    let words = format!("--preset threev8-mixed {COARSE} --set grid.spacing_m=1 --threads 1");
    let baked = bake(&folder, &scene("two_rooms_open"), &words);
    let file = &baked.file;
    let n = file.states().len();
    assert_eq!(file.metadata["encoding.distance"], "cell_box");
    assert_eq!((file.tensors["sh"].shape.as_slice(), file.tensors["sh"].dtype.as_str()), (&[n, 9, 3][..], "F32"));
    assert_eq!(file.tensors["distance"].shape, [n, 18, 18, 2]);
    let (grid, whole) = (file.grid(), divisions(file));
    assert_eq!((&grid["kind"], &grid["levels"]), (&Value::from("mixed"), &Value::from(2)));
    let base: usize = whole.iter().map(|d| d / 4).product();
    let nodes = (n - base) / 7;
    assert_eq!(n, base + 7 * nodes);
    assert_eq!(index(file).len(), n + nodes);
    // Every finest cell finds a probe: the nearest cell centre of its own or a coarser level.
    let mut covered = vec![0; n];
    for i in 0..whole.iter().product::<usize>() {
        let cell = [i % whole[0], i / whole[0] % whole[1], i / (whole[0] * whole[1])];
        let probe = probe_of(file, cell);
        covered[probe] += 1;
        let origin: [f64; 3] = serde_json::from_value(grid["origin"].clone()).unwrap();
        let place = file.position(probe);
        // At most one and a half cells from the middle of a cell of four.
        assert!((0..3).all(|k| (origin[k] + cell[k] as f64 - place[k]).abs() < 1.5 + 1e-4), "{cell:?} {place:?}");
    }
    assert!(covered.iter().all(|&cells| [1, 8, 64].contains(&cells)), "{covered:?}");
    // 400 B of presampled irradiance, 1,296 B of distances, 1 B of state, place and level, and the index.
    let runtime = 400.0 + 1296.0 + 1.0 + 16.0 + 4.0 * (n + nodes) as f64 / n as f64;
    let found = baked.report["bytes_per_probe"]["runtime"].as_f64().unwrap();
    assert!((found - runtime).abs() < 1e-9, "{found} instead of {runtime}");
    // More threads write the same bytes, and so do captures that are made anew in every pass.
    let path = folder.path().join("other.probes");
    let rooms = scene("two_rooms_open");
    for other in ["--threads 2", "--threads 3 --memory-budget 0B"] {
        let words = words.replace("--threads 1", other);
        let mut arguments = vec!["bake", text(&rooms), "-o", text(&path), "-q"];
        arguments.extend(words.split_whitespace());
        succeed(&arguments);
        assert!(std::fs::read(&path).unwrap() == baked.bytes, "{other} changes the file");
    }
    // And it is asked.
    let shown = render(&folder, &rooms, &baked.path, "picture", "--size 32x18");
    assert!(method(&shown, "visibility_on")["irradiance_indirect_mean"].as_f64().unwrap() > 0.0);
    let inspected = succeed(&["inspect", text(&baked.path), "--json", "--probe", "1"]).json();
    assert_eq!((&inspected["grid"]["kind"], &inspected["grid"]["levels"]), (&grid["kind"], &grid["levels"]));

    // Conversion: the same light in every finest cell.
    let path = folder.path().join("uniform.probes");
    let convert = ["convert", text(&baked.path), text(&rooms), "-o", text(&path), "--to", "uniform", "-q"];
    succeed(&convert);
    let uniform = ProbeFile::parse(&std::fs::read(&path).unwrap());
    assert_eq!(uniform.grid()["kind"], "uniform");
    assert!(!uniform.tensors.contains_key("grid_index"));
    assert_eq!(uniform.states().len(), whole.iter().product::<usize>());
    for i in (0..uniform.states().len()).step_by(37) {
        let probe = probe_of(file, [i % whole[0], i / whole[0] % whole[1], i / (whole[0] * whole[1])]);
        let of = |file: &ProbeFile, p: usize| file.tensors["sh"].bytes[p * 108..][..108].to_vec();
        assert_eq!(of(&uniform, i), of(file, probe), "cell {i}");
    }
    render(&folder, &rooms, &path, "picture of the uniform one", "--size 16x9");
    let again = ["convert", text(&path), text(&rooms), "-o", text(&baked.path), "--to", "uniform", "-q"];
    assert!(refuse(&again).contains("uniform already"));
    let other = scene("cornell");
    let elsewhere = ["convert", text(&baked.path), text(&other), "-o", text(&path), "--to", "uniform", "-q"];
    assert!(refuse(&elsewhere).contains("--allow-scene-change"));
}

#[test]
fn keys_that_do_not_go_together_are_refused() {
    let furnace = scene("furnace");
    for (set, words) in [
        ("store.irradiance=sh9(format: r11g11b10f)", &["store.irradiance.sh9.format", "f16 or f32"][..]),
        ("store.irradiance=sh9(presampled: 0)", &["store.irradiance.sh9.presampled"]),
        ("store.occlusion=tiles()", &["query.test", "chebyshev"]),
        ("query.look_up=towards", &["query.look_up", "normal"]),
        ("query.direction=eccentric(kappa: 2)", &["query.direction.eccentric.kappa"]),
        ("placement.refine=mixed(levels: 9)", &["placement.refine.mixed.levels", "1 to 8"]),
        ("transport=in_order(most: 0)", &["transport.in_order.most"]),
    ] {
        let message = refuse(&["bake", text(&furnace), "--dry-run", "--set", set]);
        assert!(words.iter().all(|word| message.contains(word)), "{set}: {message}");
    }
}

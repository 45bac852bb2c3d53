//! Closed rooms that emit and reflect the same everywhere: radiance Le/(1 − ρ) from every direction, irradiance π times
//! that, at every probe and around every direction.

use std::f64::consts::PI;
use std::path::Path;

use crate::common::{Folder, Gltf};
use crate::probe_file::ProbeFile;
use crate::program::{bake, scene};
use crate::shapes::{Samples, add, diffuse, quad, room, save};

/// Probes in the air of the room only; hits on its walls lie outside their hull and use the nearest cell.
const INSIDE: &str = "--preset physical --set encoding.irradiance=f32 --set grid.divisions=(3,3,3) \
                      --set grid.bounds={\"min\":[-0.8,-0.8,-0.8],\"max\":[0.8,0.8,0.8]}";

/// Bounces missing when the solver stops (`solver.tolerance` 1e-4, relative to the largest irradiance, judged by an
/// estimate of the ratio: a factor of two for it) and rounding of sums of a thousand f32.
const SOLVER_FLOOR: f64 = 2e-4 + 1e-5;

fn seeds(folder: &Folder, scene: &Path, words: &str, count: u32) -> Vec<ProbeFile> {
    (0..count).map(|seed| bake(folder, scene, &format!("{words} --seed {seed}")).file).collect()
}

/// Every given probe: mean within 0.5 % under every seed, texels within five standard errors and the solver's tolerance.
fn check(files: &[ProbeFile], probes: &[usize], expected: [f64; 3], what: &str) {
    for file in files {
        check_means(std::slice::from_ref(file), probes, expected, what);
    }
    check_texels(files, probes, expected, what);
}

/// Every given probe's mean over directions and files within 0.5 %.
fn check_means(files: &[ProbeFile], probes: &[usize], expected: [f64; 3], what: &str) {
    assert!(!probes.is_empty(), "{what}: no probe");
    for &probe in probes {
        let means: Vec<_> = files.iter().map(|f| f.mean_irradiance(probe)).collect();
        for (c, expected) in expected.into_iter().enumerate() {
            let mean = means.iter().map(|m| m[c]).sum::<f64>() / files.len() as f64;
            let off = mean / expected - 1.0;
            assert!(off.abs() < 0.005, "{what}, probe {probe}, channel {c}: off by {off}");
        }
    }
}

/// Texels' means over the files within five standard errors and the solver's tolerance.
fn check_texels(files: &[ProbeFile], probes: &[usize], expected: [f64; 3], what: &str) {
    let largest = expected.iter().copied().fold(0.0, f64::max);
    for (c, expected) in expected.into_iter().enumerate() {
        let samples = Samples::of(files, probes, c);
        let exact = vec![expected; samples.values[0].len()];
        samples.check(&exact, SOLVER_FLOOR * largest, what);
    }
}

fn expected(emission: [f64; 3], albedo: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| PI * emission[c] / (1.0 - albedo[c]))
}

#[test]
fn the_scene_of_the_repository() {
    let folder = Folder::new();
    let words = "--preset physical --set encoding.irradiance=f32 --set grid.divisions=(4,4,4) \
                 --set grid.bounds={\"min\":[-0.9,0.1,-0.9],\"max\":[0.9,1.9,0.9]}";
    let files = seeds(&folder, &scene("furnace"), words, 4);
    // The walls use the outer probes only; the 2³ inner ones are not asked by any surface.
    assert_eq!(files[0].active().len(), 64 - 8, "every probe that a wall asks is active");
    check(&files, &files[0].active(), expected([1.0; 3], [0.5; 3]), "furnace.glb");
}

#[test]
fn the_preset_of_paths() {
    let folder = Folder::new();
    // 256 directions of 64 paths: 0.11 % (rms) in the mean of a probe, so 0.5 % are more than four standard errors.
    let words = "--preset path --set grid.divisions=(3,3,3) --set capture.resolution=16 \
                 --set grid.bounds={\"min\":[-0.8,0.2,-0.8],\"max\":[0.8,1.8,0.8]} --set filter.irradiance_resolution=4";
    // Without a bounce between probes: paths bring the light that was reflected, half of all of it.
    let report = bake(&folder, &scene("furnace"), words).report;
    assert_eq!(report["bounces"].as_array().map(Vec::len), Some(1), "probes were asked: {}", report["bounces"]);
    let files = seeds(&folder, &scene("furnace"), words, 4);
    check(&files, &files[0].active(), expected([1.0; 3], [0.5; 3]), "furnace.glb, preset path");
}

#[test]
fn probes_of_the_default_grid_within_the_room() {
    // The default grid also has probes outside the room, which see no light. They lower the share of directions in
    // which emitters are seen, so that emitters are sampled and there is noise to test: 0.33 % (rms) in the mean of a
    // probe under one seed, so the 0.5 % is asked of the mean over twelve, where it is five standard errors.
    let folder = Folder::new();
    let files = seeds(
        &folder,
        &scene("furnace"),
        "--preset physical --set encoding.irradiance=f32 --set grid.spacing_m=0.6",
        12,
    );
    let inside = |p: &usize| {
        let [x, y, z] = files[0].position(*p);
        x.abs() < 1.0 && (y - 1.0).abs() < 1.0 && z.abs() < 1.0
    };
    let probes: Vec<usize> = files[0].active().into_iter().filter(inside).collect();
    assert!(Samples::of(&files, &probes, 0).pooled_error() > 0.0, "no noise: this test would test nothing");
    check_means(&files, &probes, expected([1.0; 3], [0.5; 3]), "furnace.glb, default grid");
    check_texels(&files, &probes, expected([1.0; 3], [0.5; 3]), "furnace.glb, default grid");
}

#[test]
fn albedos_from_none_to_much() {
    let folder = Folder::new();
    let (emission, colour) = ([1.0, 3.0, 0.25], [0.0, 0.5, 0.8]);
    for albedo in [[0.0; 3], [0.8; 3], colour] {
        let mut gltf = Gltf::new();
        add(&mut gltf, &room(1), diffuse(albedo, emission));
        let scene = save(gltf, &folder, "room");
        let files = seeds(&folder, &scene, INSIDE, 3);
        check(&files, &files[0].active(), expected(emission, albedo), &format!("albedo {albedo:?}"));
    }
}

#[test]
fn finely_tessellated_walls() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(24), diffuse([0.5; 3], [1.0; 3]));
    let scene = save(gltf, &folder, "room");
    let files = seeds(&folder, &scene, INSIDE, 3);
    check(&files, &files[0].active(), expected([1.0; 3], [0.5; 3]), "tessellated");
}

#[test]
fn emission_gathered_through_the_probes() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.5; 3], [1.0; 3]));
    let scene = save(gltf, &folder, "room");
    let files = seeds(&folder, &scene, &format!("{INSIDE} --set capture.emission=gathered"), 3);
    check(&files, &files[0].active(), expected([1.0; 3], [0.5; 3]), "gathered");
}

/// What `reference --max-bounces b` gives in the same room: π·Le·Σρᵏ, k from 0 to b. However emission is found.
#[test]
fn a_number_of_bounces_is_that_of_the_reference() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    let albedo = 0.5f64;
    add(&mut gltf, &room(1), diffuse([albedo; 3], [1.0; 3]));
    let scene = save(gltf, &folder, "room");
    for bounces in 0..4 {
        let sum: f64 = (0..=bounces).map(|k| albedo.powi(k)).sum();
        for emission in ["sampled", "gathered"] {
            let words =
                format!("{INSIDE} --set transport.bounces.max_bounces={bounces} --set capture.emission={emission}");
            let files = seeds(&folder, &scene, &words, 2);
            check_means(&files, &files[0].active(), [PI * sum; 3], &format!("{bounces} bounces, {emission}"));
        }
    }
}

#[test]
fn one_percent_matters_at_high_albedo() {
    // At 0.98 a bounce operator 1 % too weak would give a third less, and 1 % too strong twice as much.
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.98; 3], [1.0; 3]));
    let scene = save(gltf, &folder, "room");
    let files = seeds(&folder, &scene, &format!("{INSIDE} --set solver.max_bounces=1001"), 2);
    let exact = PI / (1.0 - 0.98);
    for probe in files[0].active() {
        let mean = files[0].mean_irradiance(probe)[0];
        assert!((mean / exact - 1.0).abs() < 0.005, "{mean} instead of {exact}");
    }
}

#[test]
fn a_constant_sky_and_nothing_else() {
    // One square centimetre of geometry, some metres away: 1e-5 of the sphere.
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &quad([0.0, -3.0, 0.0], [0.0, 0.0, 0.01], [0.01, 0.0, 0.0], 1), diffuse([0.5; 3], [0.0; 3]));
    let scene = save(gltf, &folder, "speck");
    let words = format!("{INSIDE} --env 1,2,0.5 --set placement.keep_unsampled=true");
    let files = seeds(&folder, &scene, &words, 3);
    assert_eq!(files[0].active().len(), 27);
    check(&files, &files[0].active(), [PI, 2.0 * PI, 0.5 * PI], "sky");
}

#[test]
fn a_sky_above_a_black_plane_lights_by_half_the_cosine() {
    // E(n) = πL·(1 + n·up)/2 where everything below the horizon is black.
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    let plane = quad([-2000.0, 0.0, -2000.0], [0.0, 0.0, 4000.0], [4000.0, 0.0, 0.0], 1);
    add(&mut gltf, &plane, diffuse([0.0; 3], [0.0; 3]));
    let scene = save(gltf, &folder, "plane");
    let words = "--preset physical --set encoding.irradiance=f32 --env 1,1,1 --set placement.keep_unsampled=true \
                 --set grid.divisions=(2,2,2) --set grid.bounds={\"min\":[-0.5,0.5,-0.5],\"max\":[0.5,1.5,0.5]} \
                 --set capture.samples_per_texel=4";
    let files = seeds(&folder, &scene, words, 8);
    let probes = files[0].active();
    let exact: Vec<f64> =
        probes.iter().flat_map(|&p| files[0].texels(p)).map(|(n, _, _)| PI * (1.0 + n[1]) / 2.0).collect();
    // The horizon runs through texels of 0.1 rad, whose two parts are filtered under one weight: off by at most a
    // twentieth of a radian times the small share of light in that band.
    Samples::of(&files, &probes, 1).check(&exact, 0.004 * PI, "sky above a plane");
}

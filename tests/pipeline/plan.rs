//! What the plan leaves out never changes the result.

use glam::Vec3;
use lightprobe::image::LayeredImage;

use crate::common::{Folder, Gltf};
use crate::probe_file::Tensor;
use crate::program::{bake, names_in, render, scene};
use crate::shapes::{add, diffuse, room, save};

const MOMENTS: &str = "--preset physical --set query.visibility={\"moments\":{\"power\":3,\"floor\":0}}";

fn layer(folder: &Folder, run: &str, method: &str) -> Vec<Vec3> {
    let path = folder.path().join(run).join(format!("{method}.exr"));
    LayeredImage::read_exr(&path).unwrap().layer("irradiance_indirect").unwrap().to_vec()
}

/// Bakes with and without leaving out and compares probes and pictures bit by bit.
fn check(scene: &std::path::Path, words: &str, render_words: &str) {
    let folder = Folder::new();
    let lean = bake(&folder, scene, words);
    let full = bake(&folder, scene, &format!("{words} --set plan=keep_everything"));
    let what = format!("{} {words}", scene.display());
    let lines = full.report["plan"].as_array().unwrap();
    assert!(lines.iter().all(|l| l["stage"] == "bounces" || l["kept"] == true), "{what}");
    // Maps, or coefficients and gradients.
    let held = |bake: &crate::program::Bake, probe: usize| -> Vec<Vec<u8>> {
        let tensors = ["irradiance", "sh", "gradient"].iter().filter_map(|name| bake.file.tensors.get(*name));
        let row = |t: &Tensor| t.bytes.len() / t.shape[0];
        tensors.map(|t| t.bytes[probe * row(t)..][..row(t)].to_vec()).collect()
    };
    let scale = |bake: &crate::program::Bake| bake.file.metadata["scale.irradiance"].clone();
    assert_eq!(scale(&lean), scale(&full), "{what}");
    let active = lean.file.active();
    assert!(!active.is_empty(), "{what}");
    for &probe in &active {
        assert_eq!(full.file.states()[probe], 0, "{what}: probe {probe} is active in the lean bake only");
        assert!(
            !held(&lean, probe).is_empty() && held(&lean, probe) == held(&full, probe),
            "{what}: probe {probe} differs"
        );
    }
    for (run, baked) in [("lean", &lean), ("full", &full)] {
        render(&folder, scene, &baked.path, run, &format!("--size 64x36 {render_words}"));
    }
    for method in ["visibility_off", "visibility_on", "visibility_ray"] {
        let (a, b) = (layer(&folder, "lean", method), layer(&folder, "full", method));
        assert!(a.iter().any(|p| *p != Vec3::ZERO), "{what}: {method} is dark");
        assert!(a == b, "{what}: {method} differs");
    }
    assert!(names_in(&folder.path().join("lean")) == names_in(&folder.path().join("full")));
}

#[test]
fn furnace() {
    check(&scene("furnace"), "--set grid.spacing_m=0.8", "");
    check(&scene("furnace"), &format!("--set grid.spacing_m=0.8 {MOMENTS}"), "");
}

#[test]
fn cornell() {
    check(&scene("cornell"), "--set grid.spacing_m=0.6", "");
    check(&scene("cornell"), &format!("--set grid.spacing_m=0.6 {MOMENTS}"), "");
}

#[test]
fn two_rooms() {
    check(&scene("two_rooms_open"), "--set grid.spacing_m=1.5", "");
    check(&scene("two_rooms_open"), &format!("--set grid.spacing_m=1.5 {MOMENTS}"), "");
}

#[test]
fn courtyard() {
    let words = "--set grid.spacing_m=4 --set solver.max_bounces=4 --set capture.resolution=16";
    check(&scene("courtyard"), words, "");
    check(&scene("courtyard"), &format!("{words} {MOMENTS}"), "");
}

#[test]
fn a_room_without_anything_in_the_way_has_no_visibility() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.5; 3], [1.0; 3]));
    let scene = save(gltf, &folder, "room");
    // With bounds inside the room the walls would lie beyond the survey, and visibility would be kept.
    let inside = "--set grid.divisions=(4,4,4)";
    for (visibility, held) in [
        ("", &["gradient", "position", "sh", "state"][..]),
        ("--preset physical", &["irradiance", "position", "state"]),
        (MOMENTS, &["irradiance", "position", "state"]),
    ] {
        let baked = bake(&folder, &scene, &format!("{inside} {visibility}"));
        let names: Vec<&String> = baked.file.tensors.keys().collect();
        assert_eq!(names, held, "{visibility}");
        let line = |stage: &str| {
            let lines = baked.report["plan"].as_array().unwrap();
            lines.iter().find(|l| l["stage"] == stage).unwrap_or_else(|| panic!("no line {stage}")).clone()
        };
        for stage in ["punctual_shadow_rays", "sky", "alpha_test", "textures", "radiance_levels", "visibility"] {
            assert_eq!(line(stage)["kept"], false, "{stage}");
        }
        assert_eq!(line("emissive_surfaces")["kept"], true);
        assert!(line("visibility")["saved_bytes"].as_u64().unwrap() > 0);
        check(&scene, &format!("{inside} {visibility}"), "");
    }
}

/// The share of directions in which emitters are seen divides the samples: probes that only the full bake keeps must
/// not change it for the others.
#[test]
fn courtyard_under_a_sky() {
    let words = "--set grid.spacing_m=4 --set solver.max_bounces=4 --set capture.resolution=16 --env 0.3,0.5,0.8";
    check(&scene("courtyard"), words, "--env 0.3,0.5,0.8");
}

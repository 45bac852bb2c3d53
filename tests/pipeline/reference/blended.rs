//! Surfaces that stop rays by chance.

use lightprobe::light::path::Strategy;
use lightprobe::shade::reference::{ReferenceSettings, trace};
use lightprobe::system::progress::Progress;
use serde_json::json;

use super::{Check, HEIGHT, ROUNDING, WIDTH, camera, load, settings, small, world};
use crate::common::{Folder, Gltf};
use crate::shapes::{add, diffuse, quad, save};

/// Off the panes' diagonals, on which a ray may meet both triangles, each with its own chance.
const FROM: [f64; 3] = [0.5, -0.2, 1.0];

/// An emitting wall behind a pane of opacity 0.3 that emits a little itself.
fn pane(folder: &Folder) -> std::path::PathBuf {
    let mut gltf = Gltf::new();
    let wall = quad([-9.0, -9.0, -2.0], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], 1);
    add(&mut gltf, &wall, diffuse([0.0; 3], [2.0, 1.0, 0.5]));
    let mut glass = diffuse([0.5; 3], [0.25, 0.25, 0.25]);
    glass["alphaMode"] = json!("BLEND");
    glass["pbrMetallicRoughness"]["baseColorFactor"][3] = json!(0.3);
    add(&mut gltf, &quad([-9.0, -9.0, -1.0], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], 1), glass);
    save(gltf, folder, "pane")
}

#[test]
fn panes_are_seen_by_their_opacity() {
    let folder = Folder::new();
    let scene = load(&pane(&folder));
    let world = world(&scene);
    let camera = camera(&scene, FROM, [0.1, 0.3, -1.0], 40.0);
    let reference = small(&world, &camera, &settings(1024, Strategy::Mis));
    let albedo = reference.image.layer("albedo").unwrap();
    // A share of 0.3 with a standard error of √(0.21/1024) a pixel; six of them.
    assert!(albedo.iter().all(|a| (a.x / 0.5 - 0.3).abs() < 6.0 * 0.0144), "{albedo:?}");
    // Nothing arrives at the pane's front; through the pane the wall receives the pane's own light, and reflects none.
    let expected = [2.0, 1.0, 0.5].map(|wall| 0.7 * wall + 0.3 * 0.25);
    let variance = reference.beauty_variance().unwrap();
    assert!(variance.iter().all(|v| v.x > 0.0), "chance makes noise");
    Check { found: reference.beauty(), variance, floor: ROUNDING }.against_constant(expected, "pane");
}

#[test]
fn averages_go_on_where_they_stopped() {
    let folder = Folder::new();
    let scene = load(&pane(&folder));
    let world = world(&scene);
    let camera = camera(&scene, FROM, [0.1, 0.3, -1.0], 40.0);
    let go = |spp, previous| {
        let settings = ReferenceSettings { spp, ..settings(spp, Strategy::Mis) };
        trace(&world, &camera, WIDTH, HEIGHT, &settings, Progress::hidden(), previous)
    };
    let (whole, half) = (go(64, None), go(32, None));
    assert_eq!(go(64, half.state).image, whole.image);
}

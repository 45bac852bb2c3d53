//! Light that comes through walls: figures of the report and of the pictures themselves.

use glam::Vec3;
use lightprobe::image::LayeredImage;
use lightprobe::math::color::luminance;
use serde_json::Value;

use crate::common::Folder;
use crate::program::{Bake, bake, method, render, scene};

/// A metre between probes, the wall between two planes of them.
const SPACING: &str = "--set grid.spacing_m=1";

fn irradiance(folder: &Folder, run: &str, method: &str) -> Vec<Vec3> {
    let path = folder.path().join(run).join(format!("{method}.exr"));
    let image = LayeredImage::read_exr(&path).unwrap_or_else(|e| panic!("{e}"));
    image.layer("irradiance_indirect").expect("the layer").to_vec()
}

/// Mean luminance of a picture's irradiance from probes.
fn mean(folder: &Folder, run: &str, method: &str) -> f64 {
    let pixels = irradiance(folder, run, method);
    assert!(pixels.iter().all(|p| p.is_finite() && p.min_element() >= 0.0));
    pixels.iter().map(|p| f64::from(luminance(*p))).sum::<f64>() / pixels.len() as f64
}

fn view(folder: &Folder, name: &str, baked: &Bake, camera: &str) -> Value {
    render(folder, &scene(name), &baked.path, camera, &format!("--camera {camera} --size 128x72"))
}

fn leak_light(report: &Value) -> f64 {
    method(report, "visibility_on")["leak"]["light"].as_f64().expect("light to be seen")
}

#[test]
fn a_sealed_wall_leaks_without_visibility_and_not_with_it() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("two_rooms_sealed"), SPACING);
    let planes: Vec<f64> = (0..baked.file.states().len()).map(|p| baked.file.position(p)[0]).collect();
    assert!(planes.iter().all(|x| x.abs() > 0.3), "a plane of probes lies in the wall");
    let lit = view(&folder, "two_rooms_sealed", &baked, "lit");
    view(&folder, "two_rooms_sealed", &baked, "dark");
    let ratio = |method: &str| mean(&folder, "dark", method) / mean(&folder, "lit", method);
    assert!(ratio("visibility_off") >= 0.03, "{}", ratio("visibility_off"));
    assert!(ratio("visibility_on") <= 0.001, "{}", ratio("visibility_on"));
    assert!(ratio("visibility_ray") <= 0.001, "{}", ratio("visibility_ray"));
    assert!(leak_light(&lit) <= 0.001, "{lit}");
    let off = &method(&lit, "visibility_off")["leak"];
    // Without visibility half of the probes around a wall's points are hidden ones.
    assert!(off["weight"].as_f64().unwrap() > 0.2, "{off}");
    // And the figures are those of the picture: the report's mean against the pixels' own, every pixel showing a wall.
    let reported = method(&lit, "visibility_on")["irradiance_indirect_mean"].as_f64().unwrap();
    // 16-bit EXR channels would be off by 5e-4; f32 by far less.
    assert!((mean(&folder, "lit", "visibility_on") / reported - 1.0).abs() < 1e-3);
}

#[test]
fn the_far_room_is_lit_through_the_passage() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("two_rooms_open"), SPACING);
    for camera in ["lit", "dark"] {
        let report = view(&folder, "two_rooms_open", &baked, camera);
        assert!(leak_light(&report) <= 0.001, "{camera}: {report}");
        let dark = method(&report, "visibility_on")["leak"]["dark"].as_f64().unwrap();
        assert!(dark <= 0.001, "{camera}: {dark}");
    }
    let (on, exact) = (mean(&folder, "dark", "visibility_on"), mean(&folder, "dark", "visibility_ray"));
    // Light that passes: more than a hundredth of the lit room's, against nothing where the wall is sealed.
    assert!(on > 0.01 * mean(&folder, "lit", "visibility_on"), "{on}");
    assert!((on / exact - 1.0).abs() < 0.01, "{on} against {exact} by exact visibility");
    // Without visibility, light through the wall itself.
    let off = render(&folder, &scene("two_rooms_open"), &baked.path, "off", "--camera dark --size 64x36");
    assert!(method(&off, "visibility_off")["leak"]["light"].as_f64().unwrap() > 0.1, "{off}");
}

#[test]
fn a_wall_of_a_millimetre_is_a_wall() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("thin_wall"), SPACING);
    for camera in ["middle", "behind_solid"] {
        view(&folder, "thin_wall", &baked, camera);
    }
    let lit = mean(&folder, "middle", "visibility_on");
    assert!(mean(&folder, "behind_solid", "visibility_off") > 0.03 * lit);
    assert!(mean(&folder, "behind_solid", "visibility_on") <= 0.001 * lit);
}

/// Points behind the sheet that see none of their probes (those behind it count as inside geometry) must not be lit by
/// the probes before it either.
#[test]
fn a_single_sheet_is_a_wall_from_behind_too() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("thin_wall"), SPACING);
    for camera in ["middle", "behind_sheet"] {
        view(&folder, "thin_wall", &baked, camera);
    }
    let (on, exact) = (mean(&folder, "behind_sheet", "visibility_on"), mean(&folder, "behind_sheet", "visibility_ray"));
    let lit = mean(&folder, "middle", "visibility_on");
    assert!(on <= 0.001 * lit, "{on} behind the sheet with visibility, {exact} with exact visibility, {lit} before it");
}

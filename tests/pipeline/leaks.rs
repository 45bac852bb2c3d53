//! Light that comes through walls: figures of the report and of the pictures themselves. Of the preset physical, whose values
//! are not fitted with visibility: pictures without it say what it does.

use glam::Vec3;
use lightprobe::image::LayeredImage;
use lightprobe::math::color::luminance;
use serde_json::Value;

use crate::common::Folder;
use crate::program::{Bake, bake_physical, method, render, scene};

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
    let baked = bake_physical(&folder, &scene("two_rooms_sealed"), SPACING);
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

/// The share that the report gives is that of the pictures' own pixels.
#[test]
fn blocks_are_the_pixels_that_are_off_by_a_quarter() {
    let folder = Folder::new();
    let baked = bake_physical(&folder, &scene("two_rooms_open"), SPACING);
    let report = view(&folder, "two_rooms_open", &baked, "dark");
    let exact: Vec<f32> = irradiance(&folder, "dark", "visibility_ray").into_iter().map(luminance).collect();
    let least = 0.01 * exact.iter().sum::<f32>() / exact.len() as f32;
    for name in ["visibility_off", "visibility_on", "visibility_ray"] {
        let shown = irradiance(&folder, "dark", name);
        let is_off = |(e, exact): &(&Vec3, &f32)| (luminance(**e) - **exact).abs() > 0.25 * exact.max(least);
        let share = shown.iter().zip(&exact).filter(is_off).count() as f64 / exact.len() as f64;
        let reported = method(&report, name)["leak"]["blocks"].as_f64().unwrap();
        // Of 9216 pixels, each of which shows one point: one may fall to the other side by rounding.
        assert!((reported - share).abs() < 2e-4, "{name}: {reported} {share}");
        let unseen = method(&report, name)["leak"]["unseen"].as_f64().unwrap();
        assert_eq!((unseen, method(&report, name)["outside_hull"].as_f64()), (0.0, Some(0.0)), "{name}");
        assert_eq!(reported > 0.05, name == "visibility_off", "{name}: {reported}");
    }
    assert_eq!(method(&report, "visibility_ray")["leak"]["blocks"], 0.0);
    // Probes in the lit room alone: what the camera in the other one sees lies beyond them.
    let bounds = "--set grid.bounds=(min:(-4,0,-2),max:(-0.2,2.5,2))";
    let half = bake_physical(&folder, &scene("two_rooms_open"), &format!("{SPACING} {bounds}"));
    let report = view(&folder, "two_rooms_open", &half, "dark");
    let outside = method(&report, "visibility_on")["outside_hull"].as_f64().unwrap();
    assert!(outside > 0.5 && outside <= 1.0, "{outside}");
}

#[test]
fn the_far_room_is_lit_through_the_passage() {
    let folder = Folder::new();
    let baked = bake_physical(&folder, &scene("two_rooms_open"), SPACING);
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
    let baked = bake_physical(&folder, &scene("thin_wall"), SPACING);
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
    let baked = bake_physical(&folder, &scene("thin_wall"), SPACING);
    for camera in ["middle", "behind_sheet"] {
        view(&folder, "thin_wall", &baked, camera);
    }
    let (on, exact) = (mean(&folder, "behind_sheet", "visibility_on"), mean(&folder, "behind_sheet", "visibility_ray"));
    let lit = mean(&folder, "middle", "visibility_on");
    assert!(on <= 0.001 * lit, "{on} behind the sheet with visibility, {exact} with exact visibility, {lit} before it");
}

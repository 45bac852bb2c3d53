//! Materials at the ends of their ranges.

use std::f64::consts::PI;

use lightprobe::image::LayeredImage;
use serde_json::json;

use super::case::{Bound, Case};
use super::look::{bake, worse};
use super::rooms::{AT_FURNACE, IN_FURNACE, furnace, in_furnace};
use crate::common::{Folder, Gltf};
use crate::program::{succeed, text};
use crate::shapes::save;

const EXACT: f64 = 2e-4 + 1e-5;

/// The furnace of base colour 0.5 with another material.
fn room(roughness: f64, metallic: f64) -> Gltf {
    let mut gltf = furnace(0.5);
    let material = &mut gltf.json["materials"][0]["pbrMetallicRoughness"];
    material["roughnessFactor"] = json!(roughness);
    material["metallicFactor"] = json!(metallic);
    gltf
}

pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (roughness, metallic) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let name = format!("roughness {roughness}, metallic {metallic}");
        // Metals have no diffuse albedo.
        let expected = if metallic == 1.0 { PI } else { in_furnace(0.5) };
        cases.push(Case::new("material", &name, "probes against πLe/(1 − ρ)", Bound::AtMost(EXACT), move || {
            let baked = bake(room(roughness, metallic), IN_FURNACE);
            baked.look(AT_FURNACE);
            baked.worst_mean(expected)
        }));
        cases.push(Case::new(
            "material",
            &name,
            "glossy reference: dimmest pixel ÷ Le",
            Bound::AtLeast(1.0 - 1e-5),
            move || glossy(room(roughness, metallic)).0,
        ));
        // Neither kind of surface reflects more than it gets: with a reflectance of at most 1 − (1 − F₀)·(…) < 1 of grazing
        // light the sum of all bounces stays near that of a mean reflectance of 0.5; four times Le is 0.75.
        cases.push(Case::new("material", &name, "glossy reference: mean ÷ Le", Bound::AtMost(4.0), move || {
            glossy(room(roughness, metallic)).1
        }));
    }
    cases.push(Case::new(
        "material",
        "albedo 1",
        "irradiance ÷ that at albedo 0.999",
        Bound::AtMost(1.0 + 1e-5),
        || {
            let [one, most] =
                [1.0, 0.999].map(|albedo| bake(furnace(albedo), &format!("{IN_FURNACE} --set solver.max_bounces=21")));
            assert_eq!(one.report["numerics"]["albedo_clamped"], 1);
            one.texels().into_iter().fold(0.0, worse) / most.texels().into_iter().fold(0.0, worse)
        },
    ));
    cases
}

/// Least and mean red radiance of a reference with GGX.
fn glossy(gltf: Gltf) -> (f64, f64) {
    let folder = Folder::new();
    let scene = save(gltf, &folder, "room");
    let output = folder.path().join("reference.exr");
    let mut arguments =
        vec!["reference", text(&scene), "-o", text(&output), "--spp", "32", "--transport", "gltf", "-q"];
    arguments.extend(["--size", "16x9", AT_FURNACE]);
    succeed(&arguments);
    let image = LayeredImage::read_exr(&output).unwrap_or_else(|e| panic!("{e}"));
    let pixels = image.layer("beauty").expect("the layer");
    assert!(pixels.iter().all(|p| p.is_finite()));
    let red = || pixels.iter().map(|p| f64::from(p.x));
    (red().fold(f64::INFINITY, f64::min), red().sum::<f64>() / pixels.len() as f64)
}

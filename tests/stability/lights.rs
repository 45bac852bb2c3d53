//! Light of all strengths, from small sources and from near the horizon.

use std::f64::consts::PI;

use serde_json::json;

use super::case::{Bound, Case, Found, shared};
use super::look::{Baked, bake, difference, worse};
use super::rooms::{Lamp, Rooms, SPACING_M, Wall, inside_of};
use crate::common::Gltf;
use crate::shapes::{add, add_light, diffuse, dot, quad};

/// Storage formats with the largest relative error of one value: rounding of sums, half a step of 10 bits of mantissa,
/// half a step of 5 (blue in r11g11b10f; red and green have 6) and what bilinear filtering of these may add.
pub const FORMATS: [(&str, f64); 3] = [("f32", 1e-3), ("f16", 1e-3), ("r11g11b10f", 2.5e-2)];

pub fn cases() -> Vec<Case> {
    let mut cases = strengths();
    cases.extend(both_strengths());
    cases.push(Case::new(
        "light",
        "emitter of 1 mm at 1 m",
        "against its closed form",
        Bound::AtMost(1e-3),
        small_emitter,
    ));
    cases.extend(grazing_sun());
    cases
}

fn rooms(radiance: f64) -> Rooms {
    Rooms {
        albedo: 0.7,
        wall: Wall::Door(0.1),
        lamp: Lamp::Area(radiance),
        scale: 1.0,
        shift: 0.0,
        spacing_m: SPACING_M,
    }
}

fn strengths() -> Vec<Case> {
    let base = shared(|| bake(rooms(1.0).gltf(), &rooms(1.0).words()));
    let mut cases = Vec::new();
    for factor in [1e-9, 1e9] {
        for (format, precision) in FORMATS {
            let base = base.clone();
            let name = format!("× {factor:e}, {format}");
            cases.push(Case::new("light", name, "irradiance against × 1", Bound::AtMost(precision), move || {
                let words = format!("{} --set encoding.irradiance={format}", rooms(1.0).words());
                let baked = bake(rooms(factor).gltf(), &words);
                baked.look("--camera lit");
                let scaled: Vec<f64> = baked.texels().iter().map(|e| e / factor).collect();
                let note = format!("{} clamped", baked.report["numerics"]["clamped"]["irradiance"]);
                Found { figure: difference(&base.texels(), &scaled), note }
            }));
        }
    }
    cases
}

/// Radiance of the walls of the two furnaces.
const BRIGHT: f64 = 1e9;
const DIM: f64 = 1e-9;

/// Two furnaces of albedo 0.5 side by side; a share of 1e-18 of the one's light would double the other's.
fn bright_and_dim(format: &str, emission: &str) -> Baked {
    let mut gltf = Gltf::new();
    add(&mut gltf, &inside_of([-2.1, -1.0, -1.0], [-0.1, 1.0, 1.0]), diffuse([0.5; 3], [BRIGHT; 3]));
    add(&mut gltf, &inside_of([0.1, -1.0, -1.0], [2.1, 1.0, 1.0]), diffuse([0.5; 3], [DIM; 3]));
    let words = "--set capture.resolution=16 --set grid.spacing_m=0.7 --set capture.emission=";
    let baked = bake(gltf, &format!("{words}{emission} --set encoding.irradiance={format}"));
    // Of light too dim for the format there is none to be seen.
    baked.look_dark("--look-at=0.3,0.1,0.1,2,0,0,80");
    baked
}

/// Largest relative error of the probes of one of the furnaces.
fn worst(baked: &Baked, dim: bool) -> f64 {
    let file = &baked.file;
    let radiance = if dim { DIM } else { BRIGHT };
    let probes: Vec<usize> = file.active().into_iter().filter(|&p| (file.position(p)[0] > 0.0) == dim).collect();
    assert!(!probes.is_empty());
    let off = |p: usize| (file.mean_irradiance(p)[0] / (PI * radiance / 0.5) - 1.0).abs();
    probes.into_iter().map(off).fold(0.0, worse)
}

fn both_strengths() -> Vec<Case> {
    let mut cases = Vec::new();
    for (format, precision) in FORMATS {
        let baked = shared(move || bright_and_dim(format, "gathered"));
        let name = format!("1e9 beside 1e-9, {format}");
        let of = baked.clone();
        cases.push(Case::new("light", &name, "bright room", Bound::AtMost(precision), move || worst(&of, false)));
        if format == "f32" {
            cases.push(Case::new("light", &name, "dim room", Bound::AtMost(precision), move || worst(&baked, true)));
        } else {
            // Eighteen orders do not fit: what is lost must be counted, each value of it.
            let checked = "values below the format's range, counted ÷ all of the dim room";
            cases.push(Case::new("light", &name, checked, Bound::AtLeast(1.0), move || {
                let file = &baked.file;
                let dim = file.active().into_iter().filter(|&p| file.position(p)[0] > 0.0).count();
                let side = file.resolution() + 2 * file.border();
                let counted = baked.report["numerics"]["underflowed"]["irradiance"].as_f64().expect("a count");
                counted / (dim * side * side) as f64
            }));
        }
    }
    let sampled = "1e9 beside 1e-9, f32, emission sampled";
    cases.push(Case::new("light", sampled, "dim room", Bound::AtMost(1e-3), || {
        worst(&bright_and_dim("f32", "sampled"), true)
    }));
    cases
}

/// One probe a metre below and beside a black square millimetre that emits: E(n) = L·A·cosθ·max(0, n·ω)/d², up to
/// (1 mm/d)².
fn small_emitter() -> f64 {
    const SIDE: f64 = 1e-3;
    const RADIANCE: f64 = 1e6;
    let mut gltf = Gltf::new();
    let half = (SIDE / 2.0) as f32;
    let lamp = quad([-half, 0.8, -half], [SIDE as f32, 0.0, 0.0], [0.0, 0.0, SIDE as f32], 1);
    add(&mut gltf, &lamp, diffuse([0.0; 3], [RADIANCE; 3]));
    let words = "--set encoding.irradiance=f32 --set grid.divisions=(1,1,1) --set placement.keep_unsampled=true \
                 --set grid.bounds={\"min\":[0.6,0,0],\"max\":[0.6,0,0]}";
    let baked = bake(gltf, words);
    let to = [-0.6, 0.8, 0.0];
    let exact = |n| RADIANCE * SIDE * SIDE * 0.8 * dot(n, to).max(0.0);
    let texels = baked.file.texels(0);
    let exact: Vec<f64> = texels.iter().map(|t| exact(t.0)).collect();
    difference(&exact, &texels.iter().map(|t| t.2[0]).collect::<Vec<_>>())
}

/// A sun a twentieth of a degree above the horizon of a plane.
fn grazing_sun() -> Vec<Case> {
    const SUN: f64 = 1000.0;
    const ALBEDO: f64 = 0.5;
    let height = 0.05f64.to_radians();
    let baked = shared(move || {
        let mut gltf = Gltf::new();
        let plane = quad([-2000.0, 0.0, -2000.0], [0.0, 0.0, 4000.0], [4000.0, 0.0, 0.0], 1);
        add(&mut gltf, &plane, diffuse([ALBEDO; 3], [0.0; 3]));
        // Turns −Z down by the sun's height.
        let half = -height / 2.0;
        let node = json!({ "rotation": [half.sin(), 0.0, 0.0, half.cos()] });
        add_light(&mut gltf, json!({ "type": "directional", "intensity": SUN }), node);
        let words = "--set encoding.irradiance=f32 --set placement.keep_unsampled=true --set grid.divisions=(2,2,2) \
                     --set grid.bounds={\"min\":[-0.5,0.5,-0.5],\"max\":[0.5,1.5,0.5]}";
        bake(gltf, words)
    });
    let of = baked.clone();
    vec![
        // The light's direction comes from a quaternion of f32: 6e-8 ÷ sin 0.05° is 7e-5.
        Case::new(
            "light",
            "sun 0.05° above a plane",
            "direct irradiance against E·sin",
            Bound::AtMost(1e-3),
            move || {
                let seen = of.look("--look-at=0,1,0,0,0,-1,60");
                let off = |p: &glam::Vec3| (f64::from(p.x) / (SUN * height.sin()) - 1.0).abs();
                seen.irradiance("visibility_on", "irradiance_direct").iter().map(off).fold(0.0, worse)
            },
        ),
        // E(n) = ρ·E·sin·(1 − n·up)/2; the horizon lies within texels of 0.1 rad, see the pipeline's test of a sky.
        Case::new(
            "light",
            "sun 0.05° above a plane",
            "probes against ρE·sin·(1 − n·up)/2",
            Bound::AtMost(1e-2),
            move || {
                let texels = baked.file.texels(0);
                let exact: Vec<f64> =
                    texels.iter().map(|t| ALBEDO * SUN * height.sin() * (1.0 - t.0[1]) / 2.0).collect();
                difference(&exact, &texels.iter().map(|t| t.2[0]).collect::<Vec<_>>())
            },
        ),
    ]
}

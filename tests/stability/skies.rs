//! Little in the scene, or nothing: skies without ground, ground without light, light without ground.

use std::f64::consts::PI;

use serde_json::json;

use super::case::{Bound, Case};
use super::look::{Baked, bake, bake_dark};
use super::rooms::{AT_FURNACE, IN_FURNACE};
use crate::common::{Folder, Gltf};
use crate::program::{refuse, text};
use crate::shapes::{add, add_light, diffuse, quad, room, save};

/// Sums of a thousand f32.
const ROUNDING: f64 = 1e-5;

pub fn cases() -> Vec<Case> {
    let sky = |gltf: fn() -> Gltf| {
        move || {
            let baked = bake_dark(gltf(), &format!("{IN_FURNACE} --env 1,1,1 --set placement.keep_unsampled=true"));
            baked.look_dark(&format!("--env 1,1,1 {AT_FURNACE}"));
            baked.texels().into_iter().map(|e| (e / PI - 1.0).abs()).fold(0.0, super::look::worse)
        }
    };
    let dark = |gltf: fn() -> Gltf| move || brightest(&bake_dark(gltf(), IN_FURNACE));
    vec![
        Case::new("sky", "and a square centimetre", "every texel against π", Bound::AtMost(ROUNDING), sky(speck)),
        Case::new("dark", "no light", "brightest texel and pixel", Bound::AtMost(0.0), dark(unlit_room)),
        Case::new("dark", "light, but no surface", "errors, on one line", Bound::AtMost(1.0), || {
            refused(lamp_alone(), &[])
        }),
        Case::new("dark", "nothing at all", "errors, on one line", Bound::AtMost(1.0), || refused(Gltf::new(), &[])),
        Case::new("sky", "and nothing else", "errors, on one line", Bound::AtMost(1.0), || {
            refused(Gltf::new(), &["--env", "1,1,1"])
        }),
        Case::new(
            "sky",
            "through a missing wall, as bright as the room",
            "against πLe/(1 − ρ)",
            Bound::AtMost(2e-4 + ROUNDING),
            || {
                let mut gltf = Gltf::new();
                // All but the last wall.
                let walls = room(1);
                add(&mut gltf, &walls[..walls.len() - 6], diffuse([0.5; 3], [1.0; 3]));
                let baked = bake(gltf, &format!("{IN_FURNACE} --env 2,2,2 --set capture.emission=gathered"));
                baked.look(&format!("--env 2,2,2 {AT_FURNACE}"));
                baked.worst_mean(2.0 * PI)
            },
        ),
    ]
}

/// So far away that no ray meets it.
fn speck() -> Gltf {
    let mut gltf = Gltf::new();
    add(&mut gltf, &quad([0.0, -300.0, 0.0], [0.0, 0.0, 0.01], [0.01, 0.0, 0.0], 1), diffuse([0.5; 3], [0.0; 3]));
    gltf
}

fn unlit_room() -> Gltf {
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.9; 3], [0.0; 3]));
    gltf
}

fn lamp_alone() -> Gltf {
    let mut gltf = Gltf::new();
    add_light(&mut gltf, json!({ "type": "point", "intensity": 100.0 }), json!({ "translation": [0.1, 0.2, 0.3] }));
    gltf
}

/// What no surface is in cannot be lit: the program says so, on one line, and writes nothing. Returns the lines.
fn refused(gltf: Gltf, words: &[&str]) -> f64 {
    let folder = Folder::new();
    let scene = save(gltf, &folder, "scene");
    let output = folder.path().join("out.probes");
    let message = refuse(&[&["bake", text(&scene), "-o", text(&output)], words].concat());
    assert!(message.contains("scene.glb") && message.contains("no triangles"), "{message}");
    assert!(!output.exists());
    message.lines().count() as f64
}

fn brightest(baked: &Baked) -> f64 {
    let seen = baked.look_dark(AT_FURNACE);
    let pixels = ["visibility_off", "visibility_on", "visibility_ray"].map(|method| seen.mean(method));
    baked.texels().into_iter().chain(pixels).fold(0.0, super::look::worse)
}

//! Metallic-roughness transport.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use lightprobe::light::bsdf::ReflectionModel;
use lightprobe::light::path::Strategy;
use lightprobe::scene::Environment;
use lightprobe::shade::reference::{ReferenceSettings, trace};
use lightprobe::system::progress::Progress;
use serde_json::{Value, json};

use super::{Check, HEIGHT, ROUNDING, STRATEGIES, WIDTH, camera, load, settings, small, world};
use crate::common::{Folder, Gltf};
use crate::shapes::{add, add_light, diffuse, quad, room, save};

fn material(color: [f64; 3], metallic: f64, roughness: f64) -> Value {
    json!({ "pbrMetallicRoughness": {
        "baseColorFactor": [color[0], color[1], color[2], 1.0], "metallicFactor": metallic, "roughnessFactor": roughness,
    } })
}

fn gltf(spp: u32, strategy: Strategy) -> ReferenceSettings {
    ReferenceSettings { transport: ReflectionModel::Gltf, ..settings(spp, strategy) }
}

#[test]
fn mirrors_show_the_sky() {
    // Roughness 0, metal: radiance F·L with F = F0 but for grazing angles. Shadowing takes α²·tan²/4 = 2.5e-7.
    let folder = Folder::new();
    let mut gltf_file = Gltf::new();
    let plane = quad([-500.0, 0.0, -500.0], [0.0, 0.0, 1000.0], [1000.0, 0.0, 0.0], 1);
    add(&mut gltf_file, &plane, material([0.9, 0.5, 0.2], 1.0, 0.0));
    let mut scene = load(&save(gltf_file, &folder, "mirror"));
    scene.environment = Environment::Constant(Vec3::new(1.0, 2.0, 0.5));
    let world = world(&scene);
    let camera = camera(&scene, [0.0, 1.0, 1.0], [0.0, 0.0, 0.0], 10.0);
    let reference = small(&world, &camera, &gltf(512, Strategy::Mis));
    let variance = reference.beauty_variance().expect("two blocks");
    // Schlick's rise of F at 50° is (1 − F0)·(1 − 0.64)⁵ = 0.6 % of what F0 lacks, and the range of angles ±5°.
    let cosine = 0.5f64.sqrt();
    let fresnel = |f0: f64| f0 + (1.0 - f0) * (1.0 - cosine).powi(5);
    let expected = [fresnel(0.9), 2.0 * fresnel(0.5), 0.5 * fresnel(0.2)];
    Check { found: reference.beauty(), variance, floor: 5e-3 }.against_constant(expected, "mirror");
    // The irradiance does not know what the surface does with it.
    Check::indirect(&reference).against_constant([PI, 2.0 * PI, 0.5 * PI], "irradiance on a mirror");
    let glossy = reference.image.layer("glossy").expect("a glossy layer");
    assert!(glossy.iter().zip(reference.beauty()).all(|(g, b)| g.abs_diff_eq(*b, 1e-5)), "all of it is glossy");
}

#[test]
fn white_surfaces_under_a_white_sky_show_their_directional_albedo() {
    // baseColor, metallic, roughness, n·v; and the directional albedo of glTF's appendix B by quadrature in f64. F0 = 1
    // stands for 0.999, to which `albedo_max` clamps it. At none of these does the appendix exceed 1, for any light.
    let cases = [
        (1.0, 1.0, 0.5, 0.2, 0.8307),
        (1.0, 1.0, 0.5, 0.5, 0.8543),
        (1.0, 1.0, 0.3, 0.2, 0.9115),
        (1.0, 1.0, 1.0, 0.5, 0.4087),
        (0.8, 0.0, 0.5, 0.2, 0.8798),
        (0.8, 0.0, 0.5, 0.5, 0.8197),
    ];
    for (color, metallic, roughness, cosine, albedo) in cases {
        let folder = Folder::new();
        let mut gltf_file = Gltf::new();
        let plane = quad([-500.0, 0.0, -500.0], [0.0, 0.0, 1000.0], [1000.0, 0.0, 0.0], 1);
        add(&mut gltf_file, &plane, material([color; 3], metallic, roughness));
        let mut scene = load(&save(gltf_file, &folder, "white"));
        scene.environment = Environment::Constant(Vec3::ONE);
        let world = world(&scene);
        let eye = [0.0, 2.0 * cosine, 2.0 * (1.0f64 - cosine * cosine).sqrt()];
        let camera = camera(&scene, eye, [0.0; 3], 0.5);
        let reference = small(&world, &camera, &gltf(1024, Strategy::Mis));
        let variance = reference.beauty_variance().expect("two blocks");
        // The picture spans half a degree, over which the albedo changes by up to 1e-3, symmetrically about the middle.
        let what = format!("{color} {metallic} {roughness} {cosine}");
        Check { found: reference.beauty(), variance, floor: 1e-3 }.against_constant([albedo; 3], &what);
    }
}

/// Walls of all kinds, a lamp, a point light.
fn mixed_room(folder: &Folder, glass: bool) -> std::path::PathBuf {
    let mut gltf = Gltf::new();
    let walls = room(1);
    for (i, face) in walls.chunks(12).enumerate() {
        add(&mut gltf, face, material([0.8, 0.6, 0.4], [0.0, 1.0, 0.5][i], [0.6, 0.4, 1.0][i]));
    }
    add(&mut gltf, &quad([-0.5, 0.9, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], 1), diffuse([0.5; 3], [3.0, 2.0, 1.0]));
    add_light(&mut gltf, json!({ "type": "point", "intensity": 0.5 }), json!({ "translation": [-0.5, -0.3, 0.5] }));
    if glass {
        let mut pane = material([0.5; 3], 0.0, 0.3);
        pane["alphaMode"] = json!("BLEND");
        pane["pbrMetallicRoughness"]["baseColorFactor"][3] = json!(0.4);
        add(&mut gltf, &quad([-0.4, -0.5, -0.2], [0.9, 0.0, 0.0], [0.0, 0.8, 0.1], 1), pane);
    }
    save(gltf, folder, "mixed")
}

#[test]
fn strategies_agree() {
    let folder = Folder::new();
    let scene = load(&mixed_room(&folder, false));
    let world = world(&scene);
    let camera = camera(&scene, [0.1, 0.0, 0.95], [0.1, -0.3, -1.0], 80.0);
    let all = STRATEGIES.map(|strategy| small(&world, &camera, &gltf(2048, strategy)));
    for (i, j) in [(0, 1), (0, 2)] {
        let sum = |a: Option<&[Vec3]>, b: Option<&[Vec3]>| -> Vec<Vec3> {
            a.unwrap().iter().zip(b.unwrap()).map(|(a, b)| *a + *b).collect()
        };
        let exact = |layer: &[Vec3]| -> Vec<DVec3> { layer.iter().map(|e| e.as_dvec3()).collect() };
        let what = format!("{:?} and {:?}", STRATEGIES[i], STRATEGIES[j]);
        let variance = sum(all[i].beauty_variance(), all[j].beauty_variance());
        let beauty = Check { found: all[i].beauty(), variance: &variance, floor: ROUNDING };
        beauty.against(&exact(all[j].beauty()), &format!("beauty, {what}"));
        let variance = sum(all[i].irradiance_indirect_variance(), all[j].irradiance_indirect_variance());
        let irradiance = Check { found: all[i].irradiance_indirect(), variance: &variance, floor: ROUNDING };
        irradiance.against(&exact(all[j].irradiance_indirect()), &what);
    }
}

#[test]
fn layers_add_up_and_runs_go_on() {
    let folder = Folder::new();
    for glass in [false, true] {
        let scene = load(&mixed_room(&folder, glass));
        let world = world(&scene);
        let camera = camera(&scene, [0.1, 0.0, 0.95], [0.1, -0.3, -1.0], 80.0);
        let go = |spp, previous| {
            trace(&world, &camera, WIDTH, HEIGHT, &gltf(spp, Strategy::Mis), Progress::hidden(), previous)
        };
        let (whole, half) = (go(64, None), go(16, None));
        assert_eq!(go(64, half.state).image, whole.image);
        let layer = |name: &str| whole.image.layer(name).unwrap();
        for (i, beauty) in whole.beauty().iter().enumerate() {
            let sum = layer("emission")[i] + layer("direct")[i] + layer("indirect")[i];
            assert!(sum.distance(*beauty) <= 1e-5 * beauty.length(), "{sum} {beauty}");
            assert!(layer("glossy")[i].cmple(layer("indirect")[i] + 1e-6).all());
        }
    }
}

#[test]
fn punctual_lights_on_metals_are_exact() {
    // Straight above a rough metal and looking straight down at the point below: D·F·G/4 has n·l = n·v = n·h = 1.
    let folder = Folder::new();
    let mut file = Gltf::new();
    let plane = quad([-5.0, 0.0, -5.0], [0.0, 0.0, 10.0], [10.0, 0.0, 0.0], 1);
    add(&mut file, &plane, material([0.9, 0.5, 0.2], 1.0, 0.7));
    add_light(&mut file, json!({ "type": "point", "intensity": 2.0 }), json!({ "translation": [0.0, 3.0, 0.0] }));
    let scene = load(&save(file, &folder, "metal"));
    let world = world(&scene);
    let camera = camera(&scene, [0.0, 2.0, 0.0], [0.0, 0.0, 0.0], 0.01);
    let reference = small(&world, &camera, &gltf(32, Strategy::Mis));
    // D(1) = 1/(πα²), G = 1, E = I/r².
    let expected = Vec3::new(0.9, 0.5, 0.2) * (2.0 / 9.0 / (4.0 * PI * 0.49 * 0.49)) as f32;
    for direct in reference.image.layer("direct").unwrap() {
        assert!(direct.distance(expected) < 1e-4 * expected.length(), "{direct} {expected}");
    }
}

//! Where in the world a scene stands changes no bit of it.

use glam::Vec3;
use lightprobe::scene::{LightKind, Scene};
use proptest::prelude::*;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{Rng, SeedableRng};
use serde_json::json;

use crate::common::Gltf;
use crate::{loaded, tetrahedron};

/// Every bit that a scene's place in the world must not change.
fn bits(scene: &Scene) -> Vec<u32> {
    let mesh = &scene.mesh;
    let vectors = mesh.positions.iter().chain(&mesh.normals).copied();
    let cameras = scene.cameras.iter().flat_map(|c| {
        let m = c.world_from_camera;
        [c.position, m.x_axis, m.y_axis, m.z_axis]
    });
    let lights = scene.lights.iter().flat_map(|l| match l.kind {
        LightKind::Point { position, .. } => vec![position],
        LightKind::Spot { position, direction, .. } => vec![position, direction],
        LightKind::Directional { direction } => vec![direction],
    });
    let tangents = mesh.tangents.iter().flat_map(|t| t.to_array());
    let floats = vectors.chain(cameras).chain(lights).flat_map(|v| v.to_array()).chain(tangents).map(f32::to_bits);
    floats.chain(mesh.triangles.iter().flatten().copied()).collect()
}

/// A small tree of turned, scaled and mirrored nodes, lights, a camera and instances.
pub fn tree(rng: &mut Pcg32, size: f32) -> Gltf {
    let mut unit = || (rng.next_u32() >> 8) as f32 / (1u32 << 23) as f32 - 1.0;
    let mut transform = || {
        json!({
            "translation": [unit() * size, unit() * size, unit() * size],
            "rotation": [unit(), unit(), unit(), unit() + 1.5],
            "scale": [unit() + 1.1, unit() - 1.2, 0.5]
        })
    };
    let mut gltf = tetrahedron(transform());
    for mesh in [true, false, true] {
        let parent = gltf.json["nodes"].as_array().expect("nodes").len() - 1;
        let mut node = transform();
        if mesh {
            node["mesh"] = json!(0);
        } else {
            node["camera"] = json!(0);
            node["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
        }
        let child = gltf.push("nodes", node);
        gltf.json["nodes"][parent]["children"] = json!([child]);
    }
    let offsets: Vec<f32> = (0..6).map(|_| transform()["translation"][0].as_f64().expect("a number") as f32).collect();
    let offsets = gltf.floats(&offsets, "VEC3");
    let mut instanced = transform();
    instanced["mesh"] = json!(0);
    instanced["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": offsets } } });
    gltf.root(instanced);
    gltf.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }));
    gltf.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "spot": {} }] } });
    gltf
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn a_distant_scene_is_bit_identical(seed: u64, size in 1e-3f32..1e3, direction in prop::array::uniform3(-1.0f32..1.0)) {
        let mut gltf = tree(&mut Pcg32::seed_from_u64(seed), size);
        let near = loaded(&gltf);
        let roots = gltf.json["scenes"][0]["nodes"].take();
        let root = gltf.push("nodes", json!({ "children": roots }));
        gltf.json["scenes"][0]["nodes"] = json!([root]);
        for distance in [1e5, 1e6 * size] {
            let translation = direction.map(|d| d * distance);
            gltf.json["nodes"][root]["translation"] = json!(translation);
            let far = loaded(&gltf);
            prop_assert_eq!(bits(&far), bits(&near));
            let moved = far.origin_world - near.origin_world;
            prop_assert!(moved.abs_diff_eq(Vec3::from_array(translation).as_dvec3(), 1e-9 * f64::from(distance)));
        }
    }
}

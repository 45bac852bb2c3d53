//! The scene loader on files built in code and on real ones: right where they are right, an error where they are not,
//! never a panic.

#[path = "../common/mod.rs"]
mod common;
mod damage;
mod distance;
mod geometry;
mod materials;

use common::{Folder, Gltf};
use glam::Vec3;
use lightprobe::scene::{AlphaMode, LoadOptions, Scene, SceneError, Texels, load};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;
use serde_json::{Value, json};

const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];

fn try_load(gltf: &Gltf) -> Result<Scene, SceneError> {
    let folder = Folder::new();
    let text = load(&folder.write("scene.gltf", gltf.text()), &LoadOptions::default());
    let binary = load(&folder.write("scene.glb", gltf.glb()), &LoadOptions::default());
    assert_eq!(text.is_ok(), binary.is_ok(), "the two containers differ: {text:?} {binary:?}");
    text.inspect(check)
}

fn loaded(gltf: &Gltf) -> Scene {
    try_load(gltf).expect("a valid scene")
}

fn error(gltf: &Gltf) -> String {
    let message = try_load(gltf).expect_err("an invalid scene").to_string();
    assert!(!message.contains('\n'), "{message}");
    assert!(message.contains("scene.gltf") && message.contains(';'), "no file or remedy: {message}");
    message
}

/// What every loaded scene promises.
fn check(scene: &Scene) {
    let mesh = &scene.mesh;
    let vertices = mesh.positions.len();
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
    assert!(mesh.normals.iter().all(|n| *n == Vec3::ZERO || (n.length() - 1.0).abs() < 1e-5));
    assert!(mesh.uvs.iter().all(|uvs| uvs.len() == vertices && uvs.iter().all(|uv| uv.is_finite())));
    assert!(mesh.normals.len() == vertices);
    assert!(mesh.colors.is_empty() || mesh.colors.len() == vertices);
    assert!(mesh.tangents.is_empty() || mesh.tangents.len() == vertices);
    assert!(mesh.colors.iter().chain(&mesh.tangents).all(|v| v.is_finite()));
    assert!(mesh.triangles.iter().flatten().all(|&index| (index as usize) < vertices));
    assert_eq!(mesh.triangles.len(), mesh.materials.len());
    assert!(!mesh.triangles.is_empty());
    for (number, material) in mesh.materials.iter().enumerate() {
        let opaque = scene.materials[material.0 as usize].alpha_mode == AlphaMode::Opaque;
        assert_eq!(opaque, number < mesh.opaque_count);
    }
    for m in &scene.materials {
        for slot in [m.base_color_texture, m.metallic_roughness_texture, m.emission_texture, m.normal_texture] {
            assert!(slot.is_none_or(|s| (s.texture.0 as usize) < scene.textures.len() && s.uv_set < 2));
        }
        assert!(m.base_color.is_finite() && m.emission.is_finite());
    }
    for texture in &scene.textures {
        let texels = texture.width as usize * texture.height as usize;
        assert!(texels > 0);
        assert_eq!(
            texels,
            match &texture.texels {
                Texels::Rgba8 { data, .. } => data.len(),
                Texels::Rgba32F(data) => data.len(),
            }
        );
    }
    assert!(scene.origin_world.is_finite());
    assert!(scene.cameras.iter().all(|c| c.position.is_finite() && c.world_from_camera.is_finite()));
    let names: std::collections::HashSet<_> = scene.cameras.iter().map(|c| &c.name).collect();
    assert_eq!(names.len(), scene.cameras.len());
    assert_eq!(scene.blake3.len(), 64);
    assert!(scene.warnings.iter().all(|w| !w.contains('\n')));
}

/// Geometric normal of a triangle, as its winding has it.
fn face_normal(scene: &Scene, triangle: usize) -> Vec3 {
    let [a, b, c] = scene.mesh.triangles[triangle].map(|v| scene.mesh.positions[v as usize]);
    (b - a).cross(c - a).normalize()
}

/// World positions of a triangle's corners.
fn corners(scene: &Scene, triangle: usize) -> [Vec3; 3] {
    let origin = scene.origin_world.as_vec3();
    scene.mesh.triangles[triangle].map(|v| scene.mesh.positions[v as usize] + origin)
}

/// A tetrahedron with corner normals that point outwards, its node set by `node`.
fn tetrahedron(node: Value) -> Gltf {
    let mut gltf = Gltf::new();
    let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let centre = Vec3::splat(0.25);
    let outwards: Vec<[f32; 3]> = p.iter().map(|p| ((Vec3::from_array(*p) - centre) * 7.0).to_array()).collect();
    let positions = gltf.vec3(&p);
    let normals = gltf.vec3(&outwards);
    let tangents = gltf.floats(&[1.0, 0.0, 0.0, 1.0].repeat(4), "VEC4");
    let indices = gltf.indices(&[0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "TANGENT": tangents });
    let mesh = gltf.push("meshes", json!({ "primitives": [{ "attributes": attributes, "indices": indices }] }));
    let mut node = node;
    node["mesh"] = json!(mesh);
    gltf.root(node);
    gltf
}

/// A copy with a few bytes changed or its end cut off.
fn damage(bytes: &[u8], rng: &mut Pcg32) -> Vec<u8> {
    let mut copy = bytes.to_vec();
    for _ in 0..1 + rng.next_u32() % 4 {
        let at = rng.next_u32() as usize % copy.len();
        copy[at] = match rng.next_u32() % 3 {
            0 => rng.next_u32() as u8,
            1 => copy[at] ^ (1 << (rng.next_u32() % 8)),
            _ => b"0123456789-\"[]{},"[rng.next_u32() as usize % 17],
        };
    }
    if rng.next_u32().is_multiple_of(4) {
        copy.truncate(rng.next_u32() as usize % copy.len());
    }
    copy
}

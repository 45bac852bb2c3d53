//! The scene loader on files built in code and on real ones: right where they are right, an error where they are not,
//! never a panic.

#[path = "../common/mod.rs"]
mod common;
mod damage;
mod distance;
mod geometry;
mod lights;
mod looked_at;
mod materials;
mod promises;
mod skies;

use common::{Folder, Gltf};
use glam::Vec3;
use lightprobe::scene::{LoadOptions, Scene, SceneError, load};
use promises::{check, damage};
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

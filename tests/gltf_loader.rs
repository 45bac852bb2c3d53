//! The scene loader on files built in code and on real ones: right where they are right, an error where they are not,
//! never a panic.

mod common;

use std::f32::consts::{FRAC_1_SQRT_2, FRAC_PI_2};
use std::path::{Path, PathBuf};

use common::{Folder, Gltf, I8, I16, U8, U16, shared_scenes};
use glam::{Vec2, Vec3, Vec4};
use lightprobe::scene::{
    AlphaMode, Environment, EnvironmentSource, LightKind, LoadOptions, Scene, SceneError, Texels, load,
};
use proptest::prelude::*;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::SeedableRng;
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

#[test]
fn normals_and_winding_point_outwards_under_any_transform() {
    let nodes = [
        json!({}),
        json!({ "scale": [3.0, 0.1, 1.0], "rotation": [0.0, 0.6, 0.0, 0.8], "translation": [1.0, 2.0, 3.0] }),
        json!({ "scale": [-1.0, 1.0, 1.0] }),
        json!({ "scale": [-2.0, -0.5, -1.0], "rotation": [0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2] }),
        json!({ "matrix": [0, 1, 0, 0, 1, 0, 0, 0, 0, 0.5, 1, 0, 9, 8, 7, 1] }),
        json!({ "scale": [1e-6, 1e-6, -1e-6] }),
    ];
    for node in nodes {
        let scene = loaded(&tetrahedron(node.clone()));
        let middle = scene.mesh.positions.iter().sum::<Vec3>() / 4.0;
        for (triangle, corners) in scene.mesh.triangles.iter().enumerate() {
            let face = corners.iter().map(|&v| scene.mesh.positions[v as usize]).sum::<Vec3>() / 3.0;
            assert!(
                face_normal(&scene, triangle).dot(face - middle) > 0.0,
                "{node}: triangle {triangle} is inside out"
            );
        }
        for (position, normal) in scene.mesh.positions.iter().zip(&scene.mesh.normals) {
            assert!(normal.dot(*position - middle) > 0.0, "{node}: normal points inwards");
        }
    }
}

#[test]
fn normals_take_the_inverse_transpose() {
    // The plane x + y = 1, stretched twofold along x, is x/2 + y = 1.
    let mut gltf = Gltf::of_triangles(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0]]);
    let normals = gltf.vec3(&[[1.0, 1.0, 0.0]; 3]);
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    gltf.json["nodes"][0]["scale"] = json!([2.0, 1.0, 1.0]);
    let scene = loaded(&gltf);
    assert!(scene.mesh.normals[0].abs_diff_eq(Vec3::new(0.5, 1.0, 0.0).normalize(), 1e-6));
    assert!(scene.mesh.normals[0].dot(face_normal(&scene, 0)).abs() > 0.999_999);
}

#[test]
fn mirroring_turns_the_tangent_frame() {
    let scene = loaded(&tetrahedron(json!({ "scale": [1.0, 1.0, -1.0] })));
    assert_eq!(scene.mesh.tangents[0], Vec4::new(1.0, 0.0, 0.0, -1.0));
}

#[test]
fn flattening_scales_are_legal() {
    let scene = loaded(&tetrahedron(json!({ "scale": [1.0, 0.0, 1.0] })));
    // Two faces become lines, the two others coincide.
    assert_eq!((scene.mesh.triangles.len(), scene.dropped.zero_area), (2, 2));
    assert!(matches!(try_load(&tetrahedron(json!({ "scale": [0.0, 0.0, 0.0] }))), Err(SceneError::Empty { .. })));
}

#[test]
fn strips_and_fans() {
    let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    for (mode, order) in [(5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])] {
        let mut gltf = Gltf::of_triangles(&order.map(|i: usize| square[i]));
        gltf.json["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        let scene = loaded(&gltf);
        assert_eq!(scene.mesh.triangles.len(), 2);
        for triangle in 0..2 {
            assert_eq!(face_normal(&scene, triangle), Vec3::Z, "mode {mode}");
        }
    }
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    gltf.json["meshes"][0]["primitives"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "attributes": { "POSITION": 0 }, "mode": 1 }));
    assert!(loaded(&gltf).warnings.iter().any(|w| w.contains("points or lines")));
    gltf.json["meshes"][0]["primitives"][0]["mode"] = json!(0);
    assert!(matches!(try_load(&gltf), Err(SceneError::Empty { .. })));
}

#[test]
fn sparse_accessors_replace_elements() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    let indices = gltf.view(&[1]);
    let values: Vec<u8> = [4.0f32, 0.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let values = gltf.view(&values);
    gltf.json["accessors"][0]["sparse"] = json!({
        "count": 1, "indices": { "bufferView": indices, "componentType": U8 }, "values": { "bufferView": values }
    });
    assert_eq!(corners(&loaded(&gltf), 0)[1], Vec3::new(4.0, 0.0, 0.0));
    // Without a buffer view the rest is zero: two corners coincide.
    let mut zeros = gltf;
    zeros.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert!(matches!(try_load(&zeros), Err(SceneError::Empty { .. })));
    zeros.json["accessors"][0]["sparse"]["count"] = json!(2);
    assert!(error(&zeros).contains("accessor 0 sparse"));
}

#[test]
fn quantised_attributes() {
    let mut gltf = Gltf::new();
    // i16 positions, 8 bytes apart; normalised i8 normals, 4 apart; u16 coordinates not normalised, with an offset.
    let shorts: Vec<u8> = [0i16, 0, 0, 9, 100, 0, 0, 9, 0, -100, 0, 9].iter().flat_map(|v| v.to_le_bytes()).collect();
    let positions = gltf.accessor(&shorts, I16, "VEC3", 3);
    gltf.json["bufferViews"][0]["byteStride"] = json!(8);
    let normals = gltf.accessor(&[0, 0, 0x81, 9].repeat(3), I8, "VEC3", 3);
    gltf.json["bufferViews"][1]["byteStride"] = json!(4);
    gltf.json["accessors"][normals]["normalized"] = json!(true);
    let uvs: Vec<u8> = [9u16, 9, 1, 2, 3, 4, 5, 6].iter().flat_map(|v| v.to_le_bytes()).collect();
    let uvs = gltf.accessor(&uvs, U16, "VEC2", 3);
    gltf.json["accessors"][uvs]["byteOffset"] = json!(4);
    let colors = gltf.accessor(&[255, 0, 51, 255, 0, 51, 255, 0, 51], U8, "VEC3", 3);
    let attributes = json!({ "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs, "COLOR_0": colors });
    let mesh = gltf.push("meshes", json!({ "primitives": [{ "attributes": attributes }] }));
    gltf.root(json!({ "mesh": mesh, "scale": [0.01, 0.01, 0.01] }));
    gltf.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let scene = loaded(&gltf);
    let expected = [Vec3::ZERO, Vec3::X, Vec3::NEG_Y];
    for (corner, expected) in corners(&scene, 0).iter().zip(expected) {
        assert!(corner.abs_diff_eq(expected, 1e-6), "{corner}");
    }
    assert_eq!(scene.mesh.normals, [Vec3::NEG_Z; 3]);
    assert_eq!(scene.mesh.uvs[0], [Vec2::new(1.0, 2.0), Vec2::new(3.0, 4.0), Vec2::new(5.0, 6.0)]);
    assert_eq!(scene.mesh.colors, [Vec4::new(1.0, 0.0, 0.2, 1.0); 3]);
}

#[test]
fn gpu_instances_are_written_out() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    let translations = gltf.vec3(&[[0.0; 3], [10.0, 0.0, 0.0]]);
    let rotations = gltf.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0], "VEC4");
    let scales = gltf.vec3(&[[1.0; 3], [2.0, 2.0, -2.0]]);
    let attributes = json!({ "TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales });
    gltf.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    gltf.json["nodes"][0]["translation"] = json!([0.0, 0.0, 5.0]);
    gltf.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = loaded(&gltf);
    assert_eq!(scene.mesh.triangles.len(), 2);
    assert_eq!(corners(&scene, 0), TRIANGLE.map(|p| Vec3::from_array(p) + Vec3::new(0.0, 0.0, 5.0)));
    // Half a turn about z, doubled, mirrored: winding swapped.
    let expected = [Vec3::new(10.0, 0.0, 5.0), Vec3::new(10.0, -4.0, 5.0), Vec3::new(6.0, 0.0, 5.0)];
    for (corner, expected) in corners(&scene, 1).iter().zip(expected) {
        assert!(corner.abs_diff_eq(expected, 1e-5), "{corner} is not {expected}");
    }
    gltf.json["accessors"][scales]["count"] = json!(1);
    assert!(error(&gltf).contains("node 0: EXT_mesh_gpu_instancing SCALE accessor"));
}

#[test]
fn instances_cannot_ask_for_more_than_memory() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE.repeat(4000));
    let translations = gltf.vec3(&vec![[1.0; 3]; 4000]);
    let attributes = json!({ "TRANSLATION": translations });
    gltf.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    assert!(matches!(try_load(&gltf), Err(SceneError::TooLarge { .. })));
}

#[test]
fn texture_transforms_and_materials() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    let (folder, png) = (Folder::new(), png(2, 1, &[[255, 0, 0, 255], [0, 255, 0, 255]]));
    folder.write("a b.png", &png);
    gltf.push("images", json!({ "uri": "a%20b.png" }));
    gltf.push("samplers", json!({ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 }));
    gltf.push("textures", json!({ "source": 0, "sampler": 0 }));
    let transform = json!({ "KHR_texture_transform": {
        "offset": [0.25, 0.5], "rotation": FRAC_PI_2, "scale": [2.0, 3.0], "texCoord": 1 } });
    gltf.push("materials", json!({
        "name": "m", "doubleSided": true, "emissiveFactor": [1.0, 0.5, 0.0],
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "extensions": transform }, "metallicFactor": 0.25 },
        "normalTexture": { "index": 0, "scale": 0.5, "extensions": transform },
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 8.0 }, "KHR_materials_unlit": {} }
    }));
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    gltf.json["extensionsRequired"] = json!(["KHR_texture_transform", "KHR_materials_unlit"]);
    let path = folder.write("scene.gltf", gltf.text());
    let scene = load(&path, &LoadOptions::default()).expect("a valid scene");
    check(&scene);
    let material = &scene.materials[0];
    assert_eq!((material.metallic, material.roughness, material.normal_scale), (0.25, 1.0, 0.5));
    assert_eq!(material.emission, Vec3::new(8.0, 4.0, 0.0));
    assert!(material.unlit && material.double_sided);
    let slot = material.base_color_texture.expect("a texture");
    assert_eq!(slot.uv_set, 1);
    // Scaled to (2, 0), turned a quarter to (0, −2), moved.
    assert!(slot.transform(Vec2::X).abs_diff_eq(Vec2::new(0.25, -1.5), 1e-6));
    assert!(slot.transform(Vec2::Y).abs_diff_eq(Vec2::new(3.25, 0.5), 1e-6));
    assert_eq!(material.normal_texture.expect("a texture").texture_from_uv, slot.texture_from_uv);
    // One image, as colour and as data.
    assert_eq!(scene.textures.len(), 2);
    assert!(matches!(&scene.textures[0].texels, Texels::Rgba8 { srgb: true, data } if data[1] == [0, 255, 0, 255]));
    assert!(matches!(&scene.textures[1].texels, Texels::Rgba8 { srgb: false, .. }));
    assert!(scene.textures[0].nearest);

    // The image's bytes are in the hash.
    folder.write("a b.png", self::png(2, 1, &[[254, 0, 0, 255], [0, 255, 0, 255]]));
    assert_ne!(load(&path, &LoadOptions::default()).expect("a valid scene").blake3, scene.blake3);
    std::fs::remove_file(folder.path().join("a b.png")).expect("the image");
    let message = load(&path, &LoadOptions::default()).expect_err("no image").to_string();
    assert!(message.contains("a b.png") && message.contains("material 0 'm' baseColorTexture"), "{message}");
}

fn png(width: u32, height: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let image = image::RgbaImage::from_raw(width, height, pixels.as_flattened().to_vec()).expect("that many pixels");
    image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).expect("a PNG");
    bytes
}

/// A triangle whose material has this alpha mode, factor and texture alpha.
fn with_alpha(mode: &str, factor: f32, texel_alpha: [u8; 2]) -> Scene {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    let view = gltf.view(&png(2, 1, &texel_alpha.map(|a| [10, 10, 10, a])));
    gltf.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    gltf.push("textures", json!({ "source": 0 }));
    gltf.push(
        "materials",
        json!({ "alphaMode": mode, "pbrMetallicRoughness": {
        "baseColorFactor": [1.0, 1.0, 1.0, factor], "baseColorTexture": { "index": 0 } } }),
    );
    let positions = json!({ "POSITION": 0 });
    gltf.json["meshes"][0]["primitives"] =
        json!([{ "attributes": positions, "material": 0 }, { "attributes": positions }]);
    loaded(&gltf)
}

#[test]
fn alpha_that_cannot_matter_is_opaque() {
    for (mode, factor, texels, expected) in [
        ("BLEND", 1.0, [255, 255], AlphaMode::Opaque),
        ("BLEND", 1.0, [255, 254], AlphaMode::Blend),
        ("BLEND", 0.9, [255, 255], AlphaMode::Blend),
        ("MASK", 0.9, [255, 255], AlphaMode::Opaque),
        ("MASK", 0.9, [255, 120], AlphaMode::Mask { cutoff: 0.5 }),
        ("OPAQUE", 0.1, [0, 0], AlphaMode::Opaque),
    ] {
        let scene = with_alpha(mode, factor, texels);
        let textured = scene.materials.iter().find(|m| m.base_color_texture.is_some()).expect("the material");
        assert_eq!(textured.alpha_mode, expected, "{mode} {factor} {texels:?}");
        assert_eq!(scene.mesh.opaque_count, if expected == AlphaMode::Opaque { 2 } else { 1 });
        assert_eq!(scene.textures[0].width, if texels[0] == texels[1] { 1 } else { 2 });
    }
}

#[test]
fn lights_and_cameras() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    gltf.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "spot", "color": [1.0, 0.5, 0.0], "intensity": 4.0, "range": 7.0,
          "spot": { "innerConeAngle": 0.2, "outerConeAngle": 0.6 } },
        { "type": "spot", "spot": {} },
        { "type": "point", "intensity": 1e9 },
        { "type": "directional", "intensity": 1e-9 }
    ] } });
    gltf.json["extensionsRequired"] = json!(["KHR_lights_punctual"]);
    // Turned to look along −X and scaled, which must not matter.
    let turned = json!([0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2]);
    for light in 0..4 {
        gltf.root(json!({ "rotation": turned, "scale": [3.0, 3.0, 3.0], "translation": [1.0, 2.0, 3.0],
            "extensions": { "KHR_lights_punctual": { "light": light } } }));
    }
    gltf.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }));
    gltf.push(
        "cameras",
        json!({ "type": "orthographic",
        "orthographic": { "xmag": 2.0, "ymag": 3.0, "znear": 0.1, "zfar": 9.0 } }),
    );
    for camera in [0, 0, 1] {
        gltf.root(json!({ "name": "eye", "camera": camera, "rotation": turned, "translation": [1.0, 2.0, 3.0] }));
    }
    let scene = loaded(&gltf);
    let at = Vec3::new(1.0, 2.0, 3.0) - scene.origin_world.as_vec3();
    assert_eq!(scene.lights[0].intensity, Vec3::new(4.0, 2.0, 0.0));
    let LightKind::Spot { position, direction, range_m, inner_cone_rad, outer_cone_rad } = scene.lights[0].kind else {
        panic!("not a spot light: {:?}", scene.lights[0]);
    };
    assert_eq!((position, range_m, inner_cone_rad, outer_cone_rad), (at, 7.0, 0.2, 0.6));
    assert!(direction.abs_diff_eq(Vec3::NEG_X, 1e-6));
    assert!(
        matches!(scene.lights[1].kind, LightKind::Spot { range_m: f32::INFINITY, inner_cone_rad: 0.0, outer_cone_rad, .. }
        if outer_cone_rad == std::f32::consts::FRAC_PI_4)
    );
    assert!(matches!(scene.lights[2].kind, LightKind::Point { range_m: f32::INFINITY, .. }));
    assert!(
        matches!(scene.lights[3].kind, LightKind::Directional { direction } if direction.abs_diff_eq(Vec3::NEG_X, 1e-6))
    );
    let names: Vec<_> = scene.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["eye", "eye#2", "eye#3"]);
    assert!((-scene.cameras[0].world_from_camera.z_axis).abs_diff_eq(Vec3::NEG_X, 1e-6));
    assert_eq!(scene.cameras[2].projection, lightprobe::scene::camera::Projection::Orthographic { half_height_m: 3.0 });
}

#[test]
fn broken_trees_are_errors() {
    let with_nodes = |nodes: Value, roots: Value| {
        let mut gltf = Gltf::of_triangles(&TRIANGLE);
        gltf.json["nodes"] = nodes;
        gltf.json["scenes"] = json!([{ "nodes": roots }]);
        error(&gltf)
    };
    assert!(with_nodes(json!([{ "children": [1] }, { "children": [0], "mesh": 0 }]), json!([0])).contains("ancestor"));
    assert!(with_nodes(json!([{ "children": [0], "mesh": 0 }]), json!([0])).contains("ancestor"));
    assert!(
        with_nodes(json!([{ "children": [2] }, { "children": [2] }, { "mesh": 0 }]), json!([0, 1])).contains("parent")
    );
    assert!(with_nodes(json!([{ "children": [7], "mesh": 0 }]), json!([0])).contains("does not exist"));
    assert!(with_nodes(json!([{ "mesh": 0 }]), json!([3])).contains("does not exist"));
    assert!(with_nodes(json!([{ "mesh": 5 }]), json!([0])).contains("node 0: refers to mesh 5"));
}

#[test]
fn deep_trees_do_not_overflow_the_stack() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    let depth = 100_000;
    let chain = (0..depth).map(|i| json!({ "children": [i + 1], "translation": [1.0, 0.0, 0.0] }));
    gltf.json["nodes"] = chain.chain([json!({ "mesh": 0 })]).collect();
    assert_eq!(loaded(&gltf).origin_world.x, f64::from(depth) + 1.0);
}

#[test]
fn no_scene_means_all_roots() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    gltf.push("nodes", json!({ "children": [0], "translation": [0.0, 0.0, 4.0] }));
    gltf.json.as_object_mut().unwrap().remove("scenes");
    gltf.json.as_object_mut().unwrap().remove("scene");
    let scene = loaded(&gltf);
    assert_eq!((scene.mesh.triangles.len(), scene.origin_world.z), (1, 4.0));
    gltf.json["scene"] = json!(3);
    assert!(error(&gltf).contains("scene 3"));
}

#[test]
fn marked_nodes_are_left_out_with_their_children() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    let child = gltf.push("nodes", json!({ "mesh": 0 }));
    gltf.root(json!({ "mesh": 0, "children": [child], "extras": { "lightprobe": "ignore" } }));
    assert_eq!(loaded(&gltf).mesh.triangles.len(), 1);
    gltf.json["nodes"][0]["extras"] = json!({ "lightprobe": "ignore" });
    assert!(matches!(try_load(&gltf), Err(SceneError::Empty { .. })));
    gltf.json["nodes"][0]["extras"] = json!({ "lightprobe": ["else"] });
    assert_eq!(loaded(&gltf).mesh.triangles.len(), 1);
}

#[test]
fn damaged_data_names_its_place() {
    let of = |edit: fn(&mut Gltf)| {
        let mut gltf = tetrahedron(json!({}));
        gltf.json["meshes"][0]["name"] = json!("Wall\n");
        edit(&mut gltf);
        error(&gltf)
    };
    let place = "mesh 0 'Wall\\n' primitive 0: POSITION accessor 0";
    assert!(of(|g| g.json["accessors"][0]["count"] = json!(5)).contains(place));
    assert!(of(|g| g.json["accessors"][0]["count"] = json!(u64::MAX)).contains(place));
    assert!(of(|g| g.json["accessors"][0]["byteOffset"] = json!(u64::MAX)).contains(place));
    assert!(of(|g| g.json["bufferViews"][0]["byteLength"] = json!(u64::MAX)).contains(place));
    assert!(of(|g| g.json["bufferViews"][0]["byteStride"] = json!(4)).contains("byteStride"));
    assert!(of(|g| g.json["accessors"][1]["count"] = json!(3)).contains("POSITION has 4"));
    assert!(of(|g| g.json["accessors"][0]["type"] = json!("VEC2")).contains(place));
    assert!(of(|g| g.json["accessors"][0]["type"] = json!("VEC9")).contains(place));
    assert!(of(|g| g.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(99)).contains("accessor 99"));
    assert!(of(|g| g.json["meshes"][0]["primitives"][0]["material"] = json!(99)).contains("material 99"));
    assert!(of(|g| g.json["accessors"][3]["count"] = json!(13)).contains("indices accessor 3"));
    assert!(of(|g| g.json["meshes"][0]["primitives"][0]["indices"] = json!(0)).contains("components"));
    assert!(of(|g| g.bin.truncate(100)).contains("buffer view"));
    assert!(of(|g| *g.bin.last_mut().unwrap() = 1).contains("index 259"));
    // No data, no sparse: zeros, but not more of them than the file has bytes.
    let bare = |g: &mut Gltf, count: u64| {
        g.json["accessors"][0] = json!({ "componentType": 5126, "type": "VEC3", "count": count });
    };
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    bare(&mut gltf, 1 << 40);
    assert!(error(&gltf).contains("without data"));
    bare(&mut gltf, 3);
    assert!(matches!(try_load(&gltf), Err(SceneError::Empty { .. })));
}

#[test]
fn unread_extensions_name_the_way_out() {
    for (extension, remedy) in [
        ("KHR_draco_mesh_compression", "gltf-transform"),
        ("EXT_meshopt_compression", "gltfpack"),
        ("KHR_texture_basisu", "ktxdecompress"),
        ("EXT_texture_webp", "gltf-transform png"),
        ("VENDOR_unheard_of", "without it"),
    ] {
        let mut gltf = Gltf::of_triangles(&TRIANGLE);
        gltf.json["extensionsUsed"] = json!([extension]);
        assert_eq!(loaded(&gltf).mesh.triangles.len(), 1);
        gltf.json["extensionsRequired"] = json!([extension]);
        let message = error(&gltf);
        assert!(message.contains(extension) && message.contains(remedy), "{message}");
    }
    // Not required, but without a fallback.
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    gltf.push("images", json!({ "uri": "a.ktx2" }));
    gltf.push("textures", json!({ "extensions": { "KHR_texture_basisu": { "source": 0 } } }));
    gltf.push("materials", json!({ "emissiveTexture": { "index": 0 }, "emissiveFactor": [1, 1, 1] }));
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    assert!(error(&gltf).contains("KHR_texture_basisu"));
    // A texture on a factor of zero is never read.
    gltf.json["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
    assert!(loaded(&gltf).textures.is_empty());
}

#[test]
fn degenerate_triangles_are_dropped_and_counted() {
    let bad = [
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [f32::NAN, 1.0, 0.0]],
        [[f32::INFINITY, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
        [[1.0, 1.0, 0.0]; 3],
        [[0.0, 0.0, 0.0], [1e30, 0.0, 0.0], [0.0, 1e30, 0.0]],
    ];
    let gltf = Gltf::of_triangles(&[&TRIANGLE[..], bad.as_flattened()].concat());
    let scene = loaded(&gltf);
    assert_eq!((scene.mesh.triangles.len(), scene.mesh.positions.len()), (1, 3));
    assert_eq!((scene.dropped.non_finite, scene.dropped.zero_area), (3, 2));
    assert!(scene.warnings.iter().any(|w| w.contains("5 triangles are dropped")));
}

#[test]
fn skins_take_the_bind_pose_of_their_joints() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    let joints = gltf.accessor(&[0, 1, 0, 0].repeat(3), U8, "VEC4", 3);
    let weights = gltf.accessor(&[255, 0, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0], U8, "VEC4", 3);
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let mut moved_back = identity;
    moved_back[13] = -1.0;
    let binds = gltf.floats(&[identity, moved_back].concat(), "MAT4");
    let attributes = &mut gltf.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    // The mesh node's own transform does not count.
    gltf.json["nodes"][0] = json!({ "mesh": 0, "skin": 0, "translation": [1e3, 0, 0] });
    let tip = gltf.push("nodes", json!({ "translation": [0.0, 1.0, 0.0] }));
    let base = gltf.root(json!({ "translation": [0.0, 0.0, 3.0], "children": [tip] }));
    gltf.push("skins", json!({ "joints": [base, tip], "inverseBindMatrices": binds }));
    let scene = loaded(&gltf);
    assert_eq!(corners(&scene, 0), TRIANGLE.map(|p| Vec3::from_array(p) + Vec3::new(0.0, 0.0, 3.0)));
    assert!(scene.warnings.iter().any(|w| w.contains("skinned")));
    gltf.json["skins"][0]["joints"] = json!([base]);
    gltf.json["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    assert!(error(&gltf).contains("JOINTS_0 refers to joint 1"));
}

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
fn tree(rng: &mut Pcg32, size: f32) -> Gltf {
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

#[test]
fn environments() {
    let folder = Folder::new();
    let scene = folder.write("scene.glb", Gltf::of_triangles(&TRIANGLE).glb());
    let with =
        |source: EnvironmentSource| load(&scene, &LoadOptions { environment: Some(source), ..Default::default() });
    let constant = with(EnvironmentSource::Constant(Vec3::ONE)).expect("a constant");
    assert!(matches!(constant.environment, Environment::Constant(c) if c == Vec3::ONE));
    assert!(with(EnvironmentSource::Constant(Vec3::NEG_X)).is_err());
    let hashes = [with(EnvironmentSource::Constant(Vec3::ZERO)).expect("black").blake3, constant.blake3];
    assert_ne!(hashes[0], hashes[1]);

    let texel = |x: usize, y: usize| if (x, y) == (3, 1) { (f32::NAN, 1.0, -1.0) } else { (x as f32, y as f32, 0.5) };
    let exr = folder.path().join("sky.exr");
    exr::prelude::write_rgb_file(&exr, 4, 2, texel).expect("an EXR file");
    let loaded = with(EnvironmentSource::File(exr.clone())).expect("a map");
    let Environment::Map(map) = &loaded.environment else { panic!("not a map") };
    assert_eq!((map.width, map.height), (4, 2));
    assert_eq!(
        (map.texels[1], map.texels[6], map.texels[7]),
        (Vec3::new(1.0, 0.0, 0.5), Vec3::new(2.0, 1.0, 0.5), Vec3::ZERO)
    );
    assert!(loaded.warnings.iter().any(|w| w.contains("1 texels")));

    let hdr = folder.path().join("sky.hdr");
    let pixels: Vec<_> = (0..8).map(|i| image::Rgb([i as f32, 0.5, 2.0])).collect();
    let file = std::fs::File::create(&hdr).expect("a file");
    image::codecs::hdr::HdrEncoder::new(file).encode(&pixels, 4, 2).expect("an HDR file");
    let loaded = with(EnvironmentSource::File(hdr.clone())).expect("a map");
    let Environment::Map(map) = &loaded.environment else { panic!("not a map") };
    assert!(map.texels[5].abs_diff_eq(Vec3::new(5.0, 0.5, 2.0), 0.05));

    // Damage anywhere is an error or a picture.
    let mut rng = Pcg32::seed_from_u64(1);
    for original in [exr, hdr] {
        let bytes = std::fs::read(&original).expect("a file");
        for _ in 0..150 {
            let damaged = folder.write("damaged.bin", damage(&bytes, &mut rng));
            if let Err(e) = with(EnvironmentSource::File(damaged)) {
                assert!(!e.to_string().contains('\n'), "{e}");
            }
        }
    }
    assert!(with(EnvironmentSource::File(folder.path().join("none.exr"))).is_err());
    assert!(with(EnvironmentSource::File(folder.path().to_owned())).is_err());
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

#[test]
fn damaged_files_never_panic() {
    let folder = Folder::new();
    let mut rng = Pcg32::seed_from_u64(7);
    let mut seeds = vec![tetrahedron(json!({})).glb(), tree(&mut rng, 1.0).glb()];
    if let Some(scenes) = shared_scenes() {
        let names = [
            "lights_punctual/simple-instancing.glb",
            "cornell_hwrt/cornell_box.glb",
            "adversarial/simple_skin/simple_skin.gltf",
            "lights_punctual/Lights.glb",
            "adversarial/BoxTextured-glTF-Binary/BoxTextured.glb",
        ];
        seeds.extend(names.iter().map(|name| std::fs::read(scenes.join(name)).expect("a shared scene")));
    }
    let mut ok = 0;
    for seed in &seeds {
        for _ in 0..200 {
            match load(&folder.write("damaged.glb", damage(seed, &mut rng)), &LoadOptions::default()) {
                Ok(scene) => {
                    check(&scene);
                    ok += 1;
                }
                Err(e) => assert!(!e.to_string().contains('\n'), "{e}"),
            }
        }
    }
    assert!(ok > 0, "every damaged file is refused: the damage is not subtle enough to test anything");
}

fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> =
        std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files_below(&path, found);
        } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
            found.push(path);
        }
    }
}

#[test]
fn shared_scenes_load_or_are_refused() {
    let Some(scenes) = shared_scenes() else { return };
    let mut files = Vec::new();
    files_below(&scenes, &mut files);
    assert!(files.len() > 40);
    for path in files {
        let relative = path.strip_prefix(&scenes).expect("below").display().to_string();
        match load(&path, &LoadOptions::default()) {
            Ok(scene) => {
                check(&scene);
                eprintln!("ok    {relative}: {} triangles, {:?}", scene.mesh.triangles.len(), scene.warnings);
            }
            Err(e) => {
                assert!(relative.starts_with("adversarial"), "{relative}: {e}");
                assert!(!e.to_string().contains('\n'), "{e}");
                eprintln!("error {relative}: {e}");
            }
        }
    }
}

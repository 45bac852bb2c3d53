//! Shapes: transforms, topologies, accessor encodings, instances, skins.

use std::f32::consts::FRAC_1_SQRT_2;

use glam::{Vec2, Vec3, Vec4};
use lightprobe::scene::SceneError;
use serde_json::json;

use crate::common::{Gltf, I8, I16, U8, U16};
use crate::{TRIANGLE, corners, error, face_normal, loaded, tetrahedron, try_load};

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

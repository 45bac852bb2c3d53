//! Files that are wrong, damaged or hostile.

use lightprobe::scene::SceneError;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::SeedableRng;
use serde_json::{Value, json};

use crate::common::Gltf;
use crate::distance::tree;
use crate::promises::assert_damage_is_survived;
use crate::{TRIANGLE, error, loaded, tetrahedron, try_load};

#[test]
fn instances_cannot_ask_for_more_than_memory() {
    let mut gltf = Gltf::of_triangles(&TRIANGLE.repeat(4000));
    let translations = gltf.vec3(&vec![[1.0; 3]; 4000]);
    let attributes = json!({ "TRANSLATION": translations });
    gltf.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    assert!(matches!(try_load(&gltf), Err(SceneError::TooLarge { .. })));
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
        ("EXT_lights_image_based", "--env"),
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
fn extensions_that_nobody_sees_may_be_required() {
    for extension in [
        "KHR_interactivity",
        "KHR_physics_rigid_bodies",
        "KHR_implicit_shapes",
        "KHR_node_hoverability",
        "KHR_node_selectability",
        "OMI_physics_body",
        "KHR_audio_emitter",
        "KHR_xmp_json_ld",
    ] {
        let mut gltf = Gltf::of_triangles(&TRIANGLE);
        let silent = loaded(&gltf).warnings;
        gltf.json["extensionsRequired"] = json!([extension]);
        gltf.json["nodes"][0]["extensions"] = json!({ extension: { "hoverable": false, "shape": 99 } });
        assert_eq!(loaded(&gltf).warnings, silent, "{extension}");
    }
    // What is seen is not ignored: a hidden node, and a sky.
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    gltf.root(json!({ "mesh": 0, "extensions": { "KHR_node_visibility": { "visible": false } } }));
    gltf.json["extensionsRequired"] = json!(["KHR_node_visibility"]);
    assert_eq!(loaded(&gltf).mesh.triangles.len(), 1);
    gltf.json["extensionsRequired"] = json!(["OMI_environment_sky"]);
    assert!(error(&gltf).contains("OMI_environment_sky"));
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
fn damaged_files_never_panic() {
    let mut rng = Pcg32::seed_from_u64(7);
    let seeds = [tetrahedron(json!({})).glb(), tree(&mut rng, 1.0).glb()];
    assert_damage_is_survived(&seeds, &mut rng);
}

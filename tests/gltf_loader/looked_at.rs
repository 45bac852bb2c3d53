//! What of materials is read: textures that a command looks at, coordinates that they want, meshes without a material.

use lightprobe::scene::{AlphaMode, Detail, LoadOptions, Scene, SceneError, Unassigned, load};
use serde_json::{Value, json};

use crate::common::{Folder, Gltf};
use crate::materials::png;
use crate::promises::check;
use crate::{TRIANGLE, error, loaded, try_load};

/// Loads a scene as a command does that looks at this much.
fn with_detail(gltf: &Gltf, detail: Detail) -> Result<Scene, SceneError> {
    let folder = Folder::new();
    load(&folder.write("scene.gltf", gltf.text()), &LoadOptions { detail, ..Default::default() }).inspect(check)
}

/// A triangle with this material. Texture 0 is a good one, texture 1 has no image.
fn with_material(material: Value) -> Gltf {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    let view = gltf.view(&png(2, 1, &[[10, 20, 30, 255], [200, 100, 50, 255]]));
    gltf.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    gltf.push("textures", json!({ "source": 0 }));
    gltf.push("textures", json!({}));
    gltf.push("materials", material);
    let uvs = gltf.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC2");
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uvs);
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    gltf
}

const DETAILS: [Detail; 3] = [Detail::LIGHT, Detail::PICTURE, Detail::GLOSSY];

/// Whether the material stops a bake, a picture and a glossy picture.
fn stops(material: Value) -> [bool; 3] {
    let gltf = with_material(material);
    DETAILS.map(|detail| match with_detail(&gltf, detail) {
        Ok(_) => false,
        Err(e) => {
            assert!(e.to_string().contains("material 0") || e.to_string().contains("materials[0]"), "{e}");
            true
        }
    })
}

#[test]
fn a_texture_stops_only_who_looks_at_it() {
    // The material, and whether it stops a bake, a picture, a glossy picture.
    let (none, pictures, gloss, all) = ([false; 3], [false, true, true], [false, false, true], [true; 3]);
    let bad = json!({ "index": 1 });
    for (material, expected) in [
        (json!({ "normalTexture": { "index": 1 } }), pictures),
        (json!({ "normalTexture": { "index": 0, "texCoord": 2 } }), pictures),
        (json!({ "normalTexture": { "index": 99 } }), pictures),
        (json!({ "normalTexture": "no object" }), pictures),
        (json!({ "occlusionTexture": { "index": 1, "texCoord": 7 } }), none),
        (json!({ "occlusionTexture": 5 }), none),
        (json!({ "emissiveTexture": bad }), none),
        (json!({ "emissiveTexture": 3 }), none),
        (json!({ "emissiveTexture": bad, "emissiveFactor": [1, 0, 0] }), all),
        (
            json!({ "emissiveTexture": bad, "emissiveFactor": [1, 0, 0],
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 0.0 } } }),
            none,
        ),
        (
            json!({ "emissiveTexture": bad, "emissiveFactor": [1, 0, 0], "extensions": { "KHR_materials_unlit": {} } }),
            none,
        ),
        (json!({ "pbrMetallicRoughness": { "baseColorTexture": bad, "metallicFactor": 0.5 } }), all),
        // A metal's colour is seen in its gloss alone, unless a texture makes parts of it no metal.
        (json!({ "pbrMetallicRoughness": { "baseColorTexture": bad } }), gloss),
        (
            json!({ "pbrMetallicRoughness": { "baseColorTexture": bad, "metallicRoughnessTexture": { "index": 0 } } }),
            all,
        ),
        (json!({ "pbrMetallicRoughness": { "baseColorTexture": bad }, "alphaMode": "MASK" }), all),
        (json!({ "pbrMetallicRoughness": { "baseColorTexture": bad, "baseColorFactor": [0, 0, 0, 1] } }), none),
        (
            json!({ "pbrMetallicRoughness": { "baseColorTexture": bad }, "extensions": { "KHR_materials_unlit": {} } }),
            all,
        ),
        (json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": bad } }), all),
        (json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": bad, "metallicFactor": 0 } }), gloss),
        (
            json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": bad },
            "extensions": { "KHR_materials_unlit": {} } }),
            none,
        ),
        // Textures of extensions that are not modelled.
        (json!({ "extensions": { "KHR_materials_clearcoat": { "clearcoatTexture": bad } } }), none),
        (
            json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": { "specularGlossinessTexture": bad } } }),
            none,
        ),
        (json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": { "diffuseTexture": bad } } }), all),
        // It replaces the other parameters.
        (
            json!({ "pbrMetallicRoughness": { "baseColorTexture": bad },
            "extensions": { "KHR_materials_pbrSpecularGlossiness": {} } }),
            none,
        ),
    ] {
        assert_eq!(stops(material.clone()), expected, "{material}");
    }
}

#[test]
fn what_nobody_uses_stops_nothing() {
    let mut gltf = with_material(json!({}));
    gltf.push("materials", json!({ "normalTexture": {}, "alphaMode": "unheard of", "doubleSided": 3 }));
    gltf.push("textures", json!({ "sampler": "x" }));
    gltf.push("images", json!({ "bufferView": -1 }));
    gltf.push("samplers", json!([]));
    gltf.push("skins", json!({ "joints": "none" }));
    gltf.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": "wide" } }));
    loaded(&gltf);
    // A camera that is used is left out with a warning.
    gltf.root(json!({ "camera": 0 }));
    let scene = loaded(&gltf);
    assert!(scene.cameras.is_empty());
    assert!(scene.warnings.iter().any(|w| w.contains("cameras[0]")), "{:?}", scene.warnings);
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(1);
    assert!(error(&gltf).contains("materials[1]"));
    // Coordinates and tangents, likewise.
    let mut gltf = with_material(json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 0 },
        "metallicFactor": 0 } }));
    let attributes = &mut gltf.json["meshes"][0]["primitives"][0]["attributes"];
    (attributes["TEXCOORD_1"], attributes["TANGENT"]) = (json!(99), json!(99));
    with_detail(&gltf, Detail::LIGHT).expect("what a bake needs is there");
    assert!(error(&gltf).contains("TANGENT"));
    gltf.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(1);
    let message = with_detail(&gltf, Detail::LIGHT).expect_err("no such coordinates").to_string();
    assert!(message.contains("TEXCOORD_1"), "{message}");
}

#[test]
fn the_hash_is_that_of_the_light() {
    let folder = Folder::new();
    folder.write("color.png", png(1, 1, &[[10, 20, 30, 255]]));
    folder.write("normal.png", png(1, 1, &[[128, 128, 255, 255]]));
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    // The normal map's material comes first, so that reading it in the order of the file would change the hash.
    for (number, image) in ["normal.png", "color.png"].into_iter().enumerate() {
        gltf.push("images", json!({ "uri": image }));
        gltf.push("textures", json!({ "source": number }));
    }
    gltf.push("materials", json!({ "normalTexture": { "index": 0 } }));
    let base = json!({ "baseColorTexture": { "index": 1 }, "metallicFactor": 0 });
    gltf.push("materials", json!({ "pbrMetallicRoughness": base }));
    let positions = json!({ "POSITION": 0 });
    gltf.json["meshes"][0]["primitives"] =
        json!([{ "attributes": positions, "material": 0 }, { "attributes": positions, "material": 1 }]);
    let path = folder.write("scene.gltf", gltf.text());
    let scenes = || DETAILS.map(|detail| load(&path, &LoadOptions { detail, ..Default::default() }).expect("a scene"));
    let [light, picture, glossy] = scenes();
    assert_eq!((&light.blake3, &light.blake3), (&picture.blake3, &glossy.blake3));
    assert_eq!(light.textures.len() + 1, picture.textures.len());
    assert!(light.pictures_blake3.is_none() && picture.pictures_blake3.is_some());
    // Another normal map is another picture in the same light; another colour is another light.
    folder.write("normal.png", png(1, 1, &[[90, 128, 255, 255]]));
    let [again, bent, _] = scenes();
    assert_eq!(again.blake3, light.blake3);
    assert_ne!(bent.pictures_blake3, picture.pictures_blake3);
    folder.write("color.png", png(1, 1, &[[11, 20, 30, 255]]));
    assert_ne!(scenes()[0].blake3, light.blake3);
}

/// The warning about missing coordinates.
fn about_coordinates(scene: &Scene) -> Option<&str> {
    scene.warnings.iter().map(String::as_str).find(|w| w.contains("texture coordinates"))
}

#[test]
fn meshes_without_the_coordinates_that_they_want_are_named() {
    let base = |set: u32| json!({ "index": 0, "texCoord": set });
    let material = |set| json!({ "name": "Brick", "pbrMetallicRoughness": { "baseColorTexture": base(set), "metallicFactor": 0 } });
    assert_eq!(about_coordinates(&loaded(&with_material(material(0)))), None);
    let mut gltf = with_material(material(1));
    gltf.json["meshes"][0]["name"] = json!("Wall");
    let scene = loaded(&gltf);
    let warning = about_coordinates(&scene).expect("a warning");
    for word in ["1 mesh lacks", "mesh 0 'Wall'", "material 0 'Brick'", "baseColorTexture", "TEXCOORD_1"] {
        assert!(warning.contains(word), "no '{word}' in: {warning}");
    }
    // Only a texture that someone looks at and that varies wants coordinates.
    let normal = with_material(json!({ "normalTexture": base(1) }));
    assert_eq!(about_coordinates(&with_detail(&normal, Detail::LIGHT).expect("a scene")), None);
    assert!(about_coordinates(&with_detail(&normal, Detail::PICTURE).expect("a scene")).is_some());
    let mut constant = with_material(material(1));
    let view = constant.view(&png(2, 2, &[[7, 7, 7, 255]; 4]));
    constant.json["images"][0]["bufferView"] = json!(view);
    assert_eq!(about_coordinates(&loaded(&constant)), None);
    // Many are counted, and three named.
    for number in 1..200 {
        let mesh = gltf.json["meshes"][0].clone();
        gltf.push("meshes", mesh);
        gltf.root(json!({ "mesh": number }));
    }
    let scene = loaded(&gltf);
    let warning = about_coordinates(&scene).expect("a warning");
    assert!(warning.contains("200 meshes lack") && warning.contains("and 197 more"), "{warning}");
    assert!(warning.len() < 600, "{warning}");
}

#[test]
fn meshes_without_a_material_take_that_of_the_options() {
    let folder = Folder::new();
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    let with = |gltf: &Gltf, unassigned| {
        load(&folder.write("scene.glb", gltf.glb()), &LoadOptions { unassigned, ..Default::default() })
            .expect("a scene")
    };
    let scene = with(&gltf, Unassigned::Diffuse { albedo: 0.25 });
    let material = &scene.materials[0];
    assert_eq!(material.base_color.to_array(), [0.25, 0.25, 0.25, 1.0]);
    assert_eq!((material.metallic, material.roughness, material.alpha_mode), (0.0, 1.0, AlphaMode::Opaque));
    assert_eq!((scene.metal_share(), scene.unassigned), (0.0, Some(Unassigned::Diffuse { albedo: 0.25 })));
    let metal = with(&gltf, Unassigned::Gltf);
    assert_eq!((metal.materials[0].base_color.to_array(), metal.materials[0].metallic), ([1.0; 4], 1.0));
    assert_eq!((metal.metal_share(), &metal.blake3), (1.0, &scene.blake3));
    assert_eq!(loaded(&gltf).materials[0].base_color.x, 0.8);

    let about = |scene: &Scene| scene.warnings.iter().find(|w| w.contains("no material")).cloned();
    assert!(about(&scene).is_some_and(|w| w.contains("the only mesh") && w.contains("0.25")), "{:?}", scene.warnings);
    // Instances of one mesh, and a mesh with a material.
    gltf.root(json!({ "mesh": 0 }));
    gltf.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }));
    gltf.push("materials", json!({}));
    gltf.root(json!({ "mesh": 1 }));
    assert!(about(&loaded(&gltf)).is_some_and(|w| w.starts_with("1 of 2 meshes has")), "{:?}", loaded(&gltf).warnings);
    gltf.json["meshes"][1]["primitives"][0].as_object_mut().expect("an object").remove("material");
    assert!(about(&loaded(&gltf)).is_some_and(|w| w.starts_with("all 2 meshes have")), "{:?}", loaded(&gltf).warnings);
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    gltf.json["meshes"][1]["primitives"][0]["material"] = json!(0);
    assert_eq!((about(&loaded(&gltf)), loaded(&gltf).unassigned), (None, None));
}

#[test]
fn the_share_of_metal_is_by_area() {
    // Metalness in blue: 0 on the left half and 1 on the right, seen through the whole unit square twice.
    let mut gltf = Gltf::of_triangles(&[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ]);
    let view = gltf.view(&png(2, 1, &[[0, 255, 0, 255], [0, 255, 255, 255]]));
    gltf.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    gltf.push("samplers", json!({ "magFilter": 9728 }));
    gltf.push("textures", json!({ "source": 0, "sampler": 0 }));
    gltf.push("materials", json!({ "pbrMetallicRoughness": { "metallicRoughnessTexture": { "index": 0 } } }));
    gltf.push("materials", json!({ "pbrMetallicRoughness": { "metallicFactor": 0 } }));
    let uvs = gltf.floats(&[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0], "VEC2");
    gltf.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uvs);
    gltf.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    // 1,024 even points on each triangle: their share differs from the area's by about 1/1024.
    assert!((loaded(&gltf).metal_share() - 0.5).abs() < 5e-3, "{}", loaded(&gltf).metal_share());
    // Three times the area without metal.
    let positions = gltf.vec3(&[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0]]);
    gltf.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": positions }, "material": 1 }] }));
    gltf.root(json!({ "mesh": 1 }));
    assert!((loaded(&gltf).metal_share() - 0.125).abs() < 2e-3, "{}", loaded(&gltf).metal_share());
    gltf.json["materials"][0] = json!({ "extensions": { "KHR_materials_unlit": {} } });
    assert_eq!(loaded(&gltf).metal_share(), 0.0);
}

#[test]
fn negative_or_boundless_emission_is_no_light() {
    let emission = |factor: f64, strength: f64| {
        let extension = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
        with_material(json!({ "emissiveFactor": [factor, 0.5, 0.0], "extensions": extension }))
    };
    for (factor, strength, expected) in
        [(-1.0, -4.0, [0.0; 3]), (1.0, -4.0, [0.0; 3]), (-1.0, 4.0, [0.0, 2.0, 0.0]), (1.0, 1e35, [1e30, 1e30, 0.0])]
    {
        let scene = loaded(&emission(factor, strength));
        assert_eq!(scene.materials[0].emission.to_array(), expected, "{factor} {strength}");
        assert!(scene.warnings.iter().any(|w| w.contains("material 0")), "{:?}", scene.warnings);
        assert_eq!(scene.light_clamped, u64::from(strength > 1e30));
    }
    assert!(error(&emission(1.0, 1e39)).contains("emissiveStrength"));
    assert!(try_load(&emission(0.0, 1.0)).is_ok());
}

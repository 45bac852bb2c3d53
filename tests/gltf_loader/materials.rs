//! Materials, textures, lights, cameras and the sky.

use std::f32::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use glam::{Vec2, Vec3};
use lightprobe::scene::{AlphaMode, Environment, EnvironmentSource, LightKind, LoadOptions, Scene, Texels, load};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::SeedableRng;
use serde_json::json;

use crate::common::{Folder, Gltf};
use crate::{TRIANGLE, check, damage, loaded};

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

pub fn png(width: u32, height: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
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

fn map_of(file: std::path::PathBuf) -> EnvironmentSource {
    EnvironmentSource::Map { file, layer: None }
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
    let loaded = with(map_of(exr.clone())).expect("a map");
    let Environment::Map(map) = &loaded.environment else { panic!("not a map") };
    assert_eq!((map.width, map.height), (4, 2));
    assert_eq!(
        (map.texels[1], map.texels[6], map.texels[7]),
        (Vec3::new(1.0, 0.0, 0.5), Vec3::new(2.0, 1.0, 0.5), Vec3::ZERO)
    );
    assert!(loaded.warnings.iter().any(|w| w.contains("1 texel is not finite")));

    let hdr = folder.path().join("sky.hdr");
    let pixels: Vec<_> = (0..8).map(|i| image::Rgb([i as f32, 0.5, 2.0])).collect();
    let file = std::fs::File::create(&hdr).expect("a file");
    image::codecs::hdr::HdrEncoder::new(file).encode(&pixels, 4, 2).expect("an HDR file");
    let loaded = with(map_of(hdr.clone())).expect("a map");
    let Environment::Map(map) = &loaded.environment else { panic!("not a map") };
    assert!(map.texels[5].abs_diff_eq(Vec3::new(5.0, 0.5, 2.0), 0.05));

    // Damage anywhere is an error or a picture.
    let mut rng = Pcg32::seed_from_u64(1);
    for original in [exr, hdr] {
        let bytes = std::fs::read(&original).expect("a file");
        for _ in 0..150 {
            let damaged = folder.write("damaged.bin", damage(&bytes, &mut rng));
            if let Err(e) = with(map_of(damaged)) {
                assert!(!e.to_string().contains('\n'), "{e}");
            }
        }
    }
    assert!(with(map_of(folder.path().join("none.exr"))).is_err());
    assert!(with(map_of(folder.path().to_owned())).is_err());
}

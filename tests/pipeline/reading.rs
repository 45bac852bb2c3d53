//! What commands read of a scene's materials and lights, and that they agree about it.

use lightprobe::image::LayeredImage;
use serde_json::json;

use crate::common::{Folder, Gltf};
use crate::program::{bake, names_in, refuse, render, run, succeed, text};
use crate::shapes::{add, add_light, diffuse, quad, room, save};

const GRID: &str =
    "--preset physical --set grid.divisions=(2,2,2) --set store.irradiance.octahedral.format=f32 --threads 1";

/// A lit room whose walls have this material, or none.
fn lit_room(material: Option<serde_json::Value>) -> Gltf {
    let mut gltf = Gltf::new();
    let walls = add(&mut gltf, &room(2), diffuse([0.5; 3], [0.0; 3]));
    let mesh = gltf.json["nodes"][walls]["mesh"].as_u64().expect("an index") as usize;
    let primitive = &mut gltf.json["meshes"][mesh]["primitives"][0];
    match material {
        Some(material) => gltf.json["materials"][0] = material,
        None => drop(primitive.as_object_mut().expect("an object").remove("material")),
    }
    add(&mut gltf, &quad([-0.3, 0.9, -0.3], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6], 1), diffuse([0.0; 3], [4.0; 3]));
    gltf
}

/// Mean of a layer over a picture.
fn mean(folder: &Folder, file: &str, layer: &str) -> f64 {
    let image = LayeredImage::read_exr(&folder.path().join(file)).expect("a picture");
    let values = image.layer(layer).expect("the layer");
    values.iter().map(|v| f64::from(v.x)).sum::<f64>() / values.len() as f64
}

const VIEW: &str = "--look-at 0.8,0.3,0.8,-1,-0.2,-1,70 --size 32x32";

#[test]
fn meshes_without_a_material_are_the_same_in_every_command() {
    let folder = Folder::new();
    let bare = save(lit_room(None), &folder, "bare");
    let white = save(lit_room(Some(diffuse([0.8; 3], [0.0; 3]))), &folder, "white");
    let [own, explicit] = [&bare, &white].map(|scene| bake(&folder, scene, GRID));
    assert!(own.file.mean_irradiance(0)[0] > 0.0);
    assert_eq!(own.file.tensors["irradiance"].bytes, explicit.file.tensors["irradiance"].bytes);
    let metal = bake(&folder, &bare, &format!("{GRID} --set materials.unassigned=gltf"));
    assert!(metal.file.mean_irradiance(0)[0] < 0.5 * own.file.mean_irradiance(0)[0], "metal reflects");

    // `render` shows the walls as they were baked, without being told.
    render(&folder, &bare, &own.path, "own", VIEW);
    render(&folder, &bare, &metal.path, "metal", VIEW);
    assert!((mean(&folder, "own/visibility_on.exr", "albedo") - 0.8).abs() < 0.01);
    assert_eq!(mean(&folder, "metal/visibility_on.exr", "albedo"), 0.0);

    // So does `reference`, which is told; the other choice is another picture.
    let reference = |name: &str, set: &str| {
        let path = folder.path().join(name);
        let words = format!("reference {} -o {} --spp 16 -q {VIEW} {set}", text(&bare), text(&path));
        succeed(&words.split_whitespace().collect::<Vec<_>>());
        path
    };
    let own_reference = reference("own.exr", "");
    assert!((mean(&folder, "own.exr", "albedo") - 0.8).abs() < 0.01);
    let metal_reference = reference("metal.exr", "--set materials.unassigned=gltf");
    assert_eq!(mean(&folder, "metal.exr", "albedo"), 0.0);
    let compare = |file: &std::path::Path, name: &str| {
        let output = folder.path().join(name);
        let words = format!(
            "render {} {} -o {} -q {VIEW} --reference-image {}",
            text(&bare),
            text(&own.path),
            text(&output),
            text(file)
        );
        words.split_whitespace().map(str::to_owned).collect::<Vec<_>>()
    };
    succeed(&compare(&own_reference, "compared"));
    assert!(refuse(&compare(&metal_reference, "refused")).contains("materials.unassigned"));
}

#[test]
fn one_line_says_how_much_is_without_material_or_metal() {
    let folder = Folder::new();
    let told = |scene: &std::path::Path, words: &str| {
        let words = format!("bake {} --dry-run {GRID} {words}", text(scene));
        succeed(&words.split_whitespace().collect::<Vec<_>>()).stderr
    };
    let lines = |stderr: &str, word: &str| stderr.lines().filter(|line| line.contains(word)).count();
    let bare = save(lit_room(None), &folder, "bare");
    let own = told(&bare, "");
    assert!(own.contains("1 of 2 meshes has no material") && own.contains("0.8"), "{own}");
    assert_eq!((lines(&own, "no material"), lines(&own, "metal")), (1, 0), "{own}");
    let metal = told(&bare, "--set materials.unassigned=gltf");
    assert!(metal.contains("bakes black") && metal.contains("materials.unassigned"), "{metal}");
    // The walls have 24 m², the lamp 0.36.
    assert!(metal.contains("99 % of the surface area is metal"), "{metal}");
    assert_eq!(lines(&metal, "surface area is metal"), 1, "{metal}");

    // A material that names no metallicFactor.
    let forgotten = save(lit_room(Some(json!({ "name": "Wall" }))), &folder, "forgotten");
    let stderr = told(&forgotten, "");
    assert!(stderr.contains("99 % of the surface area is metal") && stderr.contains("metallicFactor"), "{stderr}");
    let reference = folder.path().join("a.exr");
    let words = format!("reference {} -o {} --spp 16 {VIEW} --transport", text(&forgotten), text(&reference));
    for (transport, expected) in [("lambert", 1), ("gltf", 0)] {
        let words: Vec<&str> = words.split_whitespace().chain([transport]).collect();
        assert_eq!(lines(&succeed(&words).stderr, "surface area is metal"), expected, "{transport}");
    }
}

#[test]
fn a_bake_needs_no_normal_map_and_a_picture_does() {
    let folder = Folder::new();
    let mut gltf = lit_room(Some(diffuse([0.5; 3], [0.0; 3])));
    gltf.push("images", json!({ "uri": "bumps.png" }));
    gltf.push("textures", json!({ "source": 0 }));
    gltf.json["materials"][0]["normalTexture"] = json!({ "index": 0 });
    let scene = folder.write("room.gltf", gltf.text());
    let baked = bake(&folder, &scene, GRID);
    let output = folder.path().join("out");
    let words = format!("render {} {} -o {} {VIEW}", text(&scene), text(&baked.path), text(&output));
    let words: Vec<&str> = words.split_whitespace().collect();
    let failed = run(&words);
    assert_eq!(failed.code, Some(2));
    for word in ["bumps.png", "material 0", "normalTexture"] {
        assert!(failed.stderr.contains(word), "no '{word}' in: {}", failed.stderr);
    }
    assert!(!names_in(folder.path()).contains(&"out".to_owned()));
    // The picture that the map appears in is of the scene that was baked.
    let mut png = Vec::new();
    let image = image::RgbaImage::from_pixel(1, 1, image::Rgba([128, 128, 255, 255]));
    image.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).expect("a PNG");
    folder.write("bumps.png", png);
    let rendered = succeed(&words);
    // Walls without coordinates are named, once the map is looked at; it is constant here, so nothing is lost.
    assert!(!rendered.stderr.contains("texture coordinates"), "{}", rendered.stderr);
}

#[test]
fn light_beyond_its_bound_is_clamped_and_counted() {
    let folder = Folder::new();
    // Far beyond what f32 holds: at the walls, and after scaling.
    for (number, (intensity, height, scale)) in
        [(1e38, 0.0, 1.0), (3e38, 0.999, 1.0), (1e29, -0.999_99, 1e6), (1e29, 0.0, 100.0)].into_iter().enumerate()
    {
        let mut gltf = Gltf::new();
        add(&mut gltf, &room(4), diffuse([0.9; 3], [0.0; 3]));
        let light = json!({ "type": "point", "intensity": intensity });
        add_light(&mut gltf, light, json!({ "translation": [0.0, height, 0.0] }));
        let scene = save(gltf, &folder, &format!("bright{number}"));
        let baked = bake(&folder, &scene, &format!("{GRID} --set lights.punctual_scale={scale}"));
        let numerics = &baked.report["numerics"];
        assert!(numerics["light_clamped"].as_u64().is_some_and(|n| n > 0), "{numerics}");
        assert_eq!(numerics["non_finite"], 0);
        for probe in baked.file.active() {
            let mean = baked.file.mean_irradiance(probe)[0];
            assert!(mean.is_finite() && mean > 1e20, "{mean}");
        }
        assert!(baked.report["bounces"].as_array().expect("a list").iter().all(|b| b["energy"].is_f64()));
        let name = format!("view{number}");
        let rendered = render(&folder, &scene, &baked.path, &name, VIEW);
        let path = folder.path().join("bright.exr");
        let words = format!(
            "reference {} -o {} --spp 1 --json -q {VIEW} --set lights.punctual_scale={scale}",
            text(&scene),
            text(&path)
        );
        let traced = succeed(&words.split_whitespace().collect::<Vec<_>>()).json();
        for report in [&rendered, &traced] {
            assert!(report["light_clamped"].as_u64().is_some_and(|n| n > 0), "{report}");
        }
        assert_eq!(rendered["light_clamped"], traced["light_clamped"]);
        let image = LayeredImage::read_exr(&folder.path().join(name).join("visibility_on.exr")).expect("a picture");
        for layer in ["beauty", "irradiance_direct", "irradiance_indirect"] {
            assert!(image.layer(layer).expect("the layer").iter().all(|v| v.is_finite()), "{layer}");
        }
    }
    // Light that is merely bright is left as it is.
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(4), diffuse([0.9; 3], [0.0; 3]));
    add_light(&mut gltf, json!({ "type": "point", "intensity": 1e20 }), json!({}));
    let scene = save(gltf, &folder, "merely");
    let baked = bake(&folder, &scene, GRID);
    assert_eq!(baked.report["numerics"]["light_clamped"], 0);
    assert_eq!(render(&folder, &scene, &baked.path, "merely", VIEW)["light_clamped"], 0);
}

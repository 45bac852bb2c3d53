//! The same input gives the same bytes: for any number of threads, any memory budget, and wherever the scene lies.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::common::{Folder, Gltf};
use crate::program::{bake, scene};
use crate::shapes::{add, add_light, diffuse, moved, quad, room, save};

/// A room with a translucent pane, a point light, a spot and a lamp.
fn blended(folder: &Folder) -> PathBuf {
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(2), diffuse([0.6, 0.5, 0.4], [0.0; 3]));
    let mut pane = diffuse([0.2, 0.4, 0.9], [0.0; 3]);
    pane["pbrMetallicRoughness"]["baseColorFactor"][3] = json!(0.4);
    pane["alphaMode"] = json!("BLEND");
    pane["doubleSided"] = json!(true);
    add(&mut gltf, &quad([0.1, -1.0, -1.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0], 3), pane.clone());
    add(&mut gltf, &quad([-0.2, -1.0, -1.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0], 1), pane);
    add(&mut gltf, &quad([-0.9, 0.98, -0.2], [0.3, 0.0, 0.0], [0.0, 0.0, 0.3], 1), diffuse([0.5; 3], [9.0, 8.0, 7.0]));
    add_light(&mut gltf, json!({ "type": "point", "intensity": 2.0 }), json!({ "translation": [-0.5, 0.3, 0.2] }));
    let cone = json!({ "innerConeAngle": 0.2, "outerConeAngle": 0.6 });
    add_light(
        &mut gltf,
        json!({ "type": "spot", "intensity": 3.0, "range": 4.0, "spot": cone }),
        json!({ "translation": [0.5, 0.6, 0.6] }),
    );
    save(gltf, folder, "blended")
}

fn check(folder: &Folder, scene: &Path, words: &str) {
    let one = bake(folder, scene, &format!("{words} --threads 1"));
    let energy = one.report["bounces"].as_array().and_then(|list| list.last()?["energy"].as_f64());
    assert!(energy.is_some_and(|energy| energy > 0.0), "{} is dark", scene.display());
    assert_eq!(one.report["threads"], 1);
    let two = bake(folder, scene, &format!("{words} --threads 2"));
    assert_eq!(two.report["threads"], 2);
    assert!(one.bytes == two.bytes, "{}: threads change the file", scene.display());
    let seven = bake(folder, scene, &format!("{words} --threads 7 --memory-budget 1MiB"));
    assert!(one.bytes == seven.bytes, "{}: the memory budget changes the file", scene.display());
    let none = bake(folder, scene, &format!("{words} --memory-budget 0B"));
    assert!(one.bytes == none.bytes, "{}: a memory budget of nothing changes the file", scene.display());
    let other = bake(folder, scene, &format!("{words} --seed 1"));
    assert!(one.bytes != other.bytes, "{}: the seed has no effect", scene.display());
}

#[test]
fn rooms_with_a_lamp() {
    check(&Folder::new(), &scene("two_rooms_open"), "--set grid.spacing_m=1.5 --set solver.max_bounces=5");
}

#[test]
fn textures_and_masked_leaves() {
    check(&Folder::new(), &scene("glossy_room"), "--set grid.spacing_m=1.5 --set solver.max_bounces=5");
}

#[test]
fn translucent_panes_and_punctual_lights() {
    let folder = Folder::new();
    let scene = blended(&folder);
    check(&folder, &scene, "--set grid.spacing_m=0.5");
    check(&folder, &scene, "--preset physical --set grid.spacing_m=0.5");
    let moments = "--set query.visibility={\"moments\":{\"power\":3,\"floor\":0}}";
    check(&folder, &scene, &format!("--set grid.spacing_m=0.5 {moments}"));
}

#[test]
fn a_scene_far_from_the_origin_gives_the_same_tensors() {
    let folder = Folder::new();
    let scenes = [scene("two_rooms_open"), scene("glossy_room"), blended(&folder)];
    for (scene, spacing) in scenes.iter().zip([1.5, 1.5, 0.5]) {
        let words = format!("--set grid.spacing_m={spacing} --set solver.max_bounces=5");
        let here = bake(&folder, scene, &words).file;
        let bytes = std::fs::read(scene).unwrap();
        for translation in [[1e5, 0.0, 0.0], [-1e5, 1e5, 1e5], [1e5 + 0.1, -0.3, 7.7]] {
            let name = format!("moved_{}", scene.file_name().unwrap().to_str().unwrap());
            let there = bake(&folder, &folder.write(&name, moved(&bytes, translation)), &words).file;
            assert_eq!(here.tensors.keys().collect::<Vec<_>>(), there.tensors.keys().collect::<Vec<_>>());
            for (name, tensor) in &here.tensors {
                assert!(*tensor == there.tensors[name], "{}: {name} moved by {translation:?}", scene.display());
            }
            let (from, to) = (here.position(0), there.position(0));
            for k in 0..3 {
                // glTF's numbers are read as f32; f64 at 10⁵ has steps of 1.5e-11.
                let step = f64::from(translation[k] as f32);
                assert!((to[k] - from[k] - step).abs() < 1e-9, "{from:?} {to:?}");
            }
        }
    }
}

#[test]
fn no_time_path_or_thread_count_enters_the_file() {
    let folder = Folder::new();
    let copy = folder.path().join("elsewhere");
    std::fs::create_dir(&copy).unwrap();
    let copied = copy.join("furnace.glb");
    std::fs::copy(scene("furnace"), &copied).unwrap();
    let words = "--set grid.spacing_m=1";
    assert!(bake(&folder, &scene("furnace"), words).bytes == bake(&folder, &copied, words).bytes);
}

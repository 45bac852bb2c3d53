//! The scene loader on the shared scenes: they load or are refused, whole and damaged.

use lightprobe::scene::{LoadOptions, load};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::SeedableRng;

use crate::adversarial::files_below;
use crate::needs::shared_scenes;
use crate::promises::{assert_damage_is_survived, check};

pub fn shared_scenes_load_or_are_refused() {
    let scenes = shared_scenes();
    let mut files = Vec::new();
    files_below(&scenes, &mut files);
    assert!(files.len() > 40, "only {} files", files.len());
    for path in files {
        let relative = path.strip_prefix(&scenes).expect("below").display().to_string();
        match load(&path, &LoadOptions::default()) {
            Ok(scene) => check(&scene),
            Err(e) => {
                assert!(relative.starts_with("adversarial"), "{relative}: {e}");
                assert!(!e.to_string().contains('\n'), "{e}");
            }
        }
    }
}

pub fn damaged_shared_scenes_never_panic() {
    let names = [
        "lights_punctual/simple-instancing.glb",
        "cornell_hwrt/cornell_box.glb",
        "adversarial/simple_skin/simple_skin.gltf",
        "lights_punctual/Lights.glb",
        "adversarial/BoxTextured-glTF-Binary/BoxTextured.glb",
    ];
    let files = names.map(|name| std::fs::read(shared_scenes().join(name)).expect("a shared scene"));
    assert_damage_is_survived(&files, &mut Pcg32::seed_from_u64(7));
}

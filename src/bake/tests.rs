//! Resuming an interrupted bake.

use super::*;
use crate::scene::{self, LoadOptions};

/// Bakes the open rooms coarsely.
fn bake(checkpoint: Option<Checkpoint>, max_bounces: u32) -> Baked {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/two_rooms_open.glb");
    let scene = scene::load(&path, &LoadOptions::default()).unwrap();
    let set = ["grid.spacing_m=2".to_owned(), format!("solver.max_bounces={max_bounces}")];
    let config = Config::default().with_overrides(&set).unwrap();
    let world = World::new(&scene, config.lights.punctual_scale, config.solver.albedo_max).unwrap();
    let circumstances = Circumstances { seed: 1, memory_budget_bytes: None, progress: Progress::hidden(), checkpoint };
    let record = SceneRecord { name: scene.name.clone(), blake3: scene.blake3.clone() };
    prepare(&world, &config, &circumstances).unwrap().bake(&circumstances, &record).unwrap()
}

#[test]
fn a_resumed_bake_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.resume");
    let checkpoint = |resume| Checkpoint { path: path.clone(), resume, interval: Duration::ZERO };
    let whole = bake(None, 64);
    assert!(!path.exists());
    // With an interval of zero every sweep is saved; the last stands.
    bake(Some(checkpoint(false)), 64);
    let saved = std::fs::read(&path).unwrap();
    let resumed = bake(Some(checkpoint(true)), 64);
    assert_eq!(std::fs::read(&path).unwrap(), saved, "nothing was left to sweep");
    assert_eq!(resumed.container, whole.container);
    assert_eq!(resumed.solution, whole.solution);
}

#[test]
fn a_bake_is_resumed_from_the_middle() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.resume");
    let checkpoint = |resume| Checkpoint { path: path.clone(), resume, interval: Duration::ZERO };
    bake(Some(checkpoint(false)), 3);
    // The checkpoint of a bake with other settings, relabelled as one of this: three sweeps done, the rest to do.
    let mut container = Container::read(&path).unwrap();
    let identity = container.metadata["identity"].replace("max_bounces: 3", "max_bounces: 64");
    container.metadata.insert("identity".into(), identity);
    container.write(&path).unwrap();
    assert_eq!(bake(Some(checkpoint(true)), 64).container, bake(None, 64).container);
}

//! Pictures of exports in Bevy 0.20, without a window.
//!
//! `lightprobe-bevy SCENE WIDTH HEIGHT (EXPORT CAMERA OUT)…` loads the scene, and for each export folder its volumes with the
//! numbers that `probes.json` gives. All surfaces are white but keep their normal maps, and no lamp, ambient light, tone curve or exposure does
//! anything. OUT gets red, green, blue of each pixel as 32-bit floats, little-endian, rows from the top: E/π of the volumes.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use bevy::app::PluginsState;
use bevy::asset::{AssetPlugin, LoadState, RecursiveDependencyLoadState, UnapprovedPathMode};
use bevy::camera::{Exposure, Hdr, RenderTarget};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::gltf::GltfAssetLabel;
use bevy::light::{GlobalAmbientLight, IrradianceVolume, LightProbe};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use bevy::window::{ExitCondition, WindowPlugin};

/// Frames after which all that was spawned is on the graphics card, in clusters, and read back.
const FRAMES: u32 = 12;

const PATIENCE: Duration = Duration::from_secs(300);

/// Bytes that rows of a texture are padded to when they are read back (`wgpu::COPY_BYTES_PER_ROW_ALIGNMENT`).
const ROW: usize = 256;

struct Job {
    export: PathBuf,
    camera: String,
    out: PathBuf,
}

/// What was read back last.
#[derive(Resource, Default)]
struct Picture(Vec<u8>);

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match run(&words) {
        Ok(()) => ExitCode::SUCCESS,
        Err(what) => {
            eprintln!("lightprobe-bevy: {what}");
            ExitCode::FAILURE
        }
    }
}

fn run(words: &[String]) -> Result<(), String> {
    let [scene, width, height, jobs @ ..] = words else {
        return Err("usage: lightprobe-bevy SCENE WIDTH HEIGHT (EXPORT CAMERA OUT)…".to_owned());
    };
    let number = |word: &str| word.parse::<u32>().map_err(|error| format!("{word}: {error}"));
    let (width, height) = (number(width)?, number(height)?);
    let mut app = started();
    spawn_scene(&mut app, Path::new(scene))?;
    let target = target(&mut app, width, height);
    for job in jobs.chunks(3) {
        let [export, camera, out] = job else { return Err("jobs are EXPORT CAMERA OUT".to_owned()) };
        let job = Job { export: export.into(), camera: camera.clone(), out: out.into() };
        let pixels = shoot(&mut app, &target, &job)?;
        let rows = pixels.chunks((16 * width as usize).next_multiple_of(ROW)).take(height as usize);
        let colors = rows.flat_map(|row| row[..16 * width as usize].chunks(16).flat_map(|pixel| &pixel[..12]));
        let bytes: Vec<u8> = colors.copied().collect();
        fs::write(&job.out, bytes).map_err(|error| format!("{}: {error}", job.out.display()))?;
    }
    Ok(())
}

/// An app that draws into images only.
fn started() -> App {
    let mut app = App::new();
    let window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    let render = RenderPlugin { synchronous_pipeline_compilation: true, ..default() };
    // Scenes and exports lie anywhere.
    let assets =
        AssetPlugin { file_path: "/".to_owned(), unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
    app.add_plugins(DefaultPlugins.set(window).set(render).set(assets));
    app.insert_resource(GlobalAmbientLight::NONE).insert_resource(ClearColor(Color::BLACK)).init_resource::<Picture>();
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    app
}

fn absolute(path: &Path) -> Result<PathBuf, String> {
    path.canonicalize().map_err(|error| format!("{}: {error}", path.display()))
}

/// Updates until all assets are there.
fn load(app: &mut App, handles: &[UntypedHandle]) -> Result<(), String> {
    let started = Instant::now();
    for handle in handles {
        loop {
            app.update();
            let server = app.world().resource::<AssetServer>();
            if server.is_loaded_with_dependencies(handle) {
                break;
            }
            if let LoadState::Failed(error) = server.load_state(handle) {
                return Err(format!("{:?}: {error}", handle.path()));
            }
            if let RecursiveDependencyLoadState::Failed(error) = server.recursive_dependency_load_state(handle) {
                return Err(format!("{:?}: {error}", handle.path()));
            }
            if started.elapsed() > PATIENCE {
                return Err(format!("{:?} does not load", handle.path()));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    Ok(())
}

/// A camera of the scene's file.
#[derive(Component)]
struct View {
    name: String,
    projection: Projection,
}

/// What is taken over of an entity of the scene's file.
struct Taken {
    place: Transform,
    parent: Option<Entity>,
    surface: Option<(Mesh3d, MeshMaterial3d<StandardMaterial>)>,
    camera: Option<View>,
}

/// What a scene's file holds, by its own entities.
fn read(world: &mut World, handle: &Handle<WorldAsset>) -> Option<Vec<(Entity, Taken)>> {
    let mut scenes = world.resource_mut::<Assets<WorldAsset>>();
    let mut scene = scenes.get_mut(handle)?;
    let file = &mut scene.world;
    let mut places = file.query::<(Entity, &Transform)>();
    let places: Vec<(Entity, Transform)> = places.iter(file).map(|(entity, place)| (entity, *place)).collect();
    let take = |(entity, place): (Entity, Transform)| {
        let own = file.entity(entity);
        let view =
            |(name, projection): (&Name, &Projection)| View { name: name.to_string(), projection: projection.clone() };
        let surface = own.get::<Mesh3d>().cloned().zip(own.get::<MeshMaterial3d<StandardMaterial>>().cloned());
        let camera = own.get::<Name>().zip(own.get::<Projection>()).map(view);
        (entity, Taken { place, parent: own.get::<ChildOf>().map(ChildOf::parent), surface, camera })
    };
    Some(places.into_iter().map(take).collect())
}

/// The surfaces of the scene, which become white, and the places of its cameras; no lamps.
fn spawn_scene(app: &mut App, scene: &Path) -> Result<(), String> {
    let path = absolute(scene)?;
    let handle: Handle<WorldAsset> =
        app.world().resource::<AssetServer>().load(GltfAssetLabel::Scene(0).from_asset(path));
    load(app, &[handle.clone().untyped()])?;
    let world = app.world_mut();
    let found = read(world, &handle).ok_or("the scene is gone")?;
    let used: Vec<AssetId<StandardMaterial>> =
        found.iter().filter_map(|(_, taken)| taken.surface.as_ref()).map(|(_, material)| material.id()).collect();
    if used.is_empty() {
        return Err(format!("{} has no surfaces", scene.display()));
    }
    let own: HashMap<Entity, Entity> =
        found.iter().map(|(entity, taken)| (*entity, world.spawn((taken.place, Visibility::default())).id())).collect();
    for (entity, taken) in found {
        let mut spawned = world.entity_mut(own[&entity]);
        if let Some(parent) = taken.parent.and_then(|parent| own.get(&parent)) {
            spawned.insert(ChildOf(*parent));
        }
        if let Some(surface) = taken.surface {
            spawned.insert(surface);
        }
        if let Some(camera) = taken.camera {
            spawned.insert(camera);
        }
    }
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    for id in used {
        let Some(mut material) = materials.get_mut(id) else { continue };
        let white = StandardMaterial {
            base_color: Color::WHITE,
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            double_sided: material.double_sided,
            cull_mode: material.cull_mode,
            normal_map_texture: material.normal_map_texture.clone(),
            flip_normal_map_y: material.flip_normal_map_y,
            ..default()
        };
        *material = white;
    }
    Ok(())
}

/// An image of floats that cameras draw into and that is read back.
fn target(app: &mut App, width: u32, height: u32) -> Handle<Image> {
    let mut image = Image::new_target_texture(width, height, TextureFormat::Rgba32Float, None);
    image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let handle = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    let keep = |event: On<ReadbackComplete>, mut picture: ResMut<Picture>| picture.0.clone_from(&event.data);
    app.world_mut().spawn(Readback::texture(handle.clone())).observe(keep);
    handle
}

/// What the scene's camera of that name sees by the light of an export.
fn shoot(app: &mut App, target: &Handle<Image>, job: &Job) -> Result<Vec<u8>, String> {
    let volumes = spawn_volumes(app, &job.export)?;
    let camera = spawn_camera(app, &job.camera, target)?;
    for _ in 0..FRAMES {
        app.world_mut().resource_mut::<Picture>().0.clear();
        app.update();
    }
    // The card takes its time.
    let started = Instant::now();
    while app.world().resource::<Picture>().0.is_empty() {
        if started.elapsed() > PATIENCE {
            return Err("no picture comes back".to_owned());
        }
        app.update();
    }
    let world = app.world_mut();
    volumes.into_iter().chain([camera]).for_each(|entity| {
        world.despawn(entity);
    });
    Ok(app.world().resource::<Picture>().0.clone())
}

/// The volumes of an export as its `note` says.
fn spawn_volumes(app: &mut App, export: &Path) -> Result<Vec<Entity>, String> {
    let folder = absolute(export)?;
    let path = folder.join("probes.json");
    let wrong = |what: &str| format!("{}: {what}", path.display());
    let text = fs::read(&path).map_err(|error| wrong(&error.to_string()))?;
    let record: serde_json::Value = serde_json::from_slice(&text).map_err(|error| wrong(&error.to_string()))?;
    let volumes = record["volumes"].as_array().ok_or_else(|| wrong("no volumes"))?;
    let mut found = Vec::new();
    for volume in volumes {
        let file = volume["file"].as_str().ok_or_else(|| wrong("a volume without a file"))?;
        let vector = |key: &str| -> Option<Vec3> {
            let numbers: Vec<f32> =
                volume["engine"][key].as_array()?.iter().filter_map(|n| Some(n.as_f64()? as f32)).collect();
            Some(Vec3::from(<[f32; 3]>::try_from(numbers).ok()?))
        };
        let translation = vector("translation").ok_or_else(|| wrong("no translation"))?;
        let scale = vector("scale").ok_or_else(|| wrong("no scale"))?;
        let intensity = volume["engine"]["intensity"].as_f64().ok_or_else(|| wrong("no intensity"))? as f32;
        let voxels: Handle<Image> = app.world().resource::<AssetServer>().load(folder.join(file));
        load(app, &[voxels.clone().untyped()])?;
        let transform = Transform { translation, scale, ..default() };
        let volume = IrradianceVolume { voxels, intensity, ..default() };
        found.push(app.world_mut().spawn((LightProbe::default(), volume, transform)).id());
    }
    Ok(found)
}

/// A camera where the scene has the one of that name, which shows radiance as it is.
fn spawn_camera(app: &mut App, name: &str, target: &Handle<Image>) -> Result<Entity, String> {
    app.update();
    let world = app.world_mut();
    let mut views = world.query::<(&View, &GlobalTransform)>();
    let all: Vec<(&View, &GlobalTransform)> = views.iter(world).collect();
    // A single one may have no name, or one by its node.
    let found = all.iter().find(|(view, _)| view.name == name || all.len() == 1);
    let (view, place) = found.ok_or_else(|| format!("the scene has no camera '{name}'"))?;
    let (transform, projection) = (place.compute_transform(), view.projection.clone());
    let exposure = Exposure { ev100: -f32::log2(1.2) };
    let own = (
        Camera3d::default(),
        Hdr,
        RenderTarget::Image(target.clone().into()),
        projection,
        transform,
        exposure,
        Tonemapping::None,
        DebandDither::Disabled,
        Msaa::Off,
    );
    Ok(world.spawn(own).id())
}

//! Resuming an interrupted bake; stiff scenes against a dense solution.

use std::time::Duration;

use glam::Vec3;
use nalgebra::{DMatrix, DVector};
use serde_json::json;

use super::*;
use crate::config::Config;
use crate::light::World;
use crate::probe::Volume;
use crate::probe::capture::ProbeCapture;
use crate::probe::file::SceneRecord;
use crate::probe::store::Occlusion;
use crate::probe::store::kernel::Kernel;
use crate::probe::transport::operator::{self, Field, Operator};
use crate::probe::transport::solver::{self, Progress as Iterations};
use crate::probe::transport::{BounceSettings, checkpoint};
use crate::scene::{self, LoadOptions, Scene};

/// Bakes the open rooms coarsely.
fn bake(checkpoint: Option<Checkpoint>) -> Baked {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/two_rooms_open.glb");
    let scene = scene::load(&path, &LoadOptions::default()).unwrap();
    let config = Config::default().with_overrides(&["grid.spacing_m=2".to_owned()]).unwrap();
    let world = World::new(&scene, config.lights.punctual_scale, config.materials.albedo_max).unwrap();
    let circumstances = Circumstances { checkpoint, ..Circumstances::quiet(1) };
    let record = SceneRecord { name: scene.name.clone(), blake3: scene.blake3.clone() };
    prepare(&world, &config, &circumstances).unwrap().bake(&circumstances, &record).unwrap()
}

#[test]
fn a_resumed_bake_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.resume");
    let checkpoint = |resume| Checkpoint { path: path.clone(), resume, interval: Duration::ZERO };
    let whole = bake(None);
    assert!(!path.exists());
    // With an interval of zero all captures and every iteration are saved; the last stands.
    bake(Some(checkpoint(false)));
    let saved = std::fs::read(&path).unwrap();
    let resumed = bake(Some(checkpoint(true)));
    assert_eq!(std::fs::read(&path).unwrap(), saved, "nothing was left to capture or to iterate");
    assert_eq!(resumed.container, whole.container);
    assert_eq!(resumed.solution, whole.solution);
    // Whatever a kill cuts off is made again.
    for part in [1, 3, 5, 7] {
        std::fs::write(&path, &saved[..100 + (saved.len() - 100) * part / 8]).unwrap();
        let resumed = bake(Some(checkpoint(true)));
        assert_eq!(resumed.container, whole.container, "{part} eighths of the file");
        // Captures in another order, if at all.
        assert!(std::fs::read(&path).unwrap().len() >= saved.len());
    }
    // And so is what is damaged.
    let mut damaged = saved;
    (100..damaged.len()).step_by(4097).for_each(|at| damaged[at] ^= 16);
    std::fs::write(&path, damaged).unwrap();
    assert_eq!(bake(Some(checkpoint(true))).container, whole.container);
}

/// A small bake up to the iterations.
struct Traced<'w, 's> {
    prepared: Prepared<'w, 's>,
    captures: Vec<ProbeCapture>,
    kernel: Kernel,
}

impl<'w, 's> Traced<'w, 's> {
    fn new(world: &'w World<'s>, config: &'w Config) -> Traced<'w, 's> {
        let circumstances = Circumstances::quiet(1);
        let prepared = prepare(world, config, &circumstances).unwrap();
        let capture = prepared.capture(&circumstances);
        let captures = (0..prepared.grid.probe_count()).map(|p| prepared.trace(&capture, p)).collect();
        let irradiance = prepared.volume(Occlusion::None).irradiance;
        let kernel = irradiance.kernel(&config.capture.rays.directions());
        Traced { prepared, captures, kernel }
    }

    fn operator<'a>(&'a self, captures: &'a Vec<ProbeCapture>) -> Operator<'a, Vec<ProbeCapture>> {
        Operator { captures, kernel: &self.kernel, query: &self.prepared.config.query, gathers_emission: true }
    }

    fn volume(&self) -> Volume {
        let regions = self.prepared.placement.regions.clone().filter(|_| self.prepared.plan.visibility);
        self.prepared.volume(regions.map_or(Occlusion::None, Occlusion::Regions))
    }
}

/// Metres, and the finest grid that a dense matrix can be afforded for.
const COARSE: [&str; 4] =
    ["grid.padding=0", "capture.resolution=12", "filter.irradiance_resolution=3", "encoding.irradiance=f32"];

fn config(set: &[&str]) -> Config {
    let set: Vec<String> = COARSE.iter().chain(set).map(|s| (*s).to_owned()).collect();
    Config::default().with_overrides(&set).unwrap()
}

#[test]
fn iterations_go_on_from_a_checkpoint_as_if_nothing_had_happened() {
    let scene = rooms_with_a_door(0.99);
    let config = config(&["grid.divisions=(6,3,3)"]);
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let traced = Traced::new(&world, &config);
    let operator = traced.operator(&traced.captures);
    let folder = tempfile::tempdir().unwrap();
    let path = |iterations: usize| folder.path().join(iterations.to_string());
    let mut whole = traced.volume();
    let solution =
        solver::solve(&operator, &config.transport.iteration(), &mut whole, Iterations::default(), |state, volume| {
            std::fs::write(path(state.solution.bounces.len()), checkpoint::pack(state, volume)).unwrap();
        });
    let done = solution.bounces.len();
    assert!(solution.converged && solution.bounces.iter().filter(|b| b.accelerated).count() > 3, "{solution:?}");
    // In the plain iterations, among the accelerated ones, at the end.
    for iterations in [1, 2, done / 2, done - 1, done] {
        let mut volume = traced.volume();
        let state = checkpoint::unpack(&std::fs::read(path(iterations)).unwrap(), &mut volume).unwrap();
        assert_eq!(solver::solve(&operator, &config.transport.iteration(), &mut volume, state, |_, _| {}), solution);
        assert_eq!(volume.irradiance, whole.irradiance, "from iteration {iterations}");
    }
}

/// The scene's operator as a matrix and the irradiance before the first bounce, one channel.
fn dense(traced: &Traced) -> (DMatrix<f64>, DVector<f64>) {
    let mut dark = traced.captures.clone();
    for capture in &mut dark {
        capture.emitted.clear();
        capture.surfels.iter_mut().for_each(|s| s.direct_radiance = Vec3::ZERO);
    }
    let mut volume = traced.volume();
    let (operator, masks) = (traced.operator(&dark), traced.operator(&dark).masks(&volume));
    let (direct, _) = traced.operator(&traced.captures).apply(&volume, None);
    let n = direct.len();
    let mut matrix = DMatrix::zeros(n, n);
    for column in 0..n {
        let unit: Field = (0..n).map(|o| if o == column { Vec3::ONE } else { Vec3::ZERO }).collect();
        operator::store(&mut volume, &unit);
        let (image, _) = operator.apply(&volume, Some(&masks));
        image.iter().enumerate().for_each(|(row, e)| matrix[(row, column)] = f64::from(e.x));
    }
    (matrix, DVector::from_iterator(n, direct.iter().map(|e| f64::from(e.x))))
}

/// The largest eigenvalue of a matrix, by inverse iteration: that of (1 − T)⁻¹ stands apart where that of T does not.
fn largest_eigenvalue(one_minus: &nalgebra::LU<f64, nalgebra::Dyn, nalgebra::Dyn>, n: usize) -> f64 {
    let mut vector = DVector::from_element(n, 1.0);
    let mut growth = 0.0;
    for _ in 0..200 {
        vector = one_minus.solve(&vector).unwrap();
        growth = vector.norm();
        vector /= growth;
    }
    1.0 - 1.0 / growth
}

/// The accelerated solver against the dense solution: at most 30 iterations, every texel within 1 % of it, 1 − λ̂ within 10 %.
fn check_against_dense(scene: &Scene, config: &Config, what: &str) {
    let world = World::new(scene, 1.0, 0.9995).unwrap();
    let traced = Traced::new(&world, config);
    let (matrix, direct) = dense(&traced);
    let n = direct.len();
    let one_minus = (DMatrix::identity(n, n) - &matrix).lu();
    let exact = one_minus.solve(&direct).unwrap();
    let eigenvalue = largest_eigenvalue(&one_minus, n);
    let mut volume = traced.volume();
    let operator = traced.operator(&traced.captures);
    let settings = BounceSettings { max_iterations: 30, ..config.transport.iteration() };
    let solution = solver::solve(&operator, &settings, &mut volume, Iterations::default(), |_, _| {});
    let found = operator::field_of(&volume);
    let worst = found.iter().zip(exact.iter()).map(|(e, x)| (f64::from(e.x) / x - 1.0).abs()).fold(0.0, f64::max);
    let estimate = solution.spectral_radius_estimate.unwrap();
    let gap = (1.0 - estimate) / (1.0 - eigenvalue);
    println!(
        "{what}: {n} unknowns, {} iterations, worst texel {worst:.1e}, 1 − λ {:.3e}, estimate ÷ truth {gap:.4}, bound {:.1e}",
        solution.bounces.len(),
        1.0 - eigenvalue,
        solution.error_bound_relative.unwrap(),
    );
    assert!(solution.bounces.len() <= 30 && worst <= 0.01, "{what}: {} iterations, {worst}", solution.bounces.len());
    assert!((gap - 1.0).abs() <= 0.1, "{what}: 1 − λ {} instead of {}", 1.0 - estimate, 1.0 - eigenvalue);
    // The bound holds: relative to the largest texel, with a little room for rounding.
    let largest = exact.max();
    let error = found.iter().zip(exact.iter()).map(|(e, x)| (f64::from(e.x) - x).abs() / largest).fold(0.0, f64::max);
    assert!(error <= solution.error_bound_relative.unwrap() * 1.5 + 1e-6, "{what}: {error}");
    assert!(found.iter().all(|e| e.cmpge(Vec3::ZERO).all()));
}

#[test]
fn stiff_furnaces_agree_with_a_dense_solution() {
    for albedo in [0.9, 0.99, 0.999] {
        let mut gltf = common::Gltf::new();
        let emitting = json!({
            "pbrMetallicRoughness": { "baseColorFactor": [albedo, albedo, albedo, 1.0], "metallicFactor": 0.0 },
            "emissiveFactor": [1.0, 1.0, 1.0],
        });
        add_inside(&mut gltf, [-1.0; 3], [1.0; 3], emitting);
        check_against_dense(&loaded(&gltf), &config(&["grid.divisions=(3,3,3)"]), &format!("furnace {albedo}"));
    }
}

#[test]
fn stiff_rooms_agree_with_a_dense_solution() {
    for albedo in [0.9, 0.99, 0.999] {
        let config = config(&["grid.divisions=(6,3,3)"]);
        check_against_dense(&rooms_with_a_door(albedo), &config, &format!("door {albedo}"));
    }
}

/// Two rooms of 2 m × 2 m × 2 m, a wall of 0.1 m with a door of 0.3 m × 0.8 m, and in the left one a lamp of 0.1 m².
fn rooms_with_a_door(albedo: f64) -> Scene {
    let mut gltf = common::Gltf::new();
    let wall = |emission: f64| {
        json!({
            "pbrMetallicRoughness": { "baseColorFactor": [albedo, albedo, albedo, 1.0], "metallicFactor": 0.0 },
            "emissiveFactor": [emission, emission, emission],
        })
    };
    add_inside(&mut gltf, [-2.05, 0.0, -1.0], [2.05, 2.0, 1.0], wall(0.0));
    let (low, high) = (-0.05, 0.05);
    for (min, max) in [
        ([low, 0.0, -1.0], [high, 2.0, -0.15]),
        ([low, 0.0, 0.15], [high, 2.0, 1.0]),
        ([low, 0.8, -0.15], [high, 2.0, 0.15]),
    ] {
        let mut triangles = box_inside(min, max);
        // Outwards.
        triangles.as_chunks_mut::<3>().0.iter_mut().for_each(|t| t.swap(1, 2));
        add(&mut gltf, &triangles, wall(0.0));
    }
    let (y, size) = (1.99, 0.16);
    let corner = |x: f32, z: f32| [-1.0 + x * size, y, z * size];
    let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    add(&mut gltf, &[a, b, c, a, c, d], wall(1.0));
    loaded(&gltf)
}

fn loaded(gltf: &common::Gltf) -> Scene {
    let folder = common::Folder::new();
    scene::load(&folder.write("scene.glb", gltf.glb()), &LoadOptions::default()).unwrap()
}

fn add(gltf: &mut common::Gltf, triangles: &[[f32; 3]], material: serde_json::Value) {
    let material = gltf.push("materials", material);
    let positions = gltf.vec3(triangles);
    let primitive = json!({ "attributes": { "POSITION": positions }, "material": material });
    let mesh = gltf.push("meshes", json!({ "primitives": [primitive] }));
    gltf.root(json!({ "mesh": mesh }));
}

fn add_inside(gltf: &mut common::Gltf, min: [f32; 3], max: [f32; 3], material: serde_json::Value) {
    add(gltf, &box_inside(min, max), material);
}

/// The faces of a box, fronts inwards.
fn box_inside(min: [f32; 3], max: [f32; 3]) -> Vec<[f32; 3]> {
    let corner = |i: usize| std::array::from_fn(|k| if i >> k & 1 == 0 { min[k] } else { max[k] });
    let face = |k: usize| {
        let (u, v) = (1 << ((k + 1) % 3), 1 << ((k + 2) % 3));
        let quad = |base: usize, u: usize, v: usize| [base, base + u, base + u + v, base, base + u + v, base + v];
        // u × v is +k: inwards on the low face, and with both swapped on the high one.
        [quad(0, u, v), quad(1 << k, v, u)].concat()
    };
    (0..3).flat_map(face).map(corner).collect()
}

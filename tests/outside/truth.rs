//! The truth at the probes (preset `path`, `render --reference`) against the path tracer asked at the same points, with
//! no interpolation in between; and the iterated bake against both.

use std::path::Path;

use glam::Vec3;
use lightprobe::bake::{Circumstances, prepare};
use lightprobe::config::Config;
use lightprobe::light::World;
use lightprobe::light::path::PathSettings;
use lightprobe::light::sampled::RayCount;
use lightprobe::light::surface::SurfacePoint;
use lightprobe::math::blocks::{BLOCK, Block};
use lightprobe::math::color::luminance;
use lightprobe::math::octahedral::texel_direction;
use lightprobe::math::random::Purpose;
use lightprobe::probe::file::SceneRecord;
use lightprobe::probe::transport::truth::{RUNS, Truth};
use lightprobe::report::baked;
use lightprobe::scene::{self, LoadOptions};
use lightprobe::system::progress::Progress;

use crate::needs::shared_scenes;

/// Blocks of the path tracer at each point and direction.
const BLOCKS: u64 = 128;

/// What the sum over texels of 0.06 rad is off from the integral over directions, relative to the irradiance.
const QUADRATURE: f64 = 2e-3;

/// Luminance of the irradiance at a point of space, and its variance.
fn traced(world: &World, position: Vec3, normal: Vec3, name: u64) -> (f64, f64) {
    let point = SurfacePoint::in_space(position, normal);
    let (settings, mut rays) = (PathSettings::default(), RayCount::default());
    let mut block = |b: u64| -> f64 {
        let block = Block::new(99, Purpose::Path, name, b);
        let mut sample =
            |i| world.gather(&point, normal, normal, &settings, &mut block.sample(i), &mut rays).irradiance;
        (0..BLOCK).map(|i| f64::from(luminance(sample(i)))).sum::<f64>() / f64::from(BLOCK)
    };
    mean_and_variance(&(0..BLOCKS).map(&mut block).collect::<Vec<f64>>())
}

/// Mean, and its variance from the values' spread.
fn mean_and_variance(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0)))
}

/// Bakes whose own bias is averaged: what of it is noise of the bake falls to half.
const BAKES: u64 = 4;

/// The iterated bake's own bias in one setting, in shares of the light: found with 24 seeds, each with a truth of its own
/// (relocation, and so the probes' places, may depend on the seed).
struct Bias {
    mean: f64,
    /// Standard deviation of one seed's, the noise of its truth included.
    deviation: f64,
}

/// Bakes `scene` coarsely and compares. Light that is bounced between probes is interpolated between them, so the bake
/// has a bias of its own that falls with their spacing (veach_ajar: −3.0 % here, −1.8 % at half the spacing). `usual`: what
/// it may not exceed by more than four standard errors.
fn check(path: &Path, set: &[&str], usual: &Bias) {
    let scene = scene::load(path, &LoadOptions::default()).expect("the scene");
    let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
    let config = Config::default().with_overrides(&set).expect("the settings");
    let world = World::new(&scene, 1.0, config.materials.albedo_max).expect("Embree");
    let bake = |seed: u64| {
        let circumstances = Circumstances::quiet(seed);
        let record = SceneRecord { name: scene.name.clone(), blake3: scene.blake3.clone() };
        let prepared = prepare(&world, &config, &circumstances).expect("a grid");
        prepared.bake(&circumstances, &record).expect("a bake").volume
    };
    let volume = bake(3);
    let truth = Truth::trace(&world, &config.capture, &volume, 2, 5, Progress::hidden());

    let resolution = config.store.irradiance.fineness().resolution;
    // Three texels on either side of the map.
    let texels = [1, resolution * 3 + 2, resolution * 5 + 6, resolution * 7 + 3];
    let active: Vec<usize> = (0..truth.runs[0].len()).filter(|&p| !truth.runs[0][p].is_empty()).collect();
    let chosen: Vec<usize> = active.iter().copied().step_by(active.len().div_ceil(24)).collect();
    assert!(chosen.len() >= 12, "{} probes", chosen.len());
    let (mut beyond, mut count, mut differences) = (0, 0, Vec::new());
    let mut total = 0.0;
    for &p in &chosen {
        let mut sum = 0.0;
        for &o in &texels {
            let normal = texel_direction(o % resolution, o / resolution, resolution);
            let values: Vec<f64> = truth.runs.iter().map(|run| f64::from(luminance(run[p][o].into()))).collect();
            let (probe, probe_variance) = mean_and_variance(&values);
            let (point, point_variance) = traced(&world, volume.positions[p], normal, (p * 64 + o) as u64);
            let error = (probe_variance + point_variance).sqrt();
            beyond += usize::from((probe - point).abs() > 3.0 * error + QUADRATURE * point);
            count += 1;
            sum += probe - point;
            total += point;
        }
        differences.push(sum);
    }
    // With eight runs the difference has a t distribution of some seven degrees of freedom: 2 % of comparisons lie beyond
    // three standard errors; that as many as a tenth do happens once in 10⁴ sets of a hundred.
    assert!(beyond * 10 <= count, "{beyond} of {count} differ by more than three standard errors");
    // Probes are independent of each other: the mean over them, once in 200 beyond three standard errors for some 20.
    let (mean, variance) = mean_and_variance(&differences);
    let scale = total / chosen.len() as f64;
    assert!(
        mean.abs() <= 3.0 * variance.sqrt() + QUADRATURE * scale,
        "probes differ from points by {mean} ± {} of {scale}",
        variance.sqrt()
    );
    assert_eq!(truth.runs.len() as u64, RUNS);
    let (figures, _) = baked::measure(&volume, &truth);
    let bias = figures.bias.expect("there is light");
    // The parts make up the whole; the correction for noise is the same in both.
    let (light, dark) = (figures.light.expect("light"), figures.dark.expect("light"));
    assert!((light - dark - bias).abs() < 1e-9 + light.min(dark) * 1e-6, "{light} − {dark} ≠ {bias}");

    let own_bias = |seed: u64| {
        let volume = bake(seed);
        let truth = Truth::trace(&world, &config.capture, &volume, 2, seed + 2, Progress::hidden());
        baked::measure(&volume, &truth).0.bias.expect("there is light")
    };
    let others = (1..BAKES).map(|i| own_bias(3 + i));
    let biases: Vec<f64> = std::iter::once(bias).chain(others).collect();
    let mean = biases.iter().sum::<f64>() / biases.len() as f64;
    let error = usual.deviation * (1.0 / biases.len() as f64 + 1.0 / 24.0).sqrt();
    // Four standard errors: once in 30,000 if nothing has changed.
    let limit = usual.mean.abs() + 4.0 * error;
    assert!(mean.abs() <= limit, "the bake's own bias {mean} ± {error} is above {limit}; of the bakes {biases:?}");
}

pub fn cornell_probes_hold_what_paths_bring() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.glb");
    check(&path, &["grid.spacing_m=0.5"], &Bias { mean: -0.0105, deviation: 0.0035 });
}

pub fn probes_behind_a_door_ajar_hold_what_paths_bring() {
    let path = shared_scenes().join("veach_ajar/veach_ajar.glb");
    check(&path, &["grid.divisions=(8,4,8)"], &Bias { mean: -0.0300, deviation: 0.0095 });
}

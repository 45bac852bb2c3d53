//! What probes cost: asking them, filtering a capture into them, one bounce between them.
//!
//! `cargo bench` compares with its last run and prints the change; `scripts/bench.sh` prints the ratios within one run.
//! Scene: the open rooms at 1 m, one thread.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{Vec3, Vec3A};
use lightprobe::bake::{Baked, Circumstances, prepare};
use lightprobe::config::{Config, Layers};
use lightprobe::light::World;
use lightprobe::math::random::Purpose;
use lightprobe::probe::capture::{Capture, ProbeCapture};
use lightprobe::probe::file::SceneRecord;
use lightprobe::probe::query::{Query, QueryPoint, Visibility};
use lightprobe::probe::store::surface::Facing;
use lightprobe::probe::transport::operator::Operator;
use lightprobe::scene::{self, LoadOptions, Scene, TriangleIndex};

/// The methods whose look-ups are compared: name, preset, and the keys in which they differ from it.
const METHODS: [(&str, &str, &[&str]); 5] = [
    ("default", "default", &[]),
    ("physical", "physical", &[]),
    ("none", "physical", &["query.visibility=none"]),
    ("moments", "physical", &["query.visibility=moments(power: 3, floor: 0.05)"]),
    (
        "moments, wrap, crush, roots",
        "physical",
        &[
            "query.visibility=moments(power: 3, floor: 0.05)",
            "query.direction=wrap(offset: 0.2)",
            "query.crush_below=0.2",
            "query.blend=square_root",
            "query.normal_bias=0.05",
            "query.view_bias=0.18",
        ],
    ),
];

/// Points that ask in turn: more than fit into the second-level cache with their probes.
const POINTS: usize = 4096;

fn scene() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/two_rooms_open.glb");
    scene::load(&path, &LoadOptions::default()).expect("a scene of the project")
}

fn config(preset: &str, keys: &[&str]) -> Config {
    let keys = ["grid.spacing_m=1", "capture.resolution=16"].iter().chain(keys).map(|key| (*key).to_owned());
    let layers = Layers::of(Some(preset)).and_then(|layers| layers.set(&keys.collect::<Vec<_>>()));
    layers.and_then(|layers| layers.config()).expect("keys of the configuration")
}

fn bake(world: &World, config: &Config) -> Baked {
    let circumstances = Circumstances::quiet(1);
    let record = SceneRecord { name: String::new(), blake3: String::new() };
    let prepared = prepare(world, config, &circumstances).expect("a grid");
    prepared.bake(&circumstances, &record).expect("a bake")
}

/// Points on the scene's surfaces, in no order that a cache would like.
fn points(scene: &Scene) -> Vec<QueryPoint> {
    let mesh = &scene.mesh;
    let count = mesh.triangles.len();
    let point = |i: usize| {
        // Steps of the golden ratio and of the plastic number's square: spread evenly, far from each other in a row.
        let spread = |step: f64| (i as f64 * step).fract() as f32;
        let triangle = TriangleIndex((spread(0.618_034) * count as f32) as u32);
        let corners = mesh.corners(triangle);
        let (u, v) = (spread(0.754_878).sqrt(), spread(0.569_840));
        let position = corners[0] * (1.0 - u) + (corners[1] * (1.0 - v) + corners[2] * v) * u;
        let normal = mesh.geometric_normal(triangle);
        let view = (Vec3::Y - position).normalize_or_zero();
        QueryPoint { position, normal, geometric: normal, facing: Facing::of(normal), view }
    };
    (0..POINTS).map(point).collect()
}

fn query(criterion: &mut Criterion) {
    let scene = scene();
    let world = World::new(&scene, 1.0, 0.999).expect("Embree");
    let points = points(&scene);
    let mut group = criterion.benchmark_group("query");
    group.throughput(Throughput::Elements(POINTS as u64));
    for (name, preset, keys) in METHODS {
        let config = config(preset, keys);
        let volume = bake(&world, &config).volume;
        let query = Query { volume: &volume, settings: &config.query };
        group.bench_function(name, |bencher| {
            bencher.iter(|| points.iter().map(|p| query.irradiance(black_box(p), Visibility::Stored)).sum::<Vec3>());
        });
    }
}

fn filter_and_bounce(criterion: &mut Criterion) {
    let scene = scene();
    let world = World::new(&scene, 1.0, 0.999).expect("Embree");
    let config = config("physical", &[]);
    let mut volume = bake(&world, &config).volume;
    let capture = Capture {
        world: &world,
        settings: &config.capture,
        distance_clamp_m: None,
        hit_light: config.transport.hit_light(),
        expected: None,
        voxels: None,
        keeps_geometric: false,
        sees: false,
        shows: false,
        resampling: None,
        guide: None,
        counts: None,
        purpose: Purpose::Capture,
        seed: 1,
    };
    let captures: Vec<ProbeCapture> =
        (0..volume.states.len()).map(|p| capture.probe(p, volume.positions[p], |_| true)).collect();
    let kernel = volume.irradiance.kernel(&config.capture.rays.directions());
    let operator = Operator { captures: &captures, kernel: &kernel, query: &config.query, gathers_emission: false };
    let radiance: Vec<Vec3A> = (0..config.capture.rays.texels()).map(|t| Vec3A::splat(t as f32)).collect();
    let mut irradiance = vec![Vec3A::ZERO; kernel.rows()];
    let mut group = criterion.benchmark_group("probes");
    group.bench_function("filter", |bencher| {
        bencher.iter(|| kernel.irradiance(black_box(&radiance), &mut irradiance));
    });
    let masks = operator.masks(&volume);
    group.sample_size(20);
    group.bench_function("bounce", |bencher| bencher.iter(|| operator.apply(black_box(&volume), Some(&masks))));
    group.bench_function("emission", |bencher| bencher.iter(|| operator.add_emission(black_box(&mut volume))));
}

fn one_thread(criterion: &mut Criterion) {
    // Fails only when a pool stands already.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(1).build_global();
    query(criterion);
    filter_and_bounce(criterion);
}

criterion_group!(benches, one_thread);
criterion_main!(benches);

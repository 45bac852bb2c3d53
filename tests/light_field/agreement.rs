//! How many rays agree, and what they cost.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use glam::{UVec3, Vec3};
use lightprobe::light::World;
use lightprobe::math::random::{Numbers, Purpose, Random};
use lightprobe::math::sampling::{cosine_hemisphere, uniform_sphere};
use lightprobe::probe::Volume;
use lightprobe::probe::lattice::Grid;
use lightprobe::probe::lattice::grid::{Bounds, GridSettings};
use lightprobe::probe::query::march::{Reads, TraceSettings};
use lightprobe::probe::query::trace::{End, Order, Tracing};
use lightprobe::trace::Ray;

use crate::{load, volume};

/// Rays of a scene.
const RAYS: usize = 20_000;

/// Rays agree where both meet nothing, or both a surface at a distance that differs by no more than this share of the spacing,
/// or of the distance.
const APART: f32 = 0.05;

/// Points in the middles of so many equal parts of the scene's box: at its corners, where grids that cover it begin, probes would
/// stand within or behind its walls.
fn middles(world: &World, divisions: (u32, u32, u32)) -> Grid {
    let (low, high) = world.scene.mesh.bounds().expect("a scene with surfaces");
    let half = 0.5 * (high - low) / UVec3::from(divisions).as_vec3();
    let world_space = |corner: Vec3| (world.scene.origin_world + corner.as_dvec3()).into();
    let bounds = Some(Bounds { min: world_space(low + half), max: world_space(high - half) });
    let settings = GridSettings { bounds, divisions: Some(divisions), ..Default::default() };
    Grid::new(&settings, world.scene).unwrap()
}

/// Rays from surfaces, cosine-distributed, as shading sends them; `clearance` off the surfaces. Surfaces are those that random
/// rays from free places within the grid meet first.
fn rays(world: &World, grid: &Grid, clearance: f32) -> Vec<(Vec3, Vec3)> {
    let (low, high) = world.scene.mesh.bounds().unwrap_or(grid.hull(0.0));
    let ray = |i: u64| {
        let mut random = Random::new(11, Purpose::GlossyRays, i, 0);
        let place = Vec3::new(random.uniform(), random.uniform(), random.uniform());
        let (place, direction) = (low + (high - low) * place, uniform_sphere(random.pair()));
        let surface = world.surface(Ray::new(place, direction, 0))?;
        // From inside of solids, and the outside of a closed scene.
        let opposite = world.surface(Ray::new(place, -direction, 0))?;
        if surface.is_back() || opposite.is_back() {
            return None;
        }
        let normal = surface.geometric_normal;
        Some((surface.position + normal * clearance, cosine_hemisphere(normal, random.pair())))
    };
    (0..).filter_map(ray).take(RAYS).collect()
}

struct Figures {
    agree: f64,
    unknown: f64,
    median_m: f32,
    probes: f64,
    cells: f64,
    coarse: f64,
    fine: f64,
    order: f64,
    first_cell: f64,
    march_ns: f64,
    embree_ns: f64,
}

fn measure(world: &World, volume: &Volume, rays: &[(Vec3, Vec3)]) -> Figures {
    let settings = TraceSettings::default();
    let tracing = Tracing::new(volume, &settings).unwrap();
    let with = |order| {
        let mut other = tracing;
        other.order = order;
        other
    };
    let (other, first) =
        (with(Order { nearest: false, step: 5, ..Order::default() }), with(Order { cells: 1, ..Order::default() }));
    let spacing = volume.grid.spacing_max();
    let near = |a: f32, b: f32| (a - b).abs() <= APART * spacing.max(b);
    let exact = |&(o, d): &(Vec3, Vec3)| world.tracer.closest(Ray::new(o, d, 0)).map(|hit| hit.t);
    let truth: Vec<Option<f32>> = rays.iter().map(exact).collect();
    let agrees = |end: End, truth: Option<f32>| match (end, truth) {
        (End::Hit { t, .. }, Some(exact)) => near(t, exact),
        (End::Miss { .. }, None) => true,
        _ => false,
    };
    let same = |a: End, b: End| match (a, b) {
        (End::Hit { t: a, .. }, End::Hit { t: b, .. }) => near(a, b),
        (a, b) => std::mem::discriminant(&a) == std::mem::discriminant(&b),
    };
    let mut reads = Reads::default();
    let (mut agree, mut unknown, mut order, mut first_cell, mut probes, mut cells) = (0, 0, 0, 0, 0, 0);
    let mut apart = Vec::new();
    for (&(origin, direction), &truth) in rays.iter().zip(&truth) {
        let traced = tracing.trace(origin, direction, &mut reads);
        agree += u32::from(agrees(traced.end, truth));
        unknown += u32::from(matches!(traced.end, End::Lost { .. }));
        order += u32::from(!same(traced.end, other.trace(origin, direction, &mut Reads::default()).end));
        first_cell += u32::from(agrees(first.trace(origin, direction, &mut Reads::default()).end, truth));
        (probes, cells) = (probes + traced.probes, cells + traced.cells);
        if let (End::Hit { t, .. }, Some(exact)) = (traced.end, truth) {
            apart.push((t - exact).abs());
        }
    }
    apart.sort_by(f32::total_cmp);
    let started = Instant::now();
    for &(origin, direction) in rays {
        black_box(tracing.trace(origin, direction, &mut Reads::default()));
    }
    let march = started.elapsed();
    let started = Instant::now();
    for ray in rays {
        black_box(exact(ray));
    }
    let embree = started.elapsed();
    let share = |count: u32| f64::from(count) / rays.len() as f64;
    let per_ray = |count: u64| count as f64 / rays.len() as f64;
    Figures {
        agree: share(agree),
        unknown: share(unknown),
        median_m: apart.get(apart.len() / 2).copied().unwrap_or(f32::NAN),
        probes: share(probes),
        cells: share(cells),
        coarse: per_ray(reads.coarse),
        fine: per_ray(reads.fine),
        order: share(order),
        first_cell: share(first_cell),
        march_ns: march.as_secs_f64() * 1e9 / rays.len() as f64,
        embree_ns: embree.as_secs_f64() * 1e9 / rays.len() as f64,
    }
}

fn row(file: &str, divisions: (u32, u32, u32), side: usize) -> Figures {
    let scene = load(Path::new(file));
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let volume = volume(&world, middles(&world, divisions), side);
    let tracing = Tracing::new(&volume, &TraceSettings::default()).unwrap();
    let clearance = std::env::var("LIGHTPROBE_CLEARANCE").ok().and_then(|c| c.parse().ok());
    let clearance = clearance.map_or(tracing.clearance(), |share: f32| share * volume.grid.spacing_max());
    let rays = rays(&world, &volume.grid, clearance);
    let figures = measure(&world, &volume, &rays);
    let name = Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let (x, y, z) = divisions;
    println!(
        "| {name} | {x}×{y}×{z} | {side}² | {:.1} % | {:.1} % | {:.1} mm | {:.2} | {:.2} | {:.0} + {:.0} | {:.1} % | {:.1} % | {:.1} µs | {:.2} µs |",
        100.0 * figures.agree,
        100.0 * figures.unknown,
        1e3 * figures.median_m,
        figures.probes,
        figures.cells,
        figures.coarse,
        figures.fine,
        100.0 * figures.order,
        100.0 * figures.first_cell,
        figures.march_ns / 1e3,
        figures.embree_ns / 1e3,
    );
    figures
}

/// In a simple room most rays are found where they are, and a ray that asks every cell finds no fewer than one that asks its first.
#[test]
fn most_rays_end_where_the_scene_is() {
    let figures = row("scenes/cornell.glb", (3, 3, 3), 128);
    // Rays that graze surfaces, and those behind the boxes, are lost or end early; maps of 256² leave fewer.
    assert!(figures.agree > 0.6, "{}", figures.agree);
    assert!(figures.agree >= figures.first_cell, "{} and {}", figures.agree, figures.first_cell);
}

#[test]
#[ignore = "prints figures; minutes, and 13 MB a probe"]
fn figures_of_rays_in_probes() {
    let default = "scenes/cornell.glb:4,4,4 scenes/two_rooms_open.glb:7,3,4";
    let scenes = std::env::var("LIGHTPROBE_MARCH").unwrap_or_else(|_| default.to_owned());
    for entry in scenes.split_whitespace() {
        let (scene, divisions) = entry.rsplit_once(':').expect("SCENE:x,y,z");
        let divisions: Vec<u32> = divisions.split(',').map(|n| n.parse().expect("a number of points")).collect();
        for side in [256, 1024] {
            row(scene, (divisions[0], divisions[1], divisions[2]), side);
        }
    }
}

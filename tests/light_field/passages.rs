//! What probes on a grid miss (McGuire et al. 2017 name it as the method's weakness): surfaces in passages that are narrower than
//! the grid.

use std::path::Path;

use glam::Vec3;
use lightprobe::light::World;
use lightprobe::math::random::{Numbers, Purpose, Random};
use lightprobe::math::sampling::cosine_hemisphere;
use lightprobe::probe::Volume;
use lightprobe::probe::lattice::Grid;
use lightprobe::probe::lattice::grid::GridSettings;
use lightprobe::probe::query::march::{Reads, TraceSettings};
use lightprobe::probe::query::trace::{End, Tracing};
use lightprobe::scene::TriangleIndex;
use lightprobe::trace::Ray;
use rayon::prelude::*;

use crate::{load, volume};

/// Points of a scene, uniform by area.
const POINTS: u64 = 20_000;

/// Rays from each that decide whether it lies in a room, and as many that are traced in the probes.
const RAYS: usize = 16;

/// Texels per side of maps: grids of half the spacing have thousands of probes.
const SIDE: usize = 64;

/// How far points lie off their surfaces, as a share of the scene's diagonal: rays do not meet the surface itself.
const OFF: f32 = 1e-4;

/// A point that light of the rooms reaches.
struct Spot {
    position: Vec3,
    normal: Vec3,
    /// Free way along the normal, metres.
    width: f32,
}

/// Points on the fronts of surfaces in rooms: no ray from there meets a back, and at least half of them something.
fn spots(world: &World) -> Vec<Spot> {
    let mesh = &world.scene.mesh;
    let (low, high) = mesh.bounds().expect("a scene with surfaces");
    let mut areas = Vec::new();
    let mut sum = 0.0f64;
    for t in 0..mesh.triangles.len() as u32 {
        sum += f64::from(mesh.area(TriangleIndex(t)));
        areas.push(sum);
    }
    let spot = |i: u64| {
        let mut random = Random::new(23, Purpose::GlossyRays, i, 0);
        let at = sum * f64::from(random.uniform());
        let triangle = TriangleIndex(areas.partition_point(|&a| a <= at).min(areas.len() - 1) as u32);
        let [a, b, c] = mesh.corners(triangle);
        let (root, v) = (random.uniform().sqrt(), random.uniform());
        let normal = mesh.geometric_normal(triangle);
        let position = a * (1.0 - root) + (b * (1.0 - v) + c * v) * root + normal * (OFF * low.distance(high));
        let mut met = 0;
        for _ in 0..RAYS {
            match world.surface(Ray::new(position, cosine_hemisphere(normal, random.pair()), 0)) {
                Some(surface) if surface.is_back() => return None,
                Some(_) => met += 1,
                None => {}
            }
        }
        let width = world.tracer.closest(Ray::new(position, normal, 0)).map_or(f32::INFINITY, |hit| hit.t);
        (2 * met >= RAYS).then_some(Spot { position, normal, width })
    };
    (0..POINTS).into_par_iter().filter_map(spot).collect()
}

/// Shares of some points, and of rays from them.
struct Missed {
    points: usize,
    /// None of the eight probes around sees the point.
    unseen: f64,
    /// No probe knows where the ray ends.
    lost: f64,
}

fn missed<'s>(world: &World, volume: &Volume, spots: impl Iterator<Item = &'s Spot>) -> Missed {
    let tracing = Tracing::new(volume, &TraceSettings::default()).unwrap();
    let of_spot = |(i, spot): (u64, &Spot)| {
        let around = volume.grid.corners_around(&volume.grid.cell(spot.position));
        let hidden = |p| world.tracer.occluded(Ray::segment(spot.position, volume.position(p), 0));
        let mut random = Random::new(24, Purpose::GlossyRays, i, 0);
        let lost = |_: &usize| {
            let direction = cosine_hemisphere(spot.normal, random.pair());
            let origin = spot.position + spot.normal * tracing.clearance();
            matches!(tracing.trace(origin, direction, &mut Reads::default()).end, End::Lost { .. })
        };
        let lost = (0..RAYS).filter(lost).count();
        (around.into_iter().all(hidden), lost)
    };
    let (mut points, mut unseen, mut lost) = (0, 0, 0);
    for (hidden, rays) in (0..).zip(spots).map(of_spot) {
        (points, unseen, lost) = (points + 1, unseen + usize::from(hidden), lost + rays);
    }
    let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
    Missed { points, unseen: share(unseen, points), lost: share(lost, RAYS * points) }
}

/// What a grid of this spacing misses in all, and in passages narrower than `narrow` metres.
fn of_grid(world: &World, spots: &[Spot], spacing: f32, narrow: f32) -> [Missed; 2] {
    let settings = GridSettings { spacing_m: Some(spacing.into()), ..Default::default() };
    let volume = volume(world, Grid::new(&settings, world.scene).unwrap(), SIDE);
    let all = missed(world, &volume, spots.iter());
    let within = missed(world, &volume, spots.iter().filter(|spot| spot.width < narrow));
    print!("| {spacing} m | {} ", volume.positions.len());
    for part in [&all, &within] {
        print!("| {:.1} % | {:.1} % ", 100.0 * part.unseen, 100.0 * part.lost);
    }
    println!("|");
    [all, within]
}

/// The rows of a scene: its spacing and half of it; passages are narrow below the first.
fn rows(file: &str, spacing: f32) -> [[Missed; 2]; 2] {
    let scene = load(Path::new(file));
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let spots = spots(&world);
    let narrow = spots.iter().filter(|spot| spot.width < spacing).count() as f64 / spots.len() as f64;
    let name = Path::new(file).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    [spacing, spacing / 2.0].map(|own| {
        print!("| {name} | {:.1} % ", 100.0 * narrow);
        of_grid(&world, &spots, own, spacing)
    })
}

/// Passages are what a grid misses: points in them are hidden from all probes around more often than points elsewhere, and half
/// the spacing misses less.
#[test]
fn narrow_passages_are_missed() {
    let [[all, within], [finer, _]] = rows("scenes/office.glb", 1.0);
    assert!(all.points > 5_000 && within.points > 500, "{} and {} points", all.points, within.points);
    assert!(
        within.unseen > all.unseen && finer.unseen < all.unseen,
        "{} {} {}",
        within.unseen,
        all.unseen,
        finer.unseen
    );
}

#[test]
#[ignore = "prints figures; minutes"]
fn figures_of_narrow_passages() {
    let default = "scenes/two_rooms_open.glb:1 scenes/thin_wall.glb:0.75 scenes/office.glb:1";
    let scenes = std::env::var("LIGHTPROBE_PASSAGES").unwrap_or_else(|_| default.to_owned());
    for entry in scenes.split_whitespace() {
        let (scene, spacing) = entry.rsplit_once(':').expect("SCENE:spacing");
        rows(scene, spacing.parse().expect("a spacing in metres"));
    }
}

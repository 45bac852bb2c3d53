//! Rays in light fields: a room whose hits are known, cells after cells, and maps that hold anything.

use std::collections::HashSet;

use glam::{DVec3, UVec3, Vec2, Vec3};

use crate::math::blocks::Block;
use crate::math::octahedral::{oct_from_direction, texel_direction};
use crate::math::random::{Numbers, Purpose, Random};
use crate::math::sampling::uniform_sphere;
use crate::probe::Volume;
use crate::probe::lattice::{Grid, ProbeState};
use crate::probe::query::march::{self, Reads, TraceSettings};
use crate::probe::query::trace::{End, Order, Tracing, most_reads};
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::radiance::{FAR_M, LightField, Radiance, lowest_of};
use crate::probe::store::{IrradianceStore, Occlusion};

/// Probes 1 m apart; each sees what `seen` says of its place and a direction: a distance and a normal.
fn volume(divisions: UVec3, side: usize, coarse: usize, seen: impl Fn(usize, Vec3, Vec3) -> (f32, Vec3)) -> Volume {
    let grid = Grid::from_parts(DVec3::ZERO, Vec3::ONE, divisions).unwrap();
    let positions: Vec<Vec3> = grid.probes().map(|p| grid.grid_point(p)).collect();
    let texels = side * side;
    let (mut distance, mut normal, mut lowest) = (Vec::new(), Vec::new(), Vec::new());
    for (p, position) in positions.iter().enumerate() {
        let of_texel = |o: usize| seen(p, *position, texel_direction(o % side, o / side, side));
        let (distances, normals): (Vec<f32>, Vec<Vec3>) = (0..texels).map(of_texel).unzip();
        lowest.extend(lowest_of(&distances, side, coarse));
        distance.extend(distances);
        normal.extend(normals.into_iter().map(oct_from_direction));
    }
    let probes = positions.len();
    let field = LightField {
        radiance: OctahedralMaps::new(probes, side, 0, Vec3::ONE),
        normal: OctahedralMaps { resolution: side, border: 0, texels: normal },
        distance: OctahedralMaps { resolution: side, border: 0, texels: distance },
        lowest: Some(OctahedralMaps { resolution: coarse, border: 0, texels: lowest }),
    };
    Volume {
        states: vec![ProbeState::Active; probes],
        positions,
        irradiance: IrradianceStore::default().zeros(probes, 1),
        occlusion: Occlusion::None,
        radiance: Radiance { light_field: Some(field), ..Default::default() },
        layout: Default::default(),
        grid,
    }
}

/// Where a ray from within a box meets its walls, and their normal.
fn leaves(origin: Vec3, direction: Vec3, low: Vec3, high: Vec3) -> (f32, Vec3) {
    let wall = |axis: usize| {
        let face = if direction[axis] > 0.0 { high[axis] } else { low[axis] };
        let t = if direction[axis] == 0.0 { f32::INFINITY } else { (face - origin[axis]) / direction[axis] };
        (t, -Vec3::AXES[axis] * direction[axis].signum())
    };
    (0..3).map(wall).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

fn rays(count: u32, low: Vec3, high: Vec3) -> impl Iterator<Item = (Vec3, Vec3)> {
    (0..count).map(move |i| {
        let mut random = Random::new(3, Purpose::GlossyRays, u64::from(i), 0);
        let place = Vec3::new(random.uniform(), random.uniform(), random.uniform());
        (low + (high - low) * place, uniform_sphere(random.pair()))
    })
}

/// A room without anything in it: every probe sees every wall, and the first that is asked must find it where it is.
#[test]
fn rays_in_an_empty_room_end_at_its_walls() {
    let (low, high) = (Vec3::splat(-0.4), Vec3::new(2.4, 1.4, 1.4));
    let (side, coarse) = (256, 16);
    let volume = volume(UVec3::new(3, 2, 2), side, coarse, |_, p, d| leaves(p, d, low, high));
    let tracing = Tracing::new(&volume, &TraceSettings::default()).unwrap();
    let (mut agree, mut count, mut errors) = (0, 0, Vec::new());
    for (origin, direction) in rays(2000, low + 0.05, high - 0.05) {
        let exact = leaves(origin, direction, low, high).0;
        let traced = tracing.trace(origin, direction, &mut Reads::default());
        count += 1;
        if let End::Hit { t, .. } = traced.end {
            errors.push((t - exact).abs());
            agree += u32::from((t - exact).abs() < 0.1);
        }
    }
    errors.sort_by(f32::total_cmp);
    let median = errors[errors.len() / 2];
    println!("{agree} of {count} agree, median error {median}");
    // A texel is 2/256·π/2 = 0.012 rad wide and walls are 0.4 to 2.4 m away: half of it is 0.015 m at most across the ray.
    assert!(median < 0.015, "{median}");
    // Rays that graze a wall meet the stairs that its texels make of it.
    assert!(f64::from(agree) > 0.97 * f64::from(count), "{agree} of {count}");
}

/// Every probe sees 1.2 m far, and backs there: it tells nothing of what lies beyond. A ray along a row of probes is handed on
/// from cell to cell, up to where the last sees.
#[test]
fn every_cell_along_a_ray_is_asked() {
    let volume = volume(UVec3::new(6, 2, 2), 64, 8, |_, _, d| (1.2, d));
    let mut tracing = Tracing::new(&volume, &TraceSettings::default()).unwrap();
    let (origin, direction) = (Vec3::new(0.1, 0.1, 0.1), Vec3::X);
    let traced = tracing.trace(origin, direction, &mut Reads::default());
    let End::Lost { clear, .. } = traced.end else { panic!("{traced:?}") };
    // The last probe stands at 5; a texel of 64² is 0.05 rad wide.
    assert!((5.9..6.25).contains(&(clear + 0.1)), "{clear}");
    assert_eq!(traced.cells, 5);
    tracing.order = Order { cells: 1, ..Order::default() };
    let first = tracing.trace(origin, direction, &mut Reads::default());
    let End::Lost { clear, .. } = first.end else { panic!("{first:?}") };
    assert!(clear < 2.3 && first.cells == 1, "{clear}");
    // Faces in place of backs: the first that is asked finds one.
    let faces = self::volume(UVec3::new(6, 2, 2), 64, 8, |_, _, d| (1.2, -d));
    let tracing = Tracing::new(&faces, &TraceSettings::default()).unwrap();
    let End::Hit { t, probe, .. } = tracing.trace(origin, direction, &mut Reads::default()).end else { panic!() };
    assert!((t - 1.1).abs() < 0.05 && probe.0 == 0, "{t}");
}

/// What is not there is a miss, and probes that do not count are not asked.
#[test]
fn empty_space_and_dead_probes() {
    let mut volume = volume(UVec3::splat(2), 32, 4, |p, _, d| if p == 0 { (0.1, d) } else { (FAR_M, -d) });
    let tracing = Tracing::new(&volume, &TraceSettings::default()).unwrap();
    let traced = tracing.trace(Vec3::splat(0.1), Vec3::Y, &mut Reads::default());
    assert!(matches!(traced.end, End::Miss { probe } if probe.0 == 3) && traced.probes == 2, "{traced:?}");
    volume.states[3] = ProbeState::InsideGeometry;
    let tracing = Tracing::new(&volume, &TraceSettings::default()).unwrap();
    let traced = tracing.trace(Vec3::splat(0.1), Vec3::Y, &mut Reads::default());
    assert!(matches!(traced.end, End::Miss { probe } if probe.0 == 6) && traced.probes == 2, "{traced:?}");
    volume.states.fill(ProbeState::InsideGeometry);
    let tracing = Tracing::new(&volume, &TraceSettings::default()).unwrap();
    let traced = tracing.trace(Vec3::splat(0.1), Vec3::Y, &mut Reads::default());
    assert!(matches!(traced.end, End::Lost { .. }) && traced.probes == 0, "{traced:?}");
}

/// Maps that hold anything, by name: zeros, no surface anywhere, one distance, noise of all magnitudes, infinities, any of
/// these in every texel, and a near texel in every block below far ones, so that all blocks are looked into.
fn odd_volumes(side: usize, coarse: usize) -> Vec<(&'static str, Volume)> {
    let noise = |p: usize, d: Vec3| {
        let bits = d.to_array().map(f32::to_bits);
        let name = u64::from(bits[0]) << 32 | u64::from(bits[1]);
        Block::new(9, Purpose::GlossyRays, name, u64::from(bits[2]) + p as u64).sample(0)
    };
    let any = |p: usize, d: Vec3, low: f32, high: f32| {
        let mut numbers = noise(p, d);
        ((low + (high - low) * numbers.uniform()).exp2(), uniform_sphere(numbers.pair()))
    };
    let mixed = |p: usize, d: Vec3| {
        let (distance, normal) = any(p, d, -20.0, 10.0);
        let kind = (normal.x.abs() * 1e4) as usize % 5;
        ([0.0, FAR_M, f32::INFINITY, 1.0, distance][kind], normal)
    };
    let block = side / coarse;
    let is_corner = |d: Vec3| {
        let texel = ((oct_from_direction(d) * 0.5 + 0.5) * side as f32).as_uvec2() % block as u32;
        texel.element_sum() == 0
    };
    let grid = UVec3::new(4, 3, 3);
    let of = |seen: &dyn Fn(usize, Vec3) -> (f32, Vec3)| volume(grid, side, coarse, |p, _, d| seen(p, d));
    vec![
        ("zeros", of(&|_, _| (0.0, Vec3::Z))),
        ("no surface", of(&|_, d| (FAR_M, -d))),
        ("infinities", of(&|_, d| (f32::INFINITY, -d))),
        ("backs at 1 m", of(&|_, d| (1.0, d))),
        ("fronts at 1 m", of(&|_, d| (1.0, -d))),
        ("noise, 0.25 to 4 m", of(&|p, d| any(p, d, -2.0, 2.0))),
        ("noise, 1 nm to 32 km", of(&|p, d| any(p, d, -30.0, 15.0))),
        // Behind whatever is asked, and rarely before.
        ("backs at 2 to 8 m", of(&|p, d| (any(p, d, 1.0, 3.0).0, d))),
        ("any of these", of(&mixed)),
        ("a near texel a block", of(&|_, d| (if is_corner(d) { 0.0 } else { FAR_M }, d))),
    ]
}

/// Rays through such maps, some along axes and through probes; each must end within the bound. Returns the most that any
/// reads, as a share of the bound.
fn all_end(count: u32, side: usize, coarse: usize) -> f64 {
    let mut share = 0.0f64;
    for (name, volume) in &odd_volumes(side, coarse) {
        let tracing = Tracing::new(volume, &TraceSettings::default()).unwrap();
        let most = most_reads(volume, side, coarse);
        let mut largest = 0;
        let mut ends = HashSet::new();
        for (i, (origin, direction)) in rays(count, Vec3::splat(-1.0), Vec3::splat(4.0)).enumerate() {
            let (origin, direction) = match i % 8 {
                0 => (origin, Vec3::AXES[i / 8 % 3]),
                1 => (origin.round(), direction),
                2 => (origin.round(), -Vec3::AXES[i / 8 % 3]),
                3 => (origin, (origin.round() - origin).normalize_or(Vec3::Y)),
                4 => (origin * 1e4, direction),
                _ => (origin, direction),
            };
            let mut reads = Reads::default();
            let traced = tracing.trace(origin, direction, &mut reads);
            largest = largest.max(reads.all());
            assert!(reads.all() <= most, "{name}, ray {i}: {} reads of at most {most}", reads.all());
            ends.insert(std::mem::discriminant(&traced.end));
        }
        println!("{name}: {count} rays, at most {largest} reads of {most}, {} kinds of ends", ends.len());
        share = share.max(largest as f64 / most as f64);
    }
    share
}

/// 10⁵ rays in all. A bound that no ray comes near would say little: some read a hundredth of it, which is for rays that ask
/// eight probes in each of five cells, and cross all of every map.
#[test]
fn every_walk_ends() {
    let share = all_end(10_000, 64, 8);
    assert!(share > 0.01, "{share}");
}

/// 10⁷ rays in all, over larger maps.
#[test]
#[ignore = "minutes"]
fn ten_million_walks_end() {
    let started = std::time::Instant::now();
    let share = all_end(1_000_000, 256, 16);
    println!("{share:.3} of the bound at most, {:.0} s", started.elapsed().as_secs_f64());
}

/// The bound of one march by hand: a level of 4² over maps of 16² has two columns and two rows a quarter, of which a line meets
/// three at most, and four columns and four rows of texels below each, of which it meets seven.
#[test]
fn bounds_by_hand() {
    assert_eq!(march::most_reads(16, 4), 4 * 3 * (1 + 7));
    assert_eq!(march::most_reads(1024, 64), 8064);
    // Three cells along one axis, one along the others: at most three in all, with eight probes each.
    let volume = volume(UVec3::new(4, 2, 1), 16, 4, |_, _, d| (1.0, d));
    assert_eq!(most_reads(&volume, 16, 4), 3 * 8 * 96);
}

/// The level of lowest distances changes nothing of what a march finds: the same with one texel of each.
#[test]
fn both_levels_find_what_one_does() {
    let seen = |p: usize, position: Vec3, d: Vec3| {
        let walls = leaves(position, d, Vec3::splat(-0.6), Vec3::splat(1.7));
        // A pillar in the room, as each probe sees it.
        let pillar = Vec3::new(0.5, 0.4, 0.6) - position;
        let near = d.dot(pillar.normalize()) > 0.97;
        if near && p != 7 { (pillar.length() - 0.1, -d) } else { walls }
    };
    let both = volume(UVec3::splat(2), 64, 8, seen);
    let one = volume(UVec3::splat(2), 64, 64, seen);
    let tracings = [&both, &one].map(|volume| Tracing::new(volume, &TraceSettings::default()).unwrap());
    let mut differ = 0;
    for (origin, direction) in rays(1000, Vec3::splat(-0.5), Vec3::splat(1.6)) {
        let ends = tracings.map(|t| t.trace(origin, direction, &mut Reads::default()).end);
        let same = match ends {
            [End::Hit { t: a, .. }, End::Hit { t: b, .. }] => (a - b).abs() < 0.05,
            [a, b] => std::mem::discriminant(&a) == std::mem::discriminant(&b),
        };
        differ += u32::from(!same);
    }
    // Rounding decides which texel a line meets at a corner.
    assert!(differ <= 5, "{differ} of 1000 rays differ");
}

#[test]
fn normals_take_part() {
    let volume = volume(UVec3::splat(2), 32, 4, |_, _, _| (0.5, Vec3::X));
    let normal = volume.radiance.light_field.as_ref().unwrap().normal.probe(0)[0];
    assert_eq!(normal, Vec2::X);
    let tracing = Tracing::new(&volume, &TraceSettings::default()).unwrap();
    // Against the normal a ray hits; along it, it does not know.
    let hits =
        |direction| matches!(tracing.trace(Vec3::splat(0.01), direction, &mut Reads::default()).end, End::Hit { .. });
    assert!(hits(Vec3::NEG_X) && !hits(Vec3::X));
}

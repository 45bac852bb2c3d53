//! Fits whose answer is known: linear fields, dense solutions, a furnace; and which points count.

mod solving;

use std::f32::consts::PI;

use glam::{DVec3, UVec3, Vec2, Vec3, Vec3A};
use nalgebra::{DMatrix, DVector};

use super::points::asked_in_air;
use super::*;
use crate::math::random::{Purpose, Random};
use crate::math::sampling::uniform_sphere;
use crate::probe::Grid;
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::GridSettings;
use crate::probe::query::{DirectionWeight, LookUp, Query, QueryPoint, Visibility, VisibilityTest, WeightNormal};
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::irradiance::OctahedralStore;
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::sh::ShStore;
use crate::probe::store::{IrradianceStore, Occlusion};
use crate::scene::{self, LoadOptions, Scene};

fn random(index: u64) -> Random {
    Random::new(5, Purpose::FitPoints, 9, index)
}

fn in_box(random: &mut Random) -> Vec3 {
    Vec3::new(random.uniform(), random.uniform(), random.uniform())
}

fn direction(random: &mut Random) -> Vec3 {
    uniform_sphere(Vec2::new(random.uniform(), random.uniform()))
}

/// 3 × 3 × 3 black probes, 2, 4 and 1 m apart.
fn volume(store: &IrradianceStore) -> Volume {
    let grid = Grid::from_parts(DVec3::new(1.0, -1.0, 3.0), Vec3::new(2.0, 4.0, 1.0), UVec3::splat(3)).unwrap();
    let (grid, _) = grid.relative_to(DVec3::ZERO);
    let count = grid.probe_count();
    Volume {
        states: vec![ProbeState::Active; count],
        positions: grid.probes().map(|probe| grid.grid_point(probe)).collect(),
        irradiance: store.zeros(count, 1),
        occlusion: Occlusion::None,
        radiance: Default::default(),
        layout: Default::default(),
        grid,
    }
}

fn octahedral(resolution: usize) -> IrradianceStore {
    let store = OctahedralStore { resolution, format: ColorFormat::F32, ..OctahedralStore::default() };
    IrradianceStore::Octahedral(store)
}

fn harmonics(presampled: Option<usize>, gradient: bool) -> IrradianceStore {
    IrradianceStore::Sh9(ShStore { format: ColorFormat::F32, presampled, gradient })
}

fn untested() -> QuerySettings {
    QuerySettings { test: VisibilityTest::None, ..QuerySettings::default() }
}

/// A point of the volume's inside.
fn inside(volume: &Volume, random: &mut Random) -> QueryPoint {
    let (low, high) = volume.grid.hull(0.0);
    let position = low + (high - low) * in_box(random);
    let point = asked_in_air(position, direction(random)).query;
    QueryPoint { view: direction(random), geometric: direction(random), ..point }
}

#[test]
fn rows_are_the_look_up() {
    let stores =
        [octahedral(4), octahedral(1), harmonics(None, false), harmonics(None, true), harmonics(Some(5), false)];
    let biased = QuerySettings { normal_bias: 0.2, view_bias: 0.1, ..untested() };
    let ddgi = QuerySettings {
        direction: DirectionWeight::Wrap { offset: 0.2 },
        test: VisibilityTest::Chebyshev { power: 3.0, floor: 0.05 },
        trilinear_floor: 0.001,
        crush_below: 0.2,
        ..biased.clone()
    };
    let geometric = DirectionWeight::Eccentric { kappa: 0.9 };
    let towards = QuerySettings {
        direction: geometric,
        weight_normal: WeightNormal::Geometric,
        look_up: LookUp::Towards,
        ..ddgi.clone()
    };
    for store in &stores {
        for (settings, has_moments) in [(&biased, false), (&ddgi, true), (&towards, true)] {
            let mut volume = volume(store);
            let mut random = random(1);
            let unknowns = volume.irradiance.fitted_unknowns();
            for p in 0..27 {
                // The mean is so much larger than the rest that no sum is negative.
                let own = |u: usize, r: Vec3| Vec3A::from(if u == 0 { r + 30.0 } else { r });
                let of_maps = |r: Vec3| Vec3A::from(r + 1.0);
                let is_map = volume.irradiance.signed().is_none();
                let values: Vec<Vec3A> = (0..unknowns)
                    .map(|u| if is_map { of_maps(in_box(&mut random)) } else { own(u, in_box(&mut random)) })
                    .collect();
                volume.irradiance.set_fitted(p, &values);
                let back = volume.irradiance.fitted(p);
                assert!(back.iter().zip(&values).all(|(a, b)| (*a - *b).abs().max_element() < 1e-4), "{back:?}");
                // A probe that has moved.
                volume.positions[p] += 0.3 * direction(&mut random);
            }
            volume.states[13] = ProbeState::InsideGeometry;
            if has_moments {
                let mut maps = OctahedralMaps::new(27, 4, 1, Vec2::new(1.5, 0.5));
                maps.texels.iter_mut().for_each(|t| *t *= 0.5 + random.uniform());
                volume.occlusion = Occlusion::Moments(maps);
            }
            let x: Vec<DVec3> =
                (0..27).flat_map(|p| volume.irradiance.fitted(p)).map(|x| Vec3::from(x).as_dvec3()).collect();
            let asked: Vec<Asked> = (0..200)
                .map(|_| {
                    let point = inside(&volume, &mut random);
                    Asked { query: point, visibility: Visibility::Stored, ..asked_in_air(point.position, point.normal) }
                })
                .collect();
            let rows = asked.iter().map(|asked| Row::of(settings, &volume, asked, Vec3::ZERO));
            let factors = volume.irradiance.factors();
            let found = Rows::new(&factors, 27, unknowns, rows).times(&x);
            let query = Query { volume: &volume, settings };
            for (asked, found) in asked.iter().zip(found) {
                let looked_up = query.irradiance(&asked.query, Visibility::Stored);
                // Sums of some hundred products in f32, of which the largest are thirty times the result's differences.
                let off = (found.as_vec3() / looked_up - 1.0).abs().max_element();
                assert!(off < 2e-5, "{store:?} {settings:?}: {found} {looked_up}");
            }
        }
    }
}

/// Rows of a function at points of the inside.
fn rows_of(volume: &Volume, count: u64, field: impl Fn(Vec3, Vec3) -> Vec3) -> Vec<Row> {
    let settings = untested();
    (0..count)
        .map(|i| {
            let QueryPoint { position, normal, .. } = inside(volume, &mut random(100 + i));
            let asked = asked_in_air(position, normal);
            Row::of(&settings, volume, &asked, field(position, normal))
        })
        .collect()
}

#[test]
fn a_linear_field_is_fitted_exactly() {
    // Trilinear weights reproduce what is linear in space, nine functions what is linear in the direction.
    let slope = Vec3::new(0.5, -0.25, 1.0);
    let even = |x: Vec3| 20.0 + slope.dot(x);
    let field = |x: Vec3, n: Vec3| even(x) * Vec3::new(1.0, 2.0, 0.5) + Vec3::new(1.0, 0.0, -2.0) * n.z + n.x;
    let settings = RowSettings { lambda: 1e-6, iterations: 400, ..RowSettings::default() };
    for store in [harmonics(None, false), harmonics(None, true)] {
        let mut volume = volume(&store);
        // Each fit begins with the last one's values and solves for what it has left.
        for _ in 0..4 {
            let rows = rows_of(&volume, 6000, field);
            fit_rows(&mut volume, rows.into_iter(), &settings);
        }
        let query = Query { volume: &volume, settings: &untested() };
        for i in 0..500 {
            let point = inside(&volume, &mut random(10_000 + i));
            let (found, expected) = (query.irradiance(&point, Visibility::Off), field(point.position, point.normal));
            // A solver stops at 1e-4 of the gradient that it begins with, four do at 1e-16 but for the rounding of f32.
            assert!((found / expected - 1.0).abs().max_element() < 1e-3, "{store:?}: {found} {expected}");
        }
    }
}

#[test]
fn the_prior_rules_what_no_row_asks_for_and_all_where_lambda_is_large() {
    let values = |p: usize, u: usize| Vec3A::splat(1.0 + p as f32 + 0.1 * u as f32);
    for (lambda, changes) in [(1e9, false), (0.3, true)] {
        let mut volume = volume(&octahedral(4));
        (0..27).for_each(|p| volume.irradiance.set_fitted(p, &(0..16).map(|u| values(p, u)).collect::<Vec<_>>()));
        let before = volume.clone();
        // Points of the first cell alone, which ask upwards.
        let low = volume.grid.hull(0.0).0;
        let asked = |i: u64| asked_in_air(low + volume.grid.spacing() * in_box(&mut random(i)), Vec3::Z);
        let rows: Vec<Row> = (0..300).map(|i| Row::of(&untested(), &volume, &asked(i), Vec3::splat(50.0))).collect();
        fit_rows(&mut volume, rows.into_iter(), &RowSettings { lambda, ..RowSettings::default() });
        let first_cell = [0, 1, 3, 4, 9, 10, 12, 13];
        for p in 0..27 {
            let pairs = before.irradiance.fitted(p).into_iter().zip(volume.irradiance.fitted(p));
            let most = pairs.map(|(a, b)| (b / a - 1.0).abs().max_element()).fold(0.0, f32::max);
            let may_change = changes && first_cell.contains(&p);
            assert_eq!(most > 1e-5, may_change, "lambda {lambda}, probe {p}: {most}");
        }
        // −Z is the corner of the map, far from all texels that count.
        assert_eq!(volume.irradiance.of(0, Vec3::NEG_Z), before.irradiance.of(0, Vec3::NEG_Z));
    }
}

#[test]
fn blocks_are_the_rows_times_themselves() {
    for (store, has) in [(harmonics(None, true), true), (octahedral(4), true), (octahedral(5), false)] {
        let volume = volume(&store);
        let unknowns = volume.irradiance.fitted_unknowns();
        let rows = rows_of(&volume, 500, |x, _| x);
        let factors = volume.irradiance.factors();
        let rows = Rows::new(&factors, 27, unknowns, rows.into_iter());
        let Some(normal) = normal::Normal::new(&rows) else {
            assert!(!has);
            continue;
        };
        let x: Vec<DVec3> = (0..27 * unknowns as u64).map(|i| direction(&mut random(i)).as_dvec3()).collect();
        let expected = rows.transposed_times(&rows.times(&x));
        let largest = expected.iter().map(|e| e.abs().max_element()).fold(0.0, f64::max);
        for (found, expected) in normal.times(&x).iter().zip(&expected) {
            // Products of shares and factors are rounded to f32, some hundred a sum.
            assert!((*found - *expected).abs().max_element() < 1e-6 * largest, "{found} {expected}");
        }
    }
}

fn load(name: &str) -> Scene {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.glb"));
    scene::load(&path, &LoadOptions::default()).unwrap()
}

fn over(scene: &Scene, spacing_m: f64, store: &IrradianceStore) -> Volume {
    let grid = Grid::new(&GridSettings { spacing_m: Some(spacing_m), ..GridSettings::default() }, scene).unwrap();
    let count = grid.probe_count();
    let positions: Vec<Vec3> = grid.probes().map(|probe| grid.grid_point(probe)).collect();
    // Those beyond the outer walls do not count.
    let (low, high) = scene.mesh.bounds().unwrap();
    let state = |p: &Vec3| match p.cmpgt(low).all() && p.cmplt(high).all() {
        true => ProbeState::Active,
        false => ProbeState::InsideGeometry,
    };
    Volume {
        states: positions.iter().map(state).collect(),
        positions,
        irradiance: store.zeros(count, 1),
        occlusion: Occlusion::None,
        radiance: Default::default(),
        layout: Default::default(),
        grid,
    }
}

#[test]
fn rows_that_ask_through_walls_are_dropped() {
    let scene = load("two_rooms_sealed");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let volume = over(&scene, 1.0, &harmonics(None, false));
    let settings = RowSettings { rows_per_probe: 8, ..RowSettings::default() };
    let asked = points::all(&world, &Query { volume: &volume, settings: &untested() }, &settings);
    let query = Query { volume: &volume, settings: &untested() };
    // A wall stands at x = 0, 0.1 m thick.
    let across = |asked: &Asked| {
        let weights = query.weights(&asked.query, asked.visibility);
        let beyond = |probe: usize| volume.positions[probe].x * asked.query.position.x < 0.0;
        let of = |(p, w): (&crate::probe::ProbeIndex, f32)| if beyond(p.0 as usize) { w } else { 0.0 };
        weights.probes.iter().zip(weights.weights).map(of).sum::<f32>() / weights.total()
    };
    let inside = |asked: &&Asked| asked.query.position.x.abs() > 0.05;
    for kind in [Kind::Surface, Kind::Bent, Kind::Air] {
        let own = || asked.iter().filter(|a| a.kind == kind).filter(inside);
        assert!(own().filter(|a| a.is_fitted).count() > 100, "{kind:?}");
        let most = own().filter(|a| a.is_fitted).map(across).fold(0.0, f32::max);
        assert!(most <= 0.01, "{kind:?}: {most} of a row's weight lies beyond the wall");
        // Rays tell of the air; nothing does of surfaces.
        assert_eq!(own().any(|a| across(a) > 0.01 && !a.is_fitted), kind != Kind::Air, "{kind:?}");
    }
    // One in ten judges.
    let held = asked.iter().filter(|a| a.is_held_out).count() as f64 / asked.len() as f64;
    assert!((held - 0.1).abs() < 0.01, "{held}");
}

#[test]
fn a_furnace_is_fitted_to_its_closed_form() {
    // Walls emit 1 and reflect a half: 2π everywhere, in every direction, in the air too. Probes begin black.
    let scene = load("furnace");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    for store in [octahedral(4), harmonics(None, true)] {
        let mut volume = over(&scene, 0.7, &store);
        let rows = RowSettings { rows_per_probe: 100, lambda: 1e-6, air: 0.3, paths: 32, ..RowSettings::default() };
        let figures = run(&Fit::Rows(rows), &world, &untested(), &mut volume, 1, &mut (), |_| ()).unwrap();
        assert_eq!(figures.non_finite, 0);
        assert!(figures.held_out_before.unwrap() > 0.99 && figures.held_out_bent_before.unwrap() > 0.99, "{figures:?}");
        // Paths end by chance: one has a deviation of about a half of the mean, 100 rows of 32 paths a probe 1 %.
        assert!(figures.held_out_after.unwrap() < 0.04 && figures.air_after.unwrap() < 0.06, "{figures:?}");
        let query = Query { volume: &volume, settings: &untested() };
        let mean: f32 = (0..500)
            .map(|i| query.irradiance(&inside(&volume, &mut random(i)), Visibility::Off).x / (2.0 * PI) / 500.0)
            .sum();
        // Directions that hardly anything asks outer probes for stay dark.
        assert!((mean - 1.0).abs() < 0.03, "{store:?}: {mean}");
    }
}

/// Probes without light err by the targets themselves: the root of the mean product of both runs, ÷ their mean.
#[test]
fn held_out_points_of_each_kind_have_figures_of_their_own() {
    let volume = volume(&octahedral(4));
    let query = Query { volume: &volume, settings: &untested() };
    let figures = |points: &[(Kind, bool, [f32; 2])]| {
        let mut random = random(0);
        let ask = |&(kind, is_held_out, _): &(Kind, bool, [f32; 2])| Asked {
            kind,
            is_held_out,
            ..asked_in_air(inside(&volume, &mut random).position, Vec3::Y)
        };
        let asked: Vec<Asked> = points.iter().map(ask).collect();
        let targets: Vec<_> = points
            .iter()
            .map(|(.., runs)| targets::Target { runs: runs.map(Vec3::splat), noise: 0.0, paths: 16 })
            .collect();
        figures::residuals(&query, &asked, &targets)
    };
    let surface = [(Kind::Surface, true, [1.0, 1.0]), (Kind::Surface, true, [3.0, 3.0])];
    let bent = [(Kind::Bent, true, [2.0, 2.0]), (Kind::Bent, true, [4.0, 6.0]), (Kind::Bent, false, [90.0, 90.0])];
    let air = [(Kind::Air, true, [1.0, 4.0])];
    let found = figures(&[&surface[..], &bent, &air].concat());
    let is_near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-12;
    assert!(is_near(found.surface, 5f64.sqrt() / 2.0), "{found:?}");
    assert!(is_near(found.bent, 14f64.sqrt() / 3.5), "{found:?}");
    assert!(is_near(found.air, 2.0 / 2.5), "{found:?}");
    assert_eq!(figures(&surface).bent, None);
}

#[test]
fn scarce_rows_have_more_paths_and_light_ones_fewer() {
    // 150/38 = 3.95 times as many where there are 38.
    for (rows_per_probe, paths) in
        [(150, [[2, 10], [2, 5], [2, 2]]), (300, [[2, 10], [2, 5], [2, 2]]), (38, [[8, 40], [8, 20], [8, 8]])]
    {
        let settings = RowSettings { rows_per_probe, ..RowSettings::default() };
        assert_eq!([Kind::Surface, Kind::Bent, Kind::Air].map(|kind| settings.paths(kind)), paths);
    }
}

#[test]
fn threads_make_no_difference_and_seeds_do() {
    let scene = load("two_rooms_open");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let fitted = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut volume = over(&scene, 2.0, &harmonics(None, true));
        let rows = RowSettings { rows_per_probe: 20, paths: 4, ..RowSettings::default() };
        let figures =
            pool.install(|| run(&Fit::Rows(rows), &world, &untested(), &mut volume, seed, &mut (), |_| ())).unwrap();
        (volume.irradiance, figures.record())
    };
    let one = fitted(1, 3);
    assert!(one == fitted(2, 3) && one == fitted(3, 3));
    assert!(one.0 != fitted(1, 4).0);
}

/// What a fit before has kept.
#[derive(Default)]
struct Memory {
    blocks: std::collections::BTreeMap<u32, Vec<u8>>,
    kept: usize,
}

impl Traced for Memory {
    fn known(&mut self, block: u32) -> Option<Vec<u8>> {
        self.blocks.get(&block).cloned()
    }

    fn keep(&mut self, block: u32, bytes: &[u8]) {
        self.kept += 1;
        self.blocks.insert(block, bytes.to_vec());
    }
}

#[test]
fn light_that_was_kept_is_not_traced_again() {
    let scene = load("two_rooms_open");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let fitted = |memory: &mut Memory| {
        let mut volume = over(&scene, 2.0, &harmonics(None, true));
        let rows = RowSettings { rows_per_probe: 400, paths: 1, ..RowSettings::default() };
        let figures = run(&Fit::Rows(rows), &world, &untested(), &mut volume, 1, memory, |_| ()).unwrap();
        (volume.irradiance, FitFigures { time_s: 0.0, ..figures })
    };
    let mut memory = Memory::default();
    let first = fitted(&mut memory);
    let blocks = memory.kept;
    assert!(blocks > 1 && fitted(&mut memory) == first && memory.kept == blocks);
    // What is missing or of another length is traced again.
    memory.blocks.insert(0, vec![0; 60]);
    memory.blocks.pop_last();
    assert!(fitted(&mut memory) == first && memory.kept == blocks + 2);
}

//! Blocks and volumes built in code, and how textures are filtered.

use glam::{DVec3, UVec3, Vec2, Vec3, Vec3A};

use crate::export::record::Notes;
use crate::export::{Block, Export, Grids, Origin, Rules, Written};
use crate::math::harmonics::COUNT;
use crate::math::random::{Purpose, Random};
use crate::math::sampling::uniform_sphere;
use crate::probe::file::{LightRecord, SceneRecord};
use crate::probe::fit::points::asked_in_air;
use crate::probe::lattice::ProbeState;
use crate::probe::query::{QueryPoint, QuerySettings, VisibilityTest};
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::sh::ShStore;
use crate::probe::store::{IrradianceStore, Occlusion};
use crate::probe::{Grid, Volume};
use crate::scene::Unassigned;

/// Spacings differ, so that a swap of axes shows.
pub const SPACING: Vec3 = Vec3::new(2.0, 4.0, 1.0);

pub fn grid(divisions: UVec3) -> Grid {
    let grid = Grid::from_parts(DVec3::new(1.0, -1.0, 3.0), SPACING, divisions).unwrap();
    grid.relative_to(DVec3::ZERO).0
}

/// Blocks of the lattice's size, each beside the one before, with random values.
pub fn grids(rules: Rules, divisions: UVec3, count: u32) -> Grids {
    let grid = grid(divisions);
    let block = |k: u32| Block {
        first: grid.origin() + k as f32 * Vec3::new(1.5, 0.0, 0.0) * SPACING,
        spacing: SPACING,
        divisions,
        start: k * divisions.element_product(),
    };
    let blocks = (0..count).map(block).collect();
    let mut grids = Grids::new(rules, grid, blocks);
    let mut random = Random::new(3, Purpose::FitPoints, 7, 0);
    let mean = |i: usize| rules == Rules::Bevy || i.is_multiple_of(COUNT);
    for i in 0..grids.values.len() {
        let value = Vec3A::new(random.uniform(), random.uniform(), random.uniform());
        // The mean is so large that no sum is negative.
        grids.values[i] = if mean(i) { value + 8.0 } else { value };
    }
    grids
}

pub fn origin() -> Origin {
    let (name, blake3) = ("scene".to_owned(), "0".repeat(64));
    let unassigned = Unassigned::default();
    Origin {
        scene: SceneRecord { name, blake3 },
        light: LightRecord { punctual_scale: 1.0, sky: None, albedo_max: 0.9, unassigned },
        environment: None,
        seed: Some(0),
        probes_fitted: false,
        config: "()".to_owned(),
    }
}

pub fn export(grids: &Grids) -> Export {
    Export::of_grids(grids, &vec![Notes::default(); grids.blocks.len()], &origin(), None)
}

pub fn reread(grids: &Grids) -> Grids {
    let Written::Grids(read) = export(grids).as_read().unwrap() else { panic!("no grids") };
    read.relative_to(DVec3::ZERO)
}

/// Points in and around a box, with normals.
pub fn points(low: Vec3, high: Vec3, count: u64) -> Vec<QueryPoint> {
    let of = |i: u64| {
        let mut random = Random::new(4, Purpose::FitPoints, 8, i);
        let share = Vec3::new(random.uniform(), random.uniform(), random.uniform()) * 1.2 - 0.1;
        let normal = uniform_sphere(Vec2::new(random.uniform(), random.uniform()));
        asked_in_air(low + share * (high - low), normal).query
    };
    (0..count).map(of).collect()
}

/// Trilinear filtering with clamped addresses, as textures have it; `uvw` from 0 to 1.
pub fn filtered<const N: usize>(size: UVec3, texel: impl Fn(UVec3) -> [f32; N], uvw: Vec3) -> [f32; N] {
    let last = size.as_vec3() - 1.0;
    let place = uvw * size.as_vec3() - 0.5;
    let (base, fraction) = (place.floor(), place - place.floor());
    let mut sum = [0.0; N];
    for corner in 0..8u32 {
        let bit = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2).as_vec3();
        let weight = (bit * fraction + (1.0 - bit) * (1.0 - fraction)).element_product();
        let at = (base + bit).clamp(Vec3::ZERO, last).as_uvec3();
        sum.iter_mut().zip(texel(at)).for_each(|(sum, t)| *sum += weight * t);
    }
    sum
}

/// Active probes of coefficients at the points of a grid, without visibility, each with a mean irradiance.
pub fn volume(divisions: UVec3, mean: impl Fn(usize) -> f32) -> Volume {
    let grid = grid(divisions);
    let count = grid.probe_count();
    let store = ShStore { format: ColorFormat::F32, ..ShStore::default() };
    let mut irradiance = IrradianceStore::Sh9(store).zeros(count, 1);
    for probe in 0..count {
        let mut values = [Vec3A::ZERO; COUNT];
        values[0] = Vec3A::splat(mean(probe));
        values[1] = Vec3A::splat(0.1 * mean(probe));
        irradiance.set_probe(probe, &values);
    }
    Volume {
        states: vec![ProbeState::Active; count],
        positions: grid.probes().map(|probe| grid.grid_point(probe)).collect(),
        irradiance,
        occlusion: Occlusion::None,
        radiance: Default::default(),
        layout: Default::default(),
        grid,
    }
}

pub fn untested() -> QuerySettings {
    QuerySettings { test: VisibilityTest::None, ..QuerySettings::default() }
}

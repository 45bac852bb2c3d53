//! Rows against the surfaces that they are worked out of.

use glam::{DVec3, UVec3, Vec3};

use super::*;
use crate::light::surface::SurfacePoint;
use crate::math::fibonacci;
use crate::math::octahedral::texel_direction;
use crate::probe::Volume;
use crate::probe::lattice::Grid;
use crate::probe::query::{Blend, DirectionWeight, LookUp, QuerySettings, VisibilityTest};
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::kernel::Directions;
use crate::probe::store::sh::ShStore;
use crate::probe::store::{IrradianceStore, Occlusion};

const SIDE: usize = 24;
const PROBES: usize = 12;

/// Twelve probes whose irradiance differs, by direction too.
fn volume(store: IrradianceStore) -> Volume {
    let grid = Grid::from_parts(DVec3::ZERO, Vec3::new(1.0, 0.5, 0.75), UVec3::new(3, 2, 2)).unwrap();
    let mut states = vec![ProbeState::Active; PROBES];
    states[5] = ProbeState::InsideGeometry;
    let mut irradiance = store.zeros(PROBES, 1);
    irradiance.set_each(|p, before| {
        let light = |o| Vec3A::splat(0.2) + 0.1 * Vec3A::from(fibonacci::direction(9 * p + o, 9 * PROBES + 99));
        Some((before.enumerate().map(|(o, _)| light(o)).collect(), ()))
    });
    Volume {
        states,
        positions: grid.probes().map(|p| grid.grid_point(p)).collect(),
        irradiance,
        occlusion: Occlusion::None,
        radiance: Default::default(),
        layout: Default::default(),
        grid,
    }
}

/// What a probe sees: surfaces all over the grid and around it, with so many different normals.
fn capture(normals: usize) -> ProbeCapture {
    let surfel = |t: usize| {
        let toward = texel_direction(t % SIDE, t / SIDE, SIDE);
        let mut surface = SurfacePoint::in_space(
            Vec3::new(1.0, 0.25, 0.4) + 1.2 * toward,
            fibonacci::direction(t % normals, normals),
        );
        surface.albedo = Vec3::new(0.9, 0.5, 0.1) * (0.5 + 0.5 * toward.z);
        Surfel::new(&surface, 0.1 * toward.abs(), t as u32, 1.0)
    };
    let texels = SIDE * SIDE;
    ProbeCapture {
        texels,
        // Some see nothing.
        surfels: (0..texels).filter(|t| t % 7 != 0).map(surfel).collect(),
        emitted: vec![(3, Vec3::splat(2.0))],
        ..Default::default()
    }
}

/// Largest difference of what the row gives from what the surfaces do, relative to the largest unknown, and the lobes.
fn difference(presampled: Option<usize>, normals: usize, query: &QuerySettings) -> (f32, Vec<Lobe>) {
    let volume = volume(IrradianceStore::Sh9(ShStore { format: ColorFormat::F32, presampled, gradient: false }));
    let captures: Vec<ProbeCapture> = (0..PROBES).map(|_| capture(normals)).collect();
    let kernel = volume.irradiance.kernel(&Directions::octahedral(SIDE));
    let operator = Operator { captures: &captures, kernel: &kernel, query, gathers_emission: true };
    let masks = operator.masks(&volume);
    let rows = Rows::new(&operator, &volume, &masks);
    let Kept::Row(row) = &rows.kept[4] else { panic!("no row") };
    assert!(matches!(rows.kept[5], Kept::Nothing), "a probe that is not active");
    let (found, lost) = rows.update(&operator, &volume, 4, &masks);
    let (exact, lost_there) = operator.update(&volume, 4, &masks);
    assert_eq!((lost, lost_there), (0, 0));
    let largest = exact.iter().map(|e| e.abs().max_element()).fold(0.0, f32::max);
    let apart = found.iter().zip(&exact).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
    (apart / largest, row.lobes.clone())
}

#[test]
fn rows_give_what_the_surfaces_do() {
    let eccentric = DirectionWeight::Eccentric { kappa: 0.9 };
    let biased = QuerySettings {
        direction: eccentric,
        test: VisibilityTest::None,
        crush_below: 0.2,
        normal_bias: 0.05,
        view_bias: 0.15,
        ..Default::default()
    };
    let plain = QuerySettings { test: VisibilityTest::None, ..Default::default() };
    for query in [&plain, &biased] {
        for presampled in [None, Some(8)] {
            for normals in [1, 6, 9, 10, 200] {
                let (apart, lobes) = difference(presampled, normals, query);
                // Sums of 494 products of f32 in another order.
                assert!(apart < 1e-5, "{presampled:?}, {normals} normals: {apart}");
                // Eleven probes count.
                assert!(lobes.len() <= 11 * normals.min(COUNT), "{normals} normals: {} lobes", lobes.len());
                let of_unknowns = lobes.iter().filter(|lobe| matches!(lobe.asked, Asked::Unknown(_))).count();
                assert_eq!(of_unknowns > 0, normals > COUNT, "{normals} normals: {of_unknowns}");
                assert!(lobes.iter().all(|lobe| lobe.probe != 5), "a probe that is not active");
            }
        }
    }
}

/// Few surfaces, each with a normal of its own, are read sooner than lobes are.
#[test]
fn rows_larger_than_their_surfaces_are_not_kept() {
    let volume = volume(IrradianceStore::Sh9(ShStore::default()));
    let mut few = capture(200);
    few.surfels.truncate(4);
    let captures: Vec<ProbeCapture> = vec![few; PROBES];
    let kernel = volume.irradiance.kernel(&Directions::octahedral(SIDE));
    let query = QuerySettings { test: VisibilityTest::None, ..Default::default() };
    let operator = Operator { captures: &captures, kernel: &kernel, query: &query, gathers_emission: false };
    let masks = operator.masks(&volume);
    let rows = Rows::new(&operator, &volume, &masks);
    assert!(matches!(rows.kept[4], Kept::Surfaces));
    assert_eq!(rows.update(&operator, &volume, 4, &masks), operator.update(&volume, 4, &masks));
}

/// Maps of irradiance, square roots and look-ups in other directions are asked as before.
#[test]
fn other_look_ups_have_no_rows() {
    let captures: Vec<ProbeCapture> = (0..PROBES).map(|_| capture(3)).collect();
    let check = |volume: &Volume, query: &QuerySettings| {
        let kernel = volume.irradiance.kernel(&Directions::octahedral(SIDE));
        fit(&Operator { captures: &captures, kernel: &kernel, query, gathers_emission: false }, volume)
    };
    let harmonics = volume(IrradianceStore::Sh9(ShStore::default()));
    let plain = QuerySettings { test: VisibilityTest::None, ..Default::default() };
    assert!(check(&harmonics, &plain));
    assert!(!check(&volume(IrradianceStore::default()), &plain));
    assert!(!check(&harmonics, &QuerySettings { blend: Blend::SquareRoot, ..plain.clone() }));
    assert!(!check(&harmonics, &QuerySettings { look_up: LookUp::Towards, ..plain }));
}

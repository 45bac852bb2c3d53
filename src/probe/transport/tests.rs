//! The solver against closed forms: one probe that sees nothing but a surface of one albedo.

use std::f32::consts::PI;

use glam::{DVec3, UVec3, Vec3};

use super::operator::Operator;
use super::solver::Progress;
use super::{Acceleration, BounceSettings, Transport, run};
use crate::light::surface::SurfacePoint;
use crate::probe::Volume;
use crate::probe::capture::ProbeCapture;
use crate::probe::capture::surfel::Surfel;
use crate::probe::lattice::{Grid, ProbeState};
use crate::probe::query::{QuerySettings, VisibilityTest};
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::irradiance::{IrradianceCurve, OctahedralStore};
use crate::probe::store::kernel::Directions;
use crate::probe::store::sh::ShStore;
use crate::probe::store::{IrradianceStore, Occlusion};

const DIRECT: f32 = 0.25;
const EMITTED: f32 = 0.5;

/// All light that the probe gets: every texel of its capture shows the same surface.
struct World {
    captures: Vec<ProbeCapture>,
    volume: Volume,
}

impl World {
    fn new(albedo: f32) -> World {
        World::with(
            albedo,
            IrradianceStore::Octahedral(OctahedralStore {
                resolution: 2,
                format: ColorFormat::F32,
                curve: IrradianceCurve::Linear,
            }),
        )
    }

    fn with(albedo: f32, store: IrradianceStore) -> World {
        let texels = 4u32;
        let surface = SurfacePoint { albedo: Vec3::splat(albedo), ..SurfacePoint::in_space(Vec3::X, Vec3::NEG_X) };
        let capture = ProbeCapture {
            texels: texels as usize,
            surfels: (0..texels).map(|t| Surfel::new(&surface, Vec3::splat(DIRECT), t, 1.0)).collect(),
            emitted: (0..texels).map(|t| (t, Vec3::splat(EMITTED))).collect(),
            ..Default::default()
        };
        let volume = Volume {
            grid: Grid::from_parts(DVec3::ZERO, Vec3::ONE, UVec3::ONE).unwrap(),
            states: vec![ProbeState::Active],
            positions: vec![Vec3::ZERO],
            irradiance: store.zeros(1, 1),
            occlusion: Occlusion::None,
            radiance: Default::default(),
            layout: Default::default(),
        };
        World { captures: vec![capture], volume }
    }

    fn irradiance(&mut self, transport: &Transport, gathers_emission: bool) -> (f32, super::solver::Solution) {
        let kernel = self.volume.irradiance.kernel(&Directions::octahedral(2));
        let query = QuerySettings { test: VisibilityTest::None, ..Default::default() };
        if transport.hit_light() == crate::probe::capture::HitLight::None {
            self.captures[0].surfels.clear();
        }
        let operator = Operator { captures: &self.captures, kernel: &kernel, query: &query, gathers_emission };
        let solution = run(transport, &operator, &mut self.volume, Progress::default(), |_, _| {});
        let values = [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.64, 0.48)].map(|n| self.volume.irradiance.of(0, n).x);
        // Albedos of texels are dithered.
        assert!(values.iter().all(|e| (e / values[0] - 1.0).abs() < 1e-4), "{values:?}");
        (values[0], solution)
    }
}

fn bounces(max_bounces: Option<u32>, acceleration: Acceleration) -> Transport {
    Transport::Bounces(BounceSettings { max_bounces, acceleration, tolerance: 1e-6, ..Default::default() })
}

/// Albedos are kept in 16 bits: 2⁻¹⁶ of one, and what a geometric series makes of it.
fn assert_near(found: f32, expected: f32, albedo: f32) {
    let tolerance = 2e-5 / (1.0 - albedo);
    assert!((found / expected - 1.0).abs() < tolerance, "{found} instead of {expected} at albedo {albedo}");
}

#[test]
fn a_number_of_bounces_is_a_number_of_reflections() {
    for albedo in [0.0f32, 0.5, 0.9] {
        for most in 0..6 {
            // Emission reaches the probe itself; each reflection adds a term of the series.
            let reflected: f32 = (1..=most).map(|k| DIRECT * albedo.powi(k as i32 - 1)).sum();
            let emitted: f32 = (0..=most).map(|k| EMITTED * albedo.powi(k as i32)).sum();
            // Emission that is gathered is reflected like the rest.
            let (gathered, _) = World::new(albedo).irradiance(&bounces(Some(most), Acceleration::Auto), true);
            assert_near(gathered, PI * (emitted + reflected), albedo);
            let (found, solution) = World::new(albedo).irradiance(&bounces(Some(most), Acceleration::Auto), false);
            assert_near(found, PI * (EMITTED + reflected), albedo);
            let indices: Vec<u32> = solution.bounces.iter().map(|b| b.index).collect();
            // Albedo 0 has settled after the first that adds nothing.
            assert!(indices.iter().copied().eq(if most == 0 { 0..1 } else { 1..indices.len() as u32 + 1 }));
            assert!(albedo == 0.0 || indices.last() == Some(&most), "{indices:?}");
        }
    }
}

#[test]
fn all_bounces_are_the_sum_of_the_series() {
    for albedo in [0.0f32, 0.5, 0.9, 0.99] {
        for acceleration in [Acceleration::Never, Acceleration::Auto, Acceleration::Always] {
            // Sampled emission is added at the end; gathered emission bounces with the rest.
            let direct = PI * EMITTED + PI * DIRECT / (1.0 - albedo);
            let gathered = PI * (EMITTED + DIRECT) / (1.0 - albedo);
            for (gathers, expected) in [(false, direct), (true, gathered)] {
                let mut settings = BounceSettings { acceleration, tolerance: 1e-6, ..Default::default() };
                settings.max_iterations = 4000;
                let (found, solution) = World::new(albedo).irradiance(&Transport::Bounces(settings), gathers);
                assert!(solution.converged, "{albedo} {acceleration:?}");
                assert_near(found, expected, albedo);
                let bound = solution.error_bound.unwrap_or(0.0) as f32;
                // A few roundings of the largest value beside the bound.
                assert!((found - expected).abs() <= bound + expected * (2e-5 / (1.0 - albedo)));
                let norm = solution.norm_bound().unwrap();
                assert!((norm - f64::from(albedo)).abs() < 2e-5, "{norm} at {albedo}");
            }
        }
    }
}

#[test]
fn paths_leave_nothing_to_iterate() {
    let (found, solution) = World::new(0.9).irradiance(&Transport::Paths { paths: 1 }, false);
    // What captures of paths hold is all there is.
    assert_near(found, PI * (EMITTED + DIRECT), 0.9);
    assert!(solution.converged && solution.bounces.len() == 1);
}

#[test]
fn harmonics_settle_like_maps() {
    for (albedo, acceleration) in [
        (0.5, Acceleration::Never),
        (0.9, Acceleration::Auto),
        (0.99, Acceleration::Always),
        (0.999, Acceleration::Auto),
    ] {
        for presampled in [None, Some(8)] {
            let mut world = World::with(albedo, IrradianceStore::Sh9(ShStore { presampled, ..ShStore::default() }));
            let (found, solution) = world.irradiance(&bounces(None, acceleration), true);
            assert!(solution.converged, "{solution:?}");
            assert_near(found, PI * (DIRECT + EMITTED) / (1.0 - albedo), albedo);
            // The mean irradiance, whatever the number of unknowns.
            let energy = solution.bounces.last().map_or(0.0, |b| b.energy);
            assert!((energy / f64::from(found) - 1.0).abs() < 1e-3, "{energy} for {found}");
            assert_eq!(solution.negative_texels, 0);
        }
    }
}

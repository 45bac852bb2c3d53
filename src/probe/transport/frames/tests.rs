//! Frames against recursions and expectations that are known.

use std::f32::consts::PI;

use glam::{DVec3, Quat, UVec3, Vec2, Vec3};

use super::*;
use crate::light::surface::SurfacePoint;
use crate::math::fibonacci;
use crate::probe::capture::surfel::Surfel;
use crate::probe::capture::{ProbeCapture, frame_rotation};
use crate::probe::lattice::Grid;
use crate::probe::query::{QuerySettings, VisibilityTest};
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::irradiance::{IrradianceCurve, OctahedralStore};
use crate::probe::store::kernel::{Directions, Kernel};
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::{IrradianceStore, Occlusion};
use crate::probe::transport::checkpoint;
use crate::probe::transport::operator::Frame;

const DIRECT: f32 = 0.25;
const EMITTED: f32 = 0.5;

/// Rays of a frame.
const RAYS: usize = 224;

/// One probe whose rays meet, all alike, a surface of one albedo that emits where they point at the lamp.
struct Lamp {
    albedo: f32,
    /// Radiance along a turned ray.
    emission: fn(Vec3) -> f32,
    /// Whether light may be learnt from a frame.
    counts: fn(u32) -> bool,
    stationary: bool,
}

impl Lamp {
    fn rotation(&self, frame: u32) -> Quat {
        if self.stationary { Quat::IDENTITY } else { frame_rotation(3, frame) }
    }

    fn directions(&self, frame: u32) -> Directions {
        Directions::even((0..RAYS).map(|i| fibonacci::direction(i, RAYS)).collect()).turned(self.rotation(frame))
    }
}

impl Captures for Lamp {
    fn with<R>(&self, _: usize, visit: impl FnOnce(&ProbeCapture) -> R) -> R {
        visit(&ProbeCapture::default())
    }

    fn frame(&self, _: usize, frame: u32) -> Option<Frame> {
        let surface = SurfacePoint { albedo: Vec3::splat(self.albedo), ..SurfacePoint::in_space(Vec3::X, Vec3::NEG_X) };
        let rays = self.directions(frame).texel_means();
        let capture = ProbeCapture {
            texels: RAYS,
            surfels: (0..RAYS as u32).map(|t| Surfel::new(&surface, Vec3::splat(DIRECT), t, 1.0)).collect(),
            emitted: rays.iter().enumerate().map(|(t, (d, _))| (t as u32, Vec3::splat((self.emission)(*d)))).collect(),
            ..Default::default()
        };
        Some(Frame { capture, counts: (self.counts)(frame) })
    }

    fn filters(&self, frame: u32, volume: &Volume) -> Option<Filters> {
        Some(Filters { irradiance: volume.irradiance.kernel(&self.directions(frame)), distance: None })
    }
}

fn volume(curve: IrradianceCurve) -> Volume {
    let store = OctahedralStore { resolution: 2, format: ColorFormat::F32, curve };
    Volume {
        grid: Grid::from_parts(DVec3::ZERO, Vec3::ONE, UVec3::ONE).unwrap(),
        states: vec![ProbeState::Active],
        positions: vec![Vec3::ZERO],
        irradiance: IrradianceStore::Octahedral(store).zeros(1, 1),
        occlusion: Occlusion::None,
        radiance: Default::default(),
        layout: Default::default(),
    }
}

fn frames(lamp: &Lamp, settings: &FrameSettings, volume: &mut Volume, progress: Progress) -> Solution {
    let kernel = Kernel::of_rows(std::iter::empty());
    let query = QuerySettings { test: VisibilityTest::None, ..Default::default() };
    let operator = Operator { captures: lamp, kernel: &kernel, query: &query, gathers_emission: true };
    solve(&operator, settings, volume, progress, |_, _| {})
}

fn even(albedo: f32) -> Lamp {
    Lamp { albedo, emission: |_| EMITTED, counts: |_| true, stationary: true }
}

/// Where every ray brings the same, m ← h·m + (1 − h)·s(m) is a recursion of one number, in the curve's domain.
#[test]
fn frames_follow_their_recursion() {
    for (curve, power) in [(IrradianceCurve::Linear, 1.0f64), (IrradianceCurve::Gamma5Over2Pi, 5.0)] {
        for (albedo, hysteresis, count) in [(0.5f32, 0.0f32, 4u32), (0.5, 0.97, 40), (0.9, 0.8, 25)] {
            let pi = std::f64::consts::PI;
            let shade = |e: f64| pi * f64::from(EMITTED + DIRECT) + f64::from(albedo) * e;
            let mut expected = pi * f64::from(EMITTED + DIRECT);
            for _ in 1..count {
                let mixed = f64::from(hysteresis) * expected.powf(1.0 / power)
                    + f64::from(1.0 - hysteresis) * shade(expected).powf(1.0 / power);
                expected = mixed.powf(power);
            }
            let settings = FrameSettings { hysteresis, least: count, most: count, ..Default::default() };
            let mut volume = volume(curve);
            let solution = frames(&even(albedo), &settings, &mut volume, Progress::default());
            assert_eq!((solution.bounces.len() as u32, solution.stopped), (count, Some(Stopped::Limit)));
            for e in volume.irradiance.probe(0) {
                // Albedos in 16 bits, dithered; a fifth power of roundings in every frame.
                let off = f64::from(e.x) / expected - 1.0;
                assert!(off.abs() < 1e-4, "{curve:?} {albedo} {hysteresis}: {e} instead of {expected}");
            }
        }
    }
}

/// In an even room they end at π(E + D)/(1 − ρ), and say that they settled.
#[test]
fn frames_settle_at_the_sum_of_the_series() {
    for albedo in [0.0f32, 0.5, 0.8] {
        let mut volume = volume(IrradianceCurve::Gamma5Over2Pi);
        let settings = FrameSettings::default();
        let solution = frames(&even(albedo), &settings, &mut volume, Progress::default());
        assert!(solution.converged && solution.stopped == Some(Stopped::Settled), "{solution:?}");
        let count = solution.bounces.len() as u32;
        assert!((settings.least..settings.most).contains(&count), "{count} frames");
        let (found, exact) = (volume.irradiance.probe(0).next().unwrap().x, PI * (EMITTED + DIRECT) / (1.0 - albedo));
        // Albedos in 16 bits, and what a geometric series makes of them.
        assert!((found / exact - 1.0).abs() < 2e-5 / (1.0 - albedo), "{found} instead of {exact} at albedo {albedo}");
    }
}

/// Means of fifth roots are below the root of the mean, and the more so the fewer rays bring the light: of a lamp of 0.1 %
/// of the sphere, which one frame in five meets.
#[test]
fn small_bright_lamps_come_out_too_dark() {
    // Caps around X: cosines above 1 − 2/100, and above 1 − 2/1000.
    let large: fn(Vec3) -> f32 = |d| if d.x > 0.98 { 100.0 } else { 0.0 };
    let small: fn(Vec3) -> f32 = |d| if d.x > 0.998 { 1000.0 } else { 0.0 };
    let settings = FrameSettings { hysteresis: 0.99, least: 1000, most: 1000, ..Default::default() };
    // Of the light that they bring, 4π·n·x at a normal n that sees all of them.
    let ratio = |curve, emission| {
        let lamp = Lamp { albedo: 0.0, emission, counts: |_| true, stationary: false };
        let mut volume = volume(curve);
        frames(&lamp, &settings, &mut volume, Progress::default());
        let light: f32 = volume.irradiance.probe(0).map(|e| e.x - PI * DIRECT).sum();
        let axes = volume.irradiance.axes();
        light / axes.iter().map(|(n, _)| 4.0 * PI * n.x.max(0.0)).sum::<f32>()
    };
    // In the linear domain there is no bias. Some 199 frames count, of 2.24 and 0.224 hits: 5 % and 15 % are standard errors.
    for (lamp, error) in [(large, 0.05), (small, 0.15)] {
        let linear = ratio(IrradianceCurve::Linear, lamp);
        assert!((linear - 1.0).abs() < 4.0 * error, "{linear}");
    }
    // Two rays or three each frame: little is lost. One or none: most of it.
    let (large, small) = (ratio(IrradianceCurve::Gamma5Over2Pi, large), ratio(IrradianceCurve::Gamma5Over2Pi, small));
    assert!((0.8..1.05).contains(&large), "{large}");
    assert!((0.05..0.5).contains(&small), "{small}");
}

/// A probe that may learn nothing keeps what it has.
#[test]
fn frames_that_do_not_count_change_nothing() {
    let lamp = Lamp { counts: |frame| frame < 10, ..even(0.5) };
    let after = |most: u32| {
        let mut volume = volume(IrradianceCurve::Linear);
        frames(&lamp, &FrameSettings { least: most, most, ..Default::default() }, &mut volume, Progress::default());
        volume.irradiance
    };
    assert_eq!(after(10), after(30));
    assert_ne!(after(9), after(10));
    let dark = Lamp { counts: |_| false, ..even(0.5) };
    let mut volume = volume(IrradianceCurve::Linear);
    let solution = frames(&dark, &FrameSettings::default(), &mut volume, Progress::default());
    assert!(volume.irradiance.probe(0).all(|e| e == Vec3::ZERO) && solution.converged);
}

#[test]
fn frames_go_on_from_a_checkpoint_as_if_nothing_had_happened() {
    let lamp = Lamp { emission: |d| 1.0 + d.x, stationary: false, ..even(0.7) };
    let settings = FrameSettings { least: 70, most: 90, ..Default::default() };
    let folder = tempfile::tempdir().unwrap();
    let path = |frames: usize| folder.path().join(frames.to_string());
    let kernel = Kernel::of_rows(std::iter::empty());
    let query = QuerySettings { test: VisibilityTest::None, ..Default::default() };
    let operator = Operator { captures: &lamp, kernel: &kernel, query: &query, gathers_emission: true };
    // Distances too, though no rays feed them here.
    let maps = OctahedralMaps::new(1, 2, 1, Vec2::new(2.0, 0.5));
    let start = || Volume { occlusion: Occlusion::Moments(maps.clone()), ..volume(IrradianceCurve::Gamma5Over2Pi) };
    let mut whole = start();
    let solution = solve(&operator, &settings, &mut whole, Progress::default(), |state, volume| {
        std::fs::write(path(state.solution.bounces.len()), checkpoint::pack(state, volume)).unwrap();
    });
    for frames in [1, 33, 90] {
        let mut volume = Volume { occlusion: Occlusion::Moments(maps.clone()), ..start() };
        let state = checkpoint::unpack(&std::fs::read(path(frames)).unwrap(), &mut volume).unwrap();
        assert_eq!(solve(&operator, &settings, &mut volume, state, |_, _| {}), solution, "from frame {frames}");
        assert_eq!((&volume.irradiance, &volume.occlusion), (&whole.irradiance, &whole.occlusion));
    }
}

#[test]
fn frames_end_where_variability_no_longer_falls() {
    let settings = FrameSettings { window: 3, least: 4, fall: 0.01, ..Default::default() };
    let settled = |variability: &[f64]| {
        let frame = |&residual| Bounce { index: 0, residual, energy: 0.0, accelerated: false };
        has_settled(&variability.iter().map(frame).collect::<Vec<_>>(), &settings)
    };
    // The first frame is not looked at, and two windows must be full.
    assert!(!settled(&[0.0, 1.0, 1.0, 1.0, 1.0, 1.0]));
    assert!(settled(&[0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]));
    // From 0.95 to 0.94, by 1.05 %; to 0.945, by 0.5 %.
    assert!(!settled(&[0.0, 1.0, 0.95, 1.0, 0.97, 0.94, 0.99]));
    assert!(settled(&[0.0, 1.0, 0.95, 1.0, 0.97, 0.945, 0.99]));
    // What lies before the windows does not count.
    assert!(!settled(&[0.0, 0.1, 1.0, 1.0, 1.0, 0.9, 0.9, 0.9]));
    assert!(settled(&[0.0; 7]), "nothing falls below zero");
}

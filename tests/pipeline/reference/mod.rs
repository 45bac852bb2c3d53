//! The path tracer against formulas, and its file.
//!
//! Every comparison is of a whole small picture with a formula ([`Check`]): per channel the mean difference must lie within
//! three standard errors (2.7e-3 of a normal distribution lies outside), and each pixel's within six, which only guards
//! against a place that is wrong by itself: the tails of single pixels are not normal.
//!
//! There are 90 checks of three channels each, 270 comparisons of means. Channels share their random numbers, so that 90 of
//! them tell something new at most: with a new seed one or more would fail with a probability of about 0.2, and of 0.5
//! were all 270 independent. Seeds are fixed, so the outcome is.

mod blended;
mod coincident;
mod furnace;
mod gltf;
mod lights;
mod program;
mod rooms;
mod skies;

use std::path::Path;

use glam::{DVec3, Vec3};
use lightprobe::light::World;
use lightprobe::light::path::Strategy;
use lightprobe::scene::{self, Camera, LoadOptions, Scene};
use lightprobe::shade::points::{ImagePoint, see};
use lightprobe::shade::reference::{Reference, ReferenceSettings, trace};
use lightprobe::system::progress::Progress;

const STRATEGIES: [Strategy; 3] = [Strategy::Mis, Strategy::BsdfOnly, Strategy::LightOnly];

/// Relative error of f32 arithmetic along a path of some tens of vertices.
const ROUNDING: f64 = 2e-5;

const WIDTH: u32 = 8;
const HEIGHT: u32 = 6;

/// Loads a scene that a test has saved.
fn load(path: &Path) -> Scene {
    scene::load(path, &LoadOptions::default()).expect("a scene of the tests' own")
}

fn world(scene: &Scene) -> World<'_> {
    World::new(scene, 1.0, 0.999).expect("Embree")
}

/// A camera in the scene's world space.
fn camera(scene: &Scene, from: [f64; 3], to: [f64; 3], fov_deg: f32) -> Camera {
    let local = |p: [f64; 3]| (DVec3::from(p) - scene.origin_world).as_vec3();
    Camera::look_at("test", local(from), local(to), fov_deg.to_radians())
}

fn small(world: &World, camera: &Camera, settings: &ReferenceSettings) -> Reference {
    trace(world, camera, WIDTH, HEIGHT, settings, Progress::hidden(), None)
}

fn settings(spp: u32, strategy: Strategy) -> ReferenceSettings {
    ReferenceSettings { spp, strategy, seed: 2, ..Default::default() }
}

/// The points that the pixels show, in world space.
fn points(world: &World, camera: &Camera) -> Vec<(ImagePoint, DVec3)> {
    let view = see(world, camera, WIDTH, HEIGHT, 1);
    assert_eq!(view.points.len(), (WIDTH * HEIGHT) as usize, "every pixel shows a surface");
    let place = |p: &ImagePoint| p.surface.position.as_dvec3() + world.scene.origin_world;
    view.points.iter().map(|p| (*p, place(p))).collect()
}

/// One comparison of a layer with a formula.
struct Check<'a> {
    found: &'a [Vec3],
    variance: &'a [Vec3],
    /// Of the formula or the scene, relative to its largest value, beside noise.
    floor: f64,
}

impl<'a> Check<'a> {
    fn indirect(reference: &'a Reference) -> Check<'a> {
        let variance = reference.irradiance_indirect_variance().expect("two blocks");
        Check { found: reference.irradiance_indirect(), variance, floor: ROUNDING }
    }

    fn floor(self, floor: f64) -> Check<'a> {
        Check { floor: self.floor + floor, ..self }
    }

    /// Per pixel what it should be. Variances from some tens of blocks may come out too small by chance, and do so together
    /// with the mean where light is rare; single pixels are judged by no less than the mean variance.
    fn against(&self, expected: &[DVec3], what: &str) {
        assert_eq!(self.found.len(), expected.len());
        let pixels = expected.len() as f64;
        for channel in 0..3 {
            let largest = expected.iter().map(|e| e[channel].abs()).fold(0.0, f64::max);
            let floor = self.floor * largest;
            let (mut sum, mut variances) = (0.0, 0.0);
            let pooled = self.variance.iter().map(|v| f64::from(v[channel])).sum::<f64>() / pixels;
            for (pixel, exact) in expected.iter().enumerate() {
                let difference = f64::from(self.found[pixel][channel]) - exact[channel];
                let variance = f64::from(self.variance[pixel][channel]);
                assert!(variance >= 0.0, "{what}, pixel {pixel}: variance {variance}");
                assert!(
                    difference.abs() <= 6.0 * variance.max(pooled).sqrt() + floor,
                    "{what}, pixel {pixel}, channel {channel}: off by {difference} of {}, standard error {}",
                    exact[channel],
                    variance.sqrt()
                );
                sum += difference;
                variances += variance;
            }
            let (mean, error) = (sum / pixels, variances.sqrt() / pixels);
            assert!(
                mean.abs() <= 3.0 * error + floor,
                "{what}, channel {channel}: mean off by {mean}, standard error {error}, largest {largest}"
            );
        }
    }

    /// The same everywhere.
    fn against_constant(&self, expected: [f64; 3], what: &str) {
        self.against(&vec![DVec3::from(expected); self.found.len()], what);
    }
}

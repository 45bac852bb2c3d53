//! The reference picture: path-traced light in the same layers as every other picture, and its variance.
//!
//! Samples come in blocks of sixteen ([`crate::math::blocks`]), so their number is rounded up to whole blocks. Each
//! pass adds one block to every pixel. Fewer than sixteen samples are a partial block: it gives a picture but no
//! variance, and it cannot be continued.
//!
//! In scenes without BLEND surfaces a pixel shows one point. Its emission and its direct light from punctual lights are
//! then exact, and only the light that probes would store is sampled. With BLEND surfaces every block traces new rays
//! through the pixel, and all layers are averages.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

pub use super::develop::{BEAUTY_VARIANCE, IRRADIANCE_INDIRECT_VARIANCE};
use super::develop::{FixedView, NO_POINT, develop_blended, develop_fixed, direct_radiance, quantities};
use super::film::{Film, NoiseLevel, Quantity, add_block};
use super::points::{ImagePoint, has_blend, see, see_pixel};
use crate::image::LayeredImage;
use crate::light::World;
use crate::light::bsdf::ReflectionModel;
use crate::light::expected::Expected;
use crate::light::path::{PathSettings, Strategy};
use crate::light::sampled::RayCount;
use crate::math::blocks::{BLOCK, Block};
use crate::math::random::{Purpose, Random};
use crate::scene::Camera;
use crate::system::progress::Progress;

/// Number of the variants of [`Quantity`].
const MOST: usize = Quantity::Depth as usize + 1;

/// Pixels per task of a thread. They take some milliseconds.
const RUN: usize = 32;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceSettings {
    /// Samples per pixel. From [`BLOCK`] on they are rounded up to whole blocks.
    pub spp: u32,
    pub seed: u64,
    pub transport: ReflectionModel,
    /// As [`PathSettings::max_bounces`].
    pub max_bounces: Option<u32>,
    pub strategy: Strategy,
    /// As [`PathSettings::firefly_clamp`].
    pub firefly_clamp: Option<f32>,
}

impl Default for ReferenceSettings {
    fn default() -> Self {
        ReferenceSettings {
            spp: 256,
            seed: 0,
            transport: ReflectionModel::default(),
            max_bounces: None,
            strategy: Strategy::default(),
            firefly_clamp: None,
        }
    }
}

impl ReferenceSettings {
    fn path<'e>(&self, expected: &'e Expected) -> PathSettings<'e> {
        PathSettings {
            expected: Some(expected),
            cache: None,
            transport: self.transport,
            strategy: self.strategy,
            max_bounces: self.max_bounces,
            firefly_clamp: self.firefly_clamp,
        }
    }

    /// Samples that will be taken.
    pub fn rounded_spp(&self) -> u32 {
        if self.spp < BLOCK { self.spp } else { self.spp.div_ceil(BLOCK).saturating_mul(BLOCK) }
    }

    /// Whole blocks that will be taken. 0 for a partial block.
    fn blocks(&self) -> u32 {
        self.rounded_spp() / BLOCK
    }
}

/// The data that another run needs to continue this one. It contains whole blocks only.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    pub film: Film,
    /// Number of samples that were not finite. They count as 0.
    pub non_finite: u64,
    /// Rays along paths (`primary`) and towards lights (`shadow`), without the camera rays.
    pub rays: RayCount,
}

/// A finished picture.
#[derive(Debug, Clone)]
pub struct Reference {
    /// The same layers as all pictures. From two blocks on there are also `beauty_variance` and
    /// `irradiance_indirect_variance`, the variances of each pixel's mean.
    pub image: LayeredImage,
    /// Samples per pixel.
    pub spp: u32,
    /// As [`State::non_finite`].
    pub non_finite: u64,
    /// As [`State::rays`].
    pub rays: RayCount,
    /// Noise of `irradiance_indirect`. `None` below two blocks.
    pub noise: Option<NoiseLevel>,
    /// `None` for a partial block.
    pub state: Option<State>,
}

impl Reference {
    /// Indirect irradiance per pixel, W·m⁻².
    pub fn irradiance_indirect(&self) -> &[Vec3] {
        self.layer(Quantity::IrradianceIndirect.name())
    }

    /// The same over all pixels and channels; `None` without pixels.
    pub fn irradiance_indirect_mean(&self) -> Option<f64> {
        let pixels = self.irradiance_indirect();
        let sum: f64 = pixels.iter().map(|e| e.as_dvec3().element_sum()).sum();
        (!pixels.is_empty()).then(|| sum / (3 * pixels.len()) as f64)
    }

    /// Variance of each pixel's mean indirect irradiance, per channel, (W·m⁻²)². `None` below two blocks, because a
    /// single block has no spread.
    pub fn irradiance_indirect_variance(&self) -> Option<&[Vec3]> {
        self.image.layer(IRRADIANCE_INDIRECT_VARIANCE)
    }

    /// Radiance per pixel, W·m⁻²·sr⁻¹.
    pub fn beauty(&self) -> &[Vec3] {
        self.layer(Quantity::Beauty.name())
    }

    /// Variance of each pixel's [`Self::beauty`], per channel. `None` below two blocks.
    pub fn beauty_variance(&self) -> Option<&[Vec3]> {
        self.image.layer(BEAUTY_VARIANCE)
    }

    /// The pixels of a layer. Empty if a file that [`Self::write`] did not write lacks the layer.
    fn layer(&self, name: &str) -> &[Vec3] {
        self.image.layer(name).unwrap_or(&[])
    }
}

/// Traces a reference until it has all its samples. `previous` is the state of an earlier run with the same world,
/// camera, size and settings; only `spp` may differ. The result then equals that of one uninterrupted run.
pub fn trace(
    world: &World,
    camera: &Camera,
    width: u32,
    height: u32,
    settings: &ReferenceSettings,
    progress: Progress,
    previous: Option<State>,
) -> Reference {
    let mut tracing = Tracing::new(world, camera, width, height, settings, previous);
    let bar = progress.stage("reference", tracing.remaining() as usize);
    while tracing.remaining() > 0 {
        tracing.advance();
        bar.inc(1);
        if let Some(noise) = tracing.noise() {
            bar.set_message(noise.to_message());
        }
    }
    bar.finish_and_clear();
    tracing.develop()
}

impl NoiseLevel {
    /// The text for progress bars.
    pub fn to_message(&self) -> String {
        format!("noise {:.3} %", 100.0 * self.mean_standard_error / self.mean.max(f64::MIN_POSITIVE))
    }
}

/// A reference that is being traced, one block at a time.
pub struct Tracing<'a> {
    world: &'a World<'a>,
    camera: &'a Camera,
    width: u32,
    height: u32,
    settings: ReferenceSettings,
    expected: Expected,
    /// The points of the pixels. `None` if they change from block to block.
    view: Option<FixedView>,
    state: State,
    clamped: u64,
    /// Whether the partial block is done, if one was asked for.
    part_done: bool,
}

impl<'a> Tracing<'a> {
    /// As [`trace`].
    pub fn new(
        world: &'a World<'a>,
        camera: &'a Camera,
        width: u32,
        height: u32,
        settings: &ReferenceSettings,
        previous: Option<State>,
    ) -> Tracing<'a> {
        let pixels = width as usize * height as usize;
        let view = see(world, camera, width, height, settings.seed);
        let clamped = view.clamped();
        let expected = world.expect(view.points.iter().map(|p| world.places.key_of(&p.surface)).collect());
        let view = (!has_blend(world)).then(|| {
            let mut point_of_pixel = vec![NO_POINT; pixels];
            view.points.iter().enumerate().for_each(|(i, p)| point_of_pixel[p.pixel as usize] = i as u32);
            let direct = |p: &ImagePoint| direct_radiance(world, p, settings.transport, p.pixel);
            let direct = view.points.par_iter().map(direct).collect();
            FixedView { view, point_of_pixel, direct }
        });
        let state = previous.unwrap_or_else(|| State {
            film: Film::new(quantities(world, settings.transport), pixels),
            non_finite: 0,
            rays: RayCount::default(),
        });
        Tracing { world, camera, width, height, settings: *settings, expected, view, state, clamped, part_done: false }
    }

    /// Points of the picture whose light from punctual lights is clamped.
    pub fn clamped(&self) -> u64 {
        self.clamped
    }

    /// Number of passes left.
    pub fn remaining(&self) -> u32 {
        if self.is_part() {
            u32::from(!self.part_done)
        } else {
            self.settings.blocks() - self.state.film.blocks.min(self.settings.blocks())
        }
    }

    /// Whether the result is a partial block: less than a block is asked for, and no whole block exists.
    fn is_part(&self) -> bool {
        self.settings.blocks() == 0 && (self.part_done || self.state.film.blocks == 0)
    }

    /// Adds a block to every pixel.
    pub fn advance(&mut self) {
        let samples = self.settings.spp.clamp(1, BLOCK);
        let mut film = std::mem::replace(&mut self.state.film, Film::new(&[], 0));
        let (blocks, stride, quantities) = (film.blocks, film.stride(), film.quantities());
        let this = &*self;
        let run = |(run, records): (usize, &mut [f64])| {
            let mut counts = Counts::default();
            for (i, record) in records.chunks_exact_mut(stride).enumerate() {
                let pixel = (run * RUN + i) as u32;
                let means = this.block(pixel, blocks, samples, &mut counts);
                let mut picked = [DVec3::ZERO; MOST];
                picked.iter_mut().zip(quantities).for_each(|(mean, q)| *mean = means[*q as usize]);
                add_block(record, quantities, &picked[..quantities.len()], blocks);
            }
            counts
        };
        let counts =
            film.records().par_chunks_mut(stride * RUN).enumerate().map(run).reduce(Counts::default, Counts::plus);
        film.blocks += 1;
        self.state.film = film;
        self.state.non_finite += counts.non_finite;
        self.state.rays.primary += counts.rays.primary;
        self.state.rays.shadow += counts.rays.shadow;
        self.part_done = samples < BLOCK;
    }

    /// One block of one pixel: the means of all quantities, in the order of [`Quantity`].
    fn block(&self, pixel: u32, block: u32, samples: u32, counts: &mut Counts) -> [DVec3; MOST] {
        let mut means = [DVec3::ZERO; MOST];
        match &self.view {
            Some(fixed) => {
                let index = fixed.point_of_pixel[pixel as usize];
                let mut seen = fixed.view.sky[pixel as usize];
                if index != NO_POINT {
                    let point = &fixed.view.points[index as usize];
                    self.add_points(std::slice::from_ref(point), pixel, block, samples, &mut means, counts);
                    seen += point.surface.emission + fixed.direct[index as usize];
                }
                means[Quantity::Beauty as usize] = seen.as_dvec3() + means[Quantity::Indirect as usize];
            }
            None => {
                let mut random = Random::new(self.settings.seed, Purpose::Pixel, u64::from(pixel), u64::from(block));
                let (points, sky) =
                    see_pixel(self.world, self.camera, self.width, self.height, pixel, samples, &mut random);
                self.add_points(&points, pixel, block, samples, &mut means, counts);
                for point in &points {
                    self.add_seen(point, random.bits(), &mut means);
                }
                means[Quantity::Emission as usize] += sky.as_dvec3();
                means[Quantity::Beauty as usize] =
                    [Quantity::Emission, Quantity::Direct, Quantity::Indirect].map(|q| means[q as usize]).iter().sum();
            }
        }
        means
    }

    /// Adds one block of samples of the indirect light at a pixel's points.
    fn add_points(
        &self,
        points: &[ImagePoint],
        pixel: u32,
        block: u32,
        samples: u32,
        means: &mut [DVec3; MOST],
        counts: &mut Counts,
    ) {
        let path = self.settings.path(&self.expected);
        let block = Block::new(self.settings.seed, Purpose::Path, u64::from(pixel), u64::from(block));
        let mut index = 0;
        for point in points {
            // Weights are multiples of 1/samples. Each ray that hit the point starts one path there.
            let share = (point.weight * samples as f32).round() as u32;
            for _ in 0..share {
                let mut numbers = block.sample(index);
                index += 1;
                let gathered = self.world.gather(
                    &point.surface,
                    point.query.normal,
                    point.query.view,
                    &path,
                    &mut numbers,
                    &mut counts.rays,
                );
                if !(gathered.irradiance + gathered.radiance).is_finite() {
                    counts.non_finite += 1;
                    continue;
                }
                means[Quantity::IrradianceIndirect as usize] += gathered.irradiance.as_dvec3();
                means[Quantity::Indirect as usize] += gathered.radiance.as_dvec3();
                means[Quantity::Glossy as usize] += gathered.glossy.as_dvec3();
            }
        }
        for quantity in [Quantity::IrradianceIndirect, Quantity::Indirect, Quantity::Glossy] {
            means[quantity as usize] /= f64::from(samples);
        }
    }

    /// Adds the quantities of a point that need no paths.
    fn add_seen(&self, point: &ImagePoint, salt: u32, means: &mut [DVec3; MOST]) {
        let mut add = |quantity: Quantity, value: Vec3| means[quantity as usize] += (value * point.weight).as_dvec3();
        add(Quantity::Emission, point.surface.emission);
        add(Quantity::Direct, direct_radiance(self.world, point, self.settings.transport, salt));
        add(Quantity::IrradianceDirect, point.irradiance_direct);
        add(Quantity::Albedo, point.surface.albedo);
        add(Quantity::Normal, point.query.normal);
        add(Quantity::Depth, Vec3::splat(point.depth));
    }

    /// Noise of `irradiance_indirect` so far. `None` below two blocks.
    pub fn noise(&self) -> Option<NoiseLevel> {
        self.state.film.noise(Quantity::IrradianceIndirect)
    }

    /// The picture from the samples so far.
    pub fn develop(&self) -> Reference {
        let film = &self.state.film;
        let image = match &self.view {
            Some(fixed) => develop_fixed(film, fixed),
            None => develop_blended(film, self.width, self.height),
        };
        Reference {
            image,
            spp: if self.is_part() { self.settings.spp } else { film.blocks * BLOCK },
            non_finite: self.state.non_finite,
            rays: self.state.rays,
            noise: self.noise(),
            state: (!self.is_part()).then(|| self.state.clone()),
        }
    }
}

/// The counts of one task.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    rays: RayCount,
    non_finite: u64,
}

impl Counts {
    fn plus(self, other: Counts) -> Counts {
        Counts { rays: self.rays + other.rays, non_finite: self.non_finite + other.non_finite }
    }
}

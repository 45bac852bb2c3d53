//! The path-traced light at the points that ask: what probes store, indirect light and all that emitters send.

use std::collections::HashMap;
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::points::Asked;
use super::settings::{Kind, RowSettings};
use crate::light::World;
use crate::light::path::PathSettings;
use crate::light::sampled::RayCount;
use crate::light::surface::SurfacePoint;
use crate::math::blocks::{BLOCK, Block};
use crate::math::color::luminance;
use crate::math::random::{Numbers, Purpose, Random};
use crate::math::sampling::cosine_hemisphere;
use crate::trace::Ray;

/// Irradiance, W·m⁻², of one or two independent runs. Points that judge have two: the product of the differences from both
/// has no noise in the mean.
#[derive(Debug, Clone, Copy, Default)]
pub struct Target {
    pub runs: [Vec3; 2],
    /// Variance of the first run's mean, as if its paths were independent; mean of the channels.
    pub noise: f32,
    /// Of the first run.
    pub paths: u32,
}

impl Target {
    pub fn mean(&self) -> Vec3 {
        0.5 * (self.runs[0] + self.runs[1])
    }
}

/// Share of the points in the air that are left out, the brightest: those within a finger of a lamp. With 0.0005 and 0.002 errors
/// of the air in cornell and office are 0.98 to 1 and 1.05 to 1.08 times as large, those of pictures 1 to 1.04 and 0.95 to 0.99.
const BRIGHTEST: f64 = 0.001;

/// Variance that the points of a place, that is of a cell and a facing, are to be left with, as a share of the square of their light;
/// less where rows are scarce. Where there is more, noise shows as blotches. Twice as much: 0.99 to 1.05
/// times the errors in pictures of two_rooms_open's dark side, cornell, courtyard and office, for 0.99 times the time.
const NOISE: f64 = 0.02;

/// Side of the patches that paths end at, spacings. In two_rooms_open's dark side, thin_wall, cornell and courtyard errors are the
/// same within 1 % with twice that; with half of it paths end later, and a fit takes 1.4 times as long.
const PATCH: f32 = 0.25;

/// Paths for the patches from each point on surfaces. Twice as many in all: the same errors in these scenes within 1 %.
pub const PATCH_PATHS: usize = 2;

/// Points whose light is traced at a time, and kept together.
const AT_ONCE: usize = 1 << 14;

/// Light that a fit before has traced, which was interrupted, in blocks of [`AT_ONCE`] points.
pub trait Traced {
    /// What was kept of a block.
    fn known(&mut self, block: u32) -> Option<Vec<u8>>;

    fn keep(&mut self, block: u32, bytes: &[u8]);
}

/// Keeps nothing.
impl Traced for () {
    fn known(&mut self, _: u32) -> Option<Vec<u8>> {
        None
    }

    fn keep(&mut self, _: u32, _: &[u8]) {}
}

/// The light at all points that count, the rays that it took and how many paths were not finite and count as 0. `spacing` is that of
/// the probes, metres.
pub fn trace(
    world: &World,
    asked: &[Asked],
    settings: &RowSettings,
    spacing: f32,
    seed: u64,
    traced: &mut impl Traced,
    advance: &(impl Fn(u64) + Sync),
) -> (Vec<Target>, RayCount, u64) {
    /// Points between two steps of the bar.
    const STEP: usize = 256;
    let on_surface = asked.iter().filter(|asked| asked.kind != Kind::Air);
    let expected = world.expect(on_surface.map(|asked| world.places.key_of(&asked.surface)).collect());
    let path = PathSettings { expected: Some(&expected), ..PathSettings::default() };
    let on_surfaces: Vec<&SurfacePoint> =
        asked.iter().filter(|asked| asked.kind == Kind::Surface).map(|asked| &asked.surface).collect();
    let ray = |index: usize| {
        let point = on_surfaces[index / PATCH_PATHS];
        let mut random = Random::new(seed, Purpose::CacheRays, index as u64, 0);
        let direction = cosine_hemisphere(point.geometric_normal, random.pair());
        Ray::new(point.ray_origin(), direction, random.bits())
    };
    let rays = PATCH_PATHS * on_surfaces.len();
    let (cache, cache_rays) = world.irradiance_cache(rays, ray, PATCH * spacing, &path, seed);
    let path = PathSettings { cache: Some(&cache), ..path };
    let tracer = Tracer { world, path: &path, seed };
    let least = |index: usize| settings.paths(asked[index].kind)[0];
    let mut tallies = vec![Tally::default(); asked.len()];
    let first = |index: usize, tally: &mut Tally| {
        if index.is_multiple_of(STEP) {
            advance(STEP as u64);
        }
        tracer.add(&asked[index], index, 0..least(index), tally);
    };
    in_blocks(&mut tallies, 0, traced, first);
    let times = times(world, asked, &tallies, settings);
    let more = |index: usize, tally: &mut Tally| {
        if asked[index].kind != Kind::Air {
            let times = times.get(&world.places.key_of(&asked[index].surface)).copied().unwrap_or(1);
            tracer.add(&asked[index], index, least(index)..times * least(index), tally);
        }
    };
    in_blocks(&mut tallies, 1, traced, more);
    let rays = cache_rays + tallies.iter().map(|tally| tally.rays).sum();
    let lost = tallies.iter().map(|tally| tally.non_finite).sum();
    (tallies.iter().map(Tally::target).collect(), rays, lost)
}

/// Adds to all tallies, block by block, or takes over what was kept of a block; `pass` 0 or 1 tells blocks of two passes apart.
fn in_blocks(tallies: &mut [Tally], pass: u32, traced: &mut impl Traced, add: impl Fn(usize, &mut Tally) + Sync) {
    for (block, part) in tallies.chunks_mut(AT_ONCE).enumerate() {
        let key = pass << 31 | block as u32;
        match traced.known(key).filter(|bytes| bytes.len() == part.len() * Tally::BYTES) {
            Some(bytes) => {
                part.iter_mut().zip(bytes.as_chunks().0).for_each(|(tally, bytes)| *tally = Tally::of_bytes(bytes))
            }
            None => {
                part.par_iter_mut().enumerate().for_each(|(i, tally)| add(block * AT_ONCE + i, tally));
                traced.keep(key, part.iter().map(|tally| tally.to_bytes()).collect::<Vec<_>>().as_flattened());
            }
        }
    }
}

/// How many times as many paths the points of places need. They decide together, so that what one finds by chance is not what it
/// is weighed by.
fn times(world: &World, asked: &[Asked], tallies: &[Tally], settings: &RowSettings) -> HashMap<usize, u32> {
    let [least, most] = settings.paths(Kind::Surface);
    let mut places: HashMap<usize, (f64, f64)> = HashMap::new();
    for (asked, tally) in
        asked.iter().zip(tallies).filter(|(asked, tally)| asked.kind == Kind::Surface && tally.count > 0)
    {
        let target = tally.target();
        let (noise, light) = places.entry(world.places.key_of(&asked.surface)).or_default();
        *noise += f64::from(target.noise);
        *light += f64::from(target.runs[0].length_squared()) / 3.0;
    }
    let times = |(noise, light): (f64, f64)| {
        let wanted = NOISE / f64::from(settings.scarcity()) * (light - noise).max(0.0);
        if noise > wanted { (noise / wanted).ceil().min(f64::from(most / least)) as u32 } else { 1 }
    };
    places.into_iter().map(|(key, sums)| (key, times(sums))).collect()
}

/// Sums over the paths of a point.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    /// Of one run, or of two.
    sums: [Vec3; 2],
    runs: u32,
    /// Of the first run; mean of the channels.
    squares: f32,
    /// Paths of a run.
    count: u32,
    rays: RayCount,
    non_finite: u64,
}

impl Tally {
    const BYTES: usize = 60;

    /// Little-endian. Inverse: [`Self::of_bytes`].
    fn to_bytes(self) -> [u8; Tally::BYTES] {
        let [a, b] = self.sums;
        let floats = [a.x, a.y, a.z, b.x, b.y, b.z, self.squares].map(f32::to_bits);
        let long = [self.rays.primary, self.rays.shadow, self.non_finite];
        let halves = long.into_iter().flat_map(|n| [n as u32, (n >> 32) as u32]);
        let words = floats.into_iter().chain([self.runs, self.count]).chain(halves);
        let mut bytes = [0; Tally::BYTES];
        bytes.as_chunks_mut::<4>().0.iter_mut().zip(words).for_each(|(to, word)| *to = word.to_le_bytes());
        bytes
    }

    fn of_bytes(bytes: &[u8; Tally::BYTES]) -> Tally {
        let words = bytes.as_chunks::<4>().0;
        let word = |i: usize| u32::from_le_bytes(words[i]);
        let vector = |i: usize| Vec3::from_array([i, i + 1, i + 2].map(|i| f32::from_bits(word(i))));
        let long = |i: usize| u64::from(word(i)) | u64::from(word(i + 1)) << 32;
        Tally {
            sums: [vector(0), vector(3)],
            squares: f32::from_bits(word(6)),
            runs: word(7),
            count: word(8),
            rays: RayCount { primary: long(9), shadow: long(11) },
            non_finite: long(13),
        }
    }

    fn target(&self) -> Target {
        let count = self.count.max(1) as f32;
        let mean = self.sums[0] / count;
        let noise = match self.count {
            0 | 1 => 0.0,
            _ => (self.squares / count - mean.length_squared() / 3.0).max(0.0) / (count - 1.0),
        };
        Target { runs: [mean, if self.runs > 1 { self.sums[1] / count } else { mean }], noise, paths: self.count }
    }
}

struct Tracer<'a, 's> {
    world: &'a World<'s>,
    path: &'a PathSettings<'a>,
    seed: u64,
}

impl Tracer<'_, '_> {
    /// Adds some paths of a point, those of these numbers. Points that judge have two runs.
    fn add(&self, asked: &Asked, index: usize, samples: Range<u32>, tally: &mut Tally) {
        if !asked.is_fitted && !asked.is_held_out {
            return;
        }
        tally.runs = if asked.is_held_out { 2 } else { 1 };
        for run in 0..tally.runs {
            for sample in samples.clone() {
                // Blocks of two runs are of different parity.
                let block = u64::from(2 * (sample / BLOCK) + run);
                let block = Block::new(self.seed, Purpose::FitPaths, (asked.kind as u64) << 48 | index as u64, block);
                let mut numbers = block.sample(sample % BLOCK);
                let query = &asked.query;
                let (surface, rays) = (&asked.surface, &mut tally.rays);
                let gathered = self.world.gather(surface, query.normal, query.view, self.path, &mut numbers, rays);
                if !gathered.irradiance.is_finite() {
                    tally.non_finite += 1;
                    continue;
                }
                tally.sums[run as usize] += gathered.irradiance;
                if run == 0 {
                    tally.squares += gathered.irradiance.length_squared() / 3.0;
                }
            }
        }
        tally.count += samples.len() as u32;
    }
}

/// Which points are not among the brightest of the air.
pub fn without_brightest(asked: &[Asked], targets: &[Target]) -> Vec<bool> {
    let mut lit = vec![true; asked.len()];
    let mut air: Vec<usize> = (0..asked.len()).filter(|&i| asked[i].kind == Kind::Air).collect();
    let light = |i: usize| luminance(targets[i].mean());
    air.sort_by(|&a, &b| light(b).total_cmp(&light(a)).then(a.cmp(&b)));
    air.iter().take((air.len() as f64 * BRIGHTEST).ceil() as usize).for_each(|&i| lit[i] = false);
    lit
}

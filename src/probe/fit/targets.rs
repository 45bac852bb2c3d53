//! The path-traced light at the points that ask: what probes store, indirect light and all that emitters send.

use glam::Vec3;
use rayon::prelude::*;

use super::points::{Asked, Kind};
use super::settings::RowSettings;
use crate::light::World;
use crate::light::path::PathSettings;
use crate::light::sampled::RayCount;
use crate::math::blocks::{BLOCK, Block};
use crate::math::color::luminance;
use crate::math::random::Purpose;

/// Irradiance, W·m⁻², of one or two independent runs. Points that judge have two: the product of the differences from both
/// has no noise in the mean.
#[derive(Debug, Clone, Copy, Default)]
pub struct Target {
    pub runs: [Vec3; 2],
    /// Variance of the first run's mean, as if its paths were independent; mean of the channels.
    pub noise: f32,
}

impl Target {
    pub fn mean(&self) -> Vec3 {
        0.5 * (self.runs[0] + self.runs[1])
    }
}

/// Share of the points in the air that are left out, the brightest: those within a finger of a lamp. With 0.01 and 0.05 errors of
/// the air in two_rooms_open, thin_wall and office are 1.03 to 1.05 and 1.06 to 1.1 times as large.
const BRIGHTEST: f64 = 0.002;

/// The light at all points that count, the rays that it took and how many paths were not finite and count as 0.
pub fn trace(
    world: &World,
    asked: &[Asked],
    settings: &RowSettings,
    seed: u64,
    advance: &(impl Fn(u64) + Sync),
) -> (Vec<Target>, RayCount, u64) {
    /// Points between two steps of the bar.
    const STEP: usize = 256;
    let on_surface = asked.iter().filter(|asked| asked.kind != Kind::Air);
    let expected = world.expect(on_surface.map(|asked| world.places.key_of(&asked.surface)).collect());
    let path = PathSettings { expected: Some(&expected), ..PathSettings::default() };
    let at = |(index, asked): (usize, &Asked)| -> (Target, RayCount, u64) {
        if index % STEP == 0 {
            advance(STEP as u64);
        }
        let (mut target, mut rays, mut non_finite) = (Target::default(), RayCount::default(), 0);
        if !asked.is_fitted && !asked.is_held_out {
            return (target, rays, non_finite);
        }
        let runs = if asked.is_held_out { 2 } else { 1 };
        for run in 0..runs {
            let (mut sum, mut squares) = (Vec3::ZERO, 0.0);
            for sample in 0..settings.paths {
                // Blocks of two runs are of different parity.
                let block = u64::from(2 * (sample / BLOCK) + run);
                let block = Block::new(seed, Purpose::FitPaths, (asked.kind as u64) << 48 | index as u64, block);
                let mut numbers = block.sample(sample % BLOCK);
                let query = &asked.query;
                let gathered = world.gather(&asked.surface, query.normal, query.view, &path, &mut numbers, &mut rays);
                match gathered.irradiance.is_finite() {
                    true => {
                        sum += gathered.irradiance;
                        squares += gathered.irradiance.length_squared() / 3.0;
                    }
                    false => non_finite += 1,
                }
            }
            let count = settings.paths as f32;
            target.runs[run as usize] = sum / count;
            if run == 0 && settings.paths > 1 {
                target.noise = (squares / count - (sum / count).length_squared() / 3.0).max(0.0) / (count - 1.0);
            }
        }
        if runs == 1 {
            target.runs[1] = target.runs[0];
        }
        (target, rays, non_finite)
    };
    let found: Vec<_> = asked.par_iter().enumerate().map(at).collect();
    let mut rays = RayCount::default();
    let mut lost = 0;
    for (_, of, non_finite) in &found {
        rays = RayCount { primary: rays.primary + of.primary, shadow: rays.shadow + of.shadow };
        lost += non_finite;
    }
    (found.into_iter().map(|(target, ..)| target).collect(), rays, lost)
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

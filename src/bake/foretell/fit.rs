//! What a fit takes, from some of its paths.

use std::hint::black_box;

use rayon::prelude::*;

use crate::light::World;
use crate::light::path::PathSettings;
use crate::light::sampled::RayCount;
use crate::light::sides::Sides;
use crate::light::surface::SurfacePoint;
use crate::math::blocks::{BLOCK, Block};
use crate::math::random::{KroneckerSequence, Purpose, Random};
use crate::probe::Grid;
use crate::probe::fit::{self, Fit};
use crate::system::processor::processor_seconds;

/// Seconds of a fit: what its paths take, from some points of surfaces, and the rest in proportion.
pub fn seconds(fit: &Fit, world: &World, grid: &Grid, active: usize) -> f64 {
    /// Points that paths are traced from, and paths from each.
    const POINTS: usize = 64;
    const PATHS: u32 = 4;
    /// How often these same paths are timed, after a first time: there, places of the scene learn which emitters they see, and
    /// most of the paths of a fit find that done.
    const TIMES: u32 = 4;
    /// Points that are tried for each that is found.
    const TRIES: usize = 16;
    /// A fit's time ÷ that of its paths: points are chosen, rows made and solved.
    const REST: f64 = 1.4;
    let paths = fit::paths(fit, active);
    let Some(sides) = Sides::of(world.scene).filter(|_| paths.short > 0.0) else { return 0.0 };
    let hull = grid.hull(1.0);
    let mut random = Random::new(0, Purpose::FitPoints, u64::MAX, 0);
    let mut numbers = KroneckerSequence::new(&mut random);
    let places = numbers.by_ref().take(TRIES * POINTS).filter_map(|numbers| {
        let place = sides.place(numbers);
        let point = world.point_at(&place);
        let is_within = point.position.cmpge(hull.0).all() && point.position.cmple(hull.1).all();
        (is_within && world.is_seen(&place, &point, || numbers[3])).then_some(point)
    });
    let some: Vec<SurfacePoint> = places.take(POINTS).collect();
    let expected = world.expect(some.iter().map(|point| world.places.key_of(point)).collect());
    let whole = PathSettings { expected: Some(&expected), ..PathSettings::default() };
    // What the second ray takes stands for asking what is known where the first one hits.
    let short = PathSettings { max_bounces: Some(1), ..whole };
    let of_path = |settings: &PathSettings| {
        let trace = |(i, point): (usize, &SurfacePoint)| {
            for sample in 0..PATHS {
                let block = Block::new(0, Purpose::FitPaths, i as u64, u64::from(sample / BLOCK));
                let (normal, mut rays) = (point.shading_normal, RayCount::default());
                let mut numbers = block.sample(sample % BLOCK);
                black_box(world.gather(point, normal, normal, settings, &mut numbers, &mut rays));
            }
        };
        some.par_iter().enumerate().for_each(trace);
        let started = processor_seconds();
        (0..TIMES).for_each(|_| some.par_iter().enumerate().for_each(trace));
        (processor_seconds() - started) / f64::from(TIMES * PATHS) / some.len().max(1) as f64
    };
    let all = of_path(&whole) * paths.whole + of_path(&short) * paths.short;
    REST * all / rayon::current_num_threads() as f64
}

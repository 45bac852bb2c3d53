//! The fit: values of the probes that interpolate best.
//!
//! The irradiance where a probe stands is not the best value to interpolate: beside a lamp or behind a wall's edge it says
//! little about the surfaces around. The fit chooses the values by least squares instead, so that the look-up itself gives
//! the path-traced irradiance at random points (Kavan, Bargteil & Sloan, *Least Squares Vertex Baking*, 2011, do it for
//! vertices). What a look-up costs, and the layout, stay the same.
//!
//! [`points`] chooses where, [`targets`] traces the light there, [`rows`] is the look-up as a sparse matrix, by the query's
//! own weights, and [`solve`] the solver. The probes then hold no physical light any more.

mod figures;
pub mod normal;
pub mod points;
pub mod rows;
mod settings;
pub mod solve;
mod targets;
#[cfg(test)]
mod tests;

use std::time::Instant;

use glam::{DVec3, Vec3, Vec3A};
use rayon::prelude::*;

pub use self::figures::FitFigures;
use self::points::Asked;
use self::rows::{Row, Rows};
pub use self::settings::{Fit, Kind, RowSettings};
pub use self::targets::Traced;
use crate::light::World;
use crate::probe::Volume;
use crate::probe::query::{Answers, Query, QuerySettings};
use crate::probe::store::irradiance::Factors;

/// Times that unknowns below 0 are held there and the others solved for again, where none may be negative.
pub const ROUNDS: u32 = 3;

/// What is left of a probe's mean at least, as a share of what it was before the fit: floors under negative sums are shares of
/// it, and none is to be black.
const LEAST_MEAN: f64 = 0.005;

/// A look-up whose values are fitted. They are the prior too: unknowns that no row asks for keep their values.
pub trait Fitted: Sync {
    fn look_up(&self) -> impl Answers;

    /// The row of a point.
    fn row(&self, asked: &Asked, target: Vec3) -> Row;

    /// Fits the values to rows. Returns the iterations of the solver.
    fn solve(&mut self, rows: Vec<Row>, settings: &RowSettings) -> u32;
}

/// A volume by the weights of its own method.
struct OfVolume<'a> {
    volume: &'a mut Volume,
    settings: &'a QuerySettings,
}

impl Fitted for OfVolume<'_> {
    fn look_up(&self) -> impl Answers {
        Query { volume: self.volume, settings: self.settings }
    }

    fn row(&self, asked: &Asked, target: Vec3) -> Row {
        Row::of(self.settings, self.volume, asked, target)
    }

    fn solve(&mut self, rows: Vec<Row>, settings: &RowSettings) -> u32 {
        fit_rows(self.volume, rows.into_iter(), settings)
    }
}

/// Fits the volume's irradiance. `None` where the settings ask for no fit. `traced` keeps light for a fit that goes on after an
/// interruption; `advance` is called with the steps done of [`steps`].
pub fn run(
    fit: &Fit,
    world: &World,
    query: &QuerySettings,
    volume: &mut Volume,
    seed: u64,
    traced: &mut impl Traced,
    advance: impl Fn(u64) + Sync,
) -> Option<FitFigures> {
    let Fit::Rows(settings) = fit else { return None };
    Some(run_on(&mut OfVolume { volume, settings: query }, settings, world, seed, traced, advance))
}

/// Fits what a look-up reads, whoever's it is.
pub fn run_on(
    fitted: &mut impl Fitted,
    settings: &RowSettings,
    world: &World,
    seed: u64,
    traced: &mut impl Traced,
    advance: impl Fn(u64) + Sync,
) -> FitFigures {
    let started = Instant::now();
    let asked = points::all(world, &fitted.look_up(), settings);
    let (targets, rays, non_finite) =
        targets::trace(world, &asked, settings, fitted.look_up().grid().spacing_min(), seed, traced, &advance);
    let before = figures::residuals(&fitted.look_up(), &asked, &targets);
    let lit = targets::without_brightest(&asked, &targets);
    let counts = |i: usize| asked[i].is_fitted && !asked[i].is_held_out && lit[i];
    let chosen: Vec<usize> = (0..asked.len()).filter(|&i| counts(i)).collect();
    let row = |&i: &usize| Row { noise: targets[i].noise, ..fitted.row(&asked[i], targets[i].mean()) };
    let rows: Vec<Row> = chosen.par_iter().map(row).collect();
    let iterations = fitted.solve(rows, settings);
    let after = figures::residuals(&fitted.look_up(), &asked, &targets);
    let count = |of: fn(&Asked) -> bool| asked.iter().filter(|a| of(a)).count();
    FitFigures {
        rows: chosen.len(),
        rows_held_out: count(|a| a.is_held_out),
        rows_dropped: count(|a| !a.is_fitted),
        paths: chosen.iter().map(|&i| f64::from(targets[i].paths)).sum::<f64>() / chosen.len().max(1) as f64,
        iterations,
        held_out_before: before.surface,
        held_out_after: after.surface,
        held_out_bent_before: before.bent,
        held_out_bent_after: after.bent,
        air_before: before.air,
        air_after: after.air,
        negative_share: after.negative,
        non_finite,
        rays,
        time_s: started.elapsed().as_secs_f64(),
    }
}

/// Fits a volume to rows. Returns the iterations of the solver.
pub fn fit_rows(volume: &mut Volume, rows: impl Iterator<Item = Row>, settings: &RowSettings) -> u32 {
    let factors = volume.irradiance.factors();
    let unknowns = volume.irradiance.fitted_unknowns();
    let mut rows = Rows::new(&factors, volume.states.len(), unknowns, rows);
    let prior: Vec<Vec3A> = (0..volume.states.len()).flat_map(|p| volume.irradiance.fitted(p)).collect();
    let lambda = firmness(&rows, &factors, &prior, settings.lambda);
    let lightens = volume.irradiance.signed().is_some();
    let mut task = solve::Task { rows: &mut rows, prior: &prior, lambda, iterations: settings.iterations, lightens };
    // Irradiance is nowhere negative. Coefficients have signs, but for the mean of all directions.
    let solved = match volume.irradiance.signed() {
        None => task.solve(ROUNDS),
        Some(_) => task.solve_above(ROUNDS, |i| match i % unknowns {
            0 => prior[i].as_dvec3() * LEAST_MEAN,
            _ => DVec3::NEG_INFINITY,
        }),
    };
    let asked = rows.asked();
    for (p, values) in solved.values.chunks(unknowns).enumerate().filter(|(p, _)| asked[*p]) {
        volume.irradiance.set_fitted(p, values);
    }
    solved.iterations
}

/// λ of each unknown. Where rows say less about what a probe is beyond its prior than their noise does, it is held more firmly:
/// noise would make blotches of it.
pub fn firmness(rows: &Rows, factors: &Factors, prior: &[Vec3A], lambda: f32) -> Vec<f64> {
    /// Of λ, for each unit of [`Rows::noisiness`]. From 0 to 0.6 errors in pictures of two_rooms_open, thin_wall, cornell, courtyard
    /// and veach_ajar change by −1, +1, +5, +6 and 0 %, at 0.4 that of bathroom by +6 %; pixels more than a quarter off exact visibility fall by a third to a half.
    const PER_NOISE: f64 = 0.4;
    let before: Vec<DVec3> = prior.iter().map(|x| x.as_dvec3()).collect();
    let firm: Vec<f64> = rows.noisiness(&before).iter().map(|noisy| 1.0 + PER_NOISE * noisy).collect();
    let unknowns = rows.unknowns();
    let of_unknown = |i: usize| f64::from(lambda) * factors.stiffness(i % unknowns) * firm[i / unknowns];
    (0..prior.len()).map(of_unknown).collect()
}

/// Memory of rows and solver for so many active probes of so many unknowns.
pub fn bytes(fit: &Fit, active: u64, unknowns: u64) -> u64 {
    match fit {
        Fit::None => 0,
        Fit::Rows(settings) => {
            let points = 2 * u64::from(settings.rows_per_probe) * active;
            points * Row::BYTES + normal::bytes(active, unknowns) + solve::bytes(active * unknowns)
        }
    }
}

/// The same as it is to be expected.
pub fn likely_bytes(fit: &Fit, active: u64, unknowns: u64) -> u64 {
    /// Of a point: its parts are fewer than eight, and not all of it is there at the same time. Measured: 471 in office, 507 in
    /// courtyard, 585 in two_rooms_open, 449 in veach_ajar.
    const POINT: u64 = 520;
    match fit {
        Fit::None => 0,
        Fit::Rows(settings) => {
            let points: usize = settings.points(active as usize).iter().sum();
            points as u64 * POINT + normal::bytes(active, unknowns) + solve::bytes(active * unknowns)
        }
    }
}

/// Steps of a run that `advance` counts.
pub fn steps(fit: &Fit, active: usize) -> usize {
    match fit {
        Fit::None => 0,
        Fit::Rows(settings) => settings.points(active).iter().sum(),
    }
}

/// Paths of a fit, about.
#[derive(Debug, Clone, Copy, Default)]
pub struct Paths {
    /// From all points, those that judge counted twice, half-way between the least and the most. They end where light is known.
    pub short: f64,
    /// By which it gets known.
    pub whole: f64,
}

pub fn paths(fit: &Fit, active: usize) -> Paths {
    let Fit::Rows(settings) = fit else { return Paths::default() };
    let points = settings.points(active);
    let [least, most] = settings.paths(Kind::Surface);
    let all = points.iter().sum::<usize>() as f64 * (1.0 + 1.0 / points::HELD_OUT as f64);
    Paths { short: all * f64::from(least.midpoint(most)), whole: (points[0] * targets::PATCH_PATHS) as f64 }
}

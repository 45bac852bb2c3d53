//! Bounces: light goes from probes to the surfaces they captured and back, until nothing changes.
//!
//! The [`sweep`](crate::probe::transport::operator) is an affine map E ← E⁰ + T·E of the probes' irradiance. Repeating it (Jacobi's iteration)
//! adds a bounce a sweep, and what is missing shrinks by about the mean albedo: 44 sweeps to one percent at 0.9, 4,600 at
//! 0.999. Where the measured ratio says that this would take many sweeps, they are combined instead, see
//! [`anderson`](crate::probe::transport::anderson): about ten then do, at the cost of a sweep each.
//!
//! The residual of E is g(E) − E, in the max norm: for a filter and weights that are means, ‖T‖∞ bounds how far E is from
//! the solution, ‖E − E*‖∞ ≤ ‖r‖∞/(1 − ‖T‖∞), whichever way E was found.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::math::color::luminance;
use crate::probe::store::volume::Volume;
use crate::probe::transport::anderson::History;
use crate::probe::transport::operator::{Captures, Field, Masks, Sweep, field_of, store};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SolverSettings {
    /// Most bounces between probes; 0 leaves only light that reaches the captured surfaces directly. `None`: all.
    pub max_bounces: Option<u32>,
    /// Most sweeps where the number of bounces is not limited, however many are still missing.
    pub max_sweeps: u32,
    pub acceleration: Acceleration,
    /// Stop when the bounces still missing are estimated below this share of the largest irradiance.
    pub tolerance: f32,
    /// Albedos are clamped to this.
    pub albedo_max: f32,
}

/// Whether sweeps are combined so that few do for many bounces. With a number of bounces they never are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Acceleration {
    Never,
    /// When plain sweeps would go on for long.
    Auto,
    /// From the second sweep on.
    Always,
}

impl Default for SolverSettings {
    fn default() -> Self {
        SolverSettings {
            max_bounces: None,
            max_sweeps: 256,
            acceleration: Acceleration::Auto,
            tolerance: 1e-4,
            albedo_max: 0.999,
        }
    }
}

impl SolverSettings {
    /// Whether differences of iterates are worth keeping.
    pub fn may_accelerate(&self) -> bool {
        self.max_bounces.is_none() && self.acceleration != Acceleration::Never
    }

    /// Bounces, or sweeps, after which there are no more.
    pub fn most(&self) -> u32 {
        self.max_bounces.unwrap_or(self.max_sweeps)
    }
}

/// Plain sweeps still to come from which on combining them pays: it takes some itself to learn from.
const MANY_SWEEPS: f64 = 6.0;

/// A residual of so many roundings of the largest irradiance is as small as single precision makes it, if it does not
/// shrink any more either.
const ROUNDINGS: f64 = 16.0;

/// One sweep.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounce {
    pub index: u32,
    /// Largest change of any irradiance texel by this sweep ÷ largest irradiance texel.
    pub residual: f64,
    /// Mean luminance of the irradiance that would be stored after this sweep: over all interior texels of active probes,
    /// with the emission that probes see themselves, before encoding, W·m⁻². Known when all sweeps are done: until then
    /// without emission that is sampled.
    pub energy: f64,
    /// Whether the sweep began from a combination of those before it; else it adds one bounce.
    pub accelerated: bool,
}

/// How far the iteration has come; at its end, the result's figures.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Solution {
    pub bounces: Vec<Bounce>,
    pub converged: bool,
    /// Largest Ritz value where sweeps may be combined, else the ratio of the last two changes
    /// in the 2-norm; `None` before there is one.
    pub spectral_radius_estimate: Option<f64>,
    /// Largest change of any irradiance texel in the last sweep, per channel, W·m⁻²; `None` before there was a second.
    pub last_change: Option<[f64; 3]>,
    /// ‖T‖∞ per channel, at most the largest albedo; `None` before the first sweep.
    pub operator_norm: Option<[f64; 3]>,
    /// No texel is farther than this from the solution of the equations, W·m⁻², encoding apart; `None` without a second
    /// sweep or where the operator is not linear.
    pub error_bound: Option<f64>,
    /// The same ÷ largest irradiance texel.
    pub error_bound_relative: Option<f64>,
    /// Channels of sweeps that went on plainly because combining the sweeps before had let the residual rise.
    pub plain_fallbacks: u64,
    /// Texels that a combination had left negative, and that a plain sweep went on from as 0 or as they were before.
    pub negative_texels: u64,
    /// Sweeps beside those of the iteration, to learn the spectral radius.
    pub probing_sweeps: usize,
    pub non_finite: u64,
    /// Whether so little is missing that only negative texels keep it from being converged.
    settled: bool,
    /// Whether sweeps are being combined.
    accelerating: bool,
    /// Sweeps since the residual last halved, and what it then was.
    stalled: u32,
    smallest_residual: Option<f64>,
    /// 2-norm of the last change.
    last_norm: Option<f64>,
}

/// Between two sweeps: what a checkpoint must hold besides the volume's irradiance.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    pub solution: Solution,
    /// Absent where sweeps are not combined.
    pub history: Option<History>,
}

/// A sweep's figures, per channel where they are vectors.
struct Measured {
    change: Vec3,
    /// 2-norm of all changes: unlike the largest, it is not a multiple of one texel's rounding.
    change_norm: f64,
    largest: Vec3,
    energy: f64,
    /// Texels below 0 after the sweep.
    negative: u64,
}

/// Fills the volume's irradiance. Its positions, states and visibility must stand already; after an interruption its
/// irradiance too, as it was when `progress` was reported.
pub fn solve<C: Captures>(
    sweep: &Sweep<C>,
    settings: &SolverSettings,
    volume: &mut Volume,
    mut progress: State,
    mut on_sweep: impl FnMut(&State, &Volume),
) -> Solution {
    let is_linear = sweep.is_linear(volume);
    let mut masks: Option<Masks> = None;
    let most = settings.most();
    let first = progress.solution.bounces.len() as u32;
    if first == 0 {
        progress.solution.operator_norm = Some(sweep.norm(volume).as_dvec3().to_array());
    }
    for index in first..=most {
        if progress.solution.converged {
            break;
        }
        // Before the first sweep there is nothing in the probes to ask for.
        let masks = (index > 0).then(|| &*masks.get_or_insert_with(|| sweep.masks(volume)));
        let x = field_of(volume);
        let (g, non_finite) = sweep.apply(volume, masks);
        let measured = measure(&x, &g);
        let solution = &mut progress.solution;
        let rising =
            solution.last_change.map_or([false; 3], |last| [0, 1, 2].map(|c| measured.change[c] as f64 > last[c]));
        solution.add(index, &measured, non_finite);
        if settings.may_accelerate() {
            progress.history.get_or_insert_with(|| History::new(x.len())).push(&x, g.clone());
        }
        if index > 0 {
            let gap = 1.0 - solution.norm_bound().unwrap_or(f64::from(settings.albedo_max));
            let ritz = progress.history.as_ref().and_then(|history| history.spectral_radius(gap));
            solution.judge(&measured, ritz, is_linear, settings);
        }
        if let Some(history) = progress.history.as_mut().filter(|history| {
            solution.accelerating && is_linear && !history.knows_image_of_ones() && !solution.converged
        }) && let Some(image) = image_of_ones(sweep, volume, masks, history.origin())
        {
            history.set_image_of_ones(image);
            solution.probing_sweeps += 1;
        }
        if solution.converged || index == most {
            progress.history = None;
        }
        let next = match &mut progress.history {
            // The light itself is nowhere negative: a plain sweep from what is not tells whether that was all.
            _ if measured.negative > 0 && (solution.settled || index == most) => {
                solution.negative_texels += measured.negative;
                g.into_iter().map(|e| e.max(Vec3::ZERO)).collect()
            }
            Some(history) if solution.accelerating => {
                solution.plain_fallbacks += rising.iter().filter(|&&r| r).count() as u64;
                if !is_linear && rising.contains(&true) {
                    history.forget();
                }
                let (next, negative) = history.next(rising.map(|r| !r), !is_linear);
                solution.negative_texels += negative;
                next
            }
            _ => g,
        };
        store(volume, &next);
        on_sweep(&progress, volume);
    }
    let mut solution = progress.solution;
    if !sweep.gathers_emission {
        let emitted = sweep.add_emission(volume);
        solution.bounces.iter_mut().for_each(|bounce| bounce.energy += emitted);
    }
    solution
}

/// T·1, by a sweep of its own, where g(0) is known. Spoils the volume's irradiance.
fn image_of_ones<C: Captures>(
    sweep: &Sweep<C>,
    volume: &mut Volume,
    masks: Option<&Masks>,
    origin: Option<&Field>,
) -> Option<Field> {
    let origin = origin?;
    // As large as what is subtracted, so that little is lost in the difference.
    let scale = origin.iter().copied().fold(Vec3::ZERO, Vec3::max).max_element();
    if scale <= 0.0 || !scale.is_finite() {
        return None;
    }
    store(volume, &vec![Vec3::splat(scale); origin.len()]);
    let (g, _) = sweep.apply(volume, masks);
    Some(g.iter().zip(origin).map(|(g, origin)| (*g - *origin) / scale).collect())
}

impl Solution {
    /// No eigenvalue of the bounces' operator is larger; `None` before the first sweep.
    pub fn norm_bound(&self) -> Option<f64> {
        self.operator_norm.map(|norm| norm.into_iter().fold(0.0, f64::max))
    }

    fn add(&mut self, index: u32, measured: &Measured, non_finite: u64) {
        let largest = f64::from(measured.largest.max_element());
        let change = f64::from(measured.change.max_element());
        let residual = if largest > 0.0 { change / largest } else { 0.0 };
        let accelerated = self.accelerating;
        self.bounces.push(Bounce { index, residual, energy: measured.energy, accelerated });
        self.non_finite += non_finite;
    }

    /// What the sweep's change says: how much is still missing, and whether to go on plainly.
    fn judge(&mut self, measured: &Measured, ritz: Option<f64>, is_linear: bool, settings: &SolverSettings) {
        let change = measured.change.as_dvec3();
        let largest = f64::from(measured.largest.max_element());
        let (change_max, residual) = (change.max_element(), self.bounces.last().map_or(0.0, |b| b.residual));
        let ratio = self.last_norm.filter(|&before| before > 0.0).map(|before| measured.change_norm / before);
        self.last_norm = Some(measured.change_norm);
        // Every sweep adds a direction to look in. Changes alone tell it only while sweeps are plain.
        let plain_ratio = ratio.filter(|_| self.spectral_radius_estimate.is_none() || !settings.may_accelerate());
        if let Some(estimate) = ritz.or(plain_ratio) {
            self.spectral_radius_estimate = Some(estimate);
        }
        // Of an operator that is not symmetric, Ritz values can lie beyond its eigenvalues, but these not beyond its norm.
        let norm = self.norm_bound().filter(|_| is_linear);
        if let (Some(estimate), Some(norm)) = (&mut self.spectral_radius_estimate, norm) {
            *estimate = estimate.min(norm);
        }
        // What is still to come after the sweep is a geometric series in the spectral radius.
        let radius = self.spectral_radius_estimate.unwrap_or(f64::from(settings.albedo_max));
        let missing = if radius < 1.0 { residual * radius / (1.0 - radius) } else { f64::INFINITY };
        let tolerance = f64::from(settings.tolerance);
        if self.smallest_residual.is_none_or(|smallest| residual < 0.5 * smallest) {
            (self.smallest_residual, self.stalled) = (Some(residual), 0);
        } else {
            self.stalled += 1;
        }
        let at_rounding = self.stalled >= 3 && residual <= ROUNDINGS * f64::from(f32::EPSILON);
        self.last_change = Some(change.to_array());
        self.settled = change_max == 0.0 || missing <= tolerance || at_rounding;
        self.converged = self.settled && measured.negative == 0;
        if is_linear && let Some(norm) = self.operator_norm {
            // One sweep after x shrinks its error by the norm.
            let bound = |c: usize| if change[c] > 0.0 { change[c] * norm[c] / (1.0 - norm[c]) } else { 0.0 };
            let bound = [0, 1, 2].map(bound).into_iter().fold(0.0, f64::max);
            self.error_bound = Some(bound).filter(|b| b.is_finite() && *b >= 0.0);
            self.error_bound_relative = self.error_bound.filter(|_| largest > 0.0).map(|bound| bound / largest);
        }
        self.accelerating |= match settings.acceleration {
            _ if !settings.may_accelerate() => false,
            Acceleration::Never => false,
            Acceleration::Always => true,
            // A ratio needs two changes, the first of which is from nothing.
            Acceleration::Auto => {
                ratio.is_some() && missing > tolerance && missing_sweeps(radius, missing, tolerance) > MANY_SWEEPS
            }
        };
    }
}

/// Plain sweeps until what is missing falls below the tolerance.
fn missing_sweeps(ratio: f64, missing: f64, tolerance: f64) -> f64 {
    if ratio >= 1.0 || tolerance <= 0.0 {
        return f64::INFINITY;
    }
    (tolerance / missing).ln() / ratio.ln()
}

/// How much of a field a sweep has changed.
fn measure(x: &Field, g: &Field) -> Measured {
    let mut measured = Measured { change: Vec3::ZERO, change_norm: 0.0, largest: Vec3::ZERO, energy: 0.0, negative: 0 };
    for (x, g) in x.iter().zip(g) {
        let change = *g - *x;
        measured.change = measured.change.max(change.abs());
        measured.change_norm += change.as_dvec3().length_squared();
        measured.largest = measured.largest.max(g.abs());
        measured.negative += u64::from(g.cmplt(Vec3::ZERO).any());
        measured.energy += f64::from(luminance(*g));
    }
    measured.change_norm = measured.change_norm.sqrt();
    measured.energy /= g.len().max(1) as f64;
    measured
}

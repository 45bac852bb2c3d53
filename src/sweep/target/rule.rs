//! Which bake comes next.
//!
//! The model: e² = b² + n²/k, where b, the error of interpolation and leaks, is ∝ spacingᵖ, and n is what random numbers of
//! the bake add, with k times the samples of the configuration. A finer grid lowers b, more samples n. Errors are not monotone in the
//! spacing, for how planes of probes meet walls is chance: p is measured from two steps and bounded.

/// The error that a step is made for, as a share of what is asked for: the rest is for the standard error and for chance.
const AIM: f64 = 0.9;

/// Bounds of the exponent p beyond the steps, and what it is before two steps tell. Linear interpolation has 2, leaks at edges
/// 1 or less; what two steps make of it is uncertain.
const EXPONENT: (f64, f64) = (0.7, 1.5);
/// Bounds between two steps.
const EXPONENT_BETWEEN: (f64, f64) = (0.5, 3.0);
const FIRST_EXPONENT: f64 = 1.0;

/// A step is no finer than this share of the spacing before: it has eight times the probes.
pub const FINEST_STEP: f64 = 0.5;
/// How far a spacing is foretold: thousands of times the probes are beyond any limit.
const FARTHEST: f64 = 1.0 / 16.0;
/// A step less fine than this would cost a bake and change little.
pub const LEAST_STEP: f64 = 0.85;

/// A grid that is good enough is given up for one coarser by this at least, with 1/1.7 of the probes, at most by the inverse
/// of [`FINEST_STEP`].
const LEAST_COARSER: f64 = 1.2;

/// A try between two spacings is this far from the coarser one at least.
const APART: f64 = 1.1;

/// Samples are raised until they have at most this share of the squared error that is aimed at, and at most so many times.
const NOISE_SHARE: f64 = 0.25;
const MOST_SAMPLES: u32 = 16;

/// The error falls if it does so at least by this exponent with the spacing, and at least to this share of the smallest
/// before: at a smaller exponent, half the error takes 400 times the probes.
const LEAST_EXPONENT: f64 = 0.35;
const LEAST_FALL: f64 = 0.97;
/// Steps that may fail to let it fall, one after another.
const MOST_FLAT: usize = 2;

/// Bakes at most, without that with another seed.
pub const MOST_STEPS: usize = 8;

/// Digits of a spacing that was chosen.
const DIGITS: i32 = 3;

/// A bake and what it is worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    pub spacing_m: f64,
    /// Samples ÷ those of the configuration.
    pub samples: u32,
    pub error: f64,
    pub standard_error: f64,
    pub bytes: u64,
}

/// A bake to be made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    pub spacing_m: f64,
    pub samples: u32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Next {
    Bake(Choice),
    /// A bake meets the error, and none that is much smaller promises to.
    Reached,
    /// The error does not fall any more.
    NotFalling,
    /// There were enough bakes.
    Steps,
}

impl Step {
    pub fn meets(&self, error: f64) -> bool {
        self.error + self.standard_error <= error
    }

    /// The part of the error that only the grid can lower, at least a tenth of it: noise is an estimate too.
    fn of_grid(&self, noise: f64) -> f64 {
        let square = self.error * self.error - noise * noise / f64::from(self.samples);
        square.max(0.01 * self.error * self.error).sqrt()
    }
}

/// Which step's file is to be kept: of those that meet the error the smallest, else that of the smallest error. The first
/// where several are alike; `None` where there is no step.
pub fn best(steps: &[Step], error: f64) -> Option<usize> {
    let all = || (0..steps.len()).map(|i| (i, &steps[i]));
    let smallest = all().filter(|(_, step)| step.meets(error)).min_by_key(|(_, step)| step.bytes);
    let least = || all().min_by(|(_, a), (_, b)| a.error.total_cmp(&b.error));
    smallest.or_else(least).map(|(i, _)| i)
}

/// What follows on these steps, at least one; `noise`: n, where it was measured.
pub fn next(steps: &[Step], error: f64, noise: Option<f64>) -> Next {
    let Some(best) = best(steps, error).map(|i| steps[i]) else { return Next::NotFalling };
    if best.meets(error) {
        return match coarser(steps, &best, error) {
            Some(choice) if steps.len() < MOST_STEPS => Next::Bake(choice),
            _ => Next::Reached,
        };
    }
    if is_flat(steps) {
        return Next::NotFalling;
    }
    if steps.len() >= MOST_STEPS {
        return Next::Steps;
    }
    Next::Bake(finer(steps, error, noise))
}

/// A bake with a smaller error than the finest step's.
pub fn finer(steps: &[Step], error: f64, noise: Option<f64>) -> Choice {
    let (noise, aim) = (noise.unwrap_or(0.0), AIM * error);
    let Some(finest) = finest(steps) else { return Choice { spacing_m: 1.0, samples: 1 } };
    let wanted = noise * noise / (NOISE_SHARE * aim * aim);
    let samples = (wanted.ceil().clamp(1.0, f64::from(MOST_SAMPLES)) as u32).next_power_of_two().max(finest.samples);
    let own = finest.of_grid(noise);
    // What cannot be reached with the most samples is come near to.
    let left = (aim * aim - noise * noise / f64::from(samples)).max(0.25 * aim * aim).sqrt();
    let factor = (left / own).powf(1.0 / exponent(steps, noise));
    let factor = match samples > finest.samples && factor >= 1.0 {
        true => 1.0,
        false => factor.clamp(FINEST_STEP, LEAST_STEP),
    };
    Choice { spacing_m: rounded_up(factor * finest.spacing_m), samples }
}

/// The bake that the model says to have the error that is aimed at, by [`FARTHEST`] finer at most; `None` before two spacings
/// tell the pace.
pub fn wanted(steps: &[Step], error: f64, noise: Option<f64>) -> Option<Choice> {
    let finest = finest(steps)?;
    steps.iter().find(|step| step.spacing_m > finest.spacing_m)?;
    let next = finer(steps, error, noise);
    let (noise, aim) = (noise.unwrap_or(0.0), AIM * error);
    let left = (aim * aim - noise * noise / f64::from(next.samples)).max(0.25 * aim * aim).sqrt();
    let factor = (left / finest.of_grid(noise)).powf(1.0 / exponent(steps, noise)).clamp(FARTHEST, 1.0);
    Some(Choice { spacing_m: rounded_up(factor * finest.spacing_m), samples: next.samples })
}

/// The error that the model foretells of a bake, from one of the steps.
pub fn predicted(steps: &[Step], from: &Step, choice: &Choice, noise: Option<f64>) -> f64 {
    let noise = noise.unwrap_or(0.0);
    let own = from.of_grid(noise) * (choice.spacing_m / from.spacing_m).powf(exponent(steps, noise));
    (own * own + noise * noise / f64::from(choice.samples)).sqrt()
}

/// Half the spacing of a step.
pub fn halved(step: &Step) -> Choice {
    Choice { spacing_m: rounded_up(FINEST_STEP * step.spacing_m), samples: step.samples }
}

/// A bake that would be much smaller than `met`, which is good enough, and may be good enough too.
fn coarser(steps: &[Step], met: &Step, error: f64) -> Option<Choice> {
    // Coarser grids with as many bytes show that there is nothing to gain.
    let has_coarser = |s: &Step| s.meets(error) && s.spacing_m > met.spacing_m;
    if steps.iter().any(has_coarser) {
        return None;
    }
    let too_coarse = steps.iter().filter(|s| s.spacing_m > met.spacing_m && !s.meets(error));
    let too_coarse = too_coarse.min_by(|a, b| a.spacing_m.total_cmp(&b.spacing_m));
    let p = too_coarse.map_or(FIRST_EXPONENT, |other| between(met, other, 0.0, EXPONENT_BETWEEN));
    let factor = (AIM * error / met.error.max(f64::MIN_POSITIVE)).powf(1.0 / p).min(1.0 / FINEST_STEP);
    let most = too_coarse.map_or(f64::INFINITY, |other| other.spacing_m / APART);
    let spacing_m = rounded_up(factor * met.spacing_m);
    let pays = factor >= LEAST_COARSER && spacing_m <= most;
    pays.then_some(Choice { spacing_m, samples: met.samples })
}

/// Whether the last steps have not let the error fall.
fn is_flat(steps: &[Step]) -> bool {
    let Some(last) = steps.len().checked_sub(MOST_FLAT).filter(|&before| before > 0) else { return false };
    let (before, after) = steps.split_at(last);
    let least = |steps: &[Step]| steps.iter().copied().min_by(|a, b| a.error.total_cmp(&b.error));
    let (Some(before), Some(after)) = (least(before), least(after)) else { return false };
    let wanted = (after.spacing_m / before.spacing_m).powf(LEAST_EXPONENT).min(LEAST_FALL);
    after.error > wanted * before.error
}

/// The finest; of several the last.
fn finest(steps: &[Step]) -> Option<&Step> {
    steps.iter().rev().min_by(|a, b| a.spacing_m.total_cmp(&b.spacing_m))
}

/// The exponent p between the two finest spacings.
fn exponent(steps: &[Step], noise: f64) -> f64 {
    let Some(finest) = finest(steps) else { return FIRST_EXPONENT };
    let coarser = steps.iter().filter(|s| s.spacing_m > finest.spacing_m);
    let next = coarser.min_by(|a, b| a.spacing_m.total_cmp(&b.spacing_m));
    next.map_or(FIRST_EXPONENT, |next| between(finest, next, noise, EXPONENT))
}

fn between(fine: &Step, coarse: &Step, noise: f64, (least, most): (f64, f64)) -> f64 {
    let p = (coarse.of_grid(noise) / fine.of_grid(noise)).ln() / (coarse.spacing_m / fine.spacing_m).ln();
    // Errors of 0 tell nothing.
    if p.is_finite() { p.clamp(least, most) } else { FIRST_EXPONENT }
}

/// With few digits, and never finer.
pub fn rounded_up(spacing_m: f64) -> f64 {
    let exponent = spacing_m.log10().floor() as i32 + 1 - DIGITS;
    // Powers of ten above 1 are exact, so that the quotient is the number nearest to the decimal one.
    let (power, negative) = (10f64.powi(exponent.abs()), exponent < 0);
    let digits = if negative { spacing_m * power } else { spacing_m / power };
    // Rounding must not turn 0.125 into 0.126.
    let digits = (digits - 1e-9 * digits).ceil();
    if negative { digits / power } else { digits * power }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: f64 = 1.0;

    /// A scene by the model, with 64 bytes a probe; standard errors are 3 % of the error.
    struct Scene {
        at_one: f64,
        p: f64,
        noise: f64,
    }

    impl Scene {
        fn bake(&self, choice: Choice) -> Step {
            let grid = self.at_one * choice.spacing_m.powf(self.p);
            let error = (grid * grid + self.noise * self.noise / f64::from(choice.samples)).sqrt();
            let bytes = (64.0 * (1.0 + 10.0 / choice.spacing_m).powi(3)) as u64;
            Step { spacing_m: choice.spacing_m, samples: choice.samples, error, standard_error: 0.03 * error, bytes }
        }

        /// All steps of a search.
        fn search(&self, error: f64) -> (Vec<Step>, Next) {
            let mut steps = vec![self.bake(Choice { spacing_m: START, samples: 1 })];
            loop {
                match next(&steps, error, Some(self.noise)) {
                    Next::Bake(choice) => {
                        let finest = finest(&steps).unwrap();
                        assert!(choice.spacing_m >= FINEST_STEP * finest.spacing_m, "{choice:?} after {finest:?}");
                        steps.push(self.bake(choice));
                    }
                    end => return (steps, end),
                }
            }
        }
    }

    #[test]
    fn scenes_by_the_model_are_reached_in_few_steps_without_waste() {
        for p in [0.8, 1.0, 1.5, 2.0] {
            for (at_one, error) in [(0.1, 0.1), (0.2, 0.1), (0.2, 0.05), (0.5, 0.1), (0.01, 0.1), (0.05, 0.045)] {
                let scene = Scene { at_one, p, noise: 0.01 };
                let (steps, end) = scene.search(error);
                assert_eq!(end, Next::Reached, "{p} {at_one} {error}: {steps:?}");
                assert!(steps.len() <= 6, "{p} {at_one} {error}: {} steps", steps.len());
                let kept = &steps[best(&steps, error).unwrap()];
                // The grid that has just this error: no more than 1.8 × as many probes are spent, unless the coarsest
                // was never given up for one so near.
                let ideal = ((error * error - 1e-4).sqrt() / at_one).powf(1.0 / p);
                assert!(kept.meets(error) && kept.spacing_m > ideal / 1.5, "{p} {at_one} {error}: {kept:?} {ideal}");
                // All bakes together cost little more than the dearest.
                let all: u64 = steps.iter().map(|s| s.bytes).sum();
                assert!(all <= 3 * steps.iter().map(|s| s.bytes).max().unwrap(), "{p} {at_one} {error}: {steps:?}");
            }
        }
    }

    #[test]
    fn noise_is_met_by_samples_and_interpolation_by_spacing() {
        let noisy = Scene { at_one: 0.05, p: 1.0, noise: 0.15 };
        let step = noisy.bake(Choice { spacing_m: 1.0, samples: 1 });
        // (0.15/0.09)²/0.25 = 11.1: 16 times the samples leave 0.0375 of noise, and 0.0818 for a grid that has 0.05.
        assert_eq!(finer(&[step], 0.1, Some(0.15)), Choice { spacing_m: 1.0, samples: 16 });
        // Nothing is known of noise: all is the grid's. 0.09/0.158 = 0.569.
        assert_eq!(finer(&[step], 0.1, None), Choice { spacing_m: 0.57, samples: 1 });
        let (steps, end) = noisy.search(0.1);
        // The second is at 0.0625, and a coarser grid does as well.
        assert_eq!((steps.len(), end), (3, Next::Reached), "{steps:?}");
    }

    #[test]
    fn a_start_that_is_far_better_is_coarsened() {
        let (steps, end) = Scene { at_one: 0.01, p: 1.0, noise: 0.0 }.search(0.1);
        assert_eq!(end, Next::Reached);
        let spacings: Vec<f64> = steps.iter().map(|s| s.spacing_m).collect();
        // By 2 and by 2, and by 2 again; 0.09 is at 9, which is not 1.2 times 8.
        assert_eq!(spacings, [1.0, 2.0, 4.0, 8.0]);
        assert_eq!(best(&steps, 0.1), Some(3));
    }

    #[test]
    fn an_error_that_does_not_fall_stops_the_search() {
        let step = |spacing_m, error| Step { spacing_m, samples: 1, error, standard_error: 0.0, bytes: 1 };
        let flat = [step(1.0, 0.3), step(0.5, 0.3), step(0.25, 0.31)];
        assert_eq!(next(&flat, 0.1, None), Next::NotFalling);
        // One such step may be chance.
        assert!(matches!(next(&flat[..2], 0.1, None), Next::Bake(_)));
        assert_eq!(best(&flat, 0.1), Some(0));
        let (steps, end) = Scene { at_one: 0.3, p: 1.0, noise: 0.2 }.search(1e-6);
        assert!(matches!(end, Next::Steps | Next::NotFalling), "{end:?}");
        assert!(steps.len() <= MOST_STEPS);
    }

    #[test]
    fn what_an_error_takes_follows_from_the_pace() {
        let scene = Scene { at_one: 0.4, p: 1.0, noise: 0.0 };
        let mut steps = vec![scene.bake(Choice { spacing_m: 1.0, samples: 1 })];
        assert_eq!(wanted(&steps, 0.02, None), None);
        steps.push(scene.bake(Choice { spacing_m: 0.5, samples: 1 }));
        // 0.4·s = 0.018.
        assert_eq!(wanted(&steps, 0.02, None), Some(Choice { spacing_m: 0.045, samples: 1 }));
        assert_eq!(wanted(&steps, 0.002, None), Some(Choice { spacing_m: 0.0313, samples: 1 }));
    }

    #[test]
    fn spacings_have_few_digits_and_are_never_finer() {
        for (given, expected) in [(0.125, 0.125), (0.1251, 0.126), (1.0, 1.0), (123.4, 124.0), (1234.0, 1240.0)] {
            assert_eq!(rounded_up(given), expected);
        }
        assert_eq!(format!("{}", rounded_up(0.33333)), "0.334");
    }
}

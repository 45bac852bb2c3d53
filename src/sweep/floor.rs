//! What limits a configuration: its error with one cause at a time switched off.
//!
//! All with the same seed as the configuration's own bake, so that what noise the two share cancels. Squared errors are compared,
//! because errors of independent causes add in squares: a cause's share is 1 − remaining²/error². Shares of causes that act on each
//! other do not add up to 1, and one is negative where its error hid another.

use super::SweepError;
use super::run::{Finished, Setting};
use crate::bake::BakeError;
use crate::config::Config;
use crate::report::sweep::{FloorCause, FloorReport, RunRecord};
use crate::shade::visibility_modes::VisibilityMode;

/// Bakes and truths that a floor takes at most.
pub const STEPS: usize = 4;

/// Largest resolution that a configuration may have.
const MAX_RESOLUTION: usize = 1024;

/// The tolerance against which bounces are iterated without a limit, as a share of the configuration's, and at least.
const TOLERANCE_SHARE: f32 = 0.1;
const TOLERANCE_LEAST: f32 = 1e-6;

/// A configuration with a cause of error switched off.
struct Variant {
    cause: &'static str,
    how: String,
    /// `None` where it is off already, or cannot be switched off alone.
    config: Option<Config>,
    /// Whether the error without it is known.
    is_measured: bool,
}

/// Why a cause is not measured. Fitted values have little to do with the light where probes stand. Finer maps have more
/// unknowns than points that they are fitted to, so they err more for another reason.
const FITTED: &str = "not measured: the probes hold fitted values";

fn variants(config: &Config) -> [Variant; 3] {
    let angular = config.fit.is_none().then(|| {
        let mut angular = config.clone();
        angular.capture.rays = config.capture.rays.doubled(MAX_RESOLUTION);
        angular.store.irradiance = config.store.irradiance.doubled(MAX_RESOLUTION);
        angular
    });
    let finer = if angular.is_some() { "captures and irradiance of twice the angular resolution" } else { FITTED };
    let transport = config.transport.settled(TOLERANCE_SHARE, TOLERANCE_LEAST);
    let settled = (transport != config.transport).then(|| Config { transport, ..config.clone() });
    let exact = config.store.irradiance.exact().map(|irradiance| {
        let mut exact = config.clone();
        exact.store.irradiance = irradiance;
        exact
    });
    let or_already = |how: &str, config: &Option<Config>| match config {
        Some(_) => how.to_owned(),
        None => "there is none already".to_owned(),
    };
    let bounces = "all bounces, to a tenth of the tolerance";
    let encoding = "irradiance stored in single precision";
    [
        Variant { cause: "angular_resolution", how: finer.to_owned(), is_measured: angular.is_some(), config: angular },
        Variant { cause: "bounces", how: or_already(bounces, &settled), config: settled, is_measured: true },
        Variant { cause: "encoding", how: or_already(encoding, &exact), config: exact, is_measured: true },
    ]
}

fn error_of(record: &RunRecord, mode: VisibilityMode) -> Option<f64> {
    record.method(mode.name())?.error_relative
}

/// The shares of a cause without which `remaining` of `all` is left.
fn share(all: Option<f64>, remaining: Option<f64>) -> Option<f64> {
    let (all, remaining) = (all?, remaining?);
    (all > 0.0).then(|| 1.0 - (remaining / all).powi(2))
}

/// Measures what the error of one configuration is made of. `step` is called after each of the [`STEPS`].
///
/// # Errors
/// Those of a bake.
pub fn measure(
    setting: &Setting,
    (ladder, index, label): (&str, usize, &str),
    config: &Config,
    base: &RunRecord,
    warn: &dyn Fn(String),
    step: &dyn Fn(),
) -> Result<FloorReport, SweepError> {
    let seed = base.seed;
    let all = error_of(base, VisibilityMode::On);
    let cause = |cause: &'static str, how: &str, remaining: Option<f64>| FloorCause {
        cause,
        how: how.to_owned(),
        error_relative: remaining,
        share: share(all, remaining),
    };
    let mut causes = Vec::new();
    for variant in variants(config) {
        let Some(changed) = &variant.config else {
            causes.push(cause(variant.cause, &variant.how, all.filter(|_| variant.is_measured)));
            step();
            continue;
        };
        let label = format!("{label} without error of {}", variant.cause);
        causes.push(match setting.obtain(&label, changed, seed, warn) {
            Ok(Finished { record, .. }) => cause(variant.cause, &variant.how, error_of(&record, VisibilityMode::On)),
            // It is dearer than what was asked for.
            Err(SweepError::Bake { cause: BakeError::Memory(little), .. }) => {
                cause(variant.cause, &format!("{}: not measured, {little}", variant.how), None)
            }
            Err(other) => return Err(other),
        });
        step();
    }
    let exact = error_of(base, VisibilityMode::Ray);
    causes.insert(2, cause("leaks_in_shading", "exact visibility by rays (visibility_ray)", exact));
    if config.fit.is_none() {
        let truth = setting.obtain_truth(label, config, seed, warn)?;
        step();
        let lit = truth.visibility_on.error_relative;
        causes.push(cause("bake", "probes lit by full paths", lit));
        // What right probes under exact visibility still err, no bake can take away: it is the interpolation's own.
        let own = truth.visibility_ray.error_relative;
        causes.push(FloorCause {
            cause: "interpolation",
            how: "path-lit probes with exact visibility (path_ray) err by it alone".to_owned(),
            // None where other errors make up for a part of it.
            error_relative: all
                .zip(own)
                .filter(|(all, own)| all >= own)
                .map(|(all, own)| (all * all - own * own).sqrt()),
            share: all.zip(own).filter(|(all, _)| *all > 0.0).map(|(all, own)| (own / all).powi(2)),
        });
    } else {
        causes.extend(["bake", "interpolation"].map(|name| cause(name, FITTED, None)));
        step();
    }
    Ok(FloorReport {
        ladder: ladder.to_owned(),
        configuration: index,
        label: label.to_owned(),
        seed,
        error_relative: all,
        causes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::fit::{Fit, RowSettings};

    #[test]
    fn every_variant_differs_in_its_cause_only() {
        let config = Config::default();
        let [angular, bounces, encoding] = variants(&config).map(|variant| variant.config.unwrap());
        assert_eq!((angular.store.irradiance.unknowns(), angular.capture.rays.texels()), (16 * 16, 64 * 64));
        assert_eq!(Config { store: config.store.clone(), capture: config.capture.clone(), ..angular }, config);
        assert!(bounces.transport != config.transport);
        assert_eq!(Config { transport: config.transport.clone(), ..bounces }, config);
        assert_eq!(encoding.store.irradiance.fineness().rounding, 2f64.powi(-24));
        assert!(variants(&encoding)[2].config.is_none());
        let path = config.clone().with_overrides(&["transport=paths(paths: 2)".to_owned()]).unwrap();
        assert!(variants(&path)[1].config.is_none());
        let fitted = Config { fit: Fit::Rows(RowSettings::default()), ..config };
        let [angular, bounces, _] = variants(&fitted);
        assert!(angular.config.is_none() && !angular.is_measured && angular.how == FITTED);
        assert!(bounces.config.is_some() && bounces.is_measured);
    }

    #[test]
    fn shares_are_of_squares() {
        assert!((share(Some(0.5), Some(0.3)).unwrap() - 0.64).abs() < 1e-12);
        assert!(share(Some(0.5), Some(0.6)).unwrap() < 0.0);
        assert_eq!((share(Some(0.0), Some(0.0)), share(None, Some(1.0))), (None, None));
    }
}

//! Figures of the air: what objects get that move through the volume, at random points with random normals.
//!
//! As in [`super::leak`], E is the irradiance of the method and Ê that of the same weights with exact ray visibility,
//! both as luminance. Points that see none of their probes have no Ê: leak figures leave them out.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::error::at_points::error_at_points;
use crate::math::color::luminance;
use crate::shade::air::Air;
use crate::shade::point_truth::PointTruth;

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct AirFigures {
    /// Points of free air that were found.
    pub points: usize,
    /// Root mean square difference from paths at the same points, all channels, ÷ the mean luminance of these: as
    /// `error.nrmse`. The paths' own noise is subtracted. `null` without a traced reference, and in the dark.
    pub error: Option<f64>,
    /// Σ max(0, E − Ê) ÷ ΣÊ. `null` if ΣÊ is 0.
    pub leak_light: Option<f64>,
    /// Σ max(0, Ê − E) ÷ ΣÊ. `null` if ΣÊ is 0.
    pub leak_dark: Option<f64>,
    /// Share of the points that see a probe and get E = 0; with a traced reference only where that brings light. Without one,
    /// points count too where the scene is dark, as in a sealed room. `null` without points.
    pub black: Option<f64>,
    /// Share of the points that see none of their probes. `null` without points.
    pub unseen: Option<f64>,
    pub standard_error: AirErrors,
}

/// What the noise of the paths leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct AirErrors {
    /// Of `error`; `null` where the noise is not known.
    pub error: Option<f64>,
}

/// The figures that need no truth. `irradiance` is that of the method and `exact` that with exact visibility, both per
/// point.
pub fn measure(air: &Air, irradiance: &[Vec3], exact: &[Vec3]) -> AirFigures {
    let (mut light, mut dark, mut total) = (0.0f64, 0.0f64, 0.0f64);
    let (mut black, mut unseen) = (0usize, 0usize);
    for ((mask, e), exact) in air.masks.iter().zip(irradiance).zip(exact) {
        if *mask == 0 {
            unseen += 1;
            continue;
        }
        let (e, exact) = (f64::from(luminance(*e)), f64::from(luminance(*exact)));
        light += (e - exact).max(0.0);
        dark += (exact - e).max(0.0);
        total += exact;
        black += usize::from(e == 0.0);
    }
    let ratio = |a: f64, b: f64| (b > 0.0).then(|| a / b);
    let points = air.points.len();
    let share = |count: usize| ratio(count as f64, points as f64);
    AirFigures {
        points,
        leak_light: ratio(light, total),
        leak_dark: ratio(dark, total),
        black: share(black),
        unseen: share(unseen),
        ..AirFigures::default()
    }
}

impl AirFigures {
    /// Adds the error against the truth at the same points, and counts as black only those where that brings light.
    pub fn compare(&mut self, air: &Air, irradiance: &[Vec3], truth: &PointTruth) {
        let Some((error, standard_error)) = error_at_points(irradiance, truth) else { return };
        self.error = Some(error);
        self.standard_error.error = standard_error;
        let is_black = |(i, e): &(usize, &Vec3)| {
            air.masks[*i] != 0 && luminance(**e) == 0.0 && luminance(truth.irradiance[*i]) > 0.0
        };
        let black = irradiance.iter().enumerate().filter(is_black).count();
        self.black = Some(black as f64 / irradiance.len() as f64);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::probe::query::QueryPoint;
    use crate::probe::store::surface::Facing;

    fn air(masks: &[u8]) -> Air {
        let point = QueryPoint {
            position: Vec3::ZERO,
            normal: Vec3::Y,
            geometric: Vec3::Y,
            facing: Facing::of(Vec3::Y),
            view: Vec3::Y,
        };
        Air { points: Arc::new(vec![point; masks.len()]), masks: masks.to_vec() }
    }

    /// Of Σ Ê = 8: one point is 1 too bright, one loses all of its 4, one sees no probe and does not count.
    #[test]
    fn leaks_and_black_points_have_their_shares() {
        let grey = |values: [f32; 4]| values.map(Vec3::splat);
        let irradiance = grey([3.0, 0.0, 7.0, 2.0]);
        let mut figures = measure(&air(&[1, 3, 0, 255]), &irradiance, &grey([2.0, 4.0, 0.0, 2.0]));
        let close = |found: Option<f64>, expected: f64| assert!((found.unwrap() - expected).abs() < 1e-6, "{found:?}");
        close(figures.leak_light, 0.125);
        close(figures.leak_dark, 0.5);
        assert_eq!((figures.points, figures.black, figures.unseen), (4, Some(0.25), Some(0.25)));
        // Where no light comes, none is missing.
        let truth = |of_second: f32| PointTruth {
            irradiance: grey([2.0, of_second, 0.0, 2.0]).to_vec(),
            variance: None,
            blocks: 1,
        };
        figures.compare(&air(&[1, 3, 0, 255]), &irradiance, &truth(4.0));
        assert_eq!(figures.black, Some(0.25));
        figures.compare(&air(&[1, 3, 0, 255]), &irradiance, &truth(0.0));
        assert_eq!(figures.black, Some(0.0));
        assert_eq!(measure(&air(&[]), &[], &[]), AirFigures::default());
    }

    /// d = 0.5 everywhere around a truth of 2: an error of a quarter, from which a variance of 0.09 takes 0.3² of 0.5².
    #[test]
    fn the_error_is_relative_and_free_of_noise() {
        let (irradiance, truth) = (vec![Vec3::splat(2.5); 64], vec![Vec3::splat(2.0); 64]);
        let mut figures = AirFigures::default();
        let known = |variance| PointTruth { irradiance: truth.clone(), variance, blocks: 1 << 20 };
        figures.compare(&air(&[1; 64]), &irradiance, &known(None));
        assert!((figures.error.unwrap() - 0.25).abs() < 1e-6 && figures.standard_error.error.is_none());
        figures.compare(&air(&[1; 64]), &irradiance, &known(Some(vec![Vec3::splat(0.09); 64])));
        assert!((figures.error.unwrap() - 0.2).abs() < 1e-6, "{figures:?}");
        // s of the mean of d² is √(4d²v − 2v²)/√64 = 0.0340 with channels together, and that of the root at most
        // (0.4 − √(0.16 − 2s))/2, ÷ 2.
        let s = (4.0f64 * 0.25 * 0.09 - 2.0 * 0.0081).sqrt() / 8.0;
        let expected = (0.4 - (0.16 - 2.0 * s).sqrt()) / 4.0;
        assert!((figures.standard_error.error.unwrap() / expected - 1.0).abs() < 1e-4, "{figures:?} {expected}");
        let mut dark = AirFigures::default();
        dark.compare(&air(&[1]), &[Vec3::ONE], &PointTruth { irradiance: vec![Vec3::ZERO], variance: None, blocks: 1 });
        assert_eq!(dark.error, None);
    }
}

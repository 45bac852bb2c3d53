//! The relative RMSE at points that were drawn from a scene, with the standard error that both their choice and the noise
//! of the truth give it.

use glam::Vec3;

use super::root_error;
use crate::math::color::luminance;
use crate::math::statistics::Moments;
use crate::shade::block_mean::BlockMean;

/// RMSE of all channels ÷ the mean luminance of the truth, as `nrmse` of pictures, and its standard error. The noise of the
/// truth is subtracted. `None` without light.
///
/// With s = Σ(d² − v)/3 over the channels of a point (d: difference, v: variance of the truth) and l its luminance, the
/// square of the error is S/m², S and m their means over the points. Its variance follows from the spread of
/// s/m² − 2·S·l/m³ over the points (delta method), which holds the noise of each.
pub fn relative(found: &[Vec3], truth: &[BlockMean]) -> Option<(f64, f64)> {
    let of_point = |(found, truth): (&Vec3, &BlockMean)| {
        let difference = found.as_dvec3() - truth.mean;
        let square = (difference * difference - truth.variance()).element_sum() / 3.0;
        (square, f64::from(luminance(truth.mean.as_vec3())))
    };
    let points: Vec<(f64, f64)> = found.iter().zip(truth).map(of_point).collect();
    let square = points.iter().map(|p| p.0).collect::<Moments>().mean();
    let mean = points.iter().map(|p| p.1).collect::<Moments>().mean();
    if mean <= 0.0 {
        return None;
    }
    let linear = |&(s, l): &(f64, f64)| (s - 2.0 * square * l / mean) / (mean * mean);
    let spread = points.iter().map(linear).collect::<Moments>().variance();
    let error = square.max(0.0).sqrt() / mean;
    Some((error, root_error(error, (spread / (points.len() as f64 - 1.0).max(1.0)).sqrt())))
}

/// The fewest points that hold half of the squared error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Concentration {
    pub points: usize,
    /// The one that holds most of it.
    pub worst: usize,
    /// Light at the worst ÷ the mean.
    pub times_mean: f64,
}

/// Where the squared error is. `None` without an error, and without light.
pub fn concentration(found: &[Vec3], truth: &[BlockMean]) -> Option<Concentration> {
    let square = |i: usize| {
        let difference = found[i].as_dvec3() - truth[i].mean;
        (difference * difference - truth[i].variance()).element_sum().max(0.0)
    };
    let mut squares: Vec<(usize, f64)> = (0..found.len()).map(|i| (i, square(i))).collect();
    squares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let half = 0.5 * squares.iter().map(|(_, square)| square).sum::<f64>();
    let light = |i: usize| f64::from(luminance(truth[i].mean.as_vec3()));
    let mean = (0..truth.len()).map(light).collect::<Moments>().mean();
    let worst = squares.first().map(|(worst, _)| *worst).filter(|_| half > 0.0 && mean > 0.0)?;
    let mut held = 0.0;
    let before = squares.iter().take_while(|(_, square)| {
        held += square;
        held < half
    });
    Some(Concentration { points: before.count() + 1, worst, times_mean: light(worst) / mean })
}

/// RMSE of all channels between two bakes at these points ÷ the mean luminance of the truth. `None` without light.
pub fn relative_difference(a: &[Vec3], b: &[Vec3], truth: &[BlockMean]) -> Option<f64> {
    let square = |(a, b): (&Vec3, &Vec3)| (a.as_dvec3() - b.as_dvec3()).length_squared() / 3.0;
    let square = a.iter().zip(b).map(square).collect::<Moments>().mean();
    let light = truth.iter().map(|truth| f64::from(luminance(truth.mean.as_vec3())));
    let mean = light.collect::<Moments>().mean();
    (mean > 0.0).then(|| square.sqrt() / mean)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn truth(blocks: &[f64]) -> BlockMean {
        let mut mean = BlockMean::default();
        blocks.iter().for_each(|&x| mean.push(DVec3::splat(x)));
        mean
    }

    /// Half of the points are 0.2 off, the others 0: S = 0.02, m = 2. The spread of s is 0.02, so that S is known to
    /// 0.02/√99.
    #[test]
    fn the_error_is_relative_and_knows_its_sample() {
        let found: Vec<Vec3> = (0..100).map(|i| Vec3::splat(if i % 2 == 0 { 2.2 } else { 2.0 })).collect();
        let (error, standard_error) = relative(&found, &[truth(&[2.0, 2.0]); 100]).unwrap();
        assert!((error - 0.02f64.sqrt() / 2.0).abs() < 1e-6, "{error}");
        let expected = root_error(error, 0.02 / 99f64.sqrt() / 4.0);
        assert!((standard_error / expected - 1.0).abs() < 1e-4, "{standard_error} {expected}");
        assert_eq!(relative(&found, &[truth(&[0.0]); 100]), None);
        assert_eq!(relative(&[], &[]), None);
        let exact = vec![Vec3::splat(2.0); 100];
        let difference = relative_difference(&found, &exact, &[truth(&[2.0, 2.0]); 100]).unwrap();
        assert!((difference - error).abs() < 1e-6, "{difference}");
    }

    /// Squares of 9, 4 and eighteen times 0.25 are 17.5, half of it 8.75.
    #[test]
    fn half_of_the_squared_error_may_be_that_of_few_points() {
        let mut found = vec![Vec3::splat(1.5); 20];
        let mut truths = [truth(&[1.0, 1.0]); 20];
        found[7] = Vec3::splat(4.0);
        found[3] = Vec3::splat(3.0);
        assert_eq!(concentration(&found, &truths), Some(Concentration { points: 1, worst: 7, times_mean: 1.0 }));
        // Squares of 4 and eighteen times 0.25: half of 8.5 are the first and another.
        truths[7] = truth(&[4.0, 4.0]);
        let Concentration { points, worst, .. } = concentration(&found, &truths).unwrap();
        assert_eq!((points, worst), (2, 3));
        assert_eq!(concentration(&[Vec3::ONE; 20], &[truth(&[1.0, 1.0]); 20]), None);
    }

    /// Blocks of 1 and 3: a variance of 1 of their mean 2, which is all the difference from 3 there is.
    #[test]
    fn the_noise_of_the_truth_is_subtracted() {
        let (error, _) = relative(&[Vec3::splat(3.0); 10], &[truth(&[1.0, 3.0]); 10]).unwrap();
        assert!(error.abs() < 1e-6, "{error}");
    }
}

//! How much light changed, and how well that is known from the two sides alone.
//!
//! Random numbers of different probes are independent, so the noise of a mean over many shows in how unequally its parts
//! changed. A uniform change shows nothing of the kind: a ratio is compared, and all parts have the same. With equal
//! random numbers on both sides the noise is the same on both and falls out by itself, so that changes of a tenth of a
//! percent are seen; with different ones the error is what the noise makes it.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// What light bounced between probes does to the independence of their noise: a bright spot that one probe overestimates
/// lights all that see it. The true spread of the mean's change between seeds, over that which the parts show, was 0.7 to
/// 1.4 in `two_rooms_open`, `cornell` and `courtyard` (45 pairs of seeds each).
const SHARED_NOISE: f64 = 1.5;

/// How many standard errors the widening for few parts is made for; the default of `standard_errors`.
const SIGMAS: f64 = 3.0;

/// Of the parts of a whole: sum of the base, sum of the difference.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Part {
    pub base: f64,
    pub difference: f64,
}

impl Part {
    pub fn add(&mut self, base: f64, candidate: f64) {
        self.base += base;
        self.difference += candidate - base;
    }
}

/// A relative change, percent, and its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    pub percent: f64,
    /// `None` where there are too few parts to tell.
    pub standard_error: Option<f64>,
}

/// Σdifference ÷ Σbase over all parts; `None` where the base is dark and the candidate is not.
///
/// The standard error is Efron's jackknife over the parts, so that it is 0 for a change that is the same everywhere.
pub fn change(parts: &[Part]) -> Option<Change> {
    let used: Vec<Part> = parts.iter().copied().filter(|p| p.base != 0.0 || p.difference != 0.0).collect();
    let base: f64 = used.iter().map(|p| p.base).sum();
    let difference: f64 = used.iter().map(|p| p.difference).sum();
    if difference == 0.0 {
        return Some(Change { percent: 0.0, standard_error: None });
    }
    if base <= 0.0 {
        return None;
    }
    let n = used.len() as f64;
    let without = used.iter().map(|p| (difference - p.difference) / (base - p.base));
    let without: Vec<f64> = without.filter(|ratio| ratio.is_finite()).collect();
    let standard_error = (without.len() == used.len() && used.len() >= MIN_PARTS).then(|| {
        let mean = without.iter().sum::<f64>() / n;
        let scatter: f64 = without.iter().map(|r| (r - mean) * (r - mean)).sum();
        100.0 * SHARED_NOISE * widening(n - 1.0) * (scatter * (n - 1.0) / n).sqrt()
    });
    Some(Change { percent: 100.0 * difference / base, standard_error })
}

/// How unequally parts changed: the root mean square of what is left of their changes when the whole's is taken off, over the mean
/// of the base. `pairs`: base and candidate of each. 0 for a change that is the same everywhere; `None` where the base is dark.
pub fn unevenness(pairs: impl Iterator<Item = [f64; 2]> + Clone) -> Option<f64> {
    let (count, base, candidate) =
        pairs.clone().fold((0.0, 0.0, 0.0), |(n, b, c), pair| (n + 1.0, b + pair[0], c + pair[1]));
    let ratio = candidate / base;
    let squares: f64 = pairs.map(|[b, c]| (c - ratio * b).powi(2)).sum();
    (base > 0.0).then(|| (squares / count).sqrt() * count / base)
}

/// Of how many equal parts a whole would be that hangs on its parts as much: (Σbase)² ÷ Σbase².
pub fn effective_count(bases: impl Iterator<Item = f64>) -> f64 {
    let (sum, squares) = bases.fold((0.0, 0.0), |(sum, squares), base| (sum + base, squares + base * base));
    sum * sum / squares
}

/// Standard error of a picture's mean between seeds, over the unevenness of its pixels.
///
/// A lamp that one probe overestimates, or the light through one door, raises all that it lights, and neither pixels nor blocks of
/// them show it. The largest change of a mean was 1.37 of the unevenness (1,096 pairs: 24 pictures, two layers, of 15 scenes and
/// spacings with 72 to 3193 active probes), and three standard errors are 1.5.
pub const OF_UNEVENNESS: f64 = 0.5;

/// Fewer parts say nothing about their own spread that could be relied on.
const MIN_PARTS: usize = 6;

/// Quantile of Student's t with so many degrees of freedom ÷ that of the normal distribution, at [`SIGMAS`]; 1 where there are none.
pub fn widening(freedom: f64) -> f64 {
    let Ok(student) = StudentsT::new(0.0, 1.0, freedom) else { return 1.0 };
    student.inverse_cdf(Normal::standard().cdf(SIGMAS)) / SIGMAS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{Purpose, Random};

    fn parts(n: usize, scale: f64, noise: f64, seed: u64) -> Vec<Part> {
        let mut random = Random::new(seed, Purpose::FlipReplicate, 0, 0);
        // Sum of twelve uniform numbers: nearly normal, of variance 1.
        let mut normal = || (0..12).map(|_| f64::from(random.uniform())).sum::<f64>() - 6.0;
        let part = |i: usize, normal: &mut dyn FnMut() -> f64| {
            let base = 1.0 + i as f64 / n as f64;
            let mut part = Part::default();
            part.add(base * (1.0 + noise * normal()), base * scale * (1.0 + noise * normal()));
            part
        };
        (0..n).map(|i| part(i, &mut normal)).collect()
    }

    #[test]
    fn a_uniform_change_has_no_error() {
        let found = change(&parts(50, 1.01, 0.0, 0)).unwrap();
        assert!((found.percent - 1.0).abs() < 1e-9 && found.standard_error.unwrap() < 1e-9, "{found:?}");
    }

    #[test]
    fn independent_noise_is_known() {
        // 64 parts with 5 % noise on each side: the ratio errs by about 5 % · √2 / 8 = 0.9 %.
        let z = |seed| {
            let found = change(&parts(64, 1.0, 0.05, seed)).unwrap();
            (found.percent, found.standard_error.unwrap())
        };
        let found: Vec<(f64, f64)> = (0..400).map(z).collect();
        let spread = (found.iter().map(|f| f.0 * f.0).sum::<f64>() / 400.0).sqrt();
        let claimed = found.iter().map(|f| f.1).sum::<f64>() / 400.0;
        // The spread of 400 is known to 3.5 %; four of these.
        let expected = SHARED_NOISE * widening(63.0);
        assert!((claimed / spread / expected - 1.0).abs() < 0.14, "{claimed} {spread}");
    }

    #[test]
    fn unevenness_is_what_a_uniform_change_leaves() {
        let uneven = |pairs: &[[f64; 2]]| unevenness(pairs.iter().copied());
        assert!(uneven(&[[1.0, 1.1], [3.0, 3.3]]).unwrap() < 1e-12);
        // The whole does not change; each part by 1, of a mean of 2.
        assert_eq!(uneven(&[[1.0, 2.0], [3.0, 2.0]]), Some(0.5));
        assert_eq!(uneven(&[[0.0, 2.0]]), None);
        assert_eq!(uneven(&[]), None);
        assert_eq!(effective_count([2.0, 2.0, 2.0, 0.0].into_iter()), 3.0);
    }

    #[test]
    fn darkness() {
        let dark = Part::default();
        assert_eq!(change(&[dark, dark]).unwrap().percent, 0.0);
        assert_eq!(change(&[]).unwrap().percent, 0.0);
        assert_eq!(change(&[Part { base: 0.0, difference: 1.0 }]), None);
    }

    #[test]
    fn the_widening_is_that_of_students_t() {
        // Tables: two-sided 2.7e-3 (3 σ): t = 3.13 at 60 degrees of freedom, 3.85 at 11.
        assert!((SIGMAS * widening(60.0) - 3.13).abs() < 0.02, "{}", SIGMAS * widening(60.0));
        assert!((SIGMAS * widening(11.0) - 3.85).abs() < 0.01, "{}", SIGMAS * widening(11.0));
        assert_eq!(widening(0.0), 1.0);
    }
}

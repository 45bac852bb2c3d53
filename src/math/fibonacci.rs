//! Spherical Fibonacci points: nearly uniform directions for any count.
//!
//! Source: Keinert et al., *Spherical Fibonacci Mapping*, ACM TOG 34(6), 2015.

use std::f64::consts::PI;

use glam::Vec3;

/// (√5 − 1)/2, the golden ratio's fractional part.
const GOLDEN_FRACTION: f64 = 0.618_033_988_749_894_8;

/// Direction `i` of `count`, unit length.
pub fn direction(i: usize, count: usize) -> Vec3 {
    let phi = 2.0 * PI * (i as f64 * GOLDEN_FRACTION).fract();
    let z = 1.0 - (2 * i + 1) as f64 / count as f64;
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_unit_and_balanced() {
        let n = 256;
        let mut sum = Vec3::ZERO;
        for i in 0..n {
            let d = direction(i, n);
            assert!((d.length() - 1.0).abs() < 1e-6);
            sum += d;
        }
        // Random points would give √256 = 16.
        assert!(sum.length() < 1.0, "{sum}");
    }
}

//! Where further rays of probes go.
//!
//! Even rays are too few where a probe sees light through a slit: one of them then carries as much light as all others. So
//! a pilot is captured first, and a rough solution of it tells how much light every ray brings. Rays go where that differs
//! between neighbouring texels, to probes and within them in proportion to the deviation (Neyman's allocation). The
//! captures that count are drawn anew: whatever the pilot says, they are unbiased.

use glam::Vec3A;

use crate::math::color::luminance;
use crate::math::octahedral::wrap_texel;
use crate::math::random::{Purpose, Random};

/// Share of a probe's further rays that are spread evenly over it: the pilot misses what is smaller than a texel.
const EVEN: f64 = 0.5;

/// Light counts as much as if every probe received this share of the mean in addition: what is darker still need not be known
/// well.
const DARKEST: f64 = 1e-3;

/// Texels beside one with this deviation may have this share of it: an edge that the pilot found goes on beyond.
const BESIDE: f32 = 0.5;

/// Rays per texel that one probe gets at most, in the mean over its texels.
const MOST: f64 = 64.0;

/// What the pilot's texels hold of one probe.
pub struct Pilot {
    /// By texel: how much the light that it sends differs from that of its neighbours, a standard deviation, W·m⁻².
    deviations: Vec<f32>,
    /// Of all texels: the deviation of their sum, and their sum.
    deviation: f64,
    light: f64,
}

impl Pilot {
    /// From the radiance in the texels of an octahedral map, `side` a side, and their solid angles.
    pub fn new(radiance: &[Vec3A], solid_angles: &[f32], side: usize) -> Pilot {
        let light: Vec<f64> =
            radiance.iter().zip(solid_angles).map(|(l, w)| f64::from(luminance((*l).into()) * w)).collect();
        let around = |o: usize| {
            let (column, row) = ((o % side) as isize, (o / side) as isize);
            (-1..=1).flat_map(move |y| (-1..=1).map(move |x| wrap_texel(column + x, row + y, side)))
        };
        let of_texel = |o: usize| {
            let near = || around(o).map(|(column, row)| light[row * side + column]);
            let mean = near().sum::<f64>() / 9.0;
            (near().map(|l| (l - mean).powi(2)).sum::<f64>() / 9.0).sqrt() as f32
        };
        let own: Vec<f32> = (0..light.len()).map(of_texel).collect();
        let wide = |o: usize| around(o).map(|(column, row)| own[row * side + column] * BESIDE).fold(own[o], f32::max);
        let deviations: Vec<f32> = (0..light.len()).map(wide).collect();
        let deviation = deviations.iter().map(|&d| f64::from(d).powi(2)).sum::<f64>().sqrt();
        Pilot { deviation, light: light.iter().sum(), deviations }
    }
}

/// Rays through every texel of every probe.
pub struct Guide(Vec<Option<Box<[u16]>>>);

impl Guide {
    /// `per_texel` rays each, and `guided` more in the mean over all probes that are `asked`; what the others get changes
    /// nothing for these. `pilots` by probe, with what numbers its random sequences.
    pub fn new(pilots: &[Option<(usize, Pilot)>], asked: &[bool], per_texel: usize, guided: f32, seed: u64) -> Guide {
        let counted = || pilots.iter().zip(asked).filter(|(_, asked)| **asked).filter_map(|(p, _)| p.as_ref());
        let count = counted().count().max(1) as f64;
        let floor = DARKEST * counted().map(|(_, pilot)| pilot.light).sum::<f64>() / count;
        let relative = |pilot: &Pilot| {
            let light = pilot.light + floor;
            if pilot.deviation > 0.0 && pilot.deviation.is_finite() { pilot.deviation / light } else { 0.0 }
        };
        let mean = counted().map(|(_, pilot)| relative(pilot)).sum::<f64>() / count;
        let counts = |(stream, pilot): &(usize, Pilot)| {
            let share = relative(pilot) / mean;
            let rays =
                if share > 0.0 { (f64::from(guided) * share).min(MOST) * pilot.deviations.len() as f64 } else { 0.0 };
            let even = EVEN * rays / pilot.deviations.len() as f64;
            let per_deviation = (1.0 - EVEN) * rays / pilot.deviations.iter().map(|&d| f64::from(d)).sum::<f64>();
            let mut random = Random::new(seed, Purpose::Pilot, *stream as u64, 1);
            let count = |&deviation: &f32| {
                let wanted = if rays > 0.0 { even + per_deviation * f64::from(deviation) } else { 0.0 };
                // Rounded by chance; `as` saturates.
                (per_texel as f64 + wanted + f64::from(random.uniform())) as u16
            };
            pilot.deviations.iter().map(count).collect()
        };
        Guide(pilots.iter().map(|pilot| pilot.as_ref().map(counts)).collect())
    }

    /// Rays per texel that a probe gets, in the mean over its texels; 0 where there are none.
    pub fn mean(&self, probe: usize) -> f32 {
        self.of(probe).map_or(0.0, |counts| {
            let sum: u64 = counts.iter().map(|&n| u64::from(n)).sum();
            sum as f32 / counts.len() as f32
        })
    }

    /// Rays through the texels of a probe.
    pub fn of(&self, probe: usize) -> Option<&[u16]> {
        self.0[probe].as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 8;

    /// A probe that sees one bright texel, and one that sees even light.
    fn pilots() -> Vec<Option<(usize, Pilot)>> {
        let angles = [4.0 * std::f32::consts::PI / (SIDE * SIDE) as f32; SIDE * SIDE];
        let even = [Vec3A::ONE; SIDE * SIDE];
        let mut bright = even;
        bright[27] = Vec3A::splat(1000.0);
        [&bright, &even].into_iter().enumerate().map(|(i, l)| Some((i, Pilot::new(l, &angles, SIDE)))).collect()
    }

    #[test]
    fn rays_go_where_light_differs() {
        let guide = Guide::new(&pilots(), &[true; 2], 2, 3.0, 1);
        let total = |probe| guide.of(probe).unwrap().iter().map(|&n| u32::from(n)).sum::<u32>();
        // All further rays of both go to the first; rounding by chance leaves ±√(64/12).
        let texels = (SIDE * SIDE) as u32;
        assert_eq!(total(1), 2 * texels);
        assert!(total(0).abs_diff((2 + 2 * 3) * texels) < 8, "{}", total(0));
        let of_first = guide.of(0).unwrap();
        assert!(of_first.iter().all(|&n| n >= 2));
        // Nine texels around it have the deviation, 16 beside these half of it, of half the rays: 9.8 % in the middle one and
        // evenly 6 of 12.
        let share = 0.5 * f64::from(2 * 3 * texels) / (9.0 + 0.5 * 16.0);
        assert!((f64::from(of_first[27]) - (2.0 + 3.0 + share)).abs() <= 1.0, "{} {share}", of_first[27]);
        assert!(of_first[0] < 7);
    }

    #[test]
    fn probes_that_nobody_asks_take_no_rays_from_others() {
        let alone = Guide::new(&pilots(), &[true, false], 1, 1.0, 1);
        let with_a_third: Vec<_> = pilots().into_iter().chain(pilots().into_iter().take(1)).collect();
        let both = Guide::new(&with_a_third, &[true, false, false], 1, 1.0, 1);
        assert_eq!(alone.of(0), both.of(0));
    }

    #[test]
    fn light_at_the_edge_of_numbers_leaves_even_rays() {
        let angles = [0.1; SIDE * SIDE];
        for light in [0.0, 1e-38, 1e30, f32::MAX, f32::INFINITY] {
            let mut radiance = [Vec3A::splat(light); SIDE * SIDE];
            radiance[3] = Vec3A::ZERO;
            let pilots = vec![Some((0, Pilot::new(&radiance, &angles, SIDE))), None];
            let guide = Guide::new(&pilots, &[true, true], 1, 1.0, 1);
            assert!(guide.of(0).unwrap().iter().all(|&n| n >= 1), "{light}");
            assert!(guide.of(1).is_none());
        }
    }
}

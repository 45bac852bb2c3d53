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
        let light: Vec<f32> = radiance.iter().zip(solid_angles).map(|(l, w)| luminance((*l).into()) * w).collect();
        let around = |o: usize| {
            let (column, row) = ((o % side) as isize, (o / side) as isize);
            (-1..=1).flat_map(move |y| (-1..=1).map(move |x| wrap_texel(column + x, row + y, side)))
        };
        let at = |list: &[f32], (column, row): (usize, usize)| list[row * side + column];
        let own: Vec<f32> = (0..light.len())
            .map(|o| {
                let mean = around(o).map(|t| at(&light, t)).sum::<f32>() / 9.0;
                (around(o).map(|t| (at(&light, t) - mean).powi(2)).sum::<f32>() / 9.0).sqrt()
            })
            .collect();
        let wide = |o: usize| around(o).map(|t| at(&own, t) * BESIDE).fold(own[o], f32::max);
        let deviations: Vec<f32> = (0..light.len()).map(wide).collect();
        let deviation = deviations.iter().map(|&d| f64::from(d).powi(2)).sum::<f64>().sqrt();
        Pilot { deviation, light: light.iter().map(|&l| f64::from(l)).sum(), deviations }
    }
}

/// Rays through every texel of every probe: `per_texel` each, and `guided` more in the mean over all. `None` where there is no
/// probe.
pub struct Guide(Vec<Option<Box<[u16]>>>);

impl Guide {
    /// `pilots` by probe, with what numbers its random sequences.
    pub fn new(pilots: Vec<Option<(usize, Pilot)>>, per_texel: usize, guided: f32, seed: u64) -> Guide {
        let active = || pilots.iter().flatten().map(|(_, pilot)| pilot);
        let count = active().count() as f64;
        let floor = DARKEST * active().map(|pilot| pilot.light).sum::<f64>() / count;
        let relative = |pilot: &Pilot| {
            let light = pilot.light + floor;
            if pilot.deviation > 0.0 && light.is_finite() { pilot.deviation / light } else { 0.0 }
        };
        let sum: f64 = active().map(relative).sum();
        let counts = |(stream, pilot): (usize, Pilot)| {
            let texels = pilot.deviations.len();
            let share = if sum > 0.0 { relative(&pilot) / sum } else { 0.0 };
            let rays = texels as f64 * (count * f64::from(guided) * share).min(MOST);
            let (even, by_deviation) = (EVEN * rays / texels as f64, (1.0 - EVEN) * rays);
            let of_all: f64 = pilot.deviations.iter().map(|&d| f64::from(d)).sum();
            let mut random = Random::new(seed, Purpose::Pilot, stream as u64, 1);
            let count = |deviation: f32| {
                let wanted = if rays > 0.0 { even + by_deviation * f64::from(deviation) / of_all } else { 0.0 };
                // Rounded by chance; `as` saturates.
                (per_texel as f64 + wanted + f64::from(random.uniform())) as u16
            };
            pilot.deviations.into_iter().map(count).collect()
        };
        Guide(pilots.into_iter().map(|pilot| pilot.map(counts)).collect())
    }

    /// Rays through the texels of a probe.
    pub fn of(&self, probe: usize) -> Option<&[u16]> {
        self.0[probe].as_deref()
    }
}

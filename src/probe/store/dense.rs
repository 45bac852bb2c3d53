//! A filter whose weights are too many to be kept: they are computed whenever it is applied.
//!
//! From 128² texels to 128², the cosine lobe has 134 million weights, 1.07 GB, and computing one is as fast as reading it.
//! Texels are taken at their mean directions: at a size of 0.03 rad the lobe's mean within one differs by 10⁻⁴.

use std::f32::consts::PI;

use glam::{Vec3, Vec3A};

use crate::math::statistics::Moments;

/// Texels whose weights are computed beside each other.
const LANES: usize = 8;

type Lanes = [f32; LANES];

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub struct Dense {
    /// Directions and solid angles of the texels, [`LANES`] at a time; beyond the last texel nothing weighs anything.
    x: Vec<Lanes>,
    y: Vec<Lanes>,
    z: Vec<Lanes>,
    solid_angle: Vec<Lanes>,
    axes: Vec<Vec3>,
    exponent: f32,
    /// For every row one bit a block of texels: whether any of them weighs more than next to nothing.
    blocks: Vec<u64>,
}

fn words(texels: usize) -> usize {
    texels.div_ceil(LANES).div_ceil(64)
}

/// Numbers of texels side by side.
fn lanes(texels: usize, value: impl Fn(usize) -> f32) -> Vec<Lanes> {
    let at = |i: usize| if i < texels { value(i) } else { 0.0 };
    (0..texels.div_ceil(LANES)).map(|b| std::array::from_fn(|l| at(b * LANES + l))).collect()
}

fn sum(lanes: Lanes) -> f64 {
    lanes.iter().map(|&x| f64::from(x)).sum()
}

impl Dense {
    /// Means under max(0, ω·d)^`exponent`; lobes below `negligible` count as nothing.
    pub fn new(texels: &[(Vec3, f32)], axes: &[Vec3], exponent: f32, negligible: f32) -> Dense {
        let n = texels.len();
        let least = negligible.powf(1.0 / exponent);
        let words = words(n);
        let mut blocks = vec![0; axes.len() * words];
        for (axis, row) in axes.iter().zip(blocks.chunks_mut(words)) {
            for (b, block) in texels.chunks(LANES).enumerate() {
                if block.iter().any(|(d, _)| axis.dot(*d) > least) {
                    row[b / 64] |= 1 << (b % 64);
                }
            }
        }
        Dense {
            x: lanes(n, |i| texels[i].0.x),
            y: lanes(n, |i| texels[i].0.y),
            z: lanes(n, |i| texels[i].0.z),
            solid_angle: lanes(n, |i| texels[i].1),
            axes: axes.to_vec(),
            exponent,
            blocks,
        }
    }

    /// Memory of the filter of so many texels and axes.
    pub fn bytes(texels: usize, axes: usize) -> u64 {
        (texels * (size_of::<(Vec3, f32)>() + 4 * size_of::<f32>()) + axes * (words(texels) * 8 + size_of::<Vec3>()))
            as u64
    }

    pub fn rows(&self) -> usize {
        self.axes.len()
    }

    /// Blocks of texels that count for a row.
    fn blocks(&self, row: usize) -> impl Iterator<Item = usize> + '_ {
        let words = self.blocks.len() / self.axes.len();
        self.blocks[row * words..(row + 1) * words].iter().enumerate().flat_map(|(w, &bits)| {
            let mut left = bits;
            std::iter::from_fn(move || {
                let bit = left.trailing_zeros() as usize;
                left &= left.wrapping_sub(1);
                (bit < 64).then_some(w * 64 + bit)
            })
        })
    }

    #[inline]
    fn weights(&self, axis: Vec3, b: usize) -> Lanes {
        let (x, y, z, solid_angle) = (&self.x[b], &self.y[b], &self.z[b], &self.solid_angle[b]);
        let cosine: Lanes = std::array::from_fn(|l| (axis.x * x[l] + axis.y * y[l] + axis.z * z[l]).max(0.0));
        let lobe = if self.exponent == 1.0 { cosine } else { power(cosine, self.exponent) };
        std::array::from_fn(|l| lobe[l] * solid_angle[l])
    }

    /// As [`super::kernel::Kernel::irradiance`].
    pub fn irradiance(&self, radiance: &[Vec3A], out: &mut [Vec3A]) {
        let channel = |c: usize| lanes(radiance.len(), |i| radiance[i][c]);
        let channels = [channel(0), channel(1), channel(2)];
        for (o, value) in out.iter_mut().enumerate() {
            let mut sums = [[0.0f32; LANES]; 4];
            for b in self.blocks(o) {
                let w = self.weights(self.axes[o], b);
                for l in 0..LANES {
                    sums[0][l] += w[l] * channels[0][b][l];
                    sums[1][l] += w[l] * channels[1][b][l];
                    sums[2][l] += w[l] * channels[2][b][l];
                    sums[3][l] += w[l];
                }
            }
            let [r, g, b, weight] = sums.map(sum);
            let mean = |x: f64| if weight > 0.0 { (x / weight) as f32 } else { 0.0 };
            *value = PI * Vec3A::new(mean(r), mean(g), mean(b));
        }
    }

    /// As [`super::kernel::Kernel::distance`].
    pub fn distance(&self, texels: &[Moments]) -> Vec<Moments> {
        let means = lanes(texels.len(), |i| texels[i].mean() as f32);
        let variances = lanes(texels.len(), |i| texels[i].variance() as f32);
        let of_row = |o: usize| {
            let (mut first, mut weight) = ([0.0f32; LANES], [0.0f32; LANES]);
            for b in self.blocks(o) {
                let w = self.weights(self.axes[o], b);
                for l in 0..LANES {
                    first[l] += w[l] * means[b][l];
                    weight[l] += w[l];
                }
            }
            let (first, weight) = (sum(first), sum(weight));
            let mut out = Moments::default();
            if weight <= 0.0 {
                return out;
            }
            // About the mean, so that nothing large is subtracted.
            let mean = (first / weight) as f32;
            let mut second = [0.0f32; LANES];
            for b in self.blocks(o) {
                let w = self.weights(self.axes[o], b);
                for l in 0..LANES {
                    let deviation = means[b][l] - mean;
                    second[l] += w[l] * (variances[b][l] + deviation * deviation);
                }
            }
            out.add_set(first / weight, sum(second) / weight, weight);
            out
        };
        (0..self.rows()).map(of_row).collect()
    }
}

/// Each number to the power: by squaring where it is whole.
#[inline]
fn power(x: Lanes, exponent: f32) -> Lanes {
    if exponent.fract() != 0.0 || exponent > 65_536.0 {
        return x.map(|x| x.powf(exponent));
    }
    let (mut square, mut result) = (x, [1.0f32; LANES]);
    let mut left = exponent as u32;
    while left > 0 {
        if left & 1 == 1 {
            (0..LANES).for_each(|l| result[l] *= square[l]);
        }
        (0..LANES).for_each(|l| square[l] *= square[l]);
        left >>= 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::octahedral::texel_direction;
    use crate::probe::store::kernel::{Directions, Kernel};

    /// Weights computed at every use are those that are kept, up to where a texel is taken.
    #[test]
    fn kept_and_computed_weights_agree() {
        let (from, to) = (24, 5);
        let captured = Directions::octahedral(from);
        let axes: Vec<Vec3> = (0..to * to).map(|o| texel_direction(o % to, o / to, to)).collect();
        let radiance: Vec<Vec3A> =
            captured.texel_means().iter().map(|(d, _)| Vec3A::new(1.0, 1.0 + d.x, 2.0 + d.y * d.z)).collect();
        let distances: Vec<Moments> = captured
            .texel_means()
            .iter()
            .map(|(d, _)| {
                let mut m = Moments::default();
                m.add_set(f64::from(2.0 + d.x), 0.01, 1.0);
                m
            })
            .collect();
        for exponent in [1.0, 3.5, 50.0] {
            let (kept, computed) =
                (Kernel::lobe(&captured, &axes, exponent), Dense::new(&captured.texel_means(), &axes, exponent, 1e-9));
            let mut e = [vec![Vec3A::ZERO; to * to], vec![Vec3A::ZERO; to * to]];
            kept.irradiance(&radiance, &mut e[0]);
            computed.irradiance(&radiance, &mut e[1]);
            let (m, n) = (kept.distance(&distances), computed.distance(&distances));
            for o in 0..to * to {
                // Texels of up to 0.19 rad under a lobe of exponent k: its mean within one differs by k·0.19²/24 of itself,
                // 7 % at k = 50, and means under it by as much of how they change within the lobe, 1/√k times at most π.
                let tolerance = 0.04f64;
                assert!(f64::from((e[0][o] - e[1][o]).abs().max_element()) < tolerance, "{} {}", e[0][o], e[1][o]);
                assert!((e[1][o].x / PI - 1.0).abs() < 1e-6);
                assert!((m[o].mean() - n[o].mean()).abs() < tolerance);
                assert!((m[o].variance() - n[o].variance()).abs() < tolerance);
            }
        }
    }
}

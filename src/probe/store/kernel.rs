//! Filters over a probe's captured sphere: irradiance, and moments of distance.
//!
//! Both are weighted means over the capture's texels with weights that depend on directions alone, so they are
//! computed once and shared by all probes. Rows are normalised to 1: constant radiance L gives an irradiance of
//! exactly πL, whatever the resolutions.

mod harmonics;

use std::f32::consts::PI;

use glam::{Quat, Vec2, Vec3, Vec3A};

use super::dense::Dense;
use crate::math::octahedral::{direction_from_oct, solid_angle_density};
use crate::math::statistics::Moments;

/// Points per side at which the weight of one capture texel is integrated.
const QUADRATURE: usize = 4;

/// Weights below this share of a row's largest are left out: together they are below f32's own rounding.
const NEGLIGIBLE: f32 = 1e-9;

/// Directions within every captured texel, each with the solid angle that it stands for, sr: what filters integrate over.
#[derive(Debug, Clone)]
pub struct Directions {
    /// As many a texel as there are in [`Self::per_texel`].
    all: Vec<(Vec3, f32)>,
    per_texel: usize,
}

impl Directions {
    /// Of an octahedral map of `resolution`² texels, [`QUADRATURE`]² a texel.
    pub fn octahedral(resolution: usize) -> Directions {
        let fine = (resolution * QUADRATURE) as f32;
        let of_texel = |t: usize| {
            let corner = Vec2::new((t % resolution) as f32, (t / resolution) as f32) * QUADRATURE as f32;
            (0..QUADRATURE * QUADRATURE).map(move |i| {
                let inside = Vec2::new((i % QUADRATURE) as f32 + 0.5, (i / QUADRATURE) as f32 + 0.5);
                let oct = (corner + inside) / fine * 2.0 - 1.0;
                (direction_from_oct(oct), solid_angle_density(oct))
            })
        };
        let all = (0..resolution * resolution).flat_map(of_texel).collect();
        Directions { all, per_texel: QUADRATURE * QUADRATURE }
    }

    /// Of rays that each stand for as much of the sphere as any other, unit.
    pub fn even(rays: Vec<Vec3>) -> Directions {
        let share = 4.0 * PI / rays.len().max(1) as f32;
        Directions::lone(rays.into_iter().map(|direction| (direction, share)).collect())
    }

    /// Of rays that are a texel each, unit, with the solid angles that they stand for, sr.
    pub fn lone(rays: Vec<(Vec3, f32)>) -> Directions {
        Directions { all: rays, per_texel: 1 }
    }

    /// The same turned.
    pub fn turned(mut self, rotation: Quat) -> Directions {
        self.all.iter_mut().for_each(|(direction, _)| *direction = rotation * *direction);
        self
    }

    pub fn texels(&self) -> usize {
        self.all.len() / self.per_texel
    }

    /// Of every texel the mean direction, unit, and the solid angle, sr.
    pub fn texel_means(&self) -> Vec<(Vec3, f32)> {
        let mean = |texel: &[(Vec3, f32)]| {
            let sum: Vec3 = texel.iter().map(|(d, w)| *d * *w).sum();
            (sum.normalize_or(Vec3::Z), texel.iter().map(|(_, w)| w).sum())
        };
        self.all.chunks(self.per_texel).map(mean).collect()
    }
}

/// Kernels whose weights would take more than this compute them at every use instead, see [`Dense`].
const SPARSE_BYTES: f64 = (256u64 << 20) as f64;

/// A sparse matrix from capture texels to the texels of a stored map; each row sums to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Kernel {
    /// `row_start[o]..row_start[o + 1]` are the entries of output texel `o`.
    row_start: Vec<usize>,
    entries: Vec<(u32, f32)>,
    /// In place of all that where it would be too large.
    dense: Option<Dense>,
}

impl Kernel {
    /// The matrix of these rows, each a list of columns and weights above 0.
    pub fn of_rows(rows: impl Iterator<Item = Vec<(u32, f32)>>) -> Kernel {
        let mut kernel = Kernel { row_start: vec![0], entries: Vec::new(), dense: None };
        for row in rows {
            let sum: f64 = row.iter().map(|(_, w)| f64::from(*w)).sum();
            kernel.entries.extend(row.into_iter().map(|(t, w)| (t, (f64::from(w) / sum) as f32)));
            kernel.row_start.push(kernel.entries.len());
        }
        kernel
    }

    /// Cosine-weighted means around each of `axes`, unit: irradiance ÷ π.
    pub fn cosine(captured: &Directions, axes: &[Vec3]) -> Kernel {
        Kernel::lobe(captured, axes, 1.0)
    }

    /// Means under max(0, ω·d)^`exponent` around each of `axes`, unit.
    pub fn lobe(captured: &Directions, axes: &[Vec3], exponent: f32) -> Kernel {
        let entries = Kernel::entries(captured.texels(), axes.len(), exponent);
        if Kernel::is_dense(entries) {
            let dense = Dense::new(&captured.texel_means(), axes, exponent, NEGLIGIBLE);
            return Kernel { row_start: vec![0], entries: Vec::new(), dense: Some(dense) };
        }
        let mut kernel =
            Kernel { row_start: vec![0], entries: Vec::with_capacity((entries * 1.02) as usize), dense: None };
        for axis in axes {
            let texel = |texel: &[(Vec3, f32)]| -> f32 {
                texel.iter().map(|(d, w)| axis.dot(*d).max(0.0).powf(exponent) * w).sum()
            };
            let row: Vec<f32> = captured.all.chunks(captured.per_texel).map(texel).collect();
            kernel.push_row(&row);
        }
        kernel
    }

    /// About how many weights a kernel has: captured texels in the cap around each axis whose lobe is not [`NEGLIGIBLE`].
    /// A cap within the angle θ is (1 − cos θ)/2 of the sphere.
    fn entries(texels: usize, axes: usize, exponent: f32) -> f64 {
        let share = (1.0 - f64::from(NEGLIGIBLE).powf(1.0 / f64::from(exponent))) / 2.0;
        axes as f64 * texels as f64 * share
    }

    /// Memory of a kernel while it is made.
    pub fn bytes(texels: usize, axes: usize, exponent: f32) -> u64 {
        let quadrature = (texels * QUADRATURE * QUADRATURE * size_of::<(Vec3, f32)>()) as u64;
        let entries = Kernel::entries(texels, axes, exponent);
        if Kernel::is_dense(entries) {
            return Dense::bytes(texels, axes) + quadrature;
        }
        // `as` saturates.
        (entries * size_of::<(u32, f32)>() as f64) as u64 + quadrature
    }

    /// Whether so many weights are not kept.
    fn is_dense(entries: f64) -> bool {
        entries * size_of::<(u32, f32)>() as f64 > SPARSE_BYTES
    }

    fn push_row(&mut self, weights: &[f32]) {
        let largest = weights.iter().copied().fold(0.0, f32::max);
        let kept = || weights.iter().enumerate().filter(|(_, w)| **w > NEGLIGIBLE * largest);
        let sum: f64 = kept().map(|(_, &w)| f64::from(w)).sum();
        self.entries.extend(kept().map(|(t, &w)| (t as u32, (f64::from(w) / sum) as f32)));
        self.row_start.push(self.entries.len());
    }

    pub fn rows(&self) -> usize {
        self.dense.as_ref().map_or(self.row_start.len() - 1, Dense::rows)
    }

    /// The columns of a row with their weights; of kernels that keep none, none.
    pub fn row(&self, o: usize) -> &[(u32, f32)] {
        if self.dense.is_some() {
            return &[];
        }
        &self.entries[self.row_start[o]..self.row_start[o + 1]]
    }

    /// Irradiance, W·m⁻², around every output direction from the radiance in every capture texel:
    /// `E(n) = π · Σ L·w / Σ w`, w = max(0, n·ω)·ΔΩ.
    pub fn irradiance(&self, radiance: &[Vec3A], out: &mut [Vec3A]) {
        /// Sums that run beside each other, so that no addition waits for the one before it.
        const LANES: usize = 4;
        if let Some(dense) = &self.dense {
            return dense.irradiance(radiance, out);
        }
        for (o, value) in out.iter_mut().enumerate() {
            let (blocks, rest) = self.row(o).as_chunks::<LANES>();
            let mut sums = [Vec3A::ZERO; LANES];
            for block in blocks {
                for (sum, &(t, w)) in sums.iter_mut().zip(block) {
                    *sum += radiance[t as usize] * w;
                }
            }
            let rest: Vec3A = rest.iter().map(|&(t, w)| radiance[t as usize] * w).sum();
            *value = PI * (sums.iter().sum::<Vec3A>() + rest);
        }
    }

    /// The same without some texels, in ascending order, of which neither light nor weight counts. `None` where nothing is
    /// left for a direction.
    pub fn irradiance_without(&self, radiance: &[Vec3A], left_out: &[u32]) -> Option<Vec<Vec3A>> {
        if left_out.is_empty() || self.dense.is_some() {
            let mut out = vec![Vec3A::ZERO; self.rows()];
            self.irradiance(radiance, &mut out);
            return Some(out);
        }
        let mean = |o: usize| {
            let counted = self.row(o).iter().filter(|(t, _)| left_out.binary_search(t).is_err());
            let (sum, weight) =
                counted.fold((Vec3A::ZERO, 0.0), |(sum, weight), &(t, w)| (sum + radiance[t as usize] * w, weight + w));
            (weight > 0.0).then(|| PI * sum / weight)
        };
        (0..self.rows()).map(mean).collect()
    }

    /// Mean and variance of distance around every output direction from those within every capture texel, metres.
    pub fn distance(&self, texels: &[Moments]) -> Vec<Moments> {
        if let Some(dense) = &self.dense {
            return dense.distance(texels);
        }
        let mix = |o: usize| {
            let mut sum = Moments::default();
            for &(t, w) in self.row(o) {
                let m = &texels[t as usize];
                sum.add_set(m.mean(), m.variance(), f64::from(w));
            }
            sum
        };
        (0..self.rows()).map(mix).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::octahedral::texel_direction;

    fn axes(n: usize) -> Vec<Vec3> {
        (0..n * n).map(|o| texel_direction(o % n, o / n, n)).collect()
    }

    #[test]
    fn constant_radiance_gives_pi_times_it() {
        for (capture, out) in [(8, 6), (16, 8), (5, 1)] {
            let kernel = Kernel::cosine(&Directions::octahedral(capture), &axes(out));
            let mut e = vec![Vec3A::ZERO; out * out];
            kernel.irradiance(&vec![Vec3A::ONE; capture * capture], &mut e);
            // Rows are normalised in f64; what is left is the rounding of a sum of f32.
            assert!(e.iter().all(|e| (e.x / PI - 1.0).abs() < 1e-5), "{e:?}");
        }
    }

    #[test]
    fn linear_radiance_has_its_closed_form() {
        // L(ω) = 1 + ω·z: E(n) = π + (2π/3) n·z.
        let (capture, out) = (32, 8);
        let kernel = Kernel::cosine(&Directions::octahedral(capture), &axes(out));
        let radiance: Vec<Vec3A> = (0..capture * capture)
            .map(|t| Vec3A::splat(1.0 + texel_direction(t % capture, t / capture, capture).z))
            .collect();
        let mut e = vec![Vec3A::ZERO; out * out];
        kernel.irradiance(&radiance, &mut e);
        for (o, e) in e.iter().enumerate() {
            let z = texel_direction(o % out, o / out, out).z;
            let exact = PI * (1.0 + 2.0 / 3.0 * z);
            // Texels of 0.1 rad, midpoint value: relative error about 0.1²/24.
            assert!((e.x - exact).abs() < 5e-3, "texel {o}: {} instead of {exact}", e.x);
        }
    }

    #[test]
    fn distance_moments_of_two_shells() {
        // Distance 1 on one half of the sphere and 3 on the other: at the pole of a half, the mean is 1 and the
        // variance nearly 0; at the rim it is 2 and 1.
        let (capture, out) = (32, 15);
        let texels: Vec<Moments> = (0..capture * capture)
            .map(|t| {
                let mut m = Moments::default();
                m.add(if texel_direction(t % capture, t / capture, capture).x > 0.0 { 1.0 } else { 3.0 }, 1.0);
                m
            })
            .collect();
        let filtered = Kernel::lobe(&Directions::octahedral(capture), &axes(out), 50.0).distance(&texels);
        // Row 7 of 15 runs through the pole along x; column 7 is the pole +Z, on the rim between the halves.
        let (rim, pole) = (&filtered[7 * 15 + 7], &filtered[7 * 15 + 14]);
        assert!((rim.mean() - 2.0).abs() < 1e-3 && (rim.variance() - 1.0).abs() < 1e-3, "{rim:?}");
        assert!((pole.mean() - 1.0).abs() < 1e-3 && pole.variance() < 1e-2, "{pole:?}");
    }
}

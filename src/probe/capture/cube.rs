//! The six faces of a cube around a probe, and the weights by which they are resampled to an octahedral map (Luo 2022).
//!
//! Texel `x + n·(y + n·f)` of a cube of n² texels a face is that of column x and row y of face f, 2·axis + (1 where
//! negative). Its rays go through texel centres. A texel of the map with the direction d is the mean of all texels of
//! the cube, with the directions d′, under max(0, d·d′)^sharpness.
//!
//! As published, weights count texels and not the solid angles that they stand for. Around the middle of a face texels grow
//! denser by 1 + 3/2·θ², so that of a small lamp's light there 6/k is lost, k the sharpness: 0.3 % in the presets.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::math::octahedral::texel_direction;
use crate::probe::store::kernel::Kernel;

pub const CUBE_FACES: usize = 6;

/// Weights below this share of 1, the largest there can be, are left out: of a lobe that falls like a Gaussian they are
/// as small a share of the sum.
const NEGLIGIBLE: f32 = 1e-3;

/// Axis that a face looks along, and the two along its columns and its rows.
fn axes(face: u32) -> (usize, usize, usize) {
    let axis = face as usize / 2;
    (axis, (axis + 1) % 3, (axis + 2) % 3)
}

/// Unit direction through the centre of a texel.
pub fn direction(texel: u32, face: u32) -> Vec3 {
    let (axis, u, v) = axes(texel / (face * face));
    let centre = |i: u32| (i as f32 + 0.5) / face as f32 * 2.0 - 1.0;
    let mut direction = Vec3::ZERO;
    direction[axis] = if (texel / (face * face)).is_multiple_of(2) { 1.0 } else { -1.0 };
    (direction[u], direction[v]) = (centre(texel % face), centre(texel / face % face));
    direction.normalize()
}

/// Texels per solid angle in a unit direction, sr⁻¹: a patch dA of a face at distance 1/m from the centre, m the largest
/// component, is seen under dA·m³, and texels have the area 4/n².
pub fn density(direction: Vec3, face: u32) -> f32 {
    (face * face) as f32 / (4.0 * direction.abs().max_element().powi(3))
}

/// Directions through the centres of all texels, each with the solid angle of the texel, sr.
pub fn texels(face: u32) -> Vec<(Vec3, f32)> {
    let texel = |t| (direction(t, face), 1.0 / density(direction(t, face), face));
    (0..CUBE_FACES as u32 * face * face).map(texel).collect()
}

/// The weights from the texels of a cube to those of a map, and the texels beside each.
#[derive(Debug, Clone)]
pub struct Resampling {
    pub kernel: Kernel,
}

impl Resampling {
    pub fn new(face: usize, resolution: usize, sharpness: f32) -> Resampling {
        let row =
            |o: usize| Self::row(texel_direction(o % resolution, o / resolution, resolution), face as u32, sharpness);
        let rows: Vec<Vec<(u32, f32)>> = (0..resolution * resolution).into_par_iter().map(row).collect();
        Resampling { kernel: Kernel::of_rows(rows.into_iter()) }
    }

    /// Texels of the cube around a direction, with their weights.
    fn row(axis: Vec3, face: u32, sharpness: f32) -> Vec<(u32, f32)> {
        // cos^k = NEGLIGIBLE.
        let least = NEGLIGIBLE.powf(1.0 / sharpness);
        let sine = (1.0 - least * least).max(0.0).sqrt();
        // No texel of a face lies farther from its axis than a corner, whose cosine is 1/√3; a cone around a direction whose
        // cosine is below that of a corner and the cone's breadth meets none.
        let lowest = (least - std::f32::consts::SQRT_2 * sine) / 3.0f32.sqrt();
        let mut entries = Vec::new();
        for f in 0..CUBE_FACES as u32 {
            let (w, u, v) = axes(f);
            let depth = if f.is_multiple_of(2) { axis[w] } else { -axis[w] };
            if depth < lowest {
                continue;
            }
            let (low, high) = if depth > 2.0 * sine {
                // A cone of this sine around the axis meets the plane within sine·(1 + |tan|²)/(1 − sine·|tan|) of it, at
                // most; on a face |tan| is at most √2 and a cone's breadth.
                let centre = Vec2::new(axis[u], axis[v]) / depth;
                let tangent = centre.length();
                let reach = sine * (1.0 + tangent * tangent) / (1.0 - (sine * tangent).min(0.9));
                (centre - reach, centre + reach)
            } else {
                (Vec2::NEG_ONE, Vec2::ONE)
            };
            let texel = |x: f32| ((x * 0.5 + 0.5) * face as f32).clamp(0.0, face as f32) as u32;
            if low.max_element() > 1.0 || high.min_element() < -1.0 {
                continue;
            }
            for y in texel(low.y)..(texel(high.y) + 1).min(face) {
                for x in texel(low.x)..(texel(high.x) + 1).min(face) {
                    let t = x + face * (y + face * f);
                    let cosine = axis.dot(direction(t, face));
                    if cosine >= least {
                        entries.push((t, cosine.powf(sharpness)));
                    }
                }
            }
        }
        if entries.is_empty() {
            // A lobe narrower than a texel.
            let nearest = (0..CUBE_FACES as u32 * face * face)
                .map(|t| (axis.dot(direction(t, face)), t))
                .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            entries.extend(nearest.map(|(_, t)| (t, 1.0)));
        }
        entries
    }

    /// Bytes of the weights, and of one cube while it is captured.
    pub fn bytes(face: usize, resolution: usize, sharpness: f32) -> (u64, u64) {
        let texels = CUBE_FACES * face * face;
        // A cap within the angle θ is (1 − cos θ)/2 of the sphere.
        let share = (1.0 - NEGLIGIBLE.powf(1.0 / sharpness)) / 2.0;
        let entries = (texels as f64 * f64::from(share)).max(1.0) * (resolution * resolution) as f64;
        (entries as u64 * size_of::<(u32, f32)>() as u64, texels as u64 * CUBE_TEXEL_BYTES)
    }
}

/// A texel of a cube until it is resampled: a surfel with its geometric normal, what was seen of it, its distances, its emission and an index.
const CUBE_TEXEL_BYTES: u64 = 40 + 4 + 20 + 24 + 16 + 4;

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;

    #[test]
    fn texels_cover_the_sphere() {
        let face = 16;
        let sum: f32 = texels(face).iter().map(|(_, solid_angle)| solid_angle).sum();
        // Midpoint rule over squares of 1/8: its error is about 1/8²/24.
        assert!((sum / (4.0 * PI) - 1.0).abs() < 2e-3, "{sum}");
        let mean = texels(face).iter().map(|(direction, _)| *direction).sum::<Vec3>();
        assert!(mean.length() < 1e-2, "{mean}");
    }

    /// The weights are those of the formula, and none is missing that is not small.
    #[test]
    fn weights_are_those_of_all_texels() {
        let (face, resolution, sharpness) = (16, 8, 40.0);
        let resampling = Resampling::new(face, resolution, sharpness);
        for o in 0..resolution * resolution {
            let axis = texel_direction(o % resolution, o / resolution, resolution);
            let all: Vec<f32> = (0..6 * (face * face) as u32)
                .map(|t| axis.dot(direction(t, face as u32)).max(0.0).powf(sharpness))
                .collect();
            let kept: f32 = all.iter().filter(|w| **w >= NEGLIGIBLE).sum();
            let row = resampling.kernel.row(o);
            assert_eq!(row.len(), all.iter().filter(|w| **w >= NEGLIGIBLE).count(), "texel {o}");
            for &(t, w) in row {
                assert!((w - all[t as usize] / kept).abs() < 1e-5, "texel {o}: {w}");
            }
        }
        assert_eq!(Resampling::new(2, 8, 1e7).kernel.rows(), 64);
    }
}

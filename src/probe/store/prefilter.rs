//! How levels of radiance are blurred for rough surfaces.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::kernel::Kernel;
use crate::math::octahedral::{oct_from_direction, texel_direction};

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Prefilter {
    /// Each level is the mean of 2×2 texels of the one above, as texture units make it.
    #[default]
    Halved,
    /// Level k of n is what a surface of roughness k/(n − 1) reflects that is seen along its normal: the mean over GGX's lobe of
    /// α = (k/(n − 1))², weighted by the cosine (Karis 2013).
    Ggx,
}

/// Directions of a lobe.
const DIRECTIONS: u32 = 1024;

impl Prefilter {
    /// The filters from captured maps, as large as the first level, to each level; none where levels come from each other.
    pub fn kernels(self, levels: &[usize]) -> Vec<Kernel> {
        let (Prefilter::Ggx, Some(&side)) = (self, levels.first()) else { return Vec::new() };
        let kernel = |(k, &n): (usize, &usize)| {
            let roughness = k as f32 / (levels.len() - 1).max(1) as f32;
            let lobe = lobe(roughness * roughness);
            let row = |o: usize| row(texel_direction(o % n, o / n, n), &lobe, side);
            let rows: Vec<Vec<(u32, f32)>> = (0..n * n).into_par_iter().map(row).collect();
            Kernel::of_rows(rows.into_iter())
        };
        levels.iter().enumerate().map(kernel).collect()
    }
}

/// Directions around +z in which a surface with this α looks along its normal, with the cosine as weight.
fn lobe(alpha: f32) -> Vec<(Vec3, f32)> {
    let of_facet = |i: u32| {
        // Hammersley's set.
        let u = Vec2::new((i as f32 + 0.5) / DIRECTIONS as f32, i.reverse_bits() as f32 / (1u64 << 32) as f32);
        let cosine = ((1.0 - u.y) / (1.0 + (alpha * alpha - 1.0) * u.y)).max(0.0).sqrt();
        let (sine, phi) = ((1.0 - cosine * cosine).max(0.0).sqrt(), TAU * u.x);
        let facet = Vec3::new(sine * phi.cos(), sine * phi.sin(), cosine);
        // The normal mirrored at the facet.
        let light = facet * (2.0 * cosine) - Vec3::Z;
        (light, light.z)
    };
    (0..DIRECTIONS).map(of_facet).filter(|(_, weight)| *weight > 0.0).collect()
}

/// Captured texels around an axis, with their weights.
fn row(axis: Vec3, lobe: &[(Vec3, f32)], side: usize) -> Vec<(u32, f32)> {
    let (tangent, bitangent) = axis.any_orthonormal_pair();
    let texel = |(d, weight): &(Vec3, f32)| {
        let oct = oct_from_direction(tangent * d.x + bitangent * d.y + axis * d.z);
        let at = ((oct * 0.5 + 0.5) * side as f32).max(Vec2::ZERO).as_uvec2();
        let last = side as u32 - 1;
        (at.x.min(last) + side as u32 * at.y.min(last), *weight)
    };
    let mut found: Vec<(u32, f32)> = lobe.iter().map(texel).collect();
    found.sort_by_key(|(texel, _)| *texel);
    found.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    found
}

#[cfg(test)]
mod tests {
    use glam::{UVec2, Vec3A};

    use super::*;

    fn filtered(kernel: &Kernel, radiance: &[Vec3A]) -> Vec<Vec3A> {
        let mut out = vec![Vec3A::ZERO; kernel.rows()];
        kernel.irradiance(radiance, &mut out);
        out.iter().map(|e| *e / std::f32::consts::PI).collect()
    }

    #[test]
    fn constant_light_stays_as_it_is() {
        for kernel in Prefilter::Ggx.kernels(&[16, 8, 4, 2]) {
            // Rounding of a sum of f32.
            assert!(filtered(&kernel, &[Vec3A::ONE; 256]).iter().all(|l| (l.x - 1.0).abs() < 1e-5));
        }
        assert!(Prefilter::Halved.kernels(&[16, 8]).is_empty());
    }

    /// A sky that is bright above: the rougher, the more of it a level shows below the horizon. At roughness 1 GGX's facets
    /// are cosine-distributed, and what the normal +x mirrors at them is seen with the density 1/(4·cos θ_h)·cos θ_h/π: even
    /// over all directions. Weighted by the cosine, the half of the sky above is half of the light.
    #[test]
    fn rough_levels_see_more_of_the_sky() {
        let levels = [64, 32, 16, 8, 4];
        let sky: Vec<Vec3A> = (0..64 * 64)
            .map(|o| if texel_direction(o % 64, o / 64, 64).z > 0.0 { Vec3A::ONE } else { Vec3A::ZERO })
            .collect();
        let below = Vec3::new(1.0, 0.0, -0.3).normalize();
        let mut last = 0.0;
        for (kernel, n) in Prefilter::Ggx.kernels(&levels).iter().zip(levels) {
            let light = filtered(kernel, &sky);
            let at = ((oct_from_direction(below) * 0.5 + 0.5) * n as f32).as_uvec2().min(UVec2::splat(n as u32 - 1));
            let found = light[at.x as usize + n * at.y as usize].x;
            // The coarsest texels lie on the horizon, and see half of the sky to within some texels of the finest level.
            assert!(found > last - 0.05, "{n}: {found} after {last}");
            last = found;
        }
        assert!(last > 0.3, "{last}");
        let lobe = lobe(1.0);
        let all: f32 = lobe.iter().map(|(_, w)| w).sum();
        let above: f32 = lobe.iter().filter(|(d, _)| d.x > 0.0).map(|(_, w)| w).sum();
        // Hammersley's set of 1,024 halves the circle to within 1/1024 of a column.
        assert!((above / all - 0.5).abs() < 0.01, "{}", above / all);
        // Mean cosine of the cosine-weighted half sphere: 2/3.
        let mean = lobe.iter().map(|(_, w)| w * w).sum::<f32>() / all;
        assert!((mean - 2.0 / 3.0).abs() < 0.01, "{mean}");
    }
}

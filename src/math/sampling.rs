//! Maps from the unit square to other shapes. The density of each map stands beside it.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

/// Uniform on the sphere; density [`UNIFORM_SPHERE_DENSITY`].
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (2.0 * PI * u.y).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

/// Density of [`uniform_sphere`], sr⁻¹.
pub const UNIFORM_SPHERE_DENSITY: f32 = 1.0 / (4.0 * PI);

/// Uniform on the unit disc. This is the concentric map, which keeps neighbouring strata compact
/// (Shirley & Chiu, *A Low Distortion Map Between Disk and Square*, 1997).
#[inline]
pub fn concentric_disc(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    // Selections instead of branches, which would be taken at random.
    let swapped = p.y.abs() >= p.x.abs();
    let (major, minor) = if swapped { (p.y, p.x) } else { (p.x, p.y) };
    let (sin, cos) = sin_cos_octant(PI / 4.0 * (minor / major));
    // The angle counts from the axis of the larger coordinate.
    let (along, across) = (major * cos, major * sin);
    if swapped { Vec2::new(across, along) } else { Vec2::new(along, across) }
}

/// Sine and cosine of |x| ≤ π/4 by their Taylor series. The first omitted terms are at most 3·10⁻⁷ and 3·10⁻⁸. This
/// takes a third of the time of the library's functions, which must handle all angles.
#[inline]
fn sin_cos_octant(x: f32) -> (f32, f32) {
    let s = x * x;
    let sin = x * (1.0 - s * (1.0 / 6.0) * (1.0 - s * (1.0 / 20.0) * (1.0 - s * (1.0 / 42.0))));
    let cos = 1.0 - s * 0.5 * (1.0 - s * (1.0 / 12.0) * (1.0 - s * (1.0 / 30.0) * (1.0 - s * (1.0 / 56.0))));
    (sin, cos)
}

/// Cosine-distributed directions around the unit vector `normal`; density [`cosine_hemisphere_density`].
#[inline]
pub fn cosine_hemisphere(normal: Vec3, u: Vec2) -> Vec3 {
    let d = concentric_disc(u);
    let z = (1.0 - d.length_squared()).max(0.0).sqrt();
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    // The result needs no normalisation: the frame is orthonormal, and the squares of the coordinates sum to 1.
    tangent * d.x + bitangent * d.y + normal * z
}

/// Density of [`cosine_hemisphere`], sr⁻¹.
pub fn cosine_hemisphere_density(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) / PI
}

/// Barycentric coordinates (weights of the second and third vertex), uniform over a triangle's area
/// (Osada et al. 2002); density 1/area.
pub fn triangle_barycentric(u: Vec2) -> Vec2 {
    let s = u.x.sqrt();
    Vec2::new(s * (1.0 - u.y), s * u.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize) -> impl Iterator<Item = Vec2> {
        (0..n * n).map(move |i| Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32)
    }

    #[test]
    fn densities_match_their_maps() {
        // E[f/p] over the map must be the integral of f: here f = cos², whose hemisphere integral is 2π/3.
        let n = 200;
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let f = |d: Vec3| normal.dot(d).max(0.0).powi(2);
        let cosine: f32 = grid(n)
            .map(|u| {
                let d = cosine_hemisphere(normal, u);
                f(d) / cosine_hemisphere_density(normal.dot(d))
            })
            .sum::<f32>()
            / (n * n) as f32;
        let uniform: f32 = grid(n).map(|u| f(uniform_sphere(u)) / UNIFORM_SPHERE_DENSITY).sum::<f32>() / (n * n) as f32;
        let exact = 2.0 * PI / 3.0;
        // Midpoint rule on 200² points: error well below 1e-3.
        assert!((cosine - exact).abs() < 2e-3, "{cosine}");
        assert!((uniform - exact).abs() < 2e-3, "{uniform}");
    }

    #[test]
    fn octant_series_agree_with_the_library() {
        for i in -100..=100 {
            let x = PI / 4.0 * i as f32 / 100.0;
            let (sin, cos) = sin_cos_octant(x);
            // The series' own error and two roundings.
            assert!((sin - x.sin()).abs() < 5e-7 && (cos - x.cos()).abs() < 2e-7, "{x}: {sin} {cos}");
        }
    }

    #[test]
    fn triangle_points_are_uniform() {
        let n = 200;
        let mean = grid(n).map(triangle_barycentric).sum::<Vec2>() / (n * n) as f32;
        assert!(mean.distance(Vec2::splat(1.0 / 3.0)) < 1e-3, "{mean}");
        assert!(grid(20).map(triangle_barycentric).all(|b| b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0 + 1e-6));
    }
}

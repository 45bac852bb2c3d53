//! The glossy lobe of metallic-roughness materials: the microfacet BRDF of glTF 2.0, appendix B.
//!
//! The distribution is GGX (Walter et al. 2007) with α = roughness². Masking and shadowing are Smith's for GGX in the
//! separable form G₁(v)·G₁(l), as the appendix gives it. The appendix names the height-correlated form (Heitz 2014) as
//! more accurate. That form reflects more at grazing views: at F0 = 1, n·v = 0.1 and roughness 0.3, 0.5, 0.7 and 1 it
//! has the albedos 0.884, 0.892, 0.862 and 0.760 instead of 0.875, 0.854, 0.776 and 0.558, and at n·v = 0.5 0.975,
//! 0.857, 0.704 and 0.451 instead of 0.975, 0.855, 0.692 and 0.409. Fresnel is Schlick's (1994). Light that scatters
//! twice between facets is lost, which at roughness 1 is more than half.
//!
//! All directions are in the frame of the shading normal (z) and point away from the surface. The BRDF, its sampling
//! and the density of the samples stand here together.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::math::sampling::concentric_disc;

/// Least α. At this value the lobe is 1/20 of a degree wide, a mirror in any picture. A smaller α would come too close
/// to the rounding of f32 directions, 10⁻⁷.
pub const MIN_ALPHA: f32 = 1e-3;

/// Least cosine between the view direction and the normal. Vertex normals and normal maps can make the true cosine
/// negative.
const MIN_COSINE: f32 = 1e-3;

/// Schlick's weight of grazing reflection, (1 − cosine)⁵.
#[inline]
pub fn schlick_weight(cosine: f32) -> f32 {
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let x2 = x * x;
    x2 * x2 * x
}

#[derive(Debug, Clone, Copy)]
pub struct Ggx {
    alpha: f32,
    /// Reflectance along the normal.
    f0: Vec3,
}

impl Ggx {
    /// `roughness` is the perceptual roughness in [0,1].
    pub fn new(roughness: f32, f0: Vec3) -> Ggx {
        Ggx { alpha: (roughness * roughness).max(MIN_ALPHA), f0 }
    }

    /// Reflectance of a facet at this cosine.
    #[inline]
    pub fn fresnel(&self, cosine: f32) -> Vec3 {
        self.f0 + (Vec3::ONE - self.f0) * schlick_weight(cosine)
    }

    /// A view direction that the functions below accept. A direction below the horizon is moved above it.
    #[inline]
    pub fn view(local: Vec3) -> Vec3 {
        if local.z >= MIN_COSINE { local } else { local.with_z(MIN_COSINE).normalize() }
    }

    /// Density of facets by their normal `half`, sr⁻¹.
    #[inline]
    fn distribution(&self, half: Vec3) -> f32 {
        if half.z <= 0.0 {
            return 0.0;
        }
        // The usual form (n·h)²(α² − 1) + 1 cancels for small α. The sum (x² + y²)/α² + z² does not.
        let a2 = self.alpha * self.alpha;
        let sum = (half.x * half.x + half.y * half.y) / a2 + half.z * half.z;
        1.0 / (PI * a2 * sum * sum)
    }

    /// Share of the facets that face this direction and that the direction sees, Smith's G₁ for GGX, divided by twice
    /// the cosine: G₁/(2·cos) = 1/(cos + √(α² + (1 − α²)·cos²)).
    #[inline]
    fn visibility(&self, cosine: f32) -> f32 {
        let a2 = self.alpha * self.alpha;
        1.0 / (cosine + (a2 + (1.0 - a2) * cosine * cosine).sqrt())
    }

    /// The BRDF D·F·G/(4·n·l·n·v), sr⁻¹. It is 0 for light from below the horizon.
    #[inline]
    pub fn brdf(&self, view: Vec3, light: Vec3) -> Vec3 {
        if light.z <= 0.0 {
            return Vec3::ZERO;
        }
        let half = (view + light).normalize();
        // G/(4·n·l·n·v), because G = G₁(v)·G₁(l).
        let visibility = self.visibility(view.z) * self.visibility(light.z);
        self.fresnel(view.dot(half)) * (self.distribution(half) * visibility)
    }

    /// A light direction: the view direction mirrored at a random facet that the viewer sees (Heitz, *Sampling the GGX
    /// Distribution of Visible Normals*, JCGT 7(4), 2018). It may lie below the horizon.
    #[inline]
    pub fn sample(&self, view: Vec3, u: Vec2) -> Vec3 {
        // Stretching the view by α turns the visible facets into a hemisphere. From the stretched view it appears as a
        // disc whose lower half is foreshortened.
        let stretched = Vec3::new(self.alpha * view.x, self.alpha * view.y, view.z).normalize();
        let (t1, t2) = stretched.any_orthonormal_pair();
        // The two halves of the disc meet along the horizontal axis, so t1 must be horizontal.
        let horizontal = Vec3::new(-stretched.y, stretched.x, 0.0);
        let (t1, t2) = match horizontal.try_normalize() {
            Some(t1) => (t1, stretched.cross(t1)),
            None => (t1, t2),
        };
        let disc = concentric_disc(u);
        let fold = 0.5 * (1.0 + stretched.z);
        let y = (1.0 - fold) * (1.0 - disc.x * disc.x).max(0.0).sqrt() + fold * disc.y;
        let z = (1.0 - disc.x * disc.x - y * y).max(0.0).sqrt();
        let facet = t1 * disc.x + t2 * y + stretched * z;
        let half = Vec3::new(self.alpha * facet.x, self.alpha * facet.y, facet.z.max(0.0)).normalize_or(Vec3::Z);
        half * (2.0 * view.dot(half)) - view
    }

    /// Density of [`Self::sample`] over light directions, sr⁻¹: G₁(v)·D/(4·n·v). So BRDF × cosine ÷ density is
    /// F·G₁(l), which is at most 1.
    #[inline]
    pub fn density(&self, view: Vec3, light: Vec3) -> f32 {
        let half = (view + light).normalize_or_zero();
        self.visibility(view.z) * self.distribution(half) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::blocks::{BLOCK, Block};
    use crate::math::random::{Numbers, Purpose};
    use crate::math::statistics::Moments;

    fn view(cosine: f32) -> Vec3 {
        Vec3::new((1.0 - cosine * cosine).sqrt() * 0.8, (1.0 - cosine * cosine).sqrt() * 0.6, cosine)
    }

    /// The directions of a grid in cosine (from `from` to 1) and azimuth, and the solid angle of each.
    fn sphere(n: usize, from: f64) -> impl Iterator<Item = (Vec3, f64)> {
        let weight = (1.0 - from) * 2.0 * std::f64::consts::PI / (n * 2 * n) as f64;
        (0..n * 2 * n).map(move |i| {
            let z = from + (1.0 - from) * ((i % n) as f64 + 0.5) / n as f64;
            let phi = 2.0 * std::f64::consts::PI * ((i / n) as f64 + 0.5) / (2 * n) as f64;
            let r = (1.0 - z * z).sqrt();
            (glam::DVec3::new(r * phi.cos(), r * phi.sin(), z).as_vec3(), weight)
        })
    }

    /// Share of uniform incident light that is reflected, by quadrature.
    fn albedo_by_quadrature(ggx: &Ggx, view: Vec3, n: usize) -> f64 {
        sphere(n, 0.0).map(|(l, w)| f64::from(ggx.brdf(view, l).x * l.z) * w).sum()
    }

    /// Share of uniform incident light that is reflected, by sampling, and its standard error from the spread of
    /// blocks.
    fn albedo_by_sampling(ggx: &Ggx, view: Vec3, blocks: u64) -> (f64, f64) {
        let weight = |b, i| {
            let l = ggx.sample(view, Block::new(3, Purpose::Path, 0, b).sample(i).pair());
            if l.z > 0.0 { f64::from(ggx.brdf(view, l).x * l.z / ggx.density(view, l)) } else { 0.0 }
        };
        let mut moments = Moments::default();
        (0..blocks).for_each(|b| moments.add((0..BLOCK).map(|i| weight(b, i)).sum::<f64>() / f64::from(BLOCK), 1.0));
        (moments.mean(), (moments.variance() / (blocks - 1) as f64).sqrt())
    }

    #[test]
    fn density_integrates_to_one() {
        for roughness in [0.4f32, 0.5, 0.7, 1.0] {
            for cosine in [0.05, 0.5, 0.95, 1.0] {
                let ggx = Ggx::new(roughness, Vec3::ONE);
                let sum: f64 = sphere(1000, -1.0).map(|(l, w)| f64::from(ggx.density(view(cosine), l)) * w).sum();
                // Quadrature of lobes some 0.1 rad wide at steps of 0.003 rad.
                assert!((sum - 1.0).abs() < 2e-3, "roughness {roughness}, cosine {cosine}: {sum}");
            }
        }
    }

    #[test]
    fn sampling_and_quadrature_give_the_same_albedo() {
        for roughness in [0.4f32, 0.7, 1.0] {
            for cosine in [0.1, 0.5, 0.9] {
                for f0 in [1.0, 0.04] {
                    let ggx = Ggx::new(roughness, Vec3::splat(f0));
                    let exact = albedo_by_quadrature(&ggx, view(cosine), 1000);
                    let (sampled, error) = albedo_by_sampling(&ggx, view(cosine), 10_000);
                    // Five standard errors, because 18 cases are tested, and the error of the quadrature. The limit on the
                    // standard error keeps the test sharp.
                    let case = format!("{roughness} {cosine} {f0}: {sampled} ± {error}, {exact}");
                    assert!((sampled - exact).abs() < 5.0 * error + 1e-4 && error < 1e-3, "{case}");
                }
            }
        }
    }

    #[test]
    fn the_known_loss_of_a_rough_mirror() {
        // The known value of the split-sum table for F0 = 1, roughness 1 and n·v = 0.5. At α = 1 Schlick's shadowing
        // with k = α/2, which that table uses, equals Smith's.
        let albedo = albedo_by_quadrature(&Ggx::new(1.0, Vec3::ONE), view(0.5), 1000);
        assert!((albedo - 0.41).abs() < 0.005, "{albedo}");
    }

    #[test]
    fn light_and_viewer_may_change_places() {
        let ggx = Ggx::new(0.5, Vec3::new(0.9, 0.5, 0.04));
        for (a, _) in sphere(8, 0.0) {
            for (b, _) in sphere(8, 0.0) {
                let (there, back) = (ggx.brdf(a, b), ggx.brdf(b, a));
                assert!(there.distance(back) <= 1e-5 * there.length(), "{a} {b}: {there} {back}");
            }
        }
    }

    #[test]
    fn a_smooth_surface_is_a_mirror() {
        // At roughness 0 all light is reflected, to within a few α of the mirror direction.
        for cosine in [0.1, 0.5, 1.0] {
            let ggx = Ggx::new(0.0, Vec3::ONE);
            let mirrored = view(cosine) * Vec3::new(-1.0, -1.0, 1.0);
            let mut near = 0;
            for i in 0..BLOCK {
                let l = ggx.sample(view(cosine), Block::new(3, Purpose::Path, 0, 0).sample(i).pair());
                near += u32::from(l.distance(mirrored) < 0.02);
            }
            assert!(near >= BLOCK - 2, "{near}");
            let (albedo, _) = albedo_by_sampling(&ggx, view(cosine), 1000);
            // A weight is F·G₁(l), and G₁ = 1 − α²·tan²/4 to first order: 1 − 2.5e-5 at cosine 0.1.
            assert!(albedo > 1.0 - 1e-3 && albedo <= 1.0 + 1e-6, "{cosine}: {albedo}");
        }
    }

    #[test]
    fn lobes_reflect_no_more_than_arrives() {
        for roughness in (0..=10).map(|r| r as f32 / 10.0) {
            for cosine in [0.001, 0.01, 0.05, 0.2, 0.5, 0.8, 1.0] {
                let (albedo, _) = albedo_by_sampling(&Ggx::new(roughness, Vec3::ONE), Ggx::view(view(cosine)), 200);
                // Each weight is F·G₁(l) ≤ 1, apart from f32's rounding of some 10 operations.
                assert!(albedo <= 1.0 + 1e-6, "roughness {roughness}, cosine {cosine}: {albedo}");
            }
        }
    }
}

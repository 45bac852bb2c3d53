//! Reflection at a surface. One type, [`Bsdf`], covers both reflection models.

use std::f32::consts::PI;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::World;
use super::ggx::{DIELECTRIC_F0, Ggx};
use super::surface::SurfacePoint;
use crate::math::color::luminance;
use crate::math::random::Numbers;
use crate::math::sampling::{cosine_hemisphere, cosine_hemisphere_density};

/// The reflection model of paths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReflectionModel {
    /// Every surface is Lambertian with its diffuse albedo. Probes store this light.
    #[default]
    Lambert,
    /// The metallic-roughness model of glTF, [`Layered`].
    Gltf,
}

/// The BRDF of a surface for one normal and one view direction.
#[derive(Debug, Clone, Copy)]
pub enum Bsdf {
    Lambert { normal: Vec3, albedo: Vec3 },
    Gltf(Layered),
}

/// The two parts of BRDF × cosine for one light direction, sr⁻¹.
#[derive(Debug, Clone, Copy, Default)]
pub struct Scattered {
    pub diffuse: Vec3,
    pub glossy: Vec3,
}

impl Scattered {
    #[inline]
    pub fn total(&self) -> Vec3 {
        self.diffuse + self.glossy
    }
}

impl Bsdf {
    /// `normal` is the shading normal; `view` the unit direction towards the viewer.
    #[inline]
    pub fn new(world: &World, point: &SurfacePoint, normal: Vec3, view: Vec3, transport: ReflectionModel) -> Bsdf {
        match transport {
            ReflectionModel::Lambert => Bsdf::Lambert { normal, albedo: point.albedo },
            ReflectionModel::Gltf => Bsdf::Gltf(Layered::new(world, point, normal, view)),
        }
    }

    /// The same BRDF with other sampling: at least half of the samples are cosine-distributed. Estimates of irradiance
    /// need this. Irradiance counts all directions, and the weights of its samples must stay bounded.
    #[inline]
    pub fn covering(self) -> Bsdf {
        match self {
            Bsdf::Lambert { .. } => self,
            Bsdf::Gltf(layered) => {
                Bsdf::Gltf(Layered { glossy_share: layered.glossy_share.min(COVERING_GLOSSY_SHARE), ..layered })
            }
        }
    }

    /// The shading normal.
    #[inline]
    pub fn normal(&self) -> Vec3 {
        match self {
            Bsdf::Lambert { normal, .. } => *normal,
            Bsdf::Gltf(layered) => layered.normal,
        }
    }

    /// Whether the surface reflects nothing.
    #[inline]
    pub fn is_black(&self) -> bool {
        match self {
            Bsdf::Lambert { albedo, .. } => *albedo == Vec3::ZERO,
            Bsdf::Gltf(layered) => layered.unlit,
        }
    }

    /// BRDF × cosine for light from unit `direction`. `cosine` > 0 is the cosine between `direction` and the normal.
    #[inline]
    pub fn scattered(&self, direction: Vec3, cosine: f32) -> Scattered {
        match self {
            Bsdf::Lambert { albedo, .. } => Scattered { diffuse: *albedo * (cosine / PI), glossy: Vec3::ZERO },
            Bsdf::Gltf(layered) => layered.scattered(direction, cosine),
        }
    }

    /// Density with which [`Self::sample`] draws `direction`, sr⁻¹. `cosine` > 0 is the cosine between `direction` and
    /// the normal.
    #[inline]
    pub fn density(&self, direction: Vec3, cosine: f32) -> f32 {
        match self {
            Bsdf::Lambert { .. } => cosine_hemisphere_density(cosine),
            Bsdf::Gltf(layered) => layered.density(direction, cosine),
        }
    }

    /// A random light direction, preferably one from which much light is reflected. Its density is [`Self::density`].
    /// It may lie below the surface.
    #[inline]
    pub fn sample(&self, numbers: &mut impl Numbers) -> Vec3 {
        match self {
            Bsdf::Lambert { normal, .. } => cosine_hemisphere(*normal, numbers.pair()),
            Bsdf::Gltf(layered) => layered.sample(numbers),
        }
    }
}

/// Least share of samples for each of two lobes. The estimate of their strengths may be wrong, and without this bound
/// one lobe could get no samples.
const LEAST_SHARE: f32 = 0.1;

/// Largest share of samples for the glossy lobe when irradiance is estimated too ([`Bsdf::covering`]).
const COVERING_GLOSSY_SHARE: f32 = 0.5;

/// A diffuse base under the glossy lobe of [`Ggx`], with the parameters of glTF's metallic-roughness model: F0 =
/// mix(0.04, baseColor, metallic) and diffuse albedo ρ = baseColor·(1 − metallic).
///
/// The base reflects the light that the lobe lets in and out: ρ/π·(1 − F(n·l))·(1 − F(n·v)) with Schlick's F.
///
/// The weight 1 − F(v·h) of glTF's appendix B would create energy. At grazing views the lobe reflects nearly all light.
/// But v·h is large for most light directions, so F(v·h) is small and the base reflects nearly all light again.
/// Together they reflect up to 1.8 times the incident light. With the angles to the normal the sum stays below 1, which
/// a test checks. The model stays reciprocal.
#[derive(Debug, Clone, Copy)]
pub struct Layered {
    normal: Vec3,
    tangent: Vec3,
    bitangent: Vec3,
    /// View direction in the frame (tangent, bitangent, normal).
    view: Vec3,
    ggx: Ggx,
    /// ρ·(1 − F(n·v)).
    base: Vec3,
    /// Probability of sampling the glossy lobe.
    glossy_share: f32,
    unlit: bool,
}

impl Layered {
    fn new(world: &World, point: &SurfacePoint, normal: Vec3, view: Vec3) -> Layered {
        let scene = world.scene;
        let hit = &point.hit;
        let color = scene.base_color(hit.triangle, hit.barycentric).truncate().clamp(Vec3::ZERO, Vec3::ONE);
        let (roughness, metallic) = scene.roughness_metallic(hit.triangle, hit.barycentric);
        let unlit = scene.material(hit.triangle).unlit;
        let f0 = if unlit { Vec3::ZERO } else { Vec3::splat(DIELECTRIC_F0).lerp(color, metallic) };
        // The bound on albedos holds for mirrors too: light between two facing mirrors would not converge either.
        Layered::of(point.albedo, f0.min(Vec3::splat(world.albedo_max)), roughness, normal, view, unlit)
    }

    fn of(albedo: Vec3, f0: Vec3, roughness: f32, normal: Vec3, view: Vec3, unlit: bool) -> Layered {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let view = Ggx::view(Vec3::new(view.dot(tangent), view.dot(bitangent), view.dot(normal)));
        let ggx = Ggx::new(roughness, f0);
        let reflected = ggx.fresnel(view.z);
        let base = albedo * (Vec3::ONE - reflected);
        let (glossy, diffuse) = (luminance(reflected), luminance(base));
        let glossy_share = match (unlit, diffuse > 0.0) {
            (true, _) => 0.0,
            (false, false) => 1.0,
            (false, true) => (glossy / (glossy + diffuse)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE),
        };
        Layered { normal, tangent, bitangent, view, ggx, base, glossy_share, unlit }
    }

    #[inline]
    fn local(&self, direction: Vec3, cosine: f32) -> Vec3 {
        Vec3::new(direction.dot(self.tangent), direction.dot(self.bitangent), cosine)
    }

    #[inline]
    fn scattered(&self, direction: Vec3, cosine: f32) -> Scattered {
        if self.unlit {
            return Scattered::default();
        }
        let diffuse = self.base * (Vec3::ONE - self.ggx.fresnel(cosine)) * (cosine / PI);
        let glossy = self.ggx.brdf(self.view, self.local(direction, cosine)) * cosine;
        Scattered { diffuse, glossy }
    }

    #[inline]
    fn density(&self, direction: Vec3, cosine: f32) -> f32 {
        let diffuse = cosine_hemisphere_density(cosine) * (1.0 - self.glossy_share);
        if self.glossy_share == 0.0 {
            return diffuse;
        }
        diffuse + self.ggx.density(self.view, self.local(direction, cosine)) * self.glossy_share
    }

    #[inline]
    fn sample(&self, numbers: &mut impl Numbers) -> Vec3 {
        let (u, choice) = (numbers.pair(), numbers.uniform());
        if choice >= self.glossy_share {
            return cosine_hemisphere(self.normal, u);
        }
        let local = self.ggx.sample(self.view, u);
        self.tangent * local.x + self.bitangent * local.y + self.normal * local.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::blocks::{BLOCK, Block};
    use crate::math::random::Purpose;
    use crate::math::statistics::Moments;

    fn layered(albedo: f32, f0: f32, roughness: f32, cosine: f32) -> Bsdf {
        let view = Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        Bsdf::Gltf(Layered::of(Vec3::splat(albedo), Vec3::splat(f0), roughness, Vec3::Z, view, false))
    }

    /// Share of uniform incident light that is reflected, and the mean weight of irradiance samples, which should be π;
    /// each with its standard error.
    fn sampled(bsdf: &Bsdf, blocks: u64) -> [(f64, f64); 2] {
        let mut moments = [Moments::default(); 2];
        for b in 0..blocks {
            let (mut albedo, mut irradiance) = (0.0, 0.0);
            for i in 0..BLOCK {
                let direction = bsdf.sample(&mut Block::new(3, Purpose::Path, 1, b).sample(i));
                if direction.z > 0.0 {
                    let density = f64::from(bsdf.density(direction, direction.z));
                    albedo += f64::from(bsdf.scattered(direction, direction.z).total().x) / density;
                    irradiance += f64::from(direction.z) / density;
                }
            }
            moments[0].add(albedo / f64::from(BLOCK), 1.0);
            moments[1].add(irradiance / f64::from(BLOCK), 1.0);
        }
        moments.map(|m| (m.mean(), (m.variance() / (blocks - 1) as f64).sqrt()))
    }

    #[test]
    fn surfaces_reflect_no_more_than_arrives() {
        // A white material reflects more than any other.
        for metallic in [0.0f32, 0.3, 0.7, 1.0] {
            for roughness in [0.0f32, 0.1, 0.3, 0.5, 0.7, 1.0] {
                for cosine in [0.002, 0.02, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0] {
                    let f0 = 0.04 + 0.96 * metallic;
                    let [(albedo, error), _] = sampled(&layered(1.0 - metallic, f0, roughness, cosine), 2000);
                    // The bound is 1, plus four standard errors (probability 3e-5) because 192 cases are tested, plus
                    // f32's rounding of half vectors at α = 0.001.
                    let what = format!("metallic {metallic}, roughness {roughness}, cosine {cosine}");
                    assert!(albedo <= 1.0 + 4.0 * error + 1e-3, "{what}: {albedo} ± {error}");
                    assert!(error < 5e-3, "{what}: too uncertain to tell, ± {error}");
                }
            }
        }
    }

    #[test]
    fn covering_samples_know_the_irradiance() {
        for (albedo, f0, roughness, cosine) in [(0.8, 0.04, 0.0, 0.5), (0.0, 0.9, 0.2, 0.3), (0.5, 0.04, 1.0, 0.9)] {
            let [_, (irradiance, error)] = sampled(&layered(albedo, f0, roughness, cosine).covering(), 4000);
            // Four standard errors: 6e-5 of a normal distribution lies outside.
            assert!((irradiance - f64::from(PI)).abs() < 4.0 * error + 1e-5, "{irradiance} ± {error}");
        }
    }

    #[test]
    fn light_and_viewer_may_change_places() {
        let at = |x: f32, y: f32| Vec3::new(x, y, (1.0 - x * x - y * y).sqrt());
        for (a, b) in [(at(0.3, 0.5), at(-0.7, 0.1)), (at(0.9, 0.2), at(0.1, 0.0))] {
            let brdf = |v: Vec3, l: Vec3| {
                let layered = Layered::of(Vec3::splat(0.6), Vec3::splat(0.04), 0.4, Vec3::Z, v, false);
                layered.scattered(l, l.z).total().x / l.z
            };
            assert!((brdf(a, b) / brdf(b, a) - 1.0).abs() < 1e-4, "{} {}", brdf(a, b), brdf(b, a));
        }
    }
}

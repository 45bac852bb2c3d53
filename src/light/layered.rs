//! The metallic-roughness model of glTF 2.0, appendix B: a diffuse base under the glossy lobe of [`Ggx`].
//!
//! The appendix mixes a dielectric and a metal by `metallic`:
//!
//! ```text
//! dielectric = (1 − F(v·h))·baseColor/π + F(v·h)·S        F0 = 0.04
//! metal      = F(v·h)·S                                   F0 = baseColor
//! ```
//!
//! where S is the lobe without Fresnel. F is linear in F0, so the mix is the lobe with F0 = mix(0.04, baseColor,
//! metallic) and a base of albedo ρ = baseColor·(1 − metallic) under the Fresnel of the dielectric.
//!
//! This creates energy at grazing views of smooth dielectrics. The lobe reflects nearly all light there, but v·h is
//! large for most light directions, so the base reflects nearly all light again: 1.88 times the incident light at
//! roughness 0, n·v = 0.01 and ρ = 1, and 1.12 times at roughness 0.5. From roughness 0.9 on it is less than 1. The
//! appendix says so itself, and it demands energy conservation of accurate simulations. So the base is bounded here:
//!
//! ```text
//! diffuse = (1 − F(v·h))·min(ρ, q(n·v), q(n·l))/π,    q(c) = (1 − E(c))/D(c)
//! ```
//!
//! E(c) is the directional albedo of the lobe ([`LobeAlbedo`]), and D(c) that of (1 − F(v·h))/π. A base of albedo q(c)
//! reflects exactly what the lobe leaves of the light at cosine c, so the total is at most 1. The minimum keeps the BRDF
//! reciprocal. The BRDF is the appendix's for every pair of directions at both of which the appendix keeps energy, E +
//! ρ·D ≤ 1; because of the error of the table this limit is 0.996 to 1. For other pairs it is darker. At normal view
//! this takes from a dielectric of ρ = 1, 0.8 and 0.5: 4.2 %, 1.5 % and 0.3 % at roughness 0.1, 3.0 %, 0.3 % and 0 at
//! roughness 0.3, 1.1 %, 0 and 0 at roughness 0.5. Reciprocity asks for this loss, because light from grazing directions
//! leaves through the lobe alone.
//!
//! Other differences: α is at least [`MIN_ALPHA`](super::ggx::MIN_ALPHA), F0 and ρ are at most [`World::albedo_max`],
//! and view directions below the shading normal's horizon are moved above it ([`Ggx::view`]).

use std::f32::consts::PI;

use glam::Vec3;

use super::World;
use super::ggx::{Ggx, schlick_weight};
use super::lobe_albedo::{LobeAlbedo, TABLE_ERROR};
use super::surface::SurfacePoint;
use crate::math::color::luminance;
use crate::math::random::Numbers;
use crate::math::sampling::{cosine_hemisphere, cosine_hemisphere_density};

/// Reflectance of dielectrics along the normal (refractive index 1.5; glTF 2.0, appendix B).
const DIELECTRIC_F0: f32 = 0.04;

/// Least share of samples for each of two lobes. Their strengths are known for uniform light alone, and without this
/// bound one lobe could get no samples.
const LEAST_SHARE: f32 = 0.1;

/// Largest share of samples for the glossy lobe when irradiance is estimated too ([`Layered::covering`]).
const COVERING_GLOSSY_SHARE: f32 = 0.5;

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

/// The share of the light at this cosine that a white base reflects, D(c) = (1 − 0.04)·(1 − W(c)), where W(c) is the
/// mean of Schlick's weight of v·h over cosine-weighted light. W is a polynomial fitted to quadrature, off by at most
/// 10⁻⁵.
#[inline]
fn white_base_albedo(cosine: f32) -> f32 {
    const W: [f32; 5] = [0.028165, -0.079860, 0.086481, -0.043696, 0.008994];
    let weight = W.iter().rev().fold(0.0, |sum, w| sum * cosine + w);
    (1.0 - DIELECTRIC_F0) * (1.0 - weight)
}

/// Reflectance along the normal and roughness of a surface, and whether it is unlit.
fn lobe_of(world: &World, point: &SurfacePoint) -> (Vec3, f32, bool) {
    let scene = world.scene;
    let hit = &point.hit;
    let color = scene.base_color(hit.triangle, hit.barycentric).truncate().clamp(Vec3::ZERO, Vec3::ONE);
    let (roughness, metallic) = scene.roughness_metallic(hit.triangle, hit.barycentric);
    let unlit = scene.material(hit.triangle).unlit;
    let f0 = if unlit { Vec3::ZERO } else { Vec3::splat(DIELECTRIC_F0).lerp(color, metallic) };
    // The bound on albedos holds for mirrors too: light between two facing mirrors would not converge either.
    (f0.min(Vec3::splat(world.albedo_max)), roughness, unlit)
}

/// Reflectance along the normal and perceptual roughness of a surface's glossy lobe; `None` where it reflects nothing.
pub fn gloss(world: &World, point: &SurfacePoint) -> Option<(Vec3, f32)> {
    let (f0, roughness, unlit) = lobe_of(world, point);
    (!unlit).then_some((f0, roughness))
}

#[derive(Debug, Clone, Copy)]
pub struct Layered {
    normal: Vec3,
    tangent: Vec3,
    bitangent: Vec3,
    /// View direction in the frame (tangent, bitangent, normal).
    view: Vec3,
    ggx: Ggx,
    f0: Vec3,
    lobe_albedo: LobeAlbedo,
    /// min(ρ, q(n·v)).
    base: Vec3,
    /// Probability of sampling the glossy lobe.
    glossy_share: f32,
    unlit: bool,
}

impl Layered {
    /// `normal` is the shading normal; `view` the unit direction towards the viewer.
    pub fn new(world: &World, point: &SurfacePoint, normal: Vec3, view: Vec3) -> Layered {
        let (f0, roughness, unlit) = lobe_of(world, point);
        Layered::of(point.albedo, f0, roughness, normal, view, unlit)
    }

    fn of(albedo: Vec3, f0: Vec3, roughness: f32, normal: Vec3, view: Vec3, unlit: bool) -> Layered {
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let view = Ggx::view(Vec3::new(view.dot(tangent), view.dot(bitangent), view.dot(normal)));
        let ggx = Ggx::new(roughness, f0);
        let lobe_albedo = LobeAlbedo::new(roughness);
        let reflected = lobe_albedo.at(f0, view.z);
        let base = albedo.min(largest_base(reflected, view.z));
        let (glossy, diffuse) = (luminance(reflected), luminance(base) * white_base_albedo(view.z));
        let glossy_share = match (unlit, diffuse > 0.0) {
            (true, _) => 0.0,
            (false, false) => 1.0,
            (false, true) => (glossy / (glossy + diffuse)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE),
        };
        Layered { normal, tangent, bitangent, view, ggx, f0, lobe_albedo, base, glossy_share, unlit }
    }

    /// The same BRDF with at least half of the samples cosine-distributed.
    #[inline]
    pub fn covering(self) -> Layered {
        Layered { glossy_share: self.glossy_share.min(COVERING_GLOSSY_SHARE), ..self }
    }

    /// The shading normal.
    #[inline]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Whether the surface reflects nothing.
    #[inline]
    pub fn is_black(&self) -> bool {
        self.unlit
    }

    #[inline]
    fn local(&self, direction: Vec3, cosine: f32) -> Vec3 {
        Vec3::new(direction.dot(self.tangent), direction.dot(self.bitangent), cosine)
    }

    /// BRDF × cosine for light from unit `direction`. `cosine` > 0 is the cosine between `direction` and the normal.
    #[inline]
    pub fn scattered(&self, direction: Vec3, cosine: f32) -> Scattered {
        if self.unlit {
            return Scattered::default();
        }
        let light = self.local(direction, cosine);
        let glossy = self.ggx.brdf(self.view, light) * cosine;
        if self.base == Vec3::ZERO {
            return Scattered { diffuse: Vec3::ZERO, glossy };
        }
        let base = self.base.min(largest_base(self.lobe_albedo.at(self.f0, cosine), cosine));
        // v·h, from v·l = 2·(v·h)² − 1.
        let facet_cosine = (0.5 + 0.5 * self.view.dot(light)).max(0.0).sqrt();
        let entering = (1.0 - DIELECTRIC_F0) * (1.0 - schlick_weight(facet_cosine));
        Scattered { diffuse: base * (entering * cosine / PI), glossy }
    }

    /// Density with which [`Self::sample`] draws `direction`, sr⁻¹. `cosine` > 0 is the cosine between `direction` and
    /// the normal.
    #[inline]
    pub fn density(&self, direction: Vec3, cosine: f32) -> f32 {
        let diffuse = cosine_hemisphere_density(cosine) * (1.0 - self.glossy_share);
        if self.glossy_share == 0.0 {
            return diffuse;
        }
        diffuse + self.ggx.density(self.view, self.local(direction, cosine)) * self.glossy_share
    }

    /// A random light direction, preferably one from which much light is reflected. It may lie below the surface.
    #[inline]
    pub fn sample(&self, numbers: &mut impl Numbers) -> Vec3 {
        let (u, choice) = (numbers.pair(), numbers.uniform());
        if choice >= self.glossy_share {
            return cosine_hemisphere(self.normal, u);
        }
        let local = self.ggx.sample(self.view, u);
        self.tangent * local.x + self.bitangent * local.y + self.normal * local.z
    }
}

/// q(c): the largest albedo of the base for a direction at this cosine, of whose light the lobe reflects `reflected`.
/// The error of the table is left free, so that the bound on the total holds.
#[inline]
fn largest_base(reflected: Vec3, cosine: f32) -> Vec3 {
    (Vec3::splat(1.0 - TABLE_ERROR) - reflected).max(Vec3::ZERO) / white_base_albedo(cosine)
}

#[cfg(test)]
mod tests;

//! glTF 2.0, appendix B, written out in f64, and its directional albedo by quadrature. Only tests use it. It shares no
//! code with what it checks.

use std::f64::consts::PI;

use glam::DVec3;

/// A grey material of the metallic-roughness model.
#[derive(Debug, Clone, Copy)]
pub struct AppendixB {
    pub base_color: f64,
    pub metallic: f64,
    pub roughness: f64,
}

/// Reflectance along the normal of `ior = 1.5`: ((1 − ior)/(1 + ior))².
const DIELECTRIC_F0: f64 = 0.04;

/// `specular_brdf(α)`: D·G/(4·|N·L|·|N·V|).
fn specular_brdf(alpha: f64, v: DVec3, l: DVec3) -> f64 {
    let h = (v + l).normalize();
    let a2 = alpha * alpha;
    let d = a2 / (PI * (h.z * h.z * (a2 - 1.0) + 1.0).powi(2));
    let g1 = |cosine: f64| 2.0 * cosine / (cosine + (a2 + (1.0 - a2) * cosine * cosine).sqrt());
    d * g1(v.z) * g1(l.z) / (4.0 * l.z * v.z)
}

/// f0 + (1 − f0)·(1 − |V·H|)⁵.
fn fresnel(f0: f64, v: DVec3, l: DVec3) -> f64 {
    f0 + (1.0 - f0) * (1.0 - v.dot((v + l).normalize())).powi(5)
}

impl AppendixB {
    pub fn alpha(&self) -> f64 {
        self.roughness * self.roughness
    }

    /// The part of `material` that contains `specular_brdf`, sr⁻¹.
    pub fn specular(&self, v: DVec3, l: DVec3) -> f64 {
        let dielectric = fresnel(DIELECTRIC_F0, v, l);
        let metal = fresnel(self.base_color, v, l);
        (dielectric + (metal - dielectric) * self.metallic) * specular_brdf(self.alpha(), v, l)
    }

    /// The part of `material` that contains `diffuse_brdf`, divided by the diffuse albedo
    /// `base_color · (1 − metallic)`, sr⁻¹.
    pub fn diffuse_of_white(v: DVec3, l: DVec3) -> f64 {
        (1.0 - fresnel(DIELECTRIC_F0, v, l)) / PI
    }

    /// `base_color · (1 − metallic)`.
    pub fn diffuse_albedo(&self) -> f64 {
        self.base_color * (1.0 - self.metallic)
    }

    /// `material`, sr⁻¹.
    pub fn brdf(&self, v: DVec3, l: DVec3) -> f64 {
        self.specular(v, l) + self.diffuse_albedo() * AppendixB::diffuse_of_white(v, l)
    }

    /// Directional albedo of [`Self::specular`] for a view at this cosine.
    pub fn specular_albedo(&self, cosine: f64) -> f64 {
        let v = view(cosine);
        over_half_vectors(self.alpha(), v, |l| self.specular(v, l) * l.z)
    }

    /// Directional albedo of [`Self::diffuse_of_white`] for a view at this cosine.
    pub fn diffuse_albedo_of_white(cosine: f64) -> f64 {
        let v = view(cosine);
        over_cosine(|l| AppendixB::diffuse_of_white(v, l))
    }

    /// Directional albedo of `material` for a view at this cosine.
    pub fn albedo(&self, cosine: f64) -> f64 {
        self.specular_albedo(cosine) + self.diffuse_albedo() * AppendixB::diffuse_albedo_of_white(cosine)
    }
}

/// A view direction at this cosine to the normal.
pub fn view(cosine: f64) -> DVec3 {
    DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine)
}

/// Number of intervals of each axis. With twice as many the albedos of the tests change by less than 2e-5.
const INTERVALS: usize = 300;

/// ∫ f(l) dl over the upper hemisphere, for an integrand that contains D. The grid lies in half vectors h, where
/// dl = 4·(v·h)·dh. Its axes are the azimuth and x with tan²θ = α²·(1 − t)/t and t = x³, and D·cos θ dh = dt dφ/2π. The
/// cube makes the intervals narrow at θ = 90°, where grazing views see most. The plane of v and n halves the domain.
fn over_half_vectors(alpha: f64, v: DVec3, f: impl Fn(DVec3) -> f64) -> f64 {
    let n = INTERVALS;
    let a2 = alpha * alpha;
    let mut sum = 0.0;
    for i in 0..n {
        let x = (i as f64 + 0.5) / n as f64;
        let t = x.powi(3);
        let tangent2 = a2 * (1.0 - t) / t;
        let cos = 1.0 / (1.0 + tangent2).sqrt();
        let sin = cos * tangent2.sqrt();
        let d = a2 / (PI * (cos * cos * (a2 - 1.0) + 1.0).powi(2));
        for j in 0..n {
            let phi = PI * (j as f64 + 0.5) / n as f64;
            let h = DVec3::new(sin * phi.cos(), sin * phi.sin(), cos);
            let l = h * (2.0 * v.dot(h)) - v;
            if v.dot(h) > 0.0 && l.z > 0.0 {
                sum += f(l) * 4.0 * v.dot(h) / (d * cos) * 3.0 * x * x;
            }
        }
    }
    sum / (n * n) as f64
}

/// ∫ f(l)·(n·l) dl over the upper hemisphere, on a grid in azimuth and squared cosine.
pub fn over_cosine(f: impl Fn(DVec3) -> f64) -> f64 {
    let n = INTERVALS;
    let mut sum = 0.0;
    for i in 0..n {
        let z = ((i as f64 + 0.5) / n as f64).sqrt();
        let r = (1.0 - z * z).sqrt();
        for j in 0..n {
            let phi = PI * (j as f64 + 0.5) / n as f64;
            sum += f(DVec3::new(r * phi.cos(), r * phi.sin(), z));
        }
    }
    sum * PI / (n * n) as f64
}

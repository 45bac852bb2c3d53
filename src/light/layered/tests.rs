use glam::DVec3;

use super::*;
use crate::light::appendix_b::{AppendixB, over_cosine, view};
use crate::math::blocks::{BLOCK, Block};
use crate::math::random::Purpose;
use crate::math::statistics::Moments;

const ROUGHNESSES: [f32; 5] = [0.1, 0.3, 0.5, 0.7, 1.0];
const COSINES: [f32; 8] = [0.02, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9, 1.0];

/// A grey material as `Layered::new` builds it, seen at this cosine.
fn layered(base_color: f32, metallic: f32, roughness: f32, cosine: f32) -> Layered {
    seen_from(base_color, metallic, roughness, view(f64::from(cosine)).as_vec3())
}

fn seen_from(base_color: f32, metallic: f32, roughness: f32, view: Vec3) -> Layered {
    let f0 = DIELECTRIC_F0 + (base_color - DIELECTRIC_F0) * metallic;
    Layered::of(Vec3::splat(base_color * (1.0 - metallic)), Vec3::splat(f0), roughness, Vec3::Z, view, false)
}

fn appendix(base_color: f32, metallic: f32, roughness: f32) -> AppendixB {
    let [base_color, metallic, roughness] = [base_color, metallic, roughness].map(f64::from);
    AppendixB { base_color, metallic, roughness }
}

/// Share of uniform incident light that is reflected, and the mean weight of irradiance samples, which should be π;
/// each with its standard error.
fn sampled(bsdf: &Layered, blocks: u64) -> [(f64, f64); 2] {
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

/// q(c) of the module's documentation for this material, by quadrature at nodes that are linear in √c.
struct LargestBase(Vec<f64>);

impl LargestBase {
    const NODES: usize = 64;

    fn of(material: &AppendixB) -> LargestBase {
        let at = |i: usize| {
            let cosine = (i as f64 / Self::NODES as f64).powi(2).max(1e-3);
            (1.0 - material.specular_albedo(cosine)) / AppendixB::diffuse_albedo_of_white(cosine)
        };
        LargestBase((0..=Self::NODES).map(at).collect())
    }

    fn at(&self, cosine: f64) -> f64 {
        let x = cosine.sqrt() * Self::NODES as f64;
        let i = (x as usize).min(Self::NODES - 1);
        self.0[i] + (self.0[i + 1] - self.0[i]) * (x - i as f64)
    }
}

/// Directional albedo of the appendix's material with its base bounded, by quadrature.
fn bounded_albedo(material: &AppendixB, largest: &LargestBase, cosine: f64) -> f64 {
    let v = view(cosine);
    let most = material.diffuse_albedo().min(largest.at(cosine));
    let base = over_cosine(|l| AppendixB::diffuse_of_white(v, l) * most.min(largest.at(l.z)));
    material.specular_albedo(cosine) + base
}

/// The table of the module's claim: per material and roughness what is reflected at each cosine, by the appendix, by
/// its bounded form, and by sampling the code.
#[test]
fn directional_albedos_follow_appendix_b() {
    println!("roughness n·v | appendix B, bounded, sampled ± standard error");
    for (base_color, metallic) in [(1.0, 1.0), (0.5, 1.0), (1.0, 0.0), (0.8, 0.0), (0.5, 0.0), (0.8, 0.5)] {
        println!("baseColor {base_color}, metallic {metallic}");
        for roughness in ROUGHNESSES {
            let material = appendix(base_color, metallic, roughness);
            let largest = (metallic < 1.0).then(|| LargestBase::of(&material));
            for cosine in COSINES {
                let literal = material.albedo(f64::from(cosine));
                let exact = largest.as_ref().map_or(literal, |l| bounded_albedo(&material, l, f64::from(cosine)));
                let [(found, error), _] = sampled(&layered(base_color, metallic, roughness, cosine), 4000);
                let case = format!("{roughness:.1} {cosine:.2} | {literal:.4} {exact:.4} {found:.4} ± {error:.4}");
                println!("{case}");
                // Five standard errors, because 240 cases are tested, and 1e-4 for the quadrature. Where the base is
                // bounded, the code leaves TABLE_ERROR free and the table may be off by as much again.
                let bounded = if metallic < 1.0 { 2.0 * f64::from(TABLE_ERROR) } else { 0.0 };
                assert!((found - exact).abs() < 5.0 * error + bounded + 1e-4 && error < 1.5e-3, "{case}");
                assert!(found <= 1.0 + 4.0 * error && exact <= literal + 1e-4, "{case}");
            }
        }
    }
}

#[test]
fn pairs_of_directions_at_which_the_appendix_keeps_energy_are_its_own() {
    let at = |cosine: f64, azimuth: f64| {
        let r = (1.0 - cosine * cosine).sqrt();
        DVec3::new(r * azimuth.cos(), r * azimuth.sin(), cosine)
    };
    let mut same = 0;
    for (base_color, metallic, roughness) in [(1.0, 0.0, 1.0), (0.8, 0.0, 0.4), (0.5, 0.0, 0.1), (0.7, 0.5, 0.5)] {
        let material = appendix(base_color, metallic, roughness);
        let cosines: Vec<(f64, bool)> = (1..=20)
            .map(|i| f64::from(i) / 20.0)
            .map(|c| (c, material.albedo(c) < 1.0 - 2.0 * f64::from(TABLE_ERROR)))
            .collect();
        for &(cosine_v, keeps_v) in &cosines {
            for &(cosine_l, keeps_l) in &cosines {
                let (v, l) = (at(cosine_v, 0.3), at(cosine_l, 2.0));
                let right = material.brdf(v, l);
                let light = l.as_vec3();
                let bsdf = seen_from(base_color, metallic, roughness, v.as_vec3());
                let found = f64::from(bsdf.scattered(light, light.z).total().x / light.z);
                let case = format!("{base_color} {metallic} {roughness}, {v}, {l}: {found} {right}");
                // f32's rounding of half vectors, 1e-7, over α = 0.01, squared in D.
                assert!(found < right * (1.0 + 1e-4), "{case}");
                if keeps_v && keeps_l {
                    assert!(found > right * (1.0 - 1e-4), "{case}");
                    same += 1;
                }
            }
        }
    }
    assert!(same > 800, "{same} of 1600 pairs");
}

#[test]
fn surfaces_reflect_no_more_than_arrives() {
    // A white material reflects more than any other.
    for metallic in [0.0f32, 0.3, 0.7, 1.0] {
        for roughness in [0.0f32, 0.1, 0.2, 0.3, 0.5, 0.7, 0.85, 1.0] {
            for cosine in [0.001, 0.002, 0.005, 0.02, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0] {
                let [(albedo, error), _] = sampled(&layered(1.0, metallic, roughness, cosine), 2000);
                // The bound is 1, plus four standard errors (probability 3e-5) because 320 cases are tested, plus f32's
                // rounding.
                let what = format!("metallic {metallic}, roughness {roughness}, cosine {cosine}");
                assert!(albedo <= 1.0 + 4.0 * error + 1e-6, "{what}: {albedo} ± {error}");
                assert!(error < 5e-3, "{what}: too uncertain to tell, ± {error}");
            }
        }
    }
}

#[test]
fn covering_samples_know_the_irradiance() {
    for (base_color, metallic, roughness, cosine) in
        [(0.8, 0.0, 0.0, 0.5), (0.9, 1.0, 0.2, 0.3), (0.5, 0.0, 1.0, 0.9), (1.0, 0.0, 0.3, 0.02)]
    {
        let [_, (irradiance, error)] = sampled(&layered(base_color, metallic, roughness, cosine).covering(), 4000);
        // Four standard errors: 6e-5 of a normal distribution lies outside.
        assert!((irradiance - f64::from(PI)).abs() < 4.0 * error + 1e-5, "{irradiance} ± {error}");
    }
}

#[test]
fn light_and_viewer_may_change_places() {
    let at = |x: f32, y: f32| Vec3::new(x, y, (1.0 - x * x - y * y).sqrt());
    let directions = [at(0.3, 0.5), at(-0.7, 0.1), at(0.9, 0.2), at(0.1, 0.0), at(0.0, -0.999), at(0.6, -0.79)];
    for (base_color, metallic) in [(0.6, 0.0), (1.0, 0.0), (0.8, 0.5), (1.0, 1.0)] {
        for roughness in [0.05, 0.2, 0.4, 1.0] {
            for a in directions {
                for b in directions {
                    let brdf = |v: Vec3, l: Vec3| {
                        let scattered = seen_from(base_color, metallic, roughness, v).scattered(l, l.z);
                        scattered.total().x / l.z
                    };
                    let (there, back) = (brdf(a, b), brdf(b, a));
                    // f32's rounding of half vectors, 1e-7, over α = 0.0025, squared in D.
                    assert!((there / back - 1.0).abs() < 2e-4, "{a} {b}: {there} {back}");
                }
            }
        }
    }
}

#[test]
fn the_base_of_a_dielectric_reflects_its_polynomial() {
    for i in 0..=20 {
        let cosine = (f64::from(i) / 20.0).max(1e-3);
        let (found, exact) = (white_base_albedo(cosine as f32), AppendixB::diffuse_albedo_of_white(cosine));
        // The fit and its rounding.
        assert!((f64::from(found) - exact).abs() < 2e-5, "{cosine}: {found} {exact}");
    }
}

//! Sampling of emissive triangles and of the sky.
//!
//! Triangles are chosen by power through an alias table, points on them uniformly by area; the sky by solid angle
//! where it is constant, by texel power where it is a map. Both sides of a density — drawing a sample, and asking how
//! dense samples are along a given ray — stand here together, for multiple importance sampling needs both.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::math::alias::AliasTable;
use crate::math::color::luminance;
use crate::math::random::unit_from_bits;
use crate::math::sampling::{UNIFORM_SPHERE_DENSITY, cosine_hemisphere_density, triangle_barycentric, uniform_sphere};
use crate::scene::environment::EnvironmentMap;
use crate::scene::{Environment, Scene, TriangleIndex};
use crate::trace::Hit;
use crate::trace::offset::{end_offset, ray_offset};

/// Points per side of the grid on which a textured triangle's mean emission is estimated.
const POWER_GRID: usize = 4;

/// Share of the material's full factor that is added to a triangle's estimated emission, so that a bright spot of the
/// texture which the grid missed is still sampled now and then (the estimate steers noise, never the mean).
const POWER_FLOOR: f32 = 0.01;

/// Share of light samples that go to the sky when there are emissive triangles too ([`Emitters::draw`] spends a bit).
const SKY_SHARE: f32 = 0.5;

/// A direction from which light may arrive.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// Unit.
    pub direction: Vec3,
    /// End of the shadow segment, `None` for the sky.
    pub target: Option<Vec3>,
    /// Emitted radiance towards the point, times the emitter's own opacity, W·m⁻²·sr⁻¹.
    pub radiance: Vec3,
    /// Of drawing this direction, sr⁻¹.
    pub density: f32,
}

/// All that emits, ready for sampling.
pub struct Emitters {
    triangles: Vec<EmissiveTriangle>,
    /// Entry of `triangles` plus one of every scene triangle that emits, 0 for the others; empty if none emits.
    entry_of_triangle: Vec<u32>,
    alias: Option<AliasTable>,
    sky: Option<Sky>,
    /// Box around all emissive triangles; empty (lower above upper) without any.
    bounds: (Vec3, Vec3),
}

/// What sampling needs of a triangle, together in memory.
struct EmissiveTriangle {
    corner: Vec3,
    edges: [Vec3; 2],
    normal: Vec3,
    ray_offset: f32,
    /// Probability of the triangle ÷ its area, m⁻².
    density_per_area: f32,
    double_sided: bool,
    /// Emitted radiance times opacity where no texture changes it, W·m⁻²·sr⁻¹.
    constant_radiance: Option<Vec3>,
    index: TriangleIndex,
}

impl EmissiveTriangle {
    fn new(scene: &Scene, index: TriangleIndex, probability: f64) -> EmissiveTriangle {
        let corners = scene.mesh.corners(index);
        let material = scene.material(index);
        let textured = material.emission_texture.is_some()
            || material.base_color_texture.is_some()
            || !scene.mesh.colors.is_empty();
        let constant_radiance =
            (!textured).then(|| scene.emission(index, Vec2::ZERO) * scene.opacity(index, Vec2::ZERO));
        EmissiveTriangle {
            corner: corners[0],
            edges: [corners[1] - corners[0], corners[2] - corners[0]],
            normal: scene.mesh.geometric_normal(index),
            ray_offset: ray_offset(&corners),
            density_per_area: (probability / f64::from(scene.mesh.area(index))) as f32,
            double_sided: material.double_sided,
            constant_radiance,
            index,
        }
    }

    fn point(&self, barycentric: Vec2) -> Vec3 {
        self.corner + self.edges[0] * barycentric.x + self.edges[1] * barycentric.y
    }

    /// Emitted radiance times opacity.
    #[inline]
    fn radiance(&self, scene: &Scene, barycentric: Vec2) -> Vec3 {
        self.constant_radiance
            .unwrap_or_else(|| scene.emission(self.index, barycentric) * scene.opacity(self.index, barycentric))
    }

    /// Where a shadow segment from `origin` to a point of the triangle ends: short of it, on the side that faces the
    /// receiver, which the sign of `cosine` names.
    #[inline]
    fn shadow_target(&self, origin: Vec3, point: Vec3, cosine: f32) -> Vec3 {
        point + self.normal * self.ray_offset.max(end_offset(origin)).copysign(cosine)
    }
}

/// An emitter chosen and a place on it.
enum Drawn<'e> {
    Sky { direction: Vec3, density: f32 },
    Triangle { triangle: &'e EmissiveTriangle, barycentric: Vec2 },
}

/// Where irradiance is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    pub position: Vec3,
    /// Unit; that of shading.
    pub normal: Vec3,
    /// Unit; nothing arrives from below.
    pub geometric_normal: Vec3,
}

/// Irradiance that arrives unless something is in between.
#[derive(Debug, Clone, Copy)]
pub struct IrradianceSample {
    /// End of the shadow segment, or unit direction of the sky.
    pub target: Result<Vec3, Vec3>,
    /// W·m⁻².
    pub irradiance: Vec3,
}

enum Sky {
    Uniform,
    /// Density of each texel, sr⁻¹.
    Map {
        alias: AliasTable,
        density: Vec<f32>,
    },
}

impl Emitters {
    pub fn new(scene: &Scene) -> Emitters {
        let candidates = (0..scene.mesh.triangles.len() as u32).map(TriangleIndex);
        let powers: Vec<(TriangleIndex, f64)> = candidates
            .map(|t| (t, f64::from(estimated_power(scene, t))))
            .filter(|(_, power)| *power > 0.0 && power.is_finite())
            .collect();
        let total: f64 = powers.iter().map(|p| p.1).sum();
        let triangles: Vec<EmissiveTriangle> =
            powers.iter().map(|&(t, power)| EmissiveTriangle::new(scene, t, power / total)).collect();
        let mut entry_of_triangle = Vec::new();
        if !triangles.is_empty() {
            entry_of_triangle = vec![0; scene.mesh.triangles.len()];
            for (entry, t) in triangles.iter().enumerate() {
                entry_of_triangle[t.index.0 as usize] = entry as u32 + 1;
            }
        }
        let corners = || triangles.iter().flat_map(|t| [t.corner, t.corner + t.edges[0], t.corner + t.edges[1]]);
        let bounds = (corners().fold(Vec3::INFINITY, Vec3::min), corners().fold(Vec3::NEG_INFINITY, Vec3::max));
        let weights: Vec<f64> = powers.into_iter().map(|p| p.1).collect();
        // `None` only without positive weights: then there is nothing to sample.
        let alias = AliasTable::new(&weights);
        Emitters { triangles, entry_of_triangle, alias, sky: Sky::new(&scene.environment), bounds }
    }

    pub fn is_empty(&self) -> bool {
        self.alias.is_none() && self.sky.is_none()
    }

    /// Number of emissive triangles.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    pub fn has_sky(&self) -> bool {
        self.sky.is_some()
    }

    /// Whether every emitter lies behind the plane through `point` with this normal, so that sampling is in vain.
    pub fn all_behind(&self, point: Vec3, normal: Vec3) -> bool {
        let (low, high) = self.bounds;
        let foremost = Vec3::select(normal.cmpge(Vec3::ZERO), high, low);
        // Not a number where there are no triangles: nothing is in front then.
        let any_in_front = (foremost - point).dot(normal) > 0.0;
        self.sky.is_none() && !any_in_front
    }

    /// Whether the only emitter is a sky of one radiance: then cosine-distributed rays are the best samples there are.
    pub fn is_uniform_sky(&self) -> bool {
        self.alias.is_none() && matches!(self.sky, Some(Sky::Uniform))
    }

    fn sky_share(&self) -> f32 {
        match (&self.alias, &self.sky) {
            (_, None) => 0.0,
            (None, Some(_)) => 1.0,
            (Some(_), Some(_)) => SKY_SHARE,
        }
    }

    /// The emitter that uniform random bits choose, and a place on it.
    #[inline]
    fn draw(&self, scene: &Scene, bits: [u32; 4]) -> Option<Drawn<'_>> {
        let [mut choice, word, u, v] = bits;
        let place = Vec2::new(unit_from_bits(u), unit_from_bits(v));
        match (&self.alias, &self.sky) {
            (None, None) => return None,
            (Some(_), None) => {}
            (alias, Some(sky)) => {
                // With triangles beside it the top bit decides, and the other bits serve on.
                if alias.is_none() || choice >> 31 == 0 {
                    choice <<= u32::from(alias.is_some());
                    let (direction, density) = sky.sample(&scene.environment, [choice, word], place);
                    return Some(Drawn::Sky { direction, density: density * self.sky_share() });
                }
                choice <<= 1;
            }
        }
        let triangle = &self.triangles[self.alias.as_ref()?.draw([choice, word])];
        Some(Drawn::Triangle { triangle, barycentric: triangle_barycentric(place) })
    }

    /// A direction from `point` towards an emitter, drawn by uniform random bits; `None` where the emitter cannot light
    /// the point.
    pub fn sample(&self, scene: &Scene, point: Vec3, bits: [u32; 4]) -> Option<LightSample> {
        let (triangle, barycentric) = match self.draw(scene, bits)? {
            Drawn::Sky { direction, density } => {
                let radiance = scene.environment.radiance(direction);
                return Some(LightSample { direction, target: None, radiance, density });
            }
            Drawn::Triangle { triangle, barycentric } => (triangle, barycentric),
        };
        let on_triangle = triangle.point(barycentric);
        let to_target = on_triangle - point;
        let distance_squared = to_target.length_squared();
        let direction = to_target * distance_squared.sqrt().recip();
        let cosine = -triangle.normal.dot(direction);
        if cosine <= 0.0 && !triangle.double_sided {
            return None;
        }
        // Not finite where the point lies on the emitter or in its plane.
        let density = triangle.density_per_area * (1.0 - self.sky_share()) * distance_squared / cosine.abs();
        if !density.is_finite() {
            return None;
        }
        let target = triangle.shadow_target(point, on_triangle, cosine);
        Some(LightSample { direction, target: Some(target), radiance: triangle.radiance(scene, barycentric), density })
    }

    /// As [`Self::sample`], for a Lambertian receiver of irradiance and the balance heuristic against
    /// `n_cosine` cosine-distributed rays beside `n_light` light samples: what this sample adds to the irradiance if it
    /// is not shadowed, W·m⁻².
    ///
    /// With c = n·(y − x) and c' = n_y·(x − y), d the distance: the cosines are c/d and c'/d, the densities of the two
    /// techniques c/(πd) and p_A·d³/c', so that L·(c/d) ÷ (n_c·c/(πd) + n_l·p_A·d³/c') = L·c·c' ÷ (n_c·c·c'/π +
    /// n_l·p_A·d⁴): one division and no root.
    #[inline]
    pub fn irradiance_sample(
        &self,
        scene: &Scene,
        receiver: &Receiver,
        [n_cosine, n_light]: [f32; 2],
        bits: [u32; 4],
    ) -> Option<IrradianceSample> {
        match self.draw(scene, bits)? {
            Drawn::Sky { direction, density } => {
                let cosine = receiver.normal.dot(direction);
                if cosine <= 0.0 || receiver.geometric_normal.dot(direction) <= 0.0 {
                    return None;
                }
                let radiance = scene.environment.radiance(direction);
                let density = n_cosine * cosine_hemisphere_density(cosine) + n_light * density;
                (radiance != Vec3::ZERO)
                    .then(|| IrradianceSample { target: Err(direction), irradiance: radiance * (cosine / density) })
            }
            Drawn::Triangle { triangle, barycentric } => {
                let on_triangle = triangle.point(barycentric);
                let to_target = on_triangle - receiver.position;
                let c = receiver.normal.dot(to_target);
                let c_geometric = receiver.geometric_normal.dot(to_target);
                let towards = -triangle.normal.dot(to_target);
                let c_emitter = if triangle.double_sided { towards.abs() } else { towards };
                // All three at once: which of them fails cannot be predicted.
                if c.min(c_geometric).min(c_emitter) <= 0.0 {
                    return None;
                }
                let d2 = to_target.length_squared();
                let per_area = triangle.density_per_area * (1.0 - self.sky_share());
                let product = c * c_emitter;
                let share = product / (n_cosine * (1.0 / PI) * product + n_light * (per_area * d2) * d2);
                let radiance = triangle.radiance(scene, barycentric);
                // Not finite where the receiver lies on the emitter.
                (share.is_finite() && radiance != Vec3::ZERO).then(|| IrradianceSample {
                    target: Ok(triangle.shadow_target(receiver.position, on_triangle, towards)),
                    irradiance: radiance * share,
                })
            }
        }
    }

    /// Density with which [`Self::sample`] would have drawn this hit along unit `direction` from `point`, sr⁻¹.
    pub fn density_of_hit(&self, point: Vec3, direction: Vec3, hit: &Hit) -> f32 {
        let Some(&entry @ 1..) = self.entry_of_triangle.get(hit.triangle.0 as usize) else { return 0.0 };
        let triangle = &self.triangles[entry as usize - 1];
        let cosine = triangle.normal.dot(direction).abs();
        let distance_squared = triangle.point(hit.barycentric).distance_squared(point);
        triangle.density_per_area * (1.0 - self.sky_share()) * distance_squared / cosine
    }

    /// Density with which [`Self::sample`] would have drawn the sky along unit `direction`, sr⁻¹.
    pub fn density_of_sky(&self, scene: &Scene, direction: Vec3) -> f32 {
        self.sky.as_ref().map_or(0.0, |sky| sky.density(&scene.environment, direction)) * self.sky_share()
    }
}

impl Sky {
    fn new(environment: &Environment) -> Option<Sky> {
        match environment {
            _ if environment.is_black() => None,
            Environment::None => None,
            Environment::Constant(_) => Some(Sky::Uniform),
            Environment::Map(map) => {
                let weights: Vec<f64> = (0..map.texels.len())
                    .map(|i| f64::from(luminance(map.texels[i]) * texel_solid_angle(map, i / map.width)))
                    .collect();
                let total: f64 = weights.iter().sum();
                let density = (0..map.texels.len())
                    .map(|i| (weights[i] / total) as f32 / texel_solid_angle(map, i / map.width))
                    .collect();
                Some(Sky::Map { alias: AliasTable::new(&weights)?, density })
            }
        }
    }

    /// Direction and density by uniform random bits and a uniform place in the unit square.
    fn sample(&self, environment: &Environment, bits: [u32; 2], place: Vec2) -> (Vec3, f32) {
        match (self, environment) {
            (Sky::Map { alias, density }, Environment::Map(map)) => {
                let texel = alias.draw(bits);
                let (x, y) = ((texel % map.width) as f32, (texel / map.width) as f32);
                // Uniform in solid angle within the texel: uniform in the cosine of the polar angle.
                let cos_of = |row: f32| (row / map.height as f32 * PI).cos();
                let cosine = cos_of(y) + (cos_of(y + 1.0) - cos_of(y)) * place.y;
                let u = (x + place.x) / map.width as f32;
                (EnvironmentMap::direction(Vec2::new(u, cosine.clamp(-1.0, 1.0).acos() / PI)), density[texel])
            }
            _ => (uniform_sphere(place), UNIFORM_SPHERE_DENSITY),
        }
    }

    fn density(&self, environment: &Environment, direction: Vec3) -> f32 {
        match (self, environment) {
            (Sky::Map { density, .. }, Environment::Map(map)) => density[map.texel_index(direction)],
            _ => UNIFORM_SPHERE_DENSITY,
        }
    }
}

/// Solid angle of a texel in this row of the map, sr.
fn texel_solid_angle(map: &EnvironmentMap, row: usize) -> f32 {
    let edge = |row: usize| (row as f64 / map.height as f64 * std::f64::consts::PI).cos();
    ((edge(row) - edge(row + 1)) * 2.0 * std::f64::consts::PI / map.width as f64) as f32
}

/// Luminous power of a triangle up to a common factor: area × mean emission × sides.
fn estimated_power(scene: &Scene, triangle: TriangleIndex) -> f32 {
    let material = scene.material(triangle);
    let full = if material.unlit { material.base_color.truncate() } else { material.emission };
    if full == Vec3::ZERO {
        return 0.0;
    }
    let textured = if material.unlit { material.base_color_texture } else { material.emission_texture }.is_some();
    let n = if textured { POWER_GRID } else { 1 };
    let mut mean = 0.0;
    for i in 0..n * n {
        let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
        mean += luminance(scene.emission(triangle, triangle_barycentric(u))) / (n * n) as f32;
    }
    let sides = if material.double_sided { 2.0 } else { 1.0 };
    scene.mesh.area(triangle) * (mean + POWER_FLOOR * luminance(full)) * sides
}

#[cfg(test)]
mod tests;

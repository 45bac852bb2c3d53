//! Sampling of emissive triangles and of the sky.
//!
//! An alias table chooses triangles in proportion to their power. Points on a triangle are uniform by area. Directions
//! of a constant sky are uniform by solid angle. Texels of a sky map are chosen in proportion to their power.
//!
//! Multiple importance sampling needs two functions: one draws a sample, the other gives the density of samples along a
//! given ray. Both stand here together.

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

/// The mean emission of a textured triangle is estimated on a grid of this many points per side.
const POWER_GRID: usize = 4;

/// Share of the material's full emission factor that is added to a triangle's estimated emission. The grid can miss a
/// bright spot of the texture; with this addition such a triangle is still sampled. The estimate affects noise only,
/// not the mean.
const POWER_FLOOR: f32 = 0.01;

/// Share of samples for the sky if there are emissive triangles too. [`Emitters::draw`] decides with one random bit, so
/// this must be ½.
const SKY_SHARE: f32 = 0.5;

/// A sampled direction towards an emitter.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// Unit.
    pub direction: Vec3,
    /// End of the shadow segment. `None` for the sky.
    pub target: Option<Vec3>,
    /// Radiance emitted towards the point × the emitter's opacity, W·m⁻²·sr⁻¹.
    pub radiance: Vec3,
    /// Density with which this direction is drawn, sr⁻¹.
    pub density: f32,
}

/// The emissive triangles and the sky, prepared for sampling.
pub struct Emitters {
    triangles: Vec<EmissiveTriangle>,
    /// Per triangle of the scene: 1 + its index in `triangles`, or 0 if it does not emit. Empty if no triangle emits.
    entry_of_triangle: Vec<u32>,
    /// Draws an index of `triangles`. `None` if no triangle emits.
    alias: Option<AliasTable>,
    sky: Option<Sky>,
    /// Box around all emissive triangles. Its lower corner lies above its upper corner if no triangle emits.
    bounds: (Vec3, Vec3),
}

/// The data that sampling needs of a triangle, contiguous in memory.
struct EmissiveTriangle {
    corner: Vec3,
    edges: [Vec3; 2],
    normal: Vec3,
    ray_offset: f32,
    /// Probability of the triangle ÷ its area, m⁻².
    density_per_area: f32,
    double_sided: bool,
    /// Emitted radiance × opacity, W·m⁻²·sr⁻¹. `None` if a texture or vertex colours change it.
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

    /// Emitted radiance × opacity, W·m⁻²·sr⁻¹.
    #[inline]
    fn radiance(&self, scene: &Scene, barycentric: Vec2) -> Vec3 {
        self.constant_radiance
            .unwrap_or_else(|| scene.emission(self.index, barycentric) * scene.opacity(self.index, barycentric))
    }

    /// End of the shadow segment from `origin` to a point of the triangle. It lies just off the triangle on the
    /// receiver's side, which the sign of `cosine` gives.
    #[inline]
    fn shadow_target(&self, origin: Vec3, point: Vec3, cosine: f32) -> Vec3 {
        point + self.normal * self.ray_offset.max(end_offset(origin)).copysign(cosine)
    }
}

/// A drawn emitter with a direction or a point on it.
enum Drawn<'e> {
    Sky { direction: Vec3, density: f32 },
    Triangle { triangle: &'e EmissiveTriangle, barycentric: Vec2 },
}

/// The point at which irradiance is estimated.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    pub position: Vec3,
    /// Unit shading normal.
    pub normal: Vec3,
    /// Unit geometric normal. No light arrives from the side behind it.
    pub geometric_normal: Vec3,
}

/// The irradiance of a sample if nothing occludes it.
#[derive(Debug, Clone, Copy)]
pub struct IrradianceSample {
    /// `Ok` with the end of the shadow segment, or `Err` with the unit direction of a sky sample.
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
        // `None` only if no weight is positive. There is nothing to sample then.
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

    /// Whether every emitter lies behind the plane through `point` with this normal. No sample can then bring light.
    pub fn all_behind(&self, point: Vec3, normal: Vec3) -> bool {
        let (low, high) = self.bounds;
        let foremost = Vec3::select(normal.cmpge(Vec3::ZERO), high, low);
        // Without triangles the left side is NaN, so the comparison is false.
        let any_in_front = (foremost - point).dot(normal) > 0.0;
        self.sky.is_none() && !any_in_front
    }

    /// Whether the only emitter is a sky of constant radiance. Cosine-distributed rays are then the best samples.
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

    /// Turns uniform random bits into an emitter with a direction or a point on it.
    #[inline]
    fn draw(&self, scene: &Scene, bits: [u32; 4]) -> Option<Drawn<'_>> {
        let [mut choice, word, u, v] = bits;
        let place = Vec2::new(unit_from_bits(u), unit_from_bits(v));
        match (&self.alias, &self.sky) {
            (None, None) => return None,
            (Some(_), None) => {}
            (alias, Some(sky)) => {
                // If there are triangles too, the top bit chooses between sky and triangles. The other bits are used
                // below.
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

    /// Turns uniform random bits into a direction from `point` towards an emitter. `None` if the emitter cannot light
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
        // The density is not finite if the point lies on the emitter or in its plane.
        let density = triangle.density_per_area * (1.0 - self.sky_share()) * distance_squared / cosine.abs();
        if !density.is_finite() {
            return None;
        }
        let target = triangle.shadow_target(point, on_triangle, cosine);
        Some(LightSample { direction, target: Some(target), radiance: triangle.radiance(scene, barycentric), density })
    }

    /// Like [`Self::sample`], but returns what the sample adds to the irradiance, W·m⁻², if nothing occludes it. The
    /// weight is that of the balance heuristic for `n_light` such samples and `n_cosine` cosine-distributed rays.
    ///
    /// The formula needs one division and no root. Let x be the receiver, y the point on the emitter, d their distance,
    /// c = n·(y − x) and c' = n_y·(x − y). The cosines are c/d and c'/d. The densities of the two techniques are c/(πd)
    /// and p_A·d³/c', with the density by area p_A. So the result is L·(c/d) ÷ (n_c·c/(πd) + n_l·p_A·d³/c') = L·c·c' ÷
    /// (n_c·c·c'/π + n_l·p_A·d⁴).
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
                // One test for all three, because the processor cannot predict which of them fails.
                if c.min(c_geometric).min(c_emitter) <= 0.0 {
                    return None;
                }
                let d2 = to_target.length_squared();
                let per_area = triangle.density_per_area * (1.0 - self.sky_share());
                let product = c * c_emitter;
                let share = product / (n_cosine * (1.0 / PI) * product + n_light * (per_area * d2) * d2);
                let radiance = triangle.radiance(scene, barycentric);
                // The share is not finite if the receiver lies on the emitter.
                (share.is_finite() && radiance != Vec3::ZERO).then(|| IrradianceSample {
                    target: Ok(triangle.shadow_target(receiver.position, on_triangle, towards)),
                    irradiance: radiance * share,
                })
            }
        }
    }

    /// Density, sr⁻¹, with which [`Self::sample`] draws the unit `direction` from `point` to this hit.
    pub fn density_of_hit(&self, point: Vec3, direction: Vec3, hit: &Hit) -> f32 {
        let Some(&entry @ 1..) = self.entry_of_triangle.get(hit.triangle.0 as usize) else { return 0.0 };
        let triangle = &self.triangles[entry as usize - 1];
        let cosine = triangle.normal.dot(direction).abs();
        let distance_squared = triangle.point(hit.barycentric).distance_squared(point);
        triangle.density_per_area * (1.0 - self.sky_share()) * distance_squared / cosine
    }

    /// Density, sr⁻¹, with which [`Self::sample`] draws the sky in the unit `direction`.
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

    /// Turns uniform random bits and a uniform point of the unit square into a direction, and gives its density.
    fn sample(&self, environment: &Environment, bits: [u32; 2], place: Vec2) -> (Vec3, f32) {
        match (self, environment) {
            (Sky::Map { alias, density }, Environment::Map(map)) => {
                let texel = alias.draw(bits);
                let (x, y) = ((texel % map.width) as f32, (texel / map.width) as f32);
                // Uniform by solid angle within the texel, which means uniform in the cosine of the polar angle.
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

/// Luminous power of a triangle up to a factor common to all: area × mean emission × number of emitting sides.
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

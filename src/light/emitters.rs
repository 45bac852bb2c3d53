//! Sampling of emissive triangles and of the sky.
//!
//! Triangles are chosen by power through an alias table, points on them uniformly by area; the sky by solid angle
//! where it is constant, by texel power where it is a map. Both sides of a density — drawing a sample, and asking how
//! dense samples are along a given ray — stand here together, for multiple importance sampling needs both.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use crate::math::alias::AliasTable;
use crate::math::color::luminance;
use crate::math::random::Numbers;
use crate::math::sampling::{UNIFORM_SPHERE_DENSITY, triangle_barycentric, uniform_sphere};
use crate::scene::environment::EnvironmentMap;
use crate::scene::{Environment, Scene, TriangleIndex};
use crate::trace::Hit;
use crate::trace::offset::ray_offset;

/// Points per side of the grid on which a textured triangle's mean emission is estimated.
const POWER_GRID: usize = 4;

/// Share of the material's full factor that is added to a triangle's estimated emission, so that a bright spot of the
/// texture which the grid missed is still sampled now and then (the estimate steers noise, never the mean).
const POWER_FLOOR: f32 = 0.01;

/// Share of light samples that go to the sky when there are emissive triangles too.
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
    radiance: Option<Vec3>,
    index: TriangleIndex,
}

impl EmissiveTriangle {
    fn new(scene: &Scene, index: TriangleIndex, probability: f64) -> EmissiveTriangle {
        let corners = scene.mesh.corners(index);
        let material = scene.material(index);
        let textured = material.emission_texture.is_some()
            || material.base_color_texture.is_some()
            || !scene.mesh.colors.is_empty();
        let radiance = (!textured).then(|| scene.emission(index, Vec2::ZERO) * scene.opacity(index, Vec2::ZERO));
        EmissiveTriangle {
            corner: corners[0],
            edges: [corners[1] - corners[0], corners[2] - corners[0]],
            normal: scene.mesh.geometric_normal(index),
            ray_offset: ray_offset(&corners),
            density_per_area: (probability / f64::from(scene.mesh.area(index))) as f32,
            double_sided: material.double_sided,
            radiance,
            index,
        }
    }

    fn point(&self, barycentric: Vec2) -> Vec3 {
        self.corner + self.edges[0] * barycentric.x + self.edges[1] * barycentric.y
    }
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

    fn sky_share(&self) -> f32 {
        match (&self.alias, &self.sky) {
            (_, None) => 0.0,
            (None, Some(_)) => 1.0,
            (Some(_), Some(_)) => SKY_SHARE,
        }
    }

    /// A direction from `point` towards an emitter; `None` where the chosen one cannot light it.
    #[inline]
    pub fn sample(&self, scene: &Scene, point: Vec3, random: &mut impl Numbers) -> Option<LightSample> {
        let sky_share = self.sky_share();
        // No number is drawn where there is no choice.
        if sky_share == 1.0 || (sky_share > 0.0 && random.uniform() < sky_share) {
            let (direction, density) = self.sky.as_ref()?.sample(&scene.environment, random);
            let radiance = scene.environment.radiance(direction);
            return Some(LightSample { direction, target: None, radiance, density: density * sky_share });
        }
        let triangle = &self.triangles[self.alias.as_ref()?.draw(random)];
        let barycentric = triangle_barycentric(random.pair());
        let target = triangle.point(barycentric);
        let to_target = target - point;
        let distance_squared = to_target.length_squared();
        let direction = to_target * distance_squared.sqrt().recip();
        let cosine = -triangle.normal.dot(direction);
        if cosine <= 0.0 && !triangle.double_sided {
            return None;
        }
        // Not finite where the point lies on the emitter or in its plane.
        let density = triangle.density_per_area * (1.0 - sky_share) * distance_squared / cosine.abs();
        if !density.is_finite() {
            return None;
        }
        let radiance = triangle.radiance.unwrap_or_else(|| {
            scene.emission(triangle.index, barycentric) * scene.opacity(triangle.index, barycentric)
        });
        // Stop short of the emitter itself, on the side that faces the point.
        let target = target + triangle.normal * (triangle.ray_offset * cosine.signum());
        Some(LightSample { direction, target: Some(target), radiance, density })
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

    fn sample(&self, environment: &Environment, random: &mut impl Numbers) -> (Vec3, f32) {
        match (self, environment) {
            (Sky::Map { alias, density }, Environment::Map(map)) => {
                let texel = alias.draw(random);
                let (x, y) = ((texel % map.width) as f32, (texel / map.width) as f32);
                let within = random.pair();
                // Uniform in solid angle within the texel: uniform in the cosine of the polar angle.
                let cos_of = |row: f32| (row / map.height as f32 * PI).cos();
                let cosine = cos_of(y) + (cos_of(y + 1.0) - cos_of(y)) * within.x;
                let u = (x + within.y) / map.width as f32;
                (EnvironmentMap::direction(Vec2::new(u, cosine.clamp(-1.0, 1.0).acos() / PI)), density[texel])
            }
            _ => (uniform_sphere(random.pair()), UNIFORM_SPHERE_DENSITY),
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

//! How much of a scene is metal, which reflects no diffuse light.

use glam::Vec2;

use super::{Scene, TriangleIndex};
use crate::math::sampling::triangle_barycentric;

/// Points at which metalness that a texture changes is looked up, over all such triangles. The share's standard error is
/// at most 1/(2·√65,536) = 0.2 %.
const POINTS: usize = 1 << 16;
/// Most points on one triangle.
const MOST_PER_TRIANGLE: usize = 1 << 10;

/// Fractional parts of the multiples of these numbers fill the unit square evenly: the plastic number's powers −1 and −2
/// (Roberts 2018, the sequence R₂).
const R2: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];

impl Scene {
    /// Share of the surface area that is metal, 0 to 1: the mean metalness by area. Unlit surfaces count as no metal.
    pub fn metal_share(&self) -> f64 {
        let triangles = || (0..self.mesh.triangles.len() as u32).map(TriangleIndex);
        let is_textured = |t: &TriangleIndex| self.material(*t).metallic_roughness_texture.is_some();
        let textured = triangles().filter(is_textured).count();
        let points = (POINTS / textured.max(1)).clamp(1, MOST_PER_TRIANGLE);
        let (mut metal, mut total, mut number) = (0.0, 0.0, 0usize);
        for triangle in triangles() {
            let area = f64::from(self.mesh.area(triangle));
            total += area;
            let material = self.material(triangle);
            if material.unlit || material.metallic == 0.0 {
                continue;
            }
            let count = if is_textured(&triangle) { points } else { 1 };
            let mut sum = 0.0;
            for _ in 0..count {
                number += 1;
                let place = R2.map(|r| (number as f64 * r).fract() as f32);
                let (_, metallic) = self.roughness_metallic(triangle, triangle_barycentric(Vec2::from_array(place)));
                sum += f64::from(metallic);
            }
            metal += area * sum / count as f64;
        }
        if total > 0.0 { metal / total } else { 0.0 }
    }
}

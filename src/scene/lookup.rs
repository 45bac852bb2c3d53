//! Values at a point of a triangle: interpolated attributes and evaluated materials.

use glam::{Vec2, Vec3, Vec4};

use super::{AlphaMode, Material, Scene, TextureRef, TriangleIndex};

impl Scene {
    pub fn material(&self, triangle: TriangleIndex) -> &Material {
        &self.materials[self.mesh.materials[triangle.0 as usize].0 as usize]
    }

    fn textured(&self, reference: Option<TextureRef>, triangle: TriangleIndex, barycentric: Vec2) -> Vec4 {
        match reference {
            None => Vec4::ONE,
            Some(reference) => {
                let uv = self.mesh.interpolate(&self.mesh.uvs[reference.uv_set], triangle, barycentric);
                self.textures[reference.texture.0 as usize].sample(reference.transform(uv))
            }
        }
    }

    /// Linear base colour and alpha: factor × texture × vertex colour.
    pub fn base_color(&self, triangle: TriangleIndex, barycentric: Vec2) -> Vec4 {
        let material = self.material(triangle);
        let mut color = material.base_color * self.textured(material.base_color_texture, triangle, barycentric);
        if !self.mesh.colors.is_empty() {
            color *= self.mesh.interpolate(&self.mesh.colors, triangle, barycentric);
        }
        color
    }

    /// Share of rays that a point of this triangle stops: 1 for opaque materials, 0 or 1 for MASK, alpha for BLEND.
    pub fn opacity(&self, triangle: TriangleIndex, barycentric: Vec2) -> f32 {
        match self.material(triangle).alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(self.base_color(triangle, barycentric).w >= cutoff),
            AlphaMode::Blend => self.base_color(triangle, barycentric).w.clamp(0.0, 1.0),
        }
    }

    /// Diffuse albedo ρ = baseColor·(1 − metallic), each channel in [0,1]. Unlit surfaces have 0.
    pub fn albedo(&self, triangle: TriangleIndex, barycentric: Vec2) -> Vec3 {
        let material = self.material(triangle);
        if material.unlit {
            return Vec3::ZERO;
        }
        // What no texture can make metal need not be looked up.
        let is_metal = material.metallic != 0.0;
        let metallic = if is_metal { self.roughness_metallic(triangle, barycentric).1 } else { 0.0 };
        self.base_color(triangle, barycentric).truncate().clamp(Vec3::ZERO, Vec3::ONE) * (1.0 - metallic)
    }

    /// Perceptual roughness and metalness, both in [0,1].
    pub fn roughness_metallic(&self, triangle: TriangleIndex, barycentric: Vec2) -> (f32, f32) {
        let material = self.material(triangle);
        let texel = self.textured(material.metallic_roughness_texture, triangle, barycentric);
        ((material.roughness * texel.y).clamp(0.0, 1.0), (material.metallic * texel.z).clamp(0.0, 1.0))
    }

    /// Radiance that the front (`front`) or back of the surface emits, if that side emits, W·m⁻²·sr⁻¹. It is 0 where another
    /// emitter lies in front of that side in the same plane, so that light is not counted twice.
    pub fn emission(&self, triangle: TriangleIndex, barycentric: Vec2, front: bool) -> Vec3 {
        let emission = self.uncovered_emission(triangle, barycentric);
        if !self.mesh.covers.of(triangle).is_empty() {
            let normal = self.mesh.geometric_normal(triangle);
            let into = if front { -normal } else { normal };
            let mut shown = 1.0;
            self.covers_at(triangle, barycentric, into).for_each(|(by, place)| shown *= 1.0 - self.opacity(by, place));
            return emission * shown;
        }
        emission
    }

    /// As [`Self::emission`], as if nothing lay in front.
    pub fn uncovered_emission(&self, triangle: TriangleIndex, barycentric: Vec2) -> Vec3 {
        let material = self.material(triangle);
        if material.unlit {
            return self.base_color(triangle, barycentric).truncate().max(Vec3::ZERO);
        }
        if material.emission == Vec3::ZERO {
            return Vec3::ZERO;
        }
        material.emission * self.textured(material.emission_texture, triangle, barycentric).truncate()
    }

    /// The shading normal after the normal map. `shading_normal` is the interpolated normal on the front side.
    pub fn normal_mapped(&self, triangle: TriangleIndex, barycentric: Vec2, shading_normal: Vec3) -> Vec3 {
        let material = self.material(triangle);
        let Some(reference) = material.normal_texture else { return shading_normal };
        let texel = self.textured(Some(reference), triangle, barycentric).truncate();
        let scale = Vec3::new(material.normal_scale, material.normal_scale, 1.0);
        let bent = (texel * 2.0 - Vec3::ONE) * scale;
        match self.tangent_frame(triangle, barycentric, shading_normal, reference) {
            None => shading_normal,
            Some((tangent, bitangent)) => {
                (tangent * bent.x + bitangent * bent.y + shading_normal * bent.z).normalize_or(shading_normal)
            }
        }
    }

    /// Tangent and bitangent at the point. They come from the file's tangents, or from the axes of the texture
    /// coordinates if the file has no usable tangent.
    fn tangent_frame(
        &self,
        triangle: TriangleIndex,
        barycentric: Vec2,
        normal: Vec3,
        reference: TextureRef,
    ) -> Option<(Vec3, Vec3)> {
        if !self.mesh.tangents.is_empty() {
            let t = self.mesh.interpolate(&self.mesh.tangents, triangle, barycentric);
            if let Some(tangent) = t.truncate().reject_from_normalized(normal).try_normalize() {
                return Some((tangent, normal.cross(tangent) * t.w.signum()));
            }
        }
        let [p0, p1, p2] = self.mesh.corners(triangle);
        let uvs = &self.mesh.uvs[reference.uv_set];
        let [a, b, c] = self.mesh.triangles[triangle.0 as usize].map(|v| reference.transform(uvs[v as usize]));
        let (d1, d2) = (b - a, c - a);
        let handedness = d1.perp_dot(d2).signum();
        let along_u = ((p1 - p0) * d2.y - (p2 - p0) * d1.y) * handedness;
        let tangent = along_u.reject_from_normalized(normal).try_normalize()?;
        Some((tangent, normal.cross(tangent) * handedness))
    }
}

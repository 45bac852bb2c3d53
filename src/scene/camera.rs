//! Cameras. All pictures of the project, from `bake`, `render` and `reference`, use the rays of [`Camera::ray`].

use glam::{DVec2, Mat3, Vec2, Vec3};

#[derive(Debug, Clone)]
pub struct Camera {
    /// The name of the camera's node, or the camera's own name, or its index. Unique within the scene.
    pub name: String,
    /// Relative to [`super::Scene::origin_world`].
    pub position: Vec3,
    /// Rotation with the columns right, up and back. glTF cameras look along −Z.
    pub world_from_camera: Mat3,
    pub projection: Projection,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Vertical field of view; the width follows from the picture's size.
    Perspective { fov_y_rad: f32 },
    /// Half the height of the view, metres; the width follows from the picture's size.
    Orthographic { half_height_m: f32 },
}

/// Offset of primary rays from pixel centres, pixels (right, down). Without it a ray through a pixel centre can meet an
/// edge exactly, and rounding decides which side it sees. The numbers are the golden ratio and the plastic number's
/// square ÷ 1024, so no edge of a simple slope is met again. Both are below 1/256.
const PIXEL_OFFSET: DVec2 = DVec2::new(1.618_033_988_75 / 1024.0, 1.754_877_666_25 / 1024.0);

impl Camera {
    /// Origin and unit direction of the ray through the point `ndc` ∈ [−1,1]² (x right, y up) of a picture. `aspect` is
    /// width ÷ height.
    pub fn ray(&self, ndc: Vec2, aspect: f32) -> (Vec3, Vec3) {
        let on_plane = Vec2::new(ndc.x * aspect, ndc.y);
        match self.projection {
            Projection::Perspective { fov_y_rad } => {
                let on_plane = on_plane * (0.5 * fov_y_rad).tan();
                (self.position, (self.world_from_camera * on_plane.extend(-1.0)).normalize())
            }
            Projection::Orthographic { half_height_m } => {
                let offset = self.world_from_camera * (on_plane * half_height_m).extend(0.0);
                (self.position + offset, -self.world_from_camera.z_axis)
            }
        }
    }

    /// The ray through the centre of pixel (`x`, `y`), up to [`PIXEL_OFFSET`], counted from the top-left corner of a
    /// `width` × `height` picture. All passes use the same offset.
    pub fn pixel_ray(&self, x: u32, y: u32, width: u32, height: u32) -> (Vec3, Vec3) {
        // f64, because f32 rounds to 1/512 of a pixel in the largest pictures.
        let uv = (DVec2::new(x.into(), y.into()) + 0.5 + PIXEL_OFFSET) / DVec2::new(width.into(), height.into());
        self.ray(DVec2::new(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y).as_vec2(), width as f32 / height as f32)
    }

    /// A perspective camera at `position` that looks at `target`. Its up direction is +Y, or +Z if the view is
    /// vertical.
    pub fn look_at(name: &str, position: Vec3, target: Vec3, fov_y_rad: f32) -> Camera {
        let back = (position - target).normalize_or(Vec3::Z);
        // Within half a degree of vertical, +Y is too close to the view to give a right vector.
        let up = if back.y.abs() > 0.99996 { Vec3::Z } else { Vec3::Y };
        let right = up.cross(back).normalize();
        Camera {
            name: name.to_owned(),
            position,
            world_from_camera: Mat3::from_cols(right, back.cross(right), back),
            projection: Projection::Perspective { fov_y_rad },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_pass_beside_pixel_centres_by_the_same_fraction() {
        assert!(PIXEL_OFFSET.min_element() > 0.0 && PIXEL_OFFSET.max_element() < 1.0 / 256.0);
        for size in [1, 640, 16_384] {
            let mut camera = Camera::look_at("test", Vec3::ZERO, Vec3::NEG_Z, 1.0);
            // One unit of the view is half a picture.
            camera.projection = Projection::Orthographic { half_height_m: 1.0 };
            for pixel in [0, size / 3, size - 1] {
                let origin = camera.pixel_ray(pixel, pixel, size, size).0.as_dvec3();
                let half = f64::from(size) / 2.0;
                let centre = f64::from(pixel) + 0.5;
                let beside = DVec2::new((origin.x + 1.0) * half - centre, (1.0 - origin.y) * half - centre);
                // Coordinates of 1 are rounded by 6e-8, which is 5e-4 of a pixel in the largest picture.
                assert!(beside.distance(PIXEL_OFFSET) < 1e-7 * f64::from(size), "{size}, {pixel}: {beside}");
            }
        }
    }
}

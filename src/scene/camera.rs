//! Cameras. All pictures of the project, from `bake`, `render` and `reference`, use the rays of [`Camera::ray`].

use glam::{Mat3, Vec2, Vec3};

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

    /// The ray through the centre of pixel (`x`, `y`), counted from the top-left corner of a `width` × `height`
    /// picture.
    pub fn pixel_ray(&self, x: u32, y: u32, width: u32, height: u32) -> (Vec3, Vec3) {
        let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
        self.ray(Vec2::new(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y), width as f32 / height as f32)
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

//! The point that light arrives at.

use glam::Vec3;

/// A point at which light is sampled.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// Start of the shadow rays, relative to the scene's origin, metres.
    pub position: Vec3,
    /// Unit shading normal; zero for a point in free space, which receives light from all sides.
    pub normal: Vec3,
    /// Unit geometric normal, zero where `normal` is. No light arrives from the side behind it.
    pub geometric_normal: Vec3,
}

impl Receiver {
    /// A point that receives light from all sides.
    pub fn in_space(position: Vec3) -> Receiver {
        Receiver { position, normal: Vec3::ZERO, geometric_normal: Vec3::ZERO }
    }

    pub fn has_normal(&self) -> bool {
        self.normal != Vec3::ZERO
    }

    /// Cosine between the normal and the unit `direction` that light comes from; 1 in free space, 0 where light cannot
    /// arrive.
    #[inline]
    pub fn cosine(&self, direction: Vec3) -> f32 {
        if !self.has_normal() {
            return 1.0;
        }
        let cosine = self.normal.dot(direction);
        if self.geometric_normal.dot(direction) > 0.0 { cosine.max(0.0) } else { 0.0 }
    }
}

//! Direct light from punctual lights, with shadows.

use glam::Vec3;

use super::World;
use super::bsdf::Bsdf;
use super::incident::{Incident, bounded, incident};
use super::surface::SurfacePoint;
use crate::trace::Ray;

impl World<'_> {
    /// Irradiance with shadows from all punctual lights, W·m⁻², at most [`LIGHT_MAX`](crate::scene::light::LIGHT_MAX), at a surface with this shading
    /// normal; and the number of shadow rays.
    pub fn punctual_irradiance(&self, point: &SurfacePoint, normal: Vec3, salt: u32) -> (Vec3, u32) {
        self.punctual_sum(point, normal, salt, |_, cosine| Vec3::splat(cosine))
    }

    /// Radiance that a surface reflects from all punctual lights, with shadows, W·m⁻²·sr⁻¹.
    pub fn punctual_radiance(&self, point: &SurfacePoint, bsdf: &Bsdf, salt: u32) -> Vec3 {
        self.punctual_sum(point, bsdf.normal(), salt, |direction, cosine| bsdf.scattered(direction, cosine).total()).0
    }

    /// Whether no surface blocks the light of the scene's light `index`, which arrives as `incident`, before `origin`. A
    /// surface that contains the light does not block it on the side that [`super::contact`] gives. No light reaches
    /// points of that surface's own plane, because it would arrive at a right angle to their normal.
    #[inline]
    pub fn light_reaches(&self, index: usize, incident: &Incident, origin: Vec3, salt: u32) -> bool {
        let ray = match self.light_contacts.of(index) {
            None => Ray { origin, direction: incident.direction, t_max: incident.distance, salt },
            Some(contact) if contact.shares_plane(origin) => return false,
            Some(contact) => Ray::segment(origin, contact.target(origin), salt),
        };
        !self.tracer.occluded(ray)
    }

    /// The sum of irradiance × `response` over the lights that no surface occludes, and the number of shadow rays.
    /// `response` takes the direction to the light and its cosine to the normal.
    #[inline]
    fn punctual_sum(
        &self,
        point: &SurfacePoint,
        normal: Vec3,
        salt: u32,
        response: impl Fn(Vec3, f32) -> Vec3,
    ) -> (Vec3, u32) {
        let origin = point.ray_origin();
        let mut rays = 0;
        let mut sum = Vec3::ZERO;
        for (index, light) in self.scene.lights.iter().enumerate() {
            let Some(incident) = incident(light, point.position) else { continue };
            let cosine = normal.dot(incident.direction);
            // Light from below the surface cannot arrive, even if the shading normal faces it.
            if cosine <= 0.0 || point.geometric_normal.dot(incident.direction) <= 0.0 {
                continue;
            }
            rays += 1;
            if self.light_reaches(index, &incident, origin, salt) {
                sum += incident.irradiance * response(incident.direction, cosine);
            }
        }
        (bounded(sum * self.punctual_scale), rays)
    }
}

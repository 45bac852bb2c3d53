//! A camera for scenes that bring none.

use glam::Vec3;

use crate::light::World;
use crate::light::punctual::incident;
use crate::math::fibonacci;
use crate::scene::Camera;
use crate::trace::Ray;

/// Vertical field of view of framed cameras.
const FOV_Y_DEG: f32 = 60.0;

/// Directions tried around a candidate viewpoint.
const DIRECTIONS: usize = 256;

/// Candidates along each axis of the scene's box.
const CANDIDATES: u32 = 5;

/// Share of the rays from a point that must meet the front of something for the point to count as indoors.
const ENCLOSED_SHARE: f32 = 0.9;

/// Views from outside stand this many radii of the scene's bounding sphere from its centre, so that it fits the picture.
const OUTSIDE_RADII: f32 = 2.0;

/// Frames a scene: from its most open place, looking along its longest view, when it is enclosed; else from outside.
pub fn frame(world: &World, bounds: (Vec3, Vec3)) -> (Camera, bool) {
    let (low, high) = bounds;
    let fov = FOV_Y_DEG.to_radians();
    let dark = world.scene.lights.is_empty() && !world.has_emitters();
    let candidate = |i: u32| {
        let at = |k: u32| (k as f32 + 0.5) / CANDIDATES as f32;
        let share = Vec3::new(at(i % CANDIDATES), at(i / CANDIDATES % CANDIDATES), at(i / (CANDIDATES * CANDIDATES)));
        low + (high - low) * share
    };
    let inside = (0..CANDIDATES.pow(3)).filter_map(|i| {
        let position = candidate(i);
        let (clearance, farthest, fronts, lit) = look_around(world, position);
        let enclosed = fronts as f32 >= ENCLOSED_SHARE * DIRECTIONS as f32;
        // Inside a solid block it is enclosed too, but no light is to be seen there.
        (enclosed && (lit || dark)).then_some((clearance, position, farthest))
    });
    // The first of the widest, so that the choice does not depend on rounding elsewhere.
    let best = inside.fold(None, |best: Option<(f32, Vec3, Vec3)>, c| match best {
        Some(b) if b.0 >= c.0 => Some(b),
        _ => Some(c),
    });
    match best {
        Some((_, position, direction)) => (Camera::look_at("framed", position, position + direction, fov), true),
        None => {
            let (centre, radius) = ((low + high) / 2.0, ((high - low) / 2.0).length().max(f32::MIN_POSITIVE));
            let from = centre + Vec3::new(0.6, 0.45, 1.0).normalize() * radius * OUTSIDE_RADII;
            (Camera::look_at("framed", from, centre, fov), false)
        }
    }
}

/// Distance to the nearest surface, direction of the longest view that is not steep, number of rays that meet fronts,
/// and whether any light can be seen.
fn look_around(world: &World, position: Vec3) -> (f32, Vec3, usize, bool) {
    let (mut nearest, mut farthest, mut direction, mut fronts) = (f32::INFINITY, 0.0, Vec3::NEG_Z, 0);
    let mut lit =
        world.scene.lights.iter().filter_map(|light| incident(light, position)).any(|light| {
            !world.tracer.occluded(Ray { t_max: light.distance, ..Ray::new(position, light.direction, 0) })
        });
    for i in 0..DIRECTIONS {
        let d = fibonacci::direction(i, DIRECTIONS);
        let Some(surface) = world.surface(Ray::new(position, d, i as u32)) else {
            lit |= world.emitters.has_sky();
            continue;
        };
        lit |= surface.emission != Vec3::ZERO;
        fronts += usize::from(!surface.is_back());
        let t = surface.hit.t;
        nearest = nearest.min(t);
        // Views within 20° of the horizontal.
        if t > farthest && d.y.abs() < 0.34 {
            (farthest, direction) = (t, d);
        }
    }
    (nearest, direction, fronts, lit)
}

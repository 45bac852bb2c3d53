//! An automatic camera for scenes without cameras.

use glam::Vec3;

use crate::light::World;
use crate::light::incident::incident;
use crate::math::fibonacci;
use crate::scene::Camera;
use crate::trace::Ray;

/// Vertical field of view of automatic cameras.
const FOV_Y_DEG: f32 = 60.0;

/// Number of directions in which a candidate viewpoint is examined.
const DIRECTIONS: usize = 256;

/// Number of candidate viewpoints along each axis of the scene's box.
const CANDIDATES: u32 = 5;

/// A point is enclosed if at least this share of the rays from it hit the front of a surface.
const ENCLOSED_SHARE: f32 = 0.9;

/// Distance of a view from outside to the scene's centre, in radii of its bounding sphere. The scene then fits the
/// picture.
const OUTSIDE_RADII: f32 = 2.0;

/// Chooses a camera, and tells whether it stands inside the scene. If points of the scene are enclosed and see light,
/// the camera stands at the one with the most space around it and looks along its longest view. Otherwise it looks at
/// the scene from outside.
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
        // A point inside a solid block is enclosed too, but it sees no light.
        (enclosed && (lit || dark)).then_some((clearance, position, farthest))
    });
    // Of equal candidates the first is taken, so that the choice is deterministic.
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

/// Examines a viewpoint: the distance to the nearest surface, the direction of the longest nearly horizontal view, the
/// number of rays that hit fronts of surfaces, and whether any light is visible.
fn look_around(world: &World, position: Vec3) -> (f32, Vec3, usize, bool) {
    let (mut nearest, mut farthest, mut direction, mut fronts) = (f32::INFINITY, 0.0, Vec3::NEG_Z, 0);
    let mut lit = world.scene.lights.iter().enumerate().any(|(index, light)| {
        incident(light, position).is_some_and(|light| world.light_reaches(index, &light, position, 0))
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
        // 0.34 is the sine of 20°: only nearly horizontal views count.
        if t > farthest && d.y.abs() < 0.34 {
            (farthest, direction) = (t, d);
        }
    }
    (nearest, direction, fronts, lit)
}

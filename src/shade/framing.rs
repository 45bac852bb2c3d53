//! An automatic camera for scenes without cameras.
//!
//! Rooms are seen from inside, objects from outside. A viewpoint inside counts where it is enclosed by fronts of surfaces,
//! has room around it, and is no hollow of an object. Of all views the one is taken that shows most lit surfaces.

use std::f32::consts::TAU;

use glam::Vec3;

use crate::light::World;
use crate::light::incident::incident;
use crate::light::surface::SurfacePoint;
use crate::math::fibonacci;
use crate::probe::lattice::content::content_bounds;
use crate::scene::Camera;
use crate::trace::Ray;

/// Vertical field of view of automatic cameras.
const FOV_Y_DEG: f32 = 60.0;

/// Number of directions in which a viewpoint is examined.
const DIRECTIONS: usize = 256;

/// Number of candidate viewpoints along each axis of the content's box.
const CANDIDATES: u32 = 5;

/// A point is enclosed if at least this share of the rays from it hit the front of a surface.
const ENCLOSED_SHARE: f32 = 0.9;

/// Free space around a viewpoint inside, as a share of the longest side of the content's box.
const LEAST_CLEARANCE: f32 = 0.02;

/// Metres between opposite walls from which on an enclosed space is a room, not the hollow of an object. glTF has metres.
const ROOM_M: f32 = 2.5;

/// A scene whose outside shows this share of backs is made to be seen from inside.
const INSIDE_OUT: f32 = 0.5;

/// Views around a viewpoint, and around the content.
const AZIMUTHS: usize = 16;

/// Heights of views: sines of the angle above the horizon. Inside a little downwards.
const INSIDE_PITCHES: [f32; 2] = [0.0, -0.2];
const OUTSIDE_PITCHES: [f32; 2] = [0.36, 0.6];

/// The direction from the content to the camera that wins where others are hardly better.
const USUAL_DIRECTION: Vec3 = Vec3::new(0.6, 0.45, 1.0);
const CLEARLY_BETTER: f32 = 1.1;

/// Rays of a small picture along each side.
const RAYS: usize = 16;

/// Rays that tell whether a surface is lit by the sky or by emissive surfaces.
const LIGHT_RAYS: usize = 8;

/// What an unlit surface counts against a lit one, in a view from outside.
const UNLIT: f32 = 0.25;

/// Room around the content in the picture.
const MARGIN: f32 = 1.1;

/// Rays along each side of the picture by which the content is made to fill it, and the least field of view for that.
const FITTING_RAYS: usize = 64;
const LEAST_FOV_DEG: f32 = 8.0;

/// Width ÷ height of a picture whose size is not known.
pub const USUAL_ASPECT: f32 = 16.0 / 9.0;

/// Chooses a camera for pictures of this width ÷ height, and tells whether it stands inside the scene.
pub fn frame(world: &World, bounds: (Vec3, Vec3), aspect: f32) -> (Camera, bool) {
    let (low, high) = content_bounds(&world.scene.mesh).unwrap_or(bounds);
    match inside(world, low, high) {
        Some(camera) => (camera, true),
        None => (outside(world, low, high, aspect), false),
    }
}

fn camera(position: Vec3, target: Vec3) -> Camera {
    Camera::look_at("framed", position, target, FOV_Y_DEG.to_radians())
}

/// The view from the enclosed viewpoint with the most space around it.
fn inside(world: &World, low: Vec3, high: Vec3) -> Option<Camera> {
    let longest = (high - low).max_element();
    let dark = world.scene.lights.is_empty() && !world.has_emitters();
    let inside_out = outside_backs(world, low, high) >= INSIDE_OUT;
    let candidate = |i: u32| {
        let at = |k: u32| (k as f32 + 0.5) / CANDIDATES as f32;
        let share = Vec3::new(at(i % CANDIDATES), at(i / CANDIDATES % CANDIDATES), at(i / (CANDIDATES * CANDIDATES)));
        low + (high - low) * share
    };
    let places = (0..CANDIDATES.pow(3)).filter_map(|i| {
        let position = candidate(i);
        let seen = look_around(world, position);
        let enclosed = seen.fronts as f32 >= ENCLOSED_SHARE * DIRECTIONS as f32;
        let has_room = seen.nearest >= LEAST_CLEARANCE * longest;
        let is_room = inside_out || seen.lamp || seen.across >= ROOM_M;
        // A point inside a solid block is enclosed too, but it sees no light.
        (enclosed && has_room && is_room && (seen.lit || dark)).then_some((seen.nearest, position))
    });
    // Of equal candidates the first is taken, so that the choice is deterministic.
    let best = places.fold(None, |best: Option<(f32, Vec3)>, place| match best {
        Some(b) if b.0 >= place.0 => Some(b),
        _ => Some(place),
    });
    let (_, position) = best?;
    let directions = around(&INSIDE_PITCHES);
    // Long views that end at fronts of surfaces, not in the open and not at backs.
    let score = |direction: Vec3| {
        let of_ray = |surface: Option<SurfacePoint>| match surface {
            Some(surface) if surface.is_back() => -0.5,
            Some(surface) => (surface.hit.t / longest).min(1.0),
            None => 0.0,
        };
        small_picture(world, position, direction).map(of_ray).sum::<f32>()
    };
    let direction = best_of(directions, score)?;
    Some(camera(position, position + direction))
}

/// The view of the content from the side that shows most of it, lit, and hides none of it behind other things.
fn outside(world: &World, low: Vec3, high: Vec3, aspect: f32) -> Camera {
    let centre = (low + high) / 2.0;
    let usual = USUAL_DIRECTION.normalize();
    let place = |direction: Vec3| centre + direction * distance(low, high, direction);
    let margin = (high - low) * 0.1 + f32::MIN_POSITIVE;
    let is_content = |p: Vec3| p.cmpge(low - margin).all() && p.cmple(high + margin).all();
    let score = |direction: Vec3| {
        let of_ray = |surface: Option<SurfacePoint>| match surface {
            Some(surface) if surface.is_back() => -0.5,
            Some(surface) => match (is_content(surface.position), is_lit(world, &surface)) {
                (false, _) => 0.0,
                (true, true) => 1.0,
                (true, false) => UNLIT,
            },
            None => 0.0,
        };
        let bonus = if direction == usual { CLEARLY_BETTER } else { 1.0 };
        bonus * small_picture(world, place(direction), -direction).map(of_ray).sum::<f32>()
    };
    let directions = [usual].into_iter().chain(around(&OUTSIDE_PITCHES));
    let position = place(best_of(directions, score).unwrap_or(usual));
    filled(world, position, centre, aspect, is_content)
}

/// A camera there whose picture the content fills: turned to its middle, with the field of view that it takes.
fn filled(world: &World, position: Vec3, centre: Vec3, aspect: f32, is_content: impl Fn(Vec3) -> bool) -> Camera {
    let forward = (centre - position).normalize_or(Vec3::NEG_Z);
    let right = forward.cross(Vec3::Y).normalize_or(Vec3::X);
    let (up, slope) = (right.cross(forward), (FOV_Y_DEG.to_radians() / 2.0).tan());
    // In halves of the picture's height, wide enough for both a wide and a square picture.
    let towards = |x: f32, y: f32| forward + (right * x + up * y) * slope;
    let reach = aspect.max(1.0);
    let at = |k: usize| (k as f32 + 0.5) / FITTING_RAYS as f32 * 2.0 - 1.0;
    let mut ends: Option<[f32; 4]> = None;
    for i in 0..FITTING_RAYS * FITTING_RAYS {
        let (x, y) = (at(i % FITTING_RAYS) * reach, at(i / FITTING_RAYS));
        let surface = world.surface(Ray::new(position, towards(x, y).normalize(), i as u32));
        if surface.is_some_and(|surface| is_content(surface.position)) {
            let [left, right, low, high] = ends.unwrap_or([x, x, y, y]);
            ends = Some([left.min(x), right.max(x), low.min(y), high.max(y)]);
        }
    }
    let Some([left, right_end, low, high]) = ends else { return camera(position, centre) };
    let target = position + (centre - position).length() * towards((left + right_end) / 2.0, (low + high) / 2.0);
    let half = ((high - low) / 2.0).max((right_end - left) / 2.0 / aspect) + 1.0 / FITTING_RAYS as f32;
    let fov = (2.0 * (slope * half * MARGIN).atan()).clamp(LEAST_FOV_DEG.to_radians(), FOV_Y_DEG.to_radians());
    Camera::look_at("framed", position, target, fov)
}

/// Horizontal directions, raised or lowered.
fn around(pitches: &'static [f32]) -> impl Iterator<Item = Vec3> {
    (0..AZIMUTHS).flat_map(move |i| {
        let angle = TAU * i as f32 / AZIMUTHS as f32;
        pitches.iter().map(move |y| {
            let level = (1.0 - y * y).sqrt();
            Vec3::new(level * angle.sin(), *y, level * angle.cos())
        })
    })
}

/// The first of the best.
fn best_of(directions: impl Iterator<Item = Vec3>, score: impl Fn(Vec3) -> f32) -> Option<Vec3> {
    let scored = directions.map(|direction| (score(direction), direction));
    scored.reduce(|best, other| if other.0 > best.0 { other } else { best }).map(|(_, direction)| direction)
}

/// How far from its centre a box fits the picture's height, and so a width that is no smaller.
fn distance(low: Vec3, high: Vec3, direction: Vec3) -> f32 {
    let half = (high - low) / 2.0;
    let right = direction.any_orthonormal_pair().0;
    let up = Vec3::Y - direction * direction.y;
    let up = if up.length() > 1e-3 { up.normalize() } else { right };
    let right = up.cross(direction);
    let slope = (FOV_Y_DEG.to_radians() / 2.0).tan();
    let corners = (0..8).map(|i| half * Vec3::new(sign(i & 1), sign(i >> 1 & 1), sign(i >> 2)));
    // A corner at height h above the axis and depth d before the centre fits from h ÷ slope + d on.
    let needed = corners.map(|c| c.dot(up).abs().max(c.dot(right).abs()) * MARGIN / slope + c.dot(direction));
    needed.fold(f32::MIN_POSITIVE, f32::max)
}

fn sign(bit: u32) -> f32 {
    if bit == 0 { -1.0 } else { 1.0 }
}

/// What the pixels of a small square picture show.
fn small_picture(world: &World, position: Vec3, direction: Vec3) -> impl Iterator<Item = Option<SurfacePoint>> {
    let (right, up) = direction.any_orthonormal_pair();
    let slope = (FOV_Y_DEG.to_radians() / 2.0).tan();
    (0..RAYS * RAYS).map(move |i| {
        let at = |k: usize| ((k as f32 + 0.5) / RAYS as f32 * 2.0 - 1.0) * slope;
        let towards = (direction + right * at(i % RAYS) + up * at(i / RAYS)).normalize();
        world.surface(Ray::new(position, towards, i as u32))
    })
}

/// Share of backs among what the content shows from all around.
fn outside_backs(world: &World, low: Vec3, high: Vec3) -> f32 {
    let (centre, radius) = ((low + high) / 2.0, (high - low).length());
    let (mut backs, mut all) = (0, 0);
    for i in 0..DIRECTIONS {
        let d = fibonacci::direction(i, DIRECTIONS);
        if let Some(surface) = world.surface(Ray::new(centre + d * radius, -d, i as u32)) {
            all += 1;
            backs += usize::from(surface.is_back());
        }
    }
    if all == 0 { 0.0 } else { backs as f32 / all as f32 }
}

/// Whether a surface gets light straight from a lamp or the sky.
fn is_lit(world: &World, surface: &SurfacePoint) -> bool {
    let (position, normal) = (surface.ray_origin(), surface.geometric_normal);
    let by_lamps = world.scene.lights.iter().enumerate().any(|(index, light)| {
        incident(light, position).is_some_and(|light| world.light_reaches(index, &light, position, 0))
    });
    let by_surroundings = || {
        (0..LIGHT_RAYS).any(|i| {
            let d = (normal + fibonacci::direction(i, LIGHT_RAYS) * 0.95).normalize();
            match world.surface(Ray::new(position, d, i as u32)) {
                Some(other) => other.emission != Vec3::ZERO,
                None => world.emitters.has_sky(),
            }
        })
    };
    surface.emission != Vec3::ZERO || by_lamps || by_surroundings()
}

/// What a viewpoint is surrounded by.
struct Seen {
    /// Distance to the nearest surface, metres.
    nearest: f32,
    /// Metres between surfaces on opposite sides, the median over all directions.
    across: f32,
    /// Rays that hit fronts of surfaces.
    fronts: usize,
    /// Whether any light is visible; whether it is a lamp and not the sky.
    lit: bool,
    lamp: bool,
}

fn look_around(world: &World, position: Vec3) -> Seen {
    let mut seen = Seen { nearest: f32::INFINITY, across: 0.0, fronts: 0, lit: false, lamp: false };
    seen.lamp = world.scene.lights.iter().enumerate().any(|(index, light)| {
        incident(light, position).is_some_and(|light| world.light_reaches(index, &light, position, 0))
    });
    let mut distances = Vec::with_capacity(DIRECTIONS);
    for i in 0..DIRECTIONS {
        let d = fibonacci::direction(i, DIRECTIONS);
        let Some(surface) = world.surface(Ray::new(position, d, i as u32)) else {
            seen.lit |= world.emitters.has_sky();
            distances.push(f32::INFINITY);
            continue;
        };
        seen.lamp |= surface.emission != Vec3::ZERO;
        seen.fronts += usize::from(!surface.is_back());
        seen.nearest = seen.nearest.min(surface.hit.t);
        distances.push(surface.hit.t);
    }
    seen.lit |= seen.lamp;
    distances.sort_by(f32::total_cmp);
    seen.across = 2.0 * distances[DIRECTIONS / 2];
    seen
}

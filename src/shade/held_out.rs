//! Points on a scene's surfaces at which bakes are judged: uniform by area, none of them of any bake or fit, with the light
//! there by paths.
//!
//! They depend on the scene, the box and the seed alone, so that all bakes of a scene are judged at the same. Left out are
//! sides that nobody is to see:
//!
//! * inside of solids: where more than half of what rays meet are backs of single-sided surfaces, the rule of the
//!   placement;
//! * before a void: where all rays leave a scene that has no sky, or a quarter of them does and no path brings light, as at
//!   the outer faces of a closed room;
//! * in cracks: where most rays meet something nearer than [`CRACK`], as between tiles and the wall that they were modelled
//!   before (in bathroom 30 % of all surface);
//! * in dark hollows: where rays stay within a slab thinner than [`REACH`] and no path brings light, as within walls of double-sided
//!   surfaces (in bathroom 30 % of the rest, and 97 % of the squared error);
//! * away from the box that probes were asked for: farther than [`REACH`], or not in sight of it.
//!
//! Pictures weigh surfaces by how much of them a camera sees. To tell the error of one, the points of a picture are judged
//! in the same way.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::block_mean::BlockMean;
use super::points::see_pixel;
use crate::light::World;
use crate::light::path::PathSettings;
use crate::light::sides::{Place, Sides};
use crate::light::surface::SurfacePoint;
use crate::math::blocks::{BLOCK, Block};
use crate::math::color::luminance;
use crate::math::random::{KroneckerSequence, Purpose, Random};
use crate::math::sampling::cosine_hemisphere;
use crate::probe::query::QueryPoint;
use crate::probe::store::surface::Facing;
use crate::scene::Camera;
use crate::trace::Ray;

/// Points that are looked for.
const POINTS: usize = 16_384;

/// Pixels of a picture, in the shape that pictures have where no size is given. A few at edges hold much of the error: of a
/// quarter as many, the error of cornell came out at 0.038 where it is 0.048.
const PICTURE: (u32, u32) = (192, 108);

/// Rounds in which they are looked for: sides that are left out may use up all points of one.
const ROUNDS: usize = 4;

/// Rays by which a point looks around.
const LOOKS: usize = 16;

/// So many of them leave a scene before a void. At outer corners, where walls meet in a notch, half of them do.
const LEAVING: usize = LOOKS / 4;

/// Surfaces so near to the box that probes were asked for are judged, in sides of the box (its longest): a cell of the
/// default grid.
const REACH: f32 = 1.0 / 16.0;

/// Width of a crack, in the same sides: a sixteenth of a cell of the default grid. No camera fits in, and hardly one looks in.
const CRACK: f32 = REACH / 16.0;

/// Rounding of the box, in the same sides.
const ROUNDING: f32 = 1e-4;

/// Blocks of paths from each point at first, and at most. Two tell the noise.
const FIRST_BLOCKS: u32 = 2;
const MOST_BLOCKS: u32 = 16;

/// Standard error that the noise of the paths may leave, as a share of the error that is asked for.
const NOISE_SHARE: f64 = 0.05;

/// Points with the light there.
pub struct HeldOut {
    pub points: Vec<(SurfacePoint, QueryPoint)>,
    pub truth: Vec<BlockMean>,
}

impl HeldOut {
    /// Looks for points and traces the light there, so well that `error`, relative, can be told. `bounds`: the box that
    /// probes were asked for, relative to the scene's origin; `None`: the whole scene.
    pub fn new(world: &World, bounds: Option<(Vec3, Vec3)>, error: f64, seed: u64) -> HeldOut {
        let (points, hidden): (Vec<_>, Vec<bool>) = points(world, bounds, seed).into_iter().unzip();
        let all = HeldOut { truth: light(world, &points, 0, error, seed), points };
        if !all.is_lit() {
            return all;
        }
        let counts = |(light, hidden): (&BlockMean, &bool)| !hidden || light.mean.max_element() > 0.0;
        let counted: Vec<bool> = all.truth.iter().zip(&hidden).map(counts).collect();
        let kept = all.points.into_iter().zip(all.truth).zip(counted).filter(|(_, counts)| *counts);
        let (points, truth) = kept.map(|(point, _)| point).unzip();
        HeldOut { points, truth }
    }

    /// The same of what a camera sees, one point a pixel. `index` tells the pictures of a scene apart.
    pub fn in_picture(world: &World, camera: &Camera, index: u64, error: f64, seed: u64) -> HeldOut {
        let (width, height) = PICTURE;
        let stream = 1 + index;
        let pixel = |pixel: u32| {
            let mut random = Random::new(seed, Purpose::HeldOutPoints, 1 + stream, u64::from(pixel));
            let (points, _) = see_pixel(world, camera, width, height, pixel, 1, &mut random);
            points.into_iter().map(|point| (point.surface, point.query))
        };
        let points: Vec<_> = (0..width * height).into_par_iter().flat_map_iter(pixel).collect();
        HeldOut { truth: light(world, &points, stream, error, seed), points }
    }

    /// Paths from each point.
    pub fn paths(&self) -> u32 {
        self.truth.first().map_or(0, |light| light.blocks * BLOCK)
    }

    /// Whether any light arrives.
    pub fn is_lit(&self) -> bool {
        self.truth.iter().any(|light| light.mean.max_element() > 0.0)
    }
}

/// The light at points, from so many paths that their noise leaves `error` certain. Points of other streams have others.
fn light(world: &World, points: &[(SurfacePoint, QueryPoint)], stream: u64, error: f64, seed: u64) -> Vec<BlockMean> {
    let keys = points.iter().map(|(surface, _)| world.places.key_of(surface)).collect();
    let expected = world.expect(keys);
    let path = PathSettings { expected: Some(&expected), ..PathSettings::default() };
    let mut truth = vec![BlockMean::default(); points.len()];
    let mut blocks = FIRST_BLOCKS;
    loop {
        truth.par_iter_mut().zip(points).enumerate().for_each(|(index, (light, (surface, query)))| {
            for b in light.blocks..blocks {
                let block = Block::new(seed, Purpose::HeldOutPaths, stream << 32 | index as u64, u64::from(b));
                light.add(world, (surface, query), &path, &block);
            }
        });
        if blocks >= MOST_BLOCKS || noise(&truth, error) <= NOISE_SHARE * error {
            return truth;
        }
        blocks *= 2;
    }
}

/// The standard error that the truth's noise gives a relative error of this size: var(d² − v) = 4D²v + 2v² for a difference D
/// and noise of variance v, with the channels of a point taken as one. The square of a variance that was estimated from k
/// blocks is (k + 1)/(k − 1) times too large.
fn noise(truth: &[BlockMean], error: f64) -> f64 {
    let count = truth.len().max(1) as f64;
    let mean = truth.iter().map(|light| f64::from(luminance(light.mean.as_vec3()))).sum::<f64>() / count;
    if mean <= 0.0 {
        return 0.0;
    }
    let of_point = |light: &BlockMean| {
        let (v, k) = (light.variance().element_sum() / 3.0, f64::from(light.blocks));
        4.0 * (error * mean).powi(2) * v + 2.0 * v * v * (k - 1.0) / (k + 1.0)
    };
    let of_square = truth.iter().map(of_point).sum::<f64>().sqrt() / count;
    of_square / (2.0 * error * mean * mean)
}

/// A point, and whether it is hidden where no light arrives: before a void, or in a hollow.
type Found = ((SurfacePoint, QueryPoint), bool);

fn points(world: &World, bounds: Option<(Vec3, Vec3)>, seed: u64) -> Vec<Found> {
    let Some(sides) = Sides::of(world.scene) else { return Vec::new() };
    let mut random = Random::new(seed, Purpose::HeldOutPoints, 0, 0);
    let mut sequence = KroneckerSequence::new(&mut random);
    let mut found = Vec::new();
    for round in 0..ROUNDS {
        if found.len() >= POINTS {
            break;
        }
        let places: Vec<[u32; 4]> = sequence.by_ref().take(POINTS).collect();
        let at = |(index, numbers): (usize, [u32; 4])| {
            let mut random = Random::new(seed, Purpose::HeldOutPoints, 1, (round * POINTS + index) as u64);
            point(world, bounds, &sides.place(numbers), &mut random)
        };
        found.par_extend(places.into_par_iter().enumerate().filter_map(at));
    }
    found.truncate(POINTS);
    found
}

/// The point of a place, which asks with its shading normal; `None` where it is left out.
fn point(world: &World, bounds: Option<(Vec3, Vec3)>, place: &Place, random: &mut Random) -> Option<Found> {
    let surface = world.point_at(place);
    if !bounds.is_none_or(|bounds| is_asked_for(world, bounds, &surface, random)) {
        return None;
    }
    if !world.is_seen(place, &surface, || random.bits()) {
        return None;
    }
    let (low, high) = bounds.or_else(|| world.scene.mesh.bounds())?;
    let longest = (high - low).max_element();
    let around = look(world, &surface, CRACK * longest, random)?;
    let has_sky = world.emitters.has_sky();
    if around.leaving == LOOKS && !has_sky {
        return None;
    }
    let geometric = surface.geometric_normal;
    let view = cosine_hemisphere(geometric, Vec2::new(random.uniform(), random.uniform()));
    let (position, normal, facing) = (surface.position, surface.shading_normal, Facing::of(geometric));
    let is_before_void = around.leaving >= LEAVING && !has_sky;
    let is_in_hollow = around.leaving == 0 && around.width <= REACH * longest;
    Some(((surface, QueryPoint { position, normal, geometric, facing, view }), is_before_void || is_in_hollow))
}

/// Whether a point lies in the box, or beside it and sees it.
fn is_asked_for(world: &World, (low, high): (Vec3, Vec3), surface: &SurfacePoint, random: &mut Random) -> bool {
    let longest = (high - low).max_element();
    let nearest = surface.position.clamp(low, high);
    let away = surface.position.distance(nearest);
    if away <= ROUNDING * longest {
        return true;
    }
    let (from, salt) = (surface.ray_origin(), random.bits());
    let faces = (nearest - surface.position).dot(surface.geometric_normal) > 0.0;
    away <= REACH * longest && faces && !world.tracer.occluded(Ray::segment(from, nearest, salt))
}

/// What a side's rays meet.
struct Around {
    /// Rays that leave the scene.
    leaving: usize,
    /// Shortest side of the box around all that the others meet, metres.
    width: f32,
}

/// Looks around; `None` inside of a solid, and in a crack of less than this width.
fn look(world: &World, surface: &SurfacePoint, crack: f32, random: &mut Random) -> Option<Around> {
    let (mut hits, mut backs, mut near) = (0, 0, 0);
    let (mut low, mut high) = (surface.position, surface.position);
    for _ in 0..LOOKS {
        let direction = cosine_hemisphere(surface.geometric_normal, Vec2::new(random.uniform(), random.uniform()));
        if let Some(seen) = world.surface(Ray::new(surface.ray_origin(), direction, random.bits())) {
            hits += 1;
            backs += usize::from(seen.is_back());
            near += usize::from(seen.hit.t < crack);
            (low, high) = (low.min(seen.position), high.max(seen.position));
        }
    }
    let around = Around { leaving: LOOKS - hits, width: (high - low).min_element() };
    (2 * backs <= hits && 2 * near <= LOOKS).then_some(around)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;
    use std::path::Path;

    use super::*;
    use crate::scene::{self, LoadOptions, Scene};

    fn load(name: &str) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        scene::load(&path, &LoadOptions::default()).unwrap()
    }

    /// All walls emit 1 and reflect a half: π arrives directly, and as much again by reflections.
    #[test]
    fn the_light_is_that_of_a_closed_form() {
        let scene = load("furnace.glb");
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let held_out = HeldOut::new(&world, None, 0.1, 5);
        assert_eq!((held_out.points.len(), held_out.paths()), (POINTS, FIRST_BLOCKS * BLOCK));
        let count = held_out.truth.len() as f64;
        let mean = held_out.truth.iter().map(|light| light.mean.y).sum::<f64>() / count;
        let error = (held_out.truth.iter().map(|light| light.variance().y).sum::<f64>()).sqrt() / count;
        // Five standard errors, and what a ray or two that slip through an edge may take.
        assert!((mean - 2.0 * PI).abs() < 5.0 * error + 1e-3, "{mean} ± {error}");
    }

    /// Solid walls around (−3, 0, −2) to (3, 3, 2): of these the inner faces are judged, with the dark chambers, and of two
    /// sides 5 cm long in a notch outside nothing is. The panel hangs 2 cm below the ceiling, which looks at its back there.
    #[test]
    fn sides_that_nobody_sees_are_left_out() {
        let scene = load("thin_wall.glb");
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let held_out = HeldOut::new(&world, None, 0.5, 5);
        let positions: Vec<Vec3> = held_out
            .points
            .iter()
            .map(|(_, query)| (scene.origin_world + query.position.as_dvec3()).as_vec3())
            .collect();
        let is_inside = |p: &Vec3| {
            p.cmpgt(Vec3::new(-3.0, 0.0, -2.0) - 1e-4).all() && p.cmplt(Vec3::new(3.0, 3.0, 2.0) + 1e-4).all()
        };
        let outside = positions.iter().filter(|p| !is_inside(p)).count();
        // Of the 5 m² of notches none; chance may keep a few points at their edges, of which half of the rays leave.
        assert!(outside <= positions.len() / 1000, "{outside} of {}", positions.len());
        let above_panel = |p: &&Vec3| p.y > 2.99 && p.x.abs() < 0.4 && p.z.abs() < 0.4;
        assert_eq!(positions.iter().filter(above_panel).count(), 0);
        assert!(positions.iter().any(|p| p.x < -1.5) && positions.iter().any(|p| p.x > 1.5), "dark chambers count");
    }

    /// Walls 0.1 m thick with two sides to each of their surfaces are hollow: within the dividing one nobody is to look. The dark room
    /// is judged all the same.
    #[test]
    fn dark_hollows_are_left_out_and_dark_rooms_are_not() {
        let mut scene = load("two_rooms_sealed.glb");
        scene.materials.iter_mut().for_each(|material| material.double_sided = true);
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let held_out = HeldOut::new(&world, None, 0.5, 5);
        let x: Vec<f64> =
            held_out.points.iter().map(|(_, query)| scene.origin_world.x + f64::from(query.position.x)).collect();
        let inner =
            |(x, (_, query)): (&f64, &(_, QueryPoint))| x.abs() < 0.06 && x * f64::from(query.geometric.x) < 0.0;
        assert_eq!(x.iter().zip(&held_out.points).filter(|at| inner(*at)).count(), 0);
        let on_side = |sign: f64| x.iter().filter(|x| sign * **x > 0.06).count();
        assert!(on_side(1.0) > POINTS / 8 && on_side(-1.0) > POINTS / 8, "{} {}", on_side(1.0), on_side(-1.0));
    }

    /// In cornell nothing lies in a crack of 1 cm, and nearly all does in one of 100 m.
    #[test]
    fn cracks_are_left_out() {
        let scene = load("cornell.glb");
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let place = |index: u64| {
            let mut random = Random::new(index, Purpose::HeldOutPoints, 0, 0);
            let sides = Sides::of(&scene).unwrap();
            let mut sequence = KroneckerSequence::new(&mut random);
            sides.place(sequence.next().unwrap())
        };
        let mut counts = [0; 3];
        for index in 0..256 {
            let surface = world.point_at(&place(index));
            for (count, crack) in counts.iter_mut().zip([0.0, 0.01, 100.0]) {
                let mut random = Random::new(index, Purpose::HeldOutPoints, 1, 0);
                *count += usize::from(look(&world, &surface, crack, &mut random).is_some());
            }
        }
        assert!(counts[0] - counts[1] <= 8 && counts[1] > 100 && counts[2] < 30, "{counts:?}");
    }

    /// Surfaces away from the box of the probes are not judged, those that look into it from nearby are.
    #[test]
    fn a_box_bounds_what_is_judged() {
        let scene = load("cornell.glb");
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let (low, high) = scene.mesh.bounds().unwrap();
        let middle = (low + high) / 2.0;
        let half = (Vec3::new(low.x, low.y, low.z), Vec3::new(middle.x, high.y, high.z));
        let held_out = HeldOut::new(&world, Some(half), 0.5, 5);
        let reach = REACH * (half.1 - half.0).max_element();
        assert!(held_out.points.len() > POINTS / 4, "{}", held_out.points.len());
        assert!(held_out.points.iter().all(|(_, query)| query.position.x <= middle.x + reach));
    }
}

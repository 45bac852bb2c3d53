//! Where look-ups are asked that the probes are fitted to, in a fixed order.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::settings::{Kind, RowSettings};
use crate::light::World;
use crate::light::contact::{Contacts, Facet, sight_line};
use crate::light::sides::{Place, Sides};
use crate::light::surface::SurfacePoint;
use crate::math::random::{KroneckerSequence, Purpose, Random};
use crate::math::sampling::{cosine_hemisphere, uniform_sphere};
use crate::probe::lattice::ProbeIndex;
use crate::probe::place::air;
use crate::probe::query::{Answers, CornerWeights, QueryPoint, Visibility};
use crate::probe::store::surface::Facing;
use crate::trace::Ray;

/// A point that asks.
#[derive(Debug, Clone, Copy)]
pub struct Asked {
    pub kind: Kind,
    pub surface: SurfacePoint,
    pub query: QueryPoint,
    /// How it asks: by what is stored, in the air by rays.
    pub visibility: Visibility,
    /// Of its row.
    pub weight: f32,
    /// Whether there is a row. There is none where what is stored gives hidden probes more than [`MOST_HIDDEN`] of the weight
    /// or knows no probe at all: what leaks there would be fitted to the light of another room.
    pub is_fitted: bool,
    /// Whether it is kept from the fit, to judge it.
    pub is_held_out: bool,
}

/// Share of the weight that hidden probes may have where probes are fitted. The rows beyond it poison dark rooms: relative
/// error there 0.77 with them, 0.09 without.
const MOST_HIDDEN: f32 = 0.01;

/// One point in so many is held out.
pub const HELD_OUT: usize = 10;

/// Rounds in which points are looked for. Surfaces far beyond the grid may use up all points of one.
const ROUNDS: usize = 4;

/// How far beyond the probes' hull surfaces ask for light that the fit sees to, spacings: walls around a grid within a room.
const BEYOND: f32 = 1.0;

struct Task<'a, 's, A> {
    world: &'a World<'s>,
    look_up: &'a A,
    contacts: Contacts,
    /// Surfaces within it are fitted to.
    hull: (Vec3, Vec3),
}

/// All points, by kind. They do not depend on the seed, like the grid and the survey: between two bakes that differ by chance
/// only the light differs that arrives at them.
pub fn all(world: &World, look_up: &impl Answers, settings: &RowSettings) -> Vec<Asked> {
    let contacts = Contacts::of_points(world.scene, look_up.positions());
    let task = Task { world, look_up, contacts, hull: look_up.grid().hull(BEYOND) };
    let active = (0..look_up.positions().len() as u32).filter(|&probe| look_up.is_active(ProbeIndex(probe)));
    let [surface, bent, air] = settings.points(active.count());
    let mut asked = task.on_surfaces(Kind::Surface, surface, 1.0);
    asked.extend(task.on_surfaces(Kind::Bent, bent, settings.bent));
    asked.extend(task.in_air(air, settings.air));
    asked
}

impl<A: Answers> Task<'_, '_, A> {
    /// Points uniform by area on the sides of triangles that the scene shades: both of double-sided ones.
    fn on_surfaces(&self, kind: Kind, count: usize, weight: f32) -> Vec<Asked> {
        let Some(sides) = Sides::of(self.world.scene) else { return Vec::new() };
        let mut random = Random::new(0, Purpose::FitPoints, kind as u64, 0);
        let mut sequence = KroneckerSequence::new(&mut random);
        let mut found: Vec<Asked> = Vec::new();
        for round in 0..ROUNDS {
            if found.len() >= count {
                break;
            }
            let places: Vec<[u32; 4]> = sequence.by_ref().take(count).collect();
            let at = |(index, numbers): (usize, [u32; 4])| {
                let stream = (round * count + index) as u64;
                let mut random = Random::new(0, Purpose::FitPoints, kind as u64, 1 + stream);
                self.on_surface(kind, &sides.place(numbers), weight, &mut random)
            };
            found.par_extend(places.into_par_iter().enumerate().filter_map(at));
        }
        found.truncate(count);
        hold_out(&mut found);
        found
    }

    /// The point of a place; `None` where nothing is shaded, or no probe is in sight.
    fn on_surface(&self, kind: Kind, place: &Place, weight: f32, random: &mut Random) -> Option<Asked> {
        let (world, look_up) = (self.world, self.look_up);
        let surface = world.point_at(place);
        let (low, high) = self.hull;
        let is_within = surface.position.cmpge(low).all() && surface.position.cmple(high).all();
        if !is_within || !world.is_seen(place, &surface, || random.bits()) {
            return None;
        }
        let normal = match kind {
            Kind::Bent => surface.bent(Vec2::new(random.uniform(), random.uniform()))?,
            _ => surface.shading_normal,
        };
        let geometric = surface.geometric_normal;
        let view = cosine_hemisphere(geometric, Vec2::new(random.uniform(), random.uniform()));
        let facing = Facing::of(geometric);
        let query = QueryPoint { position: surface.position, normal, geometric, facing, view };
        let facet = Facet { position: surface.position, normal: geometric, offset: surface.ray_offset };
        let salt = random.bits();
        let sees = |probe: usize| {
            let line = sight_line(&facet, look_up.positions()[probe], self.contacts.of(probe));
            line.is_some_and(|(origin, target)| !world.tracer.occluded(Ray::segment(origin, target, salt)))
        };
        let weights = look_up.weights(&query, Visibility::Stored);
        let hidden = hidden_share(&weights, sees);
        // Where what is stored shows none, any of the eight may be in sight all the same.
        let is_seen = || {
            let corners = look_up.corners(&query);
            corners.into_iter().any(|probe| look_up.is_active(probe) && sees(probe.0 as usize))
        };
        if hidden.is_none_or(|hidden| hidden >= 1.0) && !is_seen() {
            return None;
        }
        // A look-up that knows no walls is fitted through them too.
        let most = if look_up.knows_walls() { MOST_HIDDEN } else { 1.0 };
        let is_fitted = hidden.is_some_and(|hidden| hidden <= most);
        let visibility = Visibility::Stored;
        Some(Asked { kind, surface, query, visibility, weight, is_fitted, is_held_out: false })
    }

    /// Points of the air that see a probe, which ask by what they see. Inside of solids no probe is in sight.
    fn in_air(&self, count: usize, weight: f32) -> Vec<Asked> {
        let (world, look_up) = (self.world, self.look_up);
        let (low, high) = air::bounds(world, look_up.grid());
        let at = |index: usize| {
            let mut random = Random::new(0, Purpose::FitPoints, Kind::Air as u64, 1 + index as u64);
            let share = Vec3::new(random.uniform(), random.uniform(), random.uniform());
            let position = low + (high - low) * share;
            let normal = uniform_sphere(Vec2::new(random.uniform(), random.uniform()));
            let query = QueryPoint { position, normal, geometric: normal, facing: Facing::of(normal), view: normal };
            let corners = look_up.corners(&query);
            let salt = random.bits();
            let mask = corners.into_iter().enumerate().fold(0u8, |mask, (i, probe)| {
                let contact = self.contacts.of(probe.0 as usize);
                let target = contact.map_or(look_up.positions()[probe.0 as usize], |contact| contact.target(position));
                let sees = || !world.tracer.occluded(Ray::segment(position, target, salt));
                mask | u8::from(look_up.is_active(probe) && sees()) << i
            });
            let visibility = Visibility::Exact(mask);
            let asks = look_up.weights(&query, visibility).total() > 0.0;
            let visibility = if look_up.knows_walls() { visibility } else { Visibility::Stored };
            let surface = SurfacePoint::in_space(position, normal);
            let kind = Kind::Air;
            asks.then_some(Asked { kind, surface, query, visibility, weight, is_fitted: true, is_held_out: false })
        };
        let mut found: Vec<Asked> = (0..count).into_par_iter().filter_map(at).collect();
        hold_out(&mut found);
        found
    }
}

/// Share of the weight of probes that are not seen; `None` where none has any.
fn hidden_share(weights: &CornerWeights, sees: impl Fn(usize) -> bool) -> Option<f32> {
    let total = weights.total();
    let of = |(probe, weight): (usize, f32)| if weight > 0.0 && !sees(probe) { weight } else { 0.0 };
    let probes = weights.probes.iter().map(|probe| probe.0 as usize).zip(weights.weights);
    (total > 0.0).then(|| probes.map(of).sum::<f32>() / total)
}

fn hold_out(asked: &mut [Asked]) {
    asked.iter_mut().step_by(HELD_OUT).for_each(|asked| asked.is_held_out = true);
}

/// A point that asks without any test of visibility, for tests.
#[cfg(test)]
pub fn asked_in_air(position: Vec3, normal: Vec3) -> Asked {
    let query = QueryPoint { position, normal, geometric: normal, facing: Facing::of(normal), view: normal };
    let (surface, visibility) = (SurfacePoint::in_space(position, normal), Visibility::Off);
    Asked { kind: Kind::Air, surface, query, visibility, weight: 1.0, is_fitted: true, is_held_out: false }
}

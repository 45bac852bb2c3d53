//! Points of free air within a volume and the scene's box, with normals in all directions: where an object asks that moves
//! through the scene.
//!
//! A point counts as inside geometry by the rule of the placement: where more than half of what rays around it meet are
//! backs of single-sided surfaces. Inside solids of double-sided surfaces nothing tells that, and points there count; so do
//! some in seams, where one solid runs into another and shows its fronts inside of it.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::point_truth::PointTruth;
use super::visibility_modes::VisibilityMode;
use crate::light::World;
use crate::light::contact::Contacts;
use crate::light::surface::SurfacePoint;
use crate::math::random::{Purpose, Random};
use crate::math::sampling::uniform_sphere;
use crate::probe::lattice::Grid;
use crate::probe::place::{SettleSettings, Settler, air};
use crate::probe::query::{Answers, QueryPoint};
use crate::probe::store::surface::Facing;
use crate::trace::Ray;

/// Points that are looked for. A share of them is known to 0.8 % (1/√(4·4096)) or better.
pub const POINTS: u32 = 4096;

/// Places tried for each point. Where nine tenths of the volume are solid, 1 point in 850 finds none.
const TRIES: u32 = 64;

/// Points of free air and which of their probes they see.
#[derive(Debug, Clone, Default)]
pub struct Air {
    /// They ask with their normal, seen from along it. In volumes that are nearly solid they are fewer than [`POINTS`].
    pub points: Arc<Vec<QueryPoint>>,
    /// Bit i: whether the segment to the probe of corner i is unblocked, and the probe active.
    pub masks: Vec<u8>,
}

impl Air {
    /// Looks for points and for what they see.
    pub fn new(world: &World, query: &impl Answers, seed: u64) -> Air {
        let points = Arc::new(points(world, query.grid(), seed));
        Air::of(world, query, points)
    }

    /// Of points that are known.
    pub fn of(world: &World, query: &impl Answers, points: Arc<Vec<QueryPoint>>) -> Air {
        let masks = masks(world, query, &points);
        Air { points, masks }
    }

    /// Irradiance from the probes at every point, W·m⁻².
    pub fn irradiance(&self, query: &impl Answers, mode: VisibilityMode) -> Vec<Vec3> {
        let asked = self.points.par_iter().zip(&self.masks);
        asked.map(|(point, &mask)| query.irradiance(point, mode.visibility(mask))).collect()
    }

    /// The truth at the points, see [`PointTruth::trace`].
    pub fn truth(&self, world: &World, spp: u32, seed: u64) -> PointTruth {
        let in_space = |point: &QueryPoint| (SurfacePoint::in_space(point.position, point.normal), *point);
        let points: Vec<(SurfacePoint, QueryPoint)> = self.points.iter().map(in_space).collect();
        PointTruth::trace(world, &points, Purpose::AirPaths, spp, seed)
    }
}

/// Points of free air. They depend on the scene, on the [`bounds`] and on the seed alone.
pub fn points(world: &World, grid: &Grid, seed: u64) -> Vec<QueryPoint> {
    (0..POINTS).into_par_iter().filter_map(|index| point(world, grid, seed, index)).collect()
}

/// The box of the points, see [`air::bounds`].
pub fn bounds(world: &World, grid: &Grid) -> (Vec3, Vec3) {
    air::bounds(world, grid)
}

/// The point of an index; `None` where all that is tried lies inside geometry.
fn point(world: &World, grid: &Grid, seed: u64, index: u32) -> Option<QueryPoint> {
    let (low, high) = bounds(world, grid);
    let settings = SettleSettings::default();
    let settler = Settler { world, grid, settings: &settings };
    let mut random = Random::new(seed, Purpose::Air, u64::from(index), 0);
    let mut place = || {
        let share = Vec3::new(random.uniform(), random.uniform(), random.uniform());
        let normal = uniform_sphere(Vec2::new(random.uniform(), random.uniform()));
        (low + (high - low) * share, normal)
    };
    let is_free = |(position, _): &(Vec3, Vec3)| !settler.is_inside(&settler.look(*position));
    let (position, normal) = (0..TRIES).map(|_| place()).find(is_free)?;
    Some(QueryPoint { position, normal, geometric: normal, facing: Facing::of(normal), view: normal })
}

/// Which probes of its cell each point sees. Nothing is in the way but the scene: the point lies on no surface.
fn masks(world: &World, query: &impl Answers, points: &[QueryPoint]) -> Vec<u8> {
    let contacts = Contacts::of_points(world.scene, query.positions());
    let mask = |(index, point): (usize, &QueryPoint)| {
        let corners = query.corners(point);
        corners.into_iter().enumerate().fold(0, |mask, (i, probe)| {
            let contact = contacts.of(probe.0 as usize);
            let target = contact.map_or(query.positions()[probe.0 as usize], |contact| contact.target(point.position));
            let sees = || !world.tracer.occluded(Ray::segment(point.position, target, index as u32));
            mask | u8::from(query.is_active(probe) && sees()) << i
        })
    };
    points.par_iter().enumerate().map(mask).collect()
}

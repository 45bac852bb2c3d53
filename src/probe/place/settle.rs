//! Moving a probe from its grid point to where it sees something.

use glam::Vec3;
use rayon::prelude::*;

use super::ddgi::{self, Relocated};
use super::placement::{Placement, PlacementTask};
use super::sampled::sampled_probes;
use super::settings::{PlacementRule, SettleSettings};
use crate::light::World;
use crate::light::contact::Contacts;
use crate::math::fibonacci;
use crate::probe::lattice::{Grid, ProbeIndex, ProbeState};
use crate::trace::Ray;

/// What the rays around a position meet.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings {
    rays: u64,
    hits: u64,
    backs: u64,
    /// Distance and direction of the nearest back, and of the nearest front.
    nearest_back: (f32, Vec3),
    nearest_front: (f32, Vec3),
}

impl Default for Surroundings {
    fn default() -> Self {
        let nothing = (f32::INFINITY, Vec3::ZERO);
        Surroundings { rays: 0, hits: 0, backs: 0, nearest_back: nothing, nearest_front: nothing }
    }
}

/// A probe on its way.
#[derive(Clone, Copy)]
struct Settled {
    state: ProbeState,
    position: Vec3,
    /// Rays of all positions tried.
    rays: u64,
    moved: bool,
}

/// Classifies every probe of the grid that a surface can sample, or that is to be kept anyway, and moves it where the rule
/// says so.
pub fn settle_all(world: &World, task: &PlacementTask) -> Placement {
    let PlacementTask { grid, settings, .. } = *task;
    let sampled = sampled_probes(grid, &world.scene.mesh, task.reach);
    let grid_points: Vec<Vec3> = grid.probes().map(|p| grid.grid_point(p)).collect();
    let contacts = Contacts::of_points(world.scene, &grid_points);
    let of_probe = |probe: usize| -> Settled {
        let position = grid_points[probe];
        let viewpoint = contacts.viewpoint(probe, position);
        if !sampled[probe] && !settings.keep_unsampled && !settings.rule.classifies() {
            return Settled { state: ProbeState::NeverSampled, position, rays: 0, moved: false };
        }
        match &settings.rule {
            PlacementRule::Settle(rule) => Settler { world, grid, settings: rule }.settle(position, viewpoint),
            PlacementRule::GridPoints => Settled { state: ProbeState::Active, position, rays: 0, moved: false },
            PlacementRule::Ddgi(rule) => {
                let cell = grid.spacing() * grid.width(ProbeIndex(probe as u32)) as f32;
                let Relocated { state, position, moved, rays } = ddgi::place(world, cell, rule, position);
                Settled { state, position, rays, moved }
            }
        }
    };
    let found: Vec<Settled> = (0..grid.probe_count()).into_par_iter().map(of_probe).collect();
    let active = || found.iter().zip(&sampled).filter(|(f, _)| f.state == ProbeState::Active);
    let mut placement = Placement {
        relocated: active().filter(|(f, _)| f.moved).count(),
        rays: found.iter().map(|f| f.rays).sum(),
        states: found.iter().map(|f| f.state).collect(),
        positions: grid_points,
        contacts,
        asked: sampled.clone(),
        sampled,
        survey: None,
        regions: None,
    };
    if found.iter().any(|f| f.moved) {
        placement.move_to(world.scene, found.iter().map(|f| f.position).enumerate());
    }
    placement
}

/// Classifies a probe and, where that helps, moves it.
pub struct Settler<'a, 's> {
    pub world: &'a World<'s>,
    pub grid: &'a Grid,
    pub settings: &'a SettleSettings,
}

impl Settler<'_, '_> {
    /// A length in spacings, metres.
    pub fn metres(&self, spacings: f32) -> f32 {
        spacings * self.grid.spacing_min()
    }

    /// What the rays around a position meet.
    pub fn look(&self, position: Vec3) -> Surroundings {
        let count = self.settings.rays as usize;
        let mut found = Surroundings { rays: count as u64, ..Default::default() };
        for i in 0..count {
            let direction = fibonacci::direction(i, count);
            let Some(surface) = self.world.surface(Ray::new(position, direction, i as u32)) else {
                continue;
            };
            found.hits += 1;
            let nearest = if surface.is_back() {
                found.backs += 1;
                &mut found.nearest_back
            } else {
                &mut found.nearest_front
            };
            if surface.hit.t < nearest.0 {
                *nearest = (surface.hit.t, direction);
            }
        }
        found
    }

    /// Whether more than `back_face_share` of what the rays met are backs: then the position lies inside something.
    pub fn is_inside(&self, around: &Surroundings) -> bool {
        around.backs as f32 > self.settings.back_face_share * around.hits as f32
    }

    /// Where a probe with these surroundings should rather be; `None` where it is well placed.
    fn better(&self, position: Vec3, around: &Surroundings) -> Option<Vec3> {
        let clearance = self.metres(self.settings.clearance);
        if self.is_inside(around) {
            // Through the nearest back face into the open.
            let (distance, direction) = around.nearest_back;
            return Some(position + direction * (distance + clearance));
        }
        let (distance, direction) = around.nearest_front;
        (distance < self.metres(self.settings.min_clearance)).then(|| position - direction * (clearance - distance))
    }

    /// State of the probe of a grid point, and the position that it settles at. `viewpoint` is where rays from the grid
    /// point start.
    fn settle(&self, grid_point: Vec3, viewpoint: Vec3) -> Settled {
        let first = self.look(viewpoint);
        let mut rays = first.rays;
        let (mut best, mut best_around, mut moved) = (grid_point, first, false);
        if self.settings.relocate {
            let (mut position, mut around) = (best, best_around);
            for _ in 0..self.settings.max_moves {
                let Some(next) = self.better(position, &around) else { break };
                // Where nothing is near, the distance to it is infinite.
                if !next.is_finite() || next.distance(grid_point) > self.metres(self.settings.max_move) {
                    break;
                }
                (position, around) = (next, self.look(next));
                rays += around.rays;
                // Into the open from inside, or away from a surface without getting inside another.
                let nearer = around.nearest_front.0 < best_around.nearest_front.0;
                if !self.is_inside(&around) && (self.is_inside(&best_around) || !nearer) {
                    (best, best_around, moved) = (position, around, true);
                }
            }
        }
        if self.is_inside(&best_around) {
            let state = ProbeState::InsideGeometry;
            return Settled { state, position: grid_point, rays, moved };
        }
        Settled { state: ProbeState::Active, position: best, rays, moved }
    }
}

//! Which probes are worth baking: not those inside geometry, nor those that no surface can ever sample.

pub mod need;
pub mod overlap;
pub mod survey;

use glam::{UVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::light::World;
use crate::math::fibonacci;
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::Grid;
use crate::probe::place::overlap::triangle_meets_box;
use crate::scene::{Mesh, TriangleIndex};
use crate::trace::Ray;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlacementSettings {
    /// Rays that decide about one probe.
    pub rays: u32,
    /// A probe counts as inside geometry (or outside the world) when more than this share of what its rays meet are
    /// backs of surfaces. Beside a sheet that has only a front nearly half of them are.
    pub back_face_share: f32,
    /// Move probes that are inside geometry, or touch it, into the open where it is near.
    pub relocate: bool,
    /// Bake probes that no surface can sample, for objects that move through the air.
    pub keep_unsampled: bool,
}

impl Default for PlacementSettings {
    fn default() -> Self {
        PlacementSettings { rays: 128, back_face_share: 0.5, relocate: true, keep_unsampled: false }
    }
}

/// What the placement rays found.
#[derive(Debug, Clone)]
pub struct Placement {
    pub states: Vec<ProbeState>,
    /// After relocation, relative to the scene's origin, metres.
    pub positions: Vec<Vec3>,
    /// Whether any surface lies in the probe's cells.
    pub sampled: Vec<bool>,
    /// Probes moved from their grid points.
    pub relocated: usize,
    /// Share of the active probes' rays that end on an emitting surface or in the sky.
    pub emitter_coverage: f32,
    pub rays: u64,
}

/// Classifies every probe of the grid. `reach` is how far from a surface, in spacings, it may look probes up.
pub fn place(world: &World, grid: &Grid, settings: &PlacementSettings, reach: f32) -> Placement {
    let sampled = sampled_probes(grid, &world.scene.mesh, reach);
    let settler = Settler { world, settings, spacing_m: grid.spacing.min_element() };
    let found: Vec<(ProbeState, Vec3, Surroundings)> = (0..grid.probe_count())
        .into_par_iter()
        .map(|probe| {
            let position = grid.origin + grid.position_in_grid(crate::probe::ProbeIndex(probe as u32));
            if sampled[probe] || settings.keep_unsampled {
                settler.settle(position)
            } else {
                (ProbeState::NeverSampled, position, Surroundings::default())
            }
        })
        .collect();
    let active = || found.iter().filter(|f| f.0 == ProbeState::Active);
    // Of those that matter only: keeping the others must not change how samples are divided.
    let counted = || found.iter().zip(&sampled).filter(|(f, sampled)| **sampled && f.0 == ProbeState::Active);
    let seen: u64 = counted().map(|(f, _)| f.2.rays).sum();
    let emitting: u64 = counted().map(|(f, _)| f.2.emitting).sum();
    Placement {
        relocated: active().filter(|f| f.2.relocated).count(),
        emitter_coverage: if seen > 0 { emitting as f32 / seen as f32 } else { 0.0 },
        rays: found.iter().map(|f| f.2.total_rays).sum(),
        states: found.iter().map(|f| f.0).collect(),
        positions: found.iter().map(|f| f.1).collect(),
        sampled,
    }
}

/// Farthest that a probe is moved from its grid point, in spacings: beyond half of one it would be nearer to a
/// neighbour's place than to its own.
const MAX_MOVE: f32 = 0.45;

/// Nearer to a surface than this, in spacings, a probe sees little but that surface and is moved away from it.
const MIN_CLEARANCE: f32 = 0.05;

/// How far beyond a surface a probe comes to lie, in spacings.
const CLEARANCE: f32 = 0.12;

/// Moves tried before a probe stays as it was.
const MAX_MOVES: usize = 4;

/// What the rays around a position meet.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings {
    rays: u64,
    hits: u64,
    backs: u64,
    emitting: u64,
    /// Distance and direction of the nearest back, and of the nearest front.
    nearest_back: (f32, Vec3),
    nearest_front: (f32, Vec3),
    /// Rays of all positions tried.
    total_rays: u64,
    relocated: bool,
}

impl Default for Surroundings {
    fn default() -> Self {
        let nothing = (f32::INFINITY, Vec3::ZERO);
        Surroundings {
            rays: 0,
            hits: 0,
            backs: 0,
            emitting: 0,
            nearest_back: nothing,
            nearest_front: nothing,
            total_rays: 0,
            relocated: false,
        }
    }
}

/// Classifies a probe and, where that helps, moves it.
pub struct Settler<'a, 's> {
    pub world: &'a World<'s>,
    pub settings: &'a PlacementSettings,
    /// Smallest spacing of the grid, metres.
    pub spacing_m: f32,
}

impl Settler<'_, '_> {
    /// What the rays around a position meet.
    pub fn look(&self, position: Vec3) -> Surroundings {
        let count = self.settings.rays as usize;
        let mut found = Surroundings { rays: count as u64, ..Default::default() };
        for i in 0..count {
            let direction = fibonacci::direction(i, count);
            let Some(surface) = self.world.surface(Ray::new(position, direction, i as u32)) else {
                found.emitting += u64::from(self.world.emitters.has_sky());
                continue;
            };
            found.hits += 1;
            found.emitting += u64::from(surface.emission != Vec3::ZERO);
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

    /// Whether so many of them are backs that the position lies inside something.
    pub fn is_inside(&self, around: &Surroundings) -> bool {
        around.backs as f32 > self.settings.back_face_share * around.hits as f32
    }

    /// Where a probe with these surroundings should rather be; `None` where it is well placed.
    fn better(&self, position: Vec3, around: &Surroundings) -> Option<Vec3> {
        if self.is_inside(around) {
            // Through the nearest back face into the open.
            let (distance, direction) = around.nearest_back;
            return Some(position + direction * (distance + CLEARANCE * self.spacing_m));
        }
        let (distance, direction) = around.nearest_front;
        let wanted = MIN_CLEARANCE * self.spacing_m;
        (distance < wanted).then(|| position - direction * (CLEARANCE * self.spacing_m - distance))
    }

    /// State of the probe of a grid point, and the position that it settles at.
    fn settle(&self, grid_point: Vec3) -> (ProbeState, Vec3, Surroundings) {
        let first = self.look(grid_point);
        let mut total_rays = first.rays;
        let mut best = (grid_point, first);
        if self.settings.relocate {
            let (mut position, mut around) = best;
            for _ in 0..MAX_MOVES {
                let Some(moved) = self.better(position, &around) else { break };
                // Of the nearest of nothing there is no distance, nor of what is infinitely far.
                let near = moved.is_finite() && moved.distance(grid_point) <= MAX_MOVE * self.spacing_m;
                if !near {
                    break;
                }
                (position, around) = (moved, self.look(moved));
                total_rays += around.rays;
                // Into the open from inside, or away from a surface without getting inside another.
                let nearer = around.nearest_front.0 < best.1.nearest_front.0;
                if !self.is_inside(&around) && (self.is_inside(&best.1) || !nearer) {
                    best = (position, Surroundings { relocated: true, ..around });
                }
            }
        }
        let (position, around) = best;
        let around = Surroundings { total_rays, ..around };
        if self.is_inside(&around) {
            (ProbeState::InsideGeometry, grid_point, around)
        } else {
            (ProbeState::Active, position, around)
        }
    }
}

/// Probes at a corner of any cell that a triangle comes within `reach` spacings of.
fn sampled_probes(grid: &Grid, mesh: &Mesh, reach: f32) -> Vec<bool> {
    let cells = grid.cells();
    let mut occupied = vec![false; grid.cell_count()];
    let half = Vec3::splat(0.5 + reach);
    for triangle in (0..mesh.triangles.len() as u32).map(TriangleIndex) {
        // In grid coordinates cells are unit boxes.
        let corners = mesh.corners(triangle).map(|p| grid.grid_from_scene(p));
        let low = corners[0].min(corners[1]).min(corners[2]) - reach;
        let high = corners[0].max(corners[1]).max(corners[2]) + reach;
        let last = cells - UVec3::ONE;
        // Points outside the grid use its nearest cell, so triangles outside occupy the cells at the rim.
        let (first, past) =
            (low.floor().max(Vec3::ZERO).as_uvec3().min(last), high.floor().max(Vec3::ZERO).as_uvec3().min(last));
        let beyond = low.cmplt(Vec3::ZERO).any() || high.cmpgt(cells.as_vec3()).any();
        for z in first.z..=past.z {
            for y in first.y..=past.y {
                for x in first.x..=past.x {
                    let base = UVec3::new(x, y, z);
                    let index = grid.cell_index(base);
                    if !occupied[index] {
                        let centre = base.as_vec3() + 0.5;
                        occupied[index] = beyond || triangle_meets_box(corners.map(|c| c - centre), half);
                    }
                }
            }
        }
    }
    let mut sampled = vec![false; grid.probe_count()];
    for z in 0..cells.z {
        for y in 0..cells.y {
            for x in 0..cells.x {
                let base = UVec3::new(x, y, z);
                if occupied[grid.cell_index(base)] {
                    for i in 0..8 {
                        sampled[grid.corner(base, i).0 as usize] = true;
                    }
                }
            }
        }
    }
    sampled
}

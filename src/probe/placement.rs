//! Which probes are worth baking: not those inside geometry, nor those that no surface can ever sample.

use glam::{UVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::grid::Grid;
use super::overlap::triangle_meets_box;
use crate::light::World;
use crate::math::fibonacci;
use crate::scene::{Mesh, TriangleIndex};
use crate::trace::Ray;

/// State of a probe, with the file's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum ProbeState {
    Active = 0,
    InsideGeometry = 1,
    NeverSampled = 2,
}

impl ProbeState {
    /// Inverse of `as u8`; `None` for numbers that no state has.
    pub fn from_u8(value: u8) -> Option<ProbeState> {
        [ProbeState::Active, ProbeState::InsideGeometry, ProbeState::NeverSampled]
            .into_iter()
            .find(|&state| state as u8 == value)
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlacementSettings {
    /// Rays that decide about one probe.
    pub rays: u32,
    /// A probe counts as inside geometry when more than this share of its rays meet the back of a surface.
    pub back_face_share: f32,
    /// Bake probes that no surface can sample, for objects that move through the air.
    pub keep_unsampled: bool,
}

impl Default for PlacementSettings {
    fn default() -> Self {
        PlacementSettings { rays: 128, back_face_share: 0.25, keep_unsampled: false }
    }
}

/// What the placement rays found.
#[derive(Debug, Clone)]
pub struct Placement {
    pub states: Vec<ProbeState>,
    /// Share of the active probes' rays that end on an emitting surface or in the sky.
    pub emitter_coverage: f32,
    pub rays: u64,
}

/// Classifies every probe of the grid. `reach` is how far from a surface, in spacings, it may look probes up.
pub fn place(world: &World, grid: &Grid, settings: &PlacementSettings, reach: f32) -> Placement {
    let sampled = if settings.keep_unsampled {
        vec![true; grid.probe_count()]
    } else {
        sampled_probes(grid, &world.scene.mesh, reach)
    };
    let rays = settings.rays.max(1) as usize;
    let found: Vec<(ProbeState, u64)> = (0..grid.probe_count())
        .into_par_iter()
        .map(|probe| {
            if !sampled[probe] {
                return (ProbeState::NeverSampled, 0);
            }
            let position = grid.origin + grid.position_in_grid(super::ProbeIndex(probe as u32));
            let (mut backs, mut emitting) = (0, 0);
            for i in 0..rays {
                let ray = Ray::new(position, fibonacci::direction(i, rays), i as u32);
                match world.surface(ray) {
                    Some(surface) => {
                        backs += u64::from(surface.is_back());
                        emitting += u64::from(surface.emission != Vec3::ZERO);
                    }
                    None => emitting += u64::from(world.emitters.has_sky()),
                }
            }
            if backs as f32 > settings.back_face_share * rays as f32 {
                (ProbeState::InsideGeometry, 0)
            } else {
                (ProbeState::Active, emitting)
            }
        })
        .collect();
    let active = found.iter().filter(|f| f.0 == ProbeState::Active).count();
    let emitting: u64 = found.iter().map(|f| f.1).sum();
    let traced = sampled.iter().filter(|&&s| s).count();
    Placement {
        states: found.into_iter().map(|f| f.0).collect(),
        emitter_coverage: if active > 0 { emitting as f32 / (active * rays) as f32 } else { 0.0 },
        rays: (traced * rays) as u64,
    }
}

/// Probes at a corner of any cell that a triangle comes within `reach` spacings of.
fn sampled_probes(grid: &Grid, mesh: &Mesh, reach: f32) -> Vec<bool> {
    let cells = grid.cells();
    let mut occupied = vec![false; cells.to_array().iter().map(|&n| n as usize).product()];
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

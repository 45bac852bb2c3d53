//! Probes go where surfaces need them.
//!
//! The survey of the surfaces ([`crate::probe::place::survey`]) tells which probes no surface sees — they lie below a
//! floor, behind a wall, in a cupboard — and which surfaces see no probe. Each such probe is moved next to such a
//! surface within its own cells; what still is not seen afterwards need not be baked. Surfaces that see none of their
//! eight probes even then are given one from the cells around.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::Vec3;
use rayon::prelude::*;

use super::placement::Placement;
use super::settings::SurveySettings;
use super::settle::Settler;
use super::survey::Survey;
use crate::light::World;
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::{CellIndex, Grid, ProbeIndex};
use crate::probe::store::surface::{Entry, SurfaceVisibility};
use crate::scene::Mesh;
use crate::trace::{Ray, Tracer};

/// A stretch of surface that sees no probe: a point off it, with nothing in between, and the direction that it faces.
#[derive(Debug, Clone, Copy)]
struct Need {
    point: Vec3,
    normal: Vec3,
}

/// Which probes any surface sees that `counts`, by its index in the table. Surfaces beyond the probes' hull are not
/// surveyed: where there are any, the probes at the rim count as seen.
pub fn seen_probes(
    mesh: &Mesh,
    grid: &Grid,
    placement: &Placement,
    table: &SurfaceVisibility,
    counts: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let rim = !grid.covers(mesh);
    let mut seen: Vec<bool> = grid.probes().map(|p| rim && grid.is_at_rim(p)).collect();
    for cell in grid.cells() {
        let union = table.entries(cell).filter(|e| counts(e.index)).fold(0, |union, entry| union | entry.mask);
        for (i, probe) in grid.corners(cell).iter().map(|probe| probe.0 as usize).enumerate() {
            seen[probe] |= union >> i & 1 == 1 && placement.states[probe] == ProbeState::Active;
        }
    }
    seen
}

/// Moves probes that nothing sees to surfaces that see none. Returns those that were moved: around them the survey is out of
/// date.
pub fn relocate(
    settler: &Settler,
    placement: &mut Placement,
    survey: &Survey,
    settings: &SurveySettings,
) -> Vec<usize> {
    let (grid, table) = (settler.grid, &survey.table);
    // A probe under the floor may see the floor's back; no one else does.
    let seen = seen_probes(&settler.world.scene.mesh, grid, placement, table, |entry| survey.fronts[entry]);
    let idle = |probe: usize| !seen[probe] && placement.sampled[probe];
    let needs_of_cell = |cell: u32| -> Vec<Need> {
        let cell = CellIndex(cell);
        if !grid.corners(cell).iter().any(|probe| idle(probe.0 as usize)) {
            return Vec::new();
        }
        let margin = settings.voxel_margin;
        let unseen = table.entries(cell).filter(|entry| entry.mask == 0);
        let unseen: Vec<Entry> = unseen.collect();
        unseen.par_iter().map(|entry| need(settler.world, grid, table, cell, entry, margin)).collect()
    };
    let needs: Vec<Vec<Need>> = (0..grid.cell_count() as u32).into_par_iter().map(needs_of_cell).collect();
    let moves: Vec<(usize, Vec3)> = (0..grid.probe_count())
        .into_par_iter()
        .filter(|&probe| idle(probe))
        .filter_map(|probe| {
            let index = ProbeIndex(probe as u32);
            let grid_point = grid.grid_point(index);
            let mut nearby: Vec<Need> =
                grid.cells_of(index).flat_map(|cell| needs[cell.0 as usize].iter().copied()).collect();
            nearby
                .sort_by(|a, b| a.point.distance_squared(grid_point).total_cmp(&b.point.distance_squared(grid_point)));
            // Spread over the whole list, so that one blocked corner does not use up all tries.
            let step = nearby.len().div_ceil(settler.settings.need_tries.max(1) as usize).max(1);
            let mut tried = nearby.iter().step_by(step).take(settler.settings.need_tries as usize);
            tried.find_map(|need| place_beside(settler, need)).map(|position| (probe, position))
        })
        .collect();
    moves.iter().for_each(|&(probe, _)| placement.states[probe] = ProbeState::Active);
    if !moves.is_empty() {
        placement.move_to(settler.world.scene, moves.iter().copied());
    }
    placement.relocated += moves.len();
    moves.into_iter().map(|(probe, _)| probe).collect()
}

/// Where the surface of an entry can be seen from; `margin` is that of the survey's voxels.
fn need(world: &World, grid: &Grid, table: &SurfaceVisibility, cell: CellIndex, entry: &Entry, margin: f32) -> Need {
    let (low, sides) = grid.cell_box(cell);
    let voxel_size = sides / table.voxels_per_cell as f32;
    let centre = low + (entry.voxel.as_vec3() + 0.5) * voxel_size;
    let normal = entry.facing;
    let depth = (voxel_size * normal).length();
    // The surface lies somewhere in the voxel; the voxel's face on the open side is off it, but another surface may lie in
    // that very face or before it, as a ceiling close above a lamp does. From behind, the first hit is the surface.
    let behind = centre - normal * depth * (0.5 + margin);
    let to_face = depth * (1.0 + margin);
    let open = match world.surface(Ray::new(behind, normal, 0)) {
        Some(surface) if surface.hit.t < to_face => {
            let off = surface.hit.t + surface.ray_offset;
            let free = world.tracer.closest(Ray::new(behind + normal * off, normal, 0)).map_or(f32::INFINITY, |h| h.t);
            (off + 0.5 * free).min(to_face)
        }
        // The line through the voxel's middle misses the surface.
        _ => to_face,
    };
    Need { point: behind + normal * open, normal }
}

/// For every entry that sees none of its eight probes and is in the open: the nearest active probe of the cells around that
/// it sees.
pub fn far_probes(
    world: &World,
    grid: &Grid,
    placement: &Placement,
    survey: &Survey,
    settings: &SurveySettings,
) -> Vec<(u32, u32)> {
    let of_cell = |cell: u32| -> Vec<(u32, u32)> {
        let cell = CellIndex(cell);
        let is_in_need = |entry: &Entry| entry.mask == 0 && survey.open[entry.index].is_some();
        let in_need: Vec<Entry> = survey.table.entries(cell).filter(is_in_need).collect();
        if in_need.is_empty() {
            return Vec::new();
        }
        let is_active = |probe: &ProbeIndex| placement.states[probe.0 as usize] == ProbeState::Active;
        let rings: Vec<Vec<ProbeIndex>> =
            (1..=settings.far_rings).map(|ring| grid.ring(cell, ring).filter(is_active).collect()).collect();
        let nearest = |entry: &Entry| {
            let need = need(world, grid, &survey.table, cell, entry, settings.voxel_margin);
            let seen = rings.iter().find_map(|ring| nearest_visible(&world.tracer, placement, ring, &need))?;
            Some((entry.index as u32, seen.0))
        };
        // Some cells have most of them: their entries are work for all threads.
        in_need.par_iter().filter_map(nearest).collect()
    };
    // Cells come in order, and so do a cell's entries: the list is sorted.
    (0..grid.cell_count() as u32).into_par_iter().flat_map_iter(of_cell).collect()
}

/// The nearest of some probes that a surface sees.
fn nearest_visible(tracer: &Tracer, placement: &Placement, probes: &[ProbeIndex], need: &Need) -> Option<ProbeIndex> {
    let position = |probe: ProbeIndex| placement.positions[probe.0 as usize];
    // Bits of numbers that are not negative are in their order.
    let distance = |probe: ProbeIndex| position(probe).distance_squared(need.point).to_bits();
    let before = probes.iter().copied().filter(|&p| (position(p) - need.point).dot(need.normal) > 0.0);
    let mut nearest: BinaryHeap<Reverse<(u32, ProbeIndex)>> = before.map(|p| Reverse((distance(p), p))).collect();
    let start =
        |p: ProbeIndex| placement.contacts.of(p.0 as usize).map_or(position(p), |contact| contact.target(need.point));
    std::iter::from_fn(|| nearest.pop())
        .map(|Reverse((_, probe))| probe)
        .find(|&p| !tracer.occluded(Ray::segment(start(p), need.point, 0)))
}

/// A place from which the surface can be seen; `None` where its surroundings are the inside of something.
fn place_beside(settler: &Settler, need: &Need) -> Option<Vec3> {
    let wanted = settler.metres(settler.settings.need_distance);
    let free = settler.world.tracer.closest(Ray::new(need.point, need.normal, 0)).map_or(f32::INFINITY, |hit| hit.t);
    let position = need.point + need.normal * wanted.min(0.5 * free);
    (!settler.is_inside(&settler.look(position))).then_some(position)
}

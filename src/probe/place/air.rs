//! Where things may move through a scene, and what they see there.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::placement::Placement;
use super::survey::Survey;
use crate::light::World;
use crate::probe::lattice::Grid;
use crate::probe::lattice::grid::{CellIndex, ProbeIndex, block};
use crate::probe::store::regions::{CellAir, Rank, air_places, middle};
use crate::probe::store::surface::{Entry, Facing, SurfaceVisibility, active_corners, key, voxel_of, voxel_of_key};
use crate::trace::Ray;

/// The box of free air, relative to the scene's origin: that of the scene as far as the probes' hull covers it. What the
/// hull has beyond is no air that anything moves through, and grids that cover the scene have the same box. Along axes
/// in which the scene is thin, as a floor is, the hull counts: things move above it and not in it.
pub fn bounds(world: &World, grid: &Grid) -> (Vec3, Vec3) {
    /// Spacings.
    const THIN: f32 = 0.5;
    let hull = grid.hull(0.0);
    let scene = world.scene.mesh.bounds().unwrap_or(hull);
    let (mut low, mut high) = (hull.0.max(scene.0), hull.1.min(scene.1));
    for axis in 0..3 {
        if high[axis] - low[axis] <= THIN * grid.spacing_max() {
            (low[axis], high[axis]) = (hull.0[axis], hull.1[axis]);
        }
    }
    (low, high)
}

/// Places that one which sees no probe looks for. 64: `air.black` and the errors as they are, in cornell, office and bathroom.
const NEAREST: usize = 16;

/// What places in the air see of one cell's probes.
struct Eye<'a, 's> {
    world: &'a World<'s>,
    placement: &'a Placement,
    probes: [ProbeIndex; 8],
    /// Those that are baked, a bit each.
    active: u8,
}

impl<'a, 's> Eye<'a, 's> {
    fn of(world: &'a World<'s>, grid: &Grid, placement: &'a Placement, cell: CellIndex) -> Self {
        let active = active_corners(grid, &placement.states, cell);
        Eye { world, placement, probes: grid.corners(cell), active }
    }

    /// Bit i: whether corner i is seen from a place.
    fn mask(&self, place: Vec3) -> u8 {
        let sees = |corner: usize| {
            let probe = self.probes[corner].0 as usize;
            let position = self.placement.positions[probe];
            let start = self.placement.contacts.of(probe).map_or(position, |contact| contact.target(place));
            self.active >> corner & 1 == 1 && !self.world.tracer.occluded(Ray::segment(start, place, 0))
        };
        (0..8).fold(0, |mask, corner| mask | u8::from(sees(corner)) << corner)
    }

    /// Rays of a mask.
    fn rays(&self) -> u64 {
        u64::from(self.active.count_ones())
    }
}

/// Which of their cell's probes places in the air see, for each cell that has surfaces, and the rays that told.
pub fn seen(world: &World, grid: &Grid, placement: &Placement, table: &SurfaceVisibility) -> (Vec<CellAir>, u64) {
    let of_cell = |cell: u32| {
        let cell = CellIndex(cell);
        let eye = Eye::of(world, grid, placement, cell);
        if table.range(cell).is_empty() || eye.active == 0 {
            return (CellAir::default(), 0);
        }
        let (low, sides) = grid.cell_box(cell);
        let at: Vec<Vec3> = air_places(table.voxels_per_cell).map(|place| low + place * sides).collect();
        let seen: Vec<u8> = at.iter().map(|&place| eye.mask(place)).collect();
        let mut rays = seen.len() as u64 * eye.rays();
        // A place that sees no probe takes what the nearest sees that it can see itself: things there may peep out at both.
        let masks = (0..seen.len()).map(|i| match seen[i] {
            0 => of_nearest(world, &at, &seen, at[i], &mut rays),
            mask => mask,
        });
        (CellAir { masks: masks.collect(), further: Vec::new() }, rays)
    };
    let found: Vec<(CellAir, u64)> = (0..grid.cell_count() as u32).into_par_iter().map(of_cell).collect();
    let rays = found.iter().map(|(_, rays)| rays).sum();
    (found.into_iter().map(|(air, _)| air).collect(), rays)
}

/// Adds what the air sees around surfaces that stay dark, in the voxels next to theirs: it is not to be as dark as they are.
/// Returns the rays that told.
pub fn look_beside_dark(
    world: &World,
    grid: &Grid,
    placement: &Placement,
    survey: &Survey,
    seen: &mut [CellAir],
) -> u64 {
    let (table, ranks) = (&survey.table, survey.ranks());
    let (n, last) = (table.voxels_per_cell, UVec3::splat(table.voxels_per_cell - 1));
    let is_dark =
        |entry: &Entry| entry.mask == 0 && ranks[entry.index] == Rank::Own && table.far_probe(entry.index).is_none();
    // These voxels have been asked.
    let known: Vec<UVec3> = air_places(n).map(|place| voxel_of(place, n)).collect();
    let of_cell = |(cell, air): (usize, &mut CellAir)| {
        let cell = CellIndex(cell as u32);
        let around = |entry: Entry| block(entry.voxel.saturating_sub(UVec3::ONE), (entry.voxel + 1).min(last));
        let dark = table.entries(cell).filter(is_dark);
        let voxels = dark.flat_map(around).filter(|voxel| !known.contains(voxel));
        let mut keys: Vec<u16> = voxels.map(|voxel| key(voxel, Facing::ALL[0], n)).collect();
        keys.sort_unstable();
        keys.dedup();
        let (eye, (low, sides)) = (Eye::of(world, grid, placement, cell), grid.cell_box(cell));
        air.further.extend(keys.iter().map(|&key| (key, eye.mask(low + middle(voxel_of_key(key, n), n) * sides))));
        keys.len() as u64 * eye.rays()
    };
    seen.par_iter_mut().enumerate().map(of_cell).sum()
}

/// What the nearest place sees that sees any probe and is seen from a point; 0 without one.
pub fn of_nearest(world: &World, places: &[Vec3], seen: &[u8], point: Vec3, rays: &mut u64) -> u8 {
    let mut others: Vec<usize> = (0..seen.len()).filter(|&place| seen[place] != 0).collect();
    let by_distance = |a: &usize, b: &usize| {
        places[*a].distance_squared(point).total_cmp(&places[*b].distance_squared(point)).then(a.cmp(b))
    };
    if others.len() > NEAREST {
        others.select_nth_unstable_by(NEAREST - 1, by_distance);
        others.truncate(NEAREST);
    }
    others.sort_unstable_by(by_distance);
    let mut sees = |&&place: &&usize| {
        *rays += 1;
        !world.tracer.occluded(Ray::segment(point, places[place], 0))
    };
    others.iter().find(&mut sees).map_or(0, |&place| seen[place])
}

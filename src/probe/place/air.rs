//! Where things may move through a scene, and what they see there.

use glam::Vec3;
use rayon::prelude::*;

use super::placement::Placement;
use crate::light::World;
use crate::probe::lattice::Grid;
use crate::probe::lattice::grid::CellIndex;
use crate::probe::store::regions::air_places;
use crate::probe::store::surface::{SurfaceVisibility, active_corners};
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

/// Which of their cell's probes places in the air see, for each cell that has surfaces, and the rays that told.
pub fn seen(world: &World, grid: &Grid, placement: &Placement, table: &SurfaceVisibility) -> (Vec<Vec<u8>>, u64) {
    let of_cell = |cell: u32| {
        let cell = CellIndex(cell);
        let active = active_corners(grid, &placement.states, cell);
        if table.range(cell).is_empty() || active == 0 {
            return (Vec::new(), 0);
        }
        let ((low, sides), probes) = (grid.cell_box(cell), grid.corners(cell));
        let sees = |place: Vec3, corner: usize| {
            let (probe, place) = (probes[corner].0 as usize, low + place * sides);
            let position = placement.positions[probe];
            let start = placement.contacts.of(probe).map_or(position, |contact| contact.target(place));
            active >> corner & 1 == 1 && !world.tracer.occluded(Ray::segment(start, place, 0))
        };
        let mask = |place| (0..8).fold(0, |mask, corner| mask | u8::from(sees(place, corner)) << corner);
        let places: Vec<Vec3> = air_places(table.voxels_per_cell).collect();
        let seen: Vec<u8> = places.iter().map(|&place| mask(place)).collect();
        let mut rays = seen.len() as u64 * u64::from(active.count_ones());
        // A place that sees no probe takes what the nearest sees that it can see itself: things there may peep out at both.
        let at: Vec<Vec3> = places.iter().map(|place| low + place * sides).collect();
        let masks = (0..seen.len()).map(|i| match seen[i] {
            0 => of_nearest(world, &at, &seen, at[i], &mut rays),
            mask => mask,
        });
        (masks.collect::<Vec<u8>>(), rays)
    };
    let found: Vec<(Vec<u8>, u64)> = (0..grid.cell_count() as u32).into_par_iter().map(of_cell).collect();
    let rays = found.iter().map(|(_, rays)| rays).sum();
    (found.into_iter().map(|(masks, _)| masks).collect(), rays)
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

//! Surfaces that see no probe — in a slit, behind a drawer — and are in the open all the same: light comes to them from
//! what they see, and so they are lent what that sees of the probes.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::air::of_nearest;
use super::survey::Survey;
use crate::light::World;
use crate::math::random::{KroneckerSequence, Purpose, Random, unit_from_bits};
use crate::math::sampling::cosine_hemisphere;
use crate::probe::lattice::Grid;
use crate::probe::lattice::grid::CellIndex;
use crate::probe::store::regions::air_places;
use crate::probe::store::surface::{Entry, Facing, SurfaceVisibility, key, voxel_of};
use crate::trace::Ray;

/// Times that surfaces are lent by others, which may have been lent theirs before.
const ROUNDS: u32 = 2;

/// Directions that light may come from to a surface.
const DIRECTIONS: usize = 32;

/// Gives entries that see no probe, neither of their cell nor around it, the mask of the nearest place in the air that they see,
/// or else of a surface. What sees only such as see nothing stays dark: a sealed box without a probe. `seen` is what the
/// [`air_places`] of each cell see. Returns the rays that told.
pub fn lend(world: &World, grid: &Grid, survey: &mut Survey, seen: &[Vec<u8>]) -> u64 {
    let mut rays = 0;
    for round in 0..=ROUNDS {
        let table = &survey.table;
        let of_cell = |cell: u32| -> (Vec<(usize, u8)>, u64) {
            let cell = CellIndex(cell);
            let open = |entry: Entry| {
                let is_blind = entry.mask == 0 && table.far_probe(entry.index).is_none();
                survey.open[entry.index].filter(|_| is_blind).map(|point| (entry, point))
            };
            let blind: Vec<(Entry, Vec3)> = table.entries(cell).filter_map(open).collect();
            if blind.is_empty() {
                return (Vec::new(), 0);
            }
            let seen = &seen[cell.0 as usize];
            let (low, sides) = grid.cell_box(cell);
            let places: Vec<Vec3> =
                air_places(table.voxels_per_cell).take(seen.len()).map(|place| low + place * sides).collect();
            let mut rays = 0;
            let mask = |(entry, point): (Entry, Vec3)| match round {
                0 => (entry.index, of_nearest(world, &places, seen, point, &mut rays)),
                _ => (entry.index, of_surface(world, grid, table, cell, &entry, point, &mut rays)),
            };
            (blind.into_iter().map(mask).collect(), rays)
        };
        let found: Vec<_> = (0..grid.cell_count() as u32).into_par_iter().map(of_cell).collect();
        for (lent, of_cell) in found {
            rays += of_cell;
            lent.into_iter().for_each(|(entry, mask)| survey.table.masks[entry] = mask);
        }
    }
    rays
}

/// What a surface of the same cell sees that is seen from a point off an entry's; 0 where none is that sees any probe.
fn of_surface(
    world: &World,
    grid: &Grid,
    table: &SurfaceVisibility,
    cell: CellIndex,
    entry: &Entry,
    point: Vec3,
    rays: &mut u64,
) -> u8 {
    /// Streams of the survey's own points.
    const TIERS: u64 = 3;
    let n = table.voxels_per_cell;
    let range = table.range(cell);
    let keys = &table.keys[range.clone()];
    let stream = u64::from(cell.0) << 16 | u64::from(table.keys[entry.index]);
    let mut random = Random::new(0, Purpose::SurfaceVisibility, stream, TIERS);
    let directions = KroneckerSequence::new(&mut random).take(DIRECTIONS);
    let mut masks = directions.map(|[x, y, _, salt]| {
        *rays += 1;
        let direction = cosine_hemisphere(entry.facing, Vec2::new(unit_from_bits(x), unit_from_bits(y)));
        let met = world.surface(Ray::new(point, direction, salt)).filter(|met| !met.is_back())?;
        let place = grid.cell_from_scene(cell, met.position);
        let is_inside = place.cmpge(Vec3::ZERO).all() && place.cmple(Vec3::ONE).all();
        let key = key(voxel_of(place.max(Vec3::ZERO), n), Facing::of(met.geometric_normal), n);
        let found = keys.binary_search(&key).ok().filter(|_| is_inside)?;
        Some(table.masks[range.start + found]).filter(|mask| *mask != 0)
    });
    masks.find_map(|mask| mask).unwrap_or(0)
}

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
use crate::probe::store::regions::{CellAir, air_places};
use crate::probe::store::surface::{Entry, Facing, SurfaceVisibility, key, voxel_of};
use crate::trace::Ray;

/// Times that surfaces are lent by others, which may have been lent theirs before.
const ROUNDS: u32 = 2;

/// Directions that light may come from to a surface.
const DIRECTIONS: usize = 32;

/// An entry that sees no probe, with a point off it in the open, and what it sees instead.
struct Blind {
    entry: Entry,
    point: Vec3,
    /// What it is lent; 0 where that is nothing.
    mask: u8,
    /// Entries that it sees, in the order in which they are asked.
    seen: Vec<usize>,
}

/// Gives entries that see no probe, neither of their cell nor around it, the mask of the nearest place in the air that they see,
/// or else of a surface. What sees only such as see nothing stays dark: a sealed box without a probe. `seen` is what the air
/// of each cell sees. Returns the rays that told.
pub fn lend(world: &World, grid: &Grid, survey: &mut Survey, seen: &[CellAir]) -> u64 {
    let table = &survey.table;
    let cells: Vec<(CellIndex, Vec<Blind>)> = grid.cells().map(|cell| (cell, blind_entries(survey, cell))).collect();
    let mut cells: Vec<_> = cells.into_iter().filter(|(_, blind)| !blind.is_empty()).collect();
    let of_air = |(cell, blind): &mut (CellIndex, Vec<Blind>)| {
        let seen = &seen[cell.0 as usize].masks;
        let (low, sides) = grid.cell_box(*cell);
        let places: Vec<Vec3> =
            air_places(table.voxels_per_cell).take(seen.len()).map(|place| low + place * sides).collect();
        let mut rays = 0;
        blind.iter_mut().for_each(|blind| blind.mask = of_nearest(world, &places, seen, blind.point, &mut rays));
        rays
    };
    let mut rays: u64 = cells.par_iter_mut().map(of_air).sum();
    give(survey, cells.iter().flat_map(|(_, blind)| blind));
    let table = &survey.table;
    let of_surfaces = |(cell, blind): &mut (CellIndex, Vec<Blind>)| -> u64 {
        blind.retain(|blind| blind.mask == 0);
        blind.iter_mut().map(|blind| blind.look_around(world, grid, table, *cell)).sum()
    };
    rays += cells.par_iter_mut().map(of_surfaces).sum::<u64>();
    for _ in 0..ROUNDS {
        let masks = &survey.table.masks;
        let of_seen = |(_, blind): &mut (CellIndex, Vec<Blind>)| {
            blind.retain(|blind| blind.mask == 0);
            for blind in blind {
                blind.mask = blind.seen.iter().map(|entry| masks[*entry]).find(|mask| *mask != 0).unwrap_or(0);
            }
        };
        cells.par_iter_mut().for_each(of_seen);
        give(survey, cells.iter().flat_map(|(_, blind)| blind));
    }
    rays
}

/// Those of a cell that are in the open.
fn blind_entries(survey: &Survey, cell: CellIndex) -> Vec<Blind> {
    let table = &survey.table;
    let blind = |entry: Entry| {
        let is_blind = entry.mask == 0 && table.far_probe(entry.index).is_none();
        let point = survey.open[entry.index].filter(|_| is_blind)?;
        Some(Blind { entry, point, mask: 0, seen: Vec::new() })
    };
    table.entries(cell).filter_map(blind).collect()
}

fn give<'b>(survey: &mut Survey, blind: impl Iterator<Item = &'b Blind>) {
    blind.for_each(|blind| survey.table.masks[blind.entry.index] = blind.mask);
}

impl Blind {
    /// Finds the surfaces of its cell that it sees, up to the first that sees a probe. Returns its rays.
    fn look_around(&mut self, world: &World, grid: &Grid, table: &SurfaceVisibility, cell: CellIndex) -> u64 {
        /// Streams of the survey's own points.
        const TIERS: u64 = 3;
        let n = table.voxels_per_cell;
        let range = table.range(cell);
        let keys = &table.keys[range.clone()];
        let stream = u64::from(cell.0) << 16 | u64::from(table.keys[self.entry.index]);
        let mut random = Random::new(0, Purpose::SurfaceVisibility, stream, TIERS);
        let mut rays = 0;
        for [x, y, _, salt] in KroneckerSequence::new(&mut random).take(DIRECTIONS) {
            rays += 1;
            let direction = cosine_hemisphere(self.entry.facing, Vec2::new(unit_from_bits(x), unit_from_bits(y)));
            let Some(met) = world.surface(Ray::new(self.point, direction, salt)).filter(|met| !met.is_back()) else {
                continue;
            };
            let place = grid.cell_from_scene(cell, met.position);
            let is_inside = place.cmpge(Vec3::ZERO).all() && place.cmple(Vec3::ONE).all();
            let key = key(voxel_of(place.max(Vec3::ZERO), n), Facing::of(met.geometric_normal), n);
            let Some(found) = keys.binary_search(&key).ok().filter(|_| is_inside) else { continue };
            let found = range.start + found;
            if !self.seen.contains(&found) {
                self.seen.push(found);
            }
            if table.masks[found] != 0 {
                break;
            }
        }
        rays
    }
}

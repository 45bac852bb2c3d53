//! Pieces of a grid that stand for the whole.

use glam::UVec3;

use crate::bake::circumstances::{BakeError, Circumstances};
use crate::bake::prepared::{Prepared, prepare_on};
use crate::config::Config;
use crate::light::World;
use crate::probe::Grid;
use crate::system::processor::processor_seconds;

/// A grid of no more cells is looked at as a whole.
pub const FEW_CELLS: usize = 48;
/// One cell in so many is looked at; the rest of a dry run takes less than they.
const CELLS_SHARE: usize = 40;
/// Fewer cells would say little of the others, and more would tell nothing new: a cell's time deviates from the mean by about
/// as much as the mean is.
const CELLS: (usize, usize) = (12, 100);

/// Part of a grid that is looked at.
pub struct Part<'w, 's> {
    pub prepared: Prepared<'w, 's>,
    /// Probes whose state is that of the whole grid's.
    pub judged: Vec<usize>,
    /// Of the processor, that placing and surveying took.
    pub seconds: f64,
}

impl Part<'_, '_> {
    pub fn cells(&self) -> usize {
        (self.prepared.grid.divisions().max(UVec3::splat(2)) - 1).element_product() as usize
    }
}

/// Places and surveys one part.
pub fn part<'w, 's>(
    world: &'w World<'s>,
    config: &'w Config,
    circumstances: &Circumstances,
    grid: Grid,
) -> Result<Part<'w, 's>, BakeError> {
    let started = processor_seconds();
    let prepared = prepare_on(world, config, circumstances, grid)?;
    let judged = (0..prepared.grid.probe_count()).collect();
    Ok(Part { prepared, judged, seconds: processor_seconds() - started })
}

/// Seconds of the processor for a part that lies far away from everything.
pub fn scan(world: &World, config: &Config, circumstances: &Circumstances, grid: &Grid) -> Result<f64, BakeError> {
    let size = grid.divisions()
        + world.scene.mesh.bounds().map_or(UVec3::ZERO, |(low, high)| ((high - low) / grid.spacing()).as_uvec3());
    // Far, and still a number of cells.
    let away = size.min(UVec3::splat(1 << 20)) * 4;
    let far = grid.part(away, UVec3::splat(2).min(grid.divisions()));
    Ok(part(world, config, circumstances, far)?.seconds)
}

/// Cells that are spread evenly over the grid, or small blocks of them where a probe's state depends on all cells around it.
pub fn some_parts<'w, 's>(
    world: &'w World<'s>,
    config: &'w Config,
    circumstances: &Circumstances,
    (grid, cells): (&Grid, UVec3),
) -> Result<Vec<Part<'w, 's>>, BakeError> {
    /// The golden ratio's fraction: its multiples are spread evenly, however many there are.
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let keeps = config.placement.keep_unsampled || config.plan.keeps("unused_probes");
    let side = UVec3::splat(if keeps { 1 } else { 2 }).min(cells);
    let count = cells.as_u64vec3().element_product() as usize;
    let wanted = (count / CELLS_SHARE).clamp(CELLS.0, CELLS.1) / side.element_product() as usize;
    let places = cells - side + 1;
    let all = places.as_u64vec3().element_product();
    let of = |i: usize| {
        let place = ((i as f64 + 0.5) * GOLDEN).fract() * all as f64;
        let place = (place as u64).min(all - 1);
        let [nx, ny] = [places.x, places.y].map(u64::from);
        let first = UVec3::new((place % nx) as u32, (place / nx % ny) as u32, (place / (nx * ny)) as u32);
        let points = (side + 1).min(grid.divisions());
        let mut part = part(world, config, circumstances, grid.part(first, points))?;
        if !keeps {
            // Only the one in the middle has all its cells.
            let middle = (points - 1) / 2;
            part.judged = vec![(middle.x + points.x * (middle.y + points.y * middle.z)) as usize];
        }
        Ok(part)
    };
    (0..wanted.max(4)).map(of).collect()
}

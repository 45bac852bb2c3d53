//! Which probes a surface can sample at all: the corners of cells that a triangle comes near.

use glam::Vec3;

use super::overlap::triangle_meets_box;
use crate::probe::lattice::Grid;
use crate::scene::{Mesh, TriangleIndex};

/// Probes at a corner of any cell that a triangle comes within `reach` cells of.
pub fn sampled_probes(grid: &Grid, mesh: &Mesh, reach: f32) -> Vec<bool> {
    let mut occupied = vec![false; grid.cell_count()];
    let half = Vec3::splat(0.5 + reach);
    for triangle in (0..mesh.triangles.len() as u32).map(TriangleIndex) {
        let corners = mesh.corners(triangle);
        let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        // Points outside the grid use its nearest cell, so triangles outside occupy the cells at the rim.
        let (_, beyond) = grid.is_beyond(low, high, reach);
        for cell in grid.cells_near(low, high, reach) {
            let occupied = &mut occupied[cell.0 as usize];
            // In units of the cell, around its middle.
            *occupied =
                *occupied || beyond || triangle_meets_box(corners.map(|c| grid.cell_from_scene(cell, c) - 0.5), half);
        }
    }
    let mut sampled = vec![false; grid.probe_count()];
    for cell in grid.cells().filter(|cell| occupied[cell.0 as usize]) {
        grid.corners(cell).iter().for_each(|probe| sampled[probe.0 as usize] = true);
    }
    sampled
}

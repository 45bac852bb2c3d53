//! The survey that fills a [`SurfaceVisibility`]: rays from points of every surface to the eight probes of its cell.
//!
//! A glance at every voxel comes first. Where it sees otherwise than the voxels around, more points are asked: shadows have edges
//! in few voxels, and most others say what their neighbours say.
//!
//! It depends on the scene, the grid and the probes alone, not on the seed: what a bake knows of visibility is as fixed as its
//! grid, and two bakes that differ by chance do not differ in it.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::look::{Depth, Found, Look, looks};
use super::placement::Placement;
use super::surveyor::{Met, Surveyor};
use crate::probe::lattice::grid::{Grid, ProbeIndex, block};
use crate::probe::store::regions::Rank;
use crate::probe::store::surface::{Facing, SurfaceVisibility, key, voxel_of_key};
use crate::scene::{Mesh, TriangleIndex};

/// Memory that a survey takes at most: one [`Met`] for each triangle in each voxel that it meets, twice while they are
/// collected, and then one look of each. A triangle meets as many voxels as its area covers, those along its edges, and one.
pub fn estimated_bytes(mesh: &Mesh, grid: &Grid, voxels_per_cell: u32) -> u64 {
    /// A tilted plane passes through more voxels than its area has faces, √3 times as many at most.
    const TILT: f64 = 1.733;
    let voxel_m = f64::from(grid.spacing_min()) / f64::from(voxels_per_cell);
    let (low, high) = grid.hull(0.0);
    let voxels = |t: u32| {
        let corners = mesh.corners(TriangleIndex(t));
        // The part of its box that lies in the grid: large triangles are many voxels, and may reach far beyond it.
        let box_low = corners[0].min(corners[1]).min(corners[2]);
        let box_high = corners[0].max(corners[1]).max(corners[2]);
        let inside = (box_high.min(high) - box_low.max(low)).max(Vec3::ZERO).as_dvec3() / voxel_m + 1.0;
        let faces = inside.x * inside.y + inside.y * inside.z + inside.z * inside.x;
        let area = f64::from(mesh.area(TriangleIndex(t))) / (voxel_m * voxel_m);
        let edges = (box_high - box_low).as_dvec3().length() / voxel_m;
        (TILT * area + 2.0 * edges + 1.0).min(faces)
    };
    let total: f64 = (0..mesh.triangles.len() as u32).into_par_iter().map(voxels).sum();
    (total * (size_of::<Met>() + size_of::<Met>().max(size_of::<Look>() + size_of::<Found>())) as f64) as u64
}

/// A table with what is known beside it while baking.
#[derive(Debug, Clone)]
pub struct Survey {
    pub table: SurfaceVisibility,
    /// Per entry: whether the front of a surface, or a surface that has no back, faces there.
    pub fronts: Vec<bool>,
    /// Per entry that sees no probe: a point just off it from which light may come; `None` where it lies inside of a solid or in
    /// a crack, as far as its points tell.
    pub open: Vec<Option<Vec3>>,
    pub rays: u64,
}

impl Survey {
    /// Of each entry.
    pub fn ranks(&self) -> Vec<Rank> {
        let rank = |(mask, open): (&u8, &Option<Vec3>)| match (mask, open) {
            (0, None) => Rank::Buried,
            (1.., Some(_)) => Rank::Lent,
            _ => Rank::Own,
        };
        self.table.masks.iter().zip(&self.open).map(rank).collect()
    }
}

impl Surveyor<'_, '_> {
    /// What surfaces see of these probes. Of the cells around none of the `moved` probes, what an earlier survey found.
    pub fn survey(&self, placement: &Placement, earlier: Option<(&Survey, &[usize])>) -> Survey {
        let mut stale = vec![earlier.is_none(); self.grid.cell_count()];
        for &probe in earlier.iter().flat_map(|(_, moved)| *moved) {
            self.grid.cells_of(ProbeIndex(probe as u32)).for_each(|cell| stale[cell.0 as usize] = true);
        }
        let groups: Vec<&[Met]> = self
            .met
            .chunk_by(|a, b| (a.cell, a.voxel_key) == (b.cell, b.voxel_key))
            .filter(|group| stale[group[0].cell.0 as usize])
            .collect();
        let looks: Vec<Look> = groups.into_par_iter().flat_map_iter(|group| looks(self, placement, group)).collect();
        let mut found: Vec<Found> = looks.par_iter().map(|look| look.look(Depth::Glance)).collect();
        let depths = self.depths(&found);
        found.par_iter_mut().zip(&looks).zip(depths).for_each(|((found, look), depth)| {
            if depth != Depth::Glance {
                let anew = look.look(depth);
                *found = Found { rays: found.rays + anew.rays, ..anew };
            }
        });
        let mut table = SurfaceVisibility { voxels_per_cell: self.n, ..Default::default() };
        let (mut fronts, mut open) = (Vec::new(), Vec::new());
        let mut anew = found.iter().filter(|found| found.asks).peekable();
        for cell in self.grid.cells() {
            table.cell_start.push(table.keys.len() as u32);
            if let (Some((known, _)), false) = (earlier, stale[cell.0 as usize]) {
                let range = known.table.range(cell);
                table.keys.extend(&known.table.keys[range.clone()]);
                table.masks.extend(&known.table.masks[range.clone()]);
                fronts.extend(&known.fronts[range.clone()]);
                open.extend(&known.open[range]);
            }
            while let Some(found) = anew.next_if(|found| found.cell == cell) {
                table.keys.push(found.key);
                table.masks.push(found.mask);
                fronts.push(found.is_front);
                open.push(found.open);
            }
        }
        table.cell_start.push(table.keys.len() as u32);
        Survey { table, fronts, open, rays: found.iter().map(|found| found.rays).sum() }
    }

    /// How closely to look where these were found at a glance, by cell and key: at those that see otherwise than the voxels
    /// around, and those that are alone.
    fn depths(&self, found: &[Found]) -> Vec<Depth> {
        let cells: Vec<&[Found]> = found.chunk_by(|a, b| a.cell == b.cell).collect();
        let of_cell = |seen: &mut Vec<Option<(u8, bool)>>, of_cell: &&[Found]| -> Vec<Depth> {
            seen.clear();
            seen.resize(self.n.pow(3) as usize * 6, None);
            of_cell.iter().for_each(|found| seen[usize::from(found.key)] = Some((found.mask, found.open.is_some())));
            of_cell.iter().map(|found| self.depth(found.key, seen)).collect()
        };
        let depths: Vec<Vec<Depth>> = cells.par_iter().map_init(Vec::new, of_cell).collect();
        depths.concat()
    }

    /// Of one, by what all of its cell see, by key: a mask, or nothing and whether there is room.
    fn depth(&self, own: u16, seen: &[Option<(u8, bool)>]) -> Depth {
        let (voxel, last) = (voxel_of_key(own, self.n), UVec3::splat(self.n - 1));
        let facing = Facing::ALL[usize::from(own) % 6];
        let around =
            block(voxel.saturating_sub(UVec3::ONE), (voxel + 1).min(last)).map(|near| key(near, facing, self.n));
        let others: Vec<(u8, bool)> =
            around.filter(|near| *near != own).filter_map(|near| seen[usize::from(near)]).collect();
        match seen[usize::from(own)] {
            Some(own) if !others.is_empty() && others.iter().all(|other| *other == own) => Depth::Glance,
            Some((0, _)) if !others.is_empty() && others.iter().all(|(mask, _)| *mask == 0) => Depth::Room,
            _ => Depth::Whole,
        }
    }
}

//! The survey that fills a [`SurfaceVisibility`]: rays from points of every surface to the eight probes of its cell.
//!
//! It depends on the scene, the grid and the probes alone, not on the seed: what a bake knows of visibility is as fixed as its
//! grid, and two bakes that differ by chance do not differ in it.

use glam::{UVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::overlap::triangle_meets_box;
use super::piece::Piece;
use super::placement::Placement;
use super::settings::SurveySettings;
use super::tally::Tally;
use crate::light::World;
use crate::light::contact::{Facet, sight_line};
use crate::math::random::{KroneckerSequence, Purpose, Random, unit_from_bits};
use crate::probe::lattice::grid::{CellIndex, Grid, ProbeIndex, block};
use crate::probe::store::regions::Rank;
use crate::probe::store::surface::{Facing, SurfaceVisibility, active_corners, key, voxel_of_key};
use crate::scene::{Mesh, TriangleIndex};
use crate::trace::Ray;
use crate::trace::offset::ray_offset;

/// Memory that a survey takes at most: one [`Met`] for each triangle in each voxel that it meets, twice while they are
/// collected. A triangle meets as many voxels as its area covers, those along its edges, and one.
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
    (total * (2 * size_of::<Met>()) as f64) as u64
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

/// A triangle in one voxel. Small, for there are millions and they are sorted.
#[derive(Debug, Clone, Copy)]
pub struct Met {
    pub cell: CellIndex,
    pub triangle: u32,
    /// Of the voxel with [`Facing::ALL`]'s first facing.
    pub voxel_key: u16,
    /// Of the front.
    pub facing: Facing,
}

impl Met {
    /// By cell, voxel and triangle. As one number, which compares without a branch.
    fn order(&self) -> u128 {
        u128::from(self.cell.0) << 48 | u128::from(self.voxel_key) << 32 | u128::from(self.triangle)
    }
}

/// One side of a triangle in a voxel.
#[derive(Debug, Clone, Copy)]
struct Side {
    triangle: TriangleIndex,
    /// Whether this is the back of the triangle.
    is_back: bool,
}

/// What is known of one side of a voxel.
#[derive(Debug, Clone, Copy)]
struct Found {
    cell: CellIndex,
    key: u16,
    mask: u8,
    is_front: bool,
    open: Option<Vec3>,
    /// Whether anything there asks: not the inside of a solid, nor a voxel that an edge merely touches.
    asks: bool,
    rays: u64,
}

/// The surfaces in every voxel of a grid.
pub struct Surveyor<'a, 's> {
    pub world: &'a World<'s>,
    pub grid: &'a Grid,
    /// Voxels along each axis of a cell.
    pub n: u32,
    pub settings: &'a SurveySettings,
    /// By cell, voxel and triangle.
    pub met: Vec<Met>,
}

impl<'a, 's> Surveyor<'a, 's> {
    /// Sorts every surface within the grid's hull into `voxels_per_cell` voxels along each axis of a cell.
    pub fn new(world: &'a World<'s>, grid: &'a Grid, voxels_per_cell: u32, settings: &'a SurveySettings) -> Self {
        let mut surveyor = Surveyor { world, grid, n: voxels_per_cell, settings, met: Vec::new() };
        // One triangle may be a whole floor: its cells are work for all threads.
        let triangles = world.scene.mesh.triangles.len() as u32;
        let cells_of = |t: u32| surveyor.cells_of(t).map(move |cell| (t, cell));
        let in_cells: Vec<(u32, CellIndex)> = (0..triangles).into_par_iter().flat_map_iter(cells_of).collect();
        surveyor.met = in_cells.par_iter().flat_map_iter(|&(t, cell)| surveyor.met_in(t, cell)).collect();
        surveyor.met.par_sort_unstable_by_key(Met::order);
        surveyor
    }

    pub fn mesh(&self) -> &'a Mesh {
        &self.world.scene.mesh
    }

    /// Voxels' margin in cells.
    fn margin(&self) -> f32 {
        self.settings.voxel_margin / self.n as f32
    }

    /// Cells that a triangle meets.
    fn cells_of(&self, triangle: u32) -> impl Iterator<Item = CellIndex> {
        let corners = self.mesh().corners(TriangleIndex(triangle));
        let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        let margin = self.margin();
        let (beyond, _) = self.grid.is_beyond(low, high, margin);
        let cells = (!beyond).then(|| self.grid.cells_near(low, high, margin)).into_iter().flatten();
        // The box of a small triangle is in one cell, and so is it.
        let within = cells.clone().nth(1).is_none();
        cells.filter(move |&cell| {
            let local = || corners.map(|c| self.grid.cell_from_scene(cell, c) - 0.5);
            within || triangle_meets_box(local(), Vec3::splat(0.5 + margin))
        })
    }

    /// A triangle in every voxel of a cell that it meets.
    fn met_in(&self, triangle: u32, cell: CellIndex) -> impl Iterator<Item = Met> {
        let margin = self.settings.voxel_margin;
        let scaled = self.mesh().corners(TriangleIndex(triangle)).map(|c| self.in_voxels(cell, c));
        let low = scaled[0].min(scaled[1]).min(scaled[2]) - margin;
        let high = scaled[0].max(scaled[1]).max(scaled[2]) + margin;
        let last = UVec3::splat(self.n - 1);
        let (low, high) = (low.max(Vec3::ZERO).as_uvec3().min(last), high.max(Vec3::ZERO).as_uvec3().min(last));
        let facing = Facing::of(self.mesh().geometric_normal(TriangleIndex(triangle)));
        // Small triangles are wholly in one voxel.
        let within = low == high;
        let meets = move |voxel: &UVec3| {
            let centre = voxel.as_vec3() + 0.5;
            within || triangle_meets_box(scaled.map(|c| c - centre), Vec3::splat(0.5 + margin))
        };
        let n = self.n;
        block(low, high).filter(meets).map(move |voxel| Met {
            cell,
            triangle,
            voxel_key: key(voxel, Facing::ALL[0], n),
            facing,
        })
    }

    /// A position in units of a cell's voxels.
    pub fn in_voxels(&self, cell: CellIndex, position: Vec3) -> Vec3 {
        self.grid.cell_from_scene(cell, position) * self.n as f32
    }

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
        let found: Vec<Found> =
            groups.into_par_iter().flat_map_iter(|group| looks(self, placement, group).map(|l| l.look())).collect();
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
}

/// A look from the surfaces of a voxel that face one way.
struct Look<'a, 's> {
    surveyor: &'a Surveyor<'a, 's>,
    placement: &'a Placement,
    cell: CellIndex,
    key: u16,
    /// By triangle.
    sides: Vec<Side>,
}

/// The looks from all surfaces of one voxel, by their keys.
fn looks<'a, 's>(
    surveyor: &'a Surveyor<'a, 's>,
    placement: &'a Placement,
    met: &'a [Met],
) -> impl Iterator<Item = Look<'a, 's>> {
    let Met { cell, voxel_key, .. } = met[0];
    Facing::ALL.into_iter().filter_map(move |facing| {
        let side = |m: &Met| {
            let is_back = m.facing == facing.opposite();
            (is_back || m.facing == facing).then_some(Side { triangle: TriangleIndex(m.triangle), is_back })
        };
        let sides: Vec<Side> = met.iter().filter_map(side).collect();
        let key = key(voxel_of_key(voxel_key, surveyor.n), facing, surveyor.n);
        (!sides.is_empty()).then_some(Look { surveyor, placement, cell, key, sides })
    })
}

impl Look<'_, '_> {
    fn look(&self) -> Found {
        let Surveyor { grid, world, n, settings, .. } = *self.surveyor;
        let (cell, key) = (self.cell, self.key);
        // Backs of surfaces that have only fronts are asked for where nothing else is.
        let is_outside = |side: &Side| !side.is_back || world.scene.material(side.triangle).double_sided;
        let is_front = self.sides.iter().any(is_outside);
        let mut found = Found { cell, key, mask: 0, is_front, open: None, asks: false, rays: 0 };
        let active = active_corners(grid, &self.placement.states, cell);
        if active == 0 {
            return found;
        }
        let centre = voxel_of_key(key, n).as_vec3() + 0.5;
        let piece = |side: &Side| {
            let corners = self.surveyor.mesh().corners(side.triangle);
            Piece::new(corners.map(|c| self.surveyor.in_voxels(cell, c) - centre), settings.voxel_margin)
        };
        let all = |counts: &dyn Fn(&Side) -> bool, has_area: bool| -> Vec<(&Side, Piece)> {
            let pieces = self.sides.iter().filter(|side| counts(side)).map(|side| (side, piece(side)));
            pieces.filter(|(_, piece)| (piece.area > 0.0) == has_area).collect()
        };
        // Outsides, backs, and what but touches the voxel: the next only where those before see no probe.
        for tier in 0..3 {
            let (pieces, search) = match tier {
                0 => (all(&is_outside, true), settings.search_points),
                1 => (all(&|side| !is_outside(side), true), settings.first_points),
                _ => (all(&|_| true, false), settings.first_points),
            };
            found.asks |= tier == 0 && !pieces.is_empty();
            if pieces.is_empty() {
                continue;
            }
            let tally = self.tally(&pieces, active, search, tier);
            found.rays += tally.rays;
            found.open = if tier == 0 { tally.open } else { found.open };
            if tally.points > 0 {
                found.mask = tally.majority();
                break;
            }
        }
        found.asks |= found.mask != 0;
        found.open = found.open.filter(|_| found.mask == 0);
        found
    }

    /// Rays from points of these pieces, spread evenly over their area. Up to `search` points are tried until one sees any
    /// probe.
    fn tally(&self, pieces: &[(&Side, Piece)], active: u8, search: u32, tier: u64) -> Tally {
        let Surveyor { grid, world, settings, .. } = *self.surveyor;
        let (cell, key) = (self.cell, self.key);
        let probes = grid.corners(cell);
        let area: f32 = pieces.iter().map(|(_, piece)| piece.area).sum();
        let SurveySettings { first_points, all_points, .. } = *settings;
        // Several surfaces may see differently.
        let first = first_points.max((pieces.len() as u32).min(all_points / 2));
        let mut random = Random::new(0, Purpose::SurfaceVisibility, u64::from(cell.0) << 16 | u64::from(key), tier);
        let mut points = KroneckerSequence::new(&mut random);
        let mut tally = Tally::default();
        for tried in 0.. {
            let enough = match tally.points {
                0 => search,
                _ if tally.agrees() => first,
                _ => all_points,
            };
            let (true, Some([place, x, y, salt])) = (tried < enough, points.next()) else { break };
            let (side, barycentric) =
                point(pieces, area * unit_from_bits(place), Vec2::new(unit_from_bits(x), unit_from_bits(y)));
            let triangle = side.triangle;
            let corners = &self.surveyor.mesh().corners(triangle);
            let front = self.surveyor.mesh().geometric_normal(triangle);
            let position =
                corners[0] + (corners[1] - corners[0]) * barycentric.x + (corners[2] - corners[0]) * barycentric.y;
            let normal = if side.is_back { -front } else { front };
            let facet = Facet { position, normal, offset: ray_offset(corners) };
            // Where the first points see nothing, the others mostly lie inside a solid: one ray tells.
            let is_last_hope = tried >= first && tally.points == 0;
            if is_last_hope {
                tally.rays += 1;
                if self.room(&facet, salt).is_none() {
                    continue;
                }
            }
            let mut seen = 0u8;
            for (corner, probe) in probes.iter().enumerate().filter(|(corner, _)| active >> corner & 1 == 1) {
                let probe = probe.0 as usize;
                let line = sight_line(&facet, self.placement.positions[probe], self.placement.contacts.of(probe));
                let Some((origin, target)) = line else { continue };
                tally.rays += 1;
                // From the surface: most rays that are blocked are blocked near it, where walls and solids meet, and
                // Embree looks there first.
                let salt = salt.wrapping_add(corner as u32);
                seen |= u8::from(!world.tracer.occluded(Ray::segment(origin, target, salt))) << corner;
            }
            tally.points += u32::from(seen != 0);
            if seen == 0 && tally.open.is_none() {
                tally.rays += 1;
                let room = self.room(&facet, salt).filter(|room| *room > self.crack());
                tally.open = room.map(|_| position + normal * self.crack());
            }
            (0..8).for_each(|corner| tally.visible[corner] += u32::from(seen >> corner & 1));
        }
        tally
    }
}

impl Look<'_, '_> {
    /// How far it is from a point to what it faces, metres. `None` inside of a solid, where that is a back.
    fn room(&self, facet: &Facet, salt: u32) -> Option<f32> {
        let origin = facet.position + facet.normal * facet.offset;
        match self.surveyor.world.surface(Ray::new(origin, facet.normal, salt)) {
            Some(surface) => (!surface.is_back()).then_some(surface.hit.t),
            None => Some(f32::INFINITY),
        }
    }

    /// Metres: what lies this close before a surface leaves no room for anyone who asks, as between tiles and a wall.
    fn crack(&self) -> f32 {
        /// Voxels.
        const CRACK: f32 = 0.5;
        let Surveyor { grid, n, .. } = *self.surveyor;
        CRACK * grid.cell_box(self.cell).1.min_element() / n as f32
    }
}

/// The side at a place within the pieces' whole area, and barycentric coordinates of a point of it. Pieces without any area
/// take turns.
fn point<'p>(pieces: &[(&'p Side, Piece)], place: f32, u: Vec2) -> (&'p Side, Vec2) {
    let mut left = place;
    for (side, piece) in pieces {
        if left < piece.area {
            return (side, piece.point(left, u));
        }
        left -= piece.area;
    }
    let (side, piece) = &pieces[(u.x * pieces.len() as f32) as usize % pieces.len()];
    (side, piece.point(u.y * piece.area, u))
}

//! The survey that fills a [`SurfaceVisibility`]: rays from points of every surface to the eight probes of its cell.

use glam::{UVec3, Vec2, Vec3};
use rayon::prelude::*;

use super::overlap::triangle_meets_box;
use super::placement::Placement;
use super::settings::SurveySettings;
use crate::light::World;
use crate::light::contact::{Contacts, Facet, sight_line};
use crate::math::random::{Purpose, Random};
use crate::probe::lattice::grid::{CellIndex, Grid};
use crate::probe::store::surface::{Facing, SurfaceVisibility, active_corners, key, voxel_of_key};
use crate::scene::{Mesh, TriangleIndex};
use crate::trace::Ray;
use crate::trace::offset::ray_offset;

/// Memory that a survey takes at most: one [`Side`] for each side of a triangle in each voxel that it meets, twice while
/// they are collected. A triangle meets as many voxels as its area covers, those along its edges, and one.
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
    (total * (2 * 2 * size_of::<Side>()) as f64) as u64
}

/// A table with what is known beside it while baking.
#[derive(Debug, Clone)]
pub struct Survey {
    pub table: SurfaceVisibility,
    /// Per entry: whether the front of a surface, or a surface that has no back, faces there.
    pub fronts: Vec<bool>,
    pub rays: u64,
    pub settings: SurveySettings,
}

/// One side of a triangle in one voxel. Small, for there are millions and they are sorted.
#[derive(Debug, Clone, Copy)]
struct Side {
    cell: CellIndex,
    key: u16,
    /// Whether this is the back of the triangle.
    is_back: bool,
    triangle: u32,
    tally: Tally,
}

/// What the points of a [`Side`] see.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    /// Rays traced: at most eight for each point.
    rays: u16,
    /// Points that see any probe at all. The others lie inside solids where walls meet, and have no vote.
    points: u8,
    /// Of these, how many see each corner.
    visible: [u8; 8],
    /// Whether chance found no point of the triangle in the voxel, only its nearest one, which lies on an edge.
    edge_only: bool,
    /// Whether the outside of a surface faces here (as against the back of one that has only a front).
    outside: bool,
}

impl Tally {
    /// Whether points well inside the voxel, on the outside of a surface, see any probe.
    fn settles(&self) -> bool {
        self.outside && !self.edge_only && self.points > 0
    }
}

impl Survey {
    /// Looks at every surface within the grid's hull, `voxels_per_cell` voxels along each axis of a cell.
    pub fn run(
        world: &World,
        grid: &Grid,
        placement: &Placement,
        voxels_per_cell: u32,
        settings: &SurveySettings,
        seed: u64,
    ) -> Survey {
        let contacts = Contacts::of_points(world.scene, &placement.positions);
        let surveyor = Surveyor { world, contacts: &contacts, grid, placement, n: voxels_per_cell, settings, seed };
        let triangles = world.scene.mesh.triangles.len() as u32;
        let mut sides: Vec<Side> = (0..triangles).into_par_iter().flat_map_iter(|t| surveyor.triangle(t)).collect();
        // Sums of counts do not depend on the order, so neither does the result.
        sides.par_sort_unstable_by_key(|e| (e.cell, e.key));
        let mut rays: u64 = sides.iter().map(|e| u64::from(e.tally.rays)).sum();
        let mut groups: Vec<&mut [Side]> = sides.chunk_by_mut(|a, b| (a.cell, a.key) == (b.cell, b.key)).collect();
        rays += groups.par_iter_mut().map(|group| surveyor.search(group)).sum::<u64>();
        let mut table = SurfaceVisibility { voxels_per_cell, ..Default::default() };
        let mut fronts = Vec::new();
        let mut groups = groups.into_iter().peekable();
        for cell in grid.cells() {
            table.cell_start.push(table.keys.len() as u32);
            while let Some(group) = groups.next_if(|g| g[0].cell == cell) {
                let mask = majority(group);
                // The inside of a solid, or a voxel that an edge merely touches: nothing there asks.
                if mask == 0 && !group.iter().any(|e| e.tally.outside && !e.tally.edge_only) {
                    continue;
                }
                table.keys.push(group[0].key);
                table.masks.push(mask);
                fronts.push(group.iter().any(|e| e.tally.outside));
            }
        }
        table.cell_start.push(table.keys.len() as u32);
        Survey { table, fronts, rays, settings: settings.clone() }
    }
}

/// Corners that most points see; points on edges vote only where there are no others.
fn majority(group: &[Side]) -> u8 {
    let only_edges = group.iter().all(|e| e.tally.edge_only || e.tally.points == 0);
    let voters = || group.iter().map(|e| &e.tally).filter(|t| only_edges || !t.edge_only);
    let points: u32 = voters().map(|t| u32::from(t.points)).sum();
    (0..8).fold(0, |mask, i| {
        let visible: u32 = voters().map(|t| u32::from(t.visible[i])).sum();
        mask | u8::from(2 * visible > points) << i
    })
}

struct Surveyor<'a, 's> {
    world: &'a World<'s>,
    grid: &'a Grid,
    placement: &'a Placement,
    contacts: &'a Contacts,
    n: u32,
    settings: &'a SurveySettings,
    seed: u64,
}

impl Surveyor<'_, '_> {
    fn mesh(&self) -> &Mesh {
        &self.world.scene.mesh
    }

    /// Tallies of both sides of a triangle, in every voxel that it meets.
    fn triangle(&self, triangle: u32) -> Vec<Side> {
        let mut out = Vec::new();
        let corners = self.mesh().corners(TriangleIndex(triangle));
        let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        // In cells.
        let margin = self.settings.voxel_margin / self.n as f32;
        let (beyond, _) = self.grid.is_beyond(low, high, margin);
        if beyond {
            return out;
        }
        for cell in self.grid.cells_near(low, high, margin) {
            let local = corners.map(|c| self.grid.cell_from_scene(cell, c));
            if triangle_meets_box(local.map(|c| c - 0.5), Vec3::splat(0.5 + margin)) {
                self.cell(triangle, &local, cell, &mut out);
            }
        }
        out
    }

    /// One triangle in one cell; `local` are its corners in units of the cell.
    fn cell(&self, triangle: u32, local: &[Vec3; 3], cell: CellIndex, out: &mut Vec<Side>) {
        if active_corners(self.grid, &self.placement.states, cell) == 0 {
            return;
        }
        let n = self.n as f32;
        let margin = self.settings.voxel_margin;
        let scaled = local.map(|c| c * n);
        let low = scaled[0].min(scaled[1]).min(scaled[2]) - margin;
        let high = scaled[0].max(scaled[1]).max(scaled[2]) + margin;
        let last = UVec3::splat(self.n - 1);
        let (low, high) = (low.max(Vec3::ZERO).as_uvec3().min(last), high.max(Vec3::ZERO).as_uvec3().min(last));
        let front = Facing::of(self.mesh().geometric_normal(TriangleIndex(triangle)));
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let voxel = UVec3::new(x, y, z);
                    let centre = voxel.as_vec3() + 0.5;
                    let around = scaled.map(|c| c - centre);
                    if !triangle_meets_box(around, Vec3::splat(0.5 + margin)) {
                        continue;
                    }
                    for (is_back, facing) in [(false, front), (true, front.opposite())] {
                        let key = key(voxel, facing, self.n);
                        let mut side = Side { cell, key, is_back, triangle, tally: Tally::default() };
                        side.tally = self.tally(&side, &around, self.settings.first_points);
                        out.push(side);
                    }
                }
            }
        }
    }

    /// Looks again, with more points, where nothing on the outside of the surfaces of a voxel has seen a probe yet.
    /// Returns the number of rays.
    fn search(&self, group: &mut [Side]) -> u64 {
        if group.iter().any(|e| e.tally.settles()) {
            return 0;
        }
        let mut rays = 0;
        let cell = group[0].cell;
        // In units of the cell.
        let centre = (voxel_of_key(group[0].key, self.n).as_vec3() + 0.5) / self.n as f32;
        let unseen = |e: &Side| e.tally.outside && !e.tally.edge_only && e.tally.rays > 0;
        let count = group.iter().filter(|e| unseen(e)).count().max(1) as u32;
        let SurveySettings { all_points, search_points, group_search_points, .. } = *self.settings;
        let points = (group_search_points / count).max(all_points / 2).min(search_points);
        for side in group.iter_mut().filter(|e| unseen(e)) {
            let corners = self.mesh().corners(TriangleIndex(side.triangle));
            let around = corners.map(|p| (self.grid.cell_from_scene(cell, p) - centre) * self.n as f32);
            side.tally = self.tally(side, &around, points);
            rays += u64::from(side.tally.rays);
        }
        rays
    }

    /// Rays from points of a triangle within a voxel; `around` are its corners relative to the voxel's centre. Up to
    /// `search` points are tried until one sees any probe.
    fn tally(&self, side: &Side, around: &[Vec3; 3], search: u32) -> Tally {
        let triangle = TriangleIndex(side.triangle);
        let corners = &self.mesh().corners(triangle);
        let front = self.mesh().geometric_normal(triangle);
        let normal = if side.is_back { -front } else { front };
        let active = active_corners(self.grid, &self.placement.states, side.cell);
        let probes = self.grid.corners(side.cell);
        let stream = u64::from(side.cell.0) << 16 | u64::from(side.key);
        let mut random = Random::new(
            self.seed,
            Purpose::SurfaceVisibility,
            stream,
            2 * u64::from(side.triangle) + u64::from(side.is_back),
        );
        let outside = !side.is_back || self.world.scene.material(triangle).double_sided;
        let SurveySettings { first_points, all_points, voxel_margin, .. } = *self.settings;
        let mut tally = Tally { outside, ..Tally::default() };
        for tried in 0.. {
            let enough = match tally.points {
                _ if tally.edge_only => 1,
                0 => search,
                points if tally.visible.iter().all(|&v| v == 0 || v == points) => first_points,
                _ => all_points,
            };
            if tried >= enough {
                break;
            }
            let (barycentric, inside) = point_in_voxel(around, voxel_margin, &mut random);
            tally.edge_only |= !inside;
            let position =
                corners[0] + (corners[1] - corners[0]) * barycentric.x + (corners[2] - corners[0]) * barycentric.y;
            let facet = Facet { position, normal, offset: ray_offset(corners) };
            let mut seen = 0u8;
            for (corner, probe) in probes.iter().enumerate() {
                if active >> corner & 1 == 0 {
                    continue;
                }
                let probe = probe.0 as usize;
                let line = sight_line(&facet, self.placement.positions[probe], self.contacts.of(probe));
                let Some((origin, target)) = line else { continue };
                tally.rays += 1;
                // From the surface: most rays that are blocked are blocked near it, where walls and solids meet, and
                // Embree looks there first.
                seen |= u8::from(!self.world.tracer.occluded(Ray::segment(origin, target, random.bits()))) << corner;
            }
            tally.points += u8::from(seen != 0);
            (0..8).for_each(|corner| tally.visible[corner] += seen >> corner & 1);
        }
        tally
    }
}

/// Barycentric coordinates of a random point of a triangle inside the unit box around the origin, and whether there
/// is one; where chance finds none (slivers, corners), of the triangle's point nearest the box's centre.
fn point_in_voxel(around: &[Vec3; 3], margin: f32, random: &mut Random) -> (Vec2, bool) {
    /// Tries before a triangle's share of a voxel counts as a sliver.
    const TRIES: usize = 8;
    let (e1, e2) = (around[1] - around[0], around[2] - around[0]);
    let normal = e1.cross(e2);
    let axis = normal.abs().max_position();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let determinant = e1[u] * e2[v] - e1[v] * e2[u];
    for _ in 0..TRIES {
        let p = Vec2::new(random.uniform() - 0.5 - around[0][u], random.uniform() - 0.5 - around[0][v]);
        let b = Vec2::new(p.x * e2[v] - p.y * e2[u], e1[u] * p.y - e1[v] * p.x) / determinant;
        let along_axis = around[0][axis] + e1[axis] * b.x + e2[axis] * b.y;
        if b.x >= 0.0 && b.y >= 0.0 && b.x + b.y <= 1.0 && along_axis.abs() <= 0.5 + margin {
            return (b, true);
        }
    }
    (nearest_to_origin(around), false)
}

/// Barycentric coordinates of the point of a triangle nearest the origin (Ericson, *Real-Time Collision Detection*,
/// 2005, section 5.1.5).
fn nearest_to_origin(t: &[Vec3; 3]) -> Vec2 {
    let (ab, ac, ap) = (t[1] - t[0], t[2] - t[0], -t[0]);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return Vec2::ZERO;
    }
    let bp = -t[1];
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return Vec2::X;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return Vec2::new(d1 / (d1 - d3), 0.0);
    }
    let cp = -t[2];
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return Vec2::Y;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return Vec2::new(0.0, d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return Vec2::new(1.0 - w, w);
    }
    Vec2::new(vb, vc) / (va + vb + vc)
}

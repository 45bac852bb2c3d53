//! Thin walls: two surfaces that face apart, with less than a voxel in between, so that a voxel has both.
//!
//! A surface of such a voxel is told from the other by its facing. Things in the air are not: whoever looks at the wall from
//! one side faces as the surface on the other does. There the tree needs to know where the wall is.

use std::collections::HashMap;

use glam::Vec3;
use rayon::prelude::*;

use super::survey::Survey;
use super::surveyor::{Met, Surveyor};
use crate::probe::lattice::grid::CellIndex;
use crate::probe::store::regions::{BELOW, BEYOND, MOST_WALLS, Plane, Wall};
use crate::probe::store::surface::{Entry, Facing, key, voxel_of_key};
use crate::scene::TriangleIndex;

/// Cosine between a wall's normal and an axis.
const UPRIGHT: f32 = 0.9999;

/// Voxels: surfaces this near lie in one plane.
const SAME: f32 = 1e-3;

/// Voxels, as a share of a cell's face, whose two surfaces have to see differently. Fewer are not worth three words.
const LEAST: f32 = 1.0 / 2.0;

/// All surfaces of one plane and facing in a cell.
#[derive(Debug, Clone)]
struct Face {
    /// Along the axis, voxels.
    place: f32,
    is_positive: bool,
    /// Keys of its voxels, with [`Facing::ALL`]'s first facing.
    voxels: Vec<u16>,
}

/// From where to where the surfaces of entries lie along an axis, voxels, by key.
type Extents = HashMap<u16, (f32, f32)>;

/// The walls of every cell.
pub fn walls(surveyor: &Surveyor, survey: &Survey) -> Vec<Vec<Wall>> {
    let mut walls = vec![Vec::new(); surveyor.grid.cell_count()];
    let cells: Vec<&[Met]> = surveyor.met.chunk_by(|a, b| a.cell == b.cell).collect();
    let found: Vec<_> = cells.par_iter().map(|met| (met[0].cell, OfCell { surveyor, survey, met }.walls())).collect();
    for (cell, of_cell) in found {
        walls[cell.0 as usize] = of_cell;
    }
    walls
}

/// The surfaces of one cell.
struct OfCell<'a, 's> {
    surveyor: &'a Surveyor<'a, 's>,
    survey: &'a Survey,
    met: &'a [Met],
}

impl OfCell<'_, '_> {
    fn cell(&self) -> CellIndex {
        self.met[0].cell
    }

    fn walls(&self) -> Vec<Wall> {
        let n = self.surveyor.n;
        let least = (LEAST * (n * n) as f32).ceil() as usize;
        let mut planes: Vec<(usize, Plane)> = Vec::new();
        for axis in 0..3 {
            let mut add = |below: &Face, beyond: &Face| {
                let contrast = self.contrast(axis, below, beyond);
                if contrast >= least {
                    let share = (below.place + beyond.place) / (2 * n) as f32;
                    let place = (share * 65536.0).round().clamp(0.0, 65535.0) as u16;
                    planes.push((contrast, Plane { axis, place }));
                }
                contrast >= least
            };
            let faces = self.faces(axis);
            let mut i = 0;
            while let Some(face) = faces.get(i) {
                let other = faces.get(i + 1).filter(|other| !face.is_positive && other.is_positive);
                i += if other.is_some_and(|other| add(face, other)) { 2 } else { 1 };
                // A sheet: its back sees something too.
                if other.is_none() {
                    add(face, face);
                }
            }
        }
        planes.sort_by_key(|(contrast, plane)| (std::cmp::Reverse(*contrast), plane.axis, plane.place));
        planes.truncate(usize::from(MOST_WALLS));
        planes.into_iter().map(|(_, plane)| Wall { plane, sides: self.sides(plane) }).collect()
    }

    /// The surfaces across an axis, in order; of two in one plane the one that faces down it first.
    fn faces(&self, axis: usize) -> Vec<Face> {
        let mesh = self.surveyor.mesh();
        let mut found: Vec<(f32, bool, u16)> = Vec::new();
        for met in self.met {
            let triangle = TriangleIndex(met.triangle);
            if usize::from(met.facing.index()) / 2 != axis || mesh.geometric_normal(triangle)[axis].abs() < UPRIGHT {
                continue;
            }
            let place = self.surveyor.in_voxels(self.cell(), mesh.corners(triangle)[0])[axis];
            let is_positive = met.facing.index().is_multiple_of(2);
            found.push((place, is_positive, met.voxel_key));
            if self.surveyor.world.scene.material(triangle).double_sided {
                found.push((place, !is_positive, met.voxel_key));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        let mut faces: Vec<Face> = Vec::new();
        for (place, is_positive, voxel) in found {
            let is_same = |face: &&mut Face| face.is_positive == is_positive && place - face.place <= SAME;
            match faces.iter_mut().rev().take(2).find(is_same) {
                Some(face) => face.voxels.push(voxel),
                None => faces.push(Face { place, is_positive, voxels: vec![voxel] }),
            }
        }
        for face in &mut faces {
            face.voxels.sort_unstable();
            face.voxels.dedup();
        }
        faces.sort_by(|a, b| {
            let is_same = (a.place - b.place).abs() <= SAME;
            if is_same { a.is_positive.cmp(&b.is_positive) } else { a.place.total_cmp(&b.place) }
        });
        faces
    }

    /// Voxels that have both of two faces which see differently.
    fn contrast(&self, axis: usize, below: &Face, beyond: &Face) -> usize {
        let facing = Facing::of(Vec3::AXES[axis]);
        let differs = |voxel: &&u16| {
            let mask = |facing: Facing| self.entry(**voxel, facing).map(|entry| self.survey.table.masks[entry]);
            beyond.voxels.binary_search(voxel).is_ok()
                && mask(facing.opposite()).zip(mask(facing)).is_some_and(|(a, b)| a != b)
        };
        below.voxels.iter().filter(differs).count()
    }

    /// Index in the table.
    fn entry(&self, voxel_key: u16, facing: Facing) -> Option<usize> {
        let n = self.surveyor.n;
        let range = self.survey.table.range(self.cell());
        let wanted = key(voxel_of_key(voxel_key, n), facing, n);
        self.survey.table.keys[range.clone()].binary_search(&wanted).ok().map(|found| range.start + found)
    }

    /// On which sides of a plane the entries of the cell lie.
    fn sides(&self, plane: Plane) -> Vec<u8> {
        let n = self.surveyor.n;
        let (axis, place) = (plane.axis, plane.share() * n as f32);
        let margin = self.surveyor.settings.voxel_margin;
        let thickness = Plane::THICKNESS * n as f32;
        let extents = self.extents(axis);
        let side = |entry: Entry| {
            let low = entry.voxel[axis] as f32 - margin;
            let facing = Facing::of(entry.facing);
            let extent = extents.get(&key(entry.voxel, facing, n)).copied();
            let (low, high) = extent.unwrap_or((low, low + 1.0 + 2.0 * margin));
            // What lies on the wall goes by its facing, if that is across.
            let on_wall = match usize::from(facing.index()) {
                index if index / 2 != axis => BELOW | BEYOND,
                index if index.is_multiple_of(2) => BEYOND,
                _ => BELOW,
            };
            let meets = low <= place + thickness && high >= place - thickness;
            let of = |holds: bool, side: u8| if holds { side } else { 0 };
            of(low < place - thickness, BELOW) | of(high > place + thickness, BEYOND) | of(meets, on_wall)
        };
        self.survey.table.entries(self.cell()).map(side).collect()
    }

    /// From where to where along an axis the surfaces of each entry lie, voxels, by key. Backs have a say where no front lies: there
    /// the entry is theirs.
    fn extents(&self, axis: usize) -> Extents {
        let (mesh, n) = (self.surveyor.mesh(), self.surveyor.n);
        let margin = self.surveyor.settings.voxel_margin;
        let (mut extents, mut backs) = (Extents::new(), Extents::new());
        for met in self.met {
            let triangle = TriangleIndex(met.triangle);
            let voxel = voxel_of_key(met.voxel_key, n);
            let places = mesh.corners(triangle).map(|corner| self.surveyor.in_voxels(self.cell(), corner)[axis]);
            let (low, high) = (voxel[axis] as f32 - margin, (voxel[axis] + 1) as f32 + margin);
            let extent = places.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)));
            let (low, high) = (extent.0.clamp(low, high), extent.1.clamp(low, high));
            let grow = |extents: &mut Extents, facing: Facing| {
                let known = extents.entry(key(voxel, facing, n)).or_insert((low, high));
                *known = (known.0.min(low), known.1.max(high));
            };
            grow(&mut extents, met.facing);
            let has_back = !self.surveyor.world.scene.material(triangle).double_sided;
            grow(if has_back { &mut backs } else { &mut extents }, met.facing.opposite());
        }
        backs.extend(extents);
        backs
    }
}

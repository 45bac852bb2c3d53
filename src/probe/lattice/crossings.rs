//! Which cells of a mixed grid are subdivided: those inside which a surface passes between two neighbouring points.
//!
//! The finest points are the centres of the finest cells. Where a triangle crosses the segment from point i−1 to point i
//! along an axis, every larger cell that holds both is subdivided: the cell `i >> (L−ℓ)` of level ℓ holds both where the
//! low L−ℓ bits of i along that axis are not all zero. Source: Fei Yang, *Mixed-resolution Grid of Light Probes*, 2023.

use glam::{DVec2, DVec3, UVec3, Vec3};

use crate::scene::{Mesh, TriangleIndex};

/// Cells to subdivide, by level.
pub struct Crossings {
    /// Base cells along each axis.
    base: UVec3,
    levels: u32,
    /// Of every level above the finest, x fastest.
    marks: Vec<Vec<bool>>,
}

/// Points this share of a triangle's area outside still count as within: on a common edge of two triangles rounding must not
/// put them outside of both.
const EDGE: f64 = 1e-9;

impl Crossings {
    /// Of a mesh with points from `origin` on, `spacing` apart, `divisions` along each axis.
    pub fn of(mesh: &Mesh, origin: Vec3, spacing: Vec3, divisions: UVec3, levels: u32) -> Crossings {
        let base = divisions >> levels;
        let cells = |level: u32| (base << level).to_array().iter().map(|&n| n as usize).product();
        let marks = (0..levels).map(|level| vec![false; cells(level)]).collect();
        let mut found = Crossings { base, levels, marks };
        for triangle in (0..mesh.triangles.len() as u32).map(TriangleIndex) {
            // In spacings: points are whole numbers.
            let corners = mesh.corners(triangle).map(|p| (p.as_dvec3() - origin.as_dvec3()) / spacing.as_dvec3());
            (0..3).for_each(|axis| found.cross(&corners, axis, divisions));
        }
        found
    }

    /// Whether a cell of a level, by its coordinate in cells of that level, is subdivided.
    pub fn divides(&self, level: u32, cell: UVec3) -> bool {
        self.marks.get(level as usize).is_some_and(|marks| marks[self.number(level, cell)])
    }

    fn number(&self, level: u32, cell: UVec3) -> usize {
        let n = self.base << level;
        cell.x as usize + n.x as usize * (cell.y as usize + n.y as usize * cell.z as usize)
    }

    /// Every segment along `axis` that a triangle crosses.
    fn cross(&mut self, corners: &[DVec3; 3], axis: usize, divisions: UVec3) {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let flat = corners.map(|c| DVec2::new(c[u], c[v]));
        let area = (flat[1] - flat[0]).perp_dot(flat[2] - flat[0]);
        // A triangle along the axis crosses no segment: those that it lies in end on its other sides.
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let (low, high) = (flat[0].min(flat[1]).min(flat[2]), flat[0].max(flat[1]).max(flat[2]));
        // `as` truncates and saturates: a range that is empty where the triangle passes between all lines.
        let range = |low: f64, high: f64, n: u32| {
            let first = (low - EDGE).ceil().max(0.0) as u32;
            first..((high + EDGE).floor() + 1.0).clamp(0.0, f64::from(n)) as u32
        };
        for y in range(low.y, high.y, divisions[v]) {
            for x in range(low.x, high.x, divisions[u]) {
                let p = DVec2::new(f64::from(x), f64::from(y));
                let share = |a: usize, b: usize| (flat[b] - flat[a]).perp_dot(p - flat[a]) / area;
                let shares = [share(1, 2), share(2, 0), share(0, 1)];
                if shares.iter().any(|&share| share < -EDGE) {
                    continue;
                }
                let along: f64 = shares.iter().zip(corners).map(|(share, corner)| share * corner[axis]).sum();
                // The end of the segment (i−1, i] that holds the crossing.
                let end = along.ceil();
                if end >= 1.0 && end <= f64::from(divisions[axis] - 1) {
                    let mut cell = UVec3::ZERO;
                    (cell[axis], cell[u], cell[v]) = (end as u32, x, y);
                    self.mark(cell, axis);
                }
            }
        }
    }

    /// Marks all cells that hold both ends of the segment that ends at a point.
    fn mark(&mut self, end: UVec3, axis: usize) {
        for level in 0..self.levels {
            let within = self.levels - level;
            if end[axis] & ((1 << within) - 1) == 0 {
                break;
            }
            let number = self.number(level, end >> within);
            self.marks[level as usize][number] = true;
        }
    }
}

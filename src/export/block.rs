//! A box of probes as engines take it: at the centres of equal cells, so that it reaches half a spacing beyond them.

use glam::{UVec3, Vec3};

use crate::probe::{Grid, ProbeIndex};

#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// The first probe, relative to the scene's origin, metres.
    pub first: Vec3,
    /// Metres along each axis.
    pub spacing: Vec3,
    /// Probes along each axis, at least one.
    pub divisions: UVec3,
    /// Number of its first probe among those of all blocks; x runs fastest, then y.
    pub start: u32,
}

impl Block {
    /// A block that fills a box with so many probes along each axis.
    pub fn filling(low: Vec3, high: Vec3, divisions: UVec3, start: u32) -> Block {
        let spacing = (high - low) / divisions.as_vec3();
        Block { first: low + 0.5 * spacing, spacing, divisions, start }
    }

    /// All points of a uniform lattice.
    pub fn of(grid: &Grid) -> Block {
        Block { first: grid.origin(), spacing: grid.spacing(), divisions: grid.divisions(), start: 0 }
    }

    pub fn count(&self) -> usize {
        self.divisions.to_array().iter().map(|&n| n as usize).product()
    }

    /// Corners of the box.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let low = self.first - 0.5 * self.spacing;
        (low, low + self.divisions.as_vec3() * self.spacing)
    }

    /// Place along each axis of its `i`-th probe.
    pub fn coordinate(&self, i: u32) -> UVec3 {
        let UVec3 { x, y, .. } = self.divisions;
        UVec3::new(i % x, i / x % y, i / (x * y))
    }

    /// Number of a probe among its own.
    pub fn index(&self, coordinate: UVec3) -> u32 {
        coordinate.x + self.divisions.x * (coordinate.y + self.divisions.y * coordinate.z)
    }

    /// Where its probes stand, in their order.
    pub fn positions(&self) -> impl Iterator<Item = Vec3> + '_ {
        (0..self.count() as u32).map(|i| self.first + self.coordinate(i).as_vec3() * self.spacing)
    }

    /// The eight probes around a place and their trilinear weights, which sum to 1: bit 0 of a corner's number is +x, bit 1
    /// is +y, bit 2 is +z. Beyond the outermost probes those at the rim count, as textures clamp.
    pub fn corners(&self, place: Vec3) -> ([ProbeIndex; 8], [f32; 8]) {
        let last = self.divisions - UVec3::ONE;
        let g = ((place - self.first) / self.spacing).clamp(Vec3::ZERO, last.as_vec3());
        let base = g.as_uvec3().min(last.saturating_sub(UVec3::ONE));
        let fraction = g - base.as_vec3();
        let step = last.min(UVec3::ONE);
        let [x, y, z] = fraction.to_array().map(|f| [1.0 - f, f]);
        let corner = |i: u32| base + step * UVec3::new(i & 1, i >> 1 & 1, i >> 2);
        (
            std::array::from_fn(|i| ProbeIndex(self.start + self.index(corner(i as u32)))),
            std::array::from_fn(|i| x[i & 1] * y[i >> 1 & 1] * z[i >> 2 & 1]),
        )
    }
}

//! The tests that tell which of its eight probes a point sees. Each is a type of its own, so that the loop over
//! corners is compiled for each.

use glam::{Vec2, Vec3};

use super::point::QueryPoint;
use crate::probe::lattice::grid::{Cell, Grid, ProbeIndex};
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::moments::chebyshev_shortened;
use crate::probe::store::regions::Regions;
use crate::probe::store::surface::{Seen, SurfaceVisibility, TableTest};
use crate::probe::store::tiles::{Tiles, box_sides};

pub trait CornerTest {
    /// Which corners of its cell a point may see at all.
    fn seen(&self, grid: &Grid, cell: &Cell, point: &QueryPoint, biased: Vec3) -> Seen;

    /// How far it sees the probe, 0 to 1.
    fn factor(&self, probe: ProbeIndex, biased: Vec3) -> f32;
}

/// The corners that are visible are known: bit i for corner i.
pub struct Mask(pub u8);

impl CornerTest for Mask {
    #[inline]
    fn seen(&self, _: &Grid, _: &Cell, _: &QueryPoint, _: Vec3) -> Seen {
        Seen { mask: self.0, far: None }
    }

    #[inline]
    fn factor(&self, _: ProbeIndex, _: Vec3) -> f32 {
        1.0
    }
}

/// A power; the first, which is the number itself, waits for no library.
#[inline]
fn raised(visibility: f32, power: f32) -> f32 {
    if power == 1.0 { visibility } else { visibility.powf(power) }
}

/// Chebyshev's bound from the moments of distance.
pub struct MomentsTest<'v> {
    pub maps: &'v OctahedralMaps<Vec2>,
    pub positions: &'v [Vec3],
    pub power: f32,
    pub floor: f32,
    /// By how much distances count as shorter, metres.
    pub shorter: f32,
}

impl CornerTest for MomentsTest<'_> {
    #[inline]
    fn seen(&self, _: &Grid, _: &Cell, _: &QueryPoint, _: Vec3) -> Seen {
        Seen { mask: u8::MAX, far: None }
    }

    #[inline]
    fn factor(&self, probe: ProbeIndex, biased: Vec3) -> f32 {
        let probe = probe.0 as usize;
        let from_probe = biased - self.positions[probe];
        raised(chebyshev_shortened(self.maps, probe, from_probe, self.shorter), self.power).max(self.floor)
    }
}

/// The table of visibility measured at the surfaces.
pub struct SurfaceTest<'v> {
    pub table: &'v SurfaceVisibility,
    pub test: TableTest,
    /// Whether there is an answer also where the table knows none.
    pub everywhere: bool,
}

impl CornerTest for SurfaceTest<'_> {
    #[inline]
    fn seen(&self, grid: &Grid, cell: &Cell, point: &QueryPoint, biased: Vec3) -> Seen {
        match self.everywhere {
            false => self.table.look_up(grid, cell, biased, point.facing, &self.test),
            true => self.table.everywhere(grid, cell, biased, point.facing, &self.test),
        }
    }

    #[inline]
    fn factor(&self, _: ProbeIndex, _: Vec3) -> f32 {
        1.0
    }
}

/// The same as trees.
pub struct RegionsTest<'v> {
    pub regions: &'v Regions,
}

impl CornerTest for RegionsTest<'_> {
    #[inline]
    fn seen(&self, grid: &Grid, cell: &Cell, point: &QueryPoint, biased: Vec3) -> Seen {
        self.regions.look_up(grid, cell, biased, point.facing)
    }

    #[inline]
    fn factor(&self, _: ProbeIndex, _: Vec3) -> f32 {
        1.0
    }
}

/// Distances as shares of the way to a box around the probe.
pub struct TilesTest<'v> {
    pub tiles: &'v Tiles,
    pub grid: &'v Grid,
    pub positions: &'v [Vec3],
    pub power: f32,
    pub floor: f32,
    /// By how much distances count as shorter, metres.
    pub shorter: f32,
}

impl CornerTest for TilesTest<'_> {
    #[inline]
    fn seen(&self, _: &Grid, _: &Cell, _: &QueryPoint, _: Vec3) -> Seen {
        Seen { mask: u8::MAX, far: None }
    }

    #[inline]
    fn factor(&self, probe: ProbeIndex, biased: Vec3) -> f32 {
        let p = probe.0 as usize;
        let (sides, steepness) = (box_sides(self.grid, probe), self.grid.width(probe) as f32);
        let visibility = self.tiles.visibility(p, biased - self.positions[p], sides, steepness, self.shorter);
        raised(visibility, self.power).max(self.floor)
    }
}

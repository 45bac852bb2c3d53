//! A small volume built in code, and what is asked of it: the one place that knows how volumes and settings are made.

use glam::{DVec3, UVec3, Vec2, Vec3, Vec3A};

use crate::probe::Volume;
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::Grid;
use crate::probe::query::{Query, QueryPoint, QuerySettings, Visibility, VisibilityTest};
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::irradiance::IrradianceCurve;
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::surface::{Facing, SurfaceVisibility, TableTest};
use crate::probe::store::tiles::{TileStore, TilesBuilder};
use crate::probe::store::{Irradiance, Occlusion};

/// Probe (0,0,0), metres. Not the origin, so that a forgotten subtraction shows.
pub const ORIGIN: Vec3 = Vec3::new(1.0, -1.0, 3.0);

/// Different along each axis, so that a swap of axes shows.
pub const SPACING: Vec3 = Vec3::new(2.0, 4.0, 1.0);

/// Interior texels per side of all maps; they have a border of one texel.
pub const RESOLUTION: usize = 4;

pub struct Fixture {
    pub volume: Volume,
    pub settings: QuerySettings,
}

impl Fixture {
    /// Active probes at the points of the grid, each with one irradiance for all directions; trilinear weights alone.
    pub fn new(divisions: [u32; 3], irradiance: impl Fn(usize) -> [f32; 3]) -> Fixture {
        let grid = Grid::from_parts(ORIGIN.as_dvec3(), SPACING, UVec3::from_array(divisions)).unwrap();
        let (grid, _) = grid.relative_to(DVec3::ZERO);
        let count = grid.probe_count();
        let volume = Volume {
            states: vec![ProbeState::Active; count],
            positions: grid.probes().map(|probe| grid.grid_point(probe)).collect(),
            irradiance: maps(count, IrradianceCurve::Linear),
            occlusion: Occlusion::None,
            radiance: Default::default(),
            layout: Default::default(),
            grid,
        };
        // Cells are those of the points themselves but where a test says otherwise.
        let settings = QuerySettings { test: VisibilityTest::None, biased_cell: false, ..QuerySettings::default() };
        let mut fixture = Fixture { volume, settings };
        fixture.store(IrradianceCurve::Linear, |probe, _, _| irradiance(probe));
        fixture
    }

    /// Stored values by probe, column and row; columns and rows count from the border, 0 to 5.
    pub fn store(&mut self, curve: IrradianceCurve, texel: impl Fn(usize, usize, usize) -> [f32; 3]) {
        let mut stored = maps(self.volume.grid.probe_count(), curve);
        if let Irradiance::Maps { maps, .. } = &mut stored {
            fill(maps, |p, c, r| Vec3A::from_array(texel(p, c, r)));
        }
        self.volume.irradiance = stored;
    }

    /// Chebyshev's bound from mean and standard deviation of distance, by probe, column and row as in [`Self::store`].
    pub fn moments(&mut self, power: f32, floor: f32, texel: impl Fn(usize, usize, usize) -> [f32; 2]) {
        self.settings.test = VisibilityTest::Chebyshev { power, floor };
        let mut maps = OctahedralMaps::new(self.volume.grid.probe_count(), RESOLUTION, 1, Vec2::ZERO);
        fill(&mut maps, |p, c, r| Vec2::from_array(texel(p, c, r)));
        self.volume.occlusion = Occlusion::Moments(maps);
    }

    /// Mean and deviation of distance as shares of the way to the box of one spacing, by probe, column and row as in
    /// [`Self::store`].
    pub fn tiles(&mut self, power: f32, floor: f32, texel: impl Fn(usize, usize, usize) -> [f32; 2]) {
        self.settings.test = VisibilityTest::Chebyshev { power, floor };
        let store = TileStore { resolution: RESOLUTION, ..TileStore::default() };
        let mut tiles = TilesBuilder::new(&store, &self.volume.grid, 1).finish();
        fill(&mut tiles.maps, |p, c, r| Vec2::from_array(texel(p, c, r)));
        self.volume.occlusion = Occlusion::Tiles(tiles);
    }

    /// A table of visibility at surfaces with two voxels per axis and cell. For each cell its entries, sorted: key
    /// 6·(x + 2·(y + 2·z)) + facing, and mask. `far`: entry of the whole table, and the probe that stands in.
    pub fn surface(&mut self, cells: &[&[(u16, u8)]], far: &[(u32, u32)]) {
        self.settings.test = VisibilityTest::Table(TableTest::default());
        let mut cell_start = vec![0];
        for cell in cells {
            cell_start.push(cell_start[cell_start.len() - 1] + cell.len() as u32);
        }
        let (keys, masks) = cells.concat().into_iter().unzip();
        let table = SurfaceVisibility { voxels_per_cell: 2, cell_start, keys, masks, far: far.to_vec() };
        self.volume.occlusion = Occlusion::Surface(table);
    }

    pub fn deactivate(&mut self, probe: usize, why: ProbeState) {
        self.volume.states[probe] = why;
    }

    pub fn place(&mut self, probe: usize, position: Vec3) {
        self.volume.positions[probe] = position;
    }

    fn query(&self) -> Query<'_> {
        Query { volume: &self.volume, settings: &self.settings }
    }

    /// Probes and weights, not normalised, in the order of corners.
    pub fn weights(&self, point: &QueryPoint, visibility: Visibility) -> ([u32; 8], [f32; 8]) {
        let corners = self.query().weights(point, visibility);
        (corners.probes.map(|probe| probe.0), corners.weights)
    }

    /// Irradiance, W·m⁻².
    pub fn look_up(&self, point: &QueryPoint, visibility: Visibility) -> [f32; 3] {
        self.query().irradiance(point, visibility).to_array()
    }
}

fn maps(probes: usize, curve: IrradianceCurve) -> Irradiance {
    Irradiance::Maps { maps: OctahedralMaps::new(probes, RESOLUTION, 1, Vec3A::ZERO), curve, format: ColorFormat::F32 }
}

fn fill<T: Copy>(maps: &mut OctahedralMaps<T>, texel: impl Fn(usize, usize, usize) -> T) {
    let (side, per_probe) = (maps.side(), maps.texels_per_probe());
    for (i, out) in maps.texels.iter_mut().enumerate() {
        *out = texel(i / per_probe, i % side, i % per_probe / side);
    }
}

/// A point whose surface faces along its shading normal.
pub fn point(position: Vec3, normal: Vec3, view: Vec3) -> QueryPoint {
    QueryPoint { position, normal, geometric: normal, facing: Facing::of(normal), view }
}

//! A look-up for graphics cards: the text of `lookup.glsl`, and what a volume binds to it.

use glam::{UVec3, Vec3};

use super::look_up::Query;
use super::settings::{Blend, DirectionWeight, LookUp, QuerySettings, VisibilityTest, WeightNormal};
use crate::probe::lattice::{Grid, ProbeIndex};
use crate::probe::store::textures::{Bound, Numbers, Texture};

/// The look-up in GLSL ES 3.00. What it binds is in `src/probe/README.md`.
pub const LOOK_UP: &str = include_str!("lookup.glsl");

/// What a volume binds to [`LOOK_UP`].
#[derive(Debug, Clone, PartialEq)]
pub struct Shader {
    /// `gridOrigin`, relative to the scene's origin, metres.
    pub origin: Vec3,
    /// `gridSpacing`, metres.
    pub spacing: Vec3,
    /// `gridPoints`.
    pub points: UVec3,
    /// Names that the text is compiled with, and textures.
    pub bound: Bound,
}

impl Shader {
    /// What binds this look-up.
    ///
    /// # Errors
    /// What of the method the text has no rule for.
    pub fn new(query: &Query) -> Result<Shader, &'static str> {
        let (volume, settings) = (query.volume, query.settings);
        let grid = &volume.grid;
        let mut bound = volume.irradiance.bound();
        let floors_maps = volume.irradiance.harmonics().is_some_and(|sh| sh.maps().is_some());
        if floors_maps && settings.sum_floor > 0.0 {
            return Err("a floor of sums (query.sum_floor) beside presampled harmonics");
        }
        if settings.asks(volume.occlusion.test()) {
            bound.add(volume.occlusion.bound().ok_or("visibility as files of before query version 4 hold it")?);
        }
        bound.textures.push(query.places());
        lattice(grid, &mut bound);
        settings.define(grid, &mut bound);
        Ok(Shader { origin: grid.origin(), spacing: grid.spacing(), points: grid.divisions(), bound })
    }

    /// The names as lines of the preprocessor, to stand between `#version` and [`LOOK_UP`].
    pub fn header(&self) -> String {
        self.bound.defines.iter().map(|(name, value)| format!("#define {name} {value}\n")).collect()
    }
}

impl Query<'_> {
    /// `probes`: place, and the width of the cell, negative where the probe is not active.
    pub fn places(&self) -> Texture {
        let volume = self.volume;
        let texel = |p: usize| {
            let probe = ProbeIndex(p as u32);
            let width = volume.grid.width(probe) as f32;
            volume.positions[p].extend(if volume.is_active(probe) { width } else { -width }).to_array()
        };
        let numbers = Numbers::F32((0..volume.positions.len()).flat_map(texel).collect());
        Texture { name: "probes", channels: 4, numbers }
    }
}

/// The index of a mixed grid.
fn lattice(grid: &Grid, bound: &mut Bound) {
    let Some(tree) = grid.tree() else { return };
    bound.define("MIXED_LEVELS", tree.levels());
    bound.define("PROBES", tree.probe_count());
    let index = tree.index().iter().map(|&entry| entry as u32).collect();
    bound.textures.push(Texture { name: "gridIndex", channels: 1, numbers: Numbers::U32(index) });
}

/// A number as GLSL reads it.
fn float(number: f32) -> String {
    format!("{number:?}")
}

impl QuerySettings {
    /// Whether a look-up reads what is stored about occlusion, which can be asked by the test of that name.
    fn asks(&self, stored: Option<&str>) -> bool {
        self.look_up == LookUp::Towards || stored == Some(self.test.name())
    }

    /// Its rules by the names that the text is compiled with.
    fn define(&self, grid: &Grid, bound: &mut Bound) {
        let (kind, number) = match self.direction {
            DirectionWeight::Uniform => (0, 0.0),
            DirectionWeight::Cosine { floor } => (1, floor),
            DirectionWeight::Wrap { offset } => (2, offset),
            DirectionWeight::Eccentric { kappa } => (3, kappa),
        };
        bound.define("DIRECTION", kind);
        bound.define("DIRECTION_NUMBER", float(number));
        bound.define("TRILINEAR_FLOOR", float(self.trilinear_floor));
        bound.define("WEIGHT_FLOOR", float(self.weight_floor));
        if let VisibilityTest::Chebyshev { power, floor } = self.test {
            bound.define("TEST_POWER", float(power));
            bound.define("TEST_FLOOR", float(floor));
        }
        // Without a shift nothing has to be added to positions.
        if self.reach() > 0.0 || matches!(self.test, VisibilityTest::Chebyshev { .. }) {
            bound.define("BIAS_SPACING", float(self.spacing(grid)));
            bound.define("NORMAL_BIAS", float(self.normal_bias));
            bound.define("VIEW_BIAS", float(self.view_bias));
            bound.define("DISTANCE_BIAS", float(self.distance_bias));
        }
        let mut above_zero = |name, number: f32| {
            if number > 0.0 {
                bound.define(name, float(number));
            }
        };
        above_zero("CRUSH_BELOW", self.crush_below);
        above_zero("BLANK_BELOW", self.blank_below);
        above_zero("SUM_FLOOR", self.sum_floor);
        let mut set = |name, holds: bool| {
            if holds {
                bound.define(name, 1);
            }
        };
        set("WEIGHT_GEOMETRIC", self.weight_normal == WeightNormal::Geometric);
        set("UNBIASED_CELL", !self.biased_cell);
        set("BLEND_SQUARE_ROOT", self.blend == Blend::SquareRoot);
        set("TOWARDS", self.look_up == LookUp::Towards);
    }
}

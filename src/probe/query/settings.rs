//! What a method says about asking its probes.

use glam::Vec3A;
use serde::{Deserialize, Serialize};

use super::glossy::{Diffuse, Glossy};
use crate::probe::lattice::Grid;
use crate::probe::store::OcclusionStore;
use crate::probe::store::surface::{MAX_VOXELS_PER_CELL, TableTest};

/// A method's weights: the factors multiply in the order of these fields.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QuerySettings {
    pub direction: DirectionWeight,
    /// The normal that direction weights and the bias take.
    pub weight_normal: WeightNormal,
    pub test: VisibilityTest,
    /// Smallest trilinear weight along each axis.
    pub trilinear_floor: f32,
    /// Smallest weight before `crush_below` and the trilinear factor.
    pub weight_floor: f32,
    /// Weights w below this threshold t become w³/t², which silences probes that hardly count; 0 turns it off.
    pub crush_below: f32,
    pub blend: Blend,
    /// Shift of the looked-up point along its normal, in spacings.
    pub normal_bias: f32,
    /// Shift of the looked-up point towards the viewer, in spacings.
    pub view_bias: f32,
    /// Whether the shifted point also chooses the cell and the trilinear weights; else only the visibility test sees the
    /// shift.
    pub biased_cell: bool,
    /// What biases are relative to where spacings differ.
    pub bias_spacing: BiasSpacing,
    /// Distances to probes count as shorter by this in the visibility test, in spacings.
    pub distance_bias: f32,
    /// Where every weight is below this, there is no light.
    pub blank_below: f32,
    /// Where probes hold coefficients, whose sum may be negative, a point gets at least this share of their mean irradiance.
    pub sum_floor: f32,
    /// The direction that probes' irradiance is looked up around.
    pub look_up: LookUp,
    /// Smallest weight of a probe in all, before weights are normalised.
    pub least_weight: f32,
    /// Where glossy surfaces find their light.
    pub glossy: Glossy,
    /// Where pictures find their irradiance besides.
    pub diffuse: Diffuse,
}

/// The spacing that lengths are relative to where the grid's differ along its axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BiasSpacing {
    Largest,
    Smallest,
}

impl Default for QuerySettings {
    fn default() -> Self {
        QuerySettings {
            direction: DirectionWeight::Uniform,
            weight_normal: WeightNormal::Shading,
            test: VisibilityTest::default(),
            trilinear_floor: 0.0,
            weight_floor: 0.0,
            crush_below: 0.0,
            blend: Blend::Linear,
            normal_bias: 0.0,
            view_bias: 0.0,
            biased_cell: true,
            bias_spacing: BiasSpacing::Largest,
            distance_bias: 0.0,
            blank_below: 0.0,
            sum_floor: 0.0,
            look_up: LookUp::Normal,
            least_weight: 0.0,
            glossy: Glossy::None,
            diffuse: Diffuse::Stored,
        }
    }
}

/// Weight by the cosine c between the normal and the direction from the point to the probe.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DirectionWeight {
    /// 1.
    Uniform,
    /// max(floor, c).
    Cosine { floor: f32 },
    /// ((c + 1)/2)² + offset.
    Wrap { offset: f32 },
    /// (κc + √(1 − (1 − c²)κ²))/(κ + 1): 1 at c = 1, (1 − κ)/(1 + κ) at c = −1 (Fei Yang 2023).
    Eccentric { kappa: f32 },
}

/// Which of a point's normals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WeightNormal {
    Shading,
    /// Of the surface itself.
    Geometric,
}

/// Where a look-up reads a probe's irradiance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LookUp {
    /// Around the shading normal n.
    Normal,
    /// Around the direction from the probe to P′ + μ(n)·n, μ(n) the mean distance that the probe knows along n: to where the
    /// light comes from that falls along n (a version of the shader of Fei Yang 2023).
    Towards,
}

/// How a look-up decides which probes a point sees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum VisibilityTest {
    /// Every probe counts as visible.
    None,
    /// Chebyshev's bound from the stored moments of distance, to a power, not below a floor.
    Chebyshev { power: f32, floor: f32 },
    /// Visibility at surfaces.
    Table(TableTest),
    /// The same, but of a file that holds entries alone ([`crate::probe::store::surface`]) it takes, where there is none, what
    /// the nearest surface sees that faces the point, and without one all. Trees have an answer everywhere.
    Everywhere(TableTest),
}

impl Default for VisibilityTest {
    fn default() -> Self {
        VisibilityTest::Table(TableTest::default())
    }
}

/// How the eight irradiances are combined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Blend {
    Linear,
    /// Means of square roots, squared (Majercik et al. 2019).
    SquareRoot,
}

impl QuerySettings {
    /// How far from its surface a point may be looked up, in spacings.
    pub fn reach(&self) -> f32 {
        self.normal_bias.abs() + self.view_bias.abs()
    }

    /// The spacing that biases are relative to, metres.
    #[inline]
    pub fn spacing(&self, grid: &Grid) -> f32 {
        match self.bias_spacing {
            BiasSpacing::Largest => grid.spacing_max(),
            BiasSpacing::Smallest => grid.spacing_min(),
        }
    }

    fn weights_need_normal(&self) -> bool {
        self.direction != DirectionWeight::Uniform || self.normal_bias != 0.0
    }

    /// Whether a look-up needs the point's shading normal besides the direction that it asks for.
    pub fn needs_normal(&self) -> bool {
        self.look_up == LookUp::Towards || self.weight_normal == WeightNormal::Shading && self.weights_need_normal()
    }

    /// Whether it needs the point's geometric normal.
    pub fn needs_geometric(&self) -> bool {
        self.weight_normal == WeightNormal::Geometric && self.weights_need_normal()
    }

    /// Whether weights depend on the direction to the viewer.
    pub fn needs_view(&self) -> bool {
        self.view_bias != 0.0
    }

    /// Whether all probes that a point asks are read around one direction, its shading normal.
    pub fn asks_one_direction(&self) -> bool {
        self.look_up == LookUp::Normal
    }

    /// Whether a look-up is a linear function of the probes' irradiance.
    pub fn is_linear(&self) -> bool {
        self.blend == Blend::Linear
    }

    /// Why this test cannot be asked of that store, with the remedy; `None` where it can.
    pub fn mismatch(&self, store: &OcclusionStore) -> Option<String> {
        let (test, written) = store.test();
        let name = store.name();
        if self.test.name() != test {
            let other = self.test.stores();
            return Some(format!(
                "store.occlusion is {name}: query.test must be {written}; or make store.occlusion {other}"
            ));
        }
        let blind = self.look_up == LookUp::Towards && !store.knows_distances();
        blind.then(|| format!("store.occlusion is {name} and knows no distances: query.look_up must be normal"))
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        const UNIT: &str = "use a number from 0 to 1";
        let mut unit = |key: &'static str, x: f32| rule(key, x.to_string(), (0.0..=1.0).contains(&x), UNIT);
        unit("query.trilinear_floor", self.trilinear_floor);
        unit("query.weight_floor", self.weight_floor);
        unit("query.crush_below", self.crush_below);
        unit("query.normal_bias", self.normal_bias);
        unit("query.view_bias", self.view_bias);
        unit("query.distance_bias", self.distance_bias);
        unit("query.blank_below", self.blank_below);
        unit("query.sum_floor", self.sum_floor);
        unit("query.least_weight", self.least_weight);
        self.glossy.check(rule);
        self.diffuse.check(rule);
        let mut unit = |key: &'static str, x: f32| rule(key, x.to_string(), (0.0..=1.0).contains(&x), UNIT);
        match self.direction {
            DirectionWeight::Uniform => {}
            DirectionWeight::Cosine { floor } => unit("query.direction.cosine.floor", floor),
            DirectionWeight::Wrap { offset } => unit("query.direction.wrap.offset", offset),
            DirectionWeight::Eccentric { kappa } => unit("query.direction.eccentric.kappa", kappa),
        }
        match self.test {
            VisibilityTest::None => {}
            VisibilityTest::Chebyshev { power, floor } => {
                unit("query.test.chebyshev.floor", floor);
                let holds = power.is_finite() && power >= 0.0;
                rule("query.test.chebyshev.power", power.to_string(), holds, "use a finite number, not negative");
            }
            VisibilityTest::Table(table) => {
                unit("query.test.table.strip", table.strip);
                let holds = table.reach_voxels <= MAX_VOXELS_PER_CELL;
                rule("query.test.table.reach_voxels", table.reach_voxels.to_string(), holds, "use 0 to 22");
            }
            VisibilityTest::Everywhere(table) => {
                unit("query.test.everywhere.strip", table.strip);
                let holds = table.reach_voxels <= MAX_VOXELS_PER_CELL;
                rule("query.test.everywhere.reach_voxels", table.reach_voxels.to_string(), holds, "use 0 to 22");
            }
        }
    }
}

impl VisibilityTest {
    /// Name in configurations of the test of what is stored that it makes.
    pub fn name(&self) -> &'static str {
        match self {
            VisibilityTest::None => "none",
            VisibilityTest::Chebyshev { .. } => "chebyshev",
            VisibilityTest::Table(_) | VisibilityTest::Everywhere(_) => "table",
        }
    }

    /// What it can be asked of, as it is written in configurations.
    fn stores(&self) -> &'static str {
        match self {
            VisibilityTest::None => "none",
            VisibilityTest::Chebyshev { .. } => "moments() or tiles()",
            VisibilityTest::Table(_) | VisibilityTest::Everywhere(_) => "surface()",
        }
    }
}

impl DirectionWeight {
    #[inline]
    pub(super) fn at(self, cosine: impl FnOnce() -> f32) -> f32 {
        match self {
            DirectionWeight::Uniform => 1.0,
            DirectionWeight::Cosine { floor } => cosine().max(floor),
            DirectionWeight::Wrap { offset } => (0.5 * (cosine() + 1.0)).powi(2) + offset,
            DirectionWeight::Eccentric { kappa } => {
                let c = cosine();
                // Rounding may take the cosine beyond 1.
                let across = 1.0 - (1.0 - c * c).max(0.0) * kappa * kappa;
                (kappa * c + across.sqrt()) / (kappa + 1.0)
            }
        }
    }
}

impl Blend {
    #[inline]
    pub(super) fn forward(self, irradiance: Vec3A) -> Vec3A {
        match self {
            Blend::Linear => irradiance,
            Blend::SquareRoot => irradiance.max(Vec3A::ZERO).map(f32::sqrt),
        }
    }

    #[inline]
    pub(super) fn backward(self, sum: Vec3A) -> Vec3A {
        match self {
            Blend::Linear => sum,
            Blend::SquareRoot => sum * sum,
        }
    }
}

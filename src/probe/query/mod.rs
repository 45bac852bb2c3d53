//! Asking the probes for the irradiance at a surface point: eight probes, weighted.
//!
//! Every published weighting is a value of [`QuerySettings`]; the factors multiply in the order of its fields.

use glam::{Vec2, Vec3, Vec3A};
use serde::{Deserialize, Serialize};

use crate::math::octahedral::oct_from_direction;
use crate::probe::lattice::grid::ProbeIndex;
use crate::probe::store::surface::{Facing, Seen};
use crate::probe::store::volume::Volume;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QuerySettings {
    pub direction: DirectionWeight,
    pub visibility: VisibilitySettings,
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
}

/// Weight by the cosine c between the normal and the direction to the probe.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DirectionWeight {
    /// 1.
    Uniform,
    /// max(floor, c).
    Cosine { floor: f32 },
    /// ((c + 1)/2)² + offset.
    Wrap { offset: f32 },
}

/// How the method knows which probes a point sees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum VisibilitySettings {
    /// Every probe counts as visible.
    None,
    /// Chebyshev's bound from the stored distance moments (Donnelly & Lauritzen 2006), to a power, not below a floor.
    Moments { power: f32, floor: f32 },
    /// Visibility measured at the surfaces themselves, see [`crate::probe::store::surface`].
    Surface { voxels_per_cell: u32 },
}

/// How the eight irradiances are combined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Blend {
    Linear,
    /// Means of square roots, squared (Majercik et al. 2019).
    SquareRoot,
}

impl Default for QuerySettings {
    fn default() -> Self {
        QuerySettings {
            direction: DirectionWeight::Uniform,
            visibility: VisibilitySettings::Surface { voxels_per_cell: 8 },
            trilinear_floor: 0.0,
            weight_floor: 0.0,
            crush_below: 0.0,
            blend: Blend::Linear,
            normal_bias: 0.0,
            view_bias: 0.0,
        }
    }
}

impl QuerySettings {
    /// How far from its surface a point may be looked up, in spacings.
    pub fn reach(&self) -> f32 {
        self.normal_bias.abs() + self.view_bias.abs()
    }

    /// Whether weights depend on the point's shading normal.
    pub fn weighs_by_normal(&self) -> bool {
        self.direction != DirectionWeight::Uniform || self.normal_bias != 0.0
    }
}

/// A surface point that asks for irradiance.
#[derive(Debug, Clone, Copy)]
pub struct QueryPoint {
    /// Relative to the scene's origin.
    pub position: Vec3,
    /// Shading normal, unit: irradiance is asked for around it.
    pub normal: Vec3,
    /// Of the geometric normal on the viewer's side.
    pub facing: Facing,
    /// Unit, towards the viewer; in the bake towards the probe.
    pub view: Vec3,
}

/// Where the visibility factor comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Visibility {
    /// 1 for every probe.
    Off,
    /// What the method stores.
    Stored,
    /// Bit i: whether corner i of the cell is visible.
    Exact(u8),
}

/// The eight probes of a point, in the order of [`crate::probe::Grid::corner`], with their weights, not normalised.
#[derive(Debug, Clone, Copy)]
pub struct CornerWeights {
    pub probes: [ProbeIndex; 8],
    pub weights: [f32; 8],
}

impl CornerWeights {
    pub fn total(&self) -> f32 {
        self.weights.iter().sum()
    }
}

/// A volume and the way to ask it.
pub struct Query<'v> {
    pub volume: &'v Volume,
    pub settings: &'v QuerySettings,
}

impl Query<'_> {
    /// Weights of the eight probes around a point; inactive probes weigh nothing.
    pub fn weights(&self, point: &QueryPoint, visibility: Visibility) -> CornerWeights {
        let (volume, settings) = (self.volume, self.settings);
        let grid = &volume.grid;
        let cell = grid.cell(point.position);
        let seen = match (visibility, &volume.surface_visibility) {
            (Visibility::Stored, Some(surface)) => surface.look_up(grid, point.position, point.facing),
            (Visibility::Exact(mask), _) => Seen { mask, far: None },
            _ => Seen { mask: u8::MAX, far: None },
        };
        let bias = (point.normal * settings.normal_bias + point.view * settings.view_bias) * grid.spacing_max();
        let biased = point.position + bias;
        let mut out = CornerWeights { probes: [ProbeIndex(0); 8], weights: [0.0; 8] };
        if let Some(far) = seen.far {
            out.probes[0] = far;
            out.weights[0] = 1.0;
            return out;
        }
        for i in 0..8 {
            let probe = grid.corner(cell.base, i);
            out.probes[i as usize] = probe;
            let trilinear = floored_trilinear(cell.fraction, i, settings.trilinear_floor);
            if trilinear <= 0.0 || seen.mask >> i & 1 == 0 || !volume.is_active(probe) {
                continue;
            }
            let to_probe = || (volume.position(probe) - point.position).normalize_or_zero();
            let mut weight = settings.direction.at(|| to_probe().dot(point.normal));
            if let (Visibility::Stored, VisibilitySettings::Moments { power, floor }) =
                (visibility, settings.visibility)
            {
                weight *= self.chebyshev(probe, biased).powf(power).max(floor);
            }
            weight = weight.max(settings.weight_floor);
            if weight < settings.crush_below {
                weight *= (weight / settings.crush_below).powi(2);
            }
            out.weights[i as usize] = weight * trilinear;
        }
        out
    }

    /// Upper bound of the share of the probe's surroundings at least as far as the point: σ²/(σ² + (d − μ)²) behind
    /// the mean distance μ, 1 before it.
    fn chebyshev(&self, probe: ProbeIndex, position: Vec3) -> f32 {
        let Some(maps) = &self.volume.distance else { return 1.0 };
        let from_probe = position - self.volume.position(probe);
        let distance = from_probe.length();
        if distance == 0.0 {
            return 1.0;
        }
        let (map, taps) = (maps.probe(probe.0 as usize), maps.taps(oct_from_direction(from_probe)));
        let tap = |i: usize| map[taps.offset[i] as usize];
        let mean: f32 = (0..4).map(|i| tap(i).x * taps.weight[i]).sum();
        let excess = distance - mean;
        if excess <= 0.0 {
            return 1.0;
        }
        // Variance of the four taps' mixture, about its own mean: no difference of large squares.
        let variance: f32 = (0..4)
            .map(|i| {
                let Vec2 { x, y } = tap(i);
                (y * y + (x - mean) * (x - mean)) * taps.weight[i]
            })
            .sum();
        variance / (variance + excess * excess)
    }

    /// Irradiance around the point's normal, W·m⁻²; zero where no probe counts.
    pub fn irradiance(&self, point: &QueryPoint, visibility: Visibility) -> Vec3 {
        self.blend(&self.weights(point, visibility), oct_from_direction(point.normal))
    }

    /// Weighted mean of the probes' irradiance around the direction `oct`.
    pub fn blend(&self, corners: &CornerWeights, oct: Vec2) -> Vec3 {
        let total = corners.total();
        if total <= 0.0 {
            return Vec3::ZERO;
        }
        let volume = self.volume;
        // One set of taps serves all eight probes: they share the direction.
        let taps = volume.irradiance.taps(oct);
        // Crushed weights may be so small that the reciprocal of their sum overflows; their shares are the same.
        let lift = if total < f32::MIN_POSITIVE { 1.0 / f32::MIN_POSITIVE } else { 1.0 };
        let per_total = 1.0 / (total * lift);
        let mut sum = Vec3A::ZERO;
        for (probe, weight) in corners.probes.iter().zip(corners.weights) {
            if weight > 0.0 {
                let irradiance = volume.curve.decode(volume.irradiance.sample(probe.0 as usize, &taps));
                sum += self.settings.blend.forward(irradiance) * (weight * lift * per_total);
            }
        }
        self.settings.blend.backward(sum).into()
    }
}

impl DirectionWeight {
    fn at(self, cosine: impl FnOnce() -> f32) -> f32 {
        match self {
            DirectionWeight::Uniform => 1.0,
            DirectionWeight::Cosine { floor } => cosine().max(floor),
            DirectionWeight::Wrap { offset } => (0.5 * (cosine() + 1.0)).powi(2) + offset,
        }
    }
}

impl Blend {
    pub fn is_linear(self) -> bool {
        self == Blend::Linear
    }

    fn forward(self, irradiance: Vec3A) -> Vec3A {
        match self {
            Blend::Linear => irradiance,
            Blend::SquareRoot => irradiance.max(Vec3A::ZERO).map(f32::sqrt),
        }
    }

    fn backward(self, sum: Vec3A) -> Vec3A {
        match self {
            Blend::Linear => sum,
            Blend::SquareRoot => sum * sum,
        }
    }
}

/// Trilinear weight of corner `i`, no axis below `floor`; without a floor the eight sum to 1.
fn floored_trilinear(fraction: Vec3, i: u32, floor: f32) -> f32 {
    let along = |bit: u32, f: f32| (if i >> bit & 1 == 1 { f } else { 1.0 - f }).max(floor);
    along(0, fraction.x) * along(1, fraction.y) * along(2, fraction.z)
}

#[cfg(test)]
mod tests;

//! Visibility from the moments of distance that probes store: Chebyshev's bound (Donnelly & Lauritzen, *Variance Shadow
//! Maps*, I3D 2006), on means and deviations instead of means of squares, which would cancel.

use glam::{Vec2, Vec3};
use safetensors::Dtype;
use serde::{Deserialize, Serialize};

use super::encode::{u16_from_unit, unit_from_u16};
use super::irradiance::texel_directions;
use super::kernel::{Directions, Kernel};
use super::map::{OctahedralMaps, fill_with_border};
use crate::math::octahedral::oct_from_direction;
use crate::math::statistics::Moments;
use crate::probe::container::{Container, EncodingLosses};

/// How distances are filtered and stored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MomentsStore {
    /// Interior texels per side.
    pub resolution: usize,
    /// Exponent k of the lobe max(0, ω·d)^k that distances are averaged under.
    pub exponent: f32,
    /// Distances beyond this many cell diagonals count as this; so do misses.
    pub clamp: f32,
}

impl Default for MomentsStore {
    /// The lobe and the clamp of Majercik et al. 2019, at their resolution.
    fn default() -> Self {
        MomentsStore { resolution: 14, exponent: 50.0, clamp: 1.5 }
    }
}

/// Mean and deviation as two u16 per texel.
const TEXEL_BYTES: usize = 4;
/// `distance_scale`, f32 per probe.
const SCALE_BYTES: usize = 4;

impl MomentsStore {
    /// Bytes of one probe in the layout that shading uses; `scaled`: with a scale of its own.
    pub fn runtime_bytes(&self, border: usize, scaled: bool) -> usize {
        (self.resolution + 2 * border).pow(2) * TEXEL_BYTES + if scaled { SCALE_BYTES } else { 0 }
    }

    /// The filter from captured distances.
    pub fn kernel(&self, captured: &Directions) -> Kernel {
        Kernel::lobe(captured, &texel_directions(self.resolution), self.exponent)
    }
}

/// The distance maps of all probes while they are captured.
pub struct MomentsBuilder {
    kernel: Kernel,
    maps: OctahedralMaps<Vec2>,
}

impl MomentsBuilder {
    pub fn new(store: &MomentsStore, captured: &Directions, probes: usize, border: usize) -> MomentsBuilder {
        MomentsBuilder {
            kernel: store.kernel(captured),
            maps: OctahedralMaps::new(probes, store.resolution, border, Vec2::ZERO),
        }
    }

    /// Mean and deviation of distance around every texel's direction from those within every captured texel, metres.
    pub fn filter(&self, captured: &[Moments]) -> Vec<Vec2> {
        let moments = self.kernel.distance(captured);
        moments.iter().map(|m| Vec2::new(m.mean() as f32, m.variance().sqrt() as f32)).collect()
    }

    /// Keeps what [`Self::filter`] gave for a probe.
    pub fn set(&mut self, probe: usize, filtered: &[Vec2]) {
        fill_with_border(filtered, self.maps.resolution, self.maps.border, self.maps.probe_mut(probe));
    }

    pub fn finish(self) -> OctahedralMaps<Vec2> {
        self.maps
    }
}

/// Upper bound of the share of a probe's surroundings that are at least as far as the point: σ²/(σ² + (d − μ)²) behind the
/// mean distance μ, 1 before it. `from_probe` leads from the probe to the point, metres.
pub fn chebyshev(maps: &OctahedralMaps<Vec2>, probe: usize, from_probe: Vec3) -> f32 {
    chebyshev_shortened(maps, probe, from_probe, 0.0)
}

/// The same for a point that counts as nearer by `shorter`, metres.
#[inline]
pub fn chebyshev_shortened(maps: &OctahedralMaps<Vec2>, probe: usize, from_probe: Vec3, shorter: f32) -> f32 {
    let distance = from_probe.length();
    if distance == 0.0 {
        return 1.0;
    }
    let distance = distance - shorter;
    let (map, taps) = (maps.probe(probe), maps.taps(oct_from_direction(from_probe)));
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

/// Names in the file.
const TENSOR: &str = "distance";
const SCALES: &str = "distance_scale";

/// Whether a file holds distance maps.
pub fn is_in(container: &Container) -> bool {
    container.has(TENSOR)
}

/// Writes the maps, each probe's relative to its largest value.
pub fn write(maps: &OctahedralMaps<Vec2>, container: &mut Container, losses: &mut EncodingLosses) {
    let side = maps.side();
    let probes = maps.texels.len() / (side * side);
    let mut scales = Vec::with_capacity(probes);
    let mut codes = Vec::with_capacity(maps.texels.len() * 2);
    for probe in 0..probes {
        let map = maps.probe(probe);
        let scale = map.iter().map(|t| t.max_element()).fold(0.0, f32::max);
        scales.push(scale);
        let unit = if scale > 0.0 { 1.0 / scale } else { 0.0 };
        for texel in map {
            let code = [u16_from_unit(texel.x * unit), u16_from_unit(texel.y * unit)];
            losses.variance_floor_hits += u64::from(scale > 0.0 && code[1] == 0);
            codes.extend(code);
        }
    }
    container.put(SCALES, Dtype::F32, &[probes], scales.into_iter().map(f32::to_le_bytes));
    container.put(TENSOR, Dtype::U16, &[probes, side, side, 2], codes.into_iter().map(u16::to_le_bytes));
}

/// Reads the maps; inverse of [`write`] up to rounding.
///
/// # Errors
/// What is missing or out of range.
pub fn read(container: &Container, probes: usize, border: usize) -> Result<OctahedralMaps<Vec2>, String> {
    let tensor = container.tensor(TENSOR, &[Dtype::U16], &[Some(probes), None, None, Some(2)])?;
    let scales = container.tensor(SCALES, &[Dtype::F32], &[Some(probes)])?.f32s();
    if scales.iter().any(|s| !(s.is_finite() && *s >= 0.0)) {
        return Err(format!("tensor '{SCALES}' holds numbers that are no distances"));
    }
    let resolution = tensor.map_resolution(TENSOR, border)?;
    let per_probe = (resolution + 2 * border).pow(2);
    let units: Vec<f32> = tensor.u16s().map(unit_from_u16).collect();
    let pairs = units.as_chunks::<2>().0;
    let texels = pairs.iter().enumerate().map(|(i, t)| Vec2::from(*t) * scales[i / per_probe]).collect();
    Ok(OctahedralMaps { resolution, border, texels })
}

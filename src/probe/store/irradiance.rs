//! Irradiance as probes hold it: the settings, the values in memory, and the linear unknowns that the solver works on.

mod bound;
mod factors;
mod settings;

use std::borrow::Cow;

use glam::{Vec2, Vec3, Vec3A};
use rayon::prelude::*;
use safetensors::Dtype;
use serde_json::Value;

pub use self::factors::Factors;
pub use self::settings::{Fineness, IrradianceCurve, IrradianceStore, OctahedralStore};
use super::encode::{ColorFormat, decode_colors, encode_colors};
use super::kernel::{Directions, Kernel};
use super::map::{OctahedralMaps, fill_with_border, interior_texel};
use super::sh::{self, ShIrradiance};
use crate::math::harmonics;
use crate::math::octahedral::{oct_from_direction, solid_angle_density, texel_centre, texel_direction};
use crate::probe::container::{Container, EncodingLosses};

impl IrradianceStore {
    /// Black irradiance for `probes` probes.
    pub fn zeros(&self, probes: usize, border: usize) -> Irradiance {
        match self {
            IrradianceStore::Octahedral(store) => {
                let maps = OctahedralMaps::new(probes, store.resolution, border, Vec3A::ZERO);
                Irradiance::Maps { maps, curve: store.curve, format: store.format }
            }
            IrradianceStore::Sh9(store) => Irradiance::Sh9(ShIrradiance::zeros(store, probes)),
        }
    }
}

/// Irradiance of all probes, ready to be asked.
#[derive(Debug, Clone, PartialEq)]
pub enum Irradiance {
    /// Four floats a texel in the domain of `curve`, so that a look-up adds whole registers; `format` is that of the file.
    Maps { maps: OctahedralMaps<Vec3A>, curve: IrradianceCurve, format: ColorFormat },
    /// Coefficients, see [`super::sh`].
    Sh9(ShIrradiance),
}

/// What unknowns are irradiance of, apart from the probes: turns samples of light into unknowns.
pub enum Lobes {
    /// Around each of these normals.
    Cosines(Vec<Vec3>),
    Harmonics,
}

impl Lobes {
    /// The unknowns that directional samples give, each with radiance ÷ density, W·m⁻².
    pub fn of_samples(&self, samples: &[(Vec3, Vec3)]) -> Vec<Vec3A> {
        let around = |normal: &Vec3| -> Vec3 {
            samples.iter().map(|(direction, light)| *light * normal.dot(*direction).max(0.0)).sum()
        };
        match self {
            Lobes::Cosines(normals) => normals.iter().map(|normal| around(normal).into()).collect(),
            Lobes::Harmonics => ShIrradiance::of_samples(samples),
        }
    }
}

impl Irradiance {
    /// Offsets along an axis are clipped to this many spacings either way.
    pub const FARTHEST: f32 = sh::FARTHEST;

    /// Σ weight · forward(irradiance around `oct`) over some probes, W·m⁻²; `offset` tells how far a probe is from the point
    /// that asks, see [`Self::FARTHEST`].
    #[inline]
    pub fn sum(
        &self,
        oct: Vec2,
        parts: impl Iterator<Item = (usize, f32)>,
        offset: impl Fn(usize) -> Vec3,
        forward: impl Fn(Vec3A) -> Vec3A,
    ) -> Vec3A {
        match self {
            Irradiance::Maps { maps, curve, .. } => {
                // One direction serves all probes.
                let taps = maps.taps(oct);
                let mut sum = Vec3A::ZERO;
                for (probe, weight) in parts {
                    sum += forward(curve.decode(maps.sample(probe, &taps))) * weight;
                }
                sum
            }
            Irradiance::Sh9(sh) => sh.sum(oct, parts, offset, forward),
        }
    }

    /// A probe's irradiance around a unit normal, W·m⁻².
    pub fn of(&self, probe: usize, normal: Vec3) -> Vec3 {
        let oct = oct_from_direction(normal);
        match self {
            Irradiance::Maps { maps, curve, .. } => curve.decode(maps.sample(probe, &maps.taps(oct))),
            Irradiance::Sh9(sh) => sh.at(probe, oct).max(Vec3A::ZERO),
        }
        .into()
    }

    /// The filter from captured radiance to a probe's unknowns ÷ π.
    pub fn kernel(&self, captured: &Directions) -> Kernel {
        match self.lobes() {
            Lobes::Cosines(axes) => Kernel::cosine(captured, &axes),
            Lobes::Harmonics => Kernel::harmonics(captured),
        }
    }

    /// What a probe's unknowns are irradiance of.
    pub fn lobes(&self) -> Lobes {
        match self {
            Irradiance::Maps { .. } => Lobes::Cosines(self.axes().into_iter().map(|(axis, _)| axis).collect()),
            Irradiance::Sh9(_) => Lobes::Harmonics,
        }
    }

    /// Whether what is looked up is a linear function of the unknowns.
    pub fn is_linear(&self) -> bool {
        match self {
            Irradiance::Maps { curve, .. } => *curve == IrradianceCurve::Linear,
            Irradiance::Sh9(_) => true,
        }
    }

    /// The domain in which values are stored, and mixed over time.
    pub fn curve(&self) -> IrradianceCurve {
        match self {
            Irradiance::Maps { curve, .. } => *curve,
            Irradiance::Sh9(_) => IrradianceCurve::Linear,
        }
    }

    /// Linear unknowns of one probe.
    pub fn unknowns(&self) -> usize {
        match self {
            Irradiance::Maps { maps, .. } => maps.resolution * maps.resolution,
            Irradiance::Sh9(_) => harmonics::COUNT,
        }
    }

    /// Where unknowns have signs and only the first of each probe is irradiance, its mean: how many they are, and the most
    /// that irradiance may exceed π times the largest radiance by, as a factor. `None` where all are irradiance.
    pub fn signed(&self) -> Option<(usize, f32)> {
        match self {
            Irradiance::Maps { .. } => None,
            Irradiance::Sh9(sh) => Some((harmonics::COUNT, sh.overshoot())),
        }
    }

    /// The coefficients, where it is held as such.
    pub fn harmonics(&self) -> Option<&ShIrradiance> {
        if let Irradiance::Sh9(sh) = self { Some(sh) } else { None }
    }

    /// Directions in which irradiance is compared, each with its weight, sr per area of the octahedral square: the normals
    /// of the unknowns where these are irradiance.
    pub fn axes(&self) -> Vec<(Vec3, f32)> {
        let n = match self {
            Irradiance::Maps { maps, .. } => maps.resolution,
            Irradiance::Sh9(sh) => Fineness::of_harmonics(&sh.store()).resolution,
        };
        let oct = |o: usize| Vec2::new(texel_centre(o % n, n), texel_centre(o / n, n));
        (0..n * n).map(|o| (texel_direction(o % n, o / n, n), solid_angle_density(oct(o)))).collect()
    }

    /// Irradiance along [`Self::axes`] from the unknowns of one probe.
    pub fn along_axes<'u>(&self, unknowns: &'u [Vec3A]) -> Cow<'u, [Vec3A]> {
        match self {
            Irradiance::Maps { .. } => unknowns.into(),
            Irradiance::Sh9(_) if unknowns.is_empty() => unknowns.into(),
            Irradiance::Sh9(_) => {
                let axes: Vec<Vec3> = self.axes().into_iter().map(|(axis, _)| axis).collect();
                ShIrradiance::along(unknowns, &axes).collect()
            }
        }
    }

    /// The unknowns of one probe, W·m⁻².
    pub fn probe(&self, probe: usize) -> Box<dyn Iterator<Item = Vec3> + '_> {
        match self {
            Irradiance::Maps { maps, curve, .. } => {
                let map = maps.probe(probe);
                let interior = interior_texel(maps.resolution, maps.border);
                Box::new((0..self.unknowns()).map(move |o| curve.decode(map[interior(o)]).into()))
            }
            Irradiance::Sh9(sh) => Box::new(sh.probe(probe).map(Vec3::from)),
        }
    }

    /// Sets the unknowns of the probes for which there are some, in parallel: `values(probe, before)` gets the unknowns as
    /// they are and gives those that shall be, W·m⁻². The results are in the order of the probes.
    pub fn set_each<R: Send>(
        &mut self,
        values: impl Fn(usize, &mut dyn Iterator<Item = Vec3A>) -> Option<(Vec<Vec3A>, R)> + Sync,
    ) -> Vec<Option<R>> {
        let (maps, curve) = match self {
            Irradiance::Maps { maps, curve, .. } => (maps, *curve),
            Irradiance::Sh9(sh) => return sh.set_each(values),
        };
        let (resolution, border) = (maps.resolution, maps.border);
        let interior = interior_texel(resolution, border);
        let set = |(probe, map): (usize, &mut [Vec3A])| {
            let mut before = (0..resolution * resolution).map(|o| curve.decode(map[interior(o)]));
            let (mut values, result) = values(probe, &mut before)?;
            values.iter_mut().for_each(|e| *e = curve.encode(*e));
            fill_with_border(&values, resolution, border, map);
            Some(result)
        };
        let per_probe = maps.texels_per_probe();
        maps.texels.par_chunks_mut(per_probe).enumerate().map(set).collect()
    }

    /// Sets the unknowns of one probe, W·m⁻².
    pub fn set_probe(&mut self, probe: usize, values: &[Vec3A]) {
        match self {
            Irradiance::Maps { maps, curve, .. } => {
                let stored: Vec<Vec3A> = values.iter().map(|e| curve.encode(*e)).collect();
                fill_with_border(&stored, maps.resolution, maps.border, maps.probe_mut(probe));
            }
            Irradiance::Sh9(sh) => sh.set_probe(probe, values),
        }
    }

    /// Irradiance as a function of the unknowns of a fit.
    pub fn factors(&self) -> Factors<'_> {
        match self {
            Irradiance::Maps { maps, .. } => Factors::of_maps(maps),
            Irradiance::Sh9(sh) => Factors::of_harmonics(sh),
        }
    }

    /// Unknowns of a fit of one probe: those of the solver, and the gradient where there is one.
    pub fn fitted_unknowns(&self) -> usize {
        match self {
            Irradiance::Maps { .. } => self.unknowns(),
            Irradiance::Sh9(sh) => sh.fitted_unknowns(),
        }
    }

    /// These of a probe, W·m⁻².
    pub fn fitted(&self, probe: usize) -> Vec<Vec3A> {
        match self {
            Irradiance::Maps { .. } => self.probe(probe).map(Vec3A::from).collect(),
            Irradiance::Sh9(sh) => sh.fitted(probe),
        }
    }

    /// Sets them.
    pub fn set_fitted(&mut self, probe: usize, values: &[Vec3A]) {
        match self {
            Irradiance::Maps { .. } => self.set_probe(probe, values),
            Irradiance::Sh9(sh) => sh.set_fitted(probe, values),
        }
    }

    /// That of some probes, in this order.
    pub fn of_probes(&self, probes: &[usize]) -> Irradiance {
        match self {
            Irradiance::Maps { maps, curve, format } => {
                Irradiance::Maps { maps: maps.of_probes(probes), curve: *curve, format: *format }
            }
            Irradiance::Sh9(sh) => Irradiance::Sh9(sh.of_probes(probes)),
        }
    }

    /// Everything as it is stored, for checkpoints; inverse of [`Self::restore`].
    pub fn stored(&self) -> Box<dyn ExactSizeIterator<Item = Vec3> + '_> {
        match self {
            Irradiance::Maps { maps, .. } => Box::new(maps.texels.iter().map(|&t| t.into())),
            Irradiance::Sh9(sh) => Box::new(sh.stored()),
        }
    }

    /// Puts back what [`Self::stored`] gave; false where it is of another volume.
    pub fn restore(&mut self, stored: &[Vec3]) -> bool {
        let maps = match self {
            Irradiance::Maps { maps, .. } => maps,
            Irradiance::Sh9(sh) => return sh.restore(stored),
        };
        let fits = stored.len() == maps.texels.len();
        if fits {
            maps.texels = stored.iter().map(|&t| t.into()).collect();
        }
        fits
    }

    /// Bytes of one probe in the layout that shading uses.
    pub fn runtime_bytes(&self) -> usize {
        match self {
            Irradiance::Maps { maps, format, .. } => maps.texels_per_probe() * format.bytes_per_texel(),
            Irradiance::Sh9(sh) => sh.store().runtime_bytes(),
        }
    }

    pub fn fineness(&self) -> Fineness {
        match self {
            Irradiance::Maps { maps, format, .. } => {
                Fineness { rounding: format.rounding(), resolution: maps.resolution }
            }
            Irradiance::Sh9(sh) => Fineness::of_harmonics(&sh.store()),
        }
    }

    /// Curve, and number format with the power of two that it is scaled by, in words.
    pub fn describe(&self) -> String {
        match self {
            Irradiance::Maps { maps, curve, format } => {
                let n = maps.resolution;
                format!("octahedral maps of {n}×{n} texels, {}, {}", format.name(), curve.name())
            }
            Irradiance::Sh9(sh) => sh.describe(),
        }
    }

    /// Writes its tensors.
    pub fn write(&self, container: &mut Container, losses: &mut EncodingLosses) {
        let (maps, curve, format) = match self {
            Irradiance::Maps { maps, curve, format } => (maps, curve, format),
            Irradiance::Sh9(sh) => return sh.write(container, losses),
        };
        let texels: Vec<Vec3> = self.stored().collect();
        let colors = encode_colors(&texels, *format);
        let side = maps.side();
        let shape = [texels.len() / (side * side), side, side, 3];
        let shape = if format.is_packed() { &shape[..3] } else { &shape };
        container.put_bytes(TENSOR, format.dtype(), shape, colors.bytes);
        container.metadata.insert(CURVE_KEY.to_owned(), curve.name().to_owned());
        container.put_json(SCALE_KEY, &colors.scale);
        losses.clamped.insert(TENSOR.to_owned(), colors.clamped);
        losses.underflowed.insert(TENSOR.to_owned(), colors.underflowed);
    }

    /// Reads its tensors; inverse of [`Self::write`] up to rounding.
    ///
    /// # Errors
    /// What is missing or out of range.
    pub fn read(container: &Container, probes: usize, border: usize) -> Result<Irradiance, String> {
        if sh::is_in(container) {
            return Ok(Irradiance::Sh9(ShIrradiance::read(container, probes)?));
        }
        let scale: f32 = container.json(SCALE_KEY)?;
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(format!("metadata '{SCALE_KEY}' is {scale}"));
        }
        let curve = Value::String(container.text(CURVE_KEY)?.clone());
        let curve = serde_json::from_value(curve).map_err(|e| format!("metadata '{CURVE_KEY}': {e}"))?;
        let shape = [Some(probes), None, None, Some(3)];
        let packed = container.tensors.get(TENSOR).is_some_and(|t| t.dtype == Dtype::U32);
        let tensor = match packed {
            true => container.tensor(TENSOR, &[Dtype::U32], &shape[..3])?,
            false => container.tensor(TENSOR, &[Dtype::F16, Dtype::F32], &shape)?,
        };
        let format = ColorFormat::of(tensor.dtype).ok_or_else(|| format!("tensor '{TENSOR}' has no colour format"))?;
        let texels = decode_colors(&tensor.bytes, format, scale);
        if texels.iter().any(|t| !t.is_finite()) {
            return Err(format!("tensor '{TENSOR}' holds numbers that are not finite"));
        }
        let texels = texels.into_iter().map(Vec3A::from).collect();
        let maps = OctahedralMaps { resolution: tensor.map_resolution(TENSOR, border)?, border, texels };
        Ok(Irradiance::Maps { maps, curve, format })
    }
}

/// Names in the file.
const TENSOR: &str = "irradiance";
const CURVE_KEY: &str = "encoding.irradiance";
const SCALE_KEY: &str = "scale.irradiance";

/// Directions of the texel centres of a map, row by row.
pub fn texel_directions(resolution: usize) -> Vec<Vec3> {
    (0..resolution * resolution).map(|o| texel_direction(o % resolution, o / resolution, resolution)).collect()
}

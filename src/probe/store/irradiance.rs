//! Irradiance as probes hold it: the settings, the values in memory, and the linear unknowns that the solver works on.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, Vec3A};
use rayon::prelude::*;
use safetensors::Dtype;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::encode::{ColorFormat, decode_colors, encode_colors};
use super::kernel::{Directions, Kernel};
use super::map::{OctahedralMaps, Taps, fill_with_border, interior_texel};
use crate::math::octahedral::{oct_from_direction, solid_angle_density, texel_centre, texel_direction};
use crate::probe::container::{Container, EncodingLosses};

/// How probes hold irradiance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IrradianceStore {
    /// An octahedral map per probe.
    Octahedral(OctahedralStore),
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OctahedralStore {
    /// Interior texels per side.
    pub resolution: usize,
    pub format: ColorFormat,
    pub curve: IrradianceCurve,
}

impl Default for OctahedralStore {
    fn default() -> Self {
        OctahedralStore { resolution: 8, format: ColorFormat::R11G11B10F, curve: IrradianceCurve::Linear }
    }
}

impl Default for IrradianceStore {
    fn default() -> Self {
        IrradianceStore::Octahedral(OctahedralStore::default())
    }
}

/// The domain in which irradiance is stored and bilinearly filtered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IrradianceCurve {
    Linear,
    /// (E/2π)^(1/5), which spends its bits where the eye does (Majercik et al. 2019).
    #[serde(rename = "gamma5_over_2pi")]
    Gamma5Over2Pi,
}

impl IrradianceCurve {
    /// Stored value of an irradiance, W·m⁻²; inverse of [`Self::decode`].
    pub fn encode(self, irradiance: Vec3A) -> Vec3A {
        match self {
            IrradianceCurve::Linear => irradiance,
            IrradianceCurve::Gamma5Over2Pi => (irradiance.max(Vec3A::ZERO) / (2.0 * PI)).powf(0.2),
        }
    }

    /// Irradiance, W·m⁻², of a stored value; inverse of [`Self::encode`].
    #[inline]
    pub fn decode(self, stored: Vec3A) -> Vec3A {
        match self {
            IrradianceCurve::Linear => stored,
            IrradianceCurve::Gamma5Over2Pi => {
                let squared = stored * stored;
                squared * squared * stored * (2.0 * PI)
            }
        }
    }

    /// Name in the file's metadata.
    pub fn name(self) -> &'static str {
        match self {
            IrradianceCurve::Linear => "linear",
            IrradianceCurve::Gamma5Over2Pi => "gamma5_over_2pi",
        }
    }
}

/// How finely irradiance is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fineness {
    /// Largest relative error of rounding.
    pub rounding: f64,
    /// Interior texels along a side of the map.
    pub resolution: usize,
}

/// Bytes of a texel in memory while an iteration runs: four floats, and four of its result.
const TEXEL_BYTES: u64 = 2 * size_of::<Vec3A>() as u64;
/// Bytes of a texel on its way into the file, beside its code: three floats.
const PLAIN_TEXEL_BYTES: u64 = 12;

impl IrradianceStore {
    /// Black irradiance for `probes` probes.
    pub fn zeros(&self, probes: usize, border: usize) -> Irradiance {
        let IrradianceStore::Octahedral(store) = self;
        let maps = OctahedralMaps::new(probes, store.resolution, border, Vec3A::ZERO);
        Irradiance::Maps { maps, curve: store.curve, format: store.format }
    }

    /// Linear unknowns of one probe.
    pub fn unknowns(&self) -> usize {
        let IrradianceStore::Octahedral(store) = self;
        store.resolution * store.resolution
    }

    /// Bytes of one probe in the layout that shading uses.
    pub fn runtime_bytes(&self, border: usize) -> usize {
        let IrradianceStore::Octahedral(store) = self;
        (store.resolution + 2 * border).pow(2) * store.format.bytes_per_texel()
    }

    /// Most memory that one probe takes while it is baked and encoded.
    pub fn working_bytes(&self, border: usize) -> u64 {
        let IrradianceStore::Octahedral(store) = self;
        let encoded = TEXEL_BYTES / 2 + PLAIN_TEXEL_BYTES + store.format.bytes_per_texel() as u64;
        ((store.resolution + 2 * border) as u64).pow(2) * TEXEL_BYTES.max(encoded)
    }

    /// Format of its colours, and of those of radiance beside it.
    pub fn format(&self) -> ColorFormat {
        let IrradianceStore::Octahedral(store) = self;
        store.format
    }

    pub fn fineness(&self) -> Fineness {
        let IrradianceStore::Octahedral(store) = self;
        Fineness { rounding: store.format.rounding(), resolution: store.resolution }
    }

    /// The key that makes it larger, with how large it is beside its default.
    pub fn size_key(&self) -> (&'static str, bool) {
        let IrradianceStore::Octahedral(store) = self;
        ("store.irradiance.octahedral.resolution", store.resolution > OctahedralStore::default().resolution)
    }

    /// The same with twice the angular resolution, at most `most` texels per side.
    pub fn doubled(&self, most: usize) -> IrradianceStore {
        let IrradianceStore::Octahedral(store) = self;
        IrradianceStore::Octahedral(OctahedralStore { resolution: (2 * store.resolution).min(most), ..store.clone() })
    }

    /// The same in single precision; `None` where it is that already.
    pub fn exact(&self) -> Option<IrradianceStore> {
        let IrradianceStore::Octahedral(store) = self;
        let exact = OctahedralStore { format: ColorFormat::F32, ..store.clone() };
        (exact != *store).then_some(IrradianceStore::Octahedral(exact))
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, most_texels: usize, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        let IrradianceStore::Octahedral(store) = self;
        let n = store.resolution;
        rule(self.size_key().0, n.to_string(), (1..=most_texels).contains(&n), "use 1 to 1024 texels");
    }
}

/// Irradiance of all probes, ready to be asked.
#[derive(Debug, Clone, PartialEq)]
pub enum Irradiance {
    /// Four floats a texel in the domain of `curve`, so that a look-up adds whole registers; `format` is that of the file.
    Maps { maps: OctahedralMaps<Vec3A>, curve: IrradianceCurve, format: ColorFormat },
}

/// A direction of irradiance, made ready once for all probes that are asked around it.
#[derive(Debug, Clone, Copy)]
pub struct Around(Taps);

impl Irradiance {
    /// Makes a direction ready, given by its octahedral coordinates.
    #[inline]
    pub fn around(&self, oct: Vec2) -> Around {
        let Irradiance::Maps { maps, .. } = self;
        Around(maps.taps(oct))
    }

    /// A probe's irradiance, W·m⁻².
    #[inline]
    pub fn at(&self, probe: usize, around: &Around) -> Vec3A {
        let Irradiance::Maps { maps, curve, .. } = self;
        curve.decode(maps.sample(probe, &around.0))
    }

    /// A probe's irradiance around a unit normal, W·m⁻².
    pub fn of(&self, probe: usize, normal: Vec3) -> Vec3 {
        self.at(probe, &self.around(oct_from_direction(normal))).into()
    }

    /// The filter from captured radiance to a probe's unknowns ÷ π.
    pub fn kernel(&self, captured: &Directions) -> Kernel {
        let axes: Vec<Vec3> = self.axes().into_iter().map(|(axis, _)| axis).collect();
        Kernel::cosine(captured, &axes)
    }

    /// Whether what is looked up is a linear function of the unknowns.
    pub fn is_linear(&self) -> bool {
        let Irradiance::Maps { curve, .. } = self;
        *curve == IrradianceCurve::Linear
    }

    /// The domain in which values are stored, and mixed over time.
    pub fn curve(&self) -> IrradianceCurve {
        let Irradiance::Maps { curve, .. } = self;
        *curve
    }

    /// Linear unknowns of one probe.
    pub fn unknowns(&self) -> usize {
        let Irradiance::Maps { maps, .. } = self;
        maps.resolution * maps.resolution
    }

    /// Normal that each unknown of a probe is the irradiance around, and the weight of that direction, sr per area of the
    /// octahedral square.
    pub fn axes(&self) -> Vec<(Vec3, f32)> {
        let Irradiance::Maps { maps, .. } = self;
        let n = maps.resolution;
        let oct = |o: usize| Vec2::new(texel_centre(o % n, n), texel_centre(o / n, n));
        (0..n * n).map(|o| (texel_direction(o % n, o / n, n), solid_angle_density(oct(o)))).collect()
    }

    /// The unknowns of one probe, W·m⁻².
    pub fn probe(&self, probe: usize) -> impl Iterator<Item = Vec3> + '_ {
        let Irradiance::Maps { maps, curve, .. } = self;
        let map = maps.probe(probe);
        let interior = interior_texel(maps.resolution, maps.border);
        (0..self.unknowns()).map(move |o| curve.decode(map[interior(o)]).into())
    }

    /// Sets the unknowns of the probes for which there are some, in parallel: `values(probe, before)` gets the unknowns as
    /// they are and gives those that shall be, W·m⁻². The results are in the order of the probes.
    pub fn set_each<R: Send>(
        &mut self,
        values: impl Fn(usize, &mut dyn Iterator<Item = Vec3A>) -> Option<(Vec<Vec3A>, R)> + Sync,
    ) -> Vec<Option<R>> {
        let Irradiance::Maps { maps, curve, .. } = self;
        let (resolution, border, curve) = (maps.resolution, maps.border, *curve);
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

    /// Everything as it is stored, for checkpoints; inverse of [`Self::restore`].
    pub fn stored(&self) -> impl ExactSizeIterator<Item = Vec3> + '_ {
        let Irradiance::Maps { maps, .. } = self;
        maps.texels.iter().map(|&t| t.into())
    }

    /// Puts back what [`Self::stored`] gave; false where it is of another volume.
    pub fn restore(&mut self, stored: &[Vec3]) -> bool {
        let Irradiance::Maps { maps, .. } = self;
        let fits = stored.len() == maps.texels.len();
        if fits {
            maps.texels = stored.iter().map(|&t| t.into()).collect();
        }
        fits
    }

    /// Bytes of one probe in the layout that shading uses.
    pub fn runtime_bytes(&self) -> usize {
        let Irradiance::Maps { maps, format, .. } = self;
        maps.texels_per_probe() * format.bytes_per_texel()
    }

    pub fn fineness(&self) -> Fineness {
        let Irradiance::Maps { maps, format, .. } = self;
        Fineness { rounding: format.rounding(), resolution: maps.resolution }
    }

    /// Curve, and number format with the power of two that it is scaled by, in words.
    pub fn describe(&self) -> String {
        let Irradiance::Maps { maps, curve, format } = self;
        let n = maps.resolution;
        format!("octahedral maps of {n}×{n} texels, {}, {}", format.name(), curve.name())
    }

    /// Writes its tensors.
    pub fn write(&self, container: &mut Container, losses: &mut EncodingLosses) {
        let Irradiance::Maps { maps, curve, format } = self;
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

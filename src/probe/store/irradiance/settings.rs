//! What a method says about holding irradiance.

use std::f32::consts::PI;

use glam::Vec3A;
use serde::{Deserialize, Serialize};

use crate::math::harmonics;
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::kernel::Kernel;
use crate::probe::store::sh::ShStore;

/// How probes hold irradiance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IrradianceStore {
    /// An octahedral map per probe.
    Octahedral(OctahedralStore),
    /// Nine coefficients of spherical harmonics per probe.
    Sh9(ShStore),
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

impl Fineness {
    pub(super) fn of_harmonics(store: &ShStore) -> Fineness {
        /// Texels per side that show all that nine coefficients can.
        const RESOLUTION: usize = 8;
        Fineness { rounding: store.rounding(), resolution: store.presampled.unwrap_or(RESOLUTION) }
    }
}

/// Bytes of a texel in memory while an iteration runs: four floats, and four of its result.
const TEXEL_BYTES: u64 = 2 * size_of::<Vec3A>() as u64;
/// Bytes of a texel on its way into the file, beside its code: three floats.
const PLAIN_TEXEL_BYTES: u64 = 12;

impl IrradianceStore {
    /// Linear unknowns of one probe.
    pub fn unknowns(&self) -> usize {
        match self {
            IrradianceStore::Octahedral(store) => store.resolution * store.resolution,
            IrradianceStore::Sh9(_) => harmonics::COUNT,
        }
    }

    /// Whether unknowns are coefficients of spherical harmonics.
    pub fn is_harmonic(&self) -> bool {
        matches!(self, IrradianceStore::Sh9(_))
    }

    /// Memory of the filter from captures of this many texels.
    pub fn filter_bytes(&self, captured_texels: usize) -> u64 {
        match self {
            IrradianceStore::Octahedral(_) => Kernel::bytes(captured_texels, self.unknowns(), 1.0),
            // Every texel counts in every row.
            IrradianceStore::Sh9(_) => 2 * Kernel::bytes(captured_texels, self.unknowns(), 1.0),
        }
    }

    /// Bytes of one probe in the layout that shading uses.
    pub fn runtime_bytes(&self, border: usize) -> usize {
        match self {
            IrradianceStore::Octahedral(store) => {
                (store.resolution + 2 * border).pow(2) * store.format.bytes_per_texel()
            }
            IrradianceStore::Sh9(store) => store.runtime_bytes(),
        }
    }

    /// Most memory that one probe takes while it is baked and encoded.
    pub fn working_bytes(&self, border: usize) -> u64 {
        match self {
            IrradianceStore::Octahedral(store) => {
                let encoded = TEXEL_BYTES / 2 + PLAIN_TEXEL_BYTES + store.format.bytes_per_texel() as u64;
                ((store.resolution + 2 * border) as u64).pow(2) * TEXEL_BYTES.max(encoded)
            }
            IrradianceStore::Sh9(store) => store.working_bytes(),
        }
    }

    /// Format of its colours, and of those of radiance beside it.
    pub fn format(&self) -> ColorFormat {
        match self {
            IrradianceStore::Octahedral(store) => store.format,
            IrradianceStore::Sh9(store) => store.format,
        }
    }

    /// Why a fit cannot fill it, with the remedy; `None` where it can.
    pub fn unfit(&self) -> Option<&'static str> {
        match self {
            IrradianceStore::Octahedral(store) if store.curve != IrradianceCurve::Linear => {
                Some("store.irradiance.octahedral.curve must be linear")
            }
            IrradianceStore::Octahedral(_) | IrradianceStore::Sh9(_) => None,
        }
    }

    /// Whether every unknown is irradiance, which is nowhere negative.
    pub fn is_irradiance(&self) -> bool {
        matches!(self, IrradianceStore::Octahedral(_))
    }

    pub fn fineness(&self) -> Fineness {
        match self {
            IrradianceStore::Octahedral(store) => {
                Fineness { rounding: store.format.rounding(), resolution: store.resolution }
            }
            IrradianceStore::Sh9(store) => Fineness::of_harmonics(store),
        }
    }

    /// The key that makes it larger, with how large it is beside its default.
    pub fn size_key(&self) -> (&'static str, bool) {
        match self {
            IrradianceStore::Octahedral(store) => {
                ("store.irradiance.octahedral.resolution", store.resolution > OctahedralStore::default().resolution)
            }
            IrradianceStore::Sh9(store) => ("store.irradiance.sh9.presampled", store.presampled > Some(16)),
        }
    }

    /// The same with twice the angular resolution, at most `most` texels per side. Of coefficients a map takes the place.
    pub fn doubled(&self, most: usize) -> IrradianceStore {
        let store = match self {
            IrradianceStore::Octahedral(store) => store.clone(),
            IrradianceStore::Sh9(_) => OctahedralStore::default(),
        };
        IrradianceStore::Octahedral(OctahedralStore { resolution: (2 * store.resolution).min(most), ..store })
    }

    /// The same in single precision; `None` where it is that already.
    pub fn exact(&self) -> Option<IrradianceStore> {
        let exact = match self {
            IrradianceStore::Octahedral(store) => {
                IrradianceStore::Octahedral(OctahedralStore { format: ColorFormat::F32, ..store.clone() })
            }
            IrradianceStore::Sh9(store) => {
                IrradianceStore::Sh9(ShStore { format: ColorFormat::F32, presampled: None, ..store.clone() })
            }
        };
        (exact != *self).then_some(exact)
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, most_texels: usize, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        match self {
            IrradianceStore::Octahedral(store) => {
                let n = store.resolution;
                rule(self.size_key().0, n.to_string(), (1..=most_texels).contains(&n), "use 1 to 1024 texels");
            }
            IrradianceStore::Sh9(store) => store.check(most_texels, rule),
        }
    }
}

//! What probes hold of light and of visibility, in memory, in bytes, and how captures are filtered into it.
//!
//! Irradiance and occlusion are stages: each has one enum of settings ([`IrradianceStore`], [`OcclusionStore`]) and one of
//! data ([`Irradiance`], [`Occlusion`]), and no other file looks at their variants. [`Volume`](volume::Volume) holds both.

mod dense;
pub mod encode;
pub mod irradiance;
pub mod kernel;
pub mod layout;
pub mod map;
pub mod moments;
pub mod occlusion;
pub mod prefilter;
pub mod radiance;
pub mod regions;
pub mod sh;
pub mod surface;
#[cfg(test)]
mod tests;
pub mod textures;
pub mod tiles;
pub mod volume;

use serde::{Deserialize, Serialize};

pub use self::irradiance::{Irradiance, IrradianceStore};
use self::layout::LayoutSettings;
pub use self::occlusion::{Occlusion, OcclusionStore};
use self::prefilter::Prefilter;
use self::radiance::{LightFieldStore, RadianceStore};

/// What probes hold, and in which form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StoreSettings {
    /// Texels around every map that repeat the far side, for a bilinear look-up without seams: 0 or 1.
    pub border: usize,
    pub irradiance: IrradianceStore,
    pub occlusion: OcclusionStore,
    pub light_field: LightFieldStore,
    /// Texels per side of the levels of radiance for glossy surfaces, from the capture's own on, each half of the one before.
    pub prefiltered: Vec<usize>,
    /// How they are blurred.
    pub prefilter: Prefilter,
    pub layout: LayoutSettings,
}

impl StoreSettings {
    /// What it says about radiance.
    pub fn radiance(&self) -> RadianceStore<'_> {
        RadianceStore {
            light_field: self.light_field,
            prefiltered: &self.prefiltered,
            prefilter: self.prefilter,
            format: self.irradiance.format(),
            border: self.border,
        }
    }
}

impl Default for StoreSettings {
    fn default() -> Self {
        StoreSettings {
            border: 1,
            irradiance: IrradianceStore::default(),
            occlusion: OcclusionStore::default(),
            light_field: LightFieldStore::None,
            prefiltered: Vec::new(),
            prefilter: Prefilter::Halved,
            layout: LayoutSettings::default(),
        }
    }
}

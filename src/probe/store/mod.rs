//! What probes hold of light and of visibility, in memory, in bytes, and how captures are filtered into it.
//!
//! Irradiance and occlusion are stages: each has one enum of settings ([`IrradianceStore`], [`OcclusionStore`]) and one of
//! data ([`Irradiance`], [`Occlusion`]), and no other file looks at their variants. [`Volume`](volume::Volume) holds both.

pub mod encode;
pub mod irradiance;
pub mod kernel;
pub mod map;
pub mod moments;
pub mod occlusion;
pub mod sh;
pub mod surface;
#[cfg(test)]
mod tests;
pub mod tiles;
pub mod volume;

use serde::{Deserialize, Serialize};

pub use self::irradiance::{Irradiance, IrradianceStore};
pub use self::occlusion::{Occlusion, OcclusionStore};

/// What probes hold, and in which form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StoreSettings {
    /// Texels around every map that repeat the far side, for a bilinear look-up without seams: 0 or 1.
    pub border: usize,
    pub irradiance: IrradianceStore,
    pub occlusion: OcclusionStore,
}

impl Default for StoreSettings {
    fn default() -> Self {
        StoreSettings { border: 1, irradiance: IrradianceStore::default(), occlusion: OcclusionStore::default() }
    }
}

/// `state`, u8 per probe.
const STATE_BYTES: usize = 1;

/// `position`, three f32 per probe.
const POSITION_BYTES: usize = 12;

/// Bytes of a probe's state and, where probes may have been moved from their grid points, its position.
pub fn head_bytes(moved: bool) -> usize {
    STATE_BYTES + if moved { POSITION_BYTES } else { 0 }
}

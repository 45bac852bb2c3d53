//! What a method costs at run time: bytes of its GPU layout, from a formula that a test holds against tensor shapes.

use super::encode::EncodingSettings;
use super::filter::FilterSettings;
use super::query::VisibilitySettings;

/// Mean and deviation as two u16 per distance texel.
const DISTANCE_TEXEL_BYTES: usize = 4;
/// `distance_scale`, f32 per probe.
const DISTANCE_SCALE_BYTES: usize = 4;
/// `state`, u8 per probe.
const STATE_BYTES: usize = 1;

/// Bytes of one probe's irradiance map and state.
pub fn irradiance_bytes(filter: &FilterSettings, encoding: &EncodingSettings) -> usize {
    let side = filter.irradiance_resolution + 2 * encoding.border;
    side * side * encoding.irradiance.bytes_per_texel() + STATE_BYTES
}

/// Bytes per probe of what the method stores about visibility. `surface_bytes` is the whole table's size.
pub fn visibility_bytes(
    visibility: VisibilitySettings,
    filter: &FilterSettings,
    encoding: &EncodingSettings,
    surface_bytes: u64,
    probes: usize,
) -> f64 {
    match visibility {
        VisibilitySettings::None => 0.0,
        VisibilitySettings::Moments { .. } => {
            let side = filter.distance_resolution + 2 * encoding.border;
            (side * side * DISTANCE_TEXEL_BYTES + DISTANCE_SCALE_BYTES) as f64
        }
        VisibilitySettings::Surface { .. } => surface_bytes as f64 / probes as f64,
    }
}

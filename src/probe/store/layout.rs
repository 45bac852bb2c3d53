//! What a method costs at run time: bytes of its GPU layout, from a formula that a test holds against tensor shapes.

use crate::probe::query::VisibilitySettings;
use crate::probe::store::encode::EncodingSettings;
use crate::probe::store::kernel::FilterSettings;

/// Mean and deviation as two u16 per distance texel.
const DISTANCE_TEXEL_BYTES: usize = 4;
/// `distance_scale`, f32 per probe.
const DISTANCE_SCALE_BYTES: usize = 4;
/// `state`, u8 per probe.
const STATE_BYTES: usize = 1;

/// `position`, three f32; without relocation it follows from the grid.
const POSITION_BYTES: usize = 12;

/// Bytes of one probe's irradiance map, state and position.
pub fn irradiance_bytes(filter: &FilterSettings, encoding: &EncodingSettings, relocated: bool) -> usize {
    let side = filter.irradiance_resolution + 2 * encoding.border;
    let position = if relocated { POSITION_BYTES } else { 0 };
    side * side * encoding.irradiance.bytes_per_texel() + STATE_BYTES + position
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

//! How the bytes of a probe are counted in the layout that shading uses, beside its maps. Published methods pack them
//! differently; nothing but the count changes by it.

use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LayoutSettings {
    pub head: Head,
    /// Whether every probe's distances have a scale of their own, one f32.
    pub distance_scale: bool,
    /// Whether normals and radial distances of light fields stay in memory.
    pub g_buffer: bool,
    /// The bytes a probe that the method's source gives, where they differ from what its formats give.
    pub published: Option<u64>,
}

/// What stands before a probe's maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Head {
    /// The state, one byte, and where probes may have moved the position, three f32.
    StateAndPosition,
    /// The offset from the grid point and the state, four f16.
    OffsetAndState,
    None,
}

impl Default for LayoutSettings {
    fn default() -> Self {
        LayoutSettings { head: Head::StateAndPosition, distance_scale: true, g_buffer: true, published: None }
    }
}

/// `state`, u8 per probe.
const STATE_BYTES: usize = 1;
/// `position`, three f32 per probe.
const POSITION_BYTES: usize = 12;
/// Offset and state in four f16.
const PACKED_BYTES: usize = 8;

impl LayoutSettings {
    /// Bytes before a probe's maps; `moved`: whether probes may stand elsewhere than at their grid points.
    pub fn head_bytes(&self, moved: bool) -> usize {
        match self.head {
            Head::StateAndPosition => STATE_BYTES + if moved { POSITION_BYTES } else { 0 },
            Head::OffsetAndState => PACKED_BYTES,
            Head::None => 0,
        }
    }
}

//! Whether a probe is baked, and if not, why.

use serde::{Deserialize, Serialize};

/// State of a probe, with the file's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum ProbeState {
    Active = 0,
    InsideGeometry = 1,
    NeverSampled = 2,
}

impl ProbeState {
    /// Inverse of `as u8`; `None` for numbers that no state has.
    pub fn from_u8(value: u8) -> Option<ProbeState> {
        [ProbeState::Active, ProbeState::InsideGeometry, ProbeState::NeverSampled]
            .into_iter()
            .find(|&state| state as u8 == value)
    }
}

//! What probes hold: irradiance and visibility, in memory and in bits.

pub mod encode;
pub mod kernel;
pub mod layout;
pub mod map;
pub mod surface;
pub mod volume;

//! Ray tracing with Embree. This module holds all unsafe code of the project.
//!
//! `embree4-rs` creates the device and the geometry. Scenes and queries use `embree4-sys` directly. The reason: both
//! crates bind Embree 4.2, and from 4.3 on the library writes one more field (`instPrimID`) behind the 80 bytes of
//! their ray-hit. Rays are therefore traced into [`ffi::RayHit`], which has room for that field.
#![allow(unsafe_code)]

mod alpha;
mod ffi;
mod tracer;

pub use crate::math::offset;
pub use tracer::{Hit, Ray, RayLog, Tracer};

/// Why rays cannot be traced.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    #[error(
        "Embree {found} is too old: version 4.0 or newer is needed; run scripts/setup.sh or point EMBREE_DIR at one"
    )]
    TooOld { found: String },
    #[error("Embree cannot {action}: {reason}")]
    Embree { action: &'static str, reason: String },
}

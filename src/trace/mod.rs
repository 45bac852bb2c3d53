//! Rays against the scene, by Embree. Everything unsafe of the project is in this module.
//!
//! `embree4-rs` makes the device and the geometry; scene and queries go to `embree4-sys` directly, because those
//! bindings are Embree 4.2's: from 4.3 on the library writes one more field (`instPrimID`) behind the bindings'
//! 80-byte ray-hit, so rays are traced into a struct of our own that has room for it ([`ffi::RayHit`]).
#![allow(unsafe_code)]

mod alpha;
mod ffi;
pub mod offset;
mod tracer;

pub use tracer::{Hit, Ray, RayLog, Tracer};

/// Why no rays can be traced.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    #[error(
        "Embree {found} is too old: version 4.0 or newer is needed; run scripts/setup.sh or point EMBREE_DIR at one"
    )]
    TooOld { found: String },
    #[error("Embree cannot {action}: {reason}")]
    Embree { action: &'static str, reason: String },
}

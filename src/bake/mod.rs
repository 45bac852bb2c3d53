//! The bake: place → plan → capture → transport → encode.
//!
//! `bake` runs it once; whatever compares configurations runs it many times on one [`World`](crate::light::World).

mod circumstances;
#[cfg(test)]
#[path = "../../tests/common/mod.rs"]
mod common;
pub mod convert;
pub mod figures;
mod gather;
mod log;
mod memory;
#[cfg(test)]
mod mixed_tests;
mod pilot;
mod pipeline;
mod predict;
mod prepared;
mod replay;
#[cfg(test)]
mod tests;

pub use self::circumstances::{BakeError, Checkpoint, Circumstances};
pub use self::memory::{check, surely_fits};
pub use self::pipeline::Baked;
pub use self::prepared::{Prepared, prepare};

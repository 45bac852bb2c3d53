//! The bake: place → plan → capture → transport → encode.
//!
//! `bake` runs it once; whatever compares configurations runs it many times on one [`World`](crate::light::World).

mod circumstances;
#[cfg(test)]
#[path = "../../tests/common/mod.rs"]
mod common;
pub mod convert;
pub mod figures;
mod foretell;
mod gather;
mod log;
mod memory;
#[cfg(test)]
mod mixed_tests;
mod pilot;
mod pipeline;
mod prepared;
mod replay;
pub mod saving;
#[cfg(test)]
mod tests;

pub use self::circumstances::{BakeError, Checkpoint, Circumstances};
pub use self::foretell::{Foretold, foretell};
pub use self::memory::check;
pub use self::pipeline::Baked;
pub use self::prepared::{Prepared, prepare};

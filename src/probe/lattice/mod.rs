//! Where probes are and which of them count: the grid, and each probe's state.

pub mod content;
pub mod crossings;
pub mod grid;
mod refine;
mod settings;
mod state;
#[cfg(test)]
mod tests;
pub mod tree;

pub use self::grid::{Grid, ProbeIndex};
pub use self::refine::Refine;
pub use self::settings::Automatic;
pub use self::state::ProbeState;

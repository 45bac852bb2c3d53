//! Where probes are and which of them count: the grid, and each probe's state.

pub mod grid;
mod state;
#[cfg(test)]
mod tests;

pub use self::grid::{Grid, ProbeIndex};
pub use self::state::ProbeState;

//! Numbers: maps between domains, sampling, statistics. Knows no scene and no probes.

pub mod alias;
pub mod blocks;
pub mod color;
pub mod fibonacci;
pub mod octahedral;
pub mod random;
pub mod sampling;
pub mod statistics;

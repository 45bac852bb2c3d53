//! Numbers: maps between domains, sampling, statistics. This module knows neither scenes nor probes.

pub mod alias;
pub mod blocks;
pub mod box_tree;
pub mod color;
pub mod fibonacci;
pub mod harmonics;
pub mod octahedral;
pub mod offset;
pub mod primaries;
pub mod random;
pub mod ranked;
pub mod sampling;
pub mod statistics;

//! Comparison of two results.

pub mod gate;

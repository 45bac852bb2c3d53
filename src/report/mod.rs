//! Figures and pictures for people and machines.

pub mod bake;

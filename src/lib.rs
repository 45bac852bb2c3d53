//! Bakes light-field probe volumes for global illumination on the CPU and measures them.
//!
//! The modules stand on floors; each uses only the floors below it:
//!
//! | floor | modules | role |
//! |---|---|---|
//! | 0 numbers | [`math`] | maps, sampling, statistics; no scene, no probes |
//! | 1 matter | [`scene`], [`image`] | glTF to world-space triangles, materials, lights, cameras; pictures |
//! | 2 rays | [`trace`] | Embree behind one small type; the only unsafe code |
//! | 3 light | [`light`] | what a surface sends out: one definition for bake and render |
//! | 4 probes | [`probe`] | grid, placement, capture, solver, filter, encoding, query, file |
//! | 5 results | [`shade`], [`report`], [`evaluate`], [`sweep`] | pictures and figures, series of bakes |
//! | 6 edge | [`config`], [`plan`], [`cli`], [`commands`] | what was asked, what is done about it |
#![deny(unsafe_code)]

pub mod bake;
pub mod cli;
pub mod commands;
pub mod config;
pub mod evaluate;
pub mod image;
pub mod input;
pub mod light;
pub mod math;
pub mod memory;
pub mod output;
pub mod plan;
pub mod probe;
pub mod progress;
pub mod report;
pub mod scene;
pub mod shade;
pub mod sweep;
pub mod trace;

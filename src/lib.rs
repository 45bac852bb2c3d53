//! Bakes light-field probe volumes for global illumination on the CPU and measures them.
//!
//! The modules stand on floors. Each imports only from its own floor and from those below it, and no two files import
//! each other, not even in a circle; `tests/floors.rs` reads the imports and fails where one does.
//!
//! | floor | modules | role |
//! |---|---|---|
//! | 0 ground | [`system`], [`math`] | files, memory, progress, numbers as text; maps, sampling, statistics |
//! | 1 matter | [`scene`], [`image`] | glTF to world-space triangles, materials, lights, cameras; pictures |
//! | 2 rays | [`trace`] | Embree behind one small type; the only unsafe code |
//! | 3 light | [`light`] | what a surface sends out: one definition for bake, render and reference |
//! | 4 probes | [`probe`] | lattice, placement, capture, transport, store, query, file |
//! | 5 bake | [`config`], [`plan`], [`bake`], [`export`] | what was asked, what is left out, and doing it; probes for engines |
//! | 6 results | [`shade`], [`report`], [`evaluate`] | pictures and figures |
//! | 7 edge | [`sweep`], [`cli`], [`commands`] | series of bakes, and the command line |
#![deny(unsafe_code)]

// The groups are the floors, from the ground up: the test counts them.
pub mod math;
pub mod system;

pub mod image;
pub mod scene;

pub mod trace;

pub mod light;

pub mod probe;

pub mod bake;
pub mod config;
pub mod export;
pub mod plan;

pub mod evaluate;
pub mod report;
pub mod shade;

pub mod cli;
pub mod commands;
pub mod sweep;

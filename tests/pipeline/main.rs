//! The pipeline as its users meet it: the built program on scenes from `scenes/` and built in code. What it writes is read by a decoder of the tests' own ([`probe_file`]), so that an error which bake and query
//! share cannot hide.

mod air;
mod care;
mod closed_forms;
mod command_line;
#[path = "../common/mod.rs"]
mod common;
mod comparison;
mod damage;
mod decoding;
mod determinism;
mod distances;
mod exporting;
mod first_hour;
mod fitting;
mod furnace;
mod glossy;
mod interrupted;
mod layers;
mod leaks;
mod plan;
mod probe_file;
mod program;
mod published;
mod reading;
mod reference;
mod reports;
mod shapes;
mod skies;
mod target;
mod threev8;

//! Light on its way between the captured surfaces and the probes.

pub mod anderson;
pub mod checkpoint;
pub mod operator;
pub mod solver;
pub mod truth;

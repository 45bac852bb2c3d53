//! Probes: where they are, what they see, how light bounces between them, how they are stored and asked.
//!
//! A bake is these modules in this order: [`grid`] → [`placement`] → [`capture`] → [`solver`] → [`filter`] →
//! [`encode`] → [`file`]; [`volume`] and [`query`] are what shading uses, and the solver with it.

pub mod anderson;
pub mod capture;
pub mod checkpoint;
pub mod container;
pub mod encode;
pub mod file;
pub mod filter;
pub mod grid;
pub mod layout;
pub mod map;
pub mod need;
pub mod overlap;
pub mod placement;
pub mod query;
pub mod solver;
pub mod surface_visibility;
pub mod surfel;
pub mod survey;
pub mod sweep;
pub mod truth;
pub mod volume;

pub use grid::{Grid, ProbeIndex};
pub use volume::Volume;

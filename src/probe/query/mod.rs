//! Asking the probes for the irradiance at a point: eight probes, weighted.
//!
//! Every published weighting is a value of [`QuerySettings`]. A look-up at P, shifted by the biases to P′:
//!
//! 1. the cell and the trilinear weights, from P′ (from P where `biased_cell` is off);
//! 2. for each of its eight probes the direction weight, from P, times the visibility test, from P′;
//! 3. the floor, the crush and the trilinear weight; nothing where all eight are below `blank_below`;
//! 4. the weighted mean of the probes' irradiance around the normal, or towards where the light comes from.

mod answers;
mod corner_test;
pub mod glossy;
mod look_up;
pub mod march;
mod point;
mod prefiltered;
mod settings;
mod shader;
#[cfg(test)]
mod tests;
pub mod trace;

pub use self::answers::Answers;
pub use self::glossy::{Diffuse, Glossy, Parallax};
pub use self::look_up::{Query, trilinear};
pub use self::point::{CornerWeights, Part, QueryPoint, Visibility};
pub use self::prefiltered::Source;
pub use self::settings::{BiasSpacing, Blend, DirectionWeight, LookUp, QuerySettings, VisibilityTest, WeightNormal};
pub use self::shader::{LOOK_UP, Shader};

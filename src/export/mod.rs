//! Probes as engines take them, and what engines make of them.
//!
//! Engines blend probes by rules of their own, most by plain trilinear filtering: without states, without visibility and as
//! if every probe stood at its grid point. Each engine has a module with the layout of its files, and [`Rules`] has its
//! look-up. The look-up is written once: figures and pictures of an export ask it, and a fit chooses the values by it.
//!
//! | target | files | look-up |
//! |---|---|---|
//! | `three` | [`three`]: atlases of spherical harmonics for `LightProbeGrid` of three.js | trilinear, half a cell along the normal |
//! | `bevy` | [`bevy`]: ambient cubes for `IrradianceVolume`, KTX2 | trilinear, three faces by the squares of the normal |
//! | `ddgi` | [`ddgi`]: irradiance, distance and data of probes as RTXGI lays them out, EXR and DDS | its own, with distances |
//! | `exr` | [`atlas`]: the maps of all probes in one picture, to look at | none |

pub mod atlas;
pub mod bevy;
mod block;
pub mod ddgi;
mod dds;
pub mod grids;
mod holes;
pub mod made;
mod projection;
mod reader;
pub mod record;
pub mod rooms;
mod rules;
mod sight;
mod target;
#[cfg(test)]
mod tests;
pub mod three;
pub mod written;

pub use self::block::Block;
pub use self::grids::Grids;
pub use self::record::{ExportError, File, RECORD};
pub use self::rules::Rules;
pub use self::target::Target;
pub use self::written::{Export, Origin, Written};

//! Where probes stand, and what surfaces see of them: grid point → settling → survey → need.
//!
//! Probes that no surface can ever ask, and those inside geometry, are not worth baking.

pub mod air;
mod ddgi;
pub mod lend;
mod look;
mod need;
pub mod overlap;
mod piece;
mod placement;
mod sampled;
mod settings;
mod settle;
mod stage;
pub mod survey;
pub mod surveyor;
mod tally;
#[cfg(test)]
mod tests;
mod walls;

pub use self::ddgi::DdgiSettings;
pub use self::placement::{Placement, PlacementTask};
pub use self::settings::{PlacementRule, PlacementSettings, SettleSettings, SurveySettings};
pub use self::settle::Settler;
pub use self::stage::place;

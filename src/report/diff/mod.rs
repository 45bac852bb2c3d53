//! Two results compared: figures, gates, verdict.
//!
//! [`sides`] finds what there is and [`pairs`] what belongs together; [`probes`] and [`images`] compare it. [`rules`] makes findings of
//! the figures, [`noise`] says what chance may do to them, and [`thresholds`] judges them into gates. [`markdown`], [`junit`] and
//! [`shown`] tell of them. Nothing is written here.

mod compare;
mod error;
pub mod figures;
pub mod images;
pub mod junit;
pub mod markdown;
pub mod mask;
pub mod noise;
mod pairs;
pub mod probes;
mod report;
pub mod rules;
pub mod shown;
pub mod sides;
mod sweep_plot;
pub mod thresholds;

pub use compare::{Compared, Request, compare};
pub use error::DiffError;
pub use report::{DiffReport, SCHEMA, SideReport, Verdict};

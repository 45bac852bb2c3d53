//! Many bakes of one scene against one reference: which configuration errs how much, at what time, bytes and leak.
//!
//! [`method`] and [`ladder`] say which configurations there are, [`offsets`] shifts their grids, [`run`] bakes and evaluates one of them, [`store`] keeps what is finished,
//! [`split`] tells noise from bias, [`front`] finds what nothing beats, [`floor`] what limits the best, [`equal`] compares methods at
//! equal cost. [`target`] is another series: bakes until an error is reached.

pub mod equal;
pub mod floor;
pub mod front;
pub mod ladder;
pub mod method;
pub mod offsets;
pub mod run;
pub mod split;
pub mod store;
pub mod target;

use std::path::PathBuf;

use crate::bake::BakeError;
use crate::config::ConfigError;
use crate::image::ImageError;
use crate::probe::container::FileError;
use crate::system::output::OutputError;

/// Why there is no sweep.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    #[error("cannot read the ladder {path}: {cause}; give the path of a RON file")]
    Unreadable { path: PathBuf, cause: std::io::Error },
    #[error("{place}: {what}")]
    Ladder { place: String, what: String },
    #[error(
        "{key} is {first} in '{first_label}' and {second} in '{second_label}': all configurations share one reference; set it alike in \
         all, for example with --set {key}=VALUE"
    )]
    NotShared { key: &'static str, first: String, first_label: String, second: String, second_label: String },
    #[error("configuration '{label}': {cause}")]
    Bake { label: String, cause: BakeError },
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Output(#[from] OutputError),
}

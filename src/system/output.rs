//! Output files. Each appears whole or not at all, because every writer of the project uses [`write_atomically`].

mod check;
mod error;
mod paths;
mod pending;
mod replace;
mod write;

pub use self::check::{Named, check_apart, check_folder, check_outputs, check_writable};
pub use self::error::OutputError;
pub use self::replace::{recover, replace};
pub use self::write::{OutputFile, create_folder, write_atomically};

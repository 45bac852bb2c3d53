//! Probes: where they are, what they see, how light bounces between them, how they are stored and asked.
//!
//! The folders from the ground up; each uses only those above it in this list:
//!
//! | folder | role |
//! |---|---|
//! | [`lattice`] | where probes are, and which of them count |
//! | [`container`] | tensors and metadata in a file, with hashes |
//! | [`store`] | what probes hold of light and of visibility, in memory and in bits |
//! | [`query`] | asking the probes at a point |
//! | [`file`] | a volume as a file, and back |
//! | [`place`] | moving probes to where they are of use, and finding out what surfaces see of them |
//! | [`capture`] | what a probe sees |
//! | [`transport`] | light on its way between the captured surfaces and the probes |
//! | [`fit`] | values that interpolate best, in place of those that light has where probes stand |

pub mod capture;
pub mod container;
pub mod file;
pub mod fit;
pub mod lattice;
pub mod place;
pub mod query;
pub mod store;
pub mod transport;

pub use self::lattice::{Grid, ProbeIndex};
pub use self::store::volume::Volume;

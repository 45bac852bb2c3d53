//! What a bake depends on besides scene and configuration, and why there may be none.

use std::path::PathBuf;
use std::time::Duration;

use crate::probe::container::FileError;
use crate::probe::lattice::grid::GridError;
use crate::system::memory::TooLittleMemory;
use crate::system::progress::Progress;

/// Why there is no bake.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    #[error(transparent)]
    Grid(#[from] GridError),
    #[error(transparent)]
    Memory(#[from] TooLittleMemory),
    #[error(transparent)]
    File(#[from] FileError),
}

/// One bake's circumstances that are not part of the method.
#[derive(Debug, Clone)]
pub struct Circumstances {
    pub seed: u64,
    /// Most bytes of captures kept in memory, with the rows that are worked out of them; the rest is traced again for every
    /// bounce, with the same result.
    pub memory_budget_bytes: Option<u64>,
    pub progress: Progress,
    /// Where iterations are saved while a long bake runs, and whether to go on from there.
    pub checkpoint: Option<Checkpoint>,
}

#[derive(Debug, Clone)]
pub struct Checkpoint {
    pub path: PathBuf,
    pub resume: bool,
    /// Least time between two checkpoints.
    pub interval: Duration,
}

impl Checkpoint {
    /// Short bakes write none.
    pub const INTERVAL: Duration = Duration::from_secs(10);
}

impl Circumstances {
    /// A bake that no one watches: all memory, no progress, no checkpoint.
    pub fn quiet(seed: u64) -> Circumstances {
        Circumstances { seed, memory_budget_bytes: None, progress: Progress::hidden(), checkpoint: None }
    }
}

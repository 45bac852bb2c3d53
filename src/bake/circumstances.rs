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
    /// Memory that the process is to take at most; what the machine has where not given. Captures that do not fit are read
    /// from the checkpoint, or, where there is none, traced again whenever they are asked for, with the same result.
    pub memory_budget_bytes: Option<u64>,
    pub progress: Progress,
    /// Where the work is saved while a long bake runs, and whether to go on from there.
    pub checkpoint: Option<Checkpoint>,
}

#[derive(Debug, Clone)]
pub struct Checkpoint {
    pub path: PathBuf,
    pub resume: bool,
    /// Bakes that take less write none, unless memory does not hold all captures. Least time between two savings of iterations.
    pub interval: Duration,
}

impl Circumstances {
    /// A bake that no one watches: all memory, no progress, no checkpoint.
    pub fn quiet(seed: u64) -> Circumstances {
        Circumstances { seed, memory_budget_bytes: None, progress: Progress::hidden(), checkpoint: None }
    }
}

//! How a method refines its grid.

use serde::{Deserialize, Serialize};

/// Whether all cells of a grid are as fine as its finest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Refine {
    /// All are.
    #[default]
    Uniform,
    /// Base cells, 2^`levels` of the finest wide, are subdivided where surfaces cross them, see
    /// [`super::crossings::Crossings`].
    Mixed { levels: u32 },
}

/// Most levels of subdivision: a base cell of 2⁸ finest cells a side.
pub const MAX_LEVELS: u32 = 8;

impl Refine {
    /// Finest cells along a side of a base cell.
    pub fn base_cell(self) -> u32 {
        match self {
            Refine::Uniform => 1,
            Refine::Mixed { levels } => 1 << levels.min(MAX_LEVELS),
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        if let Refine::Mixed { levels } = self {
            let holds = (1..=MAX_LEVELS).contains(&levels);
            rule("placement.refine.mixed.levels", levels.to_string(), holds, "use 1 to 8");
        }
    }
}

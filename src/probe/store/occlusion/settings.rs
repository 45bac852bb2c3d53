//! What a method says about knowing which points probes see.

use serde::{Deserialize, Serialize};

use crate::probe::store::kernel::{Directions, Kernel};
use crate::probe::store::layout::LayoutSettings;
use crate::probe::store::moments::MomentsStore;
use crate::probe::store::regions::Regions;
use crate::probe::store::surface::{MAX_VOXELS_PER_CELL, SurfaceStore};
use crate::probe::store::tiles::TileStore;

/// How probes know which points they see.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OcclusionStore {
    /// They do not: every probe counts as visible.
    None,
    /// By maps of the distances around every probe, see [`super::moments`].
    Moments(MomentsStore),
    /// By tiles of the distances along rays of their own, see [`super::tiles`].
    Tiles(TileStore),
    /// By visibility measured at the surfaces themselves, see [`super::surface`].
    Surface(SurfaceStore),
}

impl Default for OcclusionStore {
    fn default() -> Self {
        OcclusionStore::Surface(SurfaceStore::default())
    }
}

/// Voxels per cell at which the surfaces are surveyed only to learn whether anything is hidden at all. Half the default of
/// the table that shading asks: what is hidden in a quarter of a cell is found.
const SURVEY_VOXELS: u32 = 4;

/// Bytes of a distance texel in memory: two floats, and on the way into the file two codes, twice.
const DISTANCE_TEXEL_BYTES: u64 = 8 + 8;
/// Moments of distance of a captured texel, until they are filtered: three f64.
const MOMENTS_BYTES: u64 = 24;

impl OcclusionStore {
    /// Voxels per cell at which surfaces are surveyed; `None` where nothing needs to be known about them.
    pub fn survey_voxels(&self) -> Option<u32> {
        match self {
            OcclusionStore::None => None,
            OcclusionStore::Moments(_) | OcclusionStore::Tiles(_) => Some(SURVEY_VOXELS),
            OcclusionStore::Surface(store) => Some(store.voxels_per_cell),
        }
    }

    /// Whether a look-up asks the very table that the survey fills.
    pub fn keeps_survey(&self) -> bool {
        matches!(self, OcclusionStore::Surface(_))
    }

    /// Name in configurations.
    pub fn name(&self) -> &'static str {
        match self {
            OcclusionStore::None => "none",
            OcclusionStore::Moments(_) => "moments",
            OcclusionStore::Tiles(_) => "tiles",
            OcclusionStore::Surface(_) => "surface",
        }
    }

    /// The visibility tests of a look-up that can ask it: the name that they share, and how they are written.
    pub fn test(&self) -> (&'static str, &'static str) {
        match self {
            OcclusionStore::None => ("none", "none"),
            OcclusionStore::Moments(_) | OcclusionStore::Tiles(_) => ("chebyshev", "chebyshev(power: p, floor: f)"),
            OcclusionStore::Surface(_) => ("table", "table() or everywhere()"),
        }
    }

    pub fn is_none(&self) -> bool {
        *self == OcclusionStore::None
    }

    /// The longest distance that probes tell from longer ones, in cell diagonals; `None` where they store no distances.
    pub fn distance_clamp(&self) -> Option<f32> {
        match self {
            OcclusionStore::Moments(store) => Some(store.clamp),
            OcclusionStore::None | OcclusionStore::Tiles(_) | OcclusionStore::Surface(_) => None,
        }
    }

    /// Whether a look-up can learn how far surfaces are.
    pub fn knows_distances(&self) -> bool {
        matches!(self, OcclusionStore::Moments(_) | OcclusionStore::Tiles(_))
    }

    /// Bytes of one probe in the layout that shading uses; `regions` is what surveying the surfaces found.
    pub fn runtime_bytes(
        &self,
        border: usize,
        regions: Option<&Regions>,
        probes: usize,
        layout: &LayoutSettings,
    ) -> f64 {
        match self {
            OcclusionStore::None => 0.0,
            OcclusionStore::Moments(store) => store.runtime_bytes(border, layout.distance_scale) as f64,
            OcclusionStore::Tiles(store) => store.runtime_bytes(border) as f64,
            OcclusionStore::Surface(_) => regions.map_or(0, Regions::bytes) as f64 / probes as f64,
        }
    }

    /// Most memory that one probe takes while it is baked and encoded.
    pub fn working_bytes(&self, border: usize) -> u64 {
        match self {
            OcclusionStore::Moments(store) => ((store.resolution + 2 * border) as u64).pow(2) * DISTANCE_TEXEL_BYTES,
            OcclusionStore::Tiles(store) => ((store.resolution + 2 * border) as u64).pow(2) * DISTANCE_TEXEL_BYTES,
            OcclusionStore::None | OcclusionStore::Surface(_) => 0,
        }
    }

    /// The filter from distances in these directions to those that are stored; `None` where none are.
    pub fn kernel(&self, captured: &Directions) -> Option<Kernel> {
        match self {
            OcclusionStore::Moments(store) => Some(store.kernel(captured)),
            OcclusionStore::None | OcclusionStore::Tiles(_) | OcclusionStore::Surface(_) => None,
        }
    }

    /// Memory of the filter from captures of this many texels, and of one capture's distances.
    pub fn filter_bytes(&self, captured_texels: usize) -> (u64, u64) {
        match self {
            OcclusionStore::Moments(store) => (
                Kernel::bytes(captured_texels, store.resolution.pow(2), store.exponent),
                captured_texels as u64 * MOMENTS_BYTES,
            ),
            OcclusionStore::Tiles(store) => (0, store.resolution.pow(2) as u64 * MOMENTS_BYTES),
            OcclusionStore::None | OcclusionStore::Surface(_) => (0, 0),
        }
    }

    /// The key that makes it larger, with whether it is larger than its default; `None` where nothing grows with it.
    pub fn size_key(&self) -> Option<(&'static str, bool)> {
        match self {
            OcclusionStore::Moments(store) => {
                Some(("store.occlusion.moments.resolution", store.resolution > MomentsStore::default().resolution))
            }
            OcclusionStore::Tiles(store) => {
                Some(("store.occlusion.tiles.resolution", store.resolution > TileStore::default().resolution))
            }
            OcclusionStore::None | OcclusionStore::Surface(_) => None,
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, most_texels: usize, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        match self {
            OcclusionStore::None => {}
            OcclusionStore::Moments(MomentsStore { resolution: n, exponent, clamp }) => {
                let key = "store.occlusion.moments.resolution";
                rule(key, n.to_string(), (1..=most_texels).contains(n), "use 1 to 1024 texels");
                let holds = (1.0..=1e4).contains(exponent);
                rule("store.occlusion.moments.exponent", exponent.to_string(), holds, "use 1 to 10000");
                let holds = (1.0..=1e3).contains(clamp);
                rule("store.occlusion.moments.clamp", clamp.to_string(), holds, "use 1 to 1000 cell diagonals");
            }
            OcclusionStore::Tiles(TileStore { resolution: n, exponent }) => {
                let key = "store.occlusion.tiles.resolution";
                rule(key, n.to_string(), (1..=most_texels).contains(n), "use 1 to 1024 texels");
                let holds = (1.0..=1e4).contains(exponent);
                rule("store.occlusion.tiles.exponent", exponent.to_string(), holds, "use 1 to 10000");
            }
            OcclusionStore::Surface(SurfaceStore { voxels_per_cell: n }) => {
                let holds = (1..=MAX_VOXELS_PER_CELL).contains(n);
                rule("store.occlusion.surface.voxels_per_cell", n.to_string(), holds, "use 1 to 22");
            }
        }
    }
}

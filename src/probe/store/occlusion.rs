//! What probes know about occlusion: the settings, and the data that a look-up asks.

use std::borrow::Cow;

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::kernel::{Directions, Kernel};
use super::layout::LayoutSettings;
use super::map::{OctahedralMaps, fill_with_border, interior_texel};
use super::moments::{self, MomentsBuilder, MomentsStore};
use super::surface::{self, MAX_VOXELS_PER_CELL, SurfaceStore, SurfaceVisibility};
use super::tiles::{self, TileStore, Tiles, TilesBuilder, box_sides};
use crate::math::octahedral::oct_from_direction;
use crate::math::statistics::Moments;
use crate::probe::container::{Container, EncodingLosses};
use crate::probe::lattice::{Grid, ProbeIndex};

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

    /// The visibility test of a look-up that can ask it, by its name, and how that is written.
    pub fn test(&self) -> (&'static str, &'static str) {
        match self {
            OcclusionStore::None => ("none", "none"),
            OcclusionStore::Moments(_) | OcclusionStore::Tiles(_) => ("chebyshev", "chebyshev(power: p, floor: f)"),
            OcclusionStore::Surface(_) => ("table", "table()"),
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

    /// What collects occlusion while probes are captured and surfaces surveyed.
    pub fn builder(
        &self,
        survey: Option<&SurfaceVisibility>,
        captured: &Directions,
        grid: &Grid,
        border: usize,
    ) -> OcclusionBuilder {
        OcclusionBuilder(match self {
            OcclusionStore::None => Under::Done(Occlusion::None),
            OcclusionStore::Moments(store) => {
                Under::Moments(MomentsBuilder::new(store, captured, grid.probe_count(), border))
            }
            OcclusionStore::Tiles(store) => Under::Tiles(TilesBuilder::new(store, grid, border)),
            OcclusionStore::Surface(_) => {
                Under::Done(survey.map_or(Occlusion::None, |table| Occlusion::Surface(table.clone())))
            }
        })
    }

    /// Bytes of one probe in the layout that shading uses; `survey` is what surveying the surfaces found.
    pub fn runtime_bytes(
        &self,
        border: usize,
        survey: Option<&SurfaceVisibility>,
        probes: usize,
        layout: &LayoutSettings,
    ) -> f64 {
        match self {
            OcclusionStore::None => 0.0,
            OcclusionStore::Moments(store) => store.runtime_bytes(border, layout.distance_scale) as f64,
            OcclusionStore::Tiles(store) => store.runtime_bytes(border) as f64,
            OcclusionStore::Surface(_) => survey.map_or(0, SurfaceVisibility::bytes) as f64 / probes as f64,
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

/// What a look-up asks about occlusion.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Occlusion {
    /// Nothing is hidden, or the method does not know.
    #[default]
    None,
    /// Mean and standard deviation of distance, metres.
    Moments(OctahedralMaps<Vec2>),
    Tiles(Tiles),
    Surface(SurfaceVisibility),
}

/// Occlusion while it is collected.
pub struct OcclusionBuilder(Under);

enum Under {
    Done(Occlusion),
    Moments(MomentsBuilder),
    Tiles(TilesBuilder),
}

impl OcclusionBuilder {
    /// Whether distances are those along [`Self::rays`].
    pub fn has_rays(&self) -> bool {
        matches!(self.0, Under::Tiles(_))
    }

    /// Rays besides those of the capture whose distances a probe keeps, each with the longest that counts, metres.
    pub fn rays(&self, probe: usize) -> Vec<(Vec3, f32)> {
        match &self.0 {
            Under::Tiles(builder) => builder.rays(probe),
            Under::Moments(_) | Under::Done(_) => Vec::new(),
        }
    }

    /// What of a captured probe's distances is kept, or of those along [`Self::rays`] where there are any; may run in
    /// parallel. Inverse in order: [`Self::set`].
    pub fn filter(&self, probe: usize, distances: &[Moments]) -> Vec<Vec2> {
        match &self.0 {
            Under::Moments(builder) => builder.filter(distances),
            Under::Tiles(builder) => builder.filter(probe, distances),
            Under::Done(_) => Vec::new(),
        }
    }

    /// Keeps what [`Self::filter`] gave for a probe.
    pub fn set(&mut self, probe: usize, filtered: &[Vec2]) {
        match &mut self.0 {
            Under::Moments(builder) => builder.set(probe, filtered),
            Under::Tiles(builder) => builder.set(probe, filtered),
            Under::Done(_) => {}
        }
    }

    /// Keeps what another volume's probe has, where that is of the same kind and size.
    pub fn copy(&mut self, probe: usize, from: &Occlusion, source: usize) {
        if let (Under::Tiles(builder), Occlusion::Tiles(tiles)) = (&mut self.0, from) {
            builder.copy(probe, tiles, source);
        }
    }

    pub fn finish(self) -> Occlusion {
        match self.0 {
            Under::Done(occlusion) => occlusion,
            Under::Moments(builder) => Occlusion::Moments(builder.finish()),
            Under::Tiles(builder) => Occlusion::Tiles(builder.finish()),
        }
    }
}

impl Occlusion {
    /// Distance maps, where there are any.
    #[inline]
    pub fn moments(&self) -> Option<&OctahedralMaps<Vec2>> {
        if let Occlusion::Moments(maps) = self { Some(maps) } else { None }
    }

    /// Tiles of distance, where there are any.
    #[inline]
    pub fn tiles(&self) -> Option<&Tiles> {
        if let Occlusion::Tiles(tiles) = self { Some(tiles) } else { None }
    }

    /// What collects occlusion of this kind anew on another grid, by rays of its own; `None` where it has none.
    pub fn retraced(&self, grid: &Grid) -> Option<OcclusionBuilder> {
        self.tiles().map(|tiles| OcclusionBuilder(Under::Tiles(tiles.builder(grid))))
    }

    /// Mean distance that a probe knows along a direction, unit, metres; 0 where it knows none.
    pub fn mean_distance(&self, grid: &Grid, probe: ProbeIndex, direction: Vec3) -> f32 {
        let p = probe.0 as usize;
        match self {
            Occlusion::Moments(maps) => maps.sample(p, &maps.taps(oct_from_direction(direction))).x,
            Occlusion::Tiles(tiles) => tiles.distance(p, direction, box_sides(grid, probe)).x,
            Occlusion::None | Occlusion::Surface(_) => 0.0,
        }
    }

    /// The table of visibility at surfaces, where there is one.
    #[inline]
    pub fn surface(&self) -> Option<&SurfaceVisibility> {
        if let Occlusion::Surface(table) = self { Some(table) } else { None }
    }

    /// Bytes per probe in the layout that shading uses.
    pub fn runtime_bytes(&self, probes: usize, layout: &LayoutSettings) -> f64 {
        match self {
            Occlusion::None => 0.0,
            Occlusion::Moments(maps) => {
                let store = MomentsStore { resolution: maps.resolution, ..MomentsStore::default() };
                store.runtime_bytes(maps.border, layout.distance_scale) as f64
            }
            Occlusion::Tiles(tiles) => tiles.store().runtime_bytes(tiles.maps.border) as f64,
            Occlusion::Surface(table) => table.bytes() as f64 / probes as f64,
        }
    }

    /// Mixes new distances into those of the probes for which there are some: what was there counts with `kept`, but
    /// where there was nothing.
    pub fn blend_each(&mut self, samples: &[Option<Vec<Moments>>], kept: f64) {
        let Occlusion::Moments(maps) = self else { return };
        let (resolution, border) = (maps.resolution, maps.border);
        let interior = interior_texel(resolution, border);
        let per_probe = maps.texels_per_probe();
        maps.texels.par_chunks_mut(per_probe).zip(samples).for_each(|(map, samples)| {
            let Some(samples) = samples.as_ref().filter(|samples| samples.len() == resolution * resolution) else {
                return;
            };
            let mix = |(o, sample): (usize, &Moments)| {
                let Vec2 { x: mean, y: deviation } = map[interior(o)];
                let mut mixed = Moments::default();
                mixed.add_set(sample.mean(), sample.variance(), if mean == 0.0 { 1.0 } else { 1.0 - kept });
                if mean != 0.0 && kept > 0.0 {
                    mixed.add_set(f64::from(mean), f64::from(deviation).powi(2), kept);
                }
                Vec2::new(mixed.mean() as f32, mixed.variance().sqrt() as f32)
            };
            let mixed: Vec<Vec2> = samples.iter().enumerate().map(mix).collect();
            fill_with_border(&mixed, resolution, border, map);
        });
    }

    /// Distances as they are in memory, for checkpoints; inverse of [`Self::restore`].
    pub fn stored(&self) -> Vec<Vec3> {
        let Occlusion::Moments(maps) = self else { return Vec::new() };
        maps.texels.iter().map(|t| t.extend(0.0)).collect()
    }

    /// Puts back what [`Self::stored`] gave; false where it is of another volume.
    pub fn restore(&mut self, stored: &[Vec3]) -> bool {
        let Occlusion::Moments(maps) = self else { return stored.is_empty() };
        let fits = stored.len() == maps.texels.len();
        if fits {
            maps.texels = stored.iter().map(|t| t.truncate()).collect();
        }
        fits
    }

    /// Writes its tensors; those that are there tell which variant it is.
    pub fn write(&self, container: &mut Container, losses: &mut EncodingLosses) {
        match self {
            Occlusion::None => {}
            Occlusion::Moments(maps) => moments::write(maps, container, losses),
            Occlusion::Tiles(tiles) => tiles.write(container, losses),
            Occlusion::Surface(table) => surface::write(table, container),
        }
    }

    /// Reads its tensors; inverse of [`Self::write`] up to rounding.
    ///
    /// # Errors
    /// What is missing or out of range.
    pub fn read(container: &Container, grid: &Grid, border: usize) -> Result<Occlusion, String> {
        Ok(if tiles::is_in(container) {
            Occlusion::Tiles(Tiles::read(container, grid.probe_count(), border)?)
        } else if moments::is_in(container) {
            Occlusion::Moments(moments::read(container, grid.probe_count(), border)?)
        } else if surface::is_in(container) {
            Occlusion::Surface(surface::read(container, grid)?)
        } else {
            Occlusion::None
        })
    }

    /// Root mean square difference of two probes' mean distances, metres; `None` where these are not stored alike.
    pub fn distance_difference(&self, probe: usize, other: &Occlusion, other_probe: usize) -> Option<f64> {
        let (Occlusion::Moments(a), Occlusion::Moments(b)) = (self, other) else { return None };
        if (a.resolution, a.border) != (b.resolution, b.border) {
            return None;
        }
        let (a, b) = (a.probe(probe), b.probe(other_probe));
        let squares: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a.x - b.x).powi(2)).sum();
        Some((squares / a.len() as f64).sqrt())
    }

    /// Name of the visibility test that can ask it; `None` where there is nothing to ask.
    pub fn test(&self) -> Option<&'static str> {
        match self {
            Occlusion::None => None,
            Occlusion::Moments(_) | Occlusion::Tiles(_) => Some("chebyshev"),
            Occlusion::Surface(_) => Some("table"),
        }
    }

    /// How much it can tell, for comparisons: 0 nothing, 1 distances, 2 visibility at surfaces.
    pub fn rank(&self) -> u32 {
        match self {
            Occlusion::None => 0,
            Occlusion::Moments(_) | Occlusion::Tiles(_) => 1,
            Occlusion::Surface(_) => 2,
        }
    }

    /// Mean number of probes that a surface sees, of the eight around it; `None` where that is not stored.
    pub fn mean_visible(&self) -> Option<f64> {
        let Occlusion::Surface(table) = self else { return None };
        let bits: u64 = table.masks.iter().map(|mask| u64::from(mask.count_ones())).sum();
        Some(bits as f64 / table.masks.len().max(1) as f64)
    }

    /// Name and size in words.
    pub fn describe(&self) -> Cow<'static, str> {
        match self {
            Occlusion::None => "none".into(),
            Occlusion::Moments(maps) => format!("distance maps of {0}×{0} texels", maps.resolution).into(),
            Occlusion::Tiles(tiles) => format!("tiles of {0}×{0} distances", tiles.maps.resolution).into(),
            Occlusion::Surface(table) => {
                format!("{} voxels a cell along each axis, {} entries", table.voxels_per_cell, table.keys.len()).into()
            }
        }
    }
}

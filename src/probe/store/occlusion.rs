//! What probes know about occlusion: the settings, and the data that a look-up asks.

mod bound;
mod settings;

use std::borrow::Cow;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

pub use self::settings::OcclusionStore;
use super::kernel::Directions;
use super::layout::LayoutSettings;
use super::map::{OctahedralMaps, fill_with_border, interior_texel};
use super::moments::{self, MomentsBuilder, MomentsStore};
use super::regions::{self, Regions};
use super::surface::{self, SurfaceVisibility};
use super::tiles::{self, Tiles, TilesBuilder, box_sides};
use crate::math::octahedral::oct_from_direction;
use crate::math::statistics::Moments;
use crate::probe::container::{Container, EncodingLosses};
use crate::probe::lattice::{Grid, ProbeIndex};

impl OcclusionStore {
    /// What collects occlusion while probes are captured and surfaces surveyed.
    pub fn builder(
        &self,
        regions: Option<&Regions>,
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
                Under::Done(regions.map_or(Occlusion::None, |regions| Occlusion::Regions(regions.clone())))
            }
        })
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
    /// As older files hold it.
    Surface(SurfaceVisibility),
    Regions(Regions),
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
            Occlusion::None | Occlusion::Surface(_) | Occlusion::Regions(_) => 0.0,
        }
    }

    /// The table of visibility at surfaces, where there is one.
    #[inline]
    pub fn surface(&self) -> Option<&SurfaceVisibility> {
        if let Occlusion::Surface(table) = self { Some(table) } else { None }
    }

    /// The trees of visibility at surfaces, where there are any.
    #[inline]
    pub fn regions(&self) -> Option<&Regions> {
        if let Occlusion::Regions(regions) = self { Some(regions) } else { None }
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
            Occlusion::Regions(regions) => regions.bytes() as f64 / probes as f64,
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
            Occlusion::Regions(regions) => regions::write(regions, container),
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
        } else if regions::is_in(container) {
            Occlusion::Regions(regions::read(container, grid)?)
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
            Occlusion::Surface(_) | Occlusion::Regions(_) => Some("table"),
        }
    }

    /// How much it can tell, for comparisons: 0 nothing, 1 distances, 2 visibility at surfaces.
    pub fn rank(&self) -> u32 {
        match self {
            Occlusion::None => 0,
            Occlusion::Moments(_) | Occlusion::Tiles(_) => 1,
            Occlusion::Surface(_) | Occlusion::Regions(_) => 2,
        }
    }

    /// Mean number of probes that are seen, of the eight around, over all voxels and facings; `None` where that is not stored.
    pub fn mean_visible(&self) -> Option<f64> {
        self.regions().map(Regions::mean_visible)
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
            Occlusion::Regions(regions) => {
                format!("{} voxels a cell along each axis, {} parts", regions.voxels_per_cell, regions.parts()).into()
            }
        }
    }
}

//! Indirect light that is kept on surfaces, so that paths need not be followed to their end: where a ray meets a surface whose
//! light is known, that is taken for the rest of the path (Ward, Rubinstein & Clear, *A Ray Tracing Solution for Diffuse
//! Interreflection*, 1988, keep it at points; here it is the mean over patches). [`super::fill_cache`] finds it.
//!
//! A patch is what lies in one cell of one place and sees the first of its samples, so that no light passes through walls that
//! are thinner than a cell. Kept is the light by which paths go on. What rays towards emitters find they find at every point,
//! so that shadows stay sharp; points of a place share the weights of the two techniques.

use std::collections::HashMap;
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::World;
use super::surface::SurfacePoint;
use crate::trace::Ray;

/// Samples that a patch needs to be relied on. Not varied.
const LEAST_SAMPLES: usize = 8;

/// Most patches of a cell in a place. Not varied.
const MOST_PATCHES: usize = 4;

/// Light is taken from patches at least so many cells away: from nearby one covers many directions, and corners would be blurred.
/// Not varied.
const LEAST_DISTANCE: f32 = 2.0;

/// Indirect irradiance by patches.
#[derive(Debug)]
pub struct IrradianceCache {
    cells: Cells,
    patches: Vec<Patch>,
    /// Which patches a cell has.
    of_cell: HashMap<Key, Range<u32>>,
}

/// A place and a cell.
type Key = (u32, [u16; 3]);

/// The cells of a scene.
#[derive(Debug, Clone, Copy)]
pub struct Cells {
    low: Vec3,
    /// Metres.
    side: f32,
}

#[derive(Debug, Clone, Copy)]
struct Patch {
    /// Of its first sample, just above the surface.
    position: Vec3,
    /// Mean, W·m⁻²; `None` from too few samples.
    irradiance: Option<Vec3>,
}

/// Indirect irradiance that was found at a point.
pub struct Sample {
    key: Key,
    position: Vec3,
    /// W·m⁻².
    irradiance: Vec3,
}

impl Cells {
    /// Of this side, metres.
    pub fn new(world: &World, side: f32) -> Cells {
        Cells { low: world.scene.mesh.bounds().map_or(Vec3::ZERO, |(low, _)| low), side }
    }

    pub fn sample(&self, world: &World, point: &SurfacePoint, irradiance: Vec3) -> Sample {
        Sample { key: self.key(world, point), position: point.ray_origin(), irradiance }
    }

    fn key(&self, world: &World, point: &SurfacePoint) -> Key {
        // `as` truncates, saturates and sends NaN to 0.
        let cell = ((point.position - self.low) / self.side).to_array().map(|number| number as u16);
        (world.places.key_of(point) as u32, cell)
    }
}

impl IrradianceCache {
    /// Of samples in an order that threads do not change.
    pub fn new(world: &World, cells: Cells, mut samples: Vec<Sample>) -> IrradianceCache {
        // It is stable: patches begin with the same samples.
        samples.par_sort_by_key(|sample| sample.key);
        let of_cells: Vec<&[Sample]> = samples.chunk_by(|a, b| a.key == b.key).collect();
        let found: Vec<Vec<Patch>> = of_cells.par_iter().map(|samples| patches(world, samples)).collect();
        let mut of_cell = HashMap::with_capacity(found.len());
        let mut end = 0;
        for (samples, patches) in of_cells.iter().zip(&found) {
            let start = end;
            end += patches.len() as u32;
            of_cell.insert(samples[0].key, start..end);
        }
        IrradianceCache { cells, patches: found.into_iter().flatten().collect(), of_cell }
    }

    /// Patches whose light is known.
    pub fn known(&self) -> usize {
        self.patches.iter().filter(|patch| patch.irradiance.is_some()).count()
    }

    /// Indirect irradiance, W·m⁻², at a point that a ray has hit; `None` where it is not known, and near the ray's start.
    #[inline]
    pub fn at(&self, world: &World, point: &SurfacePoint, salt: u32) -> Option<Vec3> {
        if point.hit.t < LEAST_DISTANCE * self.cells.side {
            return None;
        }
        let Range { start, end } = self.of_cell.get(&self.cells.key(world, point))?;
        let of_cell = &self.patches[*start as usize..*end as usize];
        of_cell.iter().find(|patch| sees(world, point.ray_origin(), patch.position, salt))?.irradiance
    }
}

fn sees(world: &World, from: Vec3, to: Vec3, salt: u32) -> bool {
    from == to || !world.tracer.occluded(Ray::segment(from, to, salt))
}

/// The patches of the samples of a cell in a place.
fn patches(world: &World, samples: &[Sample]) -> Vec<Patch> {
    let mut sums: Vec<(Vec3, Vec3, usize)> = Vec::new();
    for sample in samples {
        match sums.iter().position(|(position, ..)| sees(world, sample.position, *position, 0)) {
            Some(found) => {
                sums[found].1 += sample.irradiance;
                sums[found].2 += 1;
            }
            None if sums.len() < MOST_PATCHES => sums.push((sample.position, sample.irradiance, 1)),
            None => {}
        }
    }
    let patch = |(position, sum, count): (Vec3, Vec3, usize)| Patch {
        position,
        irradiance: (count >= LEAST_SAMPLES).then(|| sum / count as f32),
    };
    sums.into_iter().map(patch).collect()
}

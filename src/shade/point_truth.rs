//! The light that arrives by paths at points other than those of a picture.

use glam::Vec3;
use rayon::prelude::*;

use super::block_mean::BlockMean;
use crate::light::World;
use crate::light::path::PathSettings;
use crate::light::surface::SurfacePoint;
use crate::math::blocks::{BLOCK, Block};
use crate::math::random::Purpose;
use crate::probe::query::QueryPoint;

/// Blocks of paths from each point at most. Their noise is subtracted, and the mean over so many points needs no more.
const MOST_BLOCKS: u32 = 4;

/// The light at some points, as probes hold it.
#[derive(Debug, Clone, PartialEq)]
pub struct PointTruth {
    /// W·m⁻².
    pub irradiance: Vec<Vec3>,
    /// Variance of each mean, per channel; `None` from less than two blocks of paths.
    pub variance: Option<Vec<Vec3>>,
    /// Independent blocks of paths from each point.
    pub blocks: u32,
}

impl PointTruth {
    /// By `spp` paths from each point, rounded up to whole blocks of sixteen, at most 64. `purpose` is that of the paths.
    pub fn trace(
        world: &World,
        points: &[(SurfacePoint, QueryPoint)],
        purpose: Purpose,
        spp: u32,
        seed: u64,
    ) -> PointTruth {
        let blocks = spp.div_ceil(BLOCK).clamp(1, MOST_BLOCKS);
        let at = |(index, (surface, query)): (usize, &(SurfacePoint, QueryPoint))| {
            let mut light = BlockMean::default();
            for b in 0..blocks {
                let block = Block::new(seed, purpose, index as u64, u64::from(b));
                light.add(world, (surface, query), &PathSettings::default(), &block);
            }
            (light.mean.as_vec3(), light.variance().as_vec3())
        };
        let (irradiance, variance) = points.par_iter().enumerate().map(at).unzip();
        PointTruth { irradiance, variance: (blocks > 1).then_some(variance), blocks }
    }
}

//! The light that arrives at a point by paths, as the mean of blocks of them: what the blocks differ by tells its noise.

use glam::DVec3;

use crate::light::World;
use crate::light::path::PathSettings;
use crate::light::sampled::RayCount;
use crate::light::surface::SurfacePoint;
use crate::math::blocks::{BLOCK, Block};
use crate::probe::query::QueryPoint;

/// Irradiance as probes hold it, W·m⁻². It has no light before the first block.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BlockMean {
    pub mean: DVec3,
    /// Σ of the squared differences from the mean.
    scatter: DVec3,
    pub blocks: u32,
}

impl BlockMean {
    /// Traces a block of [`BLOCK`] paths from the point, whose normal is that of `query`. Paths that are not finite count
    /// as 0.
    pub fn add(
        &mut self,
        world: &World,
        (surface, query): (&SurfacePoint, &QueryPoint),
        settings: &PathSettings,
        block: &Block,
    ) {
        let path = |i| {
            let (mut numbers, mut rays) = (block.sample(i), RayCount::default());
            world.gather(surface, query.normal, query.view, settings, &mut numbers, &mut rays).irradiance
        };
        let sum: DVec3 = (0..BLOCK).map(path).filter(|e| e.is_finite()).map(|e| e.as_dvec3()).sum();
        self.push(sum / f64::from(BLOCK));
    }

    /// Adds the mean of a block.
    pub fn push(&mut self, block: DVec3) {
        let delta = block - self.mean;
        self.mean += delta / f64::from(self.blocks + 1);
        self.scatter += delta * (block - self.mean);
        self.blocks += 1;
    }

    /// Variance of the mean, per channel; 0 from less than two blocks, which do not tell.
    pub fn variance(&self) -> DVec3 {
        let k = f64::from(self.blocks);
        self.scatter / (k * (k - 1.0)).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1, 2, 6: mean 3, squared differences 4 + 1 + 9 = 14, variance of the mean 14/(3·2).
    #[test]
    fn the_variance_is_that_of_the_mean() {
        let mut mean = BlockMean::default();
        [1.0, 2.0, 6.0].into_iter().for_each(|x| mean.push(DVec3::splat(x)));
        assert_eq!((mean.mean, mean.blocks), (DVec3::splat(3.0), 3));
        assert!((mean.variance().x - 14.0 / 6.0).abs() < 1e-12);
        let mut one = BlockMean::default();
        one.push(DVec3::ONE);
        assert_eq!(one.variance(), DVec3::ZERO);
    }
}

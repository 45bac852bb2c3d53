//! Points of a picture that ask with bent normals, as the relief of a normal map bends them. Walls ask for few directions of a
//! probe's light, normal maps for all.

use glam::Vec3;

use super::point_truth::PointTruth;
use super::points::{ImagePoint, View};
use super::visibility_modes::{VisibilityMode, exact_masks, irradiance};
use crate::light::World;
use crate::light::surface::SurfacePoint;
use crate::math::random::{Numbers, Purpose, Random};
use crate::probe::query::{Answers, QueryPoint};

/// Points at most.
const POINTS: usize = 4096;

/// Normals that are tried for a point. Where surfaces are smooth nine tenths of them lie above.
const TRIES: usize = 16;

/// Evenly spread over the points of a picture.
#[derive(Debug, Clone, Default)]
pub struct Bent {
    points: Vec<ImagePoint>,
}

impl Bent {
    pub fn of(view: &View, seed: u64) -> Bent {
        let step = view.points.len().div_ceil(POINTS).max(1);
        let bent = |(index, point): (usize, &ImagePoint)| {
            let mut random = Random::new(seed, Purpose::Bent, index as u64, 0);
            let normal = (0..TRIES).find_map(|_| point.surface.bent(random.pair()))?;
            Some(ImagePoint { query: QueryPoint { normal, ..point.query }, ..*point })
        };
        Bent { points: view.points.iter().step_by(step).enumerate().filter_map(bent).collect() }
    }

    /// Irradiance from the probes at every point, W·m⁻², in some modes.
    pub fn irradiance<const N: usize>(
        &self,
        world: &World,
        query: &impl Answers,
        modes: [VisibilityMode; N],
    ) -> [Vec<Vec3>; N] {
        let masks = exact_masks(world, query, &self.points);
        modes.map(|mode| irradiance(query, &self.points, &masks, mode))
    }

    /// The truth at the points, see [`PointTruth::trace`].
    pub fn truth(&self, world: &World, spp: u32, seed: u64) -> PointTruth {
        let points: Vec<(SurfacePoint, QueryPoint)> = self.points.iter().map(|p| (p.surface, p.query)).collect();
        PointTruth::trace(world, &points, Purpose::BentPaths, spp, seed)
    }
}

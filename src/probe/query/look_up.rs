//! The look-up itself.

use glam::{Vec2, Vec3, Vec3A};

use super::corner_test::{CornerTest, Mask, MomentsTest, RegionsTest, SurfaceTest, TilesTest};
use super::point::{CornerWeights, Part, QueryPoint, Visibility};
use super::settings::{LookUp, QuerySettings, VisibilityTest, WeightNormal};
use crate::math::octahedral::oct_from_direction;
use crate::probe::Volume;
use crate::probe::lattice::grid::{Cell, ProbeIndex};
use crate::probe::store::Irradiance;
use crate::probe::store::sh::ShIrradiance;

/// A volume and the way to ask it.
#[derive(Clone, Copy)]
pub struct Query<'v> {
    pub volume: &'v Volume,
    pub settings: &'v QuerySettings,
}

/// The test that a look-up makes.
enum Test<'v> {
    Mask(Mask),
    Moments(MomentsTest<'v>),
    Tiles(TilesTest<'v>),
    Surface(SurfaceTest<'v>),
    Regions(RegionsTest<'v>),
}

impl<'v> Query<'v> {
    /// The test that the mode and the settings ask for. Where nothing is stored everything is visible.
    #[inline]
    fn test(&self, visibility: Visibility) -> Test<'v> {
        let Volume { occlusion, positions, grid, .. } = self.volume;
        let found = match visibility {
            Visibility::Off => None,
            Visibility::Exact(mask) => Some(Test::Mask(Mask(mask))),
            Visibility::Stored => match self.settings.test {
                VisibilityTest::None => None,
                VisibilityTest::Chebyshev { power, floor } => {
                    let shorter = self.settings.distance_bias * self.settings.spacing(grid);
                    let tiles = |tiles| Test::Tiles(TilesTest { tiles, grid, positions, power, floor, shorter });
                    let moments = |maps| Test::Moments(MomentsTest { maps, positions, power, floor, shorter });
                    occlusion.moments().map(moments).or_else(|| occlusion.tiles().map(tiles))
                }
                VisibilityTest::Table(test) | VisibilityTest::Everywhere(test) => match occlusion.regions() {
                    Some(regions) => Some(Test::Regions(RegionsTest { regions })),
                    None => {
                        let everywhere = matches!(self.settings.test, VisibilityTest::Everywhere(_));
                        occlusion.surface().map(|table| Test::Surface(SurfaceTest { table, test, everywhere }))
                    }
                },
            },
        };
        found.unwrap_or(Test::Mask(Mask(u8::MAX)))
    }

    /// The shifted point P′.
    #[inline]
    fn biased(&self, point: &QueryPoint) -> Vec3 {
        // Without a shift the cell does not wait for one to be computed.
        if self.settings.reach() == 0.0 {
            return point.position;
        }
        let bias = self.weight_normal(point) * self.settings.normal_bias + point.view * self.settings.view_bias;
        point.position + bias * self.settings.spacing(&self.volume.grid)
    }

    /// The normal that weights and bias take.
    #[inline]
    fn weight_normal(&self, point: &QueryPoint) -> Vec3 {
        match self.settings.weight_normal {
            WeightNormal::Shading => point.normal,
            WeightNormal::Geometric => point.geometric,
        }
    }

    #[inline]
    fn cell_of(&self, point: &QueryPoint, biased: Vec3) -> Cell {
        self.volume.grid.cell(if self.settings.biased_cell { biased } else { point.position })
    }

    /// The cell whose corners a point asks.
    pub fn cell(&self, point: &QueryPoint) -> Cell {
        self.cell_of(point, self.biased(point))
    }

    /// Weights of the eight probes around a point; inactive probes weigh nothing.
    pub fn weights(&self, point: &QueryPoint, visibility: Visibility) -> CornerWeights {
        match self.test(visibility) {
            Test::Mask(test) => self.weigh(point, &test),
            Test::Moments(test) => self.weigh(point, &test),
            Test::Tiles(test) => self.weigh(point, &test),
            Test::Surface(test) => self.weigh(point, &test),
            Test::Regions(test) => self.weigh(point, &test),
        }
    }

    /// Which corners of its cell the stored table says that a point sees, where it is all the test there is: it then needs to
    /// be looked up only once. 0 where it says none, or there is more to the test.
    pub fn stored_mask(&self, point: &QueryPoint) -> u8 {
        let (biased, grid) = (self.biased(point), &self.volume.grid);
        let cell = || self.cell_of(point, biased);
        let seen = match self.test(Visibility::Stored) {
            Test::Regions(test) => test.seen(grid, &cell(), point, biased),
            Test::Surface(test) => test.seen(grid, &cell(), point, biased),
            Test::Mask(_) | Test::Moments(_) | Test::Tiles(_) => return 0,
        };
        if seen.far.is_none() { seen.mask } else { 0 }
    }

    #[inline]
    fn weigh(&self, point: &QueryPoint, test: &impl CornerTest) -> CornerWeights {
        let (volume, settings) = (self.volume, self.settings);
        let grid = &volume.grid;
        let biased = self.biased(point);
        let cell = self.cell_of(point, biased);
        let seen = test.seen(grid, &cell, point, biased);
        let mut out = CornerWeights { probes: grid.corners_around(&cell), weights: [0.0; 8] };
        if let Some(far) = seen.far {
            out.probes[0] = far;
            out.weights[0] = 1.0;
            return out;
        }
        let trilinear = floored_trilinear(cell.fraction, settings.trilinear_floor);
        for (i, &probe) in out.probes.iter().enumerate() {
            let is_nothing = trilinear[i] <= 0.0 && settings.least_weight == 0.0;
            if is_nothing || seen.mask >> i & 1 == 0 || !volume.is_active(probe) {
                continue;
            }
            let to_probe = || (volume.position(probe) - point.position).normalize_or_zero();
            let mut weight = settings.direction.at(|| to_probe().dot(self.weight_normal(point)));
            weight *= test.factor(probe, biased);
            weight = weight.max(settings.weight_floor);
            if weight < settings.crush_below {
                weight *= (weight / settings.crush_below).powi(2);
            }
            out.weights[i] = (weight * trilinear[i]).max(settings.least_weight);
        }
        if settings.blank_below > 0.0 && out.weights.iter().all(|w| *w < settings.blank_below) {
            out.weights = [0.0; 8];
        }
        out
    }

    /// Irradiance around the point's normal, W·m⁻²; zero where no probe counts.
    pub fn irradiance(&self, point: &QueryPoint, visibility: Visibility) -> Vec3 {
        let weights = self.weights(point, visibility);
        let irradiance = self.blend(&weights, point, oct_from_direction(point.normal));
        // Sums of harmonics dip below 0 beside bright lights. Bounces keep that, to stay linear; no one is shown it.
        match self.volume.irradiance.harmonics() {
            Some(sh) => irradiance.max(self.least(sh, &weights)),
            None => irradiance,
        }
    }

    /// The least that a point gets where sums may be negative.
    #[inline]
    fn least(&self, sh: &ShIrradiance, corners: &CornerWeights) -> Vec3 {
        let floor = self.settings.sum_floor;
        let shares = if floor > 0.0 { corners.shares() } else { None };
        let means = shares.into_iter().flatten().map(|(i, share)| sh.unknown(corners.probes[i].0 as usize, 0) * share);
        Vec3::from(means.sum::<Vec3A>() * floor).max(Vec3::ZERO)
    }

    /// Weighted mean of the probes' irradiance around the direction `oct`, the point's normal.
    #[inline]
    pub fn blend(&self, corners: &CornerWeights, point: &QueryPoint, oct: Vec2) -> Vec3 {
        let Some(shares) = corners.shares() else { return Vec3::ZERO };
        let shares = shares.map(|(corner, share)| (corners.probes[corner].0 as usize, share));
        let offset = |probe| self.offset(point, probe);
        let forward = |e| self.settings.blend.forward(e);
        let sum = match self.settings.look_up {
            LookUp::Normal => self.volume.irradiance.sum(oct, shares, offset, forward),
            LookUp::Towards => {
                let biased = self.biased(point);
                let of = |(probe, share)| {
                    let oct = self.towards(probe, biased, point.normal);
                    self.volume.irradiance.sum(oct, [(probe, share)].into_iter(), offset, forward)
                };
                shares.map(of).sum()
            }
        };
        self.settings.blend.backward(sum).into()
    }

    /// The parts that [`Self::irradiance`] adds up, where that is linear: each probe's share, the direction that it is asked
    /// around and how far it is.
    pub fn parts(&self, corners: &CornerWeights, point: &QueryPoint) -> Vec<Part> {
        let total = corners.weights.iter().map(|w| f64::from(*w)).sum::<f64>();
        let biased = self.biased(point);
        let counted = corners.probes.iter().zip(corners.weights).filter(|(_, weight)| *weight > 0.0);
        let part = |(probe, weight): (&ProbeIndex, f32)| {
            let p = probe.0 as usize;
            let oct = match self.settings.look_up {
                LookUp::Normal => oct_from_direction(point.normal),
                LookUp::Towards => self.towards(p, biased, point.normal),
            };
            let share = (f64::from(weight) / total) as f32;
            Part { probe: *probe, share, oct, offset: self.offset(point, p) }
        };
        counted.map(part).collect()
    }

    /// How far a point is from a probe, in the spacings of that probe, as [`Irradiance::sum`] takes it.
    #[inline]
    fn offset(&self, point: &QueryPoint, probe: usize) -> Vec3 {
        let Volume { positions, grid, .. } = self.volume;
        let spacing = grid.spacing() * grid.width(ProbeIndex(probe as u32)) as f32;
        let farthest = Vec3::splat(Irradiance::FARTHEST);
        ((point.position - positions[probe]) / spacing).clamp(-farthest, farthest)
    }

    /// Where a probe's irradiance is read for a point that asks for it around `normal`, see [`LookUp::Towards`].
    fn towards(&self, probe: usize, biased: Vec3, normal: Vec3) -> Vec2 {
        let Volume { occlusion, positions, grid, .. } = self.volume;
        let distance = occlusion.mean_distance(grid, ProbeIndex(probe as u32), normal);
        let target = biased + distance * normal - positions[probe];
        // A probe that stands in the target knows no better direction.
        oct_from_direction(target.try_normalize().unwrap_or(normal))
    }
}

/// Trilinear weights of the eight corners; they sum to 1.
#[inline]
pub fn trilinear(fraction: Vec3) -> [f32; 8] {
    floored_trilinear(fraction, 0.0)
}

/// Trilinear weights of the eight corners, no axis below `floor`; without a floor they sum to 1.
#[inline]
fn floored_trilinear(fraction: Vec3, floor: f32) -> [f32; 8] {
    let [x, y, z] = fraction.to_array().map(|f| [(1.0 - f).max(floor), f.max(floor)]);
    std::array::from_fn(|i| x[i & 1] * y[i >> 1 & 1] * z[i >> 2 & 1])
}

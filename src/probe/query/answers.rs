//! What figures and fits ask of a look-up, whoever's rules it follows: eight weighted probes a point.

use glam::Vec3;

use super::look_up::Query;
use super::point::{CornerWeights, QueryPoint, Visibility};
use crate::probe::lattice::Grid;
use crate::probe::lattice::grid::ProbeIndex;

/// A look-up: a volume by its own weights, or an export as its engine reads it.
pub trait Answers: Sync {
    /// The lattice that says where the probes' hull is and how far apart they stand.
    fn grid(&self) -> &Grid;

    /// Of all probes, relative to the scene's origin, metres.
    fn positions(&self) -> &[Vec3];

    fn is_active(&self, probe: ProbeIndex) -> bool;

    /// The eight probes that a point asks; any where it asks none.
    fn corners(&self, point: &QueryPoint) -> [ProbeIndex; 8];

    /// Their weights, not normalised.
    fn weights(&self, point: &QueryPoint, visibility: Visibility) -> CornerWeights;

    /// Irradiance around the point's normal, W·m⁻²; zero where no probe counts.
    fn irradiance(&self, point: &QueryPoint, visibility: Visibility) -> Vec3;

    /// A probe's irradiance around a unit normal, W·m⁻².
    fn probe_irradiance(&self, probe: ProbeIndex, normal: Vec3) -> Vec3;

    /// Whether it knows of any probe that a point does not see. Where it does not, light that comes through walls is its own
    /// rule, and a fit has to reckon with it.
    fn knows_walls(&self) -> bool;

    /// The probes themselves, where they hold light for glossy surfaces.
    fn glossy(&self) -> Option<Query<'_>> {
        None
    }

    /// The same where rays are traced in them for irradiance.
    fn diffuse_rays(&self) -> Option<Query<'_>> {
        None
    }
}

impl Answers for Query<'_> {
    fn grid(&self) -> &Grid {
        &self.volume.grid
    }

    fn positions(&self) -> &[Vec3] {
        &self.volume.positions
    }

    #[inline]
    fn is_active(&self, probe: ProbeIndex) -> bool {
        self.volume.is_active(probe)
    }

    #[inline]
    fn corners(&self, point: &QueryPoint) -> [ProbeIndex; 8] {
        self.volume.grid.corners_around(&self.cell(point))
    }

    #[inline]
    fn weights(&self, point: &QueryPoint, visibility: Visibility) -> CornerWeights {
        Query::weights(self, point, visibility)
    }

    #[inline]
    fn irradiance(&self, point: &QueryPoint, visibility: Visibility) -> Vec3 {
        Query::irradiance(self, point, visibility)
    }

    fn probe_irradiance(&self, probe: ProbeIndex, normal: Vec3) -> Vec3 {
        self.volume.probe_irradiance(probe, normal)
    }

    fn knows_walls(&self) -> bool {
        true
    }

    fn glossy(&self) -> Option<Query<'_>> {
        let answers = self.tracing().is_some() || !self.volume.radiance.prefiltered.is_empty();
        (!self.settings.glossy.is_none() && answers).then_some(*self)
    }

    fn diffuse_rays(&self) -> Option<Query<'_>> {
        self.diffuse_tracing().is_some().then_some(*self)
    }
}

/// What is lent answers as what it is.
impl<A: Answers> Answers for &A {
    fn grid(&self) -> &Grid {
        (*self).grid()
    }

    fn positions(&self) -> &[Vec3] {
        (*self).positions()
    }

    fn is_active(&self, probe: ProbeIndex) -> bool {
        (*self).is_active(probe)
    }

    fn corners(&self, point: &QueryPoint) -> [ProbeIndex; 8] {
        (*self).corners(point)
    }

    fn weights(&self, point: &QueryPoint, visibility: Visibility) -> CornerWeights {
        (*self).weights(point, visibility)
    }

    fn irradiance(&self, point: &QueryPoint, visibility: Visibility) -> Vec3 {
        (*self).irradiance(point, visibility)
    }

    fn probe_irradiance(&self, probe: ProbeIndex, normal: Vec3) -> Vec3 {
        (*self).probe_irradiance(probe, normal)
    }

    fn knows_walls(&self) -> bool {
        (*self).knows_walls()
    }

    fn glossy(&self) -> Option<Query<'_>> {
        (*self).glossy()
    }

    fn diffuse_rays(&self) -> Option<Query<'_>> {
        (*self).diffuse_rays()
    }
}

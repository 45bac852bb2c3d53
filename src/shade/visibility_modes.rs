//! The probes' light at a picture's points in three visibility modes: without a visibility test, with the test of the
//! probe file, and with exact rays.

use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::points::ImagePoint;
use crate::light::World;
use crate::light::contact::{Contacts, Facet, sight_line};
use crate::light::surface::SurfacePoint;
use crate::probe::ProbeIndex;
use crate::probe::query::{Answers, Visibility};
use crate::trace::Ray;

/// Number of times that shading is repeated to measure its time.
pub const RUNS: usize = 5;

/// Most points over which the time of a look-up is averaged.
const LOOKUP_POINTS: usize = 20_000;

/// Which visibility test the look-up uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisibilityMode {
    /// None.
    Off,
    /// The test that the probe file stores.
    On,
    /// Exact rays from the point to the probes.
    Ray,
}

impl VisibilityMode {
    /// All modes in the order of the report.
    pub const ALL: [VisibilityMode; 3] = [VisibilityMode::Off, VisibilityMode::On, VisibilityMode::Ray];

    /// Name in reports and in the file names of pictures.
    pub fn name(self) -> &'static str {
        match self {
            VisibilityMode::Off => "visibility_off",
            VisibilityMode::On => "visibility_on",
            VisibilityMode::Ray => "visibility_ray",
        }
    }

    /// The source of a point's visibility factors. `mask` is the point's entry of [`exact_masks`].
    pub fn visibility(self, mask: u8) -> Visibility {
        match self {
            VisibilityMode::Off => Visibility::Off,
            VisibilityMode::On => Visibility::Stored,
            VisibilityMode::Ray => Visibility::Exact(mask),
        }
    }
}

/// For every point, which of its eight probes it sees: bit i is set if the probe of corner i is active and visible.
///
/// A probe is visible if no surface blocks the segment from P + ε·n_g to the probe, where n_g is the geometric normal
/// on the viewer's side and ε the ray offset of the surface. The segment starts at the surface, as in the survey,
/// because ε accounts for the rounding there. A ray from a probe farther from the scene's origin would need a larger
/// offset. Probes in the plane of a surface follow [`sight_line`].
pub fn exact_masks(world: &World, query: &impl Answers, points: &[ImagePoint]) -> Vec<u8> {
    let contacts = Contacts::of_points(world.scene, query.positions());
    let mask = |point: &ImagePoint| {
        exact_mask(world, query, &contacts, &point.surface, query.corners(&point.query), point.pixel)
    };
    points.par_iter().map(mask).collect()
}

/// The same for eight probes and one point of a surface. `contacts` are those of the probes; `salt` is the rays'.
pub fn exact_mask(
    world: &World,
    query: &impl Answers,
    contacts: &Contacts,
    surface: &SurfacePoint,
    corners: [ProbeIndex; 8],
    salt: u32,
) -> u8 {
    let facet = Facet { position: surface.position, normal: surface.geometric_normal, offset: surface.ray_offset };
    corners.into_iter().enumerate().fold(0, |mask, (i, probe)| {
        let contact = contacts.of(probe.0 as usize);
        let is_free = |(origin, target)| !world.tracer.occluded(Ray::segment(origin, target, salt));
        let position = query.positions()[probe.0 as usize];
        let visible = query.is_active(probe) && sight_line(&facet, position, contact).is_some_and(is_free);
        mask | u8::from(visible) << i
    })
}

/// Irradiance from the probes at every point, W·m⁻².
pub fn irradiance(query: &impl Answers, points: &[ImagePoint], masks: &[u8], mode: VisibilityMode) -> Vec<Vec3> {
    points.par_iter().zip(masks).map(|(point, &mask)| query.irradiance(&point.query, mode.visibility(mask))).collect()
}

/// Milliseconds for querying and shading all points, one entry per run.
pub fn time_shading(query: &impl Answers, points: &[ImagePoint], masks: &[u8], mode: VisibilityMode) -> Vec<f64> {
    let mut radiance = vec![Vec3::ZERO; points.len()];
    (0..RUNS)
        .map(|_| {
            let started = Instant::now();
            radiance.par_iter_mut().zip(points.par_iter().zip(masks)).for_each(|(out, (point, &mask))| {
                let indirect = query.irradiance(&point.query, mode.visibility(mask));
                *out = super::layers::beauty(point, indirect);
            });
            std::hint::black_box(&radiance);
            started.elapsed().as_secs_f64() * 1e3
        })
        .collect()
}

/// Nanoseconds of one look-up on one thread, one entry per run; none without points.
pub fn time_lookup(query: &impl Answers, points: &[ImagePoint], masks: &[u8], mode: VisibilityMode) -> Vec<f64> {
    let step = points.len().div_ceil(LOOKUP_POINTS).max(1);
    let chosen: Vec<_> = points.iter().zip(masks).step_by(step).map(|(p, &mask)| (p.query, mask)).collect();
    let run = |_| {
        let started = Instant::now();
        for (point, mask) in &chosen {
            std::hint::black_box(query.irradiance(point, mode.visibility(*mask)));
        }
        started.elapsed().as_secs_f64() * 1e9 / chosen.len() as f64
    };
    if chosen.is_empty() { Vec::new() } else { (0..RUNS).map(run).collect() }
}

//! Rays of a picture that are traced in the probes: one a pixel, and a joint bilateral filter that takes the mean over the
//! pixels around that show the same surface (McGuire et al. 2017).

use glam::Vec3;
use rayon::prelude::*;

use super::points::{ImagePoint, View};
use crate::math::random::{Purpose, Random};
use crate::probe::query::march::{Reads, TraceSettings};
use crate::probe::query::trace::{End, Tracing};

/// What rays cost, and how many are lost.
#[derive(Debug, Clone, Copy, Default)]
pub struct RayFigures {
    pub rays: u64,
    pub probes: u64,
    pub reads: u64,
    /// Rays of which no probe knows where they end.
    pub lost: u64,
}

/// Power of the cosine between normals. The source gives its filter's radius and step only. This and the next two are the
/// defaults of the filter in its authors' engine, G3D (`BilateralFilterSettings`: weights of normals, planes and depths of 1).
const NORMAL_POWER: i32 = 4;

/// A pixel counts for nothing from this sine on of the angle between the plane of either surface and the way to the other.
const PLANE_SINE: f32 = 0.5;

/// A pixel counts for nothing from this difference of distances to the viewer on, in spacings, as other lengths of the method;
/// there 1 m.
const DEPTH: f32 = 1.0;

/// A pixel counts for nothing from this difference of roughness on: the same filter's with a weight of glossiness of 1, as the
/// engine AnKi has it. G3D's default is 0: rough surfaces would get what smooth ones beside them mirror.
const ROUGHNESS: f32 = 0.1;

/// How the rays of a view are traced and filtered.
#[derive(Clone, Copy)]
pub struct Rays<'a> {
    pub view: &'a View,
    pub tracing: Tracing<'a>,
    pub settings: &'a TraceSettings,
    pub seed: u64,
}

impl Rays<'_> {
    /// Mean radiance at every point along rays in the directions that `direction` draws, W·m⁻²·sr⁻¹; zero where it draws none
    /// around. `roughness` tells surfaces apart.
    pub fn trace(
        &self,
        purpose: Purpose,
        direction: impl Fn(usize, &ImagePoint, &mut Random) -> Option<Vec3> + Sync,
        roughness: impl Fn(usize) -> f32 + Sync,
    ) -> (Vec<Vec3>, RayFigures) {
        let of_point = |(i, point): (usize, &ImagePoint)| {
            let mut random = Random::new(self.seed, purpose, u64::from(point.pixel), 0);
            let (direction, normal) = (direction(i, point, &mut random)?, point.surface.geometric_normal);
            if direction.dot(normal) <= 0.0 {
                return None;
            }
            let mut reads = Reads::default();
            let origin = point.surface.position + normal * self.tracing.clearance();
            let traced = self.tracing.trace(origin, direction, &mut reads);
            Some((self.tracing.radiance(&traced, direction), traced, reads.all()))
        };
        let found: Vec<_> = self.view.points.par_iter().enumerate().map(of_point).collect();
        let mut figures = RayFigures::default();
        for (_, traced, reads) in found.iter().flatten() {
            figures.rays += 1;
            figures.probes += u64::from(traced.probes);
            figures.reads += reads;
            figures.lost += u64::from(matches!(traced.end, End::Lost { .. }));
        }
        let radiance: Vec<Option<Vec3>> = found.into_iter().map(|f| f.map(|(radiance, ..)| radiance)).collect();
        (self.filter(&radiance, roughness), figures)
    }

    /// Means by a Gaussian of half the radius and by likeness of normals, planes, depths and roughness ([`likeness`]).
    fn filter(&self, radiance: &[Option<Vec3>], roughness: impl Fn(usize) -> f32 + Sync) -> Vec<Vec3> {
        let (width, height) = (i64::from(self.view.width), i64::from(self.view.height));
        let mut first = vec![usize::MAX; (width * height) as usize];
        for (i, point) in self.view.points.iter().enumerate().rev() {
            first[point.pixel as usize] = i;
        }
        let (radius, step) = (i64::from(self.settings.radius), self.settings.step.max(1) as usize);
        let per_radius = 2.0 / ((radius * radius) as f32).max(1.0);
        let mean = |(i, point): (usize, &ImagePoint)| {
            let (x, y) = (i64::from(point.pixel) % width, i64::from(point.pixel) / width);
            let (mut sum, mut total) = (Vec3::ZERO, 0.0f32);
            // The middle is always one of them.
            let along = || (-(radius / step as i64)..=radius / step as i64).map(|k| k * step as i64);
            for (dx, dy) in along().flat_map(|dy| along().map(move |dx| (dx, dy))) {
                let (column, row) = (x + dx, y + dy);
                if !(0..width).contains(&column) || !(0..height).contains(&row) {
                    continue;
                }
                // Of several points in the middle pixel the point itself.
                let other = if dx == 0 && dy == 0 { i } else { first[(column + width * row) as usize] };
                let (Some(light), Some(near)) = (radiance.get(other).copied().flatten(), self.view.points.get(other))
                else {
                    continue;
                };
                let rough = 1.0 - (roughness(other) - roughness(i)).abs() / ROUGHNESS;
                let weight = (-((dx * dx + dy * dy) as f32 * per_radius)).exp() * rough.max(0.0);
                let weight = weight * likeness(point, near, DEPTH * self.tracing.spacing());
                sum += light * weight;
                total += weight;
            }
            if total > 0.0 { sum / total } else { Vec3::ZERO }
        };
        self.view.points.par_iter().enumerate().map(mean).collect()
    }
}

/// How much two points are of one surface, 0 to 1. `depth`: the difference of their distances to the viewer from which on they
/// are not, metres.
fn likeness(a: &ImagePoint, b: &ImagePoint, depth: f32) -> f32 {
    let cosine = a.query.normal.dot(b.query.normal).max(0.0);
    let way = b.surface.position - a.surface.position;
    let off = way.dot(a.query.normal).abs().max(way.dot(b.query.normal).abs());
    // Of one place where there is no way between them.
    let sine = if off > 0.0 { off / way.length() } else { 0.0 };
    let flat = (1.0 - sine / PLANE_SINE).max(0.0);
    let near = (1.0 - (b.depth - a.depth).abs() / depth).max(0.0);
    cosine.powi(NORMAL_POWER) * flat * flat * near
}

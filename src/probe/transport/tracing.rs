//! Light traced from hit to hit, read where the probes see it (Luo 2022).
//!
//! The captures hold at every texel's hit h the radiance I₀ that it reflects of light that came straight from emitters (and
//! emits, where emission is gathered). Each iteration sends one cosine-distributed ray from every hit. It meets the surface
//! at y, and the probes of the cell of y tell what leaves y towards them, but for those whose stored distance in that
//! direction ends before y: `I_k(h) = ρ(h)·mean of I_{k−1}`, the probes' trilinear weights summing to 1. Where all probes are
//! rejected, nothing is known and nothing added. A cross-bilateral filter over each probe's map takes the noise of the single
//! rays away. What is stored is the sum of all I_k.
//!
//! Memory: four colours for every texel of all probes, beside the light field and the captures.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3, Vec3A};
use rayon::prelude::*;

use super::operator::{Captures, Field, Operator, Scenery};
use super::settings::{TracingFilter, TracingSettings};
use super::solver::{Bounce, Progress, Solution, Stopped};
use crate::math::color::luminance;
use crate::math::octahedral::{direction_from_oct, oct_from_direction};
use crate::math::offset::ray_offset;
use crate::math::random::{Purpose, Random};
use crate::math::sampling::cosine_hemisphere;
use crate::probe::Volume;
use crate::probe::capture::ProbeCapture;
use crate::probe::query::trilinear;
use crate::probe::store::map::{OctahedralMaps, fill_with_border, interior_texel};
use crate::probe::store::radiance::FAR_M;
use crate::trace::Ray;

/// Names of what a checkpoint holds, the texels of the active probes one after another: the last reflection, and the sum of
/// all with the light before any.
const LAST: &str = "last";
const SUM: &str = "sum";

/// Traces until next to nothing is added. Without a scene or a light field there is nothing to trace.
pub fn solve<C: Captures>(
    operator: &Operator<C>,
    settings: &TracingSettings,
    volume: &mut Volume,
    mut progress: Progress,
    mut on_iteration: impl FnMut(&Progress, &Volume),
) -> Solution {
    operator.keep_radiance(volume, None, operator.gathers_emission);
    let Some(scenery) = operator.captures.scenery() else { return progress.solution };
    let Some(field) = &volume.radiance.light_field else { return progress.solution };
    let active: Vec<usize> = volume.active().collect();
    let mut last = field.radiance.clone();
    let (resolution, border) = (last.resolution, last.border);
    let interior = interior_texel(resolution, border);
    let texels = resolution * resolution;
    let is_whole = |name| progress.fields.get(name).is_some_and(|field| field.len() == active.len() * texels);
    if is_whole(LAST) && is_whole(SUM) {
        for (&p, light) in active.iter().zip(progress.fields[LAST].chunks(texels)) {
            fill_with_border(light, resolution, border, last.probe_mut(p));
        }
    } else {
        let stored = |&p: &usize| (0..texels).map(|o| last.probe(p)[interior(o)]).collect::<Field>();
        let sum = active.iter().flat_map(stored).collect();
        progress = Progress { fields: BTreeMap::from([(SUM.to_owned(), sum)]), ..Progress::default() };
    }
    let tracing = Tracing { operator, scenery: &scenery, volume, offset: Tracing::<C>::offset(&scenery) };
    for index in progress.solution.bounces.len() as u32 + 1..=settings.iterations {
        if progress.solution.converged {
            break;
        }
        let of_probe = |&p: &usize| {
            let (light, lost) = tracing.reflect(p, &last, index);
            let filtered = filter(&settings.filter, field_of(volume, p).as_ref(), resolution, &light);
            (filtered, lost)
        };
        let found: Vec<(Vec<Vec3>, u64)> = active.par_iter().map(of_probe).collect();
        let (mut largest, mut change, mut energy) = (0.0f32, 0.0f32, 0.0);
        let Progress { solution, fields, .. } = &mut progress;
        let sum = fields.entry(SUM.to_owned()).or_default();
        for ((&p, (light, lost)), total) in active.iter().zip(&found).zip(sum.chunks_mut(texels)) {
            solution.non_finite += lost;
            solution.rays.0 += operator.captures.with(p, |capture| capture.surfels.len()) as u64;
            fill_with_border(light, resolution, border, last.probe_mut(p));
            for (total, light) in total.iter_mut().zip(light) {
                *total += *light;
                largest = largest.max(total.max_element());
                change = change.max(light.max_element());
                energy += f64::from(luminance(*total));
            }
        }
        let residual = if largest > 0.0 { f64::from(change) / f64::from(largest) } else { 0.0 };
        let energy = std::f64::consts::PI * energy / (texels * active.len()).max(1) as f64;
        solution.bounces.push(Bounce { index, residual, energy, accelerated: false });
        solution.converged = residual < f64::from(settings.tolerance);
        fields.insert(LAST.to_owned(), found.into_iter().flat_map(|(light, _)| light).collect());
        on_iteration(&progress, volume);
    }
    let sum = progress.fields.remove(SUM).unwrap_or_default();
    keep(operator, volume, &active, &sum.chunks(texels).collect::<Vec<_>>());
    let solution = progress.solution;
    let stopped = if solution.converged { Stopped::Settled } else { Stopped::Limit };
    Solution { stopped: Some(stopped), ..solution }
}

/// Stores the radiance of the active probes, and the irradiance that it makes.
fn keep<C: Captures>(operator: &Operator<C>, volume: &mut Volume, active: &[usize], total: &[&[Vec3]]) {
    let mut place = vec![None; volume.states.len()];
    active.iter().enumerate().for_each(|(i, &p)| place[p] = Some(i));
    volume.irradiance.set_each(|p, _| {
        let radiance: Vec<Vec3A> = total[place[p]?].iter().map(|&l| l.into()).collect();
        let mut irradiance = vec![Vec3A::ZERO; operator.kernel.rows()];
        operator.kernel.irradiance(&radiance, &mut irradiance);
        Some((irradiance, ()))
    });
    for (&p, total) in active.iter().zip(total) {
        operator.captures.with(p, |capture| {
            let mut radiance: Vec<Vec3A> = total.iter().map(|&l| l.into()).collect();
            if !operator.gathers_emission {
                radiance.iter_mut().zip(capture.shown_radiance()).for_each(|(l, emitted)| *l += emitted);
            }
            volume.radiance.set(p, &radiance, |o| capture.surface_in(o));
        });
    }
    if !operator.gathers_emission {
        operator.add_emission(volume);
    }
}

/// Normals and distances in a probe's texels, without the border.
struct Guide {
    normals: Vec<Vec3>,
    distances: Vec<f32>,
}

fn field_of(volume: &Volume, p: usize) -> Option<Guide> {
    let field = volume.radiance.light_field.as_ref()?;
    let n = field.distance.resolution;
    let interior = interior_texel(n, field.distance.border);
    Some(Guide {
        normals: (0..n * n).map(|o| direction_from_oct(field.normal.probe(p)[interior(o)])).collect(),
        distances: (0..n * n).map(|o| field.distance.probe(p)[interior(o)]).collect(),
    })
}

struct Tracing<'a, C> {
    operator: &'a Operator<'a, C>,
    scenery: &'a Scenery<'a>,
    volume: &'a Volume,
    /// Distance from surfaces at which rays that leave them start, metres.
    offset: f32,
}

impl<C: Captures> Tracing<'_, C> {
    /// Hits do not remember their triangles: the farthest corner of the scene's box stands for all.
    fn offset(scenery: &Scenery) -> f32 {
        scenery.world.scene.mesh.bounds().map_or(0.0, |(low, high)| ray_offset(&[low, high, low]))
    }

    /// One reflection at the hits of a probe: radiance by texel, and how many hits' was not finite.
    fn reflect(&self, p: usize, light: &OctahedralMaps<Vec3>, index: u32) -> (Vec<Vec3>, u64) {
        let shorter = self.operator.query.distance_bias * self.operator.query.spacing(&self.volume.grid);
        self.operator.captures.with(p, |capture: &ProbeCapture| {
            let mut random = Random::new(self.scenery.seed, Purpose::HitRays, p as u64, u64::from(index));
            let mut out = vec![Vec3::ZERO; capture.texels];
            let mut lost = 0;
            for surfel in &capture.surfels {
                let normal = direction_from_oct(surfel.oct());
                let direction = cosine_hemisphere(normal, Vec2::new(random.uniform(), random.uniform()));
                let origin = surfel.position + normal * self.offset;
                let ray = Ray::new(origin, direction, random.bits());
                let incoming = match self.scenery.world.tracer.closest(ray) {
                    Some(hit) => seen_at(self.volume, origin + direction * hit.t, light, shorter),
                    // Sampled, the sky is in the direct light already.
                    None if index == 1 && self.operator.gathers_emission => {
                        self.scenery.world.scene.environment.radiance(direction)
                    }
                    None => Vec3::ZERO,
                };
                let reflected = surfel.albedo() * incoming;
                if reflected.is_finite() {
                    out[surfel.texel as usize] += reflected;
                } else {
                    lost += 1;
                }
            }
            (out, lost)
        })
    }
}

/// What leaves a point, as the probes around it see it: those whose stored distance in its direction does not end
/// `shorter`, metres, before it. Black where there is none.
fn seen_at(volume: &Volume, y: Vec3, light: &OctahedralMaps<Vec3>, shorter: f32) -> Vec3 {
    let Volume { grid, positions, radiance, .. } = volume;
    let Some(field) = &radiance.light_field else { return Vec3::ZERO };
    let cell = grid.cell(y);
    let (mut sum, mut total) = (Vec3::ZERO, 0.0);
    for (probe, weight) in grid.corners_around(&cell).into_iter().zip(trilinear(cell.fraction)) {
        if weight <= 0.0 || !volume.is_active(probe) {
            continue;
        }
        let p = probe.0 as usize;
        let from_probe = y - positions[p];
        let distance = from_probe.length();
        if distance == 0.0 {
            continue;
        }
        let taps = light.taps(oct_from_direction(from_probe));
        if field.distance.sample(p, &taps) < distance - shorter {
            continue;
        }
        sum += light.sample(p, &taps) * weight;
        total += weight;
    }
    if total > 0.0 { sum / total } else { Vec3::ZERO }
}

/// One probe's map, filtered.
fn filter(filter: &TracingFilter, guide: Option<&Guide>, n: usize, light: &[Vec3]) -> Vec<Vec3> {
    let (TracingFilter::Bilateral { radius, normal_power, distance }, Some(guide)) = (*filter, guide) else {
        return light.to_vec();
    };
    let radius = (radius as isize).min(n as isize);
    // A Gaussian of half the radius.
    let per_radius = 2.0 / (radius * radius) as f32;
    let texel = |o: usize| {
        let (normal, depth) = (guide.normals[o], guide.distances[o]);
        if depth >= FAR_M {
            return light[o];
        }
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                let q = wrap((o % n) as isize + dx, (o / n) as isize + dy, n);
                let cosine = normal.dot(guide.normals[q]);
                if guide.distances[q] >= FAR_M || cosine <= 0.0 {
                    continue;
                }
                let apart = (guide.distances[q] - depth) / (distance * depth).max(f32::MIN_POSITIVE);
                let near = (-((dx * dx + dy * dy) as f32) * per_radius - 0.5 * apart * apart).exp();
                let weight = near * cosine.powf(normal_power);
                sum += light[q] * weight;
                total += weight;
            }
        }
        if total > 0.0 { sum / total } else { light[o] }
    };
    (0..n * n).map(texel).collect()
}

/// The texel that continues a map at most its own size outside of it: every step across an edge arrives mirrored about the
/// edge's middle, as far inside as it would be outside.
fn wrap(mut column: isize, mut row: isize, n: usize) -> usize {
    let last = n as isize - 1;
    let inside = |x: isize| if x < 0 { -1 - x } else { 2 * last + 1 - x };
    if !(0..=last).contains(&row) {
        (column, row) = (last - column, inside(row));
    }
    if !(0..=last).contains(&column) {
        (column, row) = (inside(column), last - row);
    }
    (column + row * n as isize) as usize
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, UVec3};

    use super::*;
    use crate::math::octahedral::{texel_direction, wrap_texel};
    use crate::probe::lattice::{Grid, ProbeState};
    use crate::probe::store::encode::ColorFormat;
    use crate::probe::store::radiance::{LightFieldStore, RadianceStore};
    use crate::probe::store::{IrradianceStore, Occlusion};

    /// Two probes 4 m apart along x; probe p sees the radiance p + 1 at the distance `reach[p]` everywhere.
    fn two(reach: [f32; 2]) -> Volume {
        let grid = Grid::from_parts(DVec3::ZERO, Vec3::splat(4.0), UVec3::new(2, 1, 1)).unwrap();
        let store = RadianceStore {
            light_field: LightFieldStore::Maps,
            prefiltered: &[],
            prefilter: Default::default(),
            format: ColorFormat::F32,
            border: 1,
        };
        let mut radiance = store.zeros(2, 4);
        for (p, reach) in reach.into_iter().enumerate() {
            radiance.set(p, &[Vec3A::splat(p as f32 + 1.0); 16], |_| Some((Vec3::X, reach)));
        }
        Volume {
            states: vec![ProbeState::Active; 2],
            positions: grid.probes().map(|p| grid.grid_point(p)).collect(),
            irradiance: IrradianceStore::default().zeros(2, 1),
            occlusion: Occlusion::None,
            radiance,
            layout: Default::default(),
            grid,
        }
    }

    #[test]
    fn probes_that_see_something_nearer_are_rejected() {
        let at = |reach: [f32; 2], shorter: f32| {
            let volume = two(reach);
            let light = volume.radiance.light_field.as_ref().unwrap().radiance.clone();
            // 1 m from probe 0 and 3 m from probe 1: weights 3/4 and 1/4.
            seen_at(&volume, Vec3::X, &light, shorter).x
        };
        let near = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-5, "{found} not {expected}");
        near(at([9.0, 9.0], 0.0), 1.25);
        // A wall before probe 1, behind the point or at it, and one before both.
        near(at([9.0, 2.9], 0.0), 1.0);
        near(at([1.0, 3.0], 0.0), 1.25);
        near(at([0.9, 9.0], 0.0), 2.0);
        near(at([0.9, 2.9], 0.0), 0.0);
        // Distances that end this little before the point are let through.
        near(at([0.995, 2.995], 0.01), 1.25);
        near(at([0.985, 2.995], 0.01), 2.0);
        let mut dead = two([9.0, 9.0]);
        dead.states[0] = ProbeState::InsideGeometry;
        let light = dead.radiance.light_field.as_ref().unwrap().radiance.clone();
        near(seen_at(&dead, Vec3::X, &light, 0.0).x, 2.0);
    }

    #[test]
    fn texels_beyond_the_edge_are_neighbours() {
        let n = 16;
        for i in 0..n as isize {
            for (c, r) in [(-1, i), (n as isize, i), (i, -1), (i, n as isize), (-1, -1), (16, -1)] {
                let (column, row) = wrap_texel(c, r, n);
                assert_eq!(wrap(c, r, n), column + row * n);
            }
        }
        // Three steps are at most three texels of 0.2 rad, and a fold more.
        let direction = |t: usize| texel_direction(t % n, t / n, n);
        for (c, r) in [(-3, 5), (18, 9), (4, -3), (11, 18)] {
            let edge = wrap(c.clamp(0, 15), r.clamp(0, 15), n);
            assert!(direction(wrap(c, r, n)).angle_between(direction(edge)) < 0.8, "({c}, {r})");
        }
    }

    /// The filter keeps what is even, mixes what noise there is on a surface, and nothing across an edge.
    #[test]
    fn noise_is_mixed_on_a_surface_only() {
        let n = 16;
        let left = |o: usize| o % n < n / 2;
        let guide = Guide {
            normals: (0..n * n).map(|o| if left(o) { Vec3::X } else { Vec3::Y }).collect(),
            distances: (0..n * n).map(|o| if o / n < n / 2 { 1.0 } else { 5.0 }).collect(),
        };
        let bilateral = TracingFilter::Bilateral { radius: 2, normal_power: 8.0, distance: 0.1 };
        let even = filter(&bilateral, Some(&guide), n, &vec![Vec3::ONE; n * n]);
        assert!(even.iter().all(|l| (*l - Vec3::ONE).abs().max_element() < 1e-6));
        // One bright texel beside both edges.
        let spot = 7 + 7 * n;
        let mut light = vec![Vec3::ZERO; n * n];
        light[spot] = Vec3::ONE;
        let mixed = filter(&bilateral, Some(&guide), n, &light);
        for (o, l) in mixed.iter().enumerate() {
            let same = left(o) && o / n < n / 2;
            let near = (o % n).abs_diff(7) <= 2 && (o / n).abs_diff(7) <= 2;
            // From the far surface the near one is 8 widths of the distances' Gaussian away: 1/e³².
            assert_eq!(l.x > 1e-12, same && near, "texel {o}: {l}");
        }
        assert!(mixed[spot].x > 0.0 && mixed[spot].x < 0.5);
        assert_eq!(filter(&TracingFilter::None, Some(&guide), n, &light), light);
    }
}

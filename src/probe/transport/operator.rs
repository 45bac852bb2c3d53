//! The bounce operator: one application takes the light from the probes to the surfaces they captured and back.
//!
//! With E the irradiance in the probes it gives `G[B⁰] + T·E`, `T = G[ρ/π·Q[E]]`: Q asks the probes at every captured hit
//! with the method's own weights, G is the irradiance filter, B⁰ the radiance that hits reflect of light that did not pass
//! through probes.

use std::f32::consts::PI;
use std::time::Instant;

use glam::{Vec3, Vec3A};
use rayon::prelude::*;

use crate::light::lambert::reflected_radiance;
use crate::math::color::luminance;
use crate::math::octahedral::direction_from_oct;
use crate::probe::Volume;
use crate::probe::capture::ProbeCapture;
use crate::probe::capture::surfel::Surfel;
use crate::probe::lattice::ProbeState;
use crate::probe::query::{Query, QueryPoint, QuerySettings, Visibility};
use crate::probe::store::kernel::Kernel;

/// Where the captures of all probes come from: memory, or traced again.
pub trait Captures: Sync {
    /// Calls `visit` on one probe's capture.
    fn with<R>(&self, probe: usize, visit: impl FnOnce(&ProbeCapture) -> R) -> R;
}

impl Captures for Vec<ProbeCapture> {
    fn with<R>(&self, probe: usize, visit: impl FnOnce(&ProbeCapture) -> R) -> R {
        visit(&self[probe])
    }
}

/// The linear unknowns of all active probes in their order, W·m⁻²: what the operator works on.
pub type Field = Vec<Vec3>;

/// The operator, with all that stays the same from one application to the next.
pub struct Operator<'a, C> {
    pub captures: &'a C,
    pub kernel: &'a Kernel,
    pub query: &'a QuerySettings,
    /// Whether emission takes part in the bounces (with emission sampled at the surfaces it must not: each path counts once).
    pub gathers_emission: bool,
}

/// For every surfel of every probe the corners of its cell that it sees, so that they need not be looked up again;
/// 0 where they must be.
pub struct Masks(Vec<Vec<u8>>);

impl<C: Captures> Operator<'_, C> {
    /// Whether the operator is linear (affine): sums and differences of fields may be put into it.
    pub fn is_linear(&self, volume: &Volume) -> bool {
        self.query.is_linear() && volume.irradiance.is_linear()
    }

    /// Neither surfels nor probes move, so once is enough.
    pub fn masks(&self, volume: &Volume) -> Masks {
        let of_probe = |p: usize| match volume.states[p] {
            ProbeState::Active => self.masks_of(volume, p),
            _ => Vec::new(),
        };
        Masks((0..volume.states.len()).into_par_iter().map(of_probe).collect())
    }

    fn masks_of(&self, volume: &Volume, p: usize) -> Vec<u8> {
        let query = Query { volume, settings: self.query };
        self.captures.with(p, |capture| {
            let mask = |i| query.stored_mask(&self.query_point(capture, i, volume.positions[p]));
            (0..capture.surfels.len()).map(mask).collect()
        })
    }

    /// Irradiance of every probe from the outgoing radiance that the present irradiance gives; without `masks` from the
    /// direct radiance alone. Also how many hits' radiance was not finite and left out.
    pub fn apply(&self, volume: &Volume, masks: Option<&Masks>) -> (Field, u64) {
        let of_probe = |p: usize| self.apply_to(volume, p, masks.map(|masks| masks.0[p].as_slice()));
        let found = self.gather(volume, of_probe);
        let non_finite = found.iter().map(|(_, lost)| lost).sum();
        (found.into_iter().flat_map(|(irradiance, _)| irradiance).map(Vec3::from).collect(), non_finite)
    }

    /// Irradiance of every probe from the emission that its own rays met, which bounces begin with where it is gathered.
    pub fn gathered_emission(&self, volume: &Volume) -> Field {
        let of_probe = |p: usize| -> Vec<Vec3A> {
            let mut irradiance = vec![Vec3A::ZERO; self.kernel.rows()];
            if self.gathers_emission {
                self.captures.with(p, |capture| self.kernel.irradiance(&capture.emitted_radiance(), &mut irradiance));
            }
            irradiance
        };
        self.gather(volume, of_probe).into_iter().flatten().map(Vec3::from).collect()
    }

    /// The operator's norm ‖T‖∞ per channel: the most that it makes of irradiance 1 everywhere, and so a bound of its
    /// spectral radius. Weights of queries and filter are positive and sum to at most 1, so what remains is the filtered
    /// albedo; queries that find no probe can only lower it.
    pub fn norm(&self, volume: &Volume) -> Vec3 {
        let largest = |p: usize| {
            self.captures.with(p, |capture| {
                let mut albedo = vec![Vec3A::ZERO; capture.texels];
                let ones = Vec3::ONE;
                capture.surfels.iter().for_each(|s| {
                    albedo[s.texel as usize] += Vec3A::from(reflected_radiance(s.albedo(), ones));
                });
                if let Some((_, overshoot)) = volume.irradiance.signed() {
                    return PI * overshoot * albedo.into_iter().fold(Vec3A::ZERO, Vec3A::max);
                }
                let mut reflected = vec![Vec3A::ZERO; self.kernel.rows()];
                self.kernel.irradiance(&albedo, &mut reflected);
                reflected.into_iter().fold(Vec3A::ZERO, Vec3A::max)
            })
        };
        self.gather(volume, largest).into_iter().fold(Vec3A::ZERO, Vec3A::max).into()
    }

    /// What a function gives of every active probe, in their order.
    fn gather<R: Send>(&self, volume: &Volume, of_probe: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
        let active = |p: &usize| volume.states[*p] == ProbeState::Active;
        (0..volume.states.len()).into_par_iter().filter(active).map(of_probe).collect()
    }

    /// One application at one active probe, with the masks of its own surfels.
    fn apply_to(&self, volume: &Volume, p: usize, masks: Option<&[u8]>) -> (Vec<Vec3A>, u64) {
        let query = Query { volume, settings: self.query };
        self.captures.with(p, |capture| {
            let outgoing = |(i, surfel): (usize, &Surfel)| {
                let mut outgoing = surfel.direct_radiance;
                if let Some(masks) = masks {
                    let point = self.query_point(capture, i, volume.positions[p]);
                    outgoing += self.reflected(&query, surfel, &point, masks[i]);
                }
                outgoing
            };
            self.filter(capture, capture.surfels.iter().enumerate().map(outgoing))
        })
    }

    /// The same for a probe that is updated alone: all threads share its surfels.
    pub(super) fn update(&self, volume: &Volume, p: usize, masks: &Masks) -> (Vec<Vec3A>, u64) {
        /// Surfels that are worth another thread's attention.
        const CHUNK: usize = 512;
        let query = Query { volume, settings: self.query };
        self.captures.with(p, |capture| {
            let outgoing = |(i, surfel): (usize, &Surfel)| {
                let point = self.query_point(capture, i, volume.positions[p]);
                surfel.direct_radiance + self.reflected(&query, surfel, &point, masks.0[p][i])
            };
            let outgoing: Vec<Vec3> =
                capture.surfels.par_iter().enumerate().with_min_len(CHUNK).map(outgoing).collect();
            self.filter(capture, outgoing.into_iter())
        })
    }

    /// A probe's irradiance from the radiance of its surfels, in their order, and how many of these were not finite.
    #[inline]
    fn filter(&self, capture: &ProbeCapture, outgoing: impl Iterator<Item = Vec3>) -> (Vec<Vec3A>, u64) {
        let mut radiance =
            if self.gathers_emission { capture.emitted_radiance() } else { vec![Vec3A::ZERO; capture.texels] };
        let mut non_finite = 0;
        for (surfel, outgoing) in capture.surfels.iter().zip(outgoing) {
            if outgoing.is_finite() {
                radiance[surfel.texel as usize] += Vec3A::from(outgoing);
            } else {
                non_finite += 1;
            }
        }
        let mut irradiance = vec![Vec3A::ZERO; self.kernel.rows()];
        self.kernel.irradiance(&radiance, &mut irradiance);
        (irradiance, non_finite)
    }

    /// Seconds that one application at these probes takes.
    pub fn time(&self, volume: &Volume, probes: &[usize]) -> f64 {
        let masks: Vec<Vec<u8>> = probes.par_iter().map(|&p| self.masks_of(volume, p)).collect();
        let started = Instant::now();
        let apply = |(&p, masks): (&usize, &Vec<u8>)| self.apply_to(volume, p, Some(masks));
        std::hint::black_box(probes.par_iter().zip(&masks).map(apply).collect::<Vec<_>>());
        started.elapsed().as_secs_f64()
    }

    /// What a surfel reflects of the light in the probes. `mask`: the corners that it sees, 0 where that is not known.
    #[inline]
    pub(super) fn reflected(&self, query: &Query, surfel: &Surfel, point: &QueryPoint, mask: u8) -> Vec3 {
        let visibility = match mask {
            0 => Visibility::Stored,
            mask => Visibility::Exact(mask),
        };
        let weights = query.weights(point, visibility);
        reflected_radiance(surfel.albedo(), query.blend(&weights, point, surfel.oct()))
    }

    /// How a probe asks for the light at one of its surfels. What the method does not look at is left zero.
    pub(super) fn query_point(&self, capture: &ProbeCapture, surfel: usize, probe: Vec3) -> QueryPoint {
        let Surfel { position, facing, .. } = capture.surfels[surfel];
        let normal =
            if self.query.needs_normal() { direction_from_oct(capture.surfels[surfel].oct()) } else { Vec3::ZERO };
        let geometric =
            if self.query.needs_geometric() { direction_from_oct(capture.geometric[surfel].oct()) } else { Vec3::ZERO };
        let view = if self.query.needs_view() { (probe - position).normalize_or_zero() } else { Vec3::ZERO };
        QueryPoint { position, normal, geometric, facing, view }
    }

    /// Adds the emitted light that probes see themselves: from their rays and from the emitters sampled at their centres.
    /// Returns the mean luminance of the irradiance added, over all unknowns of active probes.
    pub fn add_emission(&self, volume: &mut Volume) -> f64 {
        let kernel = self.kernel;
        let lobes = volume.irradiance.lobes();
        let states = &volume.states;
        // Of unknowns with signs the first is the mean irradiance.
        let group = volume.irradiance.signed().map_or(1, |(group, _)| group);
        let add = |p: usize, before: &mut dyn Iterator<Item = Vec3A>| {
            if states[p] != ProbeState::Active {
                return None;
            }
            self.captures.with(p, |capture| {
                let mut emitted = vec![Vec3A::ZERO; kernel.rows()];
                let mut energy = 0.0;
                kernel.irradiance(&capture.emitted_radiance(), &mut emitted);
                let sampled = lobes.of_samples(&capture.emitter_samples);
                for (o, ((value, sampled), before)) in emitted.iter_mut().zip(sampled).zip(before).enumerate() {
                    *value += sampled;
                    if o % group == 0 {
                        energy += f64::from(luminance((*value).into()));
                    }
                    *value += before;
                }
                Some((emitted, energy))
            })
        };
        // Summed in order, on one thread: the same for any number of threads.
        let energies: Vec<Option<f64>> = volume.irradiance.set_each(add);
        let unknowns = energies.iter().flatten().count() * kernel.rows() / group;
        energies.iter().flatten().sum::<f64>() / unknowns.max(1) as f64
    }
}

/// The unknowns that the volume's irradiance now stands for.
pub fn field_of(volume: &Volume) -> Field {
    volume.active().flat_map(|p| volume.irradiance.probe(p)).collect()
}

/// Stores a field in the volume; the inverse of [`field_of`] up to the rounding of its curve.
pub fn store(volume: &mut Volume, field: &[Vec3]) {
    let unknowns = volume.irradiance.unknowns();
    let mut place = vec![None; volume.states.len()];
    volume.active().enumerate().for_each(|(i, p)| place[p] = Some(i));
    volume.irradiance.set_each(|p, _| {
        let values = field.chunks(unknowns).nth(place[p]?)?;
        Some((values.iter().map(|&e| e.into()).collect(), ()))
    });
}

//! The bounce operator: one application takes the light from the probes to the surfaces they captured and back.
//!
//! With E the irradiance in the probes it gives `G[B⁰] + T·E`, `T = G[ρ/π·Q[E]]`: Q asks the probes at every captured hit
//! with the method's own weights, G is the irradiance filter, B⁰ the radiance that hits reflect of light that did not pass
//! through probes.

use std::f32::consts::PI;

use glam::{Vec3, Vec3A};
use rayon::prelude::*;

use crate::light::World;
use crate::light::lambert::reflected_radiance;
use crate::math::color::luminance;
use crate::math::octahedral::direction_from_oct;
use crate::probe::Volume;
use crate::probe::capture::surfel::Surfel;
use crate::probe::capture::{ProbeCapture, Seen};
use crate::probe::lattice::ProbeState;
use crate::probe::query::{Query, QueryPoint, QuerySettings, Visibility};
use crate::probe::store::kernel::Kernel;
use crate::system::processor::processor_seconds;

/// Where the captures of all probes come from: memory, or traced again.
pub trait Captures: Sync {
    /// Calls `visit` on one probe's capture.
    fn with<R>(&self, probe: usize, visit: impl FnOnce(&ProbeCapture) -> R) -> R;

    /// Whether a probe's capture is in memory.
    fn keeps(&self, _probe: usize) -> bool {
        true
    }

    /// A probe's capture in one of many frames, each with rays of its own. `None` where captures do not change.
    fn frame(&self, _probe: usize, _frame: u32) -> Option<Frame> {
        None
    }

    /// The filters from the captures of one frame to what `volume` holds; `None` where captures do not change.
    fn filters(&self, _frame: u32, _volume: &Volume) -> Option<Filters> {
        None
    }

    /// The scene, for transports that send rays from the captured surfaces; `None` where there is none.
    fn scenery(&self) -> Option<Scenery<'_>> {
        None
    }
}

/// A frame's capture, and whether light may be learnt from it.
pub struct Frame {
    pub capture: ProbeCapture,
    pub counts: bool,
}

/// Filters from the texels of a frame's captures.
pub struct Filters {
    pub irradiance: Kernel,
    /// `None` where no distances are stored.
    pub distance: Option<Kernel>,
}

/// What rays are traced in.
pub struct Scenery<'a> {
    pub world: &'a World<'a>,
    pub seed: u64,
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

impl Masks {
    /// Of the surfels of one probe.
    pub fn of(&self, probe: usize) -> &[u8] {
        &self.0[probe]
    }
}

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
        self.captures.with(p, |capture| {
            let mask = |i: usize| masks.map(|masks| masks[i]);
            let (radiance, non_finite) = self.outgoing(volume, p, capture, mask, self.gathers_emission);
            (self.filtered(&radiance), non_finite)
        })
    }

    /// The same for a probe that is updated alone: all threads share its surfels.
    pub(super) fn update(&self, volume: &Volume, p: usize, masks: &Masks) -> (Vec<Vec3A>, u64) {
        /// Surfels that are worth another thread's attention.
        const CHUNK: usize = 512;
        let query = Query { volume, settings: self.query };
        self.captures.with(p, |capture| {
            let leaves = |i| self.leaves(&query, capture, i, volume.positions[p], Some(masks.0[p][i]));
            let found: Vec<Vec3> = (0..capture.surfels.len()).into_par_iter().with_min_len(CHUNK).map(leaves).collect();
            let (radiance, non_finite) = add_up(capture, found.into_iter(), self.gathers_emission);
            (self.filtered(&radiance), non_finite)
        })
    }

    /// Radiance in every texel of a capture, and how many hits' was not finite and left out. `mask` tells of a surfel what
    /// it sees, 0 where that must be looked up, and `None` where nothing is asked of the probes.
    pub fn outgoing(
        &self,
        volume: &Volume,
        p: usize,
        capture: &ProbeCapture,
        mask: impl Fn(usize) -> Option<u8>,
        emits: bool,
    ) -> (Vec<Vec3A>, u64) {
        let query = Query { volume, settings: self.query };
        let leaves = |i| self.leaves(&query, capture, i, volume.positions[p], mask(i));
        add_up(capture, (0..capture.surfels.len()).map(leaves), emits)
    }

    /// Radiance that leaves a surfel towards the probe at `position`. `mask`: the corners that it sees, 0 where that is not
    /// known; `None` where it reflects no light of probes.
    #[inline]
    fn leaves(&self, query: &Query, capture: &ProbeCapture, i: usize, position: Vec3, mask: Option<u8>) -> Vec3 {
        let surfel = &capture.surfels[i];
        let Some(mask) = mask else { return surfel.direct_radiance };
        let visibility = Visibility::of_mask(mask);
        let point = self.query_point(capture, i, position);
        let weights = query.weights(&point, visibility);
        surfel.direct_radiance + reflected_radiance(surfel.albedo(), query.blend(&weights, &point, surfel.oct()))
    }

    /// A probe's unknowns from the radiance in its texels.
    pub(super) fn filtered(&self, radiance: &[Vec3A]) -> Vec<Vec3A> {
        let mut irradiance = vec![Vec3A::ZERO; self.kernel.rows()];
        self.kernel.irradiance(radiance, &mut irradiance);
        irradiance
    }

    /// Fills what the volume holds of radiance: all that surfaces send towards the probes, with what they emit where
    /// `emits`. Without `masks` the light of the probes is not asked.
    pub fn keep_radiance(&self, volume: &mut Volume, masks: Option<&Masks>, emits: bool) {
        /// Probes at once: bounds the memory of what is on its way.
        const AT_ONCE: usize = 64;
        let active: Vec<usize> = volume.active().collect();
        for chunk in active.chunks(AT_ONCE) {
            let of_probe = |&p: &usize| {
                let mask = |i: usize| masks.map(|masks| masks.0[p][i]);
                self.captures.with(p, |capture| {
                    let mut radiance = self.outgoing(volume, p, capture, mask, false).0;
                    if emits {
                        radiance.iter_mut().zip(capture.shown_radiance()).for_each(|(l, emitted)| *l += emitted);
                    }
                    (radiance, capture.seen.clone())
                })
            };
            let found: Vec<_> = chunk.par_iter().map(of_probe).collect();
            for (&p, (radiance, seen)) in chunk.iter().zip(found) {
                volume.radiance.set(p, &radiance, |o| seen.get(o).and_then(Seen::surface));
            }
        }
    }

    /// Seconds of the processor that one application at these probes takes.
    pub fn time(&self, volume: &Volume, probes: &[usize]) -> f64 {
        let masks: Vec<Vec<u8>> = probes.par_iter().map(|&p| self.masks_of(volume, p)).collect();
        let started = processor_seconds();
        let apply = |(&p, masks): (&usize, &Vec<u8>)| self.apply_to(volume, p, Some(masks));
        std::hint::black_box(probes.par_iter().zip(&masks).map(apply).collect::<Vec<_>>());
        processor_seconds() - started
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

/// Radiance in every texel of a capture from that which leaves each of its surfels, in their order, and how many of these
/// were not finite.
#[inline]
fn add_up(capture: &ProbeCapture, leaving: impl Iterator<Item = Vec3>, emits: bool) -> (Vec<Vec3A>, u64) {
    let mut radiance = if emits { capture.emitted_radiance() } else { vec![Vec3A::ZERO; capture.texels] };
    let mut non_finite = 0;
    for (surfel, leaving) in capture.surfels.iter().zip(leaving) {
        if leaving.is_finite() {
            radiance[surfel.texel as usize] += Vec3A::from(leaving);
        } else {
            non_finite += 1;
        }
    }
    (radiance, non_finite)
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

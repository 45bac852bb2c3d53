//! What a probe's update takes of the others' light, worked out once.
//!
//! A captured surface with albedo ρ and normal n adds `K·ρ/π·Σ w·E(n)` to a probe's unknowns, K its texel's column of the
//! filter, w the shares of the probes that it asks. Of all this only their irradiance E changes from pass to pass. So the
//! surfaces of one normal that ask one probe are added up to a [`Lobe`], 3 × 9 gains: a pass reads those, and not the
//! surfaces. Where a probe is asked around more normals than it has unknowns, lobes of the unknowns themselves are fewer.

use std::iter::once;

use glam::{Vec2, Vec3, Vec3A};
use rayon::prelude::*;

use super::operator::{Captures, Masks, Operator};
use super::settings::Transport;
use crate::light::lambert::reflected_radiance;
use crate::math::harmonics::COUNT;
use crate::probe::Volume;
use crate::probe::capture::ProbeCapture;
use crate::probe::capture::surfel::{PackedNormal, Surfel};
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::ProbeIndex;
use crate::probe::query::{Query, Visibility};
use crate::probe::store::IrradianceStore;
use crate::probe::store::sh::{ShIrradiance, Shares};

/// Per channel what irradiance 1 adds to each unknown.
type Gains = [[f32; COUNT]; 3];

/// What is asked of a probe.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Asked {
    /// Irradiance around a normal.
    Around(Vec2),
    Unknown(usize),
}

/// What one answer of one probe adds.
#[derive(Debug, Clone)]
struct Lobe {
    probe: u32,
    asked: Asked,
    gains: Gains,
}

/// All that a probe's unknowns are made of.
struct Row {
    /// What light that did not pass through probes adds.
    own: Vec<Vec3A>,
    lobes: Vec<Lobe>,
    /// Surfaces whose weights or light were not finite, and that are left out.
    non_finite: u64,
}

impl Row {
    /// The unknowns that the probes' present irradiance gives.
    fn apply(&self, sh: &ShIrradiance) -> Vec<Vec3A> {
        let mut sums: Gains = std::array::from_fn(|c| std::array::from_fn(|j| self.own[j][c]));
        for Lobe { probe, asked, gains } in &self.lobes {
            let probe = *probe as usize;
            let light = match *asked {
                Asked::Around(oct) => sh.sum(oct, once((probe, 1.0)), |_| Vec3::ZERO, |e| e),
                Asked::Unknown(j) => sh.unknown(probe, j),
            };
            for c in 0..3 {
                add(&mut sums[c], &gains[c], light[c]);
            }
        }
        (0..COUNT).map(|j| Vec3A::new(sums[0][j], sums[1][j], sums[2][j])).collect()
    }
}

#[inline]
fn add(sums: &mut [f32; COUNT], of: &[f32; COUNT], times: f32) {
    sums.iter_mut().zip(of).for_each(|(sum, x)| *sum += x * times);
}

/// What is kept of a probe.
enum Kept {
    Row(Row),
    /// Its row would take more memory than the surfaces that it saves reading: these are asked in every pass.
    Surfaces,
    /// Its capture is not kept either: both are made anew in every pass.
    Nothing,
}

/// The rows of all probes, where these [`fit`].
pub struct Rows {
    kept: Vec<Kept>,
    columns: Vec<[f32; COUNT]>,
    shares: Option<Shares>,
}

impl Rows {
    /// Works out the rows of all active probes whose captures are in memory.
    pub fn new<C: Captures>(operator: &Operator<C>, volume: &Volume, masks: &Masks) -> Rows {
        let shares = volume.irradiance.harmonics().filter(|_| fit(operator, volume)).map(ShIrradiance::shares);
        let mut rows = Rows { kept: Vec::new(), columns: operator.kernel.harmonic_columns(), shares };
        let of_probe = |p: usize| match volume.states[p] {
            ProbeState::Active if operator.captures.keeps(p) => rows.make(operator, volume, p, masks),
            _ => Kept::Nothing,
        };
        rows.kept = (0..volume.states.len()).into_par_iter().map(of_probe).collect();
        rows
    }

    /// The unknowns of a probe that the probes' present irradiance gives, and how many surfaces' light was not finite and left
    /// out, each counted once where that is known.
    pub fn update<C: Captures>(
        &self,
        operator: &Operator<C>,
        volume: &Volume,
        p: usize,
        masks: &Masks,
    ) -> (Vec<Vec3A>, u64) {
        let made = match &self.kept[p] {
            Kept::Nothing => &self.make(operator, volume, p, masks),
            kept => kept,
        };
        match (made, volume.irradiance.harmonics()) {
            (Kept::Row(row), Some(sh)) => (row.apply(sh), 0),
            _ => operator.update(volume, p, masks),
        }
    }

    fn make<C: Captures>(&self, operator: &Operator<C>, volume: &Volume, p: usize, masks: &Masks) -> Kept {
        let Some(shares) = &self.shares else { return Kept::Surfaces };
        let of = |capture: &ProbeCapture| row(operator, volume, p, capture, masks.of(p), (&self.columns, shares));
        operator.captures.with(p, of).map_or(Kept::Surfaces, Kept::Row)
    }

    /// Surfaces whose weights or light were not finite, and that rows leave out.
    pub fn non_finite(&self) -> u64 {
        self.kept.iter().map(|kept| if let Kept::Row(row) = kept { row.non_finite } else { 0 }).sum()
    }
}

/// Whether look-ups are linear in coefficients of their own: surfaces then need to be asked only once, however many passes
/// there are.
pub fn fit<C: Captures>(operator: &Operator<C>, volume: &Volume) -> bool {
    operator.is_linear(volume) && operator.query.asks_one_direction() && volume.irradiance.harmonics().is_some()
}

/// The lobes of one probe that is asked.
struct Answers {
    probe: u32,
    /// Normals of the lobes; none where these are of unknowns.
    normals: Vec<PackedNormal>,
    gains: Vec<Gains>,
}

impl Answers {
    fn add(&mut self, normal: PackedNormal, gains: &Gains, shares: &Shares) {
        if let Some(known) = self.normals.iter().position(|n| *n == normal) {
            (0..3).for_each(|c| add(&mut self.gains[known][c], &gains[c], 1.0));
        } else if self.gains.len() < COUNT {
            self.normals.push(normal);
            self.gains.push(*gains);
        } else {
            if !self.normals.is_empty() {
                let lobes = std::mem::replace(&mut self.gains, vec![Gains::default(); COUNT]);
                let normals = std::mem::take(&mut self.normals);
                normals.iter().zip(&lobes).for_each(|(normal, gains)| self.add_to_unknowns(*normal, gains, shares));
            }
            self.add_to_unknowns(normal, gains, shares);
        }
    }

    fn add_to_unknowns(&mut self, normal: PackedNormal, gains: &Gains, shares: &Shares) {
        for (sums, share) in self.gains.iter_mut().zip(shares.around(normal.oct())) {
            (0..3).for_each(|c| add(&mut sums[c], &gains[c], share));
        }
    }

    fn lobes(self) -> impl Iterator<Item = Lobe> {
        let Answers { probe, normals, gains } = self;
        let asked = move |i: usize| normals.get(i).map_or(Asked::Unknown(i), |normal| Asked::Around(normal.oct()));
        gains.into_iter().enumerate().map(move |(i, gains)| Lobe { probe, asked: asked(i), gains })
    }
}

/// Adds up the surfaces of one probe.
struct Builder<'a> {
    shares: &'a Shares,
    answers: Vec<Answers>,
    /// By probe, the place of its answers.
    place: Vec<Option<u32>>,
}

/// Surfaces of one normal that ask the same eight probes.
struct Run {
    normal: PackedNormal,
    probes: [ProbeIndex; 8],
    gains: [Gains; 8],
}

impl Builder<'_> {
    /// Adds a run's lobes to those of its probes. Black where nothing was asked: adds nothing.
    fn add(&mut self, run: &Run) {
        for (probe, gains) in run.probes.iter().zip(&run.gains) {
            if *gains == Gains::default() {
                continue;
            }
            let place = *self.place[probe.0 as usize].get_or_insert_with(|| {
                self.answers.push(Answers { probe: probe.0, normals: Vec::new(), gains: Vec::new() });
                self.answers.len() as u32 - 1
            });
            self.answers[place as usize].add(run.normal, gains, self.shares);
        }
    }
}

/// Whether a bake may keep rows beside its captures.
pub fn are_kept(transport: &Transport, irradiance: &IrradianceStore) -> bool {
    transport.keeps_rows() && irradiance.is_harmonic()
}

/// No row takes more, bytes: what the surfaces take themselves.
pub fn most_bytes(capture: &ProbeCapture) -> u64 {
    (capture.surfels.len() * size_of::<Surfel>()) as u64
}

/// The row of one probe; `None` where it is too large.
fn row<C: Captures>(
    operator: &Operator<C>,
    volume: &Volume,
    p: usize,
    capture: &ProbeCapture,
    masks: &[u8],
    (columns, shares): (&[[f32; COUNT]], &Shares),
) -> Option<Row> {
    let query = Query { volume, settings: operator.query };
    let point = |i: usize| operator.query_point(capture, i, volume.positions[p]);
    // Surfaces of one cell and one normal stand together: they add up before anything is looked for, and they read the same
    // few maps of distance.
    let key = |i: usize| (volume.grid.cell_index(&query.cell(&point(i))), capture.surfels[i].normal(), i);
    let mut order: Vec<_> = (0..capture.surfels.len()).map(key).collect();
    order.sort_unstable();
    let mut builder = Builder { shares, answers: Vec::new(), place: vec![None; volume.states.len()] };
    let mut non_finite = 0;
    let mut run: Option<Run> = None;
    for (_, normal, i) in order {
        let (surfel, point) = (&capture.surfels[i], point(i));
        let weights = query.weights(&point, Visibility::of_mask(masks[i]));
        let Some(asked) = weights.shares() else { continue };
        if run.as_ref().is_none_or(|run| run.normal != normal || run.probes != weights.probes) {
            run.iter().for_each(|run| builder.add(run));
            run = Some(Run { normal, probes: weights.probes, gains: Default::default() });
        }
        let Some(Run { gains, .. }) = &mut run else { continue };
        let reflected = reflected_radiance(surfel.albedo(), Vec3::ONE);
        let column = &columns[surfel.texel as usize];
        for (corner, share) in asked {
            if !share.is_finite() {
                non_finite += 1;
                continue;
            }
            (0..3).for_each(|c| add(&mut gains[corner][c], column, reflected[c] * share));
        }
    }
    run.iter().for_each(|run| builder.add(run));
    let count: usize = builder.answers.iter().map(|answers| answers.gains.len()).sum();
    if (count * size_of::<Lobe>()) as u64 > most_bytes(capture) {
        return None;
    }
    let (radiance, lost) = operator.outgoing(volume, p, capture, |_| None, operator.gathers_emission);
    let mut lobes = Vec::with_capacity(count);
    lobes.extend(builder.answers.into_iter().flat_map(Answers::lobes));
    Some(Row { own: operator.filtered(&radiance), lobes, non_finite: non_finite + lost })
}

#[cfg(test)]
mod tests;

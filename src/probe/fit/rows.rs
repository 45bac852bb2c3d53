//! The look-up as a sparse matrix, one row a point: a share for each probe that the point asks, and of each probe the
//! factors of [`Factors`], which are made anew where they are needed.

use glam::{DVec3, Vec3, Vec3A};
use rayon::prelude::*;

use super::points::Asked;
use super::settings::Kind;
use crate::probe::Volume;
use crate::probe::query::{Part, Query, QuerySettings};
use crate::probe::store::irradiance::Factors;

/// Unknowns of a probe up to which blocks of the normal equations are small beside the rows: those of harmonics with a
/// gradient are 12. Maps have many more, of which a row asks four.
pub const MOST_UNKNOWNS: usize = 16;

/// One point's look-up, what it should give and how much that counts.
#[derive(Debug, Clone)]
pub struct Row {
    pub parts: Vec<Part>,
    /// W·m⁻².
    pub target: Vec3,
    /// Variance of the target by the noise of its paths, mean of the channels.
    pub noise: f32,
    pub weight: f32,
    pub kind: Kind,
}

impl Row {
    /// Most bytes that one takes: eight parts, twice while they are collected, their lists by probe and factors, and what is
    /// known of the point.
    pub const BYTES: u64 = (8 * (2 * size_of::<Part>() + 2 * size_of::<u32>() + MOST_UNKNOWNS * size_of::<f32>())
        + size_of::<Row>()
        + 256) as u64;

    /// The row of a point. It has no parts where the point finds no probe.
    pub fn of(query: &QuerySettings, volume: &Volume, asked: &Asked, target: Vec3) -> Row {
        let query = Query { volume, settings: query };
        let weights = query.weights(&asked.query, asked.visibility);
        let parts = if weights.total() > 0.0 { query.parts(&weights, &asked.query) } else { Vec::new() };
        Row { parts, target, noise: 0.0, weight: asked.weight, kind: asked.kind }
    }
}

/// All rows. Unknowns are numbered probe by probe.
pub struct Rows<'f, 'i> {
    factors: &'f Factors<'i>,
    unknowns: usize,
    /// Parts of row k: `start[k]..start[k + 1]`.
    start: Vec<u32>,
    parts: Vec<Part>,
    targets: Vec<Vec3>,
    noise: Vec<f32>,
    weights: Vec<f32>,
    kinds: Vec<Kind>,
    /// Parts of probe p with their rows: `of_probe[probe_start[p]..probe_start[p + 1]]`, in the order of the rows.
    probe_start: Vec<u32>,
    of_probe: Vec<(u32, u32)>,
}

/// What is lit is black if it gets less than this share of its light: more than four stops are missing. `leak.black` of reports
/// counts such pixels.
pub const BLACK_SHARE: f64 = 0.05;

/// Standard deviations of a row's noise that its light is lessened by before it is called black: what one bright path brings is not
/// to be fitted. Without it errors in pictures of glossy_room are 1.06 times as large.
const BLACK_NOISE: f64 = 2.0;

/// How many times as much a black row counts. In veach_ajar .53 % of the pixels are black without it, .39 % with 4, .31 % with 8 and
/// .27 % with 16; glossy_room's error is 1.003, 1.007 and 1.013 times as large.
const BLACK_WEIGHT: f32 = 16.0;

/// Rows and probes that a thread takes at once.
const CHUNK: usize = 64;

impl<'f, 'i> Rows<'f, 'i> {
    pub fn new(factors: &'f Factors<'i>, probes: usize, unknowns: usize, rows: impl Iterator<Item = Row>) -> Self {
        let (mut start, mut parts) = (vec![0], Vec::new());
        let (mut targets, mut noise, mut weights, mut kinds) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for row in rows {
            parts.extend(row.parts);
            start.push(parts.len() as u32);
            targets.push(row.target);
            noise.push(row.noise);
            weights.push(row.weight);
            kinds.push(row.kind);
        }
        let mut probe_start = vec![0u32; probes + 1];
        parts.iter().for_each(|part| probe_start[part.probe.0 as usize + 1] += 1);
        (0..probes).for_each(|p| probe_start[p + 1] += probe_start[p]);
        let mut next = probe_start.clone();
        let mut of_probe = vec![(0, 0); parts.len()];
        for row in 0..targets.len() {
            for i in start[row]..start[row + 1] {
                let next = &mut next[parts[i as usize].probe.0 as usize];
                of_probe[*next as usize] = (i, row as u32);
                *next += 1;
            }
        }
        Rows { factors, unknowns, start, parts, targets, noise, weights, kinds, probe_start, of_probe }
    }

    /// Which probes any row asks.
    pub fn asked(&self) -> Vec<bool> {
        self.probe_start.windows(2).map(|w| w[0] < w[1]).collect()
    }

    /// Numbers of all unknowns, asked for or not.
    pub fn columns(&self) -> usize {
        (self.probe_start.len() - 1) * self.unknowns
    }

    pub fn probes(&self) -> usize {
        self.probe_start.len() - 1
    }

    /// Of each probe.
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// What each part takes of its probe's unknowns, its share included.
    pub fn part_factors(&self) -> Vec<f32> {
        let mut out = vec![0.0; self.parts.len() * self.unknowns];
        let parts = out.par_chunks_mut(self.unknowns).with_min_len(CHUNK).enumerate();
        parts.for_each(|(part, own)| self.add_part_factors(part, own));
        out
    }

    /// Those of one part, added to `own`.
    pub fn add_part_factors(&self, part: usize, own: &mut [f32]) {
        let part = &self.parts[part];
        self.factors.each(part.oct, part.offset, |unknown, factor| own[unknown] += factor * part.share);
    }

    /// A row's parts, with their numbers among all.
    pub fn parts_of_row(&self, row: u32) -> impl Iterator<Item = (usize, &Part)> {
        let range = self.start[row as usize] as usize..self.start[row as usize + 1] as usize;
        range.clone().zip(&self.parts[range])
    }

    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    pub fn targets(&self) -> &[Vec3] {
        &self.targets
    }

    /// Gives more weight to rows of surfaces that values leave black, where squares of differences count little: in a dim corner
    /// beside a bright room. Returns the probes that they ask, ascending.
    pub fn weigh_black(&mut self, values: &[Vec3A]) -> Vec<u32> {
        let values: Vec<DVec3> = values.iter().map(|value| value.as_dvec3()).collect();
        let found = self.times(&values);
        let is_black = |row: &usize| {
            let noise = 3.0 * f64::from(self.noise[*row]).sqrt();
            let light = self.targets[*row].as_dvec3().element_sum() - BLACK_NOISE * noise;
            self.kinds[*row] == Kind::Surface && light > 0.0 && found[*row].element_sum() < BLACK_SHARE * light
        };
        let black: Vec<usize> = (0..found.len()).filter(is_black).collect();
        black.iter().for_each(|&row| self.weights[row] *= BLACK_WEIGHT);
        let parts = black.iter().flat_map(|&row| self.parts_of_row(row as u32));
        let mut probes: Vec<u32> = parts.map(|(_, part)| part.probe.0).collect();
        probes.sort_unstable();
        probes.dedup();
        probes
    }

    /// For each probe how noisy its rows are: variance by noise ÷ mean square of what they are beyond the prior without that noise,
    /// each row weighed by the probe's share in it.
    pub fn noisiness(&self, prior: &[DVec3]) -> Vec<f64> {
        /// Share of the square that is taken for more than noise at least.
        const LEAST_KNOWN: f64 = 0.02;
        let found = self.times(prior);
        let of_probe = |p: usize| {
            let (mut noise, mut square) = (0.0, 0.0);
            for &(part, row) in self.parts_of(p) {
                let (share, row) = (f64::from(self.parts[part as usize].share), row as usize);
                let weight = f64::from(self.weights[row]) * share * share;
                let beyond = self.targets[row].as_dvec3() - found[row];
                noise += weight * f64::from(self.noise[row]);
                square += weight * beyond.length_squared() / 3.0;
            }
            if square > 0.0 { noise / (square - noise).max(LEAST_KNOWN * square) } else { 0.0 }
        };
        (0..self.probes()).into_par_iter().map(of_probe).collect()
    }

    /// What the look-ups give: A·x.
    pub fn times(&self, x: &[DVec3]) -> Vec<DVec3> {
        let row = |row: usize| {
            let parts = &self.parts[self.start[row] as usize..self.start[row + 1] as usize];
            let of_part = |part: &Part| {
                let own = &x[part.probe.0 as usize * self.unknowns..][..self.unknowns];
                let mut sum = DVec3::ZERO;
                self.factors.each(part.oct, part.offset, |unknown, factor| sum += own[unknown] * f64::from(factor));
                sum * f64::from(part.share)
            };
            parts.iter().map(of_part).sum()
        };
        (0..self.targets.len()).into_par_iter().with_min_len(CHUNK).map(row).collect()
    }

    /// Aᵀ·W·y, W the weights of the rows: each unknown adds up its rows in their order, so that threads make no difference.
    pub fn transposed_times(&self, y: &[DVec3]) -> Vec<DVec3> {
        let mut out = vec![DVec3::ZERO; self.columns()];
        out.par_chunks_mut(self.unknowns).enumerate().for_each(|(p, own)| {
            for &(part, row) in self.parts_of(p) {
                let part = &self.parts[part as usize];
                let value = y[row as usize] * f64::from(part.share * self.weights[row as usize]);
                self.factors.each(part.oct, part.offset, |unknown, factor| own[unknown] += value * f64::from(factor));
            }
        });
        out
    }

    /// About the diagonal of Aᵀ·W·A: factors that a row has twice for the same unknown are squared one by one.
    pub fn diagonal(&self) -> Vec<f64> {
        let mut out = vec![0.0; self.columns()];
        out.par_chunks_mut(self.unknowns).enumerate().for_each(|(p, own)| {
            for &(part, row) in self.parts_of(p) {
                let part = &self.parts[part as usize];
                self.factors.each(part.oct, part.offset, |unknown, factor| {
                    own[unknown] += f64::from(self.weights[row as usize]) * f64::from(factor * part.share).powi(2);
                });
            }
        });
        out
    }

    /// Numbers of a probe's parts, each with its row.
    pub fn parts_of(&self, probe: usize) -> &[(u32, u32)] {
        &self.of_probe[self.probe_start[probe] as usize..self.probe_start[probe + 1] as usize]
    }
}

//! The matrix of the normal equations, Aᵀ·W·A, in blocks of two probes' unknowns: what an iteration then costs depends on how
//! many probes are asked together, not on how many rows there are.

use glam::DVec3;
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::rows::{MOST_UNKNOWNS, Rows};

/// Probes that a block names: this one, and those of the cells around it with a higher number.
const BLOCKS_PER_PROBE: u64 = 14;

pub struct Normal {
    unknowns: usize,
    /// Of each probe the blocks with itself and with probes of higher numbers, ascending.
    own: Vec<Blocks>,
    /// Of each probe those of lower numbers, and which of their blocks is with it.
    lower: Vec<Vec<(u32, u32)>>,
}

struct Blocks {
    probes: Vec<u32>,
    /// For each of `probes`: this probe's unknowns × that one's.
    values: Vec<f64>,
}

/// Memory for so many probes of so many unknowns, that of the [`Inverses`] included; 0 where there is no such matrix.
pub fn bytes(probes: u64, unknowns: u64) -> u64 {
    let blocks = if unknowns <= MOST_UNKNOWNS as u64 { BLOCKS_PER_PROBE + 1 } else { 0 };
    probes * blocks * unknowns * unknowns * size_of::<f64>() as u64
}

impl Normal {
    /// Of rows whose probes have at most [`MOST_UNKNOWNS`] unknowns; `None` for others.
    pub fn new(rows: &Rows) -> Option<Normal> {
        let unknowns = rows.unknowns();
        if unknowns > MOST_UNKNOWNS {
            return None;
        }
        let factors = rows.part_factors();
        // Each probe adds up its rows in their order, so that threads make no difference.
        let factors = |part: usize| widened(&factors[part * unknowns..][..unknowns]);
        let own: Vec<Blocks> =
            (0..rows.probes()).into_par_iter().map(|p| Blocks::of(rows, factors, unknowns, p)).collect();
        let mut lower = vec![Vec::new(); own.len()];
        for (p, blocks) in own.iter().enumerate() {
            for (i, &q) in blocks.probes.iter().enumerate().filter(|(_, q)| **q as usize > p) {
                lower[q as usize].push((p as u32, i as u32));
            }
        }
        Some(Normal { unknowns, own, lower })
    }

    /// Adds up the blocks of some probes again, after weights of their rows changed.
    pub fn refresh(&mut self, rows: &Rows, probes: &[u32]) {
        let unknowns = self.unknowns;
        let factors = |part: usize| {
            let mut own = [0.0; MOST_UNKNOWNS];
            rows.add_part_factors(part, &mut own[..unknowns]);
            widened(&own)
        };
        let blocks: Vec<Blocks> = probes.par_iter().map(|&p| Blocks::of(rows, factors, unknowns, p as usize)).collect();
        probes.iter().zip(blocks).for_each(|(&p, blocks)| self.own[p as usize] = blocks);
    }

    /// Aᵀ·W·A·x.
    pub fn times(&self, x: &[DVec3]) -> Vec<DVec3> {
        let n = self.unknowns;
        let of = |probe: u32| &x[probe as usize * n..][..n];
        let mut out = vec![DVec3::ZERO; x.len()];
        out.par_chunks_mut(n).enumerate().for_each(|(p, out)| {
            for &(q, block) in &self.lower[p] {
                let values = self.own[q as usize].block(block as usize, n);
                for (values, x) in values.chunks_exact(n).zip(of(q)) {
                    values.iter().zip(out.iter_mut()).for_each(|(value, out)| *out += *x * *value);
                }
            }
            let own = &self.own[p];
            for (i, &q) in own.probes.iter().enumerate() {
                for (values, out) in own.block(i, n).chunks_exact(n).zip(out.iter_mut()) {
                    *out += values.iter().zip(of(q)).map(|(value, x)| *x * *value).sum::<DVec3>();
                }
            }
        });
        out
    }
}

/// The inverse of each probe's block with itself, λ added to it.
pub struct Inverses {
    unknowns: usize,
    of_probe: Vec<Inverse>,
}

enum Inverse {
    /// Of all channels.
    Common(Vec<f64>),
    /// By channel: of the values that are free there, 0 for the others.
    Channels([Vec<f64>; 3]),
}

impl Normal {
    /// `free` is 1 where a value is free, 0 where it is held.
    pub fn inverses(&self, lambda: &[f64], free: &[DVec3]) -> Inverses {
        let n = self.unknowns;
        let of_probe =
            self.own.par_iter().zip(lambda.par_chunks(n)).zip(free.par_chunks(n)).map(|((own, lambda), free)| {
                let mut block = DMatrix::from_fn(n, n, |i, j| if i == j { lambda[i] } else { 0.0 });
                // Its own block is the first. A probe that no row asks has none.
                if !own.probes.is_empty() {
                    block += DMatrix::from_row_slice(n, n, own.block(0, n));
                }
                let is_free = |i: usize, channel: usize| free[i][channel] > 0.0;
                let of = |channel: usize| {
                    let both = |i, j| is_free(i, channel) && is_free(j, channel);
                    let kept =
                        |i: usize, j: usize| if both(i, j) { block[(i, j)] } else { f64::from(u8::from(i == j)) };
                    let kept = DMatrix::from_fn(n, n, kept);
                    let diagonal = || DMatrix::from_diagonal(&kept.diagonal().map(|value| 1.0 / value));
                    kept.clone().cholesky().map_or_else(diagonal, |cholesky| cholesky.inverse()).as_slice().to_vec()
                };
                if free.iter().all(|free| *free == DVec3::ONE) {
                    Inverse::Common(of(0))
                } else {
                    Inverse::Channels([0, 1, 2].map(of))
                }
            });
        Inverses { unknowns: n, of_probe: of_probe.collect() }
    }
}

impl Inverses {
    pub fn times(&self, x: &[DVec3]) -> Vec<DVec3> {
        let n = self.unknowns;
        let mut out = vec![DVec3::ZERO; x.len()];
        out.par_chunks_mut(n).zip(x.par_chunks(n)).zip(&self.of_probe).for_each(|((out, x), inverse)| {
            for (i, out) in out.iter_mut().enumerate() {
                let row = i * n..(i + 1) * n;
                *out = match inverse {
                    Inverse::Common(values) => values[row].iter().zip(x).map(|(value, x)| *x * *value).sum(),
                    Inverse::Channels([r, g, b]) => {
                        let values = r[row.clone()].iter().zip(&g[row.clone()]).zip(&b[row]);
                        values.zip(x).map(|(((r, g), b), x)| DVec3::new(*r, *g, *b) * *x).sum()
                    }
                };
            }
        });
        out
    }
}

impl Blocks {
    fn of(rows: &Rows, factors: impl Fn(usize) -> [f64; MOST_UNKNOWNS], n: usize, p: usize) -> Blocks {
        let later = |row: u32| rows.parts_of_row(row).filter(|(_, part)| part.probe.0 as usize >= p);
        let mut probes: Vec<u32> = Vec::with_capacity(BLOCKS_PER_PROBE as usize);
        for (_, part) in rows.parts_of(p).iter().flat_map(|&(_, row)| later(row)) {
            if let Err(place) = probes.binary_search(&part.probe.0) {
                probes.insert(place, part.probe.0);
            }
        }
        let mut values = vec![0.0f64; probes.len() * n * n];
        for &(part, row) in rows.parts_of(p) {
            let weight = f64::from(rows.weights()[row as usize]);
            let first = factors(part as usize).map(|factor| weight * factor);
            for (other, part) in later(row) {
                let second = factors(other);
                let place = probes.partition_point(|&q| q < part.probe.0);
                let block = &mut values[place * n * n..][..n * n];
                match n {
                    // Harmonics with a gradient: a length that the compiler knows takes it half the time.
                    12 => add_product(12, block, &first, &second),
                    _ => add_product(n, block, &first, &second),
                }
            }
        }
        Blocks { probes, values }
    }

    fn block(&self, i: usize, n: usize) -> &[f64] {
        &self.values[i * n * n..][..n * n]
    }
}

/// Adds first·secondᵀ.
#[inline(always)]
fn add_product(n: usize, block: &mut [f64], first: &[f64; MOST_UNKNOWNS], second: &[f64; MOST_UNKNOWNS]) {
    for (values, a) in block.chunks_exact_mut(n).zip(first) {
        values.iter_mut().zip(second).for_each(|(value, b)| *value += a * b);
    }
}

fn widened(factors: &[f32]) -> [f64; MOST_UNKNOWNS] {
    let mut out = [0.0; MOST_UNKNOWNS];
    out.iter_mut().zip(factors).for_each(|(out, factor)| *out = f64::from(*factor));
    out
}

//! The matrix of the normal equations, Aᵀ·W·A, in blocks of two probes' unknowns: what an iteration then costs depends on how
//! many probes are asked together, not on how many rows there are.

use glam::DVec3;
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

/// Memory for so many probes of so many unknowns; 0 where there is no such matrix.
pub fn bytes(probes: u64, unknowns: u64) -> u64 {
    let blocks = if unknowns <= MOST_UNKNOWNS as u64 { BLOCKS_PER_PROBE } else { 0 };
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
        let own: Vec<Blocks> =
            (0..rows.probes()).into_par_iter().map(|p| Blocks::of(rows, &factors, unknowns, p)).collect();
        let mut lower = vec![Vec::new(); own.len()];
        for (p, blocks) in own.iter().enumerate() {
            for (i, &q) in blocks.probes.iter().enumerate().filter(|(_, q)| **q as usize > p) {
                lower[q as usize].push((p as u32, i as u32));
            }
        }
        Some(Normal { unknowns, own, lower })
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

impl Blocks {
    fn of(rows: &Rows, factors: &[f32], n: usize, p: usize) -> Blocks {
        let later = |row: u32| rows.parts_of_row(row).filter(|(_, part)| part.probe.0 as usize >= p);
        let mut probes: Vec<u32> =
            rows.parts_of(p).iter().flat_map(|&(_, row)| later(row).map(|(_, part)| part.probe.0)).collect();
        probes.sort_unstable();
        probes.dedup();
        let mut values = vec![0.0f64; probes.len() * n * n];
        let factors_of = |part: usize| &factors[part * n..][..n];
        for &(part, row) in rows.parts_of(p) {
            let weight = f64::from(rows.weights()[row as usize]);
            let mut first = [0.0; MOST_UNKNOWNS];
            first.iter_mut().zip(factors_of(part as usize)).for_each(|(a, f)| *a = weight * f64::from(*f));
            for (other, part) in later(row) {
                let mut second = [0.0; MOST_UNKNOWNS];
                second.iter_mut().zip(factors_of(other)).for_each(|(b, f)| *b = f64::from(*f));
                let place = probes.partition_point(|&q| q < part.probe.0);
                let block = &mut values[place * n * n..][..n * n];
                for (values, a) in block.chunks_exact_mut(n).zip(&first) {
                    values.iter_mut().zip(&second).for_each(|(value, b)| *value += a * b);
                }
            }
        }
        Blocks { probes, values }
    }

    fn block(&self, i: usize, n: usize) -> &[f64] {
        &self.values[i * n * n..][..n * n]
    }
}

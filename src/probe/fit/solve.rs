//! Least squares with a prior: `min Σ ω_k (A_k·x − E_k)² + Σ λ_i·(x_i − x₀_i)²`, per channel, by conjugate gradients on the normal
//! equations with their diagonal as preconditioner (Hestenes & Stiefel 1952).

use glam::{DVec3, Vec3A};
use rayon::prelude::*;

use super::normal::Normal;
use super::rows::Rows;

pub struct Task<'a, 'f, 'i> {
    pub rows: &'a Rows<'f, 'i>,
    /// x₀.
    pub prior: &'a [Vec3A],
    /// λ of each unknown.
    pub lambda: Vec<f64>,
    /// Most iterations of one solution.
    pub iterations: u32,
}

pub struct Solved {
    pub values: Vec<Vec3A>,
    /// In all.
    pub iterations: u32,
}

/// The gradient is taken for 0 where it is this share of what it was.
const TOLERANCE: f64 = 1e-4;

/// Memory of the vectors of so many unknowns.
pub fn bytes(unknowns: u64) -> u64 {
    /// Difference, gradient, preconditioned gradient, direction, its image; of each its copy while it is made.
    const VECTORS: u64 = 6;
    unknowns * (VECTORS * size_of::<DVec3>() as u64 + 2 * size_of::<Vec3A>() as u64 + size_of::<f64>() as u64)
}

impl Task<'_, '_, '_> {
    /// Solves. Up to `rounds` times values below 0 are held at 0 and the others solved for again; without rounds values may
    /// be negative.
    pub fn solve(&self, rounds: u32) -> Solved {
        self.solve_above(rounds, |_| DVec3::ZERO)
    }

    /// The same with a bound of its own for each unknown.
    pub fn solve_above(&self, rounds: u32, least: impl Fn(usize) -> DVec3) -> Solved {
        let prior: Vec<DVec3> = self.prior.iter().map(|x| x.as_dvec3()).collect();
        let diagonal = self.rows.diagonal();
        let normal = Normal::new(self.rows);
        // What x is beyond the prior; 1 where a value is free, 0 where it is held.
        let mut beyond = vec![DVec3::ZERO; prior.len()];
        let mut free = vec![DVec3::ONE; prior.len()];
        let mut iterations = 0;
        for round in 0..=rounds {
            iterations += self.descend(&prior, &diagonal, normal.as_ref(), &free, &mut beyond);
            if round == rounds {
                break;
            }
            let mut held = false;
            for (i, ((beyond, free), prior)) in beyond.iter_mut().zip(&mut free).zip(&prior).enumerate() {
                let bound = least(i) - *prior;
                for channel in 0..3 {
                    if free[channel] > 0.0 && beyond[channel] < bound[channel] {
                        (beyond[channel], free[channel]) = (bound[channel], 0.0);
                        held = true;
                    }
                }
            }
            if !held {
                break;
            }
        }
        let value = |i: usize| {
            let value = beyond[i] + prior[i];
            Vec3A::from((if rounds > 0 { value.max(least(i)) } else { value }).as_vec3())
        };
        Solved { values: (0..prior.len()).map(value).collect(), iterations }
    }

    /// Conjugate gradients from `beyond` on, over the values that are free. Returns the iterations.
    fn descend(
        &self,
        prior: &[DVec3],
        diagonal: &[f64],
        normal: Option<&Normal>,
        free: &[DVec3],
        beyond: &mut [DVec3],
    ) -> u32 {
        let rows = self.rows;
        let steepness: Vec<f64> = diagonal.iter().zip(&self.lambda).map(|(d, lambda)| 1.0 / (d + lambda)).collect();
        let x: Vec<DVec3> = prior.iter().zip(beyond.iter()).map(|(a, b)| *a + *b).collect();
        let mut missing = rows.times(&x);
        missing.iter_mut().zip(rows.targets()).for_each(|(m, target)| *m = target.as_dvec3() - *m);
        let mut gradient = rows.transposed_times(&missing);
        let columns = || 0..gradient_len(free);
        for i in columns() {
            gradient[i] = (gradient[i] - beyond[i] * self.lambda[i]) * free[i];
        }
        let precondition = |g: &[DVec3]| -> Vec<DVec3> { g.iter().zip(&steepness).map(|(g, s)| *g * *s).collect() };
        let mut step = precondition(&gradient);
        let mut slope = dot(&gradient, &step);
        let enough = slope * (TOLERANCE * TOLERANCE);
        let mut done = 0;
        while done < self.iterations && slope.cmpgt(enough).any() {
            let mut image = match normal {
                Some(normal) => normal.times(&step),
                None => rows.transposed_times(&rows.times(&step)),
            };
            for i in columns() {
                image[i] = (image[i] + step[i] * self.lambda[i]) * free[i];
            }
            let length = ratio(slope, dot(&step, &image));
            for i in columns() {
                beyond[i] += step[i] * length;
                gradient[i] -= image[i] * length;
            }
            let next = precondition(&gradient);
            let next_slope = dot(&gradient, &next);
            let keep = ratio(next_slope, slope);
            step.iter_mut().zip(&next).for_each(|(step, next)| *step = *next + *step * keep);
            slope = next_slope;
            done += 1;
        }
        done
    }
}

fn gradient_len(free: &[DVec3]) -> usize {
    free.len()
}

/// Per channel, 0 where there is nothing to divide by: that channel is solved.
fn ratio(a: DVec3, b: DVec3) -> DVec3 {
    let of = |i: usize| if b[i] > 0.0 { a[i] / b[i] } else { 0.0 };
    DVec3::new(of(0), of(1), of(2))
}

/// Per channel; parts of fixed length are added up in order, so that threads make no difference.
fn dot(a: &[DVec3], b: &[DVec3]) -> DVec3 {
    const PART: usize = 4096;
    let of_part = |(a, b): (&[DVec3], &[DVec3])| a.iter().zip(b).map(|(a, b)| *a * *b).sum::<DVec3>();
    let parts: Vec<DVec3> = a.par_chunks(PART).zip(b.par_chunks(PART)).map(of_part).collect();
    parts.into_iter().sum()
}

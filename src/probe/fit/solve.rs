//! Least squares with a prior: `min Σ ω_k (A_k·x − E_k)² + Σ λ_i·(x_i − x₀_i)²`, per channel, by conjugate gradients on the normal
//! equations (Hestenes & Stiefel 1952) with the blocks of single probes as preconditioner, or their diagonal where these are large.

use glam::{DVec3, Vec3A};
use rayon::prelude::*;

use super::normal::{Inverses, Normal};
use super::rows::Rows;

pub struct Task<'a, 'f, 'i> {
    pub rows: &'a mut Rows<'f, 'i>,
    /// x₀.
    pub prior: &'a [Vec3A],
    /// λ of each unknown.
    pub lambda: Vec<f64>,
    /// Most iterations of one descent.
    pub iterations: u32,
    /// Whether lit rows that come out black weigh more, and all is solved once more: see [`Rows::weigh_black`].
    pub lightens: bool,
}

pub struct Solved {
    pub values: Vec<Vec3A>,
    /// In all.
    pub iterations: u32,
}

/// The gradient is taken for 0 where it is this share of what it was.
const TOLERANCE: f64 = 1e-3;

/// Memory of the vectors of so many unknowns.
pub fn bytes(unknowns: u64) -> u64 {
    /// Difference, gradient, preconditioned gradient, direction, its image; of each its copy while it is made.
    const VECTORS: u64 = 6;
    unknowns * (VECTORS * size_of::<DVec3>() as u64 + 2 * size_of::<Vec3A>() as u64 + size_of::<f64>() as u64)
}

impl Task<'_, '_, '_> {
    /// Solves. Up to `rounds` times values below 0 are held at 0 and the others solved for again; without rounds values may
    /// be negative.
    pub fn solve(&mut self, rounds: u32) -> Solved {
        self.solve_above(rounds, |_| DVec3::ZERO)
    }

    /// The same with a bound of its own for each unknown.
    pub fn solve_above(&mut self, rounds: u32, least: impl Fn(usize) -> DVec3) -> Solved {
        let prior: Vec<DVec3> = self.prior.iter().map(|x| x.as_dvec3()).collect();
        let mut system = System::new(self.rows, &prior);
        let mut state = State {
            beyond: vec![DVec3::ZERO; prior.len()],
            free: vec![DVec3::ONE; prior.len()],
            enough: None,
            iterations: 0,
        };
        self.descend_above(rounds, &least, &prior, &system, &mut state);
        let values = |state: &State| -> Vec<Vec3A> {
            let value = |i: usize| {
                let value = state.beyond[i] + prior[i];
                Vec3A::from((if rounds > 0 { value.max(least(i)) } else { value }).as_vec3())
            };
            (0..prior.len()).map(value).collect()
        };
        if self.lightens {
            let probes = self.rows.weigh_black(&values(&state));
            if !probes.is_empty() {
                system.refresh(self.rows, &prior, &probes);
                self.descend_above(rounds, &least, &prior, &system, &mut state);
            }
        }
        Solved { values: values(&state), iterations: state.iterations }
    }

    /// Descends, holds what is below its bound, and descends again.
    fn descend_above(
        &self,
        rounds: u32,
        least: &impl Fn(usize) -> DVec3,
        prior: &[DVec3],
        system: &System,
        state: &mut State,
    ) {
        for round in 0..=rounds {
            self.descend(system, state);
            if round == rounds {
                break;
            }
            let mut held = false;
            for (i, ((beyond, free), prior)) in state.beyond.iter_mut().zip(&mut state.free).zip(prior).enumerate() {
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
    }

    /// Conjugate gradients over the values that are free.
    fn descend(&self, system: &System, state: &mut State) {
        let rows = &*self.rows;
        let State { beyond, free, enough, iterations } = state;
        let columns = 0..free.len();
        let mut gradient = system.times(rows, beyond);
        for i in columns.clone() {
            gradient[i] = (system.right[i] - gradient[i] - beyond[i] * self.lambda[i]) * free[i];
        }
        let preconditioner = system.preconditioner(&self.lambda, free);
        let mut step = preconditioner.times(&gradient);
        let mut slope = dot(&gradient, &step);
        let enough = *enough.get_or_insert(slope * (TOLERANCE * TOLERANCE));
        let mut done = 0;
        while done < self.iterations && slope.cmpgt(enough).any() {
            let mut image = system.times(rows, &step);
            for i in columns.clone() {
                image[i] = (image[i] + step[i] * self.lambda[i]) * free[i];
            }
            let length = ratio(slope, dot(&step, &image));
            for i in columns.clone() {
                beyond[i] += step[i] * length;
                gradient[i] -= image[i] * length;
            }
            let next = preconditioner.times(&gradient);
            let next_slope = dot(&gradient, &next);
            let keep = ratio(next_slope, slope);
            step.iter_mut().zip(&next).for_each(|(step, next)| *step = *next + *step * keep);
            slope = next_slope;
            done += 1;
        }
        *iterations += done;
    }
}

/// How far a solution is.
struct State {
    /// What x is beyond the prior.
    beyond: Vec<DVec3>,
    /// 1 where a value is free, 0 where it is held.
    free: Vec<DVec3>,
    /// The slope that is taken for 0, which the first descent says.
    enough: Option<DVec3>,
    iterations: u32,
}

/// The normal equations without λ: Aᵀ·W·A·(x − x₀) = Aᵀ·W·(E − A·x₀).
struct System {
    matrix: Matrix,
    right: Vec<DVec3>,
}

enum Matrix {
    /// Blocks of few unknowns.
    Blocks(Normal),
    /// Its diagonal. The rest is in the rows.
    Diagonal(Vec<f64>),
}

/// What nearly inverts them with λ, on the values that are free.
enum Preconditioner {
    Blocks(Inverses),
    Diagonal(Vec<DVec3>),
}

impl System {
    fn new(rows: &Rows, prior: &[DVec3]) -> System {
        let matrix = Normal::new(rows).map_or_else(|| Matrix::Diagonal(rows.diagonal()), Matrix::Blocks);
        System { matrix, right: right(rows, prior) }
    }

    /// Takes over the weights of rows, which differ in those that ask some probes.
    fn refresh(&mut self, rows: &Rows, prior: &[DVec3], probes: &[u32]) {
        match &mut self.matrix {
            Matrix::Blocks(normal) => normal.refresh(rows, probes),
            Matrix::Diagonal(diagonal) => *diagonal = rows.diagonal(),
        }
        self.right = right(rows, prior);
    }

    fn preconditioner(&self, lambda: &[f64], free: &[DVec3]) -> Preconditioner {
        match &self.matrix {
            Matrix::Blocks(normal) => Preconditioner::Blocks(normal.inverses(lambda, free)),
            Matrix::Diagonal(diagonal) => {
                let inverse = |((d, lambda), free): ((&f64, &f64), &DVec3)| *free / (d + lambda);
                Preconditioner::Diagonal(diagonal.iter().zip(lambda).zip(free).map(inverse).collect())
            }
        }
    }

    fn times(&self, rows: &Rows, x: &[DVec3]) -> Vec<DVec3> {
        match &self.matrix {
            Matrix::Blocks(normal) => normal.times(x),
            Matrix::Diagonal(_) => rows.transposed_times(&rows.times(x)),
        }
    }
}

impl Preconditioner {
    fn times(&self, x: &[DVec3]) -> Vec<DVec3> {
        match self {
            Preconditioner::Blocks(inverses) => inverses.times(x),
            Preconditioner::Diagonal(inverse) => x.iter().zip(inverse).map(|(x, inverse)| *x * *inverse).collect(),
        }
    }
}

fn right(rows: &Rows, prior: &[DVec3]) -> Vec<DVec3> {
    let mut missing = rows.times(prior);
    missing.iter_mut().zip(rows.targets()).for_each(|(m, target)| *m = target.as_dvec3() - *m);
    rows.transposed_times(&missing)
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

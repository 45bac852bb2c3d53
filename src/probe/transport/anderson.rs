//! Anderson acceleration of a fixed-point iteration x ← g(x), per colour channel (Anderson 1965; Walker & Ni 2011).
//!
//! From the last iterates it takes the combination whose residuals f = g(x) − x cancel best, and goes on from there. For a
//! linear g this is what GMRES does (Walker & Ni, section 2); unlike it, it also serves methods whose queries are not
//! linear. The same pairs of differences tell the operator's largest eigenvalue by the method of Rayleigh and Ritz.
//!
//! Memory: 2·(columns + 1) + 2 fields.

use glam::{BVec3, DVec3, Vec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::operator::Field;

/// Most differences that are kept: as many as stiff scenes take iterations.
const WINDOW: usize = 20;
/// Fewest: below, acceleration is hardly better than plain iteration.
const MIN_WINDOW: usize = 3;
/// Memory that differences may take as far as [`MIN_WINDOW`] allows; a constant, so that no result depends on the machine.
const WINDOW_BYTES: u64 = 512 << 20;

/// Elements that one task sums: the sums' order does not depend on the number of threads.
const CHUNK: usize = 4096;

/// Rounding of one unknown of an iteration, relative to the largest ones: single precision.
const ROUNDING: f64 = f32::EPSILON as f64;

/// Smallest eigenvalue of the normalised Gram matrix, relative to its largest, whose direction counts: the square of the
/// sine between columns below which single precision cannot tell them apart.
const INDEPENDENT: f64 = 1e-11;

/// How far rounding may move an eigenvalue's estimate, relative to its distance from 1.
const EIGENVALUE_PRECISION: f64 = 0.1;

/// A pair of differences between successive iterates.
#[derive(Debug, Clone, PartialEq)]
struct Column {
    /// Of residuals f.
    df: Field,
    /// Of values g(x).
    dg: Field,
    /// Share of rounding in the difference of iterates, per channel.
    noise: DVec3,
    /// Products with all columns from the oldest to this one.
    dots: Vec<Dots>,
}

/// Inner products of two columns i ≤ j, per channel.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Dots {
    ff: DVec3,
    gg: DVec3,
    /// f of column i with g of column j, and the other way round.
    fg: DVec3,
    gf: DVec3,
}

/// What the iteration remembers.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    window: usize,
    /// Oldest first.
    columns: Vec<Column>,
    /// Residual and value of the last iterate.
    last: Option<(Field, Field)>,
    /// g(0), where the iteration began from 0.
    origin: Option<Field>,
    /// The operator applied to 1 everywhere, where that was done.
    ones: Option<Field>,
    /// Every so manieth unknown, from the first on, is irradiance; the others are 0 where all light is even.
    group: usize,
}

/// Irradiance 1 everywhere, as unknowns of which every `group`-th is irradiance.
pub fn unit(texels: usize, group: usize) -> Field {
    (0..texels).map(|o| if o % group == 0 { Vec3::ONE } else { Vec3::ZERO }).collect()
}

impl History {
    /// For fields of this many unknowns, every `group`-th of which is irradiance.
    pub fn new(texels: usize, group: usize) -> History {
        let window = History::window(texels as u64);
        History { window, columns: Vec::new(), last: None, origin: None, ones: None, group }
    }

    fn window(texels: u64) -> usize {
        let column = 2 * size_of::<Vec3>() as u64 * texels;
        ((WINDOW_BYTES / column.max(1)) as usize).clamp(MIN_WINDOW, WINDOW)
    }

    /// Most memory for fields of this many unknowns.
    pub fn bytes(texels: u64) -> u64 {
        size_of::<Vec3>() as u64 * texels * (2 * (History::window(texels) as u64 + 1) + 2)
    }

    /// Takes an iterate x and g(x) into account.
    pub fn push(&mut self, x: &[Vec3], g: Field) {
        let f = difference(&g, x);
        if self.last.is_none() && x.iter().all(|x| *x == Vec3::ZERO) {
            self.origin = Some(g.clone());
        }
        if let Some((last_f, last_g)) = self.last.take() {
            let (df, dg) = (difference(&f, &last_f), difference(&g, &last_g));
            if self.columns.len() == self.window {
                self.columns.remove(0);
                for column in &mut self.columns {
                    column.dots.remove(0);
                }
            }
            let dots = self.products(&df, &dg);
            self.columns.push(Column { noise: noise(&dots, dot(x, x)), df, dg, dots });
        }
        self.last = Some((f, g));
    }

    /// Products of all columns with a pair of differences, and of this with itself.
    fn products(&self, df: &[Vec3], dg: &[Vec3]) -> Vec<Dots> {
        let with = |f: &[Vec3], g: &[Vec3]| Dots { ff: dot(f, df), gg: dot(g, dg), fg: dot(f, dg), gf: dot(g, df) };
        self.columns.iter().map(|column| with(&column.df, &column.dg)).chain([with(df, dg)]).collect()
    }

    /// Forgets the differences: of an operator that is not linear, those from far away mislead.
    pub fn forget(&mut self) {
        self.columns.clear();
    }

    /// The next iterate: g(x) − Σ γᵢ·ΔGᵢ with the γ that minimise ‖f − Σ γᵢ·ΔFᵢ‖₂, for the channels that `accelerate`;
    /// g(x) for the others, and where asked to `keep_positive` in texels that would turn negative; these are counted.
    /// Where g is linear a negative iterate does no harm, and every deviation from the combination does.
    pub fn next(&self, accelerate: [bool; 3], keep_positive: bool) -> (Field, u64) {
        let Some((f, g)) = &self.last else { return (Field::new(), 0) };
        let right: Vec<DVec3> = self.columns.iter().map(|column| dot(&column.df, f)).collect();
        let per_channel: [Vec<f64>; 3] =
            [0, 1, 2].map(|c| if accelerate[c] { self.gamma(&right, c) } else { Vec::new() });
        let weight = |i: usize, c: usize| per_channel[c].get(i).copied().unwrap_or(0.0);
        let weights: Vec<DVec3> =
            (0..self.columns.len()).map(|i| DVec3::new(weight(i, 0), weight(i, 1), weight(i, 2))).collect();
        let texel = |(o, g): (usize, &Vec3)| {
            let mixed = self
                .columns
                .iter()
                .zip(&weights)
                .fold(g.as_dvec3(), |sum, (column, weight)| sum - *weight * column.dg[o].as_dvec3());
            let negative = mixed.cmplt(DVec3::ZERO) & BVec3::splat(keep_positive);
            (DVec3::select(negative, g.as_dvec3(), mixed).as_vec3(), u64::from(negative.any()))
        };
        let mixed: Vec<(Vec3, u64)> = g.par_iter().enumerate().map(texel).collect();
        let negative = mixed.iter().map(|(_, n)| n).sum();
        (mixed.into_iter().map(|(e, _)| e).collect(), negative)
    }

    /// Weights of the columns in one channel; `right` are their products with f.
    fn gamma(&self, right: &[DVec3], c: usize) -> Vec<f64> {
        let n = right.len();
        let product = |a: usize, b: usize| self.dots(a, b, c).ff;
        let scale: Vec<f64> =
            (0..n).map(|a| product(a, a)).map(|s| if s > 0.0 { 1.0 / s.sqrt() } else { 0.0 }).collect();
        let gram = DMatrix::from_fn(n, n, |a, b| product(a, b) * scale[a] * scale[b]);
        let Some(basis) = independent(gram, INDEPENDENT) else { return Vec::new() };
        let right = DVector::from_fn(n, |a, _| right[a][c] * scale[a]);
        let gamma = &basis * (basis.transpose() * right);
        gamma.iter().zip(scale).map(|(g, s)| g * s).collect()
    }

    /// Largest absolute Ritz value of the operator over all channels: an estimate of its spectral radius. `None` before
    /// there are two iterates whose difference is not mostly rounding.
    ///
    /// The operator is far from symmetric, and the differences are of light near lamps: in the space of them all, Ritz
    /// values say little. What is slow is even. Two vectors are nearly so, the iterate itself, in which (1 − T)⁻¹ has made
    /// the slow modes large, and 1 everywhere, which in closed rooms of one albedo is the slowest mode.
    pub fn spectral_radius(&self, gap: f64) -> Option<f64> {
        let (origin, ones, (f, g)) = (self.origin.as_ref()?, self.ones.as_ref()?, self.last.as_ref()?);
        let mut pairs = History { window: 2, ..History::new(0, 1) };
        let unit = unit(ones.len(), self.group);
        // At 0 residual and value are the same.
        pairs.add(difference(ones, &unit), ones.clone());
        pairs.add(difference(f, origin), difference(g, origin));
        let columns: Vec<(&[Dots], DVec3)> =
            pairs.columns.iter().map(|c| (&c.dots[..], DVec3::splat(ROUNDING))).collect();
        let of_channel = |c: usize| largest_ritz_value(&columns, c, gap * EIGENVALUE_PRECISION);
        (0..3).filter_map(of_channel).max_by(f64::total_cmp)
    }

    fn add(&mut self, df: Field, dg: Field) {
        let dots = self.products(&df, &dg);
        self.columns.push(Column { df, dg, noise: DVec3::ZERO, dots });
    }

    /// Takes the operator's image of 1 everywhere into account.
    pub fn set_image_of_ones(&mut self, image: Field) {
        self.ones = Some(image);
    }

    pub fn knows_image_of_ones(&self) -> bool {
        self.ones.is_some()
    }

    /// g(0), where the iteration began from 0.
    pub fn origin(&self) -> Option<&Field> {
        self.origin.as_ref()
    }

    /// Products of columns i and j.
    fn dots(&self, i: usize, j: usize, c: usize) -> ChannelDots {
        let d = if i > j { self.columns[i].dots[j] } else { self.columns[j].dots[i] };
        channel(d, i > j, c)
    }

    /// All fields, for a checkpoint: f and g of the last iterate, then of each column, then g(0) and T·1 where they are known; with
    /// the columns' noise.
    pub fn fields(&self) -> (Vec<&Field>, Vec<DVec3>) {
        let last = self.last.iter().flat_map(|(f, g)| [f, g]);
        let columns = self.columns.iter().flat_map(|column| [&column.df, &column.dg]);
        (
            last.chain(columns).chain(&self.origin).chain(&self.ones).collect(),
            self.columns.iter().map(|column| column.noise).collect(),
        )
    }

    /// The inverse of [`History::fields`]; `None` where they do not fit together.
    pub fn from_fields(texels: usize, group: usize, fields: Vec<Field>, noise: Vec<DVec3>) -> Option<History> {
        let mut history = History::new(texels, group);
        let pairs = if fields.is_empty() { 0 } else { noise.len() + 1 };
        if fields.len() < 2 * pairs
            || fields.len() > 2 * pairs + 2
            || pairs > history.window + 1
            || fields.iter().any(|f| f.len() != texels)
        {
            return None;
        }
        let mut fields = fields.into_iter();
        history.last = fields.next().zip(fields.next());
        for noise in noise {
            let (df, dg) = fields.next().zip(fields.next())?;
            let dots = history.products(&df, &dg);
            history.columns.push(Column { df, dg, noise, dots });
        }
        history.origin = fields.next();
        history.ones = fields.next();
        Some(history)
    }
}

struct ChannelDots {
    ff: f64,
    gg: f64,
    fg: f64,
    gf: f64,
}

/// Products of columns i and j in one channel of those of the lower number with the higher, or `swapped`.
fn channel(d: Dots, swapped: bool, c: usize) -> ChannelDots {
    let (fg, gf) = if swapped { (d.gf, d.fg) } else { (d.fg, d.gf) };
    ChannelDots { ff: d.ff[c], gg: d.gg[c], fg: fg[c], gf: gf[c] }
}

/// Share of rounding in a column whose products are these: of the iterate, against the difference of iterates.
fn noise(dots: &[Dots], x_square: DVec3) -> DVec3 {
    let Some(own) = dots.last() else { return DVec3::ONE };
    let dx_square = own.gg - own.fg - own.gf + own.ff;
    let share = |c: usize| if dx_square[c] > 0.0 { ROUNDING * (x_square[c] / dx_square[c]).sqrt() } else { 1.0 };
    DVec3::new(share(0), share(1), share(2))
}

/// Of columns with their products with those before and with themselves, and their noise.
///
/// With ΔX = ΔG − ΔF, T·ΔX = ΔG. In an orthonormal basis W of the ΔX, I − T is −WᵀΔF: its eigenvalues are those of T from
/// 1, and lose nothing where these are close to 1. Rounding moves them by less than `precision`.
fn largest_ritz_value(columns: &[(&[Dots], DVec3)], c: usize, precision: f64) -> Option<f64> {
    // Normalising directions enlarges rounding: by three at least it may.
    let clean: Vec<usize> = (0..columns.len()).filter(|&i| 3.0 * columns[i].1[c] < precision).collect();
    let n = clean.len();
    let noisiest = clean.iter().map(|&i| columns[i].1[c]).fold(0.0, f64::max);
    let dots = |a: usize, b: usize| {
        let (i, j) = (clean[a], clean[b]);
        channel(if i > j { columns[i].0[j] } else { columns[j].0[i] }, i > j, c)
    };
    let xx = DMatrix::from_fn(n, n, |a, b| {
        let d = dots(a, b);
        d.gg - d.fg - d.gf + d.ff
    });
    let scale = DVector::from_fn(n, |a, _| if xx[(a, a)] > 0.0 { 1.0 / xx[(a, a)].sqrt() } else { 0.0 });
    let scaled = |m: DMatrix<f64>| DMatrix::from_fn(n, n, |a, b| m[(a, b)] * scale[a] * scale[b]);
    // −ΔXₐ·ΔF_b.
    let xf = DMatrix::from_fn(n, n, |a, b| {
        let d = dots(a, b);
        d.ff - d.gf
    });
    let threshold = (noisiest / precision).powi(2).max(INDEPENDENT);
    let basis = independent(scaled(xx), threshold)?;
    let projected = basis.transpose() * scaled(xf) * &basis;
    let values = projected.complex_eigenvalues();
    values.iter().map(|mu| (1.0 - mu.re).hypot(mu.im)).filter(|l| l.is_finite()).max_by(f64::total_cmp)
}

/// W with Wᵀ·M·W = 1 for a positive semidefinite M, over its eigenvectors whose eigenvalue exceeds `threshold` of the
/// largest; `None` where there is none.
fn independent(gram: DMatrix<f64>, threshold: f64) -> Option<DMatrix<f64>> {
    if gram.is_empty() || gram.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let eigen = gram.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let kept: Vec<usize> =
        (0..eigen.eigenvalues.len()).filter(|&i| largest > 0.0 && eigen.eigenvalues[i] > threshold * largest).collect();
    let column = |i: &usize| eigen.eigenvectors.column(*i) / eigen.eigenvalues[*i].sqrt();
    (!kept.is_empty()).then(|| DMatrix::from_columns(&kept.iter().map(column).collect::<Vec<_>>()))
}

fn difference(a: &[Vec3], b: &[Vec3]) -> Field {
    a.par_iter().zip(b).map(|(a, b)| *a - *b).collect()
}

/// Inner product per channel, in f64, in an order of its own.
fn dot(a: &[Vec3], b: &[Vec3]) -> DVec3 {
    let chunk =
        |(a, b): (&[Vec3], &[Vec3])| a.iter().zip(b).fold(DVec3::ZERO, |sum, (a, b)| sum + a.as_dvec3() * b.as_dvec3());
    let sums: Vec<DVec3> = a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(chunk).collect();
    sums.into_iter().sum()
}

#[cfg(test)]
mod tests;

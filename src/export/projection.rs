//! From irradiance along some directions to coefficients of spherical harmonics, by least squares.

use glam::{Vec3, Vec3A};
use nalgebra::{DMatrix, SMatrix};

use crate::math::harmonics::{self, COUNT, Y0};

/// What each direction adds to each coefficient times Y₀.
pub struct Projection(Vec<[f32; COUNT]>);

/// Share of the mean function's square that every coefficient has to bear more: of few directions it leaves the functions
/// at 0 that these cannot tell apart.
const RIDGE: f64 = 1e-6;

impl Projection {
    /// Directions with the solid angle that each stands for, in any unit.
    pub fn of(directions: &[(Vec3, f32)]) -> Projection {
        let functions =
            DMatrix::from_fn(directions.len(), COUNT, |i, j| f64::from(harmonics::basis(directions[i].0)[j]));
        let weights: Vec<f64> = directions.iter().map(|(_, weight)| f64::from(*weight)).collect();
        let weighted = DMatrix::from_fn(directions.len(), COUNT, |i, j| functions[(i, j)] * weights[i]);
        let product = functions.transpose() * &weighted;
        let mut normal: SMatrix<f64, COUNT, COUNT> = SMatrix::from_fn(|i, j| product[(i, j)]);
        let ridge = RIDGE * normal[(0, 0)];
        // Not of the mean, so that constant irradiance is kept exactly.
        (1..COUNT).for_each(|j| normal[(j, j)] += ridge);
        // Positive definite: the mean of any direction is above 0, and the ridge is on the others.
        let inverse = normal.try_inverse().unwrap_or_else(SMatrix::identity);
        let of = |i: usize| {
            std::array::from_fn(|j| {
                let sum: f64 = (0..COUNT).map(|k| inverse[(j, k)] * weighted[(i, k)]).sum();
                (sum * f64::from(Y0)) as f32
            })
        };
        Projection((0..directions.len()).map(of).collect())
    }

    /// Coefficients times Y₀, W·m⁻².
    pub fn coefficients(&self, along: impl Iterator<Item = Vec3A>) -> Vec<Vec3A> {
        let mut out = vec![Vec3A::ZERO; COUNT];
        for (irradiance, shares) in along.zip(&self.0) {
            out.iter_mut().zip(shares).for_each(|(out, share)| *out += irradiance * *share);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::fibonacci;

    fn directions(count: usize) -> Vec<(Vec3, f32)> {
        (0..count).map(|i| (fibonacci::direction(i, count), 1.0)).collect()
    }

    #[test]
    fn functions_come_back() {
        let directions = directions(48);
        let projection = Projection::of(&directions);
        let exact: [f32; COUNT] = [2.0, 0.3, -0.4, 0.5, 0.6, -0.7, 0.2, 0.1, -0.3];
        let along = directions
            .iter()
            .map(|(d, _)| Vec3A::splat(harmonics::basis(*d).iter().zip(exact).map(|(y, c)| y * c / Y0).sum::<f32>()));
        for (found, exact) in projection.coefficients(along).iter().zip(exact) {
            // The ridge takes a millionth of what 48 directions say about each function, and rounding as much.
            assert!((found.x - exact).abs() < 1e-5, "{found} {exact}");
        }
    }

    #[test]
    fn of_few_directions_only_the_mean_is_learnt() {
        for count in [1, 2] {
            let found = Projection::of(&directions(count)).coefficients((0..count).map(|_| Vec3A::ONE));
            let along = |d: Vec3| harmonics::basis(d).iter().zip(&found).map(|(y, c)| y * c.x / Y0).sum::<f32>();
            // What was given comes back.
            assert!((along(directions(count)[0].0) - 1.0).abs() < 1e-4, "{found:?}");
        }
    }
}

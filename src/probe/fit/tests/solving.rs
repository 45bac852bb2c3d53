//! The solver, and how firmly it holds the unknowns.

use super::*;

#[test]
fn conjugate_gradients_reach_the_dense_solution() {
    let volume = volume(&octahedral(2));
    let rows = rows_of(&volume, 400, |x, n| Vec3::new(1.0 + n.z, x.x.sin(), 3.0 * n.y * x.z));
    let factors = volume.irradiance.factors();
    let unknowns = 27 * 4;
    let lambda: Vec<f64> = (0..unknowns).map(|i| 0.2 * (1 + i % 3) as f64).collect();
    let rows = Rows::new(&factors, 27, 4, rows.into_iter());
    let prior = vec![Vec3A::new(0.5, 1.0, -1.0); unknowns];
    let task = solve::Task { rows: &rows, prior: &prior, lambda: lambda.clone(), iterations: 400 };
    let solved = task.solve(0);
    let mut matrix = DMatrix::from_diagonal(&DVector::from_column_slice(&lambda));
    let mut right = vec![DVector::<f64>::from_element(unknowns, 0.0); 3];
    for column in 0..unknowns {
        let unit: Vec<DVec3> = (0..unknowns).map(|o| if o == column { DVec3::ONE } else { DVec3::ZERO }).collect();
        let image = rows.transposed_times(&rows.times(&unit));
        image.iter().enumerate().for_each(|(row, value)| matrix[(row, column)] += value.x);
    }
    let targets: Vec<DVec3> = rows.targets().iter().map(|t| t.as_dvec3()).collect();
    for (i, value) in rows.transposed_times(&targets).iter().enumerate() {
        (0..3).for_each(|c| right[c][i] = value[c] + lambda[i] * f64::from(prior[i][c]));
    }
    // Texels beyond the border of a map are texels of its far side: such factors are squared before they are added up.
    for (i, diagonal) in rows.diagonal().into_iter().enumerate() {
        let exact = matrix[(i, i)] - lambda[i];
        assert!((0.5..1.0 + 1e-6).contains(&(diagonal / exact)), "{diagonal} {exact}");
    }
    let cholesky = matrix.cholesky().unwrap();
    for (c, right) in right.iter().enumerate() {
        let exact = cholesky.solve(right);
        let largest = exact.amax();
        for i in 0..unknowns {
            let off = (f64::from(solved.values[i][c]) - exact[i]).abs() / largest;
            // The gradient is solved to 1e-4 in its preconditioned norm; the matrix is well conditioned.
            assert!(off < 1e-3, "channel {c}, unknown {i}: {} and {}", solved.values[i][c], exact[i]);
        }
    }
    // With bounds none is negative, and where the solution has no negative values it stays.
    let bounded = task.solve(5);
    assert!(solved.values.iter().any(|v| v.min_element() < -0.01));
    assert!(bounded.values.iter().all(|v| v.min_element() >= 0.0));
    let change =
        |c: usize| (0..unknowns).map(|i| (solved.values[i][c] - bounded.values[i][c]).abs()).fold(0.0, f32::max);
    assert!(change(2) > 0.01, "{}", change(2));
}

#[test]
fn noisy_rows_hold_probes_more_firmly() {
    let volume = volume(&octahedral(2));
    let factors = volume.irradiance.factors();
    let prior = vec![Vec3A::splat(1.0); 27 * 4];
    // Rows are 2 where the prior gives 1: the square of what is beyond it is 1.
    let noisiness = |noise: f32| -> Vec<f64> {
        let rows = rows_of(&volume, 400, |_, _| Vec3::splat(2.0)).into_iter().map(|row| Row { noise, ..row });
        let rows = Rows::new(&factors, 27, 4, rows);
        let noisy = rows.noisiness(&prior.iter().map(|x| x.as_dvec3()).collect::<Vec<_>>());
        let firm = firmness(&rows, &factors, &prior, 0.5);
        assert!((0..27).all(|p| (firm[4 * p] - 0.5 * (1.0 + 0.4 * noisy[p])).abs() < 1e-9));
        let asked = rows.asked();
        (0..27).filter(|&p| asked[p]).map(|p| noisy[p]).collect()
    };
    for (noise, expected) in [(0.0, 0.0), (0.5, 1.0), (0.8, 4.0), (1.0, 50.0), (7.0, 350.0)] {
        assert!(noisiness(noise).iter().all(|n| (n - expected).abs() < 1e-3 * (1.0 + expected)), "{noise}");
    }
}

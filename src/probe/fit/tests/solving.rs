//! The solver, and how firmly it holds the unknowns.

use super::super::normal::Normal;
use super::*;

#[test]
fn conjugate_gradients_reach_the_dense_solution() {
    let volume = volume(&octahedral(2));
    let rows = rows_of(&volume, 400, |x, n| Vec3::new(1.0 + n.z, x.x.sin(), 3.0 * n.y * x.z));
    let factors = volume.irradiance.factors();
    let unknowns = 27 * 4;
    let lambda: Vec<f64> = (0..unknowns).map(|i| 0.2 * (1 + i % 3) as f64).collect();
    let mut rows = Rows::new(&factors, 27, 4, rows.into_iter());
    let prior = vec![Vec3A::new(0.5, 1.0, -1.0); unknowns];
    let mut task =
        solve::Task { rows: &mut rows, prior: &prior, lambda: lambda.clone(), iterations: 400, lightens: false };
    let solved = task.solve(0);
    let bounded = task.solve(5);
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
            // The gradient is solved to 1e-3 in its preconditioned norm; the matrix is well conditioned.
            assert!(off < 5e-3, "channel {c}, unknown {i}: {} and {}", solved.values[i][c], exact[i]);
        }
    }
    // With bounds none is negative, and where the solution has no negative values it stays.
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

/// Rows of surfaces alone, and where noise leaves no doubt.
#[test]
fn black_rows_weigh_more() {
    let volume = volume(&harmonics(None, true));
    let factors = volume.irradiance.factors();
    // Of the mean of the channels; a row of light 1 is black by two standard deviations up to (1/6)².
    let variances = [0.0, 0.02, 0.04];
    let kinds = [Kind::Surface, Kind::Bent, Kind::Air];
    let lit = |i: usize| Row { kind: kinds[i / 3 % 3], noise: variances[i % 3], ..rows_of_one(&volume, i) };
    let mut rows = Rows::new(&factors, 27, 12, (0..90).map(lit));
    let is_black = |i: usize| (i / 3).is_multiple_of(3) && i % 3 < 2;
    let probes = rows.weigh_black(&[Vec3A::ZERO; 27 * 12]);
    for (i, weight) in rows.weights().iter().enumerate() {
        assert_eq!(*weight, if is_black(i) { 16.0 } else { 1.0 }, "{i}");
    }
    let asked = |probe: &u32| rows.parts_of(*probe as usize).iter().any(|&(_, row)| is_black(row as usize));
    assert_eq!(probes, (0..27).filter(asked).collect::<Vec<u32>>());
    // A mean of all directions of a tenth is enough for rows of light 1.
    let mean = |i: usize| if i.is_multiple_of(12) { Vec3A::splat(0.1 / 0.2820948) } else { Vec3A::ZERO };
    let dim: Vec<Vec3A> = (0..27 * 12).map(mean).collect();
    assert!(rows.weigh_black(&dim).is_empty());
}

fn rows_of_one(volume: &Volume, i: usize) -> Row {
    let QueryPoint { position, normal, .. } = inside(volume, &mut random(i as u64));
    Row::of(&untested(), volume, &asked_in_air(position, normal), Vec3::splat(1.0 / 3.0))
}

/// Blocks of probes whose rows got other weights are those that are made of these rows at once; the inverses of what is free
/// invert them.
#[test]
fn blocks_follow_weights() {
    let volume = volume(&harmonics(None, true));
    let factors = volume.irradiance.factors();
    let row = |i: usize| Row { kind: if i < 2 { Kind::Surface } else { Kind::Air }, ..rows_of_one(&volume, i) };
    let mut rows = Rows::new(&factors, 27, 12, (0..2000).map(row));
    let mut normal = Normal::new(&rows).unwrap();
    let x: Vec<DVec3> = (0..27 * 12).map(|i| direction(&mut random(i)).as_dvec3()).collect();
    let before = normal.times(&x);
    let probes = rows.weigh_black(&[Vec3A::ZERO; 27 * 12]);
    assert!((1..27).contains(&probes.len()));
    normal.refresh(&rows, &probes);
    let after = normal.times(&x);
    assert!(before != after);
    assert_eq!(after, Normal::new(&rows).unwrap().times(&x));
    // One probe alone, its mean held in the green channel.
    let probe = probes[0] as usize;
    let lambda = vec![0.5; 27 * 12];
    let mut free = vec![DVec3::ONE; 27 * 12];
    free[12 * probe].y = 0.0;
    let alone = |i: usize| if i / 12 == probe { x[i] * free[i] } else { DVec3::ZERO };
    let alone: Vec<DVec3> = (0..27 * 12).map(alone).collect();
    let image: Vec<DVec3> =
        normal.times(&alone).iter().zip(&alone).zip(&free).map(|((y, x), free)| (*y + 0.5 * *x) * *free).collect();
    let back = normal.inverses(&lambda, &free).times(&image);
    for i in 12 * probe..12 * (probe + 1) {
        assert!((back[i] - alone[i]).abs().max_element() < 1e-9, "{i}: {} {}", back[i], alone[i]);
    }
}

//! Combined iterations against maps whose fixed points are known.

use super::*;

/// x ← b + T·x in two rooms of `n` texels each: a texel keeps a share to itself, gives the rest to its room, and of
/// that a little to the other. The same in all channels, scaled.
struct Linear {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl Linear {
    /// Share of a texel's light that goes through the door, and that it keeps to itself.
    const DOOR: f64 = 1e-3;
    const OWN: f64 = 0.4;

    /// With the eigenvalues albedo, albedo·(1 − 2·DOOR·(1 − OWN)) and albedo·OWN.
    fn new(n: usize, albedo: f64) -> Linear {
        let matrix = DMatrix::from_fn(2 * n, 2 * n, |i, j| {
            let share = if i / n == j / n { 1.0 - Linear::DOOR } else { Linear::DOOR };
            let own = if i == j { Linear::OWN } else { 0.0 };
            albedo * (own + (1.0 - Linear::OWN) * share / n as f64)
        });
        // A lamp in the first room.
        Linear { matrix, right: DVector::from_fn(2 * n, |i, _| if i < n { 1.0 + (i as f64).cos() } else { 0.0 }) }
    }

    fn apply(&self, x: &[Vec3]) -> Field {
        let mapped = |c: usize| &self.matrix * DVector::from_fn(x.len(), |i, _| f64::from(x[i][c]));
        let [r, g, b] = [0, 1, 2].map(mapped);
        let at = |i: usize| DVec3::new(r[i], g[i], b[i]) + DVec3::new(1.0, 10.0, 0.0) * self.right[i];
        (0..x.len()).map(|i| at(i).as_vec3()).collect()
    }

    fn solution(&self) -> DVector<f64> {
        let n = self.right.len();
        (DMatrix::identity(n, n) - &self.matrix).lu().solve(&self.right).unwrap()
    }
}

#[test]
fn a_stiff_linear_system_is_solved_in_a_few_steps() {
    let system = Linear::new(4, 0.999);
    let mut history = History::new(8, 1);
    let mut x = vec![Vec3::ZERO; 8];
    // Three distinct eigenvalues, and one step to begin with; rounding costs another or two.
    for _ in 0..6 {
        let g = system.apply(&x);
        history.push(&x, g);
        x = history.next([true; 3], false).0;
    }
    let solution = system.solution();
    let largest = solution.amax();
    for (i, value) in x.iter().enumerate() {
        let error = (f64::from(value.x) - solution[i]).abs() / largest;
        // Rounding, some 2⁻²⁰ from sums of eight, is enlarged by 1/(1 − λ) = 1000.
        assert!(error < 2e-3, "texel {i}: {} instead of {}", value.x, solution[i]);
        assert!((f64::from(value.y) / 10.0 - solution[i]).abs() / largest < 2e-3);
        assert_eq!(value.z, 0.0, "a channel without light stays dark");
    }
    let ones = [Vec3::ONE; 8];
    let direct = system.apply(&[Vec3::ZERO; 8]);
    history.set_image_of_ones(difference(&system.apply(&ones), &direct));
    let radius = history.spectral_radius(1e-3).unwrap();
    assert!((radius - 0.999).abs() < 2e-5, "{radius}");
}

#[test]
fn plain_channels_stay_plain_and_negative_texels_fall_back() {
    let system = Linear::new(2, 0.9);
    let mut history = History::new(4, 1);
    let mut x = vec![Vec3::ZERO; 4];
    for _ in 0..3 {
        let g = system.apply(&x);
        history.push(&x, g.clone());
        let (next, negative) = history.next([true, false, true], true);
        assert!(next.iter().zip(&g).all(|(n, g)| n.y == g.y));
        assert!(next.iter().all(|n| n.cmpge(Vec3::ZERO).all()));
        assert!(negative <= 4);
        x = next;
    }
}

#[test]
fn a_restored_history_goes_on_as_the_old_one() {
    let system = Linear::new(2, 0.99);
    let mut history = History::new(4, 1);
    let mut x = vec![Vec3::ZERO; 4];
    for _ in 0..3 {
        history.push(&x, system.apply(&x));
        x = history.next([true; 3], false).0;
    }
    let (fields, noise) = history.fields();
    let fields: Vec<Field> = fields.into_iter().cloned().collect();
    assert_eq!(History::from_fields(4, 1, fields.clone(), noise.clone()).as_ref(), Some(&history));
    assert_eq!(History::from_fields(3, 1, fields, noise), None);
}

#[test]
fn the_window_shrinks_with_the_field() {
    assert_eq!(History::window(1000), WINDOW);
    assert_eq!(History::window(u64::from(u32::MAX)), MIN_WINDOW);
    let texels = WINDOW_BYTES / 24 / 5;
    assert_eq!(History::window(texels), 5);
    assert_eq!(History::bytes(texels), texels * 12 * 14);
}

//! Each level of a map from the one above.

use glam::Vec3;

/// The mean of every 2×2 texels; `n` texels per side are left.
pub fn halved(texels: &[Vec3], n: usize) -> Vec<Vec3> {
    let at = |x: usize, y: usize| texels[x + 2 * n * y];
    (0..n * n)
        .map(|o| {
            let (x, y) = (2 * (o % n), 2 * (o / n));
            0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
        })
        .collect()
}

/// The least distance of every block of texels; `n` blocks per side are left.
pub fn lowest_of(distances: &[f32], side: usize, n: usize) -> Vec<f32> {
    let block = side / n;
    let mut out = vec![f32::INFINITY; n * n];
    for (o, &distance) in distances.iter().enumerate() {
        let least = &mut out[o % side / block + n * (o / side / block)];
        *least = least.min(distance);
    }
    out
}

/// The mean over the area of each of `side`² texels of a map of `n`², n at most 2·`side` + 1.
pub fn shrunk(texels: &[Vec3], n: usize, side: usize) -> Vec<Vec3> {
    let width = n as f32 / side as f32;
    // Texels that a new one meets along an axis, with their shares.
    let met = |i: usize| {
        let (low, high) = (i as f32 * width, (i + 1) as f32 * width);
        (low as usize..(high.ceil() as usize).min(n)).map(move |t| {
            let share = (high.min((t + 1) as f32) - low.max(t as f32)) / width;
            (t, share.max(0.0))
        })
    };
    let mean = |o: usize| {
        let rows = met(o / side).flat_map(|(y, v)| met(o % side).map(move |(x, u)| (x + n * y, u * v)));
        rows.map(|(t, share)| texels[t] * share).sum()
    };
    (0..side * side).map(mean).collect()
}

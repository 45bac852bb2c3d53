//! Means over the neighbourhood of every pixel.

use rayon::prelude::*;

/// Side of the neighbourhood, pixels. Light changes little over it, and 25 squared differences determine their mean
/// well enough. The figures that use it contain the error that this may cause in their standard error.
const WINDOW: usize = 5;

/// For every pixel, the mean of `value` over the `used` pixels of its neighbourhood. 0 if none of them is used.
pub fn window_means<const N: usize>(
    width: u32,
    height: u32,
    used: impl Fn(usize) -> bool + Sync,
    value: impl Fn(usize) -> [f64; N] + Sync,
) -> Vec<[f64; N]> {
    let (width, height) = (width as usize, height as usize);
    let half = WINDOW / 2;
    let around = |i: usize| {
        let (x, y) = (i % width, i / width);
        let columns = x.saturating_sub(half)..(x + half + 1).min(width);
        let (mut sum, mut count) = ([0.0; N], 0.0f64);
        for row in y.saturating_sub(half)..(y + half + 1).min(height) {
            for j in columns.clone().map(|column| row * width + column).filter(|&j| used(j)) {
                sum.iter_mut().zip(value(j)).for_each(|(s, v)| *s += v);
                count += 1.0;
            }
        }
        sum.map(|s| s / count.max(1.0))
    };
    (0..width * height).into_par_iter().map(around).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_end_at_the_edges_and_skip_unused_pixels() {
        // Three rows of seven pixels with the values 0 to 20: the window covers all rows.
        let means = window_means(7, 3, |i| i != 8, |i| [i as f64, 1.0]);
        // Columns 0 to 2, without pixel 8: (0+1+2+7+9+14+15+16)/8.
        assert_eq!(means[0], [8.0, 1.0]);
        // Columns 2 to 6: the middle row's own mean.
        assert_eq!(means[4 + 7], [11.0, 1.0]);
        assert_eq!(window_means(1, 1, |_| false, |_| [3.0])[0], [0.0]);
    }
}

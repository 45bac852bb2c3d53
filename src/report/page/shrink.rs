//! Fewer pixels: for pictures that would make the page too large, and for the small ones that need no script.

use glam::Vec3;
use serde::Serialize;

/// A picture's size in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct PixelExtent {
    pub width: u32,
    pub height: u32,
}

impl PixelExtent {
    pub fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The size when blocks of `factor` × `factor` pixels become one; what is left over at the ends is a smaller block.
    pub fn shrunk(self, factor: u32) -> PixelExtent {
        PixelExtent { width: self.width.div_ceil(factor), height: self.height.div_ceil(factor) }
    }
}

/// The mean of each block; not a number where one of its pixels is not.
pub fn mean_of_blocks(pixels: &[Vec3], size: PixelExtent, factor: u32) -> Vec<Vec3> {
    if factor == 1 {
        return pixels.to_vec();
    }
    per_block(size, factor, |block| {
        let (sum, count) = block.fold((glam::DVec3::ZERO, 0.0), |(sum, n), i| (sum + pixels[i].as_dvec3(), n + 1.0));
        (sum / count).as_vec3()
    })
}

/// The value of the largest magnitude of each block, so that a single bad pixel stays to be seen; not a number where one is not.
pub fn peak_of_blocks(values: &[f32], size: PixelExtent, factor: u32) -> Vec<f32> {
    per_block(size, factor, |block| {
        block.map(|i| values[i]).fold(0.0, |peak: f32, value| {
            if peak.is_nan() || (value.abs() <= peak.abs() && !value.is_nan()) { peak } else { value }
        })
    })
}

fn per_block<T>(size: PixelExtent, factor: u32, of: impl Fn(&mut dyn Iterator<Item = usize>) -> T) -> Vec<T> {
    let shrunk = size.shrunk(factor);
    let block = |i: usize| {
        let (row, column) = (i as u32 / shrunk.width * factor, i as u32 % shrunk.width * factor);
        let rows = row..(row + factor).min(size.height);
        let columns = column..(column + factor).min(size.width);
        of(&mut rows.flat_map(|y| columns.clone().map(move |x| y as usize * size.width as usize + x as usize)))
    };
    (0..shrunk.pixels()).map(block).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_have_their_mean_and_their_peak() {
        let size = PixelExtent { width: 3, height: 2 };
        let values = [1.0, 2.0, -9.0, 3.0, -4.0, 5.0];
        assert_eq!(peak_of_blocks(&values, size, 2), [-4.0, -9.0]);
        let pixels: Vec<Vec3> = values.into_iter().map(Vec3::splat).collect();
        assert_eq!(mean_of_blocks(&pixels, size, 2), [Vec3::splat(0.5), Vec3::splat(-2.0)]);
    }

    #[test]
    fn one_bad_pixel_stays() {
        let size = PixelExtent { width: 2, height: 2 };
        assert!(peak_of_blocks(&[1.0, f32::NAN, 2.0, 8.0], size, 2)[0].is_nan());
        let pixels = [Vec3::ONE, Vec3::new(0.0, f32::NAN, 0.0), Vec3::ONE, Vec3::ONE];
        assert!(mean_of_blocks(&pixels, size, 2)[0].y.is_nan());
    }
}

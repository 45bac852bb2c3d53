//! Texture lookup.

use std::sync::LazyLock;

use glam::{Vec2, Vec4};

use super::material::{Texels, Texture, Wrap};
use crate::math::color::linear_from_srgb;

/// Linear value of every 8-bit sRGB code.
static LINEAR_FROM_SRGB8: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| linear_from_srgb(code as f32 / 255.0)));

/// Linear value of 8-bit alpha and data.
#[inline]
fn unit(code: u8) -> f32 {
    f32::from(code) * (1.0 / 255.0)
}

impl Texture {
    /// Linear RGBA of one texel. The indices must be in range.
    #[inline]
    pub(super) fn texel(&self, x: u32, y: u32) -> Vec4 {
        self.mix([self.index(x, y)], |[texel]| texel)
    }

    /// Linear RGBA at `uv`, interpolated bilinearly, or the nearest texel if the sampler asks for that. There are no
    /// mip levels, because averaging many rays filters the texture.
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        if self.width == 1 && self.height == 1 {
            return self.texel(0, 0);
        }
        let size = Vec2::new(self.width as f32, self.height as f32);
        if self.nearest {
            let p = uv * size;
            return self.texel(self.wrapped(0, floor(p.x)), self.wrapped(1, floor(p.y)));
        }
        let p = uv * size - 0.5;
        let (column, row) = (floor(p.x), floor(p.y));
        let f = p - Vec2::new(column as f32, row as f32);
        let x = [self.wrapped(0, column), self.wrapped(0, column.saturating_add(1))];
        let y = [self.wrapped(1, row), self.wrapped(1, row.saturating_add(1))];
        let corners = [(x[0], y[0]), (x[1], y[0]), (x[0], y[1]), (x[1], y[1])].map(|(x, y)| self.index(x, y));
        self.mix(corners, |[a, b, c, d]| a.lerp(b, f.x).lerp(c.lerp(d, f.x), f.y))
    }

    #[inline]
    fn index(&self, x: u32, y: u32) -> usize {
        y as usize * self.width as usize + x as usize
    }

    /// What `mix` makes of the linear RGBA of some texels. How these are stored is asked once for all.
    #[inline]
    fn mix<const N: usize>(&self, at: [usize; N], mix: impl Fn([Vec4; N]) -> Vec4) -> Vec4 {
        match &self.texels {
            Texels::Rgba32F(data) => mix(at.map(|i| data[i])),
            Texels::Rgba8 { data, srgb: true } => {
                let table: &[f32; 256] = &LINEAR_FROM_SRGB8;
                let linear = |code: u8| table[code as usize];
                mix(at.map(|i| data[i]).map(|[r, g, b, a]| Vec4::new(linear(r), linear(g), linear(b), unit(a))))
            }
            Texels::Rgba8 { data, srgb: false } => mix(at.map(|i| data[i]).map(|texel| Vec4::from(texel.map(unit)))),
        }
    }

    /// Texel index along `axis` (0 columns, 1 rows) for index `i`, which may lie outside the image.
    #[inline]
    fn wrapped(&self, axis: usize, i: i64) -> u32 {
        let size = if axis == 0 { self.width } else { self.height };
        let n = i64::from(size);
        // Images that repeat are often met anywhere: a test would be taken at random.
        if n & (n - 1) == 0 && self.wrap[axis] == Wrap::Repeat {
            return (i & (n - 1)) as u32;
        }
        // Most lookups lie inside. This test saves them a division.
        if (0..n).contains(&i) {
            return i as u32;
        }
        let wrapped = match self.wrap[axis] {
            Wrap::Repeat => i.rem_euclid(n),
            Wrap::ClampToEdge => i.clamp(0, n - 1),
            Wrap::MirroredRepeat => {
                let twice = i.rem_euclid(2 * n);
                if twice < n { twice } else { 2 * n - 1 - twice }
            }
        };
        wrapped as u32
    }
}

/// Largest integer not above `x`. It is faster than `f32::floor`, which is a function call on processors without SSE
/// 4.1, the baseline that the crate is compiled for. The cast saturates and turns NaN into 0, so every result is valid.
#[inline]
fn floor(x: f32) -> i64 {
    let truncated = x as i64;
    truncated.saturating_sub(i64::from(truncated as f32 > x))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(wrap: Wrap, nearest: bool) -> Texture {
        let texels = Texels::Rgba32F([0.0f32, 1.0, 2.0, 3.0].map(Vec4::splat).to_vec());
        Texture { width: 4, height: 1, wrap: [wrap, wrap], nearest, texels }
    }

    #[test]
    fn wrap_modes_continue_the_image() {
        let at = |wrap, u: f32| row(wrap, true).sample(Vec2::new(u, 0.5)).x;
        assert_eq!(at(Wrap::Repeat, 1.1), 0.0);
        assert_eq!(at(Wrap::Repeat, -0.1), 3.0);
        assert_eq!(at(Wrap::MirroredRepeat, 1.1), 3.0);
        assert_eq!(at(Wrap::MirroredRepeat, -0.3), 1.0);
        assert_eq!(at(Wrap::ClampToEdge, 7.0), 3.0);
        assert_eq!(at(Wrap::ClampToEdge, -7.0), 0.0);
        assert!(at(Wrap::Repeat, f32::NAN).is_finite());
        assert!(at(Wrap::MirroredRepeat, f32::INFINITY).is_finite());
    }

    #[test]
    fn sides_of_all_lengths_repeat() {
        for width in 1..40u32 {
            let texels = Texels::Rgba32F((0..width).map(|i| Vec4::splat(i as f32)).collect());
            let texture = Texture { width, height: 1, wrap: [Wrap::Repeat; 2], nearest: true, texels };
            for i in -100..100i64 {
                assert_eq!(i64::from(texture.wrapped(0, i)), i.rem_euclid(i64::from(width)), "{i} of {width}");
            }
        }
    }

    #[test]
    fn bilinear_meets_texel_centres_and_middles() {
        let t = row(Wrap::Repeat, false);
        assert_eq!(t.sample(Vec2::new(0.375, 0.5)).x, 1.0);
        assert_eq!(t.sample(Vec2::new(0.5, 0.5)).x, 1.5);
    }
}

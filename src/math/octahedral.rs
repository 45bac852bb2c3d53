//! The octahedral map between unit directions and the square `oct` ∈ [−1,1]², its inverse and its density.
//!
//! Source: Cigolle et al., *A Survey of Efficient Representations for Independent Unit Vectors*, JCGT 3(2), 2014. The
//! pole is +Z. Texture coordinates give `oct = 2·uv − 1`. The maps of probes are square: the row follows v, the column
//! follows u, and texel centres lie at `uv = (i + ½)/R` for the resolution R.

use glam::{Vec2, Vec3};

/// 1 for positive numbers and zero, −1 for negative ones. A sign of 0 would map the axes to the wrong place.
#[inline]
fn sign_not_zero(v: Vec2) -> Vec2 {
    Vec2::new(if v.x >= 0.0 { 1.0 } else { -1.0 }, if v.y >= 0.0 { 1.0 } else { -1.0 })
}

/// Folds the lower half of the octahedron onto the corners of the square. The fold is its own inverse.
#[inline]
fn fold(p: Vec2) -> Vec2 {
    (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * sign_not_zero(p)
}

/// `oct` of a direction of any length above zero. Inverse of [`direction_from_oct`].
#[inline]
pub fn oct_from_direction(direction: Vec3) -> Vec2 {
    let scale = 1.0 / (direction.x.abs() + direction.y.abs() + direction.z.abs());
    let p = direction.truncate() * scale;
    if direction.z >= 0.0 { p } else { fold(p) }
}

/// The point of the octahedron |x| + |y| + |z| = 1 that `oct` stands for.
#[inline]
fn point_on_octahedron(oct: Vec2) -> Vec3 {
    let z = 1.0 - oct.x.abs() - oct.y.abs();
    if z >= 0.0 { oct.extend(z) } else { fold(oct).extend(z) }
}

/// Unit direction of `oct` ∈ [−1,1]²; inverse of [`oct_from_direction`].
pub fn direction_from_oct(oct: Vec2) -> Vec3 {
    direction_and_density(oct).0
}

/// Solid angle per area of the square, dω/(du dv), in sr.
///
/// A face of the octahedron has the normal (1,1,1)/√3 and lies 1/√3 from the centre. A patch du·dv of the square is a
/// patch of area √3·du·dv on the face. The centre sees it at distance |p| and under the cosine 1/(√3·|p|), so
/// dω = √3·du·dv · 1/(√3·|p|) / |p|² = du·dv/|p|³.
pub fn solid_angle_density(oct: Vec2) -> f32 {
    direction_and_density(oct).1
}

/// [`direction_from_oct`] and [`solid_angle_density`] together. Both need the same square root.
#[inline]
pub fn direction_and_density(oct: Vec2) -> (Vec3, f32) {
    let p = point_on_octahedron(oct);
    let inverse_length = p.length_recip();
    (p * inverse_length, inverse_length * inverse_length * inverse_length)
}

/// Centre of texel `i` of `0..resolution`, along one axis of `oct`.
pub fn texel_centre(i: usize, resolution: usize) -> f32 {
    (i as f32 + 0.5) / resolution as f32 * 2.0 - 1.0
}

/// Unit direction through the centre of texel (`column`, `row`) of a map without border.
pub fn texel_direction(column: usize, row: usize, resolution: usize) -> Vec3 {
    direction_from_oct(Vec2::new(texel_centre(column, resolution), texel_centre(row, resolution)))
}

/// The texel inside the map that continues it at (`column`, `row`), at most one step outside: both indices run from −1
/// to `resolution`. A step across an edge arrives mirrored about the middle of that edge; a step across a corner
/// arrives at the diagonally opposite corner.
pub fn wrap_texel(column: isize, row: isize, resolution: usize) -> (usize, usize) {
    let last = resolution as isize - 1;
    let (mut c, mut r) = (column, row);
    if r < 0 || r > last {
        c = last - c;
        r = r.clamp(0, last);
    }
    if c < 0 || c > last {
        // This covers the side edges. It also covers corners, whose column the step above has mirrored to the other
        // side but left outside.
        r = last - r;
        c = c.clamp(0, last);
    }
    (c as usize, r as usize)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn map_and_inverse_agree(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..1.0) {
            let d = Vec3::new(x, y, z);
            prop_assume!(d.length() > 1e-3);
            let back = direction_from_oct(oct_from_direction(d));
            // A few roundings of f32 on either way.
            prop_assert!(back.distance(d.normalize()) < 1e-6, "{d} came back as {back}");
        }

        #[test]
        fn square_comes_back(u in -1.0f32..1.0, v in -1.0f32..1.0) {
            let oct = Vec2::new(u, v);
            prop_assert!(oct_from_direction(direction_from_oct(oct)).distance(oct) < 1e-6);
        }
    }

    #[test]
    fn axes_lie_where_the_file_format_says() {
        assert_eq!(oct_from_direction(Vec3::Z), Vec2::ZERO);
        assert_eq!(oct_from_direction(Vec3::X), Vec2::X);
        assert_eq!(oct_from_direction(Vec3::Y), Vec2::Y);
        assert_eq!(oct_from_direction(Vec3::NEG_Z), Vec2::ONE);
        // Column is u, which runs along X; row is v, which runs along Y.
        assert!(texel_direction(7, 3, 8).x > 0.9);
        assert!(texel_direction(3, 7, 8).y > 0.9);
    }

    #[test]
    fn density_integrates_to_the_sphere() {
        let n = 512;
        let cell = 4.0 / (n * n) as f64;
        let sum: f64 = (0..n * n)
            .map(|i| solid_angle_density(Vec2::new(texel_centre(i % n, n), texel_centre(i / n, n))) as f64 * cell)
            .sum();
        // Midpoint rule, error O(n⁻²).
        assert!((sum - 4.0 * PI as f64).abs() < 1e-4, "{sum}");
    }

    #[test]
    fn wrapped_texels_are_neighbours_on_the_sphere() {
        let r = 8;
        for i in 0..r as isize {
            for (c, row) in [(-1, i), (r as isize, i), (i, -1), (i, r as isize)] {
                let inside = (c.clamp(0, r as isize - 1) as usize, row.clamp(0, r as isize - 1) as usize);
                let wrapped = wrap_texel(c, row, r);
                let a = texel_direction(inside.0, inside.1, r);
                let b = texel_direction(wrapped.0, wrapped.1, r);
                // Neighbouring texels of an 8×8 map lie at most 0.4 rad apart.
                assert!(a.angle_between(b) < 0.4, "({c},{row}) wraps to {wrapped:?}");
            }
        }
        assert_eq!(wrap_texel(-1, -1, r), (7, 7));
        assert_eq!(wrap_texel(8, -1, r), (0, 7));
        assert_eq!(wrap_texel(-1, 8, r), (7, 0));
        assert_eq!(wrap_texel(8, 8, r), (0, 0));
    }
}

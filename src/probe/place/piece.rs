//! The part of a triangle that lies in a voxel, and points of it.

use glam::{Vec2, Vec3};

use crate::math::sampling::triangle_barycentric;

/// Corners of a triangle cut by a box: each of its six planes adds one at most.
const MOST_CORNERS: usize = 3 + 6;

/// The part of a triangle in a voxel, in units of the voxel and relative to its centre.
pub struct Piece {
    triangle: [Vec3; 3],
    corners: [Vec3; MOST_CORNERS],
    count: usize,
    /// In faces of the voxel; 0 where the triangle but touches it.
    pub area: f32,
}

impl Piece {
    /// The triangle may lie beyond the voxel by `margin` along the main axis of its normal: of two voxels that it lies between,
    /// both know it.
    pub fn new(triangle: [Vec3; 3], margin: f32) -> Piece {
        let axis = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).abs().max_position();
        let mut half = Vec3::splat(0.5);
        half[axis] += margin;
        let mut piece = Piece { triangle, corners: [Vec3::ZERO; MOST_CORNERS], count: 3, area: 0.0 };
        piece.corners[..3].copy_from_slice(&triangle);
        let (low, high) =
            (triangle[0].min(triangle[1]).min(triangle[2]), triangle[0].max(triangle[1]).max(triangle[2]));
        for axis in 0..3 {
            if high[axis] > half[axis] {
                piece.cut(axis, 1.0, half[axis]);
            }
            if low[axis] < -half[axis] {
                piece.cut(axis, -1.0, half[axis]);
            }
        }
        piece.area = (1..piece.count.saturating_sub(1)).map(|i| piece.fan(i)).sum();
        piece
    }

    /// Cuts off what lies beyond `half` on one side along an axis (Sutherland & Hodgman 1974).
    fn cut(&mut self, axis: usize, sign: f32, half: f32) {
        let old = self.corners;
        let beyond = |p: Vec3| sign * p[axis] - half;
        let mut count = 0;
        for i in 0..self.count {
            let (from, to) = (old[i], old[(i + 1) % self.count]);
            let (a, b) = (beyond(from), beyond(to));
            let crossing = (a > 0.0) != (b > 0.0);
            for corner in [(a <= 0.0).then_some(from), crossing.then(|| from + (to - from) * (a / (a - b)))] {
                // Rounding may make more of a sliver than there can be.
                if let (Some(corner), true) = (corner, count < MOST_CORNERS) {
                    self.corners[count] = corner;
                    count += 1;
                }
            }
        }
        self.count = count;
    }

    /// Area of the i-th triangle of the fan around the first corner.
    fn fan(&self, i: usize) -> f32 {
        0.5 * (self.corners[i] - self.corners[0]).cross(self.corners[i + 1] - self.corners[0]).length()
    }

    /// Barycentric coordinates, in the whole triangle, of a point of the piece, uniform over its area; of the triangle's point
    /// nearest the voxel's centre where it has none.
    pub fn point(&self, area: f32, u: Vec2) -> Vec2 {
        let mut left = area;
        for i in 1..self.count.saturating_sub(1) {
            let size = self.fan(i);
            if left < size || i + 2 == self.count && size > 0.0 {
                let b = triangle_barycentric(u);
                let (e1, e2) = (self.corners[i] - self.corners[0], self.corners[i + 1] - self.corners[0]);
                return self.barycentric(self.corners[0] + e1 * b.x + e2 * b.y);
            }
            left -= size;
        }
        nearest_to_origin(&self.triangle)
    }

    /// Barycentric coordinates of a point of the triangle's plane, within the triangle.
    fn barycentric(&self, point: Vec3) -> Vec2 {
        let [origin, ..] = self.triangle;
        let (e1, e2, p) = (self.triangle[1] - origin, self.triangle[2] - origin, point - origin);
        let axis = e1.cross(e2).abs().max_position();
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let determinant = e1[u] * e2[v] - e1[v] * e2[u];
        let b = Vec2::new(p[u] * e2[v] - p[v] * e2[u], e1[u] * p[v] - e1[v] * p[u]) / determinant;
        let b = b.max(Vec2::ZERO);
        b / (b.x + b.y).max(1.0)
    }
}

/// Barycentric coordinates of the point of a triangle nearest the origin (Ericson, *Real-Time Collision Detection*,
/// 2005, section 5.1.5).
fn nearest_to_origin(t: &[Vec3; 3]) -> Vec2 {
    let (ab, ac, ap) = (t[1] - t[0], t[2] - t[0], -t[0]);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return Vec2::ZERO;
    }
    let bp = -t[1];
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return Vec2::X;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return Vec2::new(d1 / (d1 - d3), 0.0);
    }
    let cp = -t[2];
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return Vec2::Y;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return Vec2::new(0.0, d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return Vec2::new(1.0 - w, w);
    }
    Vec2::new(vb, vc) / (va + vb + vc)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vec3> {
        (-2.0f32..2.0, -2.0f32..2.0, -2.0f32..2.0).prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn pieces_have_the_area_that_lies_in_the_box(a in point(), b in point(), c in point()) {
            let piece = Piece::new([a, b, c], 0.0);
            let whole = 0.5 * (b - a).cross(c - a).length();
            let n = 200;
            let at = |i: i32, j: i32| a + (b - a) * ((i as f32 + 1.0 / 3.0) / n as f32) + (c - a) * ((j as f32 + 1.0 / 3.0) / n as f32);
            let all: Vec<Vec3> = (0..n).flat_map(|i| (0..n - i).map(move |j| at(i, j))).collect();
            let inside = all.iter().filter(|p| p.abs().max_element() <= 0.5).count();
            // Half of the small triangles, those that point the other way, are not looked at.
            let counted = whole * inside as f32 / all.len() as f32;
            // Along the border a row of small triangles counts or does not: its length is at most that of six edges.
            let row = 6.0 * 1.5 * 2.0 * whole.sqrt() / n as f32 + 0.02 * whole;
            prop_assert!((piece.area - counted).abs() < row + 0.01, "{} {counted}", piece.area);
        }

        #[test]
        fn points_lie_in_the_box_and_the_triangle(a in point(), b in point(), c in point(), s in 0.0f32..1.0, u in 0.0f32..1.0, v in 0.0f32..1.0) {
            let piece = Piece::new([a, b, c], 0.0);
            prop_assume!(piece.area > 1e-3 && (b - a).cross(c - a).length() > 0.1);
            let at = piece.point(s * piece.area, Vec2::new(u, v));
            let p = a + (b - a) * at.x + (c - a) * at.y;
            prop_assert!(p.abs().max_element() < 0.5 + 1e-3, "{p}");
            prop_assert!(at.min_element() >= 0.0 && at.x + at.y <= 1.0 + 1e-6);
        }
    }

    #[test]
    fn what_but_touches_has_no_area() {
        let piece = Piece::new([Vec3::new(0.51, -1.0, 0.0), Vec3::new(0.51, 1.0, 0.0), Vec3::new(2.0, 0.0, 0.0)], 0.03);
        assert_eq!(piece.area, 0.0);
        // The nearest point, on the first edge.
        assert_eq!(piece.point(0.0, Vec2::splat(0.3)), Vec2::new(0.5, 0.0));
        // Along the normal the margin counts.
        let beyond = [Vec3::new(-1.0, -1.0, 0.51), Vec3::new(2.0, -1.0, 0.51), Vec3::new(-1.0, 2.0, 0.51)];
        assert!((Piece::new(beyond, 0.03).area - 1.0).abs() < 1e-5);
        assert_eq!(Piece::new(beyond, 0.0).area, 0.0);
    }
}

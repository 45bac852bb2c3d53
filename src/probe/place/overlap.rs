//! Triangles against boxes: the separating-axis test.
//!
//! Source: Akenine-Möller, *Fast 3D Triangle-Box Overlap Testing*, 2001.

use glam::Vec3;

/// Whether a triangle meets the box around the origin with these half sides.
pub fn triangle_meets_box(corners: [Vec3; 3], half: Vec3) -> bool {
    // What most boxes fail by comes first: the triangle's own box, then its plane.
    let low = corners[0].min(corners[1]).min(corners[2]);
    let high = corners[0].max(corners[1]).max(corners[2]);
    if low.cmpgt(half).any() || high.cmplt(-half).any() {
        return false;
    }
    let edges = [corners[1] - corners[0], corners[2] - corners[1], corners[0] - corners[2]];
    let normal = edges[0].cross(edges[1]);
    if normal.dot(corners[0]).abs() > half.dot(normal.abs()) {
        return false;
    }
    let separated = |axis: Vec3| {
        let p = corners.map(|c| c.dot(axis));
        let (low, high) = (p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2]));
        let reach = half.dot(axis.abs());
        low > reach || high < -reach
    };
    !Vec3::AXES.into_iter().any(|axis| edges.iter().any(|edge| separated(axis.cross(*edge))))
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
        fn a_point_of_the_triangle_in_the_box_means_overlap(a in point(), b in point(), c in point()) {
            let half = Vec3::new(0.5, 0.7, 0.9);
            let n = 40;
            let inside = (0..=n).flat_map(|i| (0..=n - i).map(move |j| (i, j))).any(|(i, j)| {
                let (u, v) = (i as f32 / n as f32, j as f32 / n as f32);
                (a + (b - a) * u + (c - a) * v).abs().cmple(half * 0.999).all()
            });
            if inside {
                prop_assert!(triangle_meets_box([a, b, c], half));
            }
        }
    }

    #[test]
    fn near_misses_are_told_apart() {
        // Across the corner (1,1,1) of a unit half box: the plane x+y+z = s.
        let cut = |s: f32| [Vec3::X * s, Vec3::Y * s, Vec3::Z * s];
        assert!(triangle_meets_box(cut(2.9), Vec3::ONE));
        assert!(!triangle_meets_box(cut(3.1), Vec3::ONE));
    }
}

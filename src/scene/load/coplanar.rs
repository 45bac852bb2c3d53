//! Finds emissive triangles that overlap another triangle in one plane, such as a lamp quad in the plane of a ceiling,
//! and decides which of the two is in front ([`crate::scene::cover`]).
//!
//! The rule depends on geometry and materials alone, not on the order of the file. A double-sided emitter is in front
//! for all rays. A single-sided one is in front for rays that meet its front and behind for the others, as if it stood
//! a hair before the other surface. Of two emitters the brighter one goes first.

use std::cmp::Ordering;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use crate::math::box_tree::{Bounds, BoxTree};
use crate::math::color::luminance;
use crate::math::offset::ray_offset;
use crate::scene::{Cover, Covers, Material, Mesh, TriangleIndex};

/// Fills [`Mesh::covers`] and moves covered triangles behind those that stop every ray. Returns the number of emissive
/// triangles that overlap another one.
pub(super) fn settle(mesh: &mut Mesh, materials: &[Material]) -> usize {
    let overlaps = overlaps(mesh, materials);
    if overlaps.is_empty() {
        return 0;
    }
    let mut covers = Covers::default();
    for &(front, back) in &overlaps {
        let material = &materials[mesh.materials[front.0 as usize].0 as usize];
        let normal = (!material.double_sided).then(|| mesh.geometric_normal(front));
        covers.add(back, Cover { by: front, towards: normal });
        if let Some(normal) = normal {
            covers.add(front, Cover { by: back, towards: Some(-normal) });
        }
    }
    sort_covered(mesh, &covers);
    let mut emitters: Vec<TriangleIndex> = overlaps.iter().map(|o| o.0).collect();
    emitters.sort_unstable();
    emitters.dedup();
    emitters.len()
}

/// Orders the triangles: those that stop every ray, those that are covered, those with an alpha test.
fn sort_covered(mesh: &mut Mesh, covers: &Covers) {
    let whole = |t: &u32| covers.of(TriangleIndex(*t)).is_empty();
    let opaque = || 0..mesh.opaque_count as u32;
    let tested = mesh.opaque_count as u32..mesh.triangles.len() as u32;
    let order: Vec<u32> = opaque().filter(whole).chain(opaque().filter(|t| !whole(t))).chain(tested).collect();
    let mut new = vec![0; order.len()];
    order.iter().zip(0..).for_each(|(&old, place)| new[old as usize] = place);
    let opaque_count = opaque().filter(whole).count();
    mesh.triangles = order.iter().map(|&t| mesh.triangles[t as usize]).collect();
    mesh.materials = order.iter().map(|&t| mesh.materials[t as usize]).collect();
    mesh.covers = covers.renumbered(&new);
    mesh.opaque_count = opaque_count;
}

/// All pairs of an emitter and a triangle that it lies in front of.
fn overlaps(mesh: &Mesh, materials: &[Material]) -> Vec<(TriangleIndex, TriangleIndex)> {
    let material = |t: TriangleIndex| &materials[mesh.materials[t.0 as usize].0 as usize];
    let all = || (0..mesh.triangles.len() as u32).map(TriangleIndex);
    let emitters: Vec<TriangleIndex> = all().filter(|&t| material(t).emits()).collect();
    if emitters.is_empty() {
        return Vec::new();
    }
    let bounds = |t: TriangleIndex| -> Bounds {
        let corners = mesh.corners(t);
        let reach = ray_offset(&corners);
        (corners[0].min(corners[1]).min(corners[2]) - reach, corners[0].max(corners[1]).max(corners[2]) + reach)
    };
    let tree = BoxTree::new(emitters.iter().map(|&t| bounds(t)));
    let of_triangle = |t: u32| -> Vec<(TriangleIndex, TriangleIndex)> {
        let other = TriangleIndex(t);
        let mut found = Vec::new();
        tree.meeting(bounds(other), |i| {
            let emitter = emitters[i as usize];
            // Each pair of emitters comes up twice.
            let goes_first = !material(other).emits() || precedes(mesh, materials, emitter, other);
            if emitter != other && goes_first && overlap(&mesh.corners(emitter), &mesh.corners(other)) {
                found.push((emitter, other));
            }
        });
        found
    };
    let mut pairs: Vec<_> = (0..mesh.triangles.len() as u32).into_par_iter().flat_map_iter(of_triangle).collect();
    pairs.sort_unstable();
    pairs
}

/// Whether emitter `a` goes before emitter `b`: by brightness, then by the places of the corners, then by colour, and only
/// between triangles that are alike in all of this by their numbers.
fn precedes(mesh: &Mesh, materials: &[Material], a: TriangleIndex, b: TriangleIndex) -> bool {
    let color = |t: TriangleIndex| {
        let material = &materials[mesh.materials[t.0 as usize].0 as usize];
        if material.unlit { material.base_color.truncate() } else { material.emission }
    };
    let brightness = |t: TriangleIndex| luminance(color(t));
    let corners = |t: TriangleIndex| {
        let mut corners = mesh.corners(t).map(|c| c.to_array());
        corners.sort_by(compare);
        corners
    };
    let by_corners = || {
        let (a, b) = (corners(a), corners(b));
        a.iter().zip(&b).map(|(p, q)| compare(p, q)).find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
    };
    let by_color = || compare(&color(b).to_array(), &color(a).to_array());
    brightness(b).total_cmp(&brightness(a)).then_with(by_corners).then_with(by_color).then(a.cmp(&b)).is_lt()
}

fn compare(p: &[f32; 3], q: &[f32; 3]) -> Ordering {
    p.iter().zip(q).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
}

/// Whether two triangles lie in one plane within the ray offset and share more than an edge.
fn overlap(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    let tolerance = f64::from(ray_offset(a).max(ray_offset(b)));
    let [a, b] = [a, b].map(|t| t.map(|p| p.as_dvec3()));
    let normal_of = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero();
    let within = |t: &[DVec3; 3], plane: &[DVec3; 3]| {
        let normal = normal_of(plane);
        t.iter().all(|p| normal.dot(*p - plane[0]).abs() <= tolerance)
    };
    // Of a small and a large triangle the small one decides, because its plane is less well known.
    let normal = if within(&a, &b) {
        normal_of(&b)
    } else if within(&b, &a) {
        normal_of(&a)
    } else {
        return false;
    };
    let (x, y) = normal.any_orthonormal_pair();
    let flat = |t: [DVec3; 3]| t.map(|p| DVec2::new(x.dot(p - b[0]), y.dot(p - b[0])));
    let (a, b) = (flat(a), flat(b));
    // Separating axes: two convex shapes overlap if their projections onto every edge's normal do.
    let span = |t: &[DVec2; 3], axis: DVec2| {
        let at = t.map(|p| axis.dot(p));
        (at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2]))
    };
    [&a, &b].into_iter().all(|t| {
        (0..3).all(|i| {
            let axis = (t[(i + 1) % 3] - t[i]).perp().normalize_or_zero();
            let ((low_a, high_a), (low_b, high_b)) = (span(&a, axis), span(&b, axis));
            high_a.min(high_b) - low_a.max(low_b) > tolerance
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(corners: [[f32; 2]; 3], z: f32) -> [Vec3; 3] {
        corners.map(|[x, y]| Vec3::new(x, y, z))
    }

    #[test]
    fn triangles_overlap_in_one_plane_and_by_more_than_an_edge() {
        let ceiling = triangle([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]], 2.0);
        let lamp = [[1.0, 1.0], [1.5, 1.0], [1.0, 1.5]];
        assert!(overlap(&ceiling, &triangle(lamp, 2.0)) && overlap(&triangle(lamp, 2.0), &ceiling));
        // 1 µm is within the 15 µm of a coordinate of 4 m, 0.1 mm is not.
        assert!(overlap(&ceiling, &triangle(lamp, 2.000001)));
        assert!(!overlap(&ceiling, &triangle(lamp, 2.0001)));
        // Neighbours share an edge or a part of one.
        assert!(!overlap(&ceiling, &triangle([[4.0, 0.0], [4.0, 4.0], [0.0, 4.0]], 2.0)));
        assert!(!overlap(&ceiling, &triangle([[1.0, 0.0], [2.0, 0.0], [2.0, -1.0]], 2.0)));
        assert!(overlap(&ceiling, &triangle([[1.0, 0.0], [2.0, 0.0], [2.0, 0.1]], 2.0)));
        // Boxes meet, triangles do not.
        assert!(!overlap(&ceiling, &triangle([[4.0, 4.0], [4.0, 2.0], [2.0, 4.0]], 2.0)));
        // Equal triangles.
        assert!(overlap(&ceiling, &ceiling));
        // An edge of the ceiling's plane, but upright.
        assert!(!overlap(&ceiling, &[Vec3::new(1.0, 1.0, 2.0), Vec3::new(2.0, 1.0, 2.0), Vec3::new(1.0, 1.0, 3.0)]));
    }
}

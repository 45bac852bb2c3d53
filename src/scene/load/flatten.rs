//! Copies all draws into one list of vertices, with positions relative to the middle of the scene.
//!
//! Positions are computed in f64 relative to a landmark, a point in the scene. Their bounding box gives the centre.
//! Only the final `(A·p + (t − landmark)) − centre` is rounded to f32. So the result does not depend on the scene's
//! position in the world.

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::draws::Draws;
use super::poses::Poses;
use super::primitive::Primitive;
use super::transform::{Pose, WorldPoint, is_mirrored, normal_matrix};
use crate::scene::{DroppedTriangles, MaterialIndex, Mesh};

/// Coordinates farther than this from the landmark, in metres, count as infinite. Sums of larger squares could overflow
/// f32.
const MAX_COORDINATE_M: f64 = 1e18;

/// Least height of a triangle as a share of its longest edge. A lower triangle counts as having no area: f32 rounds its
/// vertices by a share of 1.2e-7, so its normal would be noise.
const MIN_HEIGHT: f64 = 1e-7;

pub(super) struct Flattened {
    pub mesh: Mesh,
    /// Middle of the scene relative to the landmark.
    pub centre: DVec3,
    pub dropped: DroppedTriangles,
}

/// What the flattening needs to know about materials, to put opaque triangles first.
pub(super) trait MaterialOf {
    /// The material of a primitive, and whether that material needs an alpha test.
    fn of(&self, primitive: &Primitive) -> (MaterialIndex, bool);
}

/// Copies every draw. Opaque triangles come first; otherwise the order is that of the scene.
pub(super) fn flatten(draws: &Draws, landmark: &WorldPoint, materials: &impl MaterialOf) -> Flattened {
    let centre = centre(draws, landmark);
    let has = |list: fn(&Primitive) -> bool| draws.primitives.iter().any(list);
    let mut pool = Pool {
        mesh: Mesh::default(),
        centre,
        colors: has(|p| !p.colors.is_empty()),
        tangents: has(|p| !p.tangents.is_empty()),
        dropped: DroppedTriangles::default(),
        alpha: Vec::new(),
    };
    for draw in &draws.draws {
        let primitive = &draws.primitives[draw.primitive];
        let (material, needs_alpha) = materials.of(primitive);
        pool.draw(primitive, &Poses::of(draws, &draw.place, landmark), material, needs_alpha);
    }
    let Pool { mut mesh, dropped, alpha, .. } = pool;
    mesh.opaque_count = mesh.triangles.len();
    for (triangle, material) in alpha {
        mesh.triangles.push(triangle);
        mesh.materials.push(material);
    }
    Flattened { mesh, centre, dropped }
}

/// Middle of the bounding box of all triangles with finite corners, relative to the landmark.
fn centre(draws: &Draws, landmark: &WorldPoint) -> DVec3 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for draw in &draws.draws {
        let primitive = &draws.primitives[draw.primitive];
        let poses = Poses::of(draws, &draw.place, landmark);
        let points = points(primitive, &poses);
        for triangle in &primitive.triangles {
            let corners = triangle.map(|vertex| points[vertex as usize]);
            if corners.iter().all(|&p| is_sane(p)) {
                low = corners.iter().fold(low, |low, &p| low.min(p));
                high = corners.iter().fold(high, |high, &p| high.max(p));
            }
        }
    }
    if low.cmple(high).all() { low + (high - low) * 0.5 } else { DVec3::ZERO }
}

fn points(primitive: &Primitive, poses: &Poses) -> Vec<DVec3> {
    let point = |(vertex, &position)| poses.at(primitive, vertex).apply(position);
    primitive.positions.iter().enumerate().map(point).collect()
}

fn is_sane(point: DVec3) -> bool {
    point.is_finite() && point.abs().max_element() <= MAX_COORDINATE_M
}

fn has_area(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (u, v) = (b - a, c - a);
    let longest_squared = u.length_squared().max(v.length_squared()).max((c - b).length_squared());
    // Twice the area is height × longest edge.
    u.cross(v).length() > MIN_HEIGHT * longest_squared
}

struct Pool {
    mesh: Mesh,
    centre: DVec3,
    colors: bool,
    tangents: bool,
    dropped: DroppedTriangles,
    alpha: Vec<([u32; 3], MaterialIndex)>,
}

impl Pool {
    fn draw(&mut self, primitive: &Primitive, poses: &Poses, material: MaterialIndex, needs_alpha: bool) {
        const UNUSED: u32 = u32::MAX;
        let points = points(primitive, poses);
        let mut pooled = vec![UNUSED; points.len()];
        for &triangle in &primitive.triangles {
            let corners = triangle.map(|vertex| points[vertex as usize]);
            if !corners.iter().all(|&p| is_sane(p)) {
                self.dropped.non_finite += 1;
                continue;
            }
            if !has_area(corners.map(|p| self.recentred(p))) {
                self.dropped.zero_area += 1;
                continue;
            }
            let mut mirrored = 0;
            let mut wound = triangle.map(|vertex| {
                let pose = poses.at(primitive, vertex as usize);
                mirrored += if is_mirrored(&pose.linear) { 1 } else { -1 };
                let slot = &mut pooled[vertex as usize];
                if *slot == UNUSED {
                    *slot = self.mesh.positions.len() as u32;
                    let position = self.recentred(points[vertex as usize]);
                    self.push_vertex(primitive, vertex as usize, position, &pose);
                }
                pooled[vertex as usize]
            });
            // Mirroring reverses the winding. Swapping two corners restores it, so that fronts stay fronts.
            if mirrored > 0 {
                wound.swap(1, 2);
            }
            if needs_alpha {
                self.alpha.push((wound, material));
            } else {
                self.mesh.triangles.push(wound);
                self.mesh.materials.push(material);
            }
        }
    }

    fn recentred(&self, point: DVec3) -> Vec3 {
        // + 0.0 turns −0 into +0, so the bits of zero do not depend on the computation before it.
        ((point - self.centre) + DVec3::ZERO).as_vec3()
    }

    fn push_vertex(&mut self, primitive: &Primitive, vertex: usize, position: Vec3, pose: &Pose) {
        let mesh = &mut self.mesh;
        mesh.positions.push(position);
        let normal = primitive.normals.get(vertex).map_or(Vec3::ZERO, |normal| {
            let normal = normal.as_dvec3().normalize_or_zero();
            (normal_matrix(&pose.linear) * normal).normalize_or_zero().as_vec3()
        });
        mesh.normals.push(normal);
        for (pool, uvs) in mesh.uvs.iter_mut().zip(&primitive.uvs) {
            pool.push(uvs.get(vertex).copied().unwrap_or(Vec2::ZERO));
        }
        if self.colors {
            mesh.colors.push(primitive.colors.get(vertex).copied().unwrap_or(Vec4::ONE));
        }
        if self.tangents {
            let tangent = primitive.tangents.get(vertex).map_or(Vec4::ZERO, |tangent| moved_tangent(*tangent, pose));
            mesh.tangents.push(tangent);
        }
    }
}

/// The tangent in world space. Tangents lie in the surface, so they transform like edges. Mirroring reverses the
/// handedness of their frame.
fn moved_tangent(tangent: Vec4, pose: &Pose) -> Vec4 {
    let local = tangent.truncate().as_dvec3().normalize_or_zero();
    let direction = (pose.linear * local).normalize_or_zero().as_vec3();
    if direction == Vec3::ZERO {
        return Vec4::ZERO;
    }
    let handedness = if tangent.w < 0.0 { -1.0 } else { 1.0 };
    direction.extend(if is_mirrored(&pose.linear) { -handedness } else { handedness })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slivers_have_no_area_at_any_scale() {
        for scale in [1e-12, 1.0, 1e12] {
            let at = |x: f32, y: f32| Vec3::new(x, y, 0.3) * scale;
            assert!(has_area([at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)]));
            assert!(has_area([at(0.0, 0.0), at(1.0, 0.0), at(0.5, 1e-5)]));
            assert!(!has_area([at(0.0, 0.0), at(1.0, 0.0), at(2.0, 0.0)]));
            assert!(!has_area([at(0.0, 0.0), at(1.0, 0.0), at(1.0, 0.0)]));
            assert!(!has_area([at(1.0, 0.0); 3]));
        }
    }
}

//! Surfaces in one plane: which of them a ray meets first.
//!
//! Two triangles that overlap in one plane are equally far along any ray, so distance does not decide which of them a
//! ray hits. The loader decides where one of them emits: the emitting side is in front. Each triangle that is behind
//! gets a [`Cover`], and the ray tracer lets rays pass it within the cover.

use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3};

use super::{Scene, TriangleIndex};

/// A triangle that lies in front of another one in the same plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cover {
    pub by: TriangleIndex,
    /// It lies in front for rays that run against this unit vector. `None`: for all rays.
    pub towards: Option<Vec3>,
}

/// The covers of all triangles that have any.
#[derive(Debug, Clone, Default)]
pub struct Covers(HashMap<u32, Vec<Cover>>);

impl Covers {
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn add(&mut self, triangle: TriangleIndex, cover: Cover) {
        self.0.entry(triangle.0).or_default().push(cover);
    }

    /// The covers of a triangle.
    pub fn of(&self, triangle: TriangleIndex) -> &[Cover] {
        // The test for an empty map keeps hashing out of scenes without covers.
        if self.0.is_empty() { &[] } else { self.0.get(&triangle.0).map_or(&[], Vec::as_slice) }
    }

    /// The same covers after triangle i has become triangle `new[i]`.
    pub fn renumbered(&self, new: &[u32]) -> Covers {
        let at = |t: u32| new[t as usize];
        let cover = |c: &Cover| Cover { by: TriangleIndex(at(c.by.0)), ..*c };
        Covers(self.0.iter().map(|(&t, covers)| (at(t), covers.iter().map(cover).collect())).collect())
    }
}

impl Scene {
    /// The covers in front of a point of `triangle` for a ray along `direction`: the triangles with the barycentric
    /// coordinates of the point in them.
    pub fn covers_at(
        &self,
        triangle: TriangleIndex,
        barycentric: Vec2,
        direction: Vec3,
    ) -> impl Iterator<Item = (TriangleIndex, Vec2)> + '_ {
        let in_front = move |c: &&Cover| c.towards.is_none_or(|towards| direction.dot(towards) < 0.0);
        let covers = self.mesh.covers.of(triangle).iter().filter(in_front);
        covers.filter_map(move |cover| {
            let [a, b, c] = self.mesh.corners(triangle).map(|p| p.as_dvec3());
            let point = a + (b - a) * f64::from(barycentric.x) + (c - a) * f64::from(barycentric.y);
            barycentric_in(self.mesh.corners(cover.by).map(|p| p.as_dvec3()), point).map(|place| (cover.by, place))
        })
    }
}

/// Weights of the second and third corner at the projection of `point` onto the triangle. `None` outside of it.
fn barycentric_in([a, b, c]: [DVec3; 3], point: DVec3) -> Option<Vec2> {
    let (u, v, p) = (b - a, c - a, point - a);
    let normal = u.cross(v);
    let per_squared_area = normal.length_squared().recip();
    let place = glam::DVec2::new(p.cross(v).dot(normal), u.cross(p).dot(normal)) * per_squared_area;
    (place.min_element() >= 0.0 && place.element_sum() <= 1.0).then(|| place.as_vec2())
}

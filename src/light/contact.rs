//! Points that lie in a surface: a lamp on a ceiling, a probe in the plane of a floor.
//!
//! A segment that ends at such a point ends on the surface, and rounding decides whether the surface blocks it. Here
//! geometry decides. A point within the ray offset of a triangle touches it, and segments to the point end beside the
//! surface instead:
//!
//! * in front of a single-sided surface, so that light does not reach what lies behind it;
//! * on the receiver's side of a double-sided surface, or where two surfaces face apart in one plane, because nothing
//!   tells which side is meant;
//! * for a spot on the side that its axis points to, whatever the surface.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::math::box_tree::BoxTree;
use crate::math::offset::{end_offset, ray_offset};
use crate::scene::{LightKind, Scene, TriangleIndex};

/// Normals whose cosine exceeds this count as equal (0.8°). Fans of a curved surface keep their own planes.
const SAME_COSINE: f32 = 0.9999;

/// A spot stands on the side of its axis if the axis leaves the plane by more than this sine (0.6°).
const AXIS_SINE: f32 = 0.01;

/// Most rounds of moving a point out of several planes. Two planes at 30° to each other need 8 to come within 1 % of the
/// offset.
const ROUNDS: usize = 16;

/// A point that may touch surfaces.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    pub position: Vec3,
    /// Unit direction to the side that is meant, if it is known.
    pub axis: Option<Vec3>,
}

/// A plane that a point touches.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Plane {
    /// Unit, to the side that the point stands on.
    normal: Vec3,
    /// Of the point over the plane, metres.
    height: f32,
    /// Whether the point stands on the receiver's side instead.
    both_sides: bool,
}

/// The surfaces that one point touches.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    position: Vec3,
    /// Distance at which segments end from the planes, metres.
    offset: f32,
    planes: Vec<Plane>,
}

/// The contacts of a list of points.
#[derive(Debug, Clone, Default)]
pub struct Contacts(HashMap<u32, Contact>);

impl Contacts {
    /// Finds the points of `places` that touch a surface of the scene.
    pub fn find(scene: &Scene, places: &[Place]) -> Contacts {
        if places.is_empty() {
            return Contacts::default();
        }
        let mesh = &scene.mesh;
        let tree = BoxTree::new(places.iter().map(|p| (p.position, p.position)));
        let of_triangle = |t: u32| -> Vec<(u32, f32, Plane)> {
            let triangle = TriangleIndex(t);
            let corners = mesh.corners(triangle);
            let reach = ray_offset(&corners);
            let low = corners[0].min(corners[1]).min(corners[2]) - reach;
            let high = corners[0].max(corners[1]).max(corners[2]) + reach;
            let mut found = Vec::new();
            tree.meeting((low, high), |place| {
                let Place { position, axis } = places[place as usize];
                let Some(height) = height_over(&corners, position, reach) else { return };
                let normal = mesh.geometric_normal(triangle);
                let sine = axis.map_or(0.0, |axis| axis.dot(normal));
                let known = sine.abs() > AXIS_SINE;
                let side = if known { sine.signum() } else { 1.0 };
                let both_sides = !known && scene.material(triangle).double_sided;
                found.push((place, reach, Plane { normal: normal * side, height: height * side, both_sides }));
            });
            found
        };
        let touches: Vec<_> = (0..mesh.triangles.len() as u32).into_par_iter().flat_map_iter(of_triangle).collect();
        let mut contacts = HashMap::new();
        for (place, reach, plane) in touches {
            let position = places[place as usize].position;
            let none = || Contact { position, offset: 0.0, planes: Vec::new() };
            let contact = contacts.entry(place).or_insert_with(none);
            contact.offset = contact.offset.max(reach);
            contact.planes.push(plane);
        }
        contacts.values_mut().for_each(Contact::merge);
        Contacts(contacts)
    }

    /// Those of points that nothing is known about.
    pub fn of_points(scene: &Scene, positions: &[Vec3]) -> Contacts {
        let place = |&position: &Vec3| Place { position, axis: None };
        Contacts::find(scene, &positions.iter().map(place).collect::<Vec<_>>())
    }

    /// Those of the punctual lights that have a position, by their numbers in the scene.
    pub fn of_lights(scene: &Scene) -> Contacts {
        // A directional light shines from infinitely far away, and no surface touches it there.
        let place = |kind: &LightKind| match *kind {
            LightKind::Point { position, .. } => Place { position, axis: None },
            LightKind::Spot { position, direction, .. } => Place { position, axis: Some(direction) },
            LightKind::Directional { .. } => Place { position: Vec3::INFINITY, axis: None },
        };
        Contacts::find(scene, &scene.lights.iter().map(|light| place(&light.kind)).collect::<Vec<_>>())
    }

    /// Start of rays that look around from the point `index` at `position`: beside the surfaces that the point touches,
    /// in front of those of which both sides are possible.
    pub fn viewpoint(&self, index: usize, position: Vec3) -> Vec3 {
        self.of(index).map_or(position, |contact| contact.target(position + contact.front()))
    }

    /// The contact of a point, by its index in the list.
    #[inline]
    pub fn of(&self, index: usize) -> Option<&Contact> {
        // The test for an empty map keeps hashing out of scenes without contacts.
        if self.0.is_empty() { None } else { self.0.get(&(index as u32)) }
    }
}

impl Contact {
    /// Joins planes that are the same. The result does not depend on the order of the triangles.
    fn merge(&mut self) {
        let key = |p: &Plane| (p.both_sides, p.normal.to_array(), p.height);
        self.planes.sort_by(|a, b| {
            let (a, b) = (key(a), key(b));
            let normals = || a.1.iter().zip(&b.1).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne());
            a.0.cmp(&b.0).then_with(|| normals().unwrap_or(a.2.total_cmp(&b.2)))
        });
        let mut merged: Vec<Plane> = Vec::new();
        for plane in self.planes.drain(..) {
            let cosine = |known: &Plane| known.normal.dot(plane.normal);
            match merged.iter_mut().find(|known| cosine(known).abs() > SAME_COSINE) {
                None => merged.push(plane),
                // Single-sided planes come first in the order, and a double-sided one adds nothing to them.
                Some(known) => known.both_sides |= !plane.both_sides && cosine(known) < 0.0,
            }
        }
        self.planes = merged;
    }

    /// Any vector towards the fronts of the planes.
    fn front(&self) -> Vec3 {
        self.planes.iter().map(|plane| plane.normal).sum::<Vec3>() * self.offset
    }

    /// End of a segment from `origin` to the point, beside the surfaces that the point touches.
    pub fn target(&self, origin: Vec3) -> Vec3 {
        let offset = self.offset.max(end_offset(origin));
        let mut target = self.position;
        for _ in 0..ROUNDS {
            let mut moved = false;
            for plane in &self.planes {
                let side = if plane.both_sides { plane.height_of(self.position, origin).signum() } else { 1.0 };
                let missing = offset - side * plane.height_of(self.position, target);
                // A hundredth of the offset is less than one rounding of the coordinates.
                if missing > 0.01 * offset {
                    target += plane.normal * (side * missing);
                    moved = true;
                }
            }
            if !moved {
                break;
            }
        }
        target
    }

    /// Whether `origin` lies in one of the planes that the point touches, within two offsets. The point and the surface
    /// that `origin` lies on then face each other at a right angle.
    pub fn shares_plane(&self, origin: Vec3) -> bool {
        let offset = self.offset.max(end_offset(origin));
        self.planes.iter().any(|plane| plane.height_of(self.position, origin).abs() <= 2.0 * offset)
    }
}

/// The segment that tells whether a point of a surface sees a probe at `probe`. It starts at the point, lifted off the
/// surface by its ray offset, and ends at the probe, which `contact` moves off the surfaces that it touches. `None` if
/// the probe lies behind the surface and is hidden by it.
///
/// A probe in the plane of the surface counts as in front: the half space that the surface sees is closed. The segment
/// then runs at the height of the ray offset.
#[inline]
pub fn sight_line(surface: &Facet, probe: Vec3, contact: Option<&Contact>) -> Option<(Vec3, Vec3)> {
    let Facet { position, normal, offset } = *surface;
    let origin = position + normal * offset;
    let target = contact.map_or(probe, |contact| contact.target(origin));
    if (target - origin).dot(normal) > 0.0 {
        return Some((origin, target));
    }
    let height = (target - position).dot(normal);
    // A contact on the far side puts the target a whole offset behind the plane; rounding is a fraction of that.
    (height > -0.5 * offset).then(|| (origin, target + normal * (offset - height)))
}

/// A point of a surface.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    pub position: Vec3,
    /// Unit geometric normal on the side that looks.
    pub normal: Vec3,
    /// Ray offset, metres.
    pub offset: f32,
}

impl Plane {
    /// Height of `point` over the plane, if `touching` is the point that touches it.
    fn height_of(&self, touching: Vec3, point: Vec3) -> f32 {
        self.normal.dot(point - touching) + self.height
    }
}

/// Height of a point over the plane of a triangle, metres. `None` if it is more than `reach` away from the triangle.
fn height_over(corners: &[Vec3; 3], point: Vec3, reach: f32) -> Option<f32> {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let (point, reach) = (point.as_dvec3(), f64::from(reach));
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let height = normal.dot(point - a);
    // Within the three planes through the edges.
    let inside = |from: DVec3, to: DVec3| normal.cross(to - from).normalize_or_zero().dot(point - from) >= -reach;
    (height.abs() <= reach && inside(a, b) && inside(b, c) && inside(c, a)).then_some(height as f32)
}

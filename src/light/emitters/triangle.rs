//! Emissive triangles as sampling sees them.
//!
//! A triangle whose emission varies is divided into pieces, each an emitter of its own: the pieces that a bright spot
//! lies in become small, and those that are black are left out.

use std::collections::BinaryHeap;
use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::bounds::LightBounds;
use super::cone::Cone;
use crate::math::color::luminance;
use crate::math::ranked::Ranked;
use crate::math::sampling::triangle_barycentric;
use crate::scene::range::TextureRange;
use crate::scene::{Scene, TriangleIndex};
use crate::trace::offset::{end_offset, ray_offset};

/// Points per side of the grid on which the mean emission of a piece is estimated.
const POWER_GRID: usize = 4;

/// Share of a piece's largest emission that is added to its mean. The grid can miss a bright spot; with this addition it
/// is still sampled. The estimate affects noise only, not the mean.
const POWER_FLOOR: f32 = 0.01;

/// A piece is divided while its emission reaches more than this many times its mean. Division cannot help samples that
/// are at most as uneven as their cosines and distances.
const UNEVEN: f32 = 2.0;

/// Most pieces of one triangle, and of all triangles together.
const MOST_PIECES: usize = 256;
const MOST_PIECES_OF_ALL: usize = 1 << 17;

/// A part of a triangle: a point and two edges in the triangle's barycentric coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Piece {
    corner: Vec2,
    edges: [Vec2; 2],
}

impl Piece {
    pub const WHOLE: Piece = Piece { corner: Vec2::ZERO, edges: [Vec2::X, Vec2::Y] };

    /// The triangle's coordinates of a point of the piece.
    #[inline]
    fn barycentric(&self, within: Vec2) -> Vec2 {
        self.corner + self.edges[0] * within.x + self.edges[1] * within.y
    }

    /// Four of a quarter of the area each: those at the corners, and the one between; see [`child_of`].
    fn quarters(&self) -> [Piece; 4] {
        let half = self.edges.map(|edge| edge * 0.5);
        let at = |corner| Piece { corner, edges: half };
        let middle = Piece { corner: self.corner + half[0] + half[1], edges: [-half[0], -half[1]] };
        [at(self.corner), at(self.corner + half[0]), at(self.corner + half[1]), middle]
    }
}

/// The quarter that a point lies in, and its coordinates there.
#[inline]
fn child_of(p: Vec2) -> (usize, Vec2) {
    let twice = p * 2.0;
    if twice.x + twice.y <= 1.0 {
        (0, twice)
    } else if twice.x >= 1.0 {
        (1, twice - Vec2::X)
    } else if twice.y >= 1.0 {
        (2, twice - Vec2::Y)
    } else {
        (3, Vec2::ONE - twice)
    }
}

/// The data that sampling needs of a piece, contiguous in memory.
#[derive(Debug, Clone, Copy)]
pub struct EmissiveTriangle {
    corner: Vec3,
    edges: [Vec3; 2],
    pub normal: Vec3,
    ray_offset: f32,
    /// Density of points uniform by area, m⁻².
    pub per_area: f32,
    pub double_sided: bool,
    /// Emitted radiance × opacity, W·m⁻²·sr⁻¹. `None` if a texture or vertex colours change it.
    constant_radiance: Option<Vec3>,
    pub index: TriangleIndex,
    piece: Piece,
}

impl EmissiveTriangle {
    fn new(scene: &Scene, index: TriangleIndex, piece: Piece) -> EmissiveTriangle {
        let corners = scene.mesh.corners(index);
        let [x, y] = [corners[1] - corners[0], corners[2] - corners[0]];
        let at = |p: Vec2| x * p.x + y * p.y;
        let area = scene.mesh.area(index) * piece.edges[0].perp_dot(piece.edges[1]).abs();
        EmissiveTriangle {
            corner: corners[0] + at(piece.corner),
            edges: piece.edges.map(at),
            normal: scene.mesh.geometric_normal(index),
            ray_offset: ray_offset(&corners),
            per_area: 1.0 / area,
            double_sided: scene.material(index).double_sided,
            constant_radiance: is_constant(scene, index)
                .then(|| scene.uncovered_emission(index, Vec2::ZERO) * scene.opacity(index, Vec2::ZERO)),
            index,
            piece,
        }
    }

    /// Place of a point of the piece, given in its own coordinates, metres.
    #[inline]
    pub fn point(&self, within: Vec2) -> Vec3 {
        self.corner + self.edges[0] * within.x + self.edges[1] * within.y
    }

    /// Radiance that the front or back of a point of the piece emits, if that side emits, × opacity, W·m⁻²·sr⁻¹.
    #[inline]
    pub fn radiance(&self, scene: &Scene, within: Vec2, front: bool) -> Vec3 {
        self.constant_radiance.unwrap_or_else(|| {
            let barycentric = self.piece.barycentric(within);
            scene.emission(self.index, barycentric, front) * scene.opacity(self.index, barycentric)
        })
    }

    /// End of the shadow segment from `origin` to a point of the triangle. It lies just off the triangle on the
    /// receiver's side, which the sign of `cosine` gives.
    #[inline]
    pub fn shadow_target(&self, origin: Vec3, point: Vec3, cosine: f32) -> Vec3 {
        point + self.normal * self.ray_offset.max(end_offset(origin)).copysign(cosine)
    }

    fn bounds(&self, power: f32) -> LightBounds {
        let corners = [self.corner, self.corner + self.edges[0], self.corner + self.edges[1]];
        LightBounds {
            low: corners.into_iter().fold(Vec3::INFINITY, Vec3::min),
            high: corners.into_iter().fold(Vec3::NEG_INFINITY, Vec3::max),
            power,
            normals: Cone { axis: self.normal, angle: 0.0 },
            cos_reach: (PI / 2.0).cos(),
            two_sided: self.double_sided,
            range_m: f32::INFINITY,
        }
    }

    /// Mean luminance of its emission on a grid of points, of both sides where they may differ.
    fn mean(&self, scene: &Scene) -> f32 {
        let n = if self.constant_radiance.is_some() { 1 } else { POWER_GRID };
        let point = |i: usize| Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
        let of_side = |front| {
            let radiance = |i| luminance(self.radiance(scene, triangle_barycentric(point(i)), front));
            (0..n * n).map(radiance).sum::<f32>() / (n * n) as f32
        };
        let sides_differ = self.double_sided && !scene.mesh.covers.of(self.index).is_empty();
        if sides_differ { 0.5 * (of_side(true) + of_side(false)) } else { of_side(true) }
    }
}

fn is_constant(scene: &Scene, index: TriangleIndex) -> bool {
    let material = scene.material(index);
    let textured = material.emission_texture.is_some() || material.base_color_texture.is_some();
    !textured && scene.mesh.colors.is_empty() && scene.mesh.covers.of(index).is_empty()
}

/// Where the pieces of a triangle are found.
#[derive(Debug, Clone, Copy)]
enum Lookup {
    /// Black.
    None,
    /// Index of a piece.
    Piece(u32),
    /// Index of the first of four.
    Quarters(u32),
}

/// All emissive triangles of a scene, in pieces.
#[derive(Debug, Clone, Default)]
pub struct Pieces {
    pub all: Vec<EmissiveTriangle>,
    pub bounds: Vec<LightBounds>,
    /// Number of the scene's triangles that emit.
    pub triangles: usize,
    lookups: Vec<Lookup>,
    /// Per triangle of the scene: 1 + its index in `lookups`, or 0 if it does not emit. Empty if no triangle emits.
    lookup_of_triangle: Vec<u32>,
}

/// A piece that may be divided.
struct Candidate {
    piece: Piece,
    lookup: usize,
    is_uneven: bool,
    most: f32,
}

impl Pieces {
    pub fn new(scene: &Scene) -> Pieces {
        let mut pieces = Pieces::default();
        let mut ranges = TextureRange::new(scene);
        let count = scene.mesh.triangles.len();
        for index in (0..count as u32).map(TriangleIndex) {
            pieces.add(scene, index, &mut ranges);
        }
        pieces
    }

    fn add(&mut self, scene: &Scene, index: TriangleIndex, ranges: &mut TextureRange) {
        let whole = ranges.emission(scene, index, &Piece::WHOLE.corners());
        let area = scene.mesh.area(index);
        let brings_light = whole.most > 0.0 && area > 0.0;
        if !brings_light {
            return;
        }
        if self.lookup_of_triangle.is_empty() {
            self.lookup_of_triangle = vec![0; scene.mesh.triangles.len()];
        }
        self.triangles += 1;
        self.lookups.push(Lookup::None);
        let root = self.lookups.len() - 1;
        self.lookup_of_triangle[index.0 as usize] = root as u32 + 1;
        let candidate = |piece: Piece, lookup, ranges: &mut TextureRange| {
            let found = ranges.emission(scene, index, &piece.corners());
            let area = area * piece.edges[0].perp_dot(piece.edges[1]).abs();
            let is_uneven = !found.is_smallest && found.most > UNEVEN * found.mean;
            let item = Candidate { piece, lookup, is_uneven, most: found.most };
            // The next to be divided is where most is gained.
            Ranked { weight: (found.most - found.mean) * area, number: lookup as u32, item }
        };
        let mut open = BinaryHeap::from([candidate(Piece::WHOLE, root, ranges)]);
        let mut done = Vec::new();
        while let Some(Ranked { item: next, .. }) = open.pop() {
            let pieces = open.len() + done.len();
            let room = pieces + 4 <= MOST_PIECES && self.all.len() + pieces + 4 <= MOST_PIECES_OF_ALL;
            if !next.is_uneven || !room {
                done.push(next);
                continue;
            }
            let first = self.lookups.len();
            self.lookups[next.lookup] = Lookup::Quarters(first as u32);
            self.lookups.resize(first + 4, Lookup::None);
            let quarters = next.piece.quarters().into_iter().enumerate();
            open.extend(quarters.map(|(i, piece)| candidate(piece, first + i, ranges)).filter(|c| c.item.most > 0.0));
        }
        for Candidate { piece, lookup, most, .. } in done {
            let emitter = EmissiveTriangle::new(scene, index, piece);
            let power = (emitter.mean(scene) + POWER_FLOOR * most) / emitter.per_area;
            if power > 0.0 && emitter.per_area.is_finite() {
                self.lookups[lookup] = Lookup::Piece(self.all.len() as u32);
                self.bounds.push(emitter.bounds(power.min(f32::MAX)));
                self.all.push(emitter);
            }
        }
    }

    /// The piece that a point of a triangle lies in; `None` where it does not emit.
    #[inline]
    pub fn at(&self, triangle: TriangleIndex, barycentric: Vec2) -> Option<(usize, &EmissiveTriangle)> {
        let &lookup @ 1.. = self.lookup_of_triangle.get(triangle.0 as usize)? else { return None };
        let (mut lookup, mut point) = (lookup as usize - 1, barycentric);
        loop {
            match self.lookups[lookup] {
                Lookup::None => return None,
                Lookup::Piece(piece) => return Some((piece as usize, &self.all[piece as usize])),
                Lookup::Quarters(first) => {
                    let (child, within) = child_of(point);
                    (lookup, point) = (first as usize + child, within);
                }
            }
        }
    }
}

impl Piece {
    /// Its corners in the triangle's coordinates.
    fn corners(&self) -> [Vec2; 3] {
        [self.corner, self.corner + self.edges[0], self.corner + self.edges[1]]
    }
}

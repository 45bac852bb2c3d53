//! Sampling of emissive triangles, of the sky, and of punctual lights where there are many.
//!
//! Emitters come in groups: subtrees of a [`tree`] over emissive triangles, of another over [`lamps`], and bins of the [`sky`]. A [`Shares`] says how
//! often a place draws from each group. Within a group the tree chooses a triangle by what it may send to the point, and
//! points on it are uniform by area; texels of a sky map are chosen in proportion to their power.
//!
//! Multiple importance sampling needs two functions: one draws a sample, the other gives the density of samples along a
//! given ray. Both stand here together.

mod bounds;
mod cone;
mod lamps;
pub mod receiver;
pub mod shares;
mod sky;
mod tree;
mod triangle;

use glam::{Vec2, Vec3};

use self::lamps::Lamps;
use self::receiver::Receiver;
use self::shares::Shares;
use self::sky::{Sky, SkySample};
use self::tree::LightTree;
use self::triangle::Pieces;
use super::incident::{Incident, incident};
use crate::math::random::unit_from_bits;
use crate::math::sampling::triangle_barycentric;
use crate::scene::Scene;
use crate::trace::Hit;

/// A sampled direction towards an emitter.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// Unit.
    pub direction: Vec3,
    pub origin: Origin,
    /// Radiance emitted towards the point × the emitter's opacity, W·m⁻²·sr⁻¹; of a punctual light irradiance, W·m⁻².
    pub radiance: Vec3,
    /// Density with which this direction is drawn, sr⁻¹; of a punctual light the probability.
    pub density: f32,
}

/// What a sample comes from.
#[derive(Debug, Clone, Copy)]
pub enum Origin {
    Sky,
    /// The end of the shadow segment.
    Surface(Vec3),
    /// No ray finds it.
    Punctual {
        index: usize,
        incident: Incident,
    },
}

impl LightSample {
    pub fn is_punctual(&self) -> bool {
        matches!(self.origin, Origin::Punctual { .. })
    }
}

/// The emissive triangles and the sky, prepared for sampling.
pub struct Emitters {
    pieces: Pieces,
    tree: LightTree,
    lamps: Lamps,
    sky: Option<Sky>,
    punctual_scale: f32,
    /// Box around all emissive triangles and lamps. Its lower corner lies above its upper corner if there are none.
    bounds: (Vec3, Vec3),
}

/// The kind of a group, and its number within it.
enum Group<'e> {
    Triangles,
    Lamps(usize),
    Sky(&'e Sky, usize),
}

impl Emitters {
    /// `punctual_scale` is the factor on all punctual lights.
    pub fn new(scene: &Scene, punctual_scale: f32) -> Emitters {
        let pieces = Pieces::new(scene);
        let lamps = Lamps::new(&scene.lights);
        let placed = || lamps.places(&scene.lights);
        let boxes = || pieces.bounds.iter();
        let low = boxes().map(|b| b.low).chain(placed()).fold(Vec3::INFINITY, Vec3::min);
        let high = boxes().map(|b| b.high).chain(placed()).fold(Vec3::NEG_INFINITY, Vec3::max);
        let (tree, sky) = (LightTree::new(&pieces.bounds), Sky::new(&scene.environment));
        Emitters { bounds: (low, high), tree, pieces, lamps, sky, punctual_scale }
    }

    pub fn is_empty(&self) -> bool {
        self.groups() == 0
    }

    /// Whether there are emitters that rays can find.
    pub fn has_radiance(&self) -> bool {
        self.tree.groups() > 0 || self.sky.is_some()
    }

    /// Number of emissive triangles.
    pub fn triangle_count(&self) -> usize {
        self.pieces.triangles
    }

    pub fn has_sky(&self) -> bool {
        self.sky.is_some()
    }

    /// Whether punctual lights are among the emitters. Else they are summed one by one.
    pub fn has_lamps(&self) -> bool {
        self.lamps.groups() > 0
    }

    /// Number of groups: those of triangles, of lamps, of the sky.
    pub fn groups(&self) -> usize {
        self.tree.groups() + self.lamps.groups() + self.sky.as_ref().map_or(0, Sky::bins)
    }

    #[inline]
    fn kind_of(&self, group: usize) -> Group<'_> {
        let Some(group) = group.checked_sub(self.tree.groups()) else { return Group::Triangles };
        match (group.checked_sub(self.lamps.groups()), &self.sky) {
            (Some(bin), Some(sky)) => Group::Sky(sky, bin),
            _ => Group::Lamps(group),
        }
    }

    /// Whether rays can find the emitters of a group.
    pub fn is_found_by_rays(&self, group: usize) -> bool {
        !matches!(self.kind_of(group), Group::Lamps(_))
    }

    /// Whether every emitter lies behind the plane through `point` with this normal. No sample can then bring light.
    pub fn all_behind(&self, point: Vec3, normal: Vec3) -> bool {
        let (low, high) = self.bounds;
        let foremost = Vec3::select(normal.cmpge(Vec3::ZERO), high, low);
        // Without triangles the left side is NaN, so the comparison is false.
        let any_in_front = (foremost - point).dot(normal) > 0.0;
        self.sky.is_none() && !self.lamps.has_directional() && !any_in_front
    }

    /// Whether the only emitter is a sky of constant radiance. Cosine-distributed rays are then the best samples.
    pub fn is_uniform_sky(&self) -> bool {
        self.pieces.all.is_empty() && !self.has_lamps() && self.sky.as_ref().is_some_and(Sky::is_uniform)
    }

    /// Luminance of the irradiance that a group may send to the receiver if nothing occludes it: an estimate, and 0 only
    /// where it sends none.
    pub fn importance(&self, group: usize, receiver: &Receiver) -> f32 {
        match self.kind_of(group) {
            Group::Triangles => self.tree.importance(group, receiver),
            Group::Lamps(group) => self.lamps.importance(group, receiver),
            Group::Sky(sky, bin) => sky.importance(bin, receiver),
        }
    }

    /// Turns uniform random bits into a direction from `receiver` towards an emitter. `None` if the emitter cannot light
    /// the point.
    #[inline]
    pub fn sample(&self, scene: &Scene, shares: &Shares, receiver: &Receiver, bits: [u32; 4]) -> Option<LightSample> {
        let (group, share) = shares.draw(unit_from_bits(bits[0]));
        let sample = self.sample_group(scene, group, receiver, bits)?;
        Some(LightSample { density: sample.density * share, ..sample })
    }

    /// The same with an emitter of one group, and with the density within it. The first word's upper 24 bits are not used.
    #[inline]
    pub fn sample_group(
        &self,
        scene: &Scene,
        group: usize,
        receiver: &Receiver,
        [spare, word, u, v]: [u32; 4],
    ) -> Option<LightSample> {
        let place = Vec2::new(unit_from_bits(u), unit_from_bits(v));
        // 32 bits, all below 1.
        let number = f64::from(word) / 2f64.powi(32);
        match self.kind_of(group) {
            Group::Sky(sky, bin) => {
                // The lowest 8 bits of three words, which numbers of 24 bits leave over.
                let second = spare << 24 | (u & 0xFF) << 16 | (v & 0xFF) << 8;
                let SkySample { direction, radiance, density } =
                    sky.sample(&scene.environment, bin, [word, second], place)?;
                return Some(LightSample { direction, origin: Origin::Sky, radiance, density });
            }
            Group::Lamps(group) => {
                let (index, density) = self.lamps.draw(group, receiver, number)?;
                let incident = incident(&scene.lights[index], receiver.position)?;
                let origin = Origin::Punctual { index, incident };
                return Some(LightSample {
                    direction: incident.direction,
                    origin,
                    radiance: incident.irradiance * self.punctual_scale,
                    density,
                });
            }
            Group::Triangles => {}
        }
        let (piece, probability) = self.tree.draw(group, receiver, number)?;
        let triangle = &self.pieces.all[piece];
        let within = triangle_barycentric(place);
        let on_triangle = triangle.point(within);
        let to_target = on_triangle - receiver.position;
        let distance_squared = to_target.length_squared();
        let direction = to_target * distance_squared.sqrt().recip();
        let cosine = -triangle.normal.dot(direction);
        if cosine <= 0.0 && !triangle.double_sided {
            return None;
        }
        // The density is not finite if the point lies on the emitter or in its plane.
        let density = probability * triangle.per_area * distance_squared / cosine.abs();
        if !density.is_finite() {
            return None;
        }
        let target = triangle.shadow_target(receiver.position, on_triangle, cosine);
        let radiance = triangle.radiance(scene, within, cosine > 0.0);
        Some(LightSample { direction, origin: Origin::Surface(target), radiance, density })
    }

    /// Density, sr⁻¹, with which [`Self::sample`] draws the unit `direction` from `receiver` to this hit.
    #[inline]
    pub fn density_of_hit(&self, shares: &Shares, receiver: &Receiver, direction: Vec3, hit: &Hit) -> f32 {
        self.group_of_hit(receiver, direction, hit).map_or(0.0, |(group, density)| shares.of(group) * density)
    }

    /// The group that a hit belongs to, and the density of its direction within it, sr⁻¹. `None` where it does not emit.
    #[inline]
    pub fn group_of_hit(&self, receiver: &Receiver, direction: Vec3, hit: &Hit) -> Option<(usize, f32)> {
        let (piece, triangle) = self.pieces.at(hit.triangle, hit.barycentric)?;
        let cosine = triangle.normal.dot(direction).abs();
        let distance_squared = hit.t * hit.t;
        let density = triangle.per_area * distance_squared / cosine;
        Some((self.tree.group_of(piece), self.tree.probability(piece, receiver) * density))
    }

    /// Radiance of the sky along a unit `direction`, and the density, sr⁻¹, with which [`Self::sample`] draws it.
    #[inline]
    pub fn sky_along(&self, scene: &Scene, shares: &Shares, direction: Vec3) -> (Vec3, f32) {
        match self.sky_group_along(scene, direction) {
            Some((radiance, group, density)) => (radiance, shares.of(group) * density),
            None => (Vec3::ZERO, 0.0),
        }
    }

    /// Radiance of the sky along a unit `direction`, its group, and the density within it, sr⁻¹. `None` without a sky.
    #[inline]
    pub fn sky_group_along(&self, scene: &Scene, direction: Vec3) -> Option<(Vec3, usize, f32)> {
        let (radiance, bin, density) = self.sky.as_ref()?.along(&scene.environment, direction);
        Some((radiance, self.tree.groups() + self.lamps.groups() + bin, density))
    }
}

#[cfg(test)]
mod made;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tree_tests;

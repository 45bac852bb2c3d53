//! Punctual lights as emitters, for scenes with so many that they are not summed one by one.

use std::f32::consts::PI;

use glam::Vec3;

use super::bounds::LightBounds;
use super::cone::Cone;
use super::receiver::Receiver;
use super::tree::LightTree;
use crate::math::color::luminance;
use crate::scene::{LightKind, PunctualLight};

/// Up to this many lights are summed wherever light arrives: that has no noise, and costs a shadow ray for each that may
/// reach the point. More are sampled.
const MOST_SUMMED: usize = 16;

/// The punctual lights of a scene; empty where they are summed.
#[derive(Default)]
pub struct Lamps {
    /// Over `placed`.
    tree: LightTree,
    /// Indices of lights with a place.
    placed: Vec<usize>,
    /// Indices of directional lights, each a group of its own behind those of the tree.
    directional: Vec<(usize, Vec3, f32)>,
}

impl Lamps {
    pub fn new(lights: &[PunctualLight]) -> Lamps {
        let mut lamps = Lamps::default();
        if lights.len() <= MOST_SUMMED {
            return lamps;
        }
        let mut bounds = Vec::new();
        for (index, light) in lights.iter().enumerate() {
            let power = luminance(light.intensity);
            let brings_light = power > 0.0;
            if !brings_light {
                continue;
            }
            let mut place = |position, normals, cos_reach, range_m| {
                lamps.placed.push(index);
                let (low, high) = (position, position);
                bounds.push(LightBounds { low, high, power, normals, cos_reach, two_sided: false, range_m });
            };
            match light.kind {
                LightKind::Directional { direction } => lamps.directional.push((index, -direction, power)),
                LightKind::Point { position, range_m } => place(position, Cone::SPHERE, PI.cos(), range_m),
                LightKind::Spot { position, direction, range_m, outer_cone_rad, .. } => {
                    place(position, Cone { axis: direction, angle: 0.0 }, outer_cone_rad.cos(), range_m);
                }
            }
        }
        lamps.tree = LightTree::new(&bounds);
        lamps
    }

    pub fn groups(&self) -> usize {
        self.tree.groups() + self.directional.len()
    }

    /// Whether some light has no place, and so shines from beyond every plane.
    pub fn has_directional(&self) -> bool {
        !self.directional.is_empty()
    }

    /// Where the lights with a place are, relative to the scene's origin, metres.
    pub fn places<'l>(&'l self, lights: &'l [PunctualLight]) -> impl Iterator<Item = Vec3> + 'l {
        self.placed.iter().filter_map(|&index| match lights[index].kind {
            LightKind::Directional { .. } => None,
            LightKind::Point { position, .. } | LightKind::Spot { position, .. } => Some(position),
        })
    }

    /// As [`super::Emitters::importance`].
    pub fn importance(&self, group: usize, receiver: &Receiver) -> f32 {
        match group.checked_sub(self.tree.groups()).and_then(|i| self.directional.get(i)) {
            Some((_, direction, power)) => power * receiver.cosine(*direction),
            None => self.tree.importance(group, receiver),
        }
    }

    /// Index of a light of the group, and its probability, from a uniform number in [0,1).
    #[inline]
    pub fn draw(&self, group: usize, receiver: &Receiver, number: f64) -> Option<(usize, f32)> {
        if let Some((index, ..)) = group.checked_sub(self.tree.groups()).and_then(|i| self.directional.get(i)) {
            return Some((*index, 1.0));
        }
        let (light, probability) = self.tree.draw(group, receiver, number)?;
        Some((self.placed[light], probability))
    }
}

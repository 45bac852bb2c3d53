//! The light that places are expected to receive, roughly: what decides how long paths are worth following.
//!
//! Every place knows the light that comes straight to it, and by a few rays which other places it sees
//! ([`super::learnt`]). These rays are the links of a small radiosity system (Goral et al. 1984), solved by Jacobi
//! iteration. It depends on the scene and on the places that it begins with alone. Estimates that use it stay unbiased.

use glam::Vec3;
use rayon::prelude::*;

use super::World;
use crate::math::fibonacci;
use crate::trace::Ray;

/// Links are followed this many times from the places that are asked for. Not varied: a place farther off counts as unknown.
const GENERATIONS: usize = 4;

/// Bounces: at an albedo of 0.8 the rest is 1 %.
const BOUNCES: usize = 20;

/// Directions in which a point looks for the places around it. Not varied: a place that none of them meets, and that no link
/// leads to, counts as unknown.
const DIRECTIONS: usize = 64;

/// Luminance of the irradiance of places, W·m⁻².
#[derive(Debug)]
pub struct Expected {
    /// By key; `None` where nothing is known.
    places: Box<[Option<Light>]>,
}

/// Luminance of irradiance, W·m⁻².
#[derive(Debug, Clone, Copy, Default)]
pub struct Light {
    /// From emitters and punctual lights.
    pub direct: f32,
    /// That other surfaces have reflected.
    pub indirect: f32,
}

impl Light {
    pub fn sum(self) -> f32 {
        self.direct + self.indirect
    }
}

impl Expected {
    /// What is expected at the place of a key.
    #[inline]
    pub fn at(&self, key: usize) -> Option<Light> {
        self.places[key]
    }
}

impl World<'_> {
    /// What is expected at the places that are seen from these points, and at those that send them light.
    pub fn expect_around(&self, points: &[Vec3]) -> Expected {
        let seen = |&point: &Vec3| {
            let surface = move |i| self.surface(Ray::new(point, fibonacci::direction(i, DIRECTIONS), 0));
            (0..DIRECTIONS).filter_map(surface).map(|surface| self.places.key_of(&surface))
        };
        self.expect(points.par_iter().flat_map_iter(seen).collect())
    }

    /// What is expected at the places of these keys, and of those that send them light.
    pub fn expect(&self, keys: Vec<usize>) -> Expected {
        let known = self.linked_places(keys);
        let mut places = vec![None; self.places.keys()].into_boxed_slice();
        for &key in &known {
            places[key] = Some(Light { direct: self.learnt(key).direct, indirect: 0.0 });
        }
        for _ in 0..BOUNCES {
            let arrives = |&key: &usize| {
                let links = self.learnt(key).links.iter();
                links.map(|link| link.albedo * places[link.place as usize].map_or(0.0, Light::sum)).sum::<f32>()
            };
            let indirect: Vec<f32> = known.par_iter().map(arrives).collect();
            for (&key, indirect) in known.iter().zip(indirect) {
                places[key].get_or_insert_default().indirect = indirect;
            }
        }
        Expected { places }
    }

    /// These places and those that links lead to, in order.
    fn linked_places(&self, mut latest: Vec<usize>) -> Vec<usize> {
        let mut is_known = vec![false; self.places.keys()];
        for _ in 0..GENERATIONS {
            latest.sort_unstable();
            latest.dedup();
            latest.retain(|&key| !is_known[key]);
            latest.iter().for_each(|&key| is_known[key] = true);
            let linked = |&key: &usize| {
                let links = self.learnt(key).links.iter();
                links.map(|link| link.place as usize).collect::<Vec<_>>()
            };
            latest = latest.par_iter().flat_map_iter(linked).collect();
        }
        (0..is_known.len()).filter(|&key| is_known[key]).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;
    use std::path::Path;

    use super::*;
    use crate::scene::{self, LoadOptions};

    #[test]
    fn places_of_a_furnace_expect_its_closed_form() {
        // All walls emit 1 and reflect a half: π arrives directly, and as much again by reflections.
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/furnace.glb");
        let scene = scene::load(&path, &LoadOptions::default()).unwrap();
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let key = |direction| Some(world.places.key_of(&world.surface(Ray::new(Vec3::splat(0.1), direction, 0))?));
        let keys: Vec<usize> = Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]).filter_map(key).collect();
        let expected = world.expect(keys.clone());
        let light: Vec<Light> = keys.iter().filter_map(|&key| expected.at(key)).collect();
        assert_eq!(light.len(), 6);
        let mean = |of: fn(&Light) -> f32| light.iter().map(of).sum::<f32>() / 6.0;
        // 32 cosine-distributed rays find the direct light without noise; a ray or two may slip through an edge.
        assert!((mean(|l| l.direct) / PI - 1.0).abs() < 0.1, "{light:?}");
        assert!((mean(|l| l.indirect) / PI - 1.0).abs() < 0.1, "{light:?}");
        // Nothing is known of places that nobody asked for and no ray met.
        assert!((0..world.places.keys()).any(|key| expected.at(key).is_none()));
    }
}

//! Finds the indirect light that paths may end at: by a path from each point that a ray hits.

use glam::Vec3;
use rayon::prelude::*;

use super::World;
use super::irradiance_cache::{Cells, IrradianceCache};
use super::path::PathSettings;
use super::sampled::RayCount;
use crate::math::blocks::Block;
use crate::math::random::Purpose;
use crate::trace::Ray;

/// Most samples: 160 MB while they are found.
const MOST_SAMPLES: usize = 1 << 21;

impl World<'_> {
    /// Indirect light where rays hit, so many of them as far as they are not too many, and the rays that it took. `side` is that of a
    /// cell, metres. Paths that are not finite count as 0.
    pub fn irradiance_cache(
        &self,
        count: usize,
        ray: impl Fn(usize) -> Ray + Sync,
        side: f32,
        path: &PathSettings,
        seed: u64,
    ) -> (IrradianceCache, RayCount) {
        let cells = Cells::new(self, side);
        let sample = |index: usize| {
            let ray = ray(index);
            let mut rays = RayCount { primary: 1, shadow: 0 };
            let Some(hit) = self.surface(ray) else { return (None, rays) };
            let mut numbers = Block::new(seed, Purpose::CachePaths, index as u64, 0).sample(0);
            let found = self.onward(&hit, -ray.direction, path, &mut numbers, &mut rays);
            (Some(cells.sample(self, &hit, if found.is_finite() { found } else { Vec3::ZERO })), rays)
        };
        let step = count.div_ceil(MOST_SAMPLES).max(1);
        let (samples, rays): (Vec<_>, Vec<_>) = (0..count).into_par_iter().step_by(step).map(sample).unzip();
        let samples = samples.into_iter().flatten().collect();
        (IrradianceCache::new(self, cells, samples), rays.into_iter().sum())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::f64::consts::PI;
    use std::path::Path;

    use glam::{DVec3, Vec2};

    use super::*;
    use crate::light::sides::Sides;
    use crate::light::surface::SurfacePoint;
    use crate::math::blocks::BLOCK;
    use crate::math::random::{KroneckerSequence, Numbers, Random};
    use crate::math::sampling::cosine_hemisphere;
    use crate::scene::{self, LoadOptions, Scene};

    const POINTS: usize = 2000;

    fn load(name: &str) -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
        scene::load(&path, &LoadOptions::default()).unwrap()
    }

    /// Points on surfaces that look into the scene's inside.
    fn points(world: &World) -> Vec<SurfacePoint> {
        let sides = Sides::of(world.scene).unwrap();
        let mut numbers = KroneckerSequence::new(&mut Random::new(1, Purpose::FitPoints, 0, 0));
        let inner = |point: &SurfacePoint| {
            let looks = |i: u32| {
                let share = Vec2::new((i as f32 + 0.5) / 8.0, 0.3);
                let direction = cosine_hemisphere(point.geometric_normal, share);
                world.surface(Ray::new(point.ray_origin(), direction, i)).is_some_and(|seen| !seen.is_back())
            };
            (0..8).all(looks)
        };
        let all = std::iter::from_fn(|| numbers.next()).map(|numbers| world.point_at(&sides.place(numbers)));
        all.filter(inner).take(POINTS).collect()
    }

    /// Light around the points, by some rays from each.
    fn cache(world: &World, points: &[SurfacePoint], per_point: usize, side: f32) -> (IrradianceCache, RayCount) {
        let ray = |index: usize| {
            let point = &points[index / per_point];
            let mut numbers = Block::new(3, Purpose::CacheRays, index as u64, 0).sample(0);
            Ray::new(point.ray_origin(), cosine_hemisphere(point.geometric_normal, numbers.pair()), numbers.salt())
        };
        world.irradiance_cache(points.len() * per_point, ray, side, &PathSettings::default(), 3)
    }

    /// Irradiance at every point, by sixteen paths.
    fn light(world: &World, points: &[SurfacePoint], cache: Option<&IrradianceCache>, seed: u64) -> Vec<DVec3> {
        let path = PathSettings { cache, ..PathSettings::default() };
        let of_point = |(index, point): (usize, &SurfacePoint)| {
            let block = Block::new(seed, Purpose::FitPaths, index as u64, 0);
            let one = |i| {
                let normal = point.shading_normal;
                world.gather(point, normal, normal, &path, &mut block.sample(i), &mut RayCount::default()).irradiance
            };
            (0..BLOCK).map(|i| one(i).as_dvec3()).sum::<DVec3>() / f64::from(BLOCK)
        };
        points.par_iter().enumerate().map(of_point).collect()
    }

    /// All walls emit 1 and reflect a half: π arrives directly, and as much again by reflections.
    #[test]
    fn a_furnace_stays_at_its_closed_form() {
        let scene = load("furnace.glb");
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let points = points(&world);
        let (cache, rays) = cache(&world, &points, 16, 0.25);
        assert!(cache.known() > 50 && rays.total() > 32_000);
        let found = light(&world, &points, Some(&cache), 5);
        let mean = found.iter().map(|light| light.y).sum::<f64>() / POINTS as f64;
        assert!((mean / (2.0 * PI) - 1.0).abs() < 5e-3, "{mean}");
    }

    /// By the same paths that end earlier: no more noise, less rays, and the same mean within five standard errors and a hundredth.
    #[test]
    fn the_mean_is_that_of_whole_paths() {
        let scene = load("cornell.glb");
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let points = points(&world);
        let (cache, _) = cache(&world, &points, 16, 0.1);
        let [whole, short] = [None, Some(&cache)].map(|cache| light(&world, &points, cache, 5));
        let sum = |of: &[DVec3]| of.iter().map(|light| light.element_sum()).sum::<f64>();
        let squares: f64 = whole.iter().zip(&short).map(|(a, b)| (*a - *b).element_sum().powi(2)).sum();
        assert!(squares > 0.0, "the cache is used");
        let allowed = 5.0 * squares.sqrt() + 0.01 * sum(&whole);
        assert!((sum(&whole) - sum(&short)).abs() < allowed, "{} {}", sum(&whole), sum(&short));
        let scatter = |of: &[DVec3]| of.iter().map(|light| light.element_sum().powi(2)).sum::<f64>();
        assert!(scatter(&short) < scatter(&whole));
    }

    /// Cells of 0.5 m and places reach through the wall of 0.1 m between the lit room and the dark one.
    #[test]
    fn no_light_passes_a_wall() {
        let mut scene = load("two_rooms_sealed.glb");
        // With rooms of equal size places end at the wall.
        let far = scene.mesh.bounds().unwrap().1.x - 0.5;
        scene.mesh.positions.iter_mut().filter(|p| p.x > far).for_each(|p| p.x += 0.55);
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let points = points(&world);
        let (cache, _) = cache(&world, &points, 256, 0.5);
        let is_lit: Vec<bool> = light(&world, &points, None, 5).iter().map(|light| *light != DVec3::ZERO).collect();
        assert!(
            is_lit.iter().filter(|lit| **lit).count() > POINTS / 4
                && is_lit.iter().filter(|lit| !**lit).count() > POINTS / 4
        );
        let places = |side: bool| -> HashSet<usize> {
            let of_side = points.iter().zip(&is_lit).filter(|(_, lit)| **lit == side);
            of_side.map(|(point, _)| world.places.key_of(point)).collect()
        };
        assert!(!places(true).is_disjoint(&places(false)), "some place has points of both rooms");
        let found = light(&world, &points, Some(&cache), 6);
        for ((light, lit), point) in found.iter().zip(is_lit).zip(&points) {
            assert!(lit || *light == DVec3::ZERO, "{light} at {}", point.position);
        }
    }
}

//! Indirect light that is kept on surfaces, so that paths need not be followed to their end: where a ray meets a surface whose
//! light is known, that is taken for the rest of the path (Ward, Rubinstein & Clear, *A Ray Tracing Solution for Diffuse
//! Interreflection*, 1988, keep it at points; here it is the mean over patches).
//!
//! A patch is what lies in one cell of one place and sees the first of its samples, so that no light passes through walls that
//! are thinner than a cell. Kept is the light by which paths go on. What rays towards emitters find they find at every point,
//! so that shadows stay sharp; points of a place share the weights of the two techniques.

use std::collections::HashMap;
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::World;
use super::path::PathSettings;
use super::sampled::RayCount;
use super::surface::SurfacePoint;
use crate::math::blocks::{BLOCK, Block};
use crate::math::random::{Numbers, Purpose};
use crate::math::sampling::cosine_hemisphere;
use crate::trace::Ray;

/// Samples that a patch needs to be relied on.
const LEAST_SAMPLES: usize = 8;

/// Most patches of a cell in a place.
const MOST_PATCHES: usize = 4;

/// Light is taken from patches at least so many cells away: from nearby one covers many directions, and corners would be blurred.
const LEAST_DISTANCE: f32 = 2.0;

/// Most samples in all: 150 MB of them.
const MOST_SAMPLES: usize = 1 << 22;

/// Indirect irradiance by patches.
#[derive(Debug)]
pub struct IrradianceCache {
    cells: Cells,
    patches: Vec<Patch>,
    /// Which patches a cell has.
    of_cell: HashMap<Key, Range<u32>>,
}

/// A place and a cell.
type Key = (u32, [u16; 3]);

#[derive(Debug, Clone, Copy)]
struct Cells {
    low: Vec3,
    /// Metres.
    side: f32,
}

#[derive(Debug, Clone, Copy)]
struct Patch {
    /// Of its first sample, just above the surface.
    position: Vec3,
    /// Mean, W·m⁻²; `None` from too few samples.
    irradiance: Option<Vec3>,
}

/// What a path from where a ray hit has found.
struct Sample {
    key: Key,
    position: Vec3,
    irradiance: Vec3,
}

impl IrradianceCache {
    /// Light where cosine-distributed rays from points hit, `per_point` from each as far as there are not too many in all, and the
    /// rays that it took. `side` is that of a cell, metres. Paths that are not finite count as 0.
    pub fn new(
        world: &World,
        points: &[SurfacePoint],
        per_point: u32,
        side: f32,
        path: &PathSettings,
        seed: u64,
    ) -> (IrradianceCache, RayCount) {
        let cells = Cells { low: world.scene.mesh.bounds().map_or(Vec3::ZERO, |(low, _)| low), side };
        let per_point = per_point.min(BLOCK) as usize;
        let step = (points.len() * per_point).div_ceil(MOST_SAMPLES).max(1);
        let sample = |number: usize| {
            let (index, ray) = (number / per_point, (number % per_point) as u32);
            let sample = |purpose| Block::new(seed, purpose, index as u64, 0).sample(ray);
            let mut numbers = sample(Purpose::CacheRays);
            let direction = cosine_hemisphere(points[index].geometric_normal, numbers.pair());
            let hit = world.surface(Ray::new(points[index].ray_origin(), direction, numbers.salt()))?;
            let mut rays = RayCount { primary: 1, shadow: 0 };
            let found = world.onward(&hit, -direction, path, &mut sample(Purpose::CachePaths), &mut rays);
            let irradiance = if found.is_finite() { found } else { Vec3::ZERO };
            Some((Sample { key: cells.key(world, &hit), position: hit.ray_origin(), irradiance }, rays))
        };
        let numbers = (0..points.len() * per_point).into_par_iter().step_by(step);
        let (mut samples, rays): (Vec<Sample>, Vec<RayCount>) = numbers.filter_map(sample).unzip();
        // Stable, so that patches do not depend on threads.
        samples.par_sort_by_key(|sample| sample.key);
        let of_cells: Vec<&[Sample]> = samples.chunk_by(|a, b| a.key == b.key).collect();
        let found: Vec<Vec<Patch>> = of_cells.par_iter().map(|samples| patches(world, samples)).collect();
        let mut of_cell = HashMap::with_capacity(found.len());
        let mut end = 0;
        for (samples, patches) in of_cells.iter().zip(&found) {
            let start = end;
            end += patches.len() as u32;
            of_cell.insert(samples[0].key, start..end);
        }
        (IrradianceCache { cells, patches: found.into_iter().flatten().collect(), of_cell }, rays.into_iter().sum())
    }

    /// Indirect irradiance, W·m⁻², at a point that a ray has hit; `None` where it is not known, and near the ray's start.
    #[inline]
    pub fn at(&self, world: &World, point: &SurfacePoint, salt: u32) -> Option<Vec3> {
        if point.hit.t < LEAST_DISTANCE * self.cells.side {
            return None;
        }
        let Range { start, end } = self.of_cell.get(&self.cells.key(world, point))?;
        let of_cell = &self.patches[*start as usize..*end as usize];
        of_cell.iter().find(|patch| sees(world, point.ray_origin(), patch.position, salt))?.irradiance
    }
}

impl Cells {
    fn key(&self, world: &World, point: &SurfacePoint) -> Key {
        // `as` truncates, saturates and sends NaN to 0.
        let cell = ((point.position - self.low) / self.side).to_array().map(|number| number as u16);
        (world.places.key_of(point) as u32, cell)
    }
}

fn sees(world: &World, from: Vec3, to: Vec3, salt: u32) -> bool {
    from == to || !world.tracer.occluded(Ray::segment(from, to, salt))
}

/// The patches of the samples of a cell in a place.
fn patches(world: &World, samples: &[Sample]) -> Vec<Patch> {
    let mut sums: Vec<(Vec3, Vec3, usize)> = Vec::new();
    for sample in samples {
        match sums.iter().position(|(position, ..)| sees(world, sample.position, *position, 0)) {
            Some(found) => {
                sums[found].1 += sample.irradiance;
                sums[found].2 += 1;
            }
            None if sums.len() < MOST_PATCHES => sums.push((sample.position, sample.irradiance, 1)),
            None => {}
        }
    }
    let patch = |(position, sum, count): (Vec3, Vec3, usize)| Patch {
        position,
        irradiance: (count >= LEAST_SAMPLES).then(|| sum / count as f32),
    };
    sums.into_iter().map(patch).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;
    use std::path::Path;

    use glam::{DVec3, Vec2};

    use super::*;
    use crate::light::sides::Sides;
    use crate::math::random::{KroneckerSequence, Random};
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

    /// Mean luminance-like sum of channels at every point, by sixteen paths.
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
        let (cache, rays) = IrradianceCache::new(&world, &points, 16, 0.25, &PathSettings::default(), 3);
        assert!(cache.patches.iter().filter(|patch| patch.irradiance.is_some()).count() > 50 && rays.total() > 32_000);
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
        let (cache, _) = IrradianceCache::new(&world, &points, 16, 0.1, &PathSettings::default(), 3);
        let [whole, short] = [None, Some(&cache)].map(|cache| light(&world, &points, cache, 5));
        let sum = |of: &[DVec3]| of.iter().map(|light| light.element_sum()).sum::<f64>();
        let squares: f64 = whole.iter().zip(&short).map(|(a, b)| (*a - *b).element_sum().powi(2)).sum();
        assert!(squares > 0.0, "the cache is used");
        let allowed = 5.0 * squares.sqrt() + 0.01 * sum(&whole);
        assert!((sum(&whole) - sum(&short)).abs() < allowed, "{} {}", sum(&whole), sum(&short));
        let scatter = |of: &[DVec3]| of.iter().map(|light| light.element_sum().powi(2)).sum::<f64>();
        assert!(scatter(&short) < scatter(&whole));
    }

    /// Cells of 0.7 m reach through the wall of 0.1 m between the lit room and the dark one.
    #[test]
    fn no_light_passes_a_wall() {
        let scene = load("two_rooms_sealed.glb");
        let world = World::new(&scene, 1.0, 0.999).unwrap();
        let points = points(&world);
        let (cache, _) = IrradianceCache::new(&world, &points, 16, 0.7, &PathSettings::default(), 3);
        let is_lit: Vec<bool> = light(&world, &points, None, 5).iter().map(|light| *light != DVec3::ZERO).collect();
        assert!(
            is_lit.iter().filter(|lit| **lit).count() > POINTS / 4
                && is_lit.iter().filter(|lit| !**lit).count() > POINTS / 4
        );
        let found = light(&world, &points, Some(&cache), 6);
        for ((light, lit), point) in found.iter().zip(is_lit).zip(&points) {
            assert!(lit || *light == DVec3::ZERO, "{light} at {}", point.position);
        }
    }
}

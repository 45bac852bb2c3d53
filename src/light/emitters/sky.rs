//! The sky as an emitter: bins of directions, each sampled on its own.
//!
//! A place sees a part of the sky: through a window, or above the horizon. So the sky is divided into bins as a scene's
//! lamps are into groups, and every place has its own share for each.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::receiver::Receiver;
use crate::math::alias::AliasTable;
use crate::math::color::luminance;
use crate::scene::Environment;
use crate::scene::environment::EnvironmentMap;

/// Most bins along azimuth and polar angle.
const BINS: [usize; 2] = [8, 4];

/// A sky that is not black.
pub struct Sky {
    bins: Vec<Bin>,
    content: Content,
}

enum Content {
    /// The same radiance everywhere. Bins are equal in solid angle: even in azimuth and in the cosine of the polar angle.
    Uniform(Vec3),
    /// Bins are blocks of texels.
    Map(Map),
}

struct Map {
    width: usize,
    height: usize,
    /// Blocks along azimuth and polar angle.
    blocks: [usize; 2],
    /// What a look along a direction needs, together in memory.
    texels: Vec<Texel>,
}

#[derive(Debug, Clone, Copy)]
#[repr(align(16))]
struct Texel {
    radiance: Vec3,
    /// Density within its bin, sr⁻¹.
    density: f32,
}

struct Bin {
    /// Luminance × solid angle.
    power: f32,
    /// A cone around all of it: axis, and cosine and sine of its half angle.
    axis: Vec3,
    spread: (f32, f32),
    /// Draws a texel of the block, row by row; `None` for a uniform sky.
    texels: Option<AliasTable>,
}

/// A direction in the sky, unit, with its radiance and its density within its bin, sr⁻¹.
#[derive(Debug, Clone, Copy)]
pub struct SkySample {
    pub direction: Vec3,
    pub radiance: Vec3,
    pub density: f32,
}

impl Sky {
    /// `None` if the sky is black.
    pub fn new(environment: &Environment) -> Option<Sky> {
        match environment {
            _ if environment.is_black() => None,
            Environment::None => None,
            Environment::Constant(radiance) => Some(Sky::uniform(*radiance)),
            Environment::Map(map) => Some(Sky::of_map(map)),
        }
    }

    fn uniform(radiance: Vec3) -> Sky {
        let [columns, rows] = BINS;
        let bin = |i: usize| {
            let (column, row) = ((i % columns) as f32, (i / columns) as f32);
            let direction =
                |x: f32, y: f32| cylinder(Vec2::new((column + x) / columns as f32, (row + y) / rows as f32));
            let power = luminance(radiance) * 4.0 * PI / (columns * rows) as f32;
            Bin::around(power, direction(0.5, 0.5), &direction, None)
        };
        Sky { bins: (0..columns * rows).map(bin).collect(), content: Content::Uniform(radiance) }
    }

    fn of_map(map: &EnvironmentMap) -> Sky {
        let (width, height) = (map.width, map.height);
        let blocks = [BINS[0].min(width), BINS[1].min(height)];
        let mut texels: Vec<Texel> = map.texels.iter().map(|&radiance| Texel { radiance, density: 0.0 }).collect();
        let mut bins = Vec::new();
        for i in 0..blocks[0] * blocks[1] {
            let [columns, rows] = block(blocks, [width, height], i);
            let inside = || rows.clone().flat_map(|y| columns.clone().map(move |x| (y * width + x, y)));
            let weight = |(t, y): (usize, usize)| f64::from(luminance(map.texels[t]) * texel_solid_angle(map, y));
            let weights: Vec<f64> = inside().map(weight).collect();
            let total: f64 = weights.iter().sum();
            // `None` where the block is black.
            let Some(alias) = AliasTable::new(&weights) else {
                bins.push(Bin { power: 0.0, axis: Vec3::Y, spread: (-1.0, 0.0), texels: None });
                continue;
            };
            for ((t, y), weight) in inside().zip(&weights) {
                texels[t].density = (weight / total) as f32 / texel_solid_angle(map, y);
            }
            let direction = |x: f32, y: f32| {
                let along = |range: &std::ops::Range<usize>, f: f32| range.start as f32 + f * range.len() as f32;
                let uv = Vec2::new(along(&columns, x) / width as f32, along(&rows, y) / height as f32);
                EnvironmentMap::direction(uv)
            };
            bins.push(Bin::around(total as f32, direction(0.5, 0.5), &direction, Some(alias)));
        }
        Sky { bins, content: Content::Map(Map { width, height, blocks, texels }) }
    }

    /// Whether its radiance is the same everywhere.
    pub fn is_uniform(&self) -> bool {
        matches!(self.content, Content::Uniform(_))
    }

    /// Number of bins.
    pub fn bins(&self) -> usize {
        self.bins.len()
    }

    /// Luminance of the irradiance that a bin may send to the receiver if nothing occludes it: an estimate, and 0 only where
    /// it sends none.
    pub fn importance(&self, bin: usize, receiver: &Receiver) -> f32 {
        let Bin { power, axis, spread: (cos, sin), .. } = self.bins[bin];
        if !receiver.has_normal() {
            return power;
        }
        let cosine = receiver.normal.dot(axis);
        let nearest = if cosine >= cos { 1.0 } else { cosine * cos + (1.0 - cosine * cosine).max(0.0).sqrt() * sin };
        // Blocks are known to a few roundings.
        if nearest <= -1e-3 { 0.0 } else { power * nearest.max(1e-3) }
    }

    /// A direction of a bin from uniform random bits and a uniform point of the unit square. `None` where the bin is black.
    #[inline]
    pub fn sample(&self, environment: &Environment, bin: usize, bits: [u32; 2], place: Vec2) -> Option<SkySample> {
        match (&self.content, environment) {
            (Content::Map(sky), Environment::Map(_)) => {
                let [columns, rows] = block(sky.blocks, [sky.width, sky.height], bin);
                let drawn = self.bins[bin].texels.as_ref()?.draw(bits);
                let (x, y) = (columns.start + drawn % columns.len(), rows.start + drawn / columns.len());
                // Uniform by solid angle within the texel, which means uniform in the cosine of the polar angle.
                let cos_of = |row: usize| (row as f32 / sky.height as f32 * PI).cos();
                let cosine = cos_of(y) + (cos_of(y + 1) - cos_of(y)) * place.y;
                let u = (x as f32 + place.x) / sky.width as f32;
                let direction = EnvironmentMap::direction(Vec2::new(u, cosine.clamp(-1.0, 1.0).acos() / PI));
                let Texel { radiance, density } = sky.texels[y * sky.width + x];
                Some(SkySample { direction, radiance, density })
            }
            (Content::Uniform(radiance), _) => {
                let [columns, rows] = BINS;
                let corner = Vec2::new((bin % columns) as f32, (bin / columns) as f32);
                let direction = cylinder((corner + place) / Vec2::new(columns as f32, rows as f32));
                Some(SkySample { direction, radiance: *radiance, density: self.density_of_uniform() })
            }
            _ => None,
        }
    }

    /// The radiance along a unit direction, its bin, and the density there within the bin, sr⁻¹.
    #[inline]
    pub fn along(&self, environment: &Environment, direction: Vec3) -> (Vec3, usize, f32) {
        match (&self.content, environment) {
            (Content::Map(sky), Environment::Map(map)) => {
                let index = map.texel_index(direction);
                let Texel { radiance, density } = sky.texels[index];
                let (x, y) = (index % sky.width, index / sky.width);
                // The block whose range holds the index; see [`block`].
                let of = |i: usize, blocks: usize, n: usize| ((i + 1) * blocks - 1) / n;
                let bin = of(y, sky.blocks[1], sky.height) * sky.blocks[0] + of(x, sky.blocks[0], sky.width);
                (radiance, bin, density)
            }
            (Content::Uniform(radiance), _) => {
                let [columns, rows] = BINS;
                let at = on_cylinder(direction) * Vec2::new(columns as f32, rows as f32);
                let (column, row) = ((at.x as usize).min(columns - 1), (at.y as usize).min(rows - 1));
                (*radiance, row * columns + column, self.density_of_uniform())
            }
            _ => (Vec3::ZERO, 0, 0.0),
        }
    }

    fn density_of_uniform(&self) -> f32 {
        self.bins.len() as f32 / (4.0 * PI)
    }
}

impl Bin {
    /// `direction` gives points of the bin for coordinates from 0 to 1.
    fn around(power: f32, axis: Vec3, direction: &dyn Fn(f32, f32) -> Vec3, texels: Option<AliasTable>) -> Bin {
        /// Points along each side. Blocks at a pole or of half the sky have their farthest point within an edge.
        const POINTS: usize = 9;
        let at = |i: usize| i as f32 / (POINTS - 1) as f32;
        let points = (0..POINTS * POINTS).map(|i| direction(at(i % POINTS), at(i / POINTS)));
        let cosine = points.map(|d| axis.dot(d)).fold(1.0, f32::min);
        Bin { power, axis, spread: (cosine, (1.0 - cosine * cosine).max(0.0).sqrt()), texels }
    }
}

/// Columns and rows of a block.
fn block(blocks: [usize; 2], size: [usize; 2], i: usize) -> [std::ops::Range<usize>; 2] {
    let range = |k: usize, axis: usize| k * size[axis] / blocks[axis]..(k + 1) * size[axis] / blocks[axis];
    [range(i % blocks[0], 0), range(i / blocks[0], 1)]
}

/// Unit direction of a point of the unit square: azimuth around +Y, and height from −1 to 1. Keeps areas
/// (Archimedes). Inverse of [`on_cylinder`].
fn cylinder(p: Vec2) -> Vec3 {
    let height = 2.0 * p.y - 1.0;
    let radius = (1.0 - height * height).max(0.0).sqrt();
    let (sin, cos) = ((p.x - 0.5) * TAU).sin_cos();
    Vec3::new(radius * sin, height, -radius * cos)
}

/// Point of the unit square of a unit direction. Inverse of [`cylinder`].
fn on_cylinder(direction: Vec3) -> Vec2 {
    Vec2::new(0.5 + direction.x.atan2(-direction.z) / TAU, 0.5 + 0.5 * direction.y)
}

/// Solid angle of a texel in this row of the map, sr.
fn texel_solid_angle(map: &EnvironmentMap, row: usize) -> f32 {
    let edge = |row: usize| (row as f64 / map.height as f64 * std::f64::consts::PI).cos();
    ((edge(row) - edge(row + 1)) * std::f64::consts::TAU / map.width as f64) as f32
}

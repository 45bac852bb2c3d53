//! Visibility from tiles of distance: means and deviations as shares of the way to a box around the probe.
//!
//! A tile has rays of its own, one through every texel's centre. Their distances are clamped to d_max(ω), the way along ω
//! to the box of one spacing on either side of the probe (of its own cell in mixed grids), which a miss takes; mean and
//! deviation are over 3×3 texels under the lobe max(0, ω·ω′)^k. Stored are `μ/d_max` and `max(σ/d_max, 1/65535)`, both u16;
//! a look-up multiplies by the d_max of its own direction. The bilinear look-up takes the deviation as it is, without what
//! the means of the four texels differ by. Source: Fei Yang, *Mixed-resolution Grid of Light Probes*, 2023.

use glam::{Vec2, Vec3};
use safetensors::Dtype;
use serde::{Deserialize, Serialize};

use super::encode::{u16_from_unit, unit_from_u16};
use super::irradiance::texel_directions;
use super::map::{OctahedralMaps, fill_with_border};
use crate::math::octahedral::{oct_from_direction, wrap_texel};
use crate::math::statistics::Moments;
use crate::probe::container::{Container, EncodingLosses};
use crate::probe::lattice::{Grid, ProbeIndex};

/// How tiles are traced and filtered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TileStore {
    /// Interior texels per side, each with a ray.
    pub resolution: usize,
    /// Exponent k of the lobe.
    pub exponent: f32,
}

impl Default for TileStore {
    fn default() -> Self {
        TileStore { resolution: 16, exponent: 50.0 }
    }
}

/// Mean and deviation as two u16 per texel.
const TEXEL_BYTES: usize = 4;

impl TileStore {
    /// Bytes of one probe in the layout that shading uses.
    pub fn runtime_bytes(&self, border: usize) -> usize {
        (self.resolution + 2 * border).pow(2) * TEXEL_BYTES
    }
}

/// Tiles of all probes.
#[derive(Debug, Clone, PartialEq)]
pub struct Tiles {
    /// Mean and deviation of distance as shares of d_max.
    pub maps: OctahedralMaps<Vec2>,
    /// That of the lobe that they were filtered under.
    exponent: f32,
}

/// The way from a probe along a direction, unit, to the faces of its box, metres; `sides` are half of the box's.
#[inline]
pub fn way_to_box(direction: Vec3, sides: Vec3) -> f32 {
    // A direction along an axis never meets the faces of the others: infinitely far.
    (sides / direction.abs()).min_element()
}

/// Half the sides of a probe's box, metres.
#[inline]
pub fn box_sides(grid: &Grid, probe: ProbeIndex) -> Vec3 {
    grid.spacing() * grid.width(probe) as f32
}

impl Tiles {
    pub fn store(&self) -> TileStore {
        TileStore { resolution: self.maps.resolution, exponent: self.exponent }
    }

    /// What collects tiles of this kind on another grid.
    pub fn builder(&self, grid: &Grid) -> TilesBuilder {
        TilesBuilder::new(&self.store(), grid, self.maps.border)
    }

    /// Mean and deviation of distance along a direction, unit, metres.
    #[inline]
    pub fn distance(&self, probe: usize, direction: Vec3, sides: Vec3) -> Vec2 {
        let shares = self.maps.sample(probe, &self.maps.taps(oct_from_direction(direction)));
        shares * way_to_box(direction, sides)
    }

    /// How far a point is seen, 0 to 1: σ²/(σ² + (s·(d − μ))²) behind the mean distance μ, 1 before it. `steepness` s is the
    /// width of the probe's cell in the finest: what a coarse tile blurs is not to leak. The point counts as nearer by
    /// `shorter`, metres.
    #[inline]
    pub fn visibility(&self, probe: usize, from_probe: Vec3, sides: Vec3, steepness: f32, shorter: f32) -> f32 {
        let distance = from_probe.length();
        if distance == 0.0 {
            return 1.0;
        }
        let Vec2 { x: mean, y: deviation } = self.distance(probe, from_probe / distance, sides);
        let excess = steepness * (distance - shorter - mean);
        if excess <= 0.0 {
            return 1.0;
        }
        let variance = deviation * deviation;
        variance / (variance + excess * excess)
    }

    /// Writes the tiles.
    pub fn write(&self, container: &mut Container, losses: &mut EncodingLosses) {
        let side = self.maps.side();
        let probes = self.maps.texels.len() / (side * side);
        let codes = self.maps.texels.iter().flat_map(|t| [u16_from_unit(t.x), u16_from_unit(t.y)]);
        let codes: Vec<u16> = codes.collect();
        losses.variance_floor_hits += codes.iter().skip(1).step_by(2).filter(|&&code| code <= 1).count() as u64;
        container.put(TENSOR, Dtype::U16, &[probes, side, side, 2], codes.into_iter().map(u16::to_le_bytes));
        container.metadata.insert(ENCODING.to_owned(), CELL_BOX.to_owned());
        container.put_json(EXPONENT, &self.exponent);
    }

    /// Reads the tiles; inverse of [`Self::write`] up to rounding.
    ///
    /// # Errors
    /// What is missing or out of range.
    pub fn read(container: &Container, probes: usize, border: usize) -> Result<Tiles, String> {
        let tensor = container.tensor(TENSOR, &[Dtype::U16], &[Some(probes), None, None, Some(2)])?;
        let resolution = tensor.map_resolution(TENSOR, border)?;
        let units: Vec<f32> = tensor.u16s().map(unit_from_u16).collect();
        let texels = units.as_chunks::<2>().0.iter().map(|t| Vec2::from(*t)).collect();
        let exponent: f32 = container.json(EXPONENT)?;
        if !(1.0..=1e4).contains(&exponent) {
            return Err(format!("metadata '{EXPONENT}' is {exponent}"));
        }
        Ok(Tiles { maps: OctahedralMaps { resolution, border, texels }, exponent })
    }
}

/// Least deviation, as a share of d_max: one step of its code.
const LEAST_DEVIATION: f32 = 1.0 / 65_535.0;

/// Names in the file.
const TENSOR: &str = "distance";
const ENCODING: &str = "encoding.distance";
const EXPONENT: &str = "distance.exponent";
const CELL_BOX: &str = "cell_box";

/// Whether a file holds tiles.
pub fn is_in(container: &Container) -> bool {
    container.has(TENSOR) && container.metadata.get(ENCODING).is_some_and(|encoding| encoding == CELL_BOX)
}

/// The tiles of all probes while they are captured.
pub struct TilesBuilder {
    grid: Grid,
    directions: Vec<Vec3>,
    /// Per texel the 3×3 around it, with their weights.
    neighbours: Vec<[(usize, f32); 9]>,
    maps: OctahedralMaps<Vec2>,
    exponent: f32,
}

impl TilesBuilder {
    pub fn new(store: &TileStore, grid: &Grid, border: usize) -> TilesBuilder {
        let n = store.resolution;
        let directions = texel_directions(n);
        let neighbours = |o: usize| {
            std::array::from_fn(|i| {
                let (dx, dy) = (i as isize % 3 - 1, i as isize / 3 - 1);
                let (column, row) = wrap_texel((o % n) as isize + dx, (o / n) as isize + dy, n);
                let neighbour = row * n + column;
                (neighbour, directions[o].dot(directions[neighbour]).max(0.0).powf(store.exponent))
            })
        };
        let neighbours = (0..n * n).map(neighbours).collect();
        let maps = OctahedralMaps::new(grid.probe_count(), n, border, Vec2::ZERO);
        TilesBuilder { grid: grid.clone(), directions, neighbours, maps, exponent: store.exponent }
    }

    /// The rays of a probe's tile, each with the longest distance that counts, metres.
    pub fn rays(&self, probe: usize) -> Vec<(Vec3, f32)> {
        let sides = box_sides(&self.grid, ProbeIndex(probe as u32));
        self.directions.iter().map(|&d| (d, way_to_box(d, sides))).collect()
    }

    /// A probe's tile from the distances along [`Self::rays`], metres.
    pub fn filter(&self, probe: usize, distances: &[Moments]) -> Vec<Vec2> {
        let texel = |(neighbours, (_, way)): (&[(usize, f32); 9], (Vec3, f32))| {
            let mut sum = Moments::default();
            neighbours.iter().for_each(|&(o, weight)| sum.add(distances[o].mean(), f64::from(weight)));
            let share = 1.0 / f64::from(way);
            let (mean, deviation) = ((sum.mean() * share) as f32, (sum.variance().sqrt() * share) as f32);
            // Neighbours may reach farther than this texel's own way.
            Vec2::new(mean.min(1.0), deviation.clamp(LEAST_DEVIATION, 1.0))
        };
        self.neighbours.iter().zip(self.rays(probe)).map(texel).collect()
    }

    /// Keeps what [`Self::filter`] gave for a probe.
    pub fn set(&mut self, probe: usize, filtered: &[Vec2]) {
        fill_with_border(filtered, self.maps.resolution, self.maps.border, self.maps.probe_mut(probe));
    }

    /// Keeps a tile of another volume, of the same size.
    pub fn copy(&mut self, probe: usize, from: &Tiles, source: usize) {
        self.maps.probe_mut(probe).copy_from_slice(from.maps.probe(source));
    }

    pub fn finish(self) -> Tiles {
        Tiles { maps: self.maps, exponent: self.exponent }
    }
}

#[cfg(test)]
mod tests;

//! A probe's rays before they are traced, row by row.

use std::f32::consts::PI;

use glam::{UVec2, Vec2, Vec3};

use super::cube::{self, CUBE_FACES};
use super::rays::Rays;
use crate::math::fibonacci;
use crate::math::octahedral::{direction_and_density, oct_from_direction, solid_angle_density};
use crate::math::random::{KroneckerSequence, Random, unit_from_bits};

/// One of the rays through a texel.
#[derive(Clone, Copy)]
pub struct TexelRay {
    pub texel: u32,
    /// Unit.
    pub direction: Vec3,
    /// Rays of the probe per solid angle there, sr⁻¹.
    pub density: f32,
    /// Share of the texel's solid angle that the ray stands for, against the texel's other rays.
    pub share: f32,
}

/// The rays of one probe before they are traced, row by row.
pub enum Pattern<'c> {
    Octahedral(Layout<'c>),
    Fibonacci { count: usize },
    Cube { face: u32 },
}

impl Rays {
    /// The rays of a probe; with `counts` so many through each texel of an octahedral map.
    pub(super) fn pattern<'c>(&self, counts: Option<&'c [u16]>) -> Pattern<'c> {
        match self {
            Rays::Octahedral(rays) => Pattern::Octahedral(Layout {
                resolution: rays.resolution as u32,
                per_texel: rays.per_texel.max(1) as u32,
                centred: rays.centred,
                counts,
            }),
            Rays::Fibonacci(rays) => Pattern::Fibonacci { count: rays.count },
            Rays::Cube(rays) => Pattern::Cube { face: rays.face as u32 },
        }
    }
}

impl Pattern<'_> {
    /// Texels that hits fall into before any resampling.
    pub fn texels(&self) -> usize {
        match self {
            Pattern::Octahedral(layout) => (layout.resolution * layout.resolution) as usize,
            Pattern::Fibonacci { count } => *count,
            Pattern::Cube { face } => CUBE_FACES * (face * face) as usize,
        }
    }

    /// Rows of texels that [`Self::rays`] gives.
    pub fn rows(&self) -> u32 {
        match self {
            Pattern::Octahedral(layout) => layout.rows(),
            Pattern::Fibonacci { .. } => 1,
            Pattern::Cube { face } => CUBE_FACES as u32 * face,
        }
    }

    /// The tile of sixteen texels that holds a texel, neighbours where the pattern has them, and its place there.
    pub fn tile(&self, texel: u32) -> (u32, u32) {
        let of_rows = |width: u32| {
            let (x, y) = (texel % width, texel / width);
            (y / 4 * width.div_ceil(4) + x / 4, y % 4 * 4 + x % 4)
        };
        match self {
            Pattern::Octahedral(layout) => of_rows(layout.resolution),
            Pattern::Fibonacci { .. } => (texel / 16, texel % 16),
            Pattern::Cube { face } => of_rows(*face),
        }
    }

    /// Rays of a probe per solid angle in a direction, sr⁻¹.
    pub fn density(&self, direction: Vec3) -> f32 {
        match self {
            Pattern::Octahedral(layout) => layout.density(direction),
            Pattern::Fibonacci { count } => *count as f32 / (4.0 * PI),
            Pattern::Cube { face } => cube::density(direction, *face),
        }
    }

    /// Rays through a row of texels, appended to `rays`.
    pub fn rays(&self, row: u32, random: &mut Random, rays: &mut Vec<TexelRay>) {
        let alone =
            |texel: u32, direction: Vec3| TexelRay { texel, direction, density: self.density(direction), share: 1.0 };
        match self {
            Pattern::Octahedral(layout) => layout.rays(row, random, rays),
            Pattern::Fibonacci { count } => {
                rays.extend((0..*count).map(|i| alone(i as u32, fibonacci::direction(i, *count))));
            }
            Pattern::Cube { face } => {
                rays.extend((0..*face).map(|x| row * face + x).map(|t| alone(t, cube::direction(t, *face))));
            }
        }
    }
}

/// How rays are laid out in the octahedral square.
pub struct Layout<'c> {
    resolution: u32,
    /// Rays through every texel, unless `counts` says how many.
    per_texel: u32,
    /// Whether lone rays go through texel centres.
    centred: bool,
    counts: Option<&'c [u16]>,
}

impl Layout<'_> {
    /// Rows of texels that [`Self::rays`] gives.
    pub fn rows(&self) -> u32 {
        self.resolution
    }

    /// Rays through a texel per area of the octahedral square.
    fn per_area(&self, texel: u32) -> f32 {
        (self.count(texel) * self.resolution * self.resolution) as f32 / 4.0
    }

    fn count(&self, texel: u32) -> u32 {
        self.counts.map_or(self.per_texel, |counts| u32::from(counts[texel as usize]))
    }

    /// Rays of a probe per solid angle in a direction, sr⁻¹.
    pub fn density(&self, direction: Vec3) -> f32 {
        let oct = oct_from_direction(direction);
        let n = self.resolution;
        let texel = ((oct + 1.0) * (0.5 * n as f32)).max(Vec2::ZERO).as_uvec2().min(UVec2::splat(n - 1));
        self.per_area(texel.y * n + texel.x) / solid_angle_density(oct)
    }

    /// Rays through a row of texels, appended to `rays`: at random within each, several in an even sequence.
    pub fn rays(&self, row: u32, random: &mut Random, rays: &mut Vec<TexelRay>) {
        let texel_size = 2.0 / self.resolution as f32;
        for column in 0..self.resolution {
            let corner = UVec2::new(column, row).as_vec2() * texel_size - 1.0;
            let texel = row * self.resolution + column;
            let per_area = self.per_area(texel);
            let ray = |place: Vec2| {
                let (direction, solid_angle) = direction_and_density(corner + place * texel_size);
                TexelRay { texel, direction, density: per_area / solid_angle, share: 1.0 }
            };
            let first = rays.len();
            match self.count(texel) {
                1 if self.centred => rays.push(ray(Vec2::splat(0.5))),
                1 => rays.push(ray(Vec2::new(random.uniform(), random.uniform()))),
                count => {
                    let places = KroneckerSequence::new(random).take(count as usize);
                    rays.extend(places.map(|[x, y, ..]| ray(Vec2::new(unit_from_bits(x), unit_from_bits(y)))));
                    // Solid angles are the inverse of densities.
                    let inverse_sum = 1.0 / rays[first..].iter().map(|r| 1.0 / r.density).sum::<f32>();
                    rays[first..].iter_mut().for_each(|r| r.share = inverse_sum / r.density);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::capture::OctahedralRays;

    #[test]
    fn every_texel_has_a_place_of_its_own_in_a_tile_of_neighbours() {
        for resolution in [4, 6, 16, 21] {
            let rays = Rays::Octahedral(OctahedralRays { resolution, ..Default::default() });
            let pattern = rays.pattern(None);
            let n = resolution as u32;
            let tiles: Vec<(u32, u32)> = (0..n * n).map(|texel| pattern.tile(texel)).collect();
            let mut sorted = tiles.clone();
            sorted.sort_unstable();
            sorted.dedup();
            assert_eq!(sorted.len(), tiles.len(), "{resolution}");
            assert!(tiles.iter().all(|(_, place)| *place < 16));
            for (a, b) in (0..n * n).flat_map(|a| (0..n * n).map(move |b| (a, b))) {
                if tiles[a as usize].0 == tiles[b as usize].0 {
                    let apart = UVec2::new(a % n, a / n).as_ivec2() - UVec2::new(b % n, b / n).as_ivec2();
                    assert!(apart.abs().max_element() < 4, "{resolution}: {a} and {b}");
                }
            }
        }
    }
}

//! Where a probe's rays go, and the texels that they are kept in.

use std::f32::consts::PI;

use glam::{UVec2, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use super::cube::{self, CUBE_FACES, Resampling};
use crate::math::fibonacci;
use crate::math::octahedral::{direction_and_density, oct_from_direction, solid_angle_density};
use crate::math::random::Random;
use crate::probe::store::kernel::Directions;

/// The rays of one probe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rays {
    /// Stratified over the texels of an octahedral map, jittered within each.
    Octahedral(OctahedralRays),
    /// Spherical Fibonacci points: each ray is a texel of its own.
    Fibonacci(FibonacciRays),
    /// Through the texels of the six faces of a cube, kept or resampled to an octahedral map, see [`super::cube`].
    Cube(CubeRays),
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FibonacciRays {
    pub count: usize,
}

impl Default for FibonacciRays {
    /// The number of Majercik et al. 2021 and of their SDK.
    fn default() -> Self {
        FibonacciRays { count: 256 }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CubeRays {
    /// Texels per side of a face.
    pub face: usize,
    /// Texels per side of the octahedral map; `None`: the cube's own texels are kept.
    pub resolution: Option<usize>,
    /// Exponent k of the weights max(0, d·d′)^k by which texels of the cube count for one of the map.
    pub sharpness: f32,
}

impl Default for CubeRays {
    /// The resolutions of Luo 2022. It publishes no exponent. Under this lobe, 1/√k = 0.022 rad wide, sums over the map's
    /// texels, up to Δ = 0.036 rad wide, are the same wherever a small lamp lies, up to 2·exp(−2π²/(k·Δ²)) = 0.1 %; at 4096
    /// it would be 5 %.
    fn default() -> Self {
        CubeRays { face: 256, resolution: Some(128), sharpness: 2048.0 }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OctahedralRays {
    /// Texels per side of the G-buffer.
    pub resolution: usize,
    /// Stratified rays per texel.
    pub per_texel: usize,
}

impl Default for OctahedralRays {
    fn default() -> Self {
        OctahedralRays { resolution: 32, per_texel: 1 }
    }
}

impl Default for Rays {
    fn default() -> Self {
        Rays::Octahedral(OctahedralRays::default())
    }
}

impl Rays {
    /// Texels that a probe's hits are kept in.
    pub fn texels(&self) -> usize {
        match self {
            Rays::Octahedral(rays) => rays.resolution * rays.resolution,
            Rays::Fibonacci(rays) => rays.count,
            Rays::Cube(rays) => rays.resolution.map_or(self.count(), |n| n * n),
        }
    }

    /// Rays of one probe.
    pub fn count(&self) -> usize {
        match self {
            Rays::Octahedral(rays) => self.texels() * rays.per_texel.max(1),
            Rays::Fibonacci(rays) => rays.count,
            Rays::Cube(rays) => CUBE_FACES * rays.face * rays.face,
        }
    }

    /// Most surfaces that are kept of one probe.
    pub fn kept(&self) -> usize {
        if let Rays::Cube(_) = self { self.texels() } else { self.count() }
    }

    /// Texels per side of the octahedral map that hits are kept in; `None` where they make none.
    pub fn side(&self) -> Option<usize> {
        match self {
            Rays::Octahedral(rays) => Some(rays.resolution),
            Rays::Fibonacci(_) => None,
            Rays::Cube(rays) => rays.resolution,
        }
    }

    /// What filters over the texels integrate over.
    pub fn directions(&self) -> Directions {
        match self {
            Rays::Octahedral(rays) => Directions::octahedral(rays.resolution),
            Rays::Fibonacci(rays) => {
                Directions::even((0..rays.count).map(|i| fibonacci::direction(i, rays.count)).collect())
            }
            Rays::Cube(CubeRays { resolution: Some(resolution), .. }) => Directions::octahedral(*resolution),
            Rays::Cube(rays) => Directions::lone(cube::texels(rays.face as u32)),
        }
    }

    pub(super) fn pattern(&self) -> Pattern {
        match self {
            Rays::Octahedral(rays) => {
                Pattern::Octahedral(Layout::octahedral(rays.per_texel.max(1), rays.resolution as u32))
            }
            Rays::Fibonacci(rays) => Pattern::Fibonacci { count: rays.count },
            Rays::Cube(rays) => Pattern::Cube { face: rays.face as u32 },
        }
    }

    /// How texels that were traced become those that are kept; `None` where they are the same.
    pub fn resampling(&self) -> Option<Resampling> {
        if let Rays::Cube(CubeRays { face, resolution: Some(resolution), sharpness }) = self {
            Some(Resampling::new(*face, *resolution, *sharpness))
        } else {
            None
        }
    }

    /// Bytes of [`Self::resampling`], and of what one capture takes before it.
    pub fn resampling_bytes(&self) -> (u64, u64) {
        if let Rays::Cube(CubeRays { face, resolution: Some(resolution), sharpness }) = self {
            Resampling::bytes(*face, *resolution, *sharpness)
        } else {
            (0, 0)
        }
    }

    /// The same without some rays that are kept for placement. Only lone rays can be.
    pub fn without(&self, reserved: usize) -> Rays {
        match self {
            Rays::Fibonacci(rays) => {
                Rays::Fibonacci(FibonacciRays { count: rays.count.saturating_sub(reserved).max(1) })
            }
            Rays::Octahedral(_) | Rays::Cube(_) => self.clone(),
        }
    }

    /// Whether placement may keep some of them for itself.
    pub fn lends_rays(&self) -> bool {
        matches!(self, Rays::Fibonacci(_))
    }

    /// The key that makes captures larger.
    pub fn size_key(&self) -> &'static str {
        match self {
            Rays::Octahedral(_) => "capture.rays.octahedral.resolution",
            Rays::Fibonacci(_) => "capture.rays.fibonacci.count",
            Rays::Cube(_) => "capture.rays.cube.face",
        }
    }

    /// The same with twice the angular resolution, at most `most` texels per side.
    pub fn doubled(&self, most: usize) -> Rays {
        let twice = |n: usize| (2 * n).min(most);
        match self {
            Rays::Octahedral(rays) => {
                Rays::Octahedral(OctahedralRays { resolution: twice(rays.resolution), ..rays.clone() })
            }
            Rays::Fibonacci(rays) => Rays::Fibonacci(FibonacciRays { count: (4 * rays.count).min(MOST_FIBONACCI) }),
            Rays::Cube(rays) => Rays::Cube(CubeRays {
                face: twice(rays.face),
                resolution: rays.resolution.map(twice),
                sharpness: (4.0 * rays.sharpness).min(MOST_SHARPNESS),
            }),
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, most_texels: usize, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        let texels = "use 1 to 1024 texels";
        match self {
            Rays::Octahedral(OctahedralRays { resolution: n, per_texel }) => {
                rule(self.size_key(), n.to_string(), (1..=most_texels).contains(n), texels);
                let holds = (1..=65_536).contains(per_texel);
                rule("capture.rays.octahedral.per_texel", per_texel.to_string(), holds, "use 1 to 65536");
            }
            Rays::Fibonacci(FibonacciRays { count }) => {
                rule(self.size_key(), count.to_string(), (1..=MOST_FIBONACCI).contains(count), "use 1 to 1048576");
            }
            Rays::Cube(CubeRays { face, resolution, sharpness }) => {
                rule(self.size_key(), face.to_string(), (1..=most_texels).contains(face), texels);
                if let Some(n) = resolution {
                    let holds = (1..=most_texels).contains(n);
                    rule("capture.rays.cube.resolution", n.to_string(), holds, "use 1 to 1024 texels, or None");
                }
                let holds = (1.0..=MOST_SHARPNESS).contains(sharpness);
                rule("capture.rays.cube.sharpness", sharpness.to_string(), holds, "use 1 to 1e7");
            }
        }
    }
}

/// Most lone rays of a probe.
const MOST_FIBONACCI: usize = 1 << 20;
/// Beyond this exponent a lobe is narrower than the texels of the largest cube.
const MOST_SHARPNESS: f32 = 1e7;

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
pub enum Pattern {
    Octahedral(Layout),
    Fibonacci { count: usize },
    Cube { face: u32 },
}

impl Pattern {
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
pub struct Layout {
    resolution: u32,
    /// Corner of every stratum of a texel relative to the texel's, in the octahedral square.
    corners: Vec<Vec2>,
    /// Sides of one stratum in the octahedral square.
    size: Vec2,
    /// Rays per area of the octahedral square.
    per_area: f32,
}

impl Layout {
    /// Strata as square as the divisors of `samples` allow.
    fn octahedral(samples: usize, resolution: u32) -> Layout {
        let columns = (1..=samples).take_while(|c| c * c <= samples).filter(|c| samples.is_multiple_of(*c)).last();
        let columns = columns.unwrap_or(1);
        let size = 2.0 / (resolution as f32 * Vec2::new(columns as f32, (samples / columns) as f32));
        let corner = |sample: usize| Vec2::new((sample % columns) as f32, (sample / columns) as f32) * size;
        let per_area = (samples * (resolution * resolution) as usize) as f32 / 4.0;
        Layout { resolution, corners: (0..samples).map(corner).collect(), size, per_area }
    }

    /// Rows of texels that [`Self::rays`] gives.
    pub fn rows(&self) -> u32 {
        self.resolution
    }

    /// Rays of a probe per solid angle in a direction, sr⁻¹.
    pub fn density(&self, direction: Vec3) -> f32 {
        self.per_area / solid_angle_density(oct_from_direction(direction))
    }

    /// Rays through a row of texels, one at random in every stratum, appended to `rays`.
    pub fn rays(&self, row: u32, random: &mut Random, rays: &mut Vec<TexelRay>) {
        let texel_size = 2.0 / self.resolution as f32;
        for column in 0..self.resolution {
            let corner_of_texel = UVec2::new(column, row).as_vec2() * texel_size - 1.0;
            let first = rays.len();
            for stratum in &self.corners {
                let jitter = Vec2::new(random.uniform(), random.uniform());
                let (direction, solid_angle) = direction_and_density(corner_of_texel + stratum + jitter * self.size);
                let (texel, density) = (row * self.resolution + column, self.per_area / solid_angle);
                rays.push(TexelRay { texel, direction, density, share: 1.0 });
            }
            if let [_, _, ..] = rays[first..] {
                // Solid angles are the inverse of densities.
                let inverse_sum = 1.0 / rays[first..].iter().map(|r| 1.0 / r.density).sum::<f32>();
                rays[first..].iter_mut().for_each(|r| r.share = inverse_sum / r.density);
            }
        }
    }
}

//! Where a probe's rays go, and the texels that they are kept in.

use glam::{UVec2, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::math::octahedral::{direction_and_density, oct_from_direction, solid_angle_density};
use crate::math::random::Random;
use crate::probe::store::kernel::Directions;

/// The rays of one probe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rays {
    /// Stratified over the texels of an octahedral map, jittered within each.
    Octahedral(OctahedralRays),
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
        let Rays::Octahedral(rays) = self;
        rays.resolution * rays.resolution
    }

    /// Rays of one probe.
    pub fn count(&self) -> usize {
        let Rays::Octahedral(rays) = self;
        self.texels() * rays.per_texel.max(1)
    }

    /// What filters over the texels integrate over.
    pub fn directions(&self) -> Directions {
        let Rays::Octahedral(rays) = self;
        Directions::octahedral(rays.resolution)
    }

    pub(super) fn layout(&self) -> Layout {
        let Rays::Octahedral(rays) = self;
        Layout::octahedral(rays.per_texel.max(1), rays.resolution as u32)
    }

    /// The key that makes captures larger.
    pub fn size_key(&self) -> &'static str {
        "capture.rays.octahedral.resolution"
    }

    /// The same with twice the angular resolution, at most `most` texels per side.
    pub fn doubled(&self, most: usize) -> Rays {
        let Rays::Octahedral(rays) = self;
        Rays::Octahedral(OctahedralRays { resolution: (2 * rays.resolution).min(most), ..rays.clone() })
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, most_texels: usize, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        let Rays::Octahedral(OctahedralRays { resolution: n, per_texel }) = self;
        rule(self.size_key(), n.to_string(), (1..=most_texels).contains(n), "use 1 to 1024 texels");
        let holds = (1..=65_536).contains(per_texel);
        rule("capture.rays.octahedral.per_texel", per_texel.to_string(), holds, "use 1 to 65536");
    }
}

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

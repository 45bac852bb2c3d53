//! Where a probe's rays go, and the texels that they are kept in.

use serde::{Deserialize, Serialize};

use super::cube::{self, CUBE_FACES, Resampling};
use crate::math::fibonacci;
use crate::probe::store::kernel::Directions;

/// The rays of one probe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rays {
    /// Through the texels of an octahedral map, as many as each is worth.
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
    /// Rays per texel, evenly spread.
    pub per_texel: usize,
    /// Further rays, as many a texel in the mean over all probes, that go where a first solution promises most for them, see
    /// [`super::guide`].
    pub guided: f32,
    /// Whether a lone ray of a texel goes through its centre, as maps that rays march through need it; else at random.
    pub centred: bool,
}

impl Default for OctahedralRays {
    /// Deviation of a probe's mean irradiance between 12 to 30 seeds, mean over lit probes, office at 2 m: 13.5 % without guided
    /// rays; with 1, 1.25 and 1.5 of them 2.3, 1.9 and 1.8 %. The whole bake took 1.07 times the time with 1, 1.13 with 1.25
    /// (against the survey and the even rays of before, two threads). two_rooms_open 1 m, courtyard 2 m, thin_wall 0.75 m, 1 against none:
    /// 0.6, 0.5 and 7 % against 1.5, 1.1 and 17 %.
    fn default() -> Self {
        OctahedralRays { resolution: 32, per_texel: 1, guided: 1.25, centred: false }
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

    /// Rays of one probe, in the mean where some are guided.
    pub fn count(&self) -> usize {
        match self {
            Rays::Octahedral(rays) => {
                self.texels() * rays.per_texel.max(1) + (self.texels() as f32 * rays.guided) as usize
            }
            Rays::Fibonacci(rays) => rays.count,
            Rays::Cube(rays) => CUBE_FACES * rays.face * rays.face,
        }
    }

    /// Most surfaces that are kept of one probe, in the mean where some rays are guided.
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

    /// Texels per side, even rays a texel and guided ones, where there are any.
    pub fn guided(&self) -> Option<(usize, usize, f32)> {
        match self {
            Rays::Octahedral(OctahedralRays { resolution, per_texel, guided, .. }) if *guided > 0.0 => {
                Some((*resolution, (*per_texel).max(1), *guided))
            }
            _ => None,
        }
    }

    /// The same without guided rays.
    pub fn unguided(&self) -> Rays {
        match self {
            Rays::Octahedral(rays) => Rays::Octahedral(OctahedralRays { guided: 0.0, ..rays.clone() }),
            Rays::Fibonacci(_) | Rays::Cube(_) => self.clone(),
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

    /// So many times as many rays through the same texels, where rays have texels; at most as many as there may be.
    pub fn multiplied(&self, times: usize) -> Rays {
        match self {
            Rays::Octahedral(rays) => Rays::Octahedral(OctahedralRays {
                per_texel: (rays.per_texel.max(1) * times).min(MOST_PER_TEXEL),
                guided: (rays.guided * times as f32).min(MOST_GUIDED),
                ..rays.clone()
            }),
            Rays::Fibonacci(rays) => Rays::Fibonacci(FibonacciRays { count: (times * rays.count).min(MOST_FIBONACCI) }),
            Rays::Cube(rays) => {
                let face = (rays.face as f64 * (times as f64).sqrt()).ceil() as usize;
                Rays::Cube(CubeRays { face: face.min(MOST_FACE), ..rays.clone() })
            }
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, most_texels: usize, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        let texels = "use 1 to 1024 texels";
        match self {
            Rays::Octahedral(OctahedralRays { resolution: n, per_texel, guided, .. }) => {
                rule(self.size_key(), n.to_string(), (1..=most_texels).contains(n), texels);
                let holds = (1..=MOST_PER_TEXEL).contains(per_texel);
                rule("capture.rays.octahedral.per_texel", per_texel.to_string(), holds, "use 1 to 65536");
                let holds = (0.0..=MOST_GUIDED).contains(guided);
                rule("capture.rays.octahedral.guided", guided.to_string(), holds, "use 0 to 64");
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

/// Most even rays per texel.
const MOST_PER_TEXEL: usize = 65_536;
/// Most texels per side of a cube's face.
const MOST_FACE: usize = 1024;
/// Most guided rays per texel in the mean.
const MOST_GUIDED: f32 = 64.0;
/// Most lone rays of a probe.
const MOST_FIBONACCI: usize = 1 << 20;
/// Beyond this exponent a lobe is narrower than the texels of the largest cube.
const MOST_SHARPNESS: f32 = 1e7;

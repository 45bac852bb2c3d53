//! Random numbers that depend on their purpose and never on the thread that draws them.

use glam::Vec2;
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;

/// What a stream of random numbers is used for. Streams of different purposes are independent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Jitter of capture rays inside their texel, and the light samples at what they hit.
    Capture = 1,
    /// The same for the captures that guide others.
    Pilot = 10,
    /// The same again where the first of these are unsure.
    SecondPilot = 11,
    /// Light samples at probe centres.
    ProbeEmission = 2,
    /// Rays through a pixel, which translucent surfaces stop by chance.
    Pixel = 3,
    /// Points on surfaces from which visibility is measured.
    SurfaceVisibility = 4,
    /// Paths of the reference.
    Path = 5,
    /// Paths from the points that capture rays hit.
    ProbePaths = 6,
    /// Rays by which places learn which emitters they see.
    Places = 7,
    /// Rotations of the rays of frames.
    FrameRotation = 8,
    /// Rays from captured hits that find the next surface.
    HitRays = 9,
    /// Noise added to a reference, to measure how the reference's own noise changes FLIP.
    FlipReplicate = 16,
    /// Points of free air, and their normals.
    Air = 17,
    /// Paths from points of free air.
    AirPaths = 18,
    /// Shifts of grids against the scene.
    Offsets = 19,
    /// Points that probes are fitted at.
    FitPoints = 20,
    /// Paths from these points.
    FitPaths = 21,
    /// Points on surfaces at which bakes are judged that look for an error.
    HeldOutPoints = 22,
    /// Paths from these points.
    HeldOutPaths = 23,
    /// Bent normals of points of a picture.
    Bent = 24,
    /// Paths from these points.
    BentPaths = 25,
    /// Rays that find where indirect light is kept.
    CacheRays = 26,
    /// Paths that find this light.
    CachePaths = 27,
    /// Glossy rays that are traced in probes.
    GlossyRays = 32,
    /// Paths of exact glossy light.
    GlossyPaths = 33,
    /// Rays for irradiance that are traced in probes.
    DiffuseRays = 34,
}

/// A source of numbers for random decisions: a [`Random`] stream, or a point of an evenly distributed set
/// ([`super::blocks::BlockSample`]).
pub trait Numbers {
    /// Uniform in [0,1).
    fn uniform(&mut self) -> f32;

    /// Uniform over all 32-bit words.
    fn bits(&mut self) -> u32;

    /// Uniform in the unit square, for a decision that takes two dimensions.
    fn pair(&mut self) -> Vec2;
}

/// One stream, named by a seed, a purpose and two indices (probe and texel, pixel and sample, …). Equal names give
/// equal numbers.
#[derive(Debug, Clone)]
pub struct Random(Pcg32);

impl Random {
    pub fn new(seed: u64, purpose: Purpose, a: u64, b: u64) -> Random {
        let key = mix(mix(mix(seed) ^ a) ^ b.rotate_left(32));
        Random(Pcg32::new(key, mix(key ^ purpose as u64)))
    }

    /// Uniform in [0,1), a multiple of 2⁻²⁴.
    #[inline]
    pub fn uniform(&mut self) -> f32 {
        unit_from_bits(self.0.next_u32())
    }

    #[inline]
    pub fn bits(&mut self) -> u32 {
        self.0.next_u32()
    }
}

/// Uniform in [0,1), a multiple of 2⁻²⁴, from uniform bits.
#[inline]
pub fn unit_from_bits(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
}

/// An endless sequence of points that fill the unit cube of four dimensions evenly, from a random start.
///
/// It is a Kronecker sequence: each point is the previous one plus a constant step, modulo 1. The steps are the powers
/// of 1/φ₄, where φ₄ is the positive root of x⁵ = x + 1 (Roberts, *The Unreasonable Effectiveness of Quasirandom
/// Sequences*, 2018). Coordinates are integers in units of 2⁻³², so their overflow is the modulo. Each single point is
/// uniform.
#[derive(Debug, Clone)]
pub struct KroneckerSequence([u32; 4]);

impl KroneckerSequence {
    /// 2³²·φ₄⁻¹ … 2³²·φ₄⁻⁴.
    const STEP: [u32; 4] = [3_679_390_609, 3_152_041_523, 2_700_274_806, 2_313_257_605];

    pub fn new(random: &mut Random) -> KroneckerSequence {
        KroneckerSequence(std::array::from_fn(|_| random.bits()))
    }
}

impl Iterator for KroneckerSequence {
    type Item = [u32; 4];

    /// Never `None`.
    #[inline]
    fn next(&mut self) -> Option<[u32; 4]> {
        let point = self.0;
        self.0 = std::array::from_fn(|i| point[i].wrapping_add(KroneckerSequence::STEP[i]));
        Some(point)
    }
}

impl Numbers for Random {
    #[inline]
    fn uniform(&mut self) -> f32 {
        Random::uniform(self)
    }

    #[inline]
    fn bits(&mut self) -> u32 {
        Random::bits(self)
    }

    #[inline]
    fn pair(&mut self) -> Vec2 {
        let x = Random::uniform(self);
        Vec2::new(x, Random::uniform(self))
    }
}

/// Spreads every input bit over all output bits (the finaliser of SplitMix64; Steele, Lea & Flood 2014).
#[inline]
pub(super) fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

/// A number in [0,1) that depends on three words alone. It serves decisions whose result must not depend on the order
/// in which they are made.
pub fn hash_to_unit(a: u32, b: u32, c: u32) -> f32 {
    let bits = mix(mix((u64::from(a) << 32) | u64::from(b)) ^ u64::from(c));
    (bits >> 40) as f32 * (1.0 / (1u32 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_every_name_part() {
        let first = |seed, purpose, a, b| Random::new(seed, purpose, a, b).bits();
        let base = first(1, Purpose::Capture, 2, 3);
        assert_eq!(base, first(1, Purpose::Capture, 2, 3));
        for other in [
            first(2, Purpose::Capture, 2, 3),
            first(1, Purpose::Pixel, 2, 3),
            first(1, Purpose::Capture, 3, 3),
            first(1, Purpose::Capture, 2, 4),
            first(1, Purpose::Capture, 3, 2),
        ] {
            assert_ne!(base, other);
        }
    }

    #[test]
    fn first_numbers_of_neighbouring_streams_are_uniform() {
        let n = 4096;
        let mean: f64 = (0..n).map(|i| Random::new(7, Purpose::Capture, i, 0).uniform() as f64).sum::<f64>() / n as f64;
        // Standard error 1/√(12·4096) = 0.0045; five of them.
        assert!((mean - 0.5).abs() < 0.0226, "{mean}");
    }

    #[test]
    fn kronecker_points_fill_every_dimension_evenly() {
        let mut random = Random::new(7, Purpose::Capture, 1, 0);
        let n = 4096;
        let points: Vec<[u32; 4]> = KroneckerSequence::new(&mut random).take(n).collect();
        for dimension in 0..4 {
            let mut count = [0; 64];
            points.iter().for_each(|p| count[(p[dimension] >> 26) as usize] += 1);
            // 64 points per interval. Of independent points one count in three deviates by more than 8; here none may.
            assert!(count.iter().all(|c| (56..=72).contains(c)), "dimension {dimension}: {count:?}");
        }
    }
}

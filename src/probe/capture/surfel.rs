//! What a probe keeps of a hit.

use glam::{Vec2, Vec3};

use crate::light::surface::SurfacePoint;
use crate::math::color::luminance;
use crate::math::octahedral::oct_from_direction;
use crate::probe::store::surface::Facing;

/// A captured hit, in few bytes: a capture takes as long to be written to fresh memory as Embree takes for some of its
/// rays, and every bounce reads it all.
///
/// Albedo and radiance are multiplied by the share of its texel's solid angle that the hit stands for, so that a texel's
/// radiance is the sum over its surfels.
#[derive(Debug, Clone, Copy)]
pub struct Surfel {
    /// Relative to the scene's origin.
    pub position: Vec3,
    /// B⁰: radiance reflected from light that did not pass through probes, times the share, W·m⁻²·sr⁻¹.
    pub direct_radiance: Vec3,
    pub texel: u32,
    /// Shading normal, towards the probe.
    normal: PackedNormal,
    /// Albedo times the share, in units of 1/[`ALBEDO_SCALE`].
    albedo: [u16; 3],
    /// Main direction of the geometric normal, towards the probe.
    pub facing: Facing,
}

/// Steps of 1/32767 in `oct` are at most 10⁻⁴ rad: a thousandth of a texel of the maps that are asked.
const NORMAL_SCALE: f32 = i16::MAX as f32;

/// The `oct` of a normal in units of 1/[`NORMAL_SCALE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct PackedNormal([i16; 2]);

impl PackedNormal {
    pub fn of(normal: Vec3) -> PackedNormal {
        let oct = oct_from_direction(normal) * NORMAL_SCALE;
        // Adding a half before truncation rounds.
        PackedNormal([oct.x, oct.y].map(|x| (x + 0.5f32.copysign(x)) as i16))
    }

    pub(super) fn to_bytes(self) -> [u8; 4] {
        let [[a, b], [c, d]] = self.0.map(i16::to_le_bytes);
        [a, b, c, d]
    }

    pub(super) fn of_bytes([a, b, c, d]: [u8; 4]) -> PackedNormal {
        PackedNormal([[a, b], [c, d]].map(i16::from_le_bytes))
    }

    #[inline]
    pub fn oct(self) -> Vec2 {
        Vec2::new(f32::from(self.0[0]), f32::from(self.0[1])) * (1.0 / NORMAL_SCALE)
    }
}

/// Steps of 1/65535, rounded up or down by [`dither`]: at an albedo of 0.999 a bounce that is always too weak by half a step
/// would lose 0.7 % of all light.
const ALBEDO_SCALE: f32 = u16::MAX as f32;

/// What is added before truncation, 0 to 1, evenly spread over the texels: the mean of rounded values is then that of the
/// values themselves. Multiples of the golden ratio's fraction are the evenest sequence there is (Weyl, Kronecker).
fn dither(texel: u32) -> f32 {
    /// 2³²/φ.
    const GOLDEN: u32 = 0x9E37_79B9;
    // The upper 24 bits are exact in f32.
    (texel.wrapping_mul(GOLDEN) >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

const _: () = assert!(size_of::<Surfel>() == 40);

impl Surfel {
    pub fn new(surface: &SurfacePoint, direct_radiance: Vec3, texel: u32, share: f32) -> Surfel {
        // Truncated after dithering.
        let albedo = surface.albedo * (share * ALBEDO_SCALE) + dither(texel);
        Surfel {
            position: surface.position,
            direct_radiance: direct_radiance * share,
            texel,
            normal: PackedNormal::of(surface.shading_normal),
            albedo: [albedo.x as u16, albedo.y as u16, albedo.z as u16],
            facing: Facing::of(surface.geometric_normal),
        }
    }

    /// Shading normal.
    #[inline]
    pub fn normal(&self) -> PackedNormal {
        self.normal
    }

    /// `oct` of the shading normal.
    #[inline]
    pub fn oct(&self) -> Vec2 {
        self.normal.oct()
    }

    /// Albedo times the share.
    #[inline]
    pub fn albedo(&self) -> Vec3 {
        let [r, g, b] = self.albedo.map(f32::from);
        Vec3::new(r, g, b) * (1.0 / ALBEDO_SCALE)
    }

    /// Whether both look the same probes up around the same normal, if their positions do.
    pub fn is_like(&self, other: &Surfel) -> bool {
        (self.texel, self.normal, self.facing) == (other.texel, other.normal, other.facing)
    }

    /// Adds a hit of the same kind, and lets one of the two stand for both: which it is, `chance` (uniform, below 1) decides by
    /// the light that each reflects. The mean of what bounces is that of two surfels, and direct light is the sum. Returns
    /// whether it is the new one.
    pub fn join(&mut self, other: &Surfel, chance: f32) -> bool {
        let (known, new) = (luminance(self.albedo()), luminance(other.albedo()));
        let takes_place = chance * (known + new) >= known;
        self.direct_radiance += other.direct_radiance;
        for (sum, albedo) in self.albedo.iter_mut().zip(other.albedo) {
            *sum = sum.saturating_add(albedo);
        }
        if takes_place {
            self.position = other.position;
        }
        takes_place
    }

    /// Size in a file: without the padding of memory.
    pub(super) const BYTES: usize = 39;

    /// Little-endian, in the order of the fields. Inverse: [`Self::of_bytes`].
    pub(super) fn to_bytes(self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        let numbers = self.position.to_array().into_iter().chain(self.direct_radiance.to_array()).map(f32::to_bits);
        let numbers = numbers.chain([self.texel]).map(u32::to_le_bytes);
        bytes.as_chunks_mut::<4>().0.iter_mut().zip(numbers).for_each(|(to, number)| *to = number);
        bytes[28..32].copy_from_slice(&self.normal.to_bytes());
        bytes[32..38].as_chunks_mut::<2>().0.iter_mut().zip(self.albedo).for_each(|(to, a)| *to = a.to_le_bytes());
        bytes[38] = self.facing.index();
        bytes
    }

    /// `None` where the bytes are none of a surfel.
    pub(super) fn of_bytes(bytes: [u8; Self::BYTES]) -> Option<Surfel> {
        let words = bytes.as_chunks::<4>().0;
        let vector = |at: usize| Vec3::from_array([0, 1, 2].map(|i| f32::from_le_bytes(words[at + i])));
        Some(Surfel {
            position: vector(0),
            direct_radiance: vector(3),
            texel: u32::from_le_bytes(words[6]),
            normal: PackedNormal::of_bytes(words[7]),
            albedo: [32, 34, 36].map(|at| u16::from_le_bytes([bytes[at], bytes[at + 1]])),
            facing: *Facing::ALL.get(usize::from(bytes[38]))?,
        })
    }

    /// The same surface in another texel, with the albedo and the direct radiance of that.
    pub fn in_texel(&self, texel: u32, albedo: Vec3, direct_radiance: Vec3) -> Surfel {
        let scaled = albedo * ALBEDO_SCALE + dither(texel);
        Surfel { texel, direct_radiance, albedo: [scaled.x as u16, scaled.y as u16, scaled.z as u16], ..*self }
    }
}

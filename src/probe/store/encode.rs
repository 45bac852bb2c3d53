//! Storage formats of the tensors and what they cost in precision.

use glam::Vec3;
use half::f16;
use safetensors::Dtype;
use serde::{Deserialize, Serialize};

/// Format of a colour's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorFormat {
    F32,
    F16,
    R11G11B10F,
}

impl ColorFormat {
    /// Bytes of one RGB texel.
    pub fn bytes_per_texel(self) -> usize {
        match self {
            ColorFormat::F32 => 12,
            ColorFormat::F16 => 6,
            ColorFormat::R11G11B10F => 4,
        }
    }

    /// Type of the tensor's numbers: one a texel where packed, else three.
    pub fn dtype(self) -> Dtype {
        match self {
            ColorFormat::F32 => Dtype::F32,
            ColorFormat::F16 => Dtype::F16,
            ColorFormat::R11G11B10F => Dtype::U32,
        }
    }

    /// Inverse of [`Self::dtype`].
    pub fn of(dtype: Dtype) -> Option<ColorFormat> {
        [ColorFormat::F32, ColorFormat::F16, ColorFormat::R11G11B10F].into_iter().find(|f| f.dtype() == dtype)
    }

    /// Whether a texel is one number.
    pub fn is_packed(self) -> bool {
        self == ColorFormat::R11G11B10F
    }

    /// Largest relative error of a stored value within the format's range: half a step of the mantissa.
    pub fn rounding(self) -> f64 {
        match self {
            ColorFormat::F32 => 2.0_f64.powi(-24),
            ColorFormat::F16 => 2.0_f64.powi(-11),
            ColorFormat::R11G11B10F => 2.0_f64.powi(-6),
        }
    }

    /// Name in configurations.
    pub fn name(self) -> &'static str {
        match self {
            ColorFormat::F32 => "f32",
            ColorFormat::F16 => "f16",
            ColorFormat::R11G11B10F => "r11g11b10f",
        }
    }

    /// Largest value that every channel can hold.
    pub fn max(self) -> f32 {
        match self {
            ColorFormat::F32 => f32::MAX,
            ColorFormat::F16 => 65_504.0,
            ColorFormat::R11G11B10F => Small::TEN.max(),
        }
    }
}

/// An unsigned float with a 5-bit exponent of bias 15: 11 bits (6 of mantissa) or 10 bits (5).
///
/// Source: Khronos Data Format Specification 1.3, sections 10.3 and 10.4.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Small {
    mantissa_bits: u32,
}

impl Small {
    const ELEVEN: Small = Small { mantissa_bits: 6 };
    const TEN: Small = Small { mantissa_bits: 5 };

    /// Largest finite value: 65,024 and 64,512.
    const fn max(self) -> f32 {
        (2.0 - 1.0 / (1 << self.mantissa_bits) as f32) * 32_768.0
    }

    /// Nearest code, ties to even; negative values and NaN become 0, large ones the maximum.
    fn encode(self, value: f32) -> u32 {
        if value.is_nan() || value <= 0.0 {
            return 0;
        }
        let value = value.min(self.max());
        // Spacing of codes: 2^(e − mantissa bits), e ≥ −14 (below it the denormals keep that of e = −14).
        let exponent = ((value.to_bits() >> 23) as i32 - 127).max(-14);
        let steps = value * 2.0f32.powi(self.mantissa_bits as i32 - exponent);
        // Rounding up to the next power of two carries into the exponent field by itself.
        let rounded = steps.round_ties_even() as u32;
        let field = if rounded < 1 << self.mantissa_bits { 0 } else { (exponent + 15) as u32 };
        let implicit = if field == 0 { 0 } else { 1 << self.mantissa_bits };
        (field << self.mantissa_bits) + (rounded - implicit)
    }

    /// Inverse of [`Self::encode`] up to rounding.
    fn decode(self, code: u32) -> f32 {
        let mantissa = (code & ((1 << self.mantissa_bits) - 1)) as f32;
        let field = (code >> self.mantissa_bits) as i32;
        let unit = 2.0f32.powi(-(self.mantissa_bits as i32));
        match field {
            0 => mantissa * unit * 2.0f32.powi(-14),
            31 => f32::INFINITY,
            _ => (1.0 + mantissa * unit) * 2.0f32.powi(field - 15),
        }
    }
}

/// R in the low 11 bits, G in the next 11, B in the high 10; inverse of [`unpack_r11g11b10f`].
pub fn pack_r11g11b10f(rgb: Vec3) -> u32 {
    Small::ELEVEN.encode(rgb.x) | Small::ELEVEN.encode(rgb.y) << 11 | Small::TEN.encode(rgb.z) << 22
}

/// Inverse of [`pack_r11g11b10f`] up to rounding.
pub fn unpack_r11g11b10f(bits: u32) -> Vec3 {
    Vec3::new(
        Small::ELEVEN.decode(bits & 0x7FF),
        Small::ELEVEN.decode(bits >> 11 & 0x7FF),
        Small::TEN.decode(bits >> 22),
    )
}

/// An encoded colour tensor.
#[derive(Debug, Clone, PartialEq)]
pub struct EncodedColors {
    pub format: ColorFormat,
    /// Little-endian texels.
    pub bytes: Vec<u8>,
    /// Decoded values are multiplied by this power of two.
    pub scale: f32,
    /// Texels with a channel below 0 or above the format's maximum.
    pub clamped: u64,
    /// Texels with a channel above 0 that is too small for the format, and stored as 0.
    pub underflowed: u64,
}

/// Largest stored value is brought below this, which leaves packed floats 30 binary orders below it.
const LARGEST_STORED: f32 = 32_768.0;

/// Values whose maximum is in this range are stored as they are.
const UNSCALED: std::ops::RangeInclusive<f32> = 0.015_625..=LARGEST_STORED;

/// Power of two that brings a tensor with this largest value into the range of 16-bit and packed floats.
pub(super) fn scale_for(largest: f32, format: ColorFormat) -> f32 {
    if format == ColorFormat::F32 || largest == 0.0 || UNSCALED.contains(&largest) {
        return 1.0;
    }
    let exponent = (largest.log2() - LARGEST_STORED.log2()).ceil();
    exponent.clamp(-126.0, 127.0).exp2()
}

/// Encodes texels (in the domain of the irradiance curve); inverse of [`decode_colors`].
pub fn encode_colors(texels: &[Vec3], format: ColorFormat) -> EncodedColors {
    let largest = texels.iter().map(|t| t.max_element()).filter(|v| v.is_finite()).fold(0.0, f32::max);
    let scale = scale_for(largest, format);
    let (mut clamped, mut underflowed) = (0, 0);
    let mut bytes = Vec::with_capacity(texels.len() * format.bytes_per_texel());
    for texel in texels {
        let v = *texel / scale;
        clamped += u64::from(v.min_element() < 0.0 || v.max_element() > format.max() || v.is_nan());
        match format {
            ColorFormat::F32 => v.to_array().into_iter().map(finite).for_each(|c| bytes.extend(c.to_le_bytes())),
            ColorFormat::F16 => {
                let codes = v.min(Vec3::splat(format.max())).to_array().map(f16::from_f32);
                let stored = Vec3::from(codes.map(f16::to_f32));
                underflowed += u64::from(is_lost(v, stored));
                codes.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
            }
            ColorFormat::R11G11B10F => {
                let code = pack_r11g11b10f(v);
                underflowed += u64::from(is_lost(v, unpack_r11g11b10f(code)));
                bytes.extend(code.to_le_bytes());
            }
        }
    }
    EncodedColors { format, bytes, scale, clamped, underflowed }
}

/// Encodes numbers of either sign ÷ `scale`; `f32` where the format has no signs. Inverse of [`decode_colors`].
pub fn encode_signed(numbers: impl Iterator<Item = f32>, format: ColorFormat, scale: f32) -> EncodedColors {
    let mut encoded = EncodedColors { format, bytes: Vec::new(), scale, clamped: 0, underflowed: 0 };
    for number in numbers {
        let scaled = number / scale;
        encoded.clamped += u64::from(scaled.is_nan() || scaled.abs() > format.max());
        let held = if scaled.is_nan() { 0.0 } else { scaled.clamp(-format.max(), format.max()) };
        match format {
            ColorFormat::F16 => {
                let code = f16::from_f32(held);
                encoded.underflowed += u64::from(held != 0.0 && code.to_f32() == 0.0);
                encoded.bytes.extend(code.to_le_bytes());
            }
            ColorFormat::F32 | ColorFormat::R11G11B10F => encoded.bytes.extend(held.to_le_bytes()),
        }
    }
    encoded
}

/// The nearest finite number; 0 for NaN.
fn finite(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(f32::MIN, f32::MAX) }
}

/// Whether any channel above 0 has become 0.
fn is_lost(value: Vec3, stored: Vec3) -> bool {
    (value.cmpgt(Vec3::ZERO) & stored.cmpeq(Vec3::ZERO)).any()
}

/// Inverse of [`encode_colors`] up to rounding; `bytes` must be whole texels.
pub fn decode_colors(bytes: &[u8], format: ColorFormat, scale: f32) -> Vec<Vec3> {
    let texels = bytes.chunks_exact(format.bytes_per_texel());
    let decode = |texel: &[u8]| match format {
        ColorFormat::F32 => {
            let c = |i: usize| f32::from_le_bytes([texel[i], texel[i + 1], texel[i + 2], texel[i + 3]]);
            Vec3::new(c(0), c(4), c(8))
        }
        ColorFormat::F16 => {
            let c = |i: usize| f16::from_le_bytes([texel[i], texel[i + 1]]).to_f32();
            Vec3::new(c(0), c(2), c(4))
        }
        ColorFormat::R11G11B10F => unpack_r11g11b10f(u32::from_le_bytes([texel[0], texel[1], texel[2], texel[3]])),
    };
    texels.map(|t| decode(t) * scale).collect()
}

/// A share of a probe's distance scale in 16 bits: 65535 = 1; inverse of [`unit_from_u16`].
pub fn u16_from_unit(value: f32) -> u16 {
    (value.clamp(0.0, 1.0) * 65_535.0).round() as u16
}

/// Inverse of [`u16_from_unit`].
pub fn unit_from_u16(code: u16) -> f32 {
    f32::from(code) * (1.0 / 65_535.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_code_comes_back() {
        for small in [Small::ELEVEN, Small::TEN] {
            for code in 0..31u32 << small.mantissa_bits {
                assert_eq!(small.encode(small.decode(code)), code);
            }
        }
        assert_eq!(Small::ELEVEN.max(), 65_024.0);
        assert_eq!(Small::TEN.max(), 64_512.0);
    }

    #[test]
    fn ties_go_to_even_and_carry() {
        let eleven = Small::ELEVEN;
        for code in 0..(31u32 << 6) - 1 {
            let middle = 0.5 * (eleven.decode(code) + eleven.decode(code + 1));
            assert_eq!(eleven.encode(middle), code + (code & 1), "between {code} and its next");
        }
    }

    #[test]
    fn odd_values_are_clamped_and_counted() {
        let texels = [Vec3::new(-1.0, 0.0, 0.0), Vec3::new(f32::NAN, 1.0, 1.0), Vec3::ONE];
        let encoded = encode_colors(&texels, ColorFormat::R11G11B10F);
        assert_eq!((encoded.clamped, encoded.underflowed), (2, 0));
        assert_eq!(decode_colors(&encoded.bytes, encoded.format, encoded.scale)[2], Vec3::ONE);
    }

    #[test]
    fn values_too_small_are_counted() {
        let texels = [Vec3::splat(1e9), Vec3::splat(1e-9), Vec3::ZERO];
        for (format, underflowed) in [(ColorFormat::F32, 0), (ColorFormat::F16, 1), (ColorFormat::R11G11B10F, 1)] {
            assert_eq!(encode_colors(&texels, format).underflowed, underflowed, "{format:?}");
        }
    }

    #[test]
    fn extreme_light_is_scaled_into_range() {
        for largest in [1e-9f32, 3e-4, 7.0, 1e9, 3e30] {
            for format in [ColorFormat::F16, ColorFormat::R11G11B10F] {
                let encoded = encode_colors(&[Vec3::splat(largest)], format);
                assert_eq!(encoded.clamped, 0);
                assert_eq!(encoded.scale.log2().fract(), 0.0, "scale is a power of two");
                let back = decode_colors(&encoded.bytes, format, encoded.scale)[0];
                // Half a step of the 5-bit mantissa.
                assert!((back.z / largest - 1.0).abs() <= 1.0 / 64.0, "{largest} came back as {back}");
            }
        }
    }

    proptest! {
        #[test]
        fn packing_is_within_half_a_step(r in 1e-3f32..6e4, g in 1e-3f32..6e4, b in 1e-3f32..6e4) {
            let back = unpack_r11g11b10f(pack_r11g11b10f(Vec3::new(r, g, b)));
            prop_assert!((back.x / r - 1.0).abs() <= 1.0 / 128.0);
            prop_assert!((back.y / g - 1.0).abs() <= 1.0 / 128.0);
            prop_assert!((back.z / b - 1.0).abs() <= 1.0 / 64.0);
        }
    }
}

//! Planes of codes packed into text: predicted, split into bytes, deflated, base64.
//!
//! Layout before deflation (zlib container, RFC 1950), for planes P₀ … of `width · height` codes each: the low bytes of every
//! plane's residuals, plane after plane, then their high bytes likewise. A residual is code − prediction modulo 2¹⁶, its sign moved
//! to the lowest bit (0, −1, 1, −2 … → 0, 1, 2, 3 …). The prediction is the median of left, upper and left + upper − upper-left
//! (M. Weinberger et al., "The LOCO-I Lossless Image Compression Algorithm", 2000, equation 1); outside of the plane stands 0.
//!
//! Undone by `assets/page/codec.js` in the page, and by [`unpack`] in tests.

use std::io::{self, Write};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;

/// Deflate's effort, 0 to 9: from 6 on the size hardly falls and the time doubles.
const EFFORT: u32 = 6;

/// Planes of codes as text; all of `width · height` codes, row 0 at the top.
///
/// # Errors
/// None in practice: the writer is memory.
pub fn pack(planes: &[Vec<i16>], width: usize) -> io::Result<String> {
    let mut bytes = Vec::with_capacity(2 * planes.iter().map(Vec::len).sum::<usize>());
    let residuals: Vec<Vec<u16>> = planes.iter().map(|plane| residuals(plane, width)).collect();
    for shift in [0, 8] {
        bytes.extend(residuals.iter().flatten().map(|residual| (residual >> shift) as u8));
    }
    pack_bytes(&bytes)
}

/// Bytes as text.
///
/// # Errors
/// None in practice: the writer is memory.
pub fn pack_bytes(bytes: &[u8]) -> io::Result<String> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(EFFORT));
    encoder.write_all(bytes)?;
    Ok(STANDARD.encode(encoder.finish()?))
}

/// About how much planes take when packed, in bits, for comparing them at a tenth of the time: of residuals in Elias' γ code.
pub fn cost(planes: &[Vec<i16>], width: usize) -> u64 {
    let bits = |residual: u16| u64::from(2 * (u32::from(residual) + 1).ilog2() + 1);
    planes.iter().flat_map(|plane| residuals(plane, width)).map(bits).sum()
}

fn residuals(plane: &[i16], width: usize) -> Vec<u16> {
    let residual = |(i, &code): (usize, &i16)| {
        let residual = code.wrapping_sub(predict(plane, width, i));
        ((residual << 1) ^ (residual >> 15)) as u16
    };
    plane.iter().enumerate().map(residual).collect()
}

/// The prediction of code `i` from those before it.
fn predict(plane: &[i16], width: usize, i: usize) -> i16 {
    let (first_column, first_row) = (i.is_multiple_of(width), i < width);
    let left = if first_column { 0 } else { plane[i - 1] };
    let upper = if first_row { 0 } else { plane[i - width] };
    let corner = if first_column || first_row { 0 } else { plane[i - width - 1] };
    let sum = i32::from(left) + i32::from(upper) - i32::from(corner);
    sum.clamp(i32::from(left.min(upper)), i32::from(left.max(upper))) as i16
}

/// The inverse of [`pack`]: `count` planes of `width · height` codes. `None` for any other text.
#[cfg(test)]
pub fn unpack(text: &str, count: usize, width: usize, height: usize) -> Option<Vec<Vec<i16>>> {
    let mut bytes = Vec::new();
    let mut decoder = flate2::write::ZlibDecoder::new(&mut bytes);
    decoder.write_all(&STANDARD.decode(text).ok()?).ok()?;
    decoder.finish().ok()?;
    let size = width * height;
    if bytes.len() != 2 * count * size {
        return None;
    }
    let plane = |p: usize| {
        let mut plane = vec![0_i16; size];
        for i in 0..size {
            let at = p * size + i;
            let folded = u16::from(bytes[at]) | u16::from(bytes[count * size + at]) << 8;
            let residual = (folded >> 1) as i16 ^ -((folded & 1) as i16);
            plane[i] = residual.wrapping_add(predict(&plane, width, i));
        }
        plane
    };
    Some((0..count).map(plane).collect())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn planes_come_back(codes in prop::collection::vec(any::<i16>(), 2 * 12), width in prop::sample::select(vec![1_usize, 2, 3, 4, 6, 12])) {
            let planes: Vec<Vec<i16>> = codes.chunks(12).map(<[i16]>::to_vec).collect();
            let text = pack(&planes, width).unwrap();
            prop_assert_eq!(unpack(&text, 2, width, 12 / width), Some(planes));
            prop_assert_eq!(unpack(&text, 3, width, 12 / width), None);
        }
    }

    #[test]
    fn what_costs_less_packs_smaller() {
        // Noise of 2 and of 200 codes.
        let noise = |span: i64| -> Vec<i16> { (0..4096_i64).map(|i| (i * i * 7919 % 10_007 % span) as i16).collect() };
        let [fine, coarse] = [2, 200].map(|span| vec![noise(span)]);
        assert!(2 * cost(&fine, 64) < cost(&coarse, 64));
        assert!(2 * pack(&fine, 64).unwrap().len() < pack(&coarse, 64).unwrap().len());
    }

    #[test]
    fn a_ramp_costs_next_to_nothing() {
        let plane: Vec<i16> = (0..100 * 100).map(|i| (i % 100 + i / 100) as i16).collect();
        assert!(pack(&[plane], 100).unwrap().len() < 400);
    }
}

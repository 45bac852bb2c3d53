//! Files for `IrradianceVolume` of Bevy 0.20: ambient cubes as a 3D texture in KTX2.
//!
//! A volume of Rx × Ry × Rz probes is a texture of Rx × 2Ry × 3Rz texels RGB9E5. The face of the probe (x, y, z) that looks
//! along the axis a (0, 1, 2 for x, y, z), with s = 0 for the positive direction and 1 for the negative, is the texel
//!
//! `(x, y + s·Ry, z + a·Rz)`
//!
//! The crate's documentation has the positive directions in the second half of y; `irradiance_volume.wesl` reads the negative
//! ones there. The shader multiplies the sum by the diffuse colour without dividing by π, so that texels hold E/π.

use std::f32::consts::PI;

use glam::{UVec3, Vec3, Vec3A};
use serde_json::json;

use super::block::Block;
use super::grids::Grids;
use super::record::{File, Number, VolumeRecord};

/// What values are, and which light is to be added to them.
pub const NOTE: &str = "Irradiance ÷ π along +x, −x, +y, −y, +z, −z, linear Rec. 709, W·m⁻²·sr⁻¹ ÷ intensity; axes are \
    glTF's, +Y up, metres. Spawn (LightProbe::default(), IrradianceVolume { voxels, intensity, .. }, Transform) for each \
    volume, with the numbers of `engine`; the camera's exposure scales it as it scales lamps. The volume lights surfaces with \
    all light that bounced, and with that of emissive surfaces and of the sky: add punctual lights with shadows, and \
    no ambient light (GlobalAmbientLight::NONE) or environment map.";

/// Texels along each axis.
fn size(block: &Block) -> UVec3 {
    block.divisions * UVec3::new(1, 2, 3)
}

/// Where the face lies that holds axis `axis`, in its negative direction where `negative`.
fn texel(block: &Block, coordinate: UVec3, axis: u32, negative: bool) -> usize {
    let UVec3 { x, y, z } = block.divisions;
    let row = coordinate.y + if negative { y } else { 0 };
    let slice = coordinate.z + axis * z;
    (coordinate.x + x * (row + 2 * y * slice)) as usize
}

/// Files of one volume's record.
pub fn files(grids: &Grids, block: &Block, record: &mut VolumeRecord) -> Vec<File> {
    let intensity = intensity(grids, block);
    let mut texels = vec![0u32; 6 * block.count()];
    for i in 0..block.count() {
        for (face, value) in grids.of_probe(block.start as usize + i).iter().enumerate() {
            let at = texel(block, block.coordinate(i as u32), face as u32 / 2, face % 2 == 1);
            texels[at] = rgb9e5(Vec3::from(*value) / (PI * intensity));
        }
    }
    record.number = Number::Rgb9e5;
    record.file.push_str(".vxgi.ktx2");
    let (min, max) = (record.min, record.max);
    let each = |of: fn(f64, f64) -> f64| [0, 1, 2].map(|i| of(min[i], max[i]));
    record.engine = json!({
        "translation": each(|low, high| 0.5 * (low + high)),
        "scale": each(|low, high| high - low),
        "intensity": intensity,
    });
    vec![File { name: record.file.clone(), bytes: ktx2(size(block), &texels) }]
}

/// A power of two that brings radiance into the range of the format: 1 wherever it fits.
fn intensity(grids: &Grids, block: &Block) -> f32 {
    const SMALLEST: f32 = 1e-3;
    let n = grids.rules.unknowns();
    let own = &grids.values[block.start as usize * n..][..block.count() * n];
    let largest = own.iter().map(|value| value.max_element()).fold(0.0, f32::max) / PI;
    if largest == 0.0 || (SMALLEST..=LARGEST).contains(&largest) { 1.0 } else { largest.log2().floor().exp2() }
}

/// Gives a block's probes what a file holds; inverse of [`files`] up to rounding.
///
/// # Errors
/// The file is not of this volume.
pub fn read(grids: &mut Grids, block: &Block, record: &VolumeRecord, bytes: &[u8]) -> Result<(), String> {
    let texels = read_ktx2(size(block), bytes).map_err(|what| format!("{}: {what}", record.file))?;
    let intensity = record.engine["intensity"].as_f64().map(|intensity| intensity as f32);
    let Some(intensity) = intensity.filter(|intensity| *intensity > 0.0 && intensity.is_finite()) else {
        return Err(format!("{}: its volume has no intensity", record.file));
    };
    for i in 0..block.count() {
        let of = |face: u32| {
            let at = texel(block, block.coordinate(i as u32), face / 2, face % 2 == 1);
            Vec3A::from(from_rgb9e5(texels[at])) * (PI * intensity)
        };
        let values: [Vec3A; 6] = std::array::from_fn(|face| of(face as u32));
        grids.set_probe(block.start as usize + i, &values);
    }
    Ok(())
}

/// Bits of a mantissa, and what is added to the exponent, of RGB9E5 (Vulkan, *E5B9G9R9_UFLOAT_PACK32*).
const MANTISSA_BITS: i32 = 9;
const BIAS: i32 = 15;

/// Largest number of the format: (2⁹ − 1)/2⁹ · 2¹⁶.
const LARGEST: f32 = 65_408.0;

/// Three numbers from 0 up with one exponent; larger ones become the largest.
pub fn rgb9e5(color: Vec3) -> u32 {
    let color = color.clamp(Vec3::ZERO, Vec3::splat(LARGEST));
    let largest = color.max_element();
    let floor_log2 = if largest > 0.0 { (largest.to_bits() >> 23) as i32 - 127 } else { i32::MIN / 2 };
    let mut exponent = floor_log2.max(-BIAS - 1) + 1 + BIAS;
    let scale = |exponent: i32| ((exponent - BIAS - MANTISSA_BITS) as f32).exp2();
    if (largest / scale(exponent)).round_ties_even() as i32 == 1 << MANTISSA_BITS {
        exponent += 1;
    }
    let mantissa = (color / scale(exponent)).to_array().map(|m| m.round_ties_even() as u32);
    mantissa[0] | mantissa[1] << 9 | mantissa[2] << 18 | (exponent as u32) << 27
}

pub fn from_rgb9e5(bits: u32) -> Vec3 {
    let scale = (((bits >> 27) as i32 - BIAS - MANTISSA_BITS) as f32).exp2();
    Vec3::new((bits & 511) as f32, (bits >> 9 & 511) as f32, (bits >> 18 & 511) as f32) * scale
}

/// First bytes of a KTX 2.0 file.
const IDENTIFIER: [u8; 12] = *b"\xABKTX 20\xBB\r\n\x1A\n";

/// `VK_FORMAT_E5B9G9R9_UFLOAT_PACK32`.
const FORMAT: u32 = 123;

/// Bytes before the data format descriptor: identifier, header, index, index of one level.
const HEAD: usize = 12 + 9 * 4 + 4 * 4 + 2 * 8 + 3 * 8;

/// The data format descriptor of the format (Khronos Data Format Specification 1.3): RGB, Rec. 709, linear; a sample for
/// each mantissa, followed by one for the exponent that all share.
fn descriptor() -> Vec<u8> {
    const SAMPLES: u32 = 6;
    const BLOCK: u32 = 24 + 16 * SAMPLES;
    let mut words = vec![4 + BLOCK, 0, 2 | BLOCK << 16, 1 | 1 << 8 | 1 << 16, 0, 4, 0];
    for channel in 0..3u32 {
        let (exponent, at) = (0x20, 9 * channel);
        words.extend([at | 8 << 16 | channel << 24, 0, 0, 8448]);
        words.extend([27 | 4 << 16 | (channel | exponent) << 24, 0, 15, 31]);
    }
    words.into_iter().flat_map(u32::to_le_bytes).collect()
}

/// A 3D texture without mipmaps.
pub fn ktx2(size: UVec3, texels: &[u32]) -> Vec<u8> {
    let descriptor = descriptor();
    let writer = b"KTXwriter\0lightprobe\0";
    let mut pairs = (writer.len() as u32).to_le_bytes().to_vec();
    pairs.extend(writer);
    pairs.resize(pairs.len().next_multiple_of(4), 0);
    let (pairs_at, data_at) = (HEAD + descriptor.len(), HEAD + descriptor.len() + pairs.len());
    let data_bytes = 4 * texels.len() as u64;
    let mut out = IDENTIFIER.to_vec();
    let header = [FORMAT, 4, size.x, size.y, size.z, 0, 1, 1, 0];
    let index = [HEAD as u32, descriptor.len() as u32, pairs_at as u32, pairs.len() as u32];
    out.extend(header.into_iter().chain(index).flat_map(u32::to_le_bytes));
    out.extend([0, 0, data_at as u64, data_bytes, data_bytes].into_iter().flat_map(u64::to_le_bytes));
    out.extend(descriptor);
    out.extend(pairs);
    out.extend(texels.iter().flat_map(|texel| texel.to_le_bytes()));
    out
}

/// The texels of a file of [`ktx2`].
fn read_ktx2(size: UVec3, bytes: &[u8]) -> Result<Vec<u32>, String> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let long = |at: usize| Some(u64::from(word(at)?) | u64::from(word(at + 4)?) << 32);
    if bytes.get(..12) != Some(&IDENTIFIER) || word(12) != Some(FORMAT) {
        return Err("no KTX2 file of RGB9E5 texels".to_owned());
    }
    let found = [20, 24, 28].map(word);
    if found != size.to_array().map(Some) {
        return Err(format!("a texture of {found:?} texels, not {size}"));
    }
    let expected = 4 * size.to_array().iter().map(|&n| u64::from(n)).product::<u64>();
    let level = long(80).zip(long(88)).filter(|(_, length)| *length == expected);
    let data =
        level.and_then(|(at, length)| bytes.get(usize::try_from(at).ok()?..)?.get(..usize::try_from(length).ok()?));
    let data = data.ok_or_else(|| format!("its texels are not {expected} bytes within the file"))?;
    Ok(data.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect())
}

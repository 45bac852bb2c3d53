//! Files for `LightProbeGridWebGL` and `LightProbeGrid` of three.js (npm `three` 0.187, examples/jsm/lighting).
//!
//! A grid of nx × ny × nz probes is one 3D texture of nx × ny × 7·(nz + 2) texels of four numbers. A probe's nine
//! coefficients of *radiance*, c₀ to c₈ in the order of [`harmonics`], are 27 numbers: r, g, b of each. With a zero behind them
//! these fill seven texels, which lie in seven sub-volumes one behind the other along z:
//!
//! `texel (x, y, t·(nz + 2) + 1 + z) = numbers 4t to 4t + 3 of the probe (x, y, z)`
//!
//! The first and the last slice of each sub-volume repeat their neighbour, so that filtering does not mix sub-volumes. The
//! shader makes E = Σ A·c·Y of it, A being π, 2π/3 and π/4 by band, and divides by π in its Lambertian materials.

use glam::{UVec3, Vec3A};
use half::f16;
use serde_json::json;

use super::block::Block;
use super::grids::Grids;
use super::record::{File, Number, VolumeRecord};
use crate::math::harmonics::{COSINE, COUNT, Y0};

/// Sub-volumes.
const TEXELS: usize = 7;

/// Slices that repeat their neighbour, of each sub-volume.
const PADDING: u32 = 2;

/// Numbers of a texel.
const WIDTH: usize = 4;

const LOADER: &str = include_str!("assets/loadProbes.js");
const PAGE: &str = include_str!("assets/three.html");

/// What values are, and which light is to be added to them.
pub const NOTE: &str = "Spherical harmonics of radiance, linear Rec. 709, W·m⁻²·sr⁻¹; axes are glTF's, +Y up, metres. The grid \
    lights surfaces with all light that bounced, and with that of emissive surfaces and of the sky: add punctual lights with \
    shadows, and no ambient light, environment or light map. Lambertian materials divide by π themselves.";

/// Where number `n` of a probe lies among those of the texture.
fn place(block: &Block, coordinate: UVec3, n: usize) -> usize {
    let UVec3 { x, y, z } = block.divisions;
    let slice = (n / WIDTH) as u32 * (z + PADDING) + 1 + coordinate.z;
    (coordinate.x + x * (coordinate.y + y * slice)) as usize * WIDTH + n % WIDTH
}

/// Texels along each axis.
fn size(block: &Block) -> UVec3 {
    let UVec3 { x, y, z } = block.divisions;
    UVec3::new(x, y, TEXELS as u32 * (z + PADDING))
}

/// Numbers of the texture.
fn count(block: &Block) -> usize {
    size(block).to_array().iter().map(|&n| n as usize).product::<usize>() * WIDTH
}

/// The texture of a block.
pub fn pack(grids: &Grids, block: &Block) -> Vec<f32> {
    let mut out = vec![0.0; count(block)];
    for i in 0..block.count() {
        for (j, value) in grids.of_probe(block.start as usize + i).iter().enumerate() {
            let radiance = *value / (Y0 * COSINE[j]);
            for (channel, number) in radiance.to_array().into_iter().enumerate() {
                out[place(block, block.coordinate(i as u32), 3 * j + channel)] = number;
            }
        }
    }
    let slice = WIDTH * (block.divisions.x * block.divisions.y) as usize;
    for sub_volume in out.chunks_exact_mut(slice * (block.divisions.z + PADDING) as usize) {
        sub_volume.copy_within(slice..2 * slice, 0);
        let last = sub_volume.len() - slice;
        sub_volume.copy_within(last - slice..last, last);
    }
    out
}

/// The numbers as bytes: halves, or floats where halves are too coarse or too small for them.
pub fn encode(numbers: &[f32]) -> (Number, Vec<u8>) {
    /// Below it, halves lose what the largest number has digits for.
    const SMALLEST: f32 = 1e-3;
    let largest = numbers.iter().map(|n| n.abs()).fold(0.0, f32::max);
    if largest == 0.0 || (SMALLEST..=f16::MAX.to_f32()).contains(&largest) {
        return (Number::Half, numbers.iter().flat_map(|n| f16::from_f32(*n).to_le_bytes()).collect());
    }
    (Number::Float, numbers.iter().flat_map(|n| n.to_le_bytes()).collect())
}

/// Files of one volume's record, which gets the type of the numbers.
pub fn files(grids: &Grids, block: &Block, record: &mut VolumeRecord) -> Vec<File> {
    let (number, bytes) = encode(&pack(grids, block));
    record.number = number;
    record.file.push_str(".bin");
    record.engine = json!({ "textureSize": size(block).to_array() });
    vec![File { name: record.file.clone(), bytes }]
}

/// What goes with any export to three.js.
pub fn companions() -> Vec<File> {
    let file = |name: &str, text: &str| File { name: name.to_owned(), bytes: text.as_bytes().to_vec() };
    vec![file("loadProbes.js", LOADER), file("index.html", PAGE)]
}

/// Gives a block's probes what a file holds; inverse of [`files`] up to rounding.
///
/// # Errors
/// The file is not of this volume.
pub fn read(grids: &mut Grids, block: &Block, record: &VolumeRecord, bytes: &[u8]) -> Result<(), String> {
    let count = count(block);
    let size = match record.number {
        Number::Half => 2,
        Number::Float => 4,
        Number::Rgb9e5 => return Err(format!("{}: rgb9e5 cannot hold coefficients", record.file)),
    };
    if bytes.len() != count * size {
        return Err(format!("{} has {} bytes, not {}", record.file, bytes.len(), count * size));
    }
    let number = |i: usize| match record.number {
        Number::Half => f16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]).to_f32(),
        _ => f32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]),
    };
    for i in 0..block.count() {
        let of = |n: usize| number(place(block, block.coordinate(i as u32), n));
        let mut values = [Vec3A::ZERO; COUNT];
        for (j, value) in values.iter_mut().enumerate() {
            *value = Vec3A::new(of(3 * j), of(3 * j + 1), of(3 * j + 2)) * (Y0 * COSINE[j]);
        }
        if values.iter().any(|value| !value.is_finite()) {
            return Err(format!("{} holds numbers that are not finite", record.file));
        }
        grids.set_probe(block.start as usize + i, &values);
    }
    Ok(())
}

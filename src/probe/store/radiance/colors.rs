//! Maps of radiance and of normals in the probe file.

use glam::Vec3;
use safetensors::Dtype;

use crate::probe::container::{Container, EncodingLosses};
use crate::probe::store::encode::{ColorFormat, decode_colors, encode_colors};
use crate::probe::store::map::OctahedralMaps;

/// A coordinate of `oct` in a byte; inverse of [`oct_of`].
pub fn byte_of(x: f32) -> u8 {
    (x.clamp(-1.0, 1.0) * 127.5 + 127.5).round() as u8
}

/// Inverse of [`byte_of`] up to rounding.
pub fn oct_of(byte: u8) -> f32 {
    f32::from(byte) / 127.5 - 1.0
}

fn scale_key(name: &str) -> String {
    format!("scale.{name}")
}

/// Writes a tensor of colours, its scale, and what that lost.
pub fn write_colors(
    name: &str,
    maps: &OctahedralMaps<Vec3>,
    format: ColorFormat,
    container: &mut Container,
    losses: &mut EncodingLosses,
) {
    let colors = encode_colors(&maps.texels, format);
    let side = maps.side();
    let shape = [maps.texels.len() / (side * side), side, side, 3];
    let shape = if format.is_packed() { &shape[..3] } else { &shape };
    container.put_bytes(name, format.dtype(), shape, colors.bytes);
    container.put_json(&scale_key(name), &colors.scale);
    losses.clamped.insert(name.to_owned(), colors.clamped);
    losses.underflowed.insert(name.to_owned(), colors.underflowed);
}

/// Reads a tensor of colours; inverse of [`write_colors`] up to rounding.
///
/// # Errors
/// What is missing or out of range.
pub fn read_colors(
    name: &str,
    container: &Container,
    probes: usize,
    border: usize,
) -> Result<(OctahedralMaps<Vec3>, ColorFormat), String> {
    let key = scale_key(name);
    let scale: f32 = container.json(&key)?;
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(format!("metadata '{key}' is {scale}"));
    }
    let shape = [Some(probes), None, None, Some(3)];
    let packed = container.tensors.get(name).is_some_and(|t| t.dtype == Dtype::U32);
    let tensor = match packed {
        true => container.tensor(name, &[Dtype::U32], &shape[..3])?,
        false => container.tensor(name, &[Dtype::F16, Dtype::F32], &shape)?,
    };
    let format = ColorFormat::of(tensor.dtype).ok_or_else(|| format!("tensor '{name}' has no colour format"))?;
    let texels = decode_colors(&tensor.bytes, format, scale);
    if texels.iter().any(|t| !t.is_finite()) {
        return Err(format!("tensor '{name}' holds numbers that are not finite"));
    }
    Ok((OctahedralMaps { resolution: tensor.map_resolution(name, border)?, border, texels }, format))
}

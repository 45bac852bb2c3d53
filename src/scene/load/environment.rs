//! Equirectangular environment maps from Radiance HDR and OpenEXR files.

use std::io::Cursor;
use std::path::Path;

use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder};

use super::inputs::Inputs;
use super::text::sentence;
use crate::scene::environment::{Environment, EnvironmentMap};
use crate::scene::error::SceneError;
use crate::scene::options::EnvironmentSource;

/// Most texels of a map: 8192 × 4096, which take 384 MiB.
const MAX_TEXELS: u64 = 1 << 25;
/// Maps up to this many texels are accepted from a file of any size, because a compressed black sky is small.
const MAX_UNBACKED_TEXELS: u64 = 1 << 22;
/// Most texels per byte of the file in larger maps.
const MAX_RATIO: u64 = 64;

/// Loads the sky. Texels that are negative or not finite become 0; a warning gives their number.
pub(super) fn load(
    source: Option<&EnvironmentSource>,
    inputs: &mut Inputs,
    warnings: &mut Vec<String>,
) -> Result<Environment, SceneError> {
    match source {
        None => Ok(Environment::None),
        Some(EnvironmentSource::Constant(radiance)) => {
            if !radiance.is_finite() || radiance.min_element() < 0.0 {
                return Err(SceneError::Image {
                    file: "environment".into(),
                    place: format!("{},{},{}", radiance.x, radiance.y, radiance.z),
                    what: "negative or not finite".to_owned(),
                    remedy: "give finite radiance from 0 up",
                });
            }
            inputs.add(format!("{},{},{}", radiance.x, radiance.y, radiance.z).as_bytes());
            Ok(Environment::Constant(*radiance))
        }
        Some(EnvironmentSource::File(path)) => {
            let bytes = inputs.read(path).map_err(|cause| SceneError::Read {
                file: path.clone(),
                place: "environment map".to_owned(),
                cause,
                remedy: "check the path given to --env",
            })?;
            let mut map = decode(path, &bytes)?;
            clean(path, &mut map, warnings);
            Ok(Environment::Map(map))
        }
    }
}

fn decode(path: &Path, bytes: &[u8]) -> Result<EnvironmentMap, SceneError> {
    let result = if bytes.starts_with(&EXR_MAGIC) { decode_exr(bytes) } else { decode_hdr(bytes) };
    let (file, place) = (path.to_owned(), "environment map".to_owned());
    result.map_err(|failure| match failure {
        Failure::Broken(what) => SceneError::Image {
            file,
            place,
            what: sentence(&what),
            remedy: "give an equirectangular .hdr or .exr of linear RGB",
        },
        Failure::TooLarge(what) => {
            SceneError::TooLarge { file, place, what, remedy: "reduce the map; 8192×4096 is the most" }
        }
    })
}

/// The reason why a map was not decoded.
enum Failure {
    Broken(String),
    TooLarge(String),
}

const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

fn check_size(width: u64, height: u64, bytes: &[u8]) -> Result<(), Failure> {
    let allowed = MAX_TEXELS.min(MAX_UNBACKED_TEXELS.max(MAX_RATIO * bytes.len() as u64));
    match width.checked_mul(height) {
        Some(0) => Err(Failure::Broken("it has no pixels".to_owned())),
        Some(texels) if texels <= allowed => Ok(()),
        _ => Err(Failure::TooLarge(format!(
            "it has {width}×{height} pixels; a file of {} bytes may have at most {allowed}",
            bytes.len()
        ))),
    }
}

fn decode_hdr(bytes: &[u8]) -> Result<EnvironmentMap, Failure> {
    let broken = |what: &str, e: image::ImageError| Failure::Broken(format!("{what}: {e}"));
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(|e| broken("neither HDR nor EXR", e))?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into(), bytes)?;
    let image = DynamicImage::from_decoder(decoder).map_err(|e| broken("it does not decode", e))?;
    let texels = image.into_rgb32f().pixels().map(|p| Vec3::from_array(p.0)).collect();
    Ok(EnvironmentMap { width: width as usize, height: height as usize, texels })
}

fn decode_exr(bytes: &[u8]) -> Result<EnvironmentMap, Failure> {
    use exr::prelude::{MetaData, ReadChannels, ReadLayers, read};
    let describe = |e: exr::error::Error| Failure::Broken(format!("it does not decode: {e}"));
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(describe)?;
    for header in &meta.headers {
        check_size(header.layer_size.0 as u64, header.layer_size.1 as u64, bytes)?;
    }
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| EnvironmentMap { width: size.0, height: size.1, texels: vec![Vec3::ZERO; size.0 * size.1] },
            |map, at, (r, g, b): (f32, f32, f32)| {
                let index = at.1 * map.width + at.0;
                map.texels[index] = Vec3::new(r, g, b);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(describe)?;
    Ok(image.layer_data.channel_data.pixels)
}

fn clean(path: &Path, map: &mut EnvironmentMap, warnings: &mut Vec<String>) {
    let mut bad = 0;
    for texel in &mut map.texels {
        if !texel.is_finite() || texel.min_element() < 0.0 {
            *texel = Vec3::ZERO;
            bad += 1;
        }
    }
    if bad > 0 {
        warnings.push(format!("{}: {bad} texels are negative or not finite and count as black", path.display()));
    }
    if map.width != 2 * map.height {
        warnings.push(format!(
            "{}: {}×{} pixels are not 2:1, so it is stretched over the sphere",
            path.display(),
            map.width,
            map.height
        ));
    }
}

//! Equirectangular environment maps from Radiance HDR and OpenEXR files.

use std::path::Path;

use glam::Vec3;

use super::inputs::Inputs;
use crate::image::Picture;
use crate::scene::environment::{Environment, EnvironmentMap};
use crate::scene::error::SceneError;
use crate::scene::options::{EnvironmentSource, LoadOptions};
use crate::system::format;

/// Most texels of a map: 8192 × 4096, which take 384 MiB.
const MAX_TEXELS: u64 = 1 << 25;
/// Maps up to this many texels are accepted from a file of any size, because a compressed black sky is small.
const MAX_UNBACKED_TEXELS: u64 = 1 << 22;
/// Most texels per byte of the file in larger maps.
const MAX_RATIO: u64 = 64;

/// Loads the sky, turned and scaled as the options say. Channels that are negative and texels that are not finite become
/// 0; a warning gives their numbers.
pub(super) fn load(
    options: &LoadOptions,
    inputs: &mut Inputs,
    warnings: &mut Vec<String>,
) -> Result<Environment, SceneError> {
    let scale = options.environment_scale;
    let error = |file: &Path, what: String, remedy| SceneError::Image {
        file: file.to_owned(),
        place: "environment".to_owned(),
        what,
        remedy,
    };
    let (file, layer) = match &options.environment {
        None => return Ok(Environment::None),
        Some(EnvironmentSource::Constant(radiance)) => {
            let scaled = *radiance * scale;
            let [r, g, b] = scaled.to_array();
            if !scaled.is_finite() || scaled.min_element() < 0.0 {
                let what = format!("its radiance {r:?},{g:?},{b:?} is negative or not finite");
                return Err(error(Path::new("sky"), what, "give finite radiance and scale from 0 up"));
            }
            // The scaled radiance alone is the sky: by which factors it came does not matter.
            inputs.add(format!("{r},{g},{b}").as_bytes());
            return Ok(Environment::Constant(scaled));
        }
        Some(EnvironmentSource::Map { file, layer }) => (file, layer.as_deref()),
    };
    let bytes = inputs.read(file).map_err(|cause| SceneError::Read {
        file: file.clone(),
        place: "environment map".to_owned(),
        cause,
        remedy: "check the path given to --env",
    })?;
    let most_texels = MAX_TEXELS.min(MAX_UNBACKED_TEXELS.max(MAX_RATIO * bytes.len() as u64));
    let picture = Picture::decode_light(file, &bytes, layer, most_texels);
    let Picture { width, height, pixels } = picture.map_err(SceneError::EnvironmentMap)?;
    let mut map = EnvironmentMap { width: width as usize, height: height as usize, texels: pixels };
    clean(file, &mut map, warnings);
    scale_texels(&mut map, scale).map_err(|what| error(file, what, "give a smaller --env-scale"))?;
    let map = map.turned(options.environment_rotate_deg);
    add_to_hash(options, layer, inputs);
    Ok(Environment::Map(map))
}

/// Adds what makes another sky of the same file. A choice that changes nothing leaves the hash as it is.
fn add_to_hash(options: &LoadOptions, layer: Option<&str>, inputs: &mut Inputs) {
    if let Some(layer) = layer {
        inputs.add(format!("layer {layer}").as_bytes());
    }
    let turn = options.environment_rotate_deg.rem_euclid(360.0);
    if turn != 0.0 {
        inputs.add(format!("turned {turn}").as_bytes());
    }
    if options.environment_scale != 1.0 {
        inputs.add(format!("scaled {}", options.environment_scale).as_bytes());
    }
}

fn scale_texels(map: &mut EnvironmentMap, scale: f32) -> Result<(), String> {
    map.texels.iter_mut().for_each(|texel| *texel *= scale);
    match map.texels.iter().filter(|texel| !texel.is_finite()).count() {
        0 => Ok(()),
        beyond => {
            let beyond = format::counted(beyond as u64, "texel exceeds", "texels exceed");
            Err(format!("scaled by {scale:?}, {beyond} the largest 32-bit number"))
        }
    }
}

fn clean(path: &Path, map: &mut EnvironmentMap, warnings: &mut Vec<String>) {
    let (mut negative, mut least, mut not_finite) = (0, 0.0_f32, 0);
    for texel in &mut map.texels {
        if !texel.is_finite() {
            *texel = Vec3::ZERO;
            not_finite += 1;
        } else if texel.min_element() < 0.0 {
            negative += 1;
            least = least.min(texel.min_element());
            *texel = texel.max(Vec3::ZERO);
        }
    }
    let mut faults = Vec::new();
    if negative > 0 {
        let negative = format::counted(negative, "texel has", "texels have");
        faults.push(format!("{negative} negative channels, down to {least:?}, which count as 0"));
    }
    if not_finite > 0 {
        let not_finite =
            format::counted(not_finite, "texel is not finite and counts", "texels are not finite and count");
        faults.push(format!("{not_finite} as black"));
    }
    if !faults.is_empty() {
        warnings.push(format!("{}: {}", path.display(), faults.join("; ")));
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

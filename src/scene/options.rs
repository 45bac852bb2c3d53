//! Options of loading a scene.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use glam::Vec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::light::LIGHT_MAX;

/// Options of [`super::load`].
#[derive(Debug, Clone)]
pub struct LoadOptions {
    /// The material of meshes without one.
    pub unassigned: Unassigned,
    /// What is read of materials. All else is not read and cannot be at fault.
    pub detail: Detail,
    /// The sky. glTF files contain none.
    pub environment: Option<EnvironmentSource>,
    /// Turn of an environment map about +Y, degrees, finite. See
    /// [`EnvironmentMap::turned`](super::environment::EnvironmentMap::turned).
    pub environment_rotate_deg: f64,
    /// Factor on the radiance of the sky, finite and not negative.
    pub environment_scale: f32,
    /// Index of the glTF scene to load. `None` loads the file's default scene.
    pub scene: Option<usize>,
    /// Store an image whose texels are all equal as one texel. Lookups return the same values.
    pub collapse_constant_images: bool,
}

impl Default for LoadOptions {
    fn default() -> Self {
        LoadOptions {
            unassigned: Unassigned::default(),
            detail: Detail::GLOSSY,
            environment: None,
            environment_rotate_deg: 0.0,
            environment_scale: 1.0,
            scene: None,
            collapse_constant_images: true,
        }
    }
}

/// The material of meshes that have none in the file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Unassigned {
    /// A rough white surface of this diffuse albedo, 0 to 1.
    Diffuse { albedo: f32 },
    /// The default material of glTF 2.0, section 3.9.1: a white metal, which reflects no diffuse light.
    Gltf,
}

impl Default for Unassigned {
    fn default() -> Self {
        Unassigned::Diffuse { albedo: 0.8 }
    }
}

impl fmt::Display for Unassigned {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Unassigned::Diffuse { albedo } => write!(f, "diffuse(albedo: {albedo})"),
            Unassigned::Gltf => f.write_str("gltf"),
        }
    }
}

/// The textures that a command looks at besides those that diffuse light depends on. These are base colour, metalness,
/// emission and alpha, each only where its factor lets it matter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Detail {
    /// Normal maps and tangents, which bend what a camera sees.
    pub normal_maps: bool,
    /// Roughness, and the colour of metals.
    pub gloss: bool,
}

impl Detail {
    /// What a bake needs.
    pub const LIGHT: Detail = Detail { normal_maps: false, gloss: false };
    /// What pictures of diffuse surfaces need.
    pub const PICTURE: Detail = Detail { normal_maps: true, gloss: false };
    /// What pictures of glossy surfaces need.
    pub const GLOSSY: Detail = Detail { normal_maps: true, gloss: true };
}

/// The source of the sky. On the command line it is written `FILE.hdr`, `FILE.exr`, `FILE.exr:LAYER` or `R,G,B`.
#[derive(Debug, Clone, PartialEq)]
pub enum EnvironmentSource {
    /// One radiance for all directions, W·m⁻²·sr⁻¹, from 0 to [`LIGHT_MAX`].
    Constant(Vec3),
    /// An equirectangular map whose centre looks along −Z.
    Map {
        file: PathBuf,
        /// A layer or part of an OpenEXR file; `None` for the plain channels.
        layer: Option<String>,
    },
}

/// The reason why a text does not name an [`EnvironmentSource`].
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum EnvironmentSourceError {
    #[error(
        "environment '{0}' is neither a .hdr or .exr file nor three numbers; write FILE.hdr, FILE.exr, FILE.exr:LAYER or \
         R,G,B"
    )]
    Form(String),
    #[error("environment '{text}': '{part}' is not a number; write R,G,B such as 1,1,1")]
    Number { text: String, part: String },
    #[error(
        "environment '{text}': '{part}' is no radiance that is computed with; give numbers from 0 to {LIGHT_MAX:e}"
    )]
    Range { text: String, part: String },
}

impl FromStr for EnvironmentSource {
    type Err = EnvironmentSourceError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let lower = text.to_ascii_lowercase();
        if lower.ends_with(".hdr") || lower.ends_with(".exr") {
            return Ok(EnvironmentSource::Map { file: PathBuf::from(text), layer: None });
        }
        // Lower case of ASCII keeps the places of bytes.
        if let Some(at) = lower.rfind(".exr:").map(|dot| dot + ".exr".len())
            && at + 1 < text.len()
        {
            let layer = Some(text[at + 1..].to_owned());
            return Ok(EnvironmentSource::Map { file: PathBuf::from(&text[..at]), layer });
        }
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        if parts.len() != 3 {
            return Err(EnvironmentSourceError::Form(text.to_owned()));
        }
        let mut rgb = [0.0f32; 3];
        for (value, part) in rgb.iter_mut().zip(parts) {
            *value = part
                .parse()
                .map_err(|_| EnvironmentSourceError::Number { text: text.to_owned(), part: part.to_owned() })?;
            if !(0.0..=LIGHT_MAX).contains(value) {
                return Err(EnvironmentSourceError::Range { text: text.to_owned(), part: part.to_owned() });
            }
        }
        Ok(EnvironmentSource::Constant(Vec3::from_array(rgb)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_the_forms() {
        let map = |file: &str, layer: Option<&str>| {
            Ok(EnvironmentSource::Map { file: file.into(), layer: layer.map(str::to_owned) })
        };
        assert_eq!("a b/SKY.HDR".parse(), map("a b/SKY.HDR", None));
        assert_eq!("1,2,3.exr".parse(), map("1,2,3.exr", None));
        assert_eq!("sky.EXR:left.beauty".parse(), map("sky.EXR", Some("left.beauty")));
        assert_eq!("C:\\sky.exr".parse(), map("C:\\sky.exr", None));
        assert_eq!("1, 0.5,2e-3".parse(), Ok(EnvironmentSource::Constant(Vec3::new(1.0, 0.5, 2e-3))));
    }

    #[test]
    fn refuses_the_rest() {
        let bright = "1e31,0,0";
        for text in
            ["", "sky.png", "1,2", "1,2,3,4", "1,x,3", "1,-1,0", "nan,0,0", "inf,0,0", bright, "sky.exr:", "sky.hdr:a"]
        {
            assert!(text.parse::<EnvironmentSource>().is_err(), "{text}");
        }
    }
}

//! Reading one picture of light, Radiance HDR or OpenEXR, with all that its header says about its pixels.

use std::io::Cursor;
use std::path::Path;

use exr::meta::attribute::EnvironmentMap;

use super::error::ImageError;
use super::exr_file::{EXR_MAGIC, ExrFile};
use super::exr_layers::{PartLayer, no_color, no_layer};
use super::exr_read::read_part_layer;
use super::exr_window::Window;
use super::hdr::HdrFile;
use super::picture::Picture;

impl Picture {
    /// Decodes the bytes of a Radiance or OpenEXR file into light in Rec. 709; `path` is for messages only.
    ///
    /// Radiance's exposure is divided out. OpenEXR's pixels fill the display window. Primaries that differ are converted,
    /// see [`Primaries::rec_709_from_rgb`](crate::math::primaries::Primaries::rec_709_from_rgb). Colours beyond Rec. 709
    /// become negative in a channel. `layer` names a layer or part of OpenEXR; without it, the first plain R, G, B (or
    /// grey Y) is read, or the only layer.
    ///
    /// # Errors
    /// The file has another format, is damaged or holds what cannot be light, has no such layer, or has more than
    /// `most_pixels`.
    pub fn decode_light(
        path: &Path,
        bytes: &[u8],
        layer: Option<&str>,
        most_pixels: u64,
    ) -> Result<Picture, ImageError> {
        let check = |width: usize, height: usize| match (width as u64).checked_mul(height as u64) {
            Some(pixels) if pixels <= most_pixels => Ok(()),
            _ => {
                let (path, file_bytes) = (path.to_owned(), bytes.len() as u64);
                Err(ImageError::TooLarge { path, width, height, most_pixels, file_bytes })
            }
        };
        if bytes.starts_with(&EXR_MAGIC) {
            read_exr(path, bytes, layer, check)
        } else {
            read_hdr(path, bytes, layer, check)
        }
    }
}

fn read_exr(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&str>,
    check: impl Fn(usize, usize) -> Result<(), ImageError>,
) -> Result<Picture, ImageError> {
    let file = ExrFile::new(path, Cursor::new(bytes), bytes.len() as u64)?;
    let layers = PartLayer::all(file.headers());
    let layer = match wanted {
        Some(name) => layers.iter().find(|layer| layer.is_called(name)),
        None => {
            layers.iter().find(|layer| layer.is_plain()).or(if let [only] = &layers[..] { Some(only) } else { None })
        }
    };
    let Some(layer) = layer else {
        return Err(if layers.is_empty() { no_color(path, file.headers()) } else { no_layer(path, wanted, &layers) });
    };
    let header = &file.headers()[layer.part];
    if header.own_attributes.environment_map == Some(EnvironmentMap::Cube) {
        return Err(ImageError::NotLight {
            path: path.to_owned(),
            reason: "its attribute `envmap` says that it holds the six faces of a cube".to_owned(),
            remedy: "convert it into a latitude-longitude map, for example with `exrenvmap -l IN.exr OUT.exr`",
        });
    }
    let size = Window::of(header).size;
    check(size.width(), size.height())?;
    check(header.layer_size.width(), header.layer_size.height())?;
    read_part_layer(path, file, layer.part, layer.channels)
}

fn read_hdr(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&str>,
    check: impl Fn(usize, usize) -> Result<(), ImageError>,
) -> Result<Picture, ImageError> {
    if !bytes.starts_with(b"#?") {
        return Err(ImageError::NotLight {
            path: path.to_owned(),
            reason: "it is neither Radiance HDR nor OpenEXR".to_owned(),
            remedy: "give an equirectangular .hdr or .exr of linear RGB",
        });
    }
    if let Some(wanted) = wanted {
        return Err(no_layer(path, Some(wanted), &[]));
    }
    let file = HdrFile::open(path, bytes)?;
    let (width, height) = file.size();
    check(width as usize, height as usize)?;
    file.read()
}

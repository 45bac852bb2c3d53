//! Radiance HDR: its header, and its pixels as radiance.
//!
//! The `image` crate decodes the pixels behind a header that is written here. It reads only `#?RADIANCE` and one order
//! of axes, and leaves exposure and primaries to its caller. The format: Ward, "Real Pixels", Graphics Gems II (1991),
//! and `refman` of Radiance.

use std::io::{BufRead, Cursor, Read};
use std::path::Path;

use glam::{DMat3, DVec3, Vec3};
use image::DynamicImage;
use image::codecs::hdr::HdrDecoder;

use super::error::ImageError;
use super::picture::Picture;
use crate::math::primaries::Primaries;

const FORMAT: &str = "Radiance HDR";

/// Most bytes before the pixels. The lines of a long history of commands take some thousand.
const MAX_HEADER_BYTES: u64 = 1 << 16;

/// A remedy.
const LINEAR: &str = "save it as linear RGB, for example as OpenEXR";

/// An opened file whose header has been read.
pub(super) struct HdrFile<'a, R> {
    path: &'a Path,
    reader: R,
    header: Header,
}

struct Header {
    axes: Axes,
    /// What the pixels were multiplied by, per channel: the product of all `EXPOSURE` and `COLORCORR`.
    multiplied: DVec3,
    rec_709_from_rgb: DMat3,
}

/// The order of the pixels. Y counts upwards and X to the right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Axes {
    width: u32,
    height: u32,
    /// Whether a scan line is a column.
    is_transposed: bool,
    is_right_to_left: bool,
    is_upwards: bool,
}

impl<'a, R: BufRead> HdrFile<'a, R> {
    /// Reads the header.
    ///
    /// # Errors
    /// The header is damaged, or its `FORMAT`, `GAMMA` or `PRIMARIES` cannot be read.
    pub(super) fn open(path: &'a Path, mut reader: R) -> Result<HdrFile<'a, R>, ImageError> {
        let header = read_header(&mut reader).map_err(|fault| fault.at(path))?;
        Ok(HdrFile { path, reader, header })
    }

    /// Width and height of the upright picture.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.header.axes.width, self.header.axes.height)
    }

    /// Decodes the pixels: radiance in Rec. 709, row 0 at the top.
    ///
    /// # Errors
    /// The pixels are damaged.
    pub(super) fn read(self) -> Result<Picture, ImageError> {
        let Header { axes, multiplied, rec_709_from_rgb } = self.header;
        let [lines, length] = axes.lines_and_length();
        let plain = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {lines} +X {length}\n");
        let decoded = HdrDecoder::new(Cursor::new(plain).chain(self.reader)).and_then(DynamicImage::from_decoder);
        let stored = decoded.map_err(|e| Fault::Damaged(e.to_string()).at(self.path))?.into_rgb32f();
        let is_as_stored = axes == Axes { is_transposed: false, is_right_to_left: false, is_upwards: false, ..axes };
        let is_radiance = multiplied == DVec3::ONE && rec_709_from_rgb == DMat3::IDENTITY;
        let radiance = |pixel: [f32; 3]| match is_radiance {
            true => pixel.into(),
            false => (rec_709_from_rgb * (Vec3::from(pixel).as_dvec3() / multiplied)).as_vec3(),
        };
        let pixels = match is_as_stored {
            true => stored.pixels().map(|pixel| radiance(pixel.0)).collect(),
            false => {
                let places = (0..axes.height).flat_map(|y| (0..axes.width).map(move |x| axes.stored_at(x, y)));
                places.map(|(line, place)| radiance(stored.get_pixel(place, line).0)).collect()
            }
        };
        Ok(Picture::from_pixels(axes.width, axes.height, pixels))
    }
}

impl Axes {
    /// Reads a line such as `-Y 512 +X 1024`. The first axis counts the scan lines.
    fn parse(line: &str) -> Option<Axes> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [first, lines, second, length] = words[..] else { return None };
        let [lines, length] = [lines.parse().ok()?, length.parse().ok()?];
        let is_transposed = matches!(first, "+X" | "-X");
        let ([x, y], [width, height]) = match is_transposed {
            true => ([first, second], [lines, length]),
            false => ([second, first], [length, lines]),
        };
        let are_axes = matches!(x, "+X" | "-X") && matches!(y, "+Y" | "-Y");
        let axes = Axes { width, height, is_transposed, is_right_to_left: x == "-X", is_upwards: y == "+Y" };
        (are_axes && width > 0 && height > 0).then_some(axes)
    }

    /// Number of scan lines, and pixels in each.
    fn lines_and_length(&self) -> [u32; 2] {
        if self.is_transposed { [self.width, self.height] } else { [self.height, self.width] }
    }

    /// The scan line of a pixel of the upright picture, and its place in the line.
    fn stored_at(&self, x: u32, y: u32) -> (u32, u32) {
        let x = if self.is_right_to_left { self.width - 1 - x } else { x };
        let y = if self.is_upwards { self.height - 1 - y } else { y };
        if self.is_transposed { (x, y) } else { (y, x) }
    }
}

/// What is wrong with a file, before its path is known.
enum Fault {
    Damaged(String),
    /// With the remedy.
    NotLight(String, &'static str),
}

impl Fault {
    fn at(self, path: &Path) -> ImageError {
        let path = path.to_owned();
        match self {
            Fault::Damaged(reason) => ImageError::Damaged { path, format: FORMAT, reason },
            Fault::NotLight(reason, remedy) => ImageError::NotLight { path, reason, remedy },
        }
    }
}

fn read_header(reader: &mut impl BufRead) -> Result<Header, Fault> {
    let mut limited = reader.take(MAX_HEADER_BYTES);
    let mut line = || {
        let mut bytes = Vec::new();
        limited.read_until(b'\n', &mut bytes).map_err(|e| Fault::Damaged(e.to_string()))?;
        match bytes.pop() {
            Some(b'\n') => Ok(String::from_utf8_lossy(&bytes).trim_end_matches('\r').to_owned()),
            _ => Err(Fault::Damaged("its header does not end".to_owned())),
        }
    };
    // Programs write their own name here; the FORMAT line tells what the pixels are.
    if !line()?.starts_with("#?") {
        return Err(Fault::Damaged("it does not begin with #?RADIANCE or #?RGBE".to_owned()));
    }
    let (mut multiplied, mut rec_709_from_rgb) = (DVec3::ONE, DMat3::IDENTITY);
    loop {
        let line = line()?;
        if line.is_empty() {
            break;
        }
        // An indented line is the history of another picture, and its key does not match.
        let Some((key, value)) = line.split_once('=') else { continue };
        match key {
            "EXPOSURE" => multiplied *= DVec3::splat(positive::<1>(key, value)?[0]),
            "COLORCORR" => multiplied *= DVec3::from(positive::<3>(key, value)?),
            "PRIMARIES" => {
                let primaries = numbers::<8>(value).map(Primaries::from_array);
                let matrix = primaries.and_then(|primaries| primaries.rec_709_from_rgb());
                rec_709_from_rgb = matrix.ok_or_else(|| not(key, value, "primaries of colour"))?;
            }
            "FORMAT" => check_format(value.trim())?,
            // The key of files from other programs than Radiance, whose pixels are not linear then.
            "GAMMA" if positive::<1>(key, value)? != [1.0] => {
                return Err(Fault::NotLight(format!("its pixels have GAMMA={}", shown(value)), LINEAR));
            }
            _ => {}
        }
    }
    if !(multiplied.is_finite() && multiplied.min_element() > 0.0) {
        return Err(Fault::Damaged("the product of its EXPOSURE and COLORCORR lines is out of range".to_owned()));
    }
    let resolution = line()?;
    let axes = Axes::parse(&resolution).ok_or_else(|| {
        Fault::Damaged(format!("'{}' stands in place of its size, such as -Y 512 +X 1024", shown(&resolution)))
    })?;
    Ok(Header { axes, multiplied, rec_709_from_rgb })
}

fn check_format(format: &str) -> Result<(), Fault> {
    match format {
        "32-bit_rle_rgbe" => Ok(()),
        // Photometric, and adapted to the white of equal energy (Radiance, `ra_xyze.c`).
        "32-bit_rle_xyze" => Err(Fault::NotLight(
            "its FORMAT is 32-bit_rle_xyze, candela per square metre in CIE XYZ".to_owned(),
            "turn it into radiance with Radiance's `ra_xyze -r -o IN.hdr OUT.hdr`",
        )),
        other => Err(Fault::NotLight(format!("its FORMAT is '{}', not 32-bit_rle_rgbe", shown(other)), LINEAR)),
    }
}

fn numbers<const N: usize>(value: &str) -> Option<[f64; N]> {
    let numbers: Vec<f64> = value.split_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

fn positive<const N: usize>(key: &str, value: &str) -> Result<[f64; N], Fault> {
    let is_positive = |numbers: &[f64; N]| numbers.iter().all(|&x| x.is_finite() && x > 0.0);
    numbers::<N>(value).filter(is_positive).ok_or_else(|| not(key, value, &format!("{N} positive number(s)")))
}

fn not(key: &str, value: &str, expected: &str) -> Fault {
    Fault::Damaged(format!("its line {key}={} does not hold {expected}", shown(value)))
}

/// Text of a file for a message of one line.
fn shown(text: &str) -> String {
    text.trim().chars().take(60).flat_map(char::escape_debug).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_of_all_eight_orders() {
        // Pixel (1, 0) of 3 × 2: right of the top-left corner.
        for (line, expected) in [
            ("-Y 2 +X 3", (0, 1)),
            ("-Y 2 -X 3", (0, 1)),
            ("+Y 2 +X 3", (1, 1)),
            ("+Y 2 -X 3", (1, 1)),
            ("+X 3 -Y 2", (1, 0)),
            ("+X 3 +Y 2", (1, 1)),
            ("-X 3 -Y 2", (1, 0)),
            ("-X 3 +Y 2", (1, 1)),
        ] {
            let axes = Axes::parse(line).unwrap();
            assert_eq!((axes.width, axes.height), (3, 2), "{line}");
            assert_eq!(axes.stored_at(1, 0), expected, "{line}");
        }
        assert_eq!(Axes::parse("-Y 2 -X 3").unwrap().stored_at(0, 0), (0, 2));
        for bad in [
            "-Y 2",
            "-Y 2 +Y 3",
            "Y 2 X 3",
            "-Y 2 +X 3 1",
            "-Y -2 +X 3",
            "-Y 0 +X 3",
            "-Y 2 +X 0",
            "-Y 2 +X 99999999999",
        ] {
            assert_eq!(Axes::parse(bad), None, "{bad}");
        }
    }
}

//! Values that flags take, and what is said about those they do not take.

use std::str::FromStr;
use std::time::Duration;

use crate::probe::lattice::grid::MAX_PROBES;

/// Width and height, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PictureSize {
    pub width: u32,
    pub height: u32,
}

/// Largest side of a picture, pixels.
const MAX_SIDE: u32 = 16_384;

impl FromStr for PictureSize {
    type Err = String;

    fn from_str(text: &str) -> Result<PictureSize, String> {
        let side = |s: &str| s.parse::<u32>().ok().filter(|n| (1..=MAX_SIDE).contains(n));
        let parts = text.split_once(['x', 'X']).and_then(|(w, h)| Some((side(w)?, side(h)?)));
        let (width, height) =
            parts.ok_or_else(|| format!("write width and height as 640x360, each from 1 to {MAX_SIDE}"))?;
        Ok(PictureSize { width, height })
    }
}

/// A camera position and target in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookAt {
    pub origin: [f64; 3],
    pub target: [f64; 3],
    pub fov_y_deg: f32,
}

impl FromStr for LookAt {
    type Err = String;

    fn from_str(text: &str) -> Result<LookAt, String> {
        let form = "write six or seven numbers: ox,oy,oz,tx,ty,tz[,fov]";
        let numbers: Option<Vec<f64>> =
            text.split(',').map(|s| s.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
        let numbers = numbers.ok_or(form)?;
        let (origin, target, fov) = match numbers[..] {
            [a, b, c, d, e, f] => ([a, b, c], [d, e, f], 60.0),
            [a, b, c, d, e, f, fov] => ([a, b, c], [d, e, f], fov),
            _ => return Err(form.into()),
        };
        if origin == target {
            return Err("origin and target are the same point".into());
        }
        if !(fov > 0.0 && fov < 180.0) {
            return Err("the field of view must lie between 0 and 180 degrees".into());
        }
        Ok(LookAt { origin, target, fov_y_deg: fov as f32 })
    }
}

/// A ray in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TraceRay {
    pub origin: [f64; 3],
    /// Of any length above zero.
    pub direction: [f64; 3],
}

impl FromStr for TraceRay {
    type Err = String;

    fn from_str(text: &str) -> Result<TraceRay, String> {
        let numbers: Option<Vec<f64>> =
            text.split(',').map(|s| s.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
        let Some(&[a, b, c, d, e, f]) = numbers.as_deref() else {
            return Err("write six numbers, a point and a direction: ox,oy,oz,dx,dy,dz".into());
        };
        if [d, e, f] == [0.0; 3] {
            return Err("the direction has no length".into());
        }
        Ok(TraceRay { origin: [a, b, c], direction: [d, e, f] })
    }
}

pub fn parse_exposure(text: &str) -> Result<f32, String> {
    let ev: Option<f32> = text.parse().ok().filter(|ev: &f32| ev.abs() <= 100.0);
    ev.ok_or_else(|| "write a number from -100 to 100".into())
}

pub fn parse_positive(text: &str) -> Result<f32, String> {
    let range = f32::MIN_POSITIVE..=f32::MAX;
    let number: Option<f32> = text.parse().ok().filter(|x| range.contains(x));
    number.ok_or_else(|| format!("write a number from {:.1e} to {:.1e}", range.start(), range.end()))
}

/// Relative errors: at 1 a bake is as far off as darkness, and none comes near to the least.
pub fn parse_target_error(text: &str) -> Result<f64, String> {
    let number: Option<f64> = text.parse().ok().filter(|x| (1e-6..=1.0).contains(x));
    number.ok_or_else(|| "write a share from 1e-6 to 1, such as 0.1 for 10 %".into())
}

pub fn parse_index(text: &str) -> Result<u32, String> {
    text.parse().map_err(|_| format!("write a whole number from 0 to {}, such as 8", u32::MAX))
}

/// A whole number from 1 to `most`.
fn parse_number(text: &str, most: u64, example: &str) -> Result<u64, String> {
    let number: Option<u64> = text.parse().ok().filter(|n| (1..=most).contains(n));
    number.ok_or_else(|| format!("write a whole number from 1 to {most}, such as {example}"))
}

/// Most samples per pixel: their sum is far from losing a sample to f64, and years from being reached.
const MAX_SPP: u32 = 1 << 30;

/// Most seeds of a sweep, and most offsets: the spread is known well long before.
const MAX_SEEDS: u32 = 1000;

pub fn parse_samples(text: &str) -> Result<u32, String> {
    Ok(parse_number(text, MAX_SPP.into(), "64")? as u32)
}

pub fn parse_seeds(text: &str) -> Result<u32, String> {
    Ok(parse_number(text, MAX_SEEDS.into(), "3")? as u32)
}

pub fn parse_most_probes(text: &str) -> Result<u64, String> {
    parse_number(text, MAX_PROBES, "65536")
}

pub fn parse_seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("write a whole number from 0 to {}, such as 1", u64::MAX))
}

/// Numbers that are too large are refused later, with what makes sense.
pub fn parse_threads(text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| "write a whole number, such as 2; 0 means one thread per core".into())
}

pub fn parse_finite(text: &str) -> Result<f64, String> {
    let number: Option<f64> = text.parse().ok().filter(|x: &f64| x.is_finite());
    number.ok_or_else(|| "write a finite number".into())
}

pub fn parse_not_negative(text: &str) -> Result<f32, String> {
    let number: Option<f32> = text.parse().ok().filter(|x: &f32| x.is_finite() && *x >= 0.0);
    number.ok_or_else(|| "write a finite number from 0 up".into())
}

/// Bytes of a size with its unit: 512 alone may be meant as bytes or as mebibytes.
pub fn parse_size(text: &str) -> Result<u64, String> {
    let size = text.parse::<bytesize::ByteSize>().map_err(|_| "write a size such as 512MiB or 2GB")?;
    if !text.trim_end().ends_with(|last: char| last.is_ascii_alphabetic()) {
        return Err(format!("a size needs a unit: write {0}MiB, {0}GB, or {0}B for bytes", text.trim()));
    }
    Ok(size.as_u64())
}

/// Seconds of up to a year.
pub fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds: Option<f64> = text.parse().ok().filter(|x| (0.0..=3.2e7).contains(x));
    seconds.map(Duration::from_secs_f64).ok_or_else(|| "write seconds from 0 to 3.2e7".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_asked_for_in_plain_words() {
        assert_eq!((parse_samples("1"), parse_seeds("1000"), parse_most_probes("8")), (Ok(1), Ok(1000), Ok(8)));
        for message in [parse_samples("0"), parse_samples("-4"), parse_seeds("1001"), parse_seeds("two")] {
            assert!(message.unwrap_err().starts_with("write a whole number from 1 to "));
        }
        assert!(parse_most_probes("0").unwrap_err().ends_with("such as 65536"));
    }

    #[test]
    fn sizes_need_a_unit() {
        for (text, bytes) in [("512MiB", 512 << 20), ("2GB", 2_000_000_000), ("0B", 0), ("7 kib", 7 << 10)] {
            assert_eq!(parse_size(text), Ok(bytes), "{text}");
        }
        for text in ["512", "0"] {
            let message = parse_size(text).unwrap_err();
            assert!(message.contains("unit") && message.contains("MiB"), "{text}: {message}");
        }
        for text in ["", "1.5", "MiB", "-1MiB", "lots"] {
            assert!(parse_size(text).unwrap_err().contains("512MiB"), "{text}");
        }
    }
}

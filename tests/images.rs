//! Pictures on disk: what is written comes back, what is damaged is an error, and heat maps say what they show.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::Vec3;
use lightprobe::image::{ImageError, LayeredImage, Picture, Picture8};
use lightprobe::report::colormap::{MISSING, color};
use lightprobe::report::heatmap::{Heatmap, range_of};
use lightprobe::system::output::write_atomically;
use proptest::prelude::*;

const WIDTH: u32 = 11;
const HEIGHT: u32 = 35;

/// Any colours, over many magnitudes, with what a renderer may hand over by mistake.
fn colors(seed: f32) -> Vec<Vec3> {
    let mut pixels: Vec<Vec3> = (0..WIDTH * HEIGHT)
        .map(|i| Vec3::new((i as f32 * seed).sin().exp2(), i as f32 * 1.0e-9, (i as f32 * 0.05 - 30.0).exp2()))
        .collect();
    pixels[3] = Vec3::new(f32::INFINITY, -1.0, f32::MIN_POSITIVE);
    pixels
}

fn layered() -> LayeredImage {
    let mut image = LayeredImage::new(WIDTH, HEIGHT);
    image.push("irradiance_indirect", colors(0.3));
    image.push("beauty", colors(0.7));
    image.push_scalar("depth", &(0..WIDTH * HEIGHT).map(|i| i as f32).collect::<Vec<_>>());
    image
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.exr");
    (folder, path)
}

#[test]
fn layers_come_back() {
    let (_folder, path) = folder();
    let image = layered();
    image.write_exr(&path).unwrap();
    let read = LayeredImage::read_exr(&path).unwrap();
    assert_eq!((read.width, read.height), (WIDTH, HEIGHT));
    assert_eq!(read.names().collect::<Vec<_>>(), ["beauty", "depth", "irradiance_indirect"]);
    for (name, pixels) in image.layers() {
        assert_eq!(read.layer(name), Some(pixels), "{name}");
    }
    assert_eq!(read.scalar("depth").unwrap()[7], 7.0);
    assert_eq!(Picture::read_exr(&path).unwrap().pixels, image.layer("beauty").unwrap());
}

#[test]
fn channels_are_named_and_sorted_as_the_contract_says() {
    let (_folder, path) = folder();
    layered().write_exr(&path).unwrap();
    let file = std::io::BufReader::new(fs::File::open(&path).unwrap());
    let meta = exr::meta::MetaData::read_from_buffered(file, true).unwrap();
    assert_eq!(meta.headers.len(), 1);
    let header = &meta.headers[0];
    let names: Vec<String> = header.channels.list.iter().map(|channel| channel.name.to_string()).collect();
    let expected = "B G R beauty.B beauty.G beauty.R depth.B depth.G depth.R \
                    irradiance_indirect.B irradiance_indirect.G irradiance_indirect.R";
    assert_eq!(names.join(" "), expected);
    assert!(header.channels.list.iter().all(|channel| channel.sample_type == exr::meta::attribute::SampleType::F32));
    assert_eq!(header.compression, exr::compression::Compression::ZIP16);
}

#[test]
fn the_same_picture_gives_the_same_bytes() {
    let (folder, path) = folder();
    let other = folder.path().join("other.exr");
    layered().write_exr(&path).unwrap();
    layered().write_exr(&other).unwrap();
    assert_eq!(fs::read(path).unwrap(), fs::read(other).unwrap());
}

#[test]
fn plain_pictures_come_back_as_beauty() {
    let (_folder, path) = folder();
    let picture = Picture::from_pixels(WIDTH, HEIGHT, colors(0.1));
    picture.write_exr(&path).unwrap();
    assert_eq!(Picture::read_exr(&path).unwrap(), picture);
    assert_eq!(LayeredImage::read_exr(&path).unwrap().picture("beauty"), Some(picture));
}

#[test]
fn what_cannot_be_written_or_read_is_named() {
    let (folder, path) = folder();
    let mut image = LayeredImage::new(1, 1);
    assert!(matches!(image.write_exr(&path), Err(ImageError::Empty { .. })));
    image.push("no.dots", vec![Vec3::ONE]);
    assert!(matches!(image.write_exr(&path), Err(ImageError::LayerName { .. })));
    assert!(!path.exists());
    let missing = Picture::read_exr(&path).unwrap_err().to_string();
    assert!(missing.contains("picture.exr") && missing.contains("check the path"), "{missing}");
    assert!(Picture::read_exr(folder.path()).unwrap_err().to_string().contains("not a regular file"));
    fs::write(&path, b"not an exr at all").unwrap();
    assert!(matches!(Picture::read_exr(&path), Err(ImageError::Damaged { .. })));
    // Layers without colour to fall back on.
    let depth_only = exr::prelude::Image::from_channels(
        (2, 2),
        exr::prelude::SpecificChannels::build().with_channel("Z").with_pixel_fn(|_| (1.0_f32,)),
    );
    exr::prelude::WritableImage::write(&depth_only).to_file(&path).unwrap();
    let message = Picture::read_exr(&path).unwrap_err().to_string();
    assert!(message.contains("only Z"), "{message}");
    assert!(matches!(LayeredImage::read_exr(&path), Err(ImageError::NoColor { .. })));
}

#[test]
fn half_floats_are_read() {
    let (_folder, path) = folder();
    exr::prelude::write_rgba_file(&path, 5, 4, |x, y| {
        (half::f16::from_f32(x as f32), half::f16::from_f32(y as f32), half::f16::ONE, half::f16::ONE)
    })
    .unwrap();
    let picture = Picture::read_exr(&path).unwrap();
    assert_eq!(picture.pixel(4, 3), Vec3::new(4.0, 3.0, 1.0));
    assert_eq!(LayeredImage::read_exr(&path).unwrap().names().collect::<Vec<_>>(), ["beauty"]);
}

/// Reads a file both ways; only that it returns matters, and that an error names the file.
fn read_both(path: &Path) -> bool {
    let results = [Picture::read_exr(path).err(), LayeredImage::read_exr(path).err()];
    for error in results.iter().flatten() {
        assert!(error.to_string().contains("picture.exr"), "{error}");
    }
    results.iter().all(Option::is_some)
}

#[test]
fn truncated_files_are_errors() {
    let (_folder, path) = folder();
    layered().write_exr(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    let in_header = 0..bytes.len().min(900);
    let in_data = (900..bytes.len()).step_by(97);
    for length in in_header.chain(in_data).chain([bytes.len() - 1]) {
        fs::write(&path, &bytes[..length]).unwrap();
        assert!(read_both(&path), "{length} of {} bytes were taken for a picture", bytes.len());
    }
}

#[test]
fn flipped_bytes_never_panic() {
    let (_folder, path) = folder();
    layered().write_exr(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    let in_header = 0..bytes.len().min(1100);
    for place in in_header.chain((1100..bytes.len()).step_by(997)) {
        for flip in [0x01, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[place] ^= flip;
            fs::write(&path, &damaged).unwrap();
            read_both(&path);
        }
    }
}

#[test]
fn counters_in_blocks_are_not_believed() {
    use exr::prelude::{
        Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, Vec2, WritableImage,
    };
    let (_folder, path) = folder();
    let wave = |p: Vec2<usize>| ((p.0 * p.1) as f32 * 0.1).sin();
    let channels =
        SpecificChannels::rgb(|p: Vec2<usize>| (half::f16::from_f32(wave(p)), half::f16::ONE, half::f16::ONE));
    let encoding =
        Encoding { compression: Compression::DWAA(None), blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let layer = Layer::new((40, 37), LayerAttributes::default(), encoding, channels);
    Image::from_layer(layer).write().to_file(&path).unwrap();
    assert!(Picture::read_exr(&path).is_ok());
    let bytes = fs::read(&path).unwrap();
    // A block starts with its version, 2, and ten more numbers of 8 bytes. Their high bytes at 64 ask the decoder for exabytes,
    // which would end the process.
    let version = 2_u64.to_le_bytes();
    let start = bytes.windows(8).rposition(|part| part == version).unwrap();
    for place in start..start + 11 * 8 {
        let mut damaged = bytes.clone();
        damaged[place] ^= 64;
        fs::write(&path, &damaged).unwrap();
        read_both(&path);
    }
}

#[test]
fn a_header_is_not_believed() {
    let (_folder, path) = folder();
    layered().write_exr(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    // The data window's type is followed by its length (4 bytes) and xMin, yMin, xMax, yMax.
    let name = b"dataWindow\0box2i\0";
    let at = bytes.windows(name.len()).position(|part| part == name).unwrap() + name.len() + 4;
    for (x_max, y_max) in
        [(i32::MAX - 1, 0), (0, i32::MAX - 1), (i32::MAX - 1, i32::MAX - 1), (99_999, 99_999), (99_999, 34)]
    {
        let mut damaged = bytes.clone();
        damaged[at + 8..at + 12].copy_from_slice(&x_max.to_le_bytes());
        damaged[at + 12..at + 16].copy_from_slice(&y_max.to_le_bytes());
        fs::write(&path, &damaged).unwrap();
        assert!(read_both(&path), "{x_max} × {y_max}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn pngs_come_back(width in 1_u32..40, height in 1_u32..40, seed in any::<u32>()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let mut picture = Picture8::filled(width, height, [0; 3]);
        for (i, pixel) in picture.pixels.iter_mut().enumerate() {
            let [r, g, b, _] = (i as u32).wrapping_add(seed).wrapping_mul(2_654_435_761).to_le_bytes();
            *pixel = [r, g, b];
        }
        picture.write_png(&path).unwrap();
        prop_assert_eq!(Picture8::read_png(&path).unwrap(), picture);
    }
}

#[test]
fn damaged_pngs_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.png");
    Picture::from_pixels(WIDTH, HEIGHT, colors(0.4)).tonemapped(0.0).write_png(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    // The last 12 bytes are the end mark, which decoders do without.
    for length in (0..bytes.len() - 12).step_by(13) {
        fs::write(&path, &bytes[..length]).unwrap();
        let error = Picture8::read_png(&path).unwrap_err().to_string();
        assert!(error.contains("picture.png"), "{error}");
    }
    assert!(Picture8::filled(0, 4, [0; 3]).write_png(&path).is_err());
}

#[test]
fn the_exposure_of_a_picture_shows_it_at_mid_grey() {
    let picture = Picture::from_pixels(2, 2, vec![Vec3::splat(1440.0); 4]);
    let exposure_ev = picture.auto_exposure_ev();
    assert!((exposure_ev + 8000_f32.log2()).abs() < 1e-5);
    let grey = Picture::from_pixels(2, 2, vec![Vec3::splat(0.18); 4]);
    assert_eq!(picture.tonemapped(exposure_ev), grey.tonemapped(0.0));
    assert_eq!(Picture::new(3, 3).auto_exposure_ev(), 0.0);
}

/// Set in the child that [`outputs_honour_the_umask`] starts under another umask.
const UNDER_UMASK: &str = "LIGHTPROBE_TEST_MODE";

#[test]
fn outputs_honour_the_umask() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out");
    write_atomically(&path, |_| Ok(())).unwrap();
    let mode = fs::metadata(&path).unwrap().permissions().mode() & 0o777;
    if let Ok(expected) = std::env::var(UNDER_UMASK) {
        assert_eq!(format!("{mode:o}"), expected);
        return;
    }
    // A process has one umask, shared with the other tests; so each is tried in a process of its own.
    let this_test = std::env::current_exe().unwrap();
    for (umask, expected) in [("022", "644"), ("077", "600"), ("002", "664")] {
        let script = format!("umask {umask}; exec \"$0\" --exact outputs_honour_the_umask");
        let status =
            Command::new("sh").arg("-c").arg(script).arg(&this_test).env(UNDER_UMASK, expected).output().unwrap();
        assert!(status.status.success(), "umask {umask}: {}", String::from_utf8_lossy(&status.stdout));
    }
}

/// Height of a legend at zoom 1.
const LEGEND_HEIGHT: u32 = 82;

fn heatmap(values: &[f32], width: u32, height: u32) -> Picture8 {
    let range = range_of(values);
    Heatmap { values, width, height, range, title: "Leaked light", unit: "W·m⁻²", missing: "no surface" }.draw()
}

#[test]
fn a_heatmap_keeps_its_map_pixel_for_pixel() {
    let values: Vec<f32> = (0..640 * 360).map(|i| (i % 640) as f32 / 639.0).collect();
    let drawn = heatmap(&values, 640, 360);
    assert_eq!((drawn.width, drawn.height), (640, 360 + LEGEND_HEIGHT));
    for (x, y) in [(0, 0), (639, 0), (320, 180), (17, 359)] {
        assert_eq!(drawn.pixel(x, y), color(values[x as usize], 1.0));
    }
}

#[test]
fn a_legends_bar_runs_from_low_to_high() {
    let values: Vec<f32> = (0..600).map(|i| (i as f32 - 300.0) / 300.0).collect();
    let drawn = heatmap(&values, 600, 1);
    let is_bar = |y: u32| (1..600).filter(|&x| drawn.pixel(x, y) != drawn.pixel(x - 1, y)).count() > 250;
    let y = (1..drawn.height).find(|&y| is_bar(y)).expect("a bar below the map");
    let at = |value: f32| (0..600).filter(|&x| drawn.pixel(x, y) == color(value, 1.0)).collect::<Vec<_>>();
    let [low, middle, high] = [-1.0, 0.0, 1.0].map(at);
    assert!(low[0] < middle[0] && middle[0] < high[0], "{low:?} {middle:?} {high:?}");
    // Zero stands in the middle, within a column.
    assert!((middle[middle.len() / 2] as i32 - 300).abs() <= 1, "{middle:?}");
}

#[test]
fn missing_values_have_their_own_colour_which_the_legend_names() {
    let mut values = vec![0.5_f32; 500 * 20];
    let is_missing = |pixel: &&[u8; 3]| **pixel == MISSING;
    let whole = heatmap(&values, 500, 20);
    assert_eq!(whole.pixels.iter().filter(is_missing).count(), 0);
    values[3] = f32::NAN;
    values[4] = f32::INFINITY;
    let drawn = heatmap(&values, 500, 20);
    assert_eq!(drawn.pixel(3, 0), MISSING);
    assert_eq!(drawn.pixel(4, 0), MISSING);
    let in_legend = drawn.pixels[500 * 20..].iter().filter(is_missing).count();
    assert!(in_legend >= 100, "a swatch of {in_legend} pixels");
}

#[test]
fn small_maps_still_get_a_legible_legend() {
    for (width, height) in [(64, 36), (1, 1), (1, 3000), (479, 2), (0, 0)] {
        let values = vec![0.25; width as usize * height as usize];
        let drawn = heatmap(&values, width, height);
        assert!(drawn.width >= 480, "{width} × {height}");
        let shown = drawn.pixels.iter().filter(|pixel| **pixel == color(0.25, 0.25)).count();
        // Every value covers a square of one size.
        let scale = (drawn.height - LEGEND_HEIGHT).checked_div(height).unwrap_or(1);
        let map = (width * height * scale * scale) as usize;
        assert!(shown >= map, "{width} × {height}: {shown} of {map}");
        assert!(drawn.height <= (height + LEGEND_HEIGHT).max(1200));
    }
}

#[test]
fn ranges_are_round_and_robust() {
    let mut values = vec![0.0_f32; 10_000];
    assert_eq!(range_of(&values), 1.0);
    values[..2000].fill(0.4);
    values[0] = 1.0e6;
    values[1] = f32::NAN;
    assert_eq!(range_of(&values), 0.4);
}

//! Maps of the sky: what the headers of Radiance HDR and OpenEXR say about the pixels is honoured, or refused by name.

use exr::math::Vec2;
use exr::meta::attribute::{Chromaticities, EnvironmentMap as Layout, IntegerBounds};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, Text, WritableImage,
};
use glam::Vec3;
use lightprobe::scene::environment::EnvironmentMap;
use lightprobe::scene::{Environment, LoadOptions, Scene, load};

use crate::TRIANGLE;
use crate::common::{Folder, Gltf};

/// A triangle under a sky as the command line names it; `Err` is the message.
fn under(folder: &Folder, sky: &str, adjust: impl FnOnce(&mut LoadOptions)) -> Result<Scene, String> {
    let scene = folder.write("scene.glb", Gltf::of_triangles(&TRIANGLE).glb());
    let source = sky.parse().map_err(|e| format!("{e}"))?;
    let mut options = LoadOptions { environment: Some(source), ..Default::default() };
    adjust(&mut options);
    load(&scene, &options).map_err(|e| e.to_string())
}

fn map(scene: &Scene) -> &EnvironmentMap {
    let Environment::Map(map) = &scene.environment else { panic!("not a map") };
    map
}

fn path(folder: &Folder, name: &str) -> String {
    folder.path().join(name).to_str().expect("UTF-8").to_owned()
}

/// The texels of a sky, and the warnings that name its file.
fn read(folder: &Folder, sky: &str) -> (Vec<Vec3>, String) {
    let scene = under(folder, sky, |_| {}).unwrap_or_else(|e| panic!("{e}"));
    let of_sky = |warning: &&String| warning.contains(&folder.path().display().to_string());
    let said: Vec<&str> = scene.warnings.iter().filter(of_sky).map(String::as_str).collect();
    (map(&scene).texels.clone(), said.join("\n"))
}

/// The message that refuses a sky, with all of these words on its one line.
fn refuse(folder: &Folder, sky: &str, words: &[&str]) {
    let message = under(folder, sky, |_| {}).expect_err("a sky that is refused");
    assert!(!message.contains('\n') && words.iter().all(|word| message.contains(word)), "{words:?}: {message}");
}

/// Pixels of 4 × 2, or of 2 × 4, in the order of the file: 1, 2, … 8 in all channels.
fn hdr(folder: &Folder, header: &str, size: &str) -> String {
    // A mantissa of 128 at exponent 129 is 1 (Ward 1991). Lines this short are not compressed.
    let pixels = (1..=8).flat_map(|value| [16 * value, 16 * value, 16 * value, 132]);
    let bytes: Vec<u8> = header.bytes().chain(format!("\n{size}\n").into_bytes()).chain(pixels).collect();
    folder.write("sky.hdr", bytes);
    path(folder, "sky.hdr")
}

const HEADER: &str = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n";

#[test]
fn exposure_and_colour_correction_are_divided_out() {
    let folder = Folder::new();
    for (lines, divisor) in [
        ("", Vec3::ONE),
        ("EXPOSURE=4\n", Vec3::splat(4.0)),
        ("EXPOSURE= 4.0 \nEXPOSURE=5e-1\r\n", Vec3::splat(2.0)),
        ("COLORCORR=1 2 4\nEXPOSURE=2\nCOLORCORR= 2 1 1\n", Vec3::new(4.0, 4.0, 8.0)),
        // The history of a picture that this one was made from.
        ("\tEXPOSURE=4\n\tCOLORCORR=1 2 3\n# EXPOSURE=4\npfilt -e 4\n", Vec3::ONE),
    ] {
        let (texels, said) = read(&folder, &hdr(&folder, &format!("{HEADER}{lines}"), "-Y 2 +X 4"));
        // Powers of two, so that the quotients are exact.
        let expected: Vec<Vec3> = (1..=8).map(|value| Vec3::splat(value as f32) / divisor).collect();
        assert_eq!(texels, expected, "{lines}");
        assert_eq!(said, "", "{lines}");
    }
    for bad in ["EXPOSURE=0", "EXPOSURE=-1", "EXPOSURE=x", "EXPOSURE=inf", "COLORCORR=1 2", "COLORCORR=1 2 3 4"] {
        refuse(&folder, &hdr(&folder, &format!("{HEADER}{bad}\n"), "-Y 2 +X 4"), &["sky.hdr", bad]);
    }
    let product = "EXPOSURE=1e300\n".repeat(2);
    refuse(&folder, &hdr(&folder, &format!("{HEADER}{product}"), "-Y 2 +X 4"), &["EXPOSURE", "out of range"]);
}

#[test]
fn radiance_under_any_name_and_in_any_order() {
    let folder = Folder::new();
    let upright = [1, 2, 3, 4, 5, 6, 7, 8];
    for (header, size, order) in [
        ("#?RGBE\nFORMAT=32-bit_rle_rgbe\n", "-Y 2 +X 4", upright),
        ("#?AUTOPANO\n", "-Y 2 +X 4", upright),
        (HEADER, "-Y 2 -X 4", [4, 3, 2, 1, 8, 7, 6, 5]),
        (HEADER, "+Y 2 +X 4", [5, 6, 7, 8, 1, 2, 3, 4]),
        (HEADER, "+Y 2 -X 4", [8, 7, 6, 5, 4, 3, 2, 1]),
        // Scan lines are columns.
        (HEADER, "+X 4 -Y 2", [1, 3, 5, 7, 2, 4, 6, 8]),
        (HEADER, "-X 4 -Y 2", [7, 5, 3, 1, 8, 6, 4, 2]),
        (HEADER, "+X 4 +Y 2", [2, 4, 6, 8, 1, 3, 5, 7]),
        (HEADER, "-X 4 +Y 2", [8, 6, 4, 2, 7, 5, 3, 1]),
    ] {
        let (texels, said) = read(&folder, &hdr(&folder, header, size));
        assert_eq!(texels, order.map(|value| Vec3::splat(value as f32)), "{header}{size}");
        assert_eq!(said, "", "the map is 2:1");
    }
    refuse(&folder, &hdr(&folder, HEADER, "-Y 2 +Z 4"), &["+Z 4", "-Y 512 +X 1024"]);
    folder.write("sky.hdr", "#?RADIANCE\nno end");
    refuse(&folder, &path(&folder, "sky.hdr"), &["does not end"]);
}

#[test]
fn radiance_in_other_colours() {
    let folder = Folder::new();
    let with = |line: &str| hdr(&folder, &format!("#?RADIANCE\n{line}\n"), "-Y 2 +X 4");
    // Radiance's own primaries. White stays white; f32 rounds twice.
    let (texels, _) = read(&folder, &with("PRIMARIES= 0.640 0.330 0.290 0.600 0.150 0.060 0.333 0.333"));
    assert!(texels[7].abs_diff_eq(Vec3::splat(8.0), 1e-5), "{}", texels[7]);
    refuse(&folder, &with("PRIMARIES=0 0 0 0 0 0 0 0"), &["PRIMARIES=0 0"]);
    refuse(&folder, &with("PRIMARIES=0.64 0.33"), &["PRIMARIES=0.64 0.33"]);
    refuse(&folder, &with("FORMAT=32-bit_rle_xyze"), &["32-bit_rle_xyze", "ra_xyze"]);
    refuse(&folder, &with("FORMAT=Radiance_spectra"), &["Radiance_spectra", "linear RGB"]);
    refuse(&folder, &with("GAMMA=2.2"), &["GAMMA=2.2", "linear RGB"]);
    read(&folder, &with("GAMMA=1.0"));
}

/// What a test's EXR has besides its pixels.
#[derive(Default)]
struct Header {
    /// Position and size. The data window's where `None`.
    display: Option<((i32, i32), (usize, usize))>,
    position: (i32, i32),
    chromaticities: Option<Chromaticities>,
    layout: Option<Layout>,
}

/// A part of one size, a value per pixel in each channel.
type Part<'a> = (&'a str, &'a [(&'a str, &'a [f32])]);

/// Writes parts whose pixels are `width` wide.
fn exr(folder: &Folder, name: &str, width: usize, parts: &[Part], header: Header) -> String {
    let layer = |&(name, channels): &Part| {
        let channel = |&(name, values): &(&str, &[f32])| AnyChannel::new(name, FlatSamples::F32(values.to_vec()));
        let attributes = LayerAttributes {
            layer_name: (!name.is_empty()).then(|| Text::from(name)),
            layer_position: header.position.into(),
            environment_map: header.layout,
            ..LayerAttributes::default()
        };
        let size = Vec2(width, channels[0].1.len() / width);
        let channels: SmallVec<_> = channels.iter().map(channel).collect();
        Layer::new(size, attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(channels))
    };
    let layers: Vec<_> = parts.iter().map(layer).collect();
    let data = IntegerBounds::new(header.position, layers[0].size);
    let display = header.display.map_or(data, |(position, size)| IntegerBounds::new(position, size));
    let mut attributes = exr::meta::header::ImageAttributes::new(display);
    attributes.chromaticities = header.chromaticities;
    let file = folder.path().join(name);
    Image::from_layers(attributes, SmallVec::from_vec(layers))
        .write()
        .non_parallel()
        .to_file(&file)
        .expect("an EXR file");
    path(folder, name)
}

/// Eight pixels whose channels are `r`, `g`, `b`.
fn flat(folder: &Folder, [r, g, b]: [f32; 3], header: Header) -> String {
    let channels = [("R", &[r; 8][..]), ("G", &[g; 8]), ("B", &[b; 8])];
    exr(folder, "sky.exr", 4, &[("", &channels)], header)
}

const NUMBERS: [f32; 8] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0];
const RGB: [(&str, &[f32]); 3] = [("R", &NUMBERS), ("G", &NUMBERS), ("B", &NUMBERS)];

#[test]
fn only_the_negative_channel_is_black() {
    let folder = Folder::new();
    let (texels, said) = read(&folder, &flat(&folder, [-0.01, 0.2, 1.0], Header::default()));
    assert_eq!(texels, [Vec3::new(0.0, 0.2, 1.0); 8]);
    assert!(said.contains("8 texels have negative channels") && said.contains("-0.01"), "{said}");
    let (texels, said) = read(&folder, &flat(&folder, [f32::INFINITY, 0.2, -1.0], Header::default()));
    assert_eq!(texels, [Vec3::ZERO; 8]);
    assert!(said.contains("8 texels are not finite") && !said.contains("negative"), "{said}");
}

fn chromaticities([rx, ry, gx, gy, bx, by, wx, wy]: [f32; 8]) -> Header {
    let found = Chromaticities { red: Vec2(rx, ry), green: Vec2(gx, gy), blue: Vec2(bx, by), white: Vec2(wx, wy) };
    Header { chromaticities: Some(found), ..Header::default() }
}

#[test]
fn chromaticities_are_converted_to_rec_709() {
    let folder = Folder::new();
    // The tristimulus values of Rec. 709's (1, 0.5, 0.25): rows of the matrix of IEC 61966-2-1.
    let xyz = [
        0.4124 + 0.3576 * 0.5 + 0.1805 * 0.25,
        0.2126 + 0.7152 * 0.5 + 0.0722 * 0.25,
        0.0193 + 0.1192 * 0.5 + 0.9505 * 0.25,
    ];
    let third = 1.0 / 3.0;
    let (texels, _) = read(&folder, &flat(&folder, xyz, chromaticities([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, third, third])));
    // The matrix has four decimals, and its inverse entries up to 3.2.
    assert!(texels[0].abs_diff_eq(Vec3::new(1.0, 0.5, 0.25), 5e-4), "{}", texels[0]);
    // ACEScg: its white is D60, and stays white.
    let ap1 = [0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767];
    let (texels, _) = read(&folder, &flat(&folder, [2.0; 3], chromaticities(ap1)));
    assert!(texels[0].abs_diff_eq(Vec3::splat(2.0), 1e-5), "{}", texels[0]);
    // Rec. 709 keeps the bits.
    let rec_709 = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329];
    let (texels, _) = read(&folder, &flat(&folder, [0.1, 0.2, 0.3], chromaticities(rec_709)));
    assert_eq!(texels[0], Vec3::new(0.1, 0.2, 0.3));
    refuse(&folder, &flat(&folder, [1.0; 3], chromaticities([0.3; 8])), &["chromaticities", "Rec. 709"]);
}

#[test]
fn the_display_window_is_the_map() {
    let folder = Folder::new();
    let with = |position, display| {
        let sky = exr(&folder, "sky.exr", 4, &[("", &RGB)], Header { position, display, ..Header::default() });
        let scene = under(&folder, &sky, |_| {}).unwrap_or_else(|e| panic!("{e}"));
        let map = map(&scene);
        (map.width, map.height, map.texels.iter().map(|texel| texel.z).collect::<Vec<_>>())
    };
    // The data window is the upper half.
    let upper = with((0, 0), Some(((0, 0), (4, 4))));
    assert_eq!(upper, (4, 4, [&NUMBERS[..], &[0.0; 8]].concat()));
    // Moved both, and stored more than is shown to the left and above, less to the right.
    let moved = with((-10, 7), Some(((-8, 8), (4, 2))));
    assert_eq!(moved, (4, 2, vec![7.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    assert_eq!(with((5, 5), None), (4, 2, NUMBERS.to_vec()), "both windows are equal, away from the origin");
    // A small file that claims a large picture.
    let claims = Header { display: Some(((0, 0), (32768, 16384))), ..Header::default() };
    refuse(&folder, &exr(&folder, "sky.exr", 4, &[("", &RGB)], claims), &["32768", "16384"]);
}

#[test]
fn grey_maps_and_layers_by_name() {
    let folder = Folder::new();
    let grey = |value: f32| [Vec3::splat(value); 8];
    let one = |name: &'static str, value: &'static [f32]| (name, value);
    let sky = exr(&folder, "grey.exr", 4, &[("", &[one("Y", &[3.0; 8]), one("A", &[1.0; 8])])], Header::default());
    assert_eq!(read(&folder, &sky).0, grey(3.0));
    let layers = [
        one("day.B", &[1.0; 8]),
        one("day.G", &[1.0; 8]),
        one("day.R", &[1.0; 8]),
        one("night.Y", &[0.5; 8]),
        one("motion.X", &[9.0; 8]),
        one("motion.Y", &[9.0; 8]),
    ];
    let sky = exr(&folder, "layers.exr", 4, &[("", &layers)], Header::default());
    assert_eq!(read(&folder, &format!("{sky}:day")).0, grey(1.0));
    assert_eq!(read(&folder, &format!("{sky}:night")).0, grey(0.5));
    refuse(&folder, &sky, &["several layers", "layers.exr:LAYER", "day, night"]);
    refuse(&folder, &format!("{sky}:motion"), &["no layer 'motion'", "day, night"]);
    // The only layer needs no name.
    let sky = exr(&folder, "one.exr", 4, &[("", &layers[..3])], Header::default());
    assert_eq!(read(&folder, &sky).0, grey(1.0));
    // Parts by name. The first is the default.
    let part = |value: &'static [f32]| [("R", value), ("G", value), ("B", value)];
    let (left, right) = (part(&[1.0; 8]), part(&[2.0; 8]));
    let sky = exr(&folder, "parts.exr", 4, &[("left", &left), ("right", &right)], Header::default());
    assert_eq!(read(&folder, &sky).0, grey(1.0));
    assert_eq!(read(&folder, &format!("{sky}:right")).0, grey(2.0));
    refuse(&folder, &format!("{sky}:up"), &["no layer 'up'", "left, right"]);
    // Nothing has colour.
    let chroma = [one("Y", &[1.0; 8]), one("RY", &[0.0; 8]), one("BY", &[0.0; 8])];
    let sky = exr(&folder, "chroma.exr", 4, &[("", &chroma)], Header::default());
    refuse(&folder, &sky, &["no channels R, G and B", "only BY, RY, Y"]);
    let plain = flat(&folder, [1.0; 3], Header::default());
    refuse(&folder, &format!("{plain}:day"), &["no layer 'day'", "leave its name out"]);
}

#[test]
fn cubes_are_refused_by_name() {
    let folder = Folder::new();
    let layout = |layout| Header { layout: Some(layout), ..Header::default() };
    read(&folder, &flat(&folder, [1.0; 3], layout(Layout::LatitudeLongitude)));
    refuse(&folder, &flat(&folder, [1.0; 3], layout(Layout::Cube)), &["envmap", "cube", "exrenvmap -l"]);
}

#[test]
fn turned_and_scaled_skies_are_other_skies() {
    let folder = Folder::new();
    let sky = exr(&folder, "sky.exr", 4, &[("", &RGB)], Header::default());
    let with = |sky: &str, turn: f64, scale: f32| {
        let adjust = |o: &mut LoadOptions| (o.environment_rotate_deg, o.environment_scale) = (turn, scale);
        under(&folder, sky, adjust)
    };
    let loaded = |turn, scale| with(&sky, turn, scale).unwrap_or_else(|e| panic!("{e}"));
    let plain = loaded(0.0, 1.0);
    let turned = loaded(90.0, 2.0);
    let red: Vec<f32> = map(&turned).texels.iter().map(|texel| texel.x).collect();
    assert_eq!(red, [4.0, 6.0, 8.0, 2.0, 12.0, 14.0, 16.0, 10.0]);
    let hashes = [&plain, &turned, &loaded(90.0, 1.0), &loaded(0.0, 2.0)].map(|scene| scene.blake3.clone());
    assert!((0..4).all(|i| (0..i).all(|j| hashes[i] != hashes[j])), "{hashes:?}");
    for same in [loaded(360.0, 1.0), loaded(-720.0, 1.0)] {
        assert_eq!(same.blake3, plain.blake3);
        assert_eq!(map(&same).texels, map(&plain).texels);
    }
    assert_eq!(loaded(-270.0, 2.0).blake3, turned.blake3);
    let message = with(&sky, 0.0, 1e38).expect_err("beyond f32");
    assert!(message.contains("--env-scale") && message.contains("sky.exr"), "{message}");

    let constant = with("1,2,3", 45.0, 2.0).expect("a constant");
    assert!(matches!(constant.environment, Environment::Constant(sky) if sky == Vec3::new(2.0, 4.0, 6.0)));
    assert_eq!(constant.blake3, with("2,4,6", 0.0, 1.0).expect("a constant").blake3);
    assert!(with("1,2,3", 0.0, f32::MAX).is_err());
}

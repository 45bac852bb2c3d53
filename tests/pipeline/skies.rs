//! Maps of the sky from the command line to the probes.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use crate::common::{Folder, Gltf};
use crate::program::{Bake, bake, refuse, run, succeed, text};
use crate::shapes::{add, diffuse, quad, save};

const WORDS: &str = "--preset physical --set grid.divisions=(2,2,2) --set grid.bounds={\"min\":[-1,-1,-1],\"max\":[1,1,1]} \
                     --set placement.keep_unsampled=true --set encoding.irradiance=f32";

/// One square centimetre of geometry, some metres away.
fn speck(folder: &Folder) -> PathBuf {
    let mut gltf = Gltf::new();
    add(&mut gltf, &quad([0.0, -3.0, 0.0], [0.0, 0.0, 0.01], [0.01, 0.0, 0.0], 1), diffuse([0.5; 3], [0.0; 3]));
    save(gltf, folder, "speck")
}

/// A map of 64 × 32 with this radiance.
fn sky(folder: &Folder, radiance: impl Fn(usize, usize) -> f32 + Sync) -> PathBuf {
    let path = folder.path().join("sky.exr");
    let texel = |x, y| (radiance(x, y), radiance(x, y), radiance(x, y));
    exr::prelude::write_rgb_file(&path, 64, 32, texel).expect("an EXR file");
    path
}

fn under(folder: &Folder, scene: &Path, sky: &Path, words: &str) -> Bake {
    bake(folder, scene, &format!("{WORDS} --env {} {words}", text(sky)))
}

#[test]
fn an_upper_half_of_light() {
    let folder = Folder::new();
    let (scene, sky) = (speck(&folder), sky(&folder, |_, y| if y < 16 { 1.0 } else { 0.0 }));
    let file = under(&folder, &scene, &sky, "").file;
    for (normal, _, found) in file.texels(file.active()[0]) {
        // E(n) = πL·(1 + n·up)/2.
        let exact = PI * (1.0 + normal[1]) / 2.0;
        // The horizon runs through texels of 0.1 rad: as in `a_sky_above_a_black_plane_lights_by_half_the_cosine`, but with
        // one seed instead of the mean of eight.
        assert!((found[0] - exact).abs() < 0.012 * PI, "{} instead of {exact} towards {normal:?}", found[0]);
    }
}

#[test]
fn a_bright_spot_lies_where_the_turn_says() {
    let folder = Folder::new();
    // At the centre of the map, which is −Z: four texels around its crossing of lines.
    let spot = |x: usize, y: usize| if (31..=32).contains(&x) && (15..=16).contains(&y) { 1000.0 } else { 0.0 };
    let (scene, sky) = (speck(&folder), sky(&folder, spot));
    for (degrees, towards) in [("0", [0.0, 0.0, -1.0]), ("90", [-1.0, 0.0, 0.0]), ("-90", [1.0, 0.0, 0.0])] {
        let file = under(&folder, &scene, &sky, &format!("--env-rotate {degrees}")).file;
        let lit = |direction: [f64; 3]| file.irradiance(file.active()[0], direction)[0];
        let away = towards.map(|x: f64| -x);
        assert!(lit(towards) > 10.0 * lit(away).max(0.1), "{degrees}°: {} and {}", lit(towards), lit(away));
        // Sideways and upwards the light grazes: the kernel's texels see little of it.
        for aside in [[0.0, 1.0, 0.0], [towards[2], 0.0, -towards[0]]] {
            assert!(lit(towards) > 3.0 * lit(aside), "{degrees}°: {} and {} aside", lit(towards), lit(aside));
        }
    }
}

#[test]
fn pictures_need_the_turn_and_scale_of_their_bake() {
    let folder = Folder::new();
    let (scene, sky) = (speck(&folder), sky(&folder, |x, _| x as f32));
    let turned = ["--env", text(&sky), "--env-rotate", "45", "--env-scale", "0.5"];
    let baked = bake(&folder, &scene, &format!("{WORDS} {}", turned.join(" ")));
    let output = folder.path().join("out");
    let render = ["render", text(&scene), text(&baked.path), "-o", text(&output), "--size", "16x16"];
    let view = ["--look-at", "0,0,0,0,-3,0.1"];
    for words in [&turned[..2], &turned[..4], &["--env", text(&sky), "--env-rotate", "46", "--env-scale", "0.5"]] {
        let message = refuse(&[&render[..], &view, words].concat());
        assert!(message.contains("another scene") && message.contains("--env-rotate and --env-scale"), "{message}");
    }
    succeed(&[&render[..], &view, &turned].concat());
    // Without the map the one thing to say is that it is missing.
    let message = refuse(&[&render[..], &view].concat());
    let is_told = message.contains("baked under an environment map of 64×32") && message.contains("give the --env");
    assert!(is_told && !message.contains("sends out light"), "{message}");
    let allowed = succeed(&[&render[..], &view, &["--allow-scene-change"]].concat()).stderr;
    assert!(allowed.contains("an environment map of 64×32") && !allowed.contains("sends out light"), "{allowed}");

    // A scaled constant is carried by the probe file, and turning it changes nothing.
    let words = format!("{WORDS} --env 1,2,3 --env-scale 2 --env-rotate 30");
    let baked = bake(&folder, &scene, &words);
    let render = ["render", text(&scene), text(&baked.path), "-o", text(&output), "--size", "16x16"];
    succeed(&[&render[..], &view].concat());
    succeed(&[&render[..], &view, &["--env", "2,4,6"]].concat());
}

#[test]
fn turns_and_scales_are_checked() {
    let folder = Folder::new();
    let (scene, output) = (speck(&folder), folder.path().join("a.probes"));
    let bake = ["bake", text(&scene), "-o", text(&output)];
    for (words, expected) in [
        (&["--env", "1,1,1", "--env-rotate", "nan"][..], "finite number"),
        (&["--env", "1,1,1", "--env-scale", "-1"], "from 0 up"),
        (&["--env", "1,1,1", "--env-scale", "inf"], "from 0 up"),
        (&["--env", "1,1,1e31"], "numbers from 0 to 1e30"),
        (&["--env", "1,1,1", "--env-scale", "1e31"], "brighter than 1e30"),
        (&["--env-scale", "2"], "there is no --env"),
        (&["--env-rotate", "2"], "there is no --env"),
        (&["--env-scale", "2", "--set", "lights.sky=(1,2,0.5)"], "give it as --env 1.0,2.0,0.5 too"),
    ] {
        let ended = run(&[&bake[..], words].concat());
        assert_eq!(ended.code, Some(2), "{words:?}");
        assert!(ended.stderr.contains(expected), "{words:?}: {}", ended.stderr);
    }
}

#[test]
fn maps_that_cannot_be_read_or_are_too_bright() {
    let folder = Folder::new();
    let scene = speck(&folder);
    folder.write("bad.hdr", "no picture");
    let bad = folder.path().join("bad.hdr");
    let message = refuse(&["bake", text(&scene), "-o", text(&folder.path().join("a.probes")), "--env", text(&bad)]);
    assert_eq!(message.matches("cannot read").count(), 1, "{message}");
    for (bright, words) in
        [(1, "1 texel of the environment map is brighter"), (2, "2 texels of the environment map are")]
    {
        let sky = sky(&folder, |x, y| if y == 0 && x < bright { 1e31 } else { 1.0 });
        let output = folder.path().join("bright.probes");
        let line = format!("bake {} -o {} --env {} {WORDS}", text(&scene), text(&output), text(&sky));
        let told = succeed(&line.split_whitespace().collect::<Vec<_>>()).stderr;
        assert!(told.contains(words), "{told}");
    }
}

/// The same digits for all brightnesses.
#[test]
fn listings_show_dim_and_bright_light() {
    let folder = Folder::new();
    let scene = speck(&folder);
    for (radiance, exponent) in [("1e-9", "e-9"), ("1e29", "e29")] {
        let baked = bake(&folder, &scene, &format!("{WORDS} --env {radiance},{radiance},{radiance}"));
        let probe = baked.file.active()[0].to_string();
        let told = succeed(&["inspect", text(&baked.path), "--probe", &probe]).stdout;
        let line = told.lines().find(|line| line.contains("irradiance +y")).expect("a line");
        // π times the radiance, but for the rounding of some hundred weights.
        for figure in line.split_whitespace().skip(2).take(3) {
            assert!(figure.starts_with("3.14") && figure.ends_with(exponent) && figure.len() < 12, "{line}");
        }
    }
}

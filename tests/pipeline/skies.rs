//! Maps of the sky from the command line to the probes.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use crate::common::{Folder, Gltf};
use crate::program::{Bake, bake, refuse, run, succeed, text};
use crate::shapes::{add, diffuse, quad, save};

const WORDS: &str = "--set grid.divisions=(2,2,2) --set grid.bounds={\"min\":[-1,-1,-1],\"max\":[1,1,1]} \
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
        assert!(message.contains("--env-rotate and --env-scale"), "{message}");
    }
    succeed(&[&render[..], &view, &turned].concat());

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
        (&["--env-scale", "2"], "--env"),
        (&["--env-rotate", "2"], "--env"),
    ] {
        let ended = run(&[&bake[..], words].concat());
        assert_eq!(ended.code, Some(2), "{words:?}");
        assert!(ended.stderr.contains(expected), "{words:?}: {}", ended.stderr);
    }
}

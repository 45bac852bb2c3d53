//! Error figures of pictures whose difference and noise are known.

#[path = "common/mod.rs"]
mod common;

use std::f32::consts::TAU;

use glam::{DVec3, Vec3};
use lightprobe::image::LayeredImage;
use lightprobe::light::World;
use lightprobe::math::random::{Purpose, Random};
use lightprobe::report::error::flip::{Flip, measure as measure_flip};
use lightprobe::report::error::{ErrorReport, Figures, measure};
use lightprobe::report::leak::{dark_region, false_black};
use lightprobe::report::reference_layers::{ReferenceError, ReferenceLayers};
use lightprobe::scene::{self, Camera, LoadOptions};
use lightprobe::shade::points::see;
use lightprobe::shade::regions::{Region, regions};

const WIDTH: u32 = 40;
const HEIGHT: u32 = 30;
const PIXELS: usize = (WIDTH * HEIGHT) as usize;

/// How the channels of the constructed noise hang together.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Channels {
    /// All three err by the same number of deviations, which is what is assumed without a layer of covariances.
    Together,
    /// Independent, with a layer of covariances that says so.
    Apart,
}

/// A true picture, and what a method makes of it.
struct Pair {
    truth: Vec<Vec3>,
    method: Vec<Vec3>,
}

impl Pair {
    /// The method errs by `difference(x, y)` in [−1, 1]², scaled by a factor of its own in each channel.
    fn new(difference: impl Fn(f32, f32) -> f32) -> Pair {
        let at = |i: usize| {
            let (x, y) = (i % WIDTH as usize, i / WIDTH as usize);
            (2.0 * x as f32 / (WIDTH - 1) as f32 - 1.0, 2.0 * y as f32 / (HEIGHT - 1) as f32 - 1.0)
        };
        let truth: Vec<Vec3> = (0..PIXELS).map(|i| Vec3::new(2.0, 1.5, 1.0) * (1.5 + at(i).1)).collect();
        let method = (0..PIXELS).map(|i| truth[i] + Vec3::new(1.0, 0.8, 0.5) * difference(at(i).0, at(i).1)).collect();
        Pair { truth, method }
    }

    /// The truth with noise of this deviation, which it knows.
    fn noisy(&self, sigma: f32, channels: Channels, seed: u64) -> ReferenceLayers {
        let noise = noise(channels, seed, 0);
        let reference: Vec<Vec3> = self.truth.iter().zip(noise).map(|(t, n)| *t + sigma * n).collect();
        let covariance = (channels == Channels::Apart).then(|| vec![Vec3::ZERO; PIXELS]);
        layers(&reference, Some(vec![Vec3::splat(sigma * sigma); PIXELS]), covariance, None)
    }
}

/// Normal numbers, by G. E. P. Box & M. E. Muller.
fn noise(channels: Channels, seed: u64, block: u64) -> Vec<Vec3> {
    let normal = |random: &mut Random| (-2.0 * (1.0 - random.uniform()).ln()).sqrt() * (TAU * random.uniform()).cos();
    let pixel = |i: usize| {
        let mut random = Random::new(seed, Purpose::Pixel, i as u64, block);
        match channels {
            Channels::Together => Vec3::splat(normal(&mut random)),
            Channels::Apart => Vec3::from_array([0; 3].map(|_| normal(&mut random))),
        }
    };
    (0..PIXELS).map(pixel).collect()
}

fn layers(
    irradiance: &[Vec3],
    variance: Option<Vec<Vec3>>,
    covariance: Option<Vec<Vec3>>,
    blocks: Option<u32>,
) -> ReferenceLayers {
    let mut image = LayeredImage::new(WIDTH, HEIGHT);
    image.push("irradiance_indirect", irradiance.to_vec());
    image.push("beauty", irradiance.to_vec());
    if let Some(variance) = variance {
        image.push("beauty_variance", variance.clone());
        image.push("irradiance_indirect_variance", variance);
    }
    if let Some(covariance) = covariance {
        image.push("irradiance_indirect_covariance", covariance);
    }
    ReferenceLayers::new(&image, (WIDTH, HEIGHT), blocks).expect("all layers")
}

fn compare(reference: &ReferenceLayers, method: &[Vec3]) -> ErrorReport {
    measure(reference, method, &[Some(Region::Flat); PIXELS], None)
}

type Pick = fn(&Figures) -> Option<f64>;

const FIGURES: [(&str, Pick); 8] = [
    ("mae", |f| f.mae),
    ("rmse", |f| f.rmse),
    ("nrmse", |f| f.nrmse),
    ("relmse", |f| f.relmse),
    ("bias", |f| f.bias),
    ("over", |f| f.over),
    ("under", |f| f.under),
    ("psnr_db", |f| f.psnr_db),
];

fn close(found: Option<f64>, expected: f64) {
    let found = found.expect("a figure");
    // f32 pixels.
    assert!((found - expected).abs() <= 1e-5 * expected.abs() + 1e-6, "{found} instead of {expected}");
}

#[test]
fn constant_offsets_have_their_figures() {
    for offset in [0.25f32, -0.25] {
        let truth = vec![Vec3::new(1.0, 2.0, 4.0); PIXELS];
        let method: Vec<Vec3> = truth.iter().map(|t| *t + offset).collect();
        let report = compare(&layers(&truth, Some(vec![Vec3::ZERO; PIXELS]), None, None), &method);
        let figures = &report.all.figures;
        close(figures.bias, f64::from(offset));
        close(figures.mae, 0.25);
        close(figures.rmse, 0.25);
        // Rec. 709 weights of (1, 2, 4).
        let mean = 0.2126 + 2.0 * 0.7152 + 4.0 * 0.0722;
        close(Some(report.nrmse_mean), mean);
        close(figures.nrmse, 0.25 / mean);
        close(figures.over, f64::from(offset.max(0.0)));
        close(figures.under, f64::from((-offset).max(0.0)));
        close(figures.psnr_db, 20.0 * (4.0f64 / 0.25).log10());
        // The mean of the reference is 7/3.
        let epsilon = 0.01 * (7.0f64 / 3.0).powi(2);
        close(Some(report.relmse_epsilon), epsilon);
        close(Some(report.psnr_peak), 4.0);
        let relative = [1.0, 2.0, 4.0].map(|r: f64| 0.0625 / (r * r + epsilon));
        close(figures.relmse, relative.iter().sum::<f64>() / 3.0);
        for (name, pick) in FIGURES {
            assert_eq!(pick(&report.all.standard_error), Some(0.0), "{name}");
        }
        assert_eq!((report.all.verdict, report.all.noise_rms), (None, Some(0.0)));
        assert_eq!((report.by_region.flat.pixels, report.by_region.corner.pixels), (PIXELS, 0));
        assert_eq!(report.by_region.corner.figures, Figures::default());
    }
}

#[test]
fn identical_pictures_have_no_psnr_and_no_difference() {
    let pair = Pair::new(|_, _| 0.0);
    let report = compare(&layers(&pair.truth, Some(vec![Vec3::ZERO; PIXELS]), None, None), &pair.truth);
    assert_eq!(report.all.figures.psnr_db, None);
    assert_eq!((report.all.figures.rmse, report.all.figures.mae), (Some(0.0), Some(0.0)));
    assert_eq!(report.all.verdict, None);
    // Black against black: neither a peak nor a denominator.
    let black = vec![Vec3::ZERO; PIXELS];
    let report = compare(&layers(&black, None, None, None), &black);
    assert_eq!((report.all.figures.relmse, report.all.figures.nrmse, report.all.figures.psnr_db), (None, None, None));
}

/// 95.45 % of a normal distribution lies within two deviations. Of 200 seeds 178 to 199 must: Binomial(200, 0.9545) lies below
/// with probability 1.6e-4 and above with 9e-5; there are 32 such comparisons on each side here, so that correct error bars fail
/// once in 125 choices of seeds. Seeds are fixed.
const SEEDS: u64 = 200;
const FEWEST_WITHIN: usize = 178;
const MOST_WITHIN: usize = 199;

/// How many of the seeds give each figure within two of its own standard errors of the truth.
fn within(pair: &Pair, report: impl Fn(u64) -> ErrorReport) -> [usize; FIGURES.len()] {
    let reference = layers(&pair.truth, None, None, None);
    let exact = compare(&reference, &pair.method);
    let mut counts = [0; FIGURES.len()];
    for seed in 0..SEEDS {
        let report = report(seed);
        for (count, (name, pick)) in counts.iter_mut().zip(FIGURES) {
            let value = |figures| pick(figures).unwrap_or_else(|| panic!("no {name}"));
            let (found, error) = (value(&report.all.figures), value(&report.all.standard_error));
            // The peak is a convention of each report's own.
            let peaks = if name == "psnr_db" { 20.0 * (report.psnr_peak / exact.psnr_peak).log10() } else { 0.0 };
            // A picture that is nowhere too dark has an `under` of exactly 0 ± 0, but for f32.
            *count += usize::from((found - peaks - value(&exact.all.figures)).abs() <= 2.0 * error + 1e-7);
        }
    }
    counts
}

#[test]
fn differences_far_above_the_noise_have_honest_error_bars() {
    let pair = Pair::new(|x, y| 0.5 + 0.2 * x - 0.1 * y * y);
    for channels in [Channels::Together, Channels::Apart] {
        let counts = within(&pair, |seed| compare(&pair.noisy(0.03, channels, seed), &pair.method));
        for ((name, _), count) in FIGURES.iter().zip(counts) {
            assert!(count >= FEWEST_WITHIN, "{name}, {channels:?}: {count} of {SEEDS}");
            assert!(
                // The bars of `psnr_db` also hold what the peak may be wrong by.
                count <= MOST_WITHIN || matches!(*name, "under" | "psnr_db"),
                "{name}, {channels:?}: {count} of {SEEDS}: bars too long"
            );
        }
    }
}

#[test]
fn differences_like_the_noise_have_honest_error_bars() {
    // The difference changes its sign, and its root mean square over channels, 0.21, is that of the noise.
    let pair = Pair::new(|x, y| 0.45 * x + 0.15 * y);
    for channels in [Channels::Together, Channels::Apart] {
        let counts = within(&pair, |seed| compare(&pair.noisy(0.2, channels, seed), &pair.method));
        for ((name, _), count) in FIGURES.iter().zip(counts) {
            assert!(count >= FEWEST_WITHIN, "{name}, {channels:?}: {count} of {SEEDS}");
            // The bars of these also cover what the correction for the fold may be wrong by; and the noise, up to 0.4 of the
            // denominator's root, is more than the delta method is good for, which errs towards long bars.
            let longer = matches!(*name, "mae" | "over" | "under" | "relmse" | "psnr_db");
            assert!(count <= MOST_WITHIN || longer, "{name}, {channels:?}: {count} of {SEEDS}: bars too long");
        }
    }
}

#[test]
fn variances_from_few_blocks_have_honest_error_bars() {
    const BLOCKS: u32 = 4;
    let pair = Pair::new(|x, y| 0.3 * x + 0.1 * y);
    let counts = within(&pair, |seed| {
        let blocks: Vec<Vec<Vec3>> = (0..u64::from(BLOCKS)).map(|b| noise(Channels::Together, seed, b)).collect();
        let n = BLOCKS as f32;
        let value = |i: usize, b: &Vec<Vec3>| pair.truth[i] + 0.3 * b[i];
        let mean = |i: usize| blocks.iter().map(|b| value(i, b)).sum::<Vec3>() / n;
        let variance =
            |i: usize| blocks.iter().map(|b| (value(i, b) - mean(i)).powf(2.0)).sum::<Vec3>() / (n * (n - 1.0));
        let reference: Vec<Vec3> = (0..PIXELS).map(mean).collect();
        compare(&layers(&reference, Some((0..PIXELS).map(variance).collect()), None, Some(BLOCKS)), &pair.method)
    });
    for ((name, _), count) in FIGURES.iter().zip(counts) {
        // A relative square cannot be freed of the noise of its denominator by a variance that errs by 80 %.
        assert!(count >= FEWEST_WITHIN || *name == "relmse", "{name}: {count} of {SEEDS}");
    }
}

#[test]
fn noise_alone_is_no_difference() {
    let pair = Pair::new(|_, _| 0.0);
    for channels in [Channels::Together, Channels::Apart] {
        let mut within = [0; FIGURES.len()];
        for seed in 0..SEEDS {
            let report = compare(&pair.noisy(0.2, channels, seed), &pair.truth);
            assert_eq!(report.all.verdict, Some("reference too noisy"), "seed {seed}");
            for (count, (_, pick)) in within.iter_mut().zip(FIGURES) {
                // A difference of exactly 0 has no PSNR.
                let (value, error) = (pick(&report.all.figures), pick(&report.all.standard_error));
                *count += usize::from(value.zip(error).is_none_or(|(value, error)| value.abs() <= 2.0 * error));
            }
        }
        for ((name, _), count) in FIGURES.iter().zip(within).filter(|((name, _), _)| *name != "psnr_db") {
            assert!(count >= FEWEST_WITHIN, "{name}, {channels:?}: {count} of {SEEDS}");
        }
    }
}

#[test]
fn without_a_variance_the_report_says_so() {
    let pair = Pair::new(|x, _| x);
    let report = compare(&layers(&pair.truth, None, None, None), &pair.method);
    assert_eq!(report.all.standard_error, Figures::default());
    assert!(report.all.verdict.is_some_and(|v| v.contains("no error estimate")), "{:?}", report.all.verdict);
    assert!(report.all.figures.rmse.is_some_and(|x| x > 0.1));
}

#[test]
fn pixels_without_surface_and_without_number_do_not_count() {
    let mut pair = Pair::new(|_, _| 0.5);
    let mut shown = vec![Some(Region::Corner); PIXELS];
    shown[..100].fill(None);
    pair.method[..100].fill(Vec3::splat(1e9));
    pair.method[200] = Vec3::NAN;
    pair.truth[300].y = f32::INFINITY;
    let report = measure(&layers(&pair.truth, None, None, None), &pair.method, &shown, None);
    assert_eq!((report.all.pixels, report.pixels_not_finite), (PIXELS - 102, 2));
    // Half of 1, 0.8 and 0.5.
    close(report.all.figures.bias, 0.5 * 2.3 / 3.0);
    assert_eq!(report.by_region.corner.pixels, PIXELS - 102);
}

#[test]
fn layers_of_another_size_or_name_are_refused() {
    let mut image = LayeredImage::new(2, 2);
    image.push("beauty", vec![Vec3::ONE; 4]);
    let missing = ReferenceLayers::new(&image, (2, 2), None).expect_err("no irradiance");
    assert!(
        missing.to_string().contains("'irradiance_indirect'") && missing.to_string().contains("beauty"),
        "{missing}"
    );
    let size = ReferenceLayers::new(&image, (3, 2), None).expect_err("another size");
    assert_eq!(size, ReferenceError::Size { found: (2, 2), wanted: (3, 2) });
    assert!(size.to_string().contains("--size 2x2"), "{size}");
}

#[test]
fn flip_takes_the_references_noise_away() {
    const EXPOSURE_EV: f32 = -2.0;
    let shown = [Some(Region::Flat); PIXELS];
    let of = |reference: &ReferenceLayers, method: &[Vec3]| {
        let beauty = layers(method, None, None, None).beauty;
        measure_flip(reference, &beauty, EXPOSURE_EV, &shown, 7)[0]
    };
    for (difference, floor) in [(0.5, 0.05), (0.0, 0.0)] {
        let pair = Pair::new(|x, y| if x * y > 0.0 { difference } else { 0.0 });
        let exact = of(&layers(&pair.truth, None, None, None), &pair.method);
        let exact_mean = exact.mean.expect("a mean");
        assert!(exact_mean >= floor && exact.standard_error.is_none(), "{exact:?}");
        for seed in 0..8 {
            let noisy = pair.noisy(0.05, Channels::Together, seed);
            let Flip { mean: Some(mean), standard_error: Some(error) } = of(&noisy, &pair.method) else {
                panic!("no figure")
            };
            // The greater part of the error is systematic: no significance level belongs to it, and two is what these need.
            assert!((mean - exact_mean).abs() <= 2.0 * error, "seed {seed}: {mean} ± {error} instead of {exact_mean}");
            assert!(error < 0.02, "seed {seed}: {error}");
            let uncorrected = of(&layers(&noisy.irradiance, None, None, None), &pair.method).mean.expect("a mean");
            assert!(
                (mean - exact_mean).abs() < 0.7 * (uncorrected - exact_mean).abs(),
                "seed {seed}: {mean} {uncorrected}"
            );
        }
    }
}

#[test]
fn the_dark_region_is_where_the_reference_is_surely_dark() {
    let mut truth = vec![Vec3::ONE; PIXELS];
    truth[..300].fill(Vec3::ZERO);
    let mut variance = vec![Vec3::ZERO; PIXELS];
    // These are dark too, but the reference is not sure: 3·3.2e-4 of a mean of 0.75 is above a thousandth.
    variance[200..300].fill(Vec3::splat(1e-7));
    let mut method = vec![Vec3::splat(0.9); PIXELS];
    method[..200].fill(Vec3::splat(0.3));
    let shown = [true; PIXELS];
    let reference = layers(&truth, Some(variance), None, None);
    close(dark_region(&method, &reference, &shown), 0.3 / 0.75);
    assert_eq!(dark_region(&method, &layers(&truth, None, None, None), &shown), None);
    let bright = layers(&vec![Vec3::ONE; PIXELS], Some(vec![Vec3::ZERO; PIXELS]), None, None);
    assert_eq!(dark_region(&method, &bright, &shown), None);
}

#[test]
fn what_gets_hardly_any_of_its_light_is_falsely_black() {
    let mut truth = vec![Vec3::ONE; PIXELS];
    // Dark, so that black is right.
    truth[..100].fill(Vec3::splat(1e-4));
    let mut method = vec![Vec3::splat(0.06); PIXELS];
    method[..200].fill(Vec3::splat(0.04));
    let mut shown = [true; PIXELS];
    let reference = layers(&truth, None, None, None);
    close(false_black(&method, &reference, &shown), 100.0 / (PIXELS - 100) as f64);
    shown[100..150].fill(false);
    close(false_black(&method, &reference, &shown), 50.0 / (PIXELS - 150) as f64);
    assert_eq!(false_black(&method, &layers(&vec![Vec3::ZERO; PIXELS], None, None, None), &shown), None);
}

/// Every pixel gets twice the light that would be dark, by one of fifty samples. With 32 of them half of the pixels find
/// nothing, know of no variance, and are not dark all the same.
#[test]
fn few_samples_do_not_make_the_dark_region() {
    let light = 2e-3f32;
    let mut random = Random::new(3, Purpose::Pixel, 0, 0);
    let mut block = || (0..16).map(|_| if random.uniform() < 0.02 { 50.0 * light } else { 0.0 }).sum::<f32>() / 16.0;
    let blocks: Vec<[f32; 2]> = (0..PIXELS).map(|_| [block(), block()]).collect();
    // A bright part makes the mean about 1.
    let bright = PIXELS / 2;
    let mean = |i: usize| if i < bright { 2.0 } else { (blocks[i][0] + blocks[i][1]) / 2.0 };
    let variance = |i: usize| if i < bright { 0.0 } else { ((blocks[i][0] - blocks[i][1]) / 2.0).powi(2) };
    let truth: Vec<Vec3> = (0..PIXELS).map(|i| Vec3::splat(mean(i))).collect();
    let noise: Vec<Vec3> = (0..PIXELS).map(|i| Vec3::splat(variance(i))).collect();
    let black = (bright..PIXELS).filter(|&i| truth[i] == Vec3::ZERO && noise[i] == Vec3::ZERO).count();
    assert!(black > PIXELS / 5, "{black} pixels have seen nothing");
    let mut reference = layers(&truth, Some(noise), None, None);
    reference.noise.as_mut().expect("noise").blocks = Some(2);
    assert_eq!(dark_region(&[Vec3::ONE; PIXELS], &reference, &[true; PIXELS]), None);
}

/// In a cube of side 2, of cosine-distributed rays from a point at the distance x from one wall the share
/// (acos k − k·√(1 − k²))/π, k = x/R, meets that wall within R: their projections fill the unit disc evenly, and those beyond k
/// meet it. A quarter do at k = 0.4040. R is 2 % of the diagonal 2√3.
#[test]
fn regions_of_a_cube_are_where_geometry_puts_them() {
    let folder = common::Folder::new();
    let corners = |k: usize| std::array::from_fn(|axis| if k >> axis & 1 == 1 { 1.0 } else { -1.0 });
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles: Vec<[f32; 3]> =
        faces.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]).map(corners).collect();
    let path = folder.write("cube.glb", common::Gltf::of_triangles(&triangles).glb());
    let scene = scene::load(&path, &LoadOptions::default()).expect("a cube");
    let world = World::new(&scene, 1.0, 0.9).expect("Embree");
    let limit = 0.4040 * 0.02 * 2.0 * 3.0f32.sqrt();
    // Seen by a single pixel each.
    let region_at = |x: f32| {
        let local = |p: [f64; 3]| (DVec3::from(p) - scene.origin_world).as_vec3();
        let (eye, target) = ([0.0, 0.5, 0.1], [f64::from(1.0 - x), -1.0, 0.2]);
        let camera = Camera::look_at("eye", local(eye), local(target), 0.1);
        regions(&world, &see(&world, &camera, 1, 1, 0))
    };
    // 64 fixed rays resolve the share to about 1/64 of 0.25, and k with it to 5 %.
    for (x, expected) in [
        (0.01 * limit, Region::Corner),
        (0.5 * limit, Region::Corner),
        (0.9 * limit, Region::Corner),
        (1.1 * limit, Region::Flat),
        (2.0 * limit, Region::Flat),
        (1.0, Region::Flat),
    ] {
        assert_eq!(region_at(x), [Some(expected)], "{x} m from the wall");
    }
    // Out of the cube's open sky nothing is seen: no region.
    let away = Camera::look_at("away", Vec3::splat(9.0), Vec3::splat(20.0), 0.5);
    assert_eq!(regions(&world, &see(&world, &away, 2, 1, 0)), [None, None]);
}

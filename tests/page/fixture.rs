//! A comparison made up: light of many magnitudes, a pixel that is no number, names that would break a careless page.

use glam::Vec3;
use lightprobe::image::Picture;
use lightprobe::math::color::luminance;
use lightprobe::probe::lattice::ProbeState;
use lightprobe::report::diff::figures::Figure;
use lightprobe::report::diff::images::{ImageReport, Layer};
use lightprobe::report::diff::probes::{ProbeRow, ProbesReport};
use lightprobe::report::diff::shown;
use lightprobe::report::diff::{DiffReport, SideReport, Verdict};
use lightprobe::report::gate::{Gate, sort};
use lightprobe::report::page::{Command, ConfigChange};
use minijinja::context;
use serde_json::json;

/// Breaks out of attributes, elements, scripts and comments, and turns the text after it around.
pub const HOSTILE: &str = "</script><img src=x onerror=\"window.boom=1\">'\"`<!-- \u{202E}gnp.exr";

pub const WIDTH: u32 = 32;
pub const HEIGHT: u32 = 18;
/// Of the first pair.
pub const EXPOSURE_EV: f32 = 0.5;
/// Of the candidate that is no number, in the first pair.
pub const NAN_AT: (u32, u32) = (20, 12);

/// The linear light of a pixel of the first pair.
pub fn light(side: usize, x: u32, y: u32) -> Vec3 {
    let base = Vec3::new(0.02 + 0.03 * x as f32, 0.4, (0.35 * y as f32 - 4.0).exp2());
    if side == 0 { base } else { Vec3::new(base.z, 0.5 * base.y + 0.01 * x as f32, base.x) }
}

fn pair(name: &str, width: u32, height: u32, of: impl Fn(usize, u32, u32) -> Vec3) -> Layer {
    let side = |side| {
        Picture::from_pixels(width, height, (0..width * height).map(|i| of(side, i % width, i / width)).collect())
    };
    let report = ImageReport {
        item: name.to_owned(),
        layer: "beauty".to_owned(),
        width,
        height,
        judged: true,
        is_display: false,
        quantity: "radiance",
        unit: "W·m⁻²·sr⁻¹",
        exposure_ev: Some(EXPOSURE_EV),
        figures: json!({"rmse": 0.0123, "worst": {"x": width / 3, "y": height / 2}}),
        path_base: String::new(),
        path_candidate: String::new(),
        difference_map: None,
    };
    Layer { report, base: side(0), candidate: side(1), difference: Vec::new() }
}

pub fn gate(name: &str, item: &str, value: f64, threshold: f64) -> Gate {
    Gate {
        name: name.to_owned(),
        item: item.to_owned(),
        base: Some(0.65),
        candidate: Some(0.65 + value),
        value: Some(value),
        unit: "",
        side_unit: "",
        threshold: Some(threshold),
        margin: Some(1.0 - value / threshold),
        standard_error: (value > 0.02).then_some(0.1 * value),
        passed: value <= threshold,
        waived: false,
        source: "default".to_owned(),
        explanation: format!(
            "The {name} of the candidate against that of the base, over all pixels that show a surface."
        ),
    }
}

pub fn gates() -> Vec<Gate> {
    let mut gates = vec![
        gate("image.flip", "lit/visibility_on", 0.012, 0.05),
        gate("leak.light", "dark/visibility_on", 0.5, 0.02),
        gate("irradiance.mean", HOSTILE, 0.031, 0.004),
        gate("probes.worst", "two_rooms_open.probes", 0.03, 0.2),
    ];
    gates.push(Gate {
        passed: false,
        waived: true,
        source: "--allow-scene-change".to_owned(),
        ..gate("scene", "", 1.0, 0.5)
    });
    gates.push(Gate { threshold: None, margin: None, unit: "s", ..gate("time.bake", "bake", 0.083, 1.0) });
    gates.push(Gate { value: None, margin: None, base: None, candidate: None, ..gate("image.psnr", "lit", 0.0, 1.0) });
    gates.extend((0..16).map(|i| gate("leak.dark", &format!("camera {i}"), 0.001 * f64::from(i), 0.02)));
    sort(&mut gates);
    gates
}

/// A page of these pairs.
fn page_of(mut images: Vec<Layer>) -> String {
    let side = |label: &str| SideReport {
        path: format!("out/{label}/{HOSTILE}"),
        kind: "render folder".to_owned(),
        items: 1,
        seed: Some(7),
        config: Some("()".to_owned()),
        scene_blake3: Some("4f1ab0c2".repeat(8)),
    };
    let row = |i: usize| ProbeRow {
        index: 17 * i,
        candidate_index: 17 * i,
        position_m: [i as f64 - 3.5, 1.25, 0.125 * i as f64],
        state_base: ProbeState::Active,
        state_candidate: if i == 1 { ProbeState::InsideGeometry } else { ProbeState::Active },
        moved_m: 0.0,
        irradiance_base: 1.0,
        irradiance_candidate: 1.0,
        irradiance_difference: 0.4,
        irradiance_difference_relative: 0.4 / (1.0 + i as f64),
        distance_difference_m: (i > 2).then_some(0.03),
    };
    let figure = |item: &str, name: &str, base: f64, candidate: f64| Figure {
        item: item.to_owned(),
        name: name.to_owned(),
        base: Some(base),
        candidate: Some(candidate),
        difference: Some(candidate - base),
    };
    let gates = gates();
    let report = DiffReport {
        base: side("base"),
        candidate: side("candidate"),
        verdict: Verdict::of(&gates),
        gates,
        probes: vec![ProbesReport {
            item: "two_rooms_open.probes".to_owned(),
            figures: json!({"probes_base": 300, "probes_candidate": 300, "irradiance_base": 1.271, "irradiance_candidate": 1.05}),
            worst: (0..10).map(row).collect(),
            changes_percent: (0..300).map(|i| (i as f32 * 0.7).sin().powi(5) * 20.0).collect(),
            distance_differences_m: Vec::new(),
        }],
        figures: vec![
            figure("lit", "methods.visibility_on.shade_ms.median", 12.3, 11.9),
            figure("lit", "peak_memory_bytes", 3.0e8, 2.9e8),
            figure(HOSTILE, HOSTILE, 1.0, 2.0),
        ],
        added: vec!["dark/extra.exr".to_owned()],
        missing: vec![HOSTILE.to_owned()],
        commands: vec![
            Command {
                purpose: "Bake the candidate".to_owned(),
                line: "lightprobe bake scenes/two_rooms_open.glb -o candidate.probes --set grid.spacing_m=1 --set query.visibility=none --seed 7".to_owned(),
            },
            Command { purpose: "Compare".to_owned(), line: format!("lightprobe diff-report base '{HOSTILE}' -o diff") },
        ],
        config_changes: Some(vec![
            ConfigChange {
                key: "query.visibility".to_owned(),
                base: Some("moments".to_owned()),
                candidate: Some("none".to_owned()),
            },
            ConfigChange { key: HOSTILE.to_owned(), base: Some(HOSTILE.to_owned()), candidate: None },
        ]),
        notes: vec!["Same seed and configuration of capture: noise explains nothing.".to_owned()],
        ..DiffReport::default()
    };
    let pairs = images.len();
    let packed = images.iter_mut().map(|layer| {
        let pixels = layer.base.pixels.iter().zip(&layer.candidate.pixels);
        layer.difference = pixels.map(|(base, candidate)| luminance(*candidate - *base)).collect();
        shown::image(layer, pairs).unwrap()
    });
    let plots = vec![context! {
        title => "Error against time",
        svg => "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 400 200\"><script>window.boom=2</script>\
              <image href=\"http://example.org/x.png\"/><path d=\"M20 20 L380 180\" stroke=\"#06c\"/></svg>",
    }];
    shown::page(&report, packed.collect(), plots).unwrap()
}

/// Three pairs: light with a pixel that is no number, a hostile name, a PNG.
pub fn page() -> String {
    let mut first = pair("lit/visibility_on: beauty", WIDTH, HEIGHT, light);
    first.candidate.pixels[(NAN_AT.1 * WIDTH + NAN_AT.0) as usize] = Vec3::new(0.1, f32::NAN, 0.1);
    let second = pair(HOSTILE, 48, 20, |side, x, y| light(side, x % WIDTH, y % HEIGHT) * 1.0e4);
    let mut third =
        pair("probes.png", 40, 30, |side, x, y| Vec3::new(x as f32 / 40.0, y as f32 / 30.0, 0.5 * side as f32));
    (third.report.is_display, third.report.exposure_ev, third.report.unit) = (true, None, "");
    third.report.judged = false;
    page_of(vec![first, second, third])
}

/// Pairs of 1920 × 1080 pixels with smooth shading, edges, texture and, with `noise`, relative noise of that size.
pub fn large_page(pairs: u32, noise: f32) -> String {
    let of = |p: u32| {
        move |side: usize, x: u32, y: u32| {
            let (u, v) = (x as f32 / 1920.0, y as f32 / 1080.0);
            let wall = if (u * 5.0).fract() < 0.2 + 0.4 * v { 0.8 } else { 0.25 };
            let shade = (0.2 + (3.1 * u + p as f32).sin().abs()) / (0.3 + (u - 0.4).powi(2) + (v - 0.6).powi(2));
            let tile = if ((x / 60) ^ (y / 60)) & 1 == 0 { 1.0 } else { 0.7 };
            // Any well-mixed bits do: they only must not compress.
            let mut bits = x.wrapping_mul(0x9E37_79B9)
                ^ y.wrapping_mul(0x85EB_CA6B)
                ^ (side as u32 + 2 * p).wrapping_mul(0xC2B2_AE35);
            for _ in 0..2 {
                bits = (bits ^ (bits >> 15)).wrapping_mul(0x2C1B_3C6D);
            }
            let grain = 1.0 + noise * ((bits >> 8) as f32 / (1 << 24) as f32 - 0.5);
            let change = if side == 1 { 1.0 + 0.3 * (4.0 * v).sin() * u } else { 1.0 };
            Vec3::new(0.9, 0.75, 0.6) * wall * shade * tile * grain * change
        }
    };
    page_of((0..pairs).map(|p| pair(&format!("camera {p}"), 1920, 1080, of(p))).collect())
}

//! Two rooms, a small lamp in the one, a door to the other: at high albedo light goes back and forth for long.

use glam::Vec2;
use lightprobe::math::random::{Purpose, Random};
use lightprobe::math::sampling::triangle_barycentric;
use lightprobe::scene::TriangleIndex;

use super::case::{Bound, Case, Found, shared};
use super::furnaces::ALBEDOS;
use super::look::{Baked, bake, difference, irradiance_at};
use super::rooms::{LAMP_M, Lamp, Rooms, SPACING_M, Wall};

/// Of the lamp, W·m⁻²·sr⁻¹.
const RADIANCE: f64 = 10.0;

fn rooms(albedo: f64) -> Rooms {
    Rooms { albedo, wall: Wall::Door(0.1), lamp: Lamp::Area(RADIANCE), scale: 1.0, shift: 0.0, spacing_m: SPACING_M }
}

/// Points on the surfaces, in all.
const POINTS: usize = 20_000;

/// Watts that arrive at the surfaces, from the irradiance that the probes give at random points of them.
fn incident_w(baked: &Baked) -> f64 {
    baked.with_query(|scene, query| {
        let mesh = &scene.mesh;
        let count = mesh.triangles.len() as u32;
        let total: f32 = (0..count).map(|t| mesh.area(TriangleIndex(t))).sum();
        let mut random = Random::new(0, Purpose::Path, 0, 0);
        let mut watts = 0.0;
        for t in (0..count).map(TriangleIndex) {
            let n = (POINTS as f32 * mesh.area(t) / total).ceil() as usize;
            let corners = mesh.corners(t);
            let normal = mesh.geometric_normal(t);
            let mut point = || {
                let b = triangle_barycentric(Vec2::new(random.uniform(), random.uniform()));
                corners[0] + (corners[1] - corners[0]) * b.x + (corners[2] - corners[0]) * b.y
            };
            let sum: f64 = (0..n).map(|_| irradiance_at(query, point(), normal)).sum();
            watts += sum / n as f64 * f64::from(mesh.area(t));
        }
        watts
    })
}

/// Watts that the surfaces take up ÷ those that the lamp sends out.
///
/// What comes straight from the lamp is all of its power, whatever probes a metre apart make of it; what has been reflected
/// is what the probes give beyond what they give in black rooms, whose probes stand in the same places.
fn absorbed_share(baked: &Baked, black: &Baked, albedo: f64) -> f64 {
    let emitted = std::f64::consts::PI * RADIANCE * LAMP_M * LAMP_M;
    (1.0 - albedo) * (emitted + incident_w(baked) - incident_w(black)) / emitted
}

pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let black = shared(|| bake(rooms(0.0).gltf(), &rooms(0.0).words()));
    cases.push(Case::new(
        "door",
        "albedo 0.99, half the spacing",
        "of what the absorbed power is off, left",
        Bound::AtMost(0.75),
        || {
            let off = |spacing_m: f64| {
                let [baked, black] = [0.99, 0.0].map(|albedo| {
                    let rooms = Rooms { spacing_m, ..rooms(albedo) };
                    bake(rooms.gltf(), &rooms.words())
                });
                (absorbed_share(&baked, &black, 0.99) - 1.0).abs()
            };
            let (whole, half) = (off(SPACING_M), off(SPACING_M / 2.0));
            Found { figure: half / whole, note: format!("{whole:.4}, then {half:.4}") }
        },
    ));
    for albedo in ALBEDOS {
        let baked = shared(move || bake(rooms(albedo).gltf(), &rooms(albedo).words()));
        let name = format!("albedo {albedo}");
        let of = baked.clone();
        cases.push(Case::new("door", &name, "solver: change left ÷ largest", Bound::AtMost(1e-4), move || {
            assert_eq!(of.report["converged"], true, "the solver gave up");
            let note = format!("{} sweeps", of.report["solver"]["operator_applications"]);
            let sweeps = of.report["bounces"].as_array().expect("a list");
            Found { figure: sweeps.last().expect("a sweep")["residual"].as_f64().expect("a number"), note }
        }));
        if albedo > 0.0 {
            let of = baked.clone();
            cases.push(Case::new("door", &name, "solver's error bound ÷ largest", Bound::AtMost(1e-3), move || {
                of.report["solver"]["error_bound_relative"].as_f64().expect("a bound")
            }));
            let of = baked.clone();
            // Plain sweeps would be 44 at 0.9, 4,600 at 0.999.
            cases.push(Case::new("door", &name, "to 1 % in 30 sweeps: difference", Bound::AtMost(1e-2), move || {
                let quick =
                    bake(rooms(albedo).gltf(), &format!("{} --set solver.max_sweeps=30", rooms(albedo).words()));
                difference(&of.texels(), &quick.texels())
            }));
        }
        let of = baked.clone();
        let black = black.clone();
        // Each point hands light to probes up to a metre away, and these need not hand as much back: an error of the
        // grid, of the first order in its spacing (the next row), that the bounces add up and the solver has no part in.
        cases.push(Case::new("door", &name, "absorbed ÷ emitted power, off 1 by", Bound::AtMost(0.15), move || {
            let share = absorbed_share(&of, &black, albedo);
            Found { figure: (share - 1.0).abs(), note: format!("{share:.4} of it") }
        }));
        let of = baked.clone();
        cases.push(Case::new("door", &name, "leak.light, both rooms", Bound::AtMost(1e-3), move || {
            let [lit, dark] = ["lit", "dark"].map(|c| of.look(&format!("--camera {c}")).leak("light"));
            lit.max(dark)
        }));
        // So many bounces that the largest of them is below 1e-6 of the sum; more would take minutes at 0.999.
        let plain = match albedo {
            0.0 => 1,
            0.5 => 20,
            0.9 => 132,
            0.99 => 1375,
            _ => continue,
        };
        cases.push(Case::new("door", &name, "against plain bounces, all of them", Bound::AtMost(3e-4), move || {
            let words = format!(
                "{} --set solver.max_bounces={plain} --set solver.max_sweeps={plain} --set solver.tolerance=0",
                rooms(albedo).words()
            );
            let by_hand = bake(rooms(albedo).gltf(), &words);
            Found { figure: difference(&by_hand.texels(), &baked.texels()), note: format!("{plain} bounces") }
        }));
    }
    cases
}

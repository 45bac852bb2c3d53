//! Probes where they should not be, and grids that are hardly grids.

use super::case::{Bound, Case, Found, shared};
use super::look::{Baked, bake, bake_dark};
use super::rooms::{AT_FURNACE, IN_FURNACE, furnace, in_furnace, outside_of};
use crate::shapes::{add, diffuse};

const EXACT: f64 = 2e-4 + 1e-5;

/// One probe at a point of the furnace of albedo 0.5.
fn at(place: [f64; 3], words: &str) -> String {
    let place = serde_json::json!(place);
    format!(
        "--set encoding.irradiance=f32 --set capture.resolution=16 --set grid.divisions=(1,1,1) \
         --set grid.bounds={{\"min\":{place},\"max\":{place}}} {words}"
    )
}

fn count(baked: &Baked, key: &str) -> f64 {
    baked.report["numerics"][key].as_f64().expect("a count")
}

pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let inside = [
        ("on a wall", [-1.0, 0.2, 0.1]),
        ("in an edge", [-1.0, -1.0, 0.1]),
        ("in a corner", [-1.0; 3]),
        ("one probe", [0.1, 0.2, -0.1]),
    ];
    for (name, place) in inside {
        cases.push(Case::new("probe", name, "against πLe/(1 − ρ)", Bound::AtMost(EXACT), move || {
            let baked = bake(furnace(0.5), &at(place, "--set capture.emission=gathered"));
            baked.look(AT_FURNACE);
            baked.worst_mean(in_furnace(0.5))
        }));
        // Where it stays exactly on the surface, rays start on it: they may pass, which loses light, but none is made.
        cases.push(Case::new(
            "probe",
            format!("{name}, not moved"),
            "÷ πLe/(1 − ρ)",
            Bound::AtMost(1.0 + EXACT),
            move || {
                let baked =
                    bake(furnace(0.5), &at(place, "--set capture.emission=gathered --set placement.relocate=false"));
                baked.look_dark(AT_FURNACE);
                baked.texels().into_iter().fold(0.0, f64::max) / in_furnace(0.5)
            },
        ));
    }
    for (name, place) in [("in a wall of 2 m", [5.0, 0.0, 0.0]), ("outside of the room", [-2.5, 0.0, 0.0])] {
        cases.push(Case::new("probe", name, "probes inside geometry", Bound::AtLeast(1.0), move || {
            let mut gltf = furnace(0.5);
            add(&mut gltf, &outside_of([4.0, -1.0, -1.0], [6.0, 1.0, 1.0]), diffuse([0.5; 3], [0.0; 3]));
            // What stands beside the room is lit by its probes only, of which there are none.
            let baked = bake_dark(gltf, &at(place, "--set placement.keep_unsampled=true"));
            assert_eq!(baked.look_dark(AT_FURNACE).mean("visibility_on"), 0.0, "light from nowhere");
            count(&baked, "probes_inside_geometry")
        }));
    }
    for divisions in ["(1,1,5)", "(1,5,1)", "(5,1,1)", "(3,1,3)"] {
        cases.push(Case::new(
            "grid",
            format!("{divisions} probes"),
            "against πLe/(1 − ρ)",
            Bound::AtMost(EXACT),
            move || {
                let baked = bake(furnace(0.5), &format!("{IN_FURNACE} --set grid.divisions={divisions}"));
                let seen = baked.look(AT_FURNACE).mean("visibility_on");
                baked.worst_mean(in_furnace(0.5)).max((seen / in_furnace(0.5) - 1.0).abs())
            },
        ));
    }
    // Rays of the pilot are counted, what they meet is not.
    let air = shared(|| bake(furnace(0.5), &format!("{IN_FURNACE} --set capture.rays.octahedral.guided=0")));
    let of = air.clone();
    cases.push(Case::new("grid", "fitted to the air", "against πLe/(1 − ρ)", Bound::AtMost(EXACT), move || {
        of.worst_mean(in_furnace(0.5))
    }));
    cases.push(Case::new(
        "grid",
        "fitted to the air",
        "hits outside, counted ÷ rays",
        Bound::AtLeast(1.0),
        move || count(&air, "hits_outside_volume") / air.report["rays"]["primary"].as_f64().expect("a count"),
    ));
    cases.extend(large());
    cases
}

/// 64³ probes at a resolution that makes them cheap.
fn large() -> [Case; 2] {
    let baked = shared(|| {
        let words = "--set encoding.irradiance=f32 --set grid.divisions=(64,64,64) --set placement.keep_unsampled=true \
                     --set placement.rays=8 --set capture.resolution=2 --set filter.irradiance_resolution=2 \
                     --set capture.emission=gathered --set query.visibility=none \
                     --set grid.bounds={\"min\":[-0.9,-0.9,-0.9],\"max\":[0.9,0.9,0.9]}";
        bake(furnace(0.5), words)
    });
    let of = baked.clone();
    [
        Case::new("grid", "64³ probes", "against πLe/(1 − ρ)", Bound::AtMost(EXACT), move || {
            let seconds = of.report["time_s"]["total"].as_f64().expect("a time");
            let note = format!("{} probes, {seconds:.1} s", of.report["probes_active"]);
            Found { figure: of.worst_mean(in_furnace(0.5)), note }
        }),
        // Captures of 4 surfels of 48 bytes, three copies of maps of 4² texels of 16 bytes, the file, and what the sweep
        // keeps of each probe: about 2 kB each.
        Case::new("grid", "64³ probes", "peak memory", Bound::AtMost(1.0), move || {
            baked.report["peak_memory_bytes"].as_f64().expect("bytes") / f64::from(1 << 30)
        })
        .in_unit(" GiB"),
    ]
}

//! Distances: no half floats, no cancellation, and a miss is the longest distance there is.

use super::case::{Bound, Case, Shared, shared};
use super::look::{Baked, bake, bake_dark, scaled, worse};
use super::rooms::{AT_FURNACE, furnace, in_furnace, under_root};
use crate::common::Gltf;
use crate::shapes::{add, diffuse, quad};

/// Probes a unit apart with distance maps, for a room of this size.
fn words(scale: f64) -> String {
    let cube = |x: f64| serde_json::json!([x, x, x]);
    let (low, high) = (cube(-0.5 * scale), cube(0.5 * scale));
    format!(
        "--set query.visibility={{\"moments\":{{\"power\":1,\"floor\":0}}}} --set plan=keep_everything \
         --set encoding.irradiance=f32 --set capture.resolution=16 --set grid.divisions=(2,2,2) \
         --set grid.bounds={{\"min\":{low},\"max\":{high}}}"
    )
}

/// 1.5 diagonals of a cell.
fn clamp(scale: f64) -> f64 {
    1.5 * 3f64.sqrt() * scale
}

fn room(scale: f64) -> Baked {
    let mut gltf = furnace(0.5);
    under_root(&mut gltf, serde_json::json!({ "scale": [scale, scale, scale] }));
    bake(gltf, &words(scale))
}

fn distances(baked: &Baked, scale: f64) -> Vec<(f64, f64)> {
    let file = &baked.file;
    let maps = file.active().into_iter().flat_map(|p| file.distances(p));
    maps.map(|(_, mean, deviation)| (mean / scale, deviation / scale)).collect()
}

const STEP: f64 = 1.1 / 65_535.0;

pub fn cases() -> Vec<Case> {
    let base: Shared<Baked> = shared(|| room(1.0));
    let mut cases = Vec::new();
    for scale in [1e-4, 16.0, 300.0, 1e4] {
        let there = shared(move || room(scale));
        let name = format!("room of ±{scale} m");
        let (a, b) = (base.clone(), there.clone());
        cases.push(Case::new(
            "distance",
            &name,
            "mean and deviation against ±1 m, ÷ clamp",
            Bound::AtMost(STEP),
            move || {
                let (a, b) = (distances(&a, 1.0), distances(&b, scale));
                assert_eq!(a.len(), b.len());
                let off = a.iter().zip(&b).map(|(a, b)| worse((a.0 - b.0).abs(), (a.1 - b.1).abs()));
                off.fold(0.0, worse) / clamp(1.0)
            },
        ));
        cases.push(Case::new(
            "distance",
            &name,
            "furnace with moments against πLe/(1 − ρ)",
            Bound::AtMost(2e-4 + 1e-5),
            move || {
                there.look(&scaled(AT_FURNACE, scale));
                there.worst_mean(in_furnace(0.5))
            },
        ));
    }
    cases.push(Case::new(
        "distance",
        "probes that see only sky",
        "against the clamp; deviation",
        Bound::AtMost(STEP),
        || {
            let mut gltf = Gltf::new();
            add(
                &mut gltf,
                &quad([0.0, -300.0, 0.0], [0.0, 0.0, 0.01], [0.01, 0.0, 0.0], 1),
                diffuse([0.5; 3], [0.0; 3]),
            );
            let baked = bake_dark(gltf, &format!("{} --env 1,1,1 --set placement.keep_unsampled=true", words(1.0)));
            assert_eq!(baked.file.active().len(), 8);
            let off = |(mean, deviation): (f64, f64)| worse((mean / clamp(1.0) - 1.0).abs(), deviation);
            distances(&baked, 1.0).into_iter().map(off).fold(0.0, worse)
        },
    ));
    cases
}

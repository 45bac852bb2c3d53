//! Closed rooms of constant radiance: E = πLe/(1 − ρ), known exactly, at every albedo.

use super::case::{Bound, Case, shared};
use super::look::bake;
use super::rooms::{AT_FURNACE, IN_FURNACE, furnace, in_furnace};

/// From none to stiff.
pub const ALBEDOS: [f64; 5] = [0.0, 0.5, 0.9, 0.99, 0.999];

/// Relative error of a furnace: what the solver may leave (its tolerance of 1e-4, judged by an estimate of the ratio: a
/// factor of two), and what a bounce's rounding becomes when 1/(1 − ρ) bounces add up: sums of a thousand f32 are off by
/// 2e-6 at most when their roundings add at random (√1000 × 6e-8).
fn tolerance(albedo: f64) -> f64 {
    2e-4 + 2e-6 / (1.0 - albedo)
}

pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for emission in ["sampled", "gathered"] {
        for albedo in ALBEDOS {
            let name = format!("albedo {albedo}, emission {emission}");
            let baked =
                shared(move || bake(furnace(albedo), &format!("{IN_FURNACE} --set capture.emission={emission}")));
            let looked = baked.clone();
            cases.push(Case::new(
                "furnace",
                &name,
                "probes against πLe/(1 − ρ)",
                Bound::AtMost(tolerance(albedo)),
                move || {
                    assert_eq!(baked.report["converged"], true, "the solver gave up");
                    baked.worst_mean(in_furnace(albedo))
                },
            ));
            cases.push(Case::new(
                "furnace",
                &name,
                "picture against it",
                Bound::AtMost(tolerance(albedo)),
                move || (looked.look(AT_FURNACE).mean("visibility_on") / in_furnace(albedo) - 1.0).abs(),
            ));
        }
    }
    cases
}

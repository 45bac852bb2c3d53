//! Every way to store irradiance, against the furnace's answer.

use super::case::{Bound, Case};
use super::look::bake;
use super::rooms::{AT_FURNACE, IN_FURNACE, furnace, in_furnace};

/// What the solver may leave, see the furnaces.
const SOLVER: f64 = 2e-4;

pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    // Half a step of the mantissa: 10 bits; 5 bits, those of blue.
    for (format, rounding) in [("f32", 1e-6), ("f16", 2f64.powi(-11)), ("r11g11b10f", 2f64.powi(-6))] {
        // Decoding takes the fifth power, which makes five times of a small relative error, and a little more of 1.6 %.
        for (curve, gain) in [("linear", 1.0), ("gamma5_over_2pi", 5.2)] {
            for border in [0, 1] {
                let bound = Bound::AtMost(SOLVER + gain * rounding);
                let name = format!("{format}, {curve}, border {border}");
                cases.push(Case::new("encoding", name, "furnace against πLe/(1 − ρ)", bound, move || {
                    let words = format!(
                        "{IN_FURNACE} --set encoding.irradiance={format} --set encoding.curve={curve} --set encoding.border={border}"
                    );
                    let baked = bake(furnace(0.5), &words);
                    let seen = baked.look(AT_FURNACE).mean("visibility_on");
                    baked.worst_mean(in_furnace(0.5)).max((seen / in_furnace(0.5) - 1.0).abs())
                }));
            }
        }
    }
    cases
}

//! One judged figure, and what becomes of all of them.

use serde::Serialize;

/// A figure of the comparison, the bound that it is held to, and whether it holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gate {
    /// Such as "irradiance.mean", "leak.light", "scene", "image.flip", "probes.worst".
    pub name: String,
    /// What of the sides: "lit/visibility_on", "bake", "two_rooms.probes"; empty for the whole.
    pub item: String,
    /// The sides' own figures, where they have one.
    pub base: Option<f64>,
    pub candidate: Option<f64>,
    /// The judged figure: a difference, a ratio − 1, and so on. `None`: undefined, which fails unless it is so on both sides.
    pub value: Option<f64>,
    /// Unit of `value` and `threshold`, such as "W/m²" or "%"; empty for pure numbers.
    pub unit: &'static str,
    /// What the value must not exceed. `None`: only shown.
    pub threshold: Option<f64>,
    /// 1 − value/threshold: 1 untouched, 0 at the limit, negative beyond.
    pub margin: Option<f64>,
    /// Of `value`, where known.
    pub standard_error: Option<f64>,
    pub passed: bool,
    /// Would fail, but a flag allows it.
    pub waived: bool,
    /// Where the threshold came from: "default", "FILE.ron: images.flip", "--allow-scene-change".
    pub source: String,
    /// One plain sentence.
    pub explanation: String,
}

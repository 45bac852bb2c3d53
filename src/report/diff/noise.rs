//! Whether the two sides drew the same random numbers.
//!
//! Where they did, what did not change is equal to the last digit, and every difference is a change. Where they did not, probes
//! differ by their noise, and a picture by that of all the probes that light it.

use serde_json::Value;

/// What the random numbers of both sides have to do with each other.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Noise {
    /// Nothing tells, as of pictures alone: taken for the same.
    #[default]
    Unknown,
    Same,
    Other,
}

impl Noise {
    /// From the sides' seeds.
    pub fn of(seeds: [Option<u64>; 2]) -> Noise {
        match seeds {
            [Some(a), Some(b)] if a == b => Noise::Same,
            [Some(_), Some(_)] => Noise::Other,
            _ => Noise::Unknown,
        }
    }

    /// Of two reports of one kind: all of the seeds that went into them.
    pub fn of_reports(reports: [&Value; 2]) -> Noise {
        let number = |key: &str| Noise::of(reports.map(|report| report[key].as_u64()));
        let [a, b] = reports.map(|report| report["seeds"].as_array());
        match (a, b) {
            // A sweep.
            (Some(a), Some(b)) => {
                if a == b {
                    Noise::Same
                } else {
                    Noise::Other
                }
            }
            // A render's own seed is that of its lamps' samples; its probes have that of their bake.
            _ if reports.iter().any(|report| report["command"] == "render") => number("seed").and(number("bake_seed")),
            _ => number("seed"),
        }
    }

    /// A standard error of a mean, percent, as estimated from how unequally its parts changed, but no more than noise makes it. What is
    /// broken is uneven too, and must not excuse itself: with the same random numbers three of it are a percent at most; with others
    /// 21 %, where the largest change of a mean between seeds was 18 %.
    pub fn at_most(self, error: f64) -> f64 {
        error.min(if self == Noise::Same { 1.0 / 3.0 } else { 7.0 })
    }

    /// The same of the noise of single probes, percent: between seeds it was 13 in the worst scene; with the same seed twenty of these,
    /// the default of `probes.worst`, are a fifth of a probe's own light.
    pub fn of_probe_at_most(self, error: f64) -> f64 {
        error.min(if self == Noise::Same { 1.0 } else { 14.0 })
    }

    fn and(self, other: Noise) -> Noise {
        match (self, other) {
            (Noise::Other, _) | (_, Noise::Other) => Noise::Other,
            (Noise::Same, Noise::Same) => Noise::Same,
            _ => Noise::Unknown,
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn every_seed_of_a_side_counts() {
        let render = |seed: u64, bake: Value| json!({"command": "render", "seed": seed, "bake_seed": bake});
        for (a, b, expected) in [
            (render(0, json!(1)), render(0, json!(1)), Noise::Same),
            (render(0, json!(1)), render(0, json!(2)), Noise::Other),
            (render(0, json!(1)), render(3, json!(1)), Noise::Other),
            (render(0, json!(null)), render(0, json!(1)), Noise::Unknown),
            (json!({"command": "bake", "seed": 4}), json!({"command": "bake", "seed": 4}), Noise::Same),
            (json!({"seed": 0, "seeds": [0, 1]}), json!({"seed": 0, "seeds": [0, 1]}), Noise::Same),
            (json!({"seed": 0, "seeds": [0, 1]}), json!({"seed": 0, "seeds": [0, 1, 2]}), Noise::Other),
            (json!({}), json!({}), Noise::Unknown),
        ] {
            assert_eq!(Noise::of_reports([&a, &b]), expected, "{a} {b}");
        }
    }
}

//! How light comes from surface to surface.

use serde::{Deserialize, Serialize};

use crate::probe::capture::HitLight;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Transport {
    /// Through the probes: their irradiance is asked at every hit, bounce after bounce.
    Bounces(BounceSettings),
    /// Through the probes, one after another, each seeing the new values of those before it.
    InOrder(InOrderSettings),
    /// By this many full paths from every hit: the truth at the probes, up to resolution and noise.
    Paths { paths: u32 },
}

impl Default for Transport {
    fn default() -> Self {
        Transport::Bounces(BounceSettings::default())
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BounceSettings {
    /// Most reflections between a light and the surface that the probes shade; 0 leaves light that comes straight from
    /// emitters and the sky. `None`: all.
    pub max_bounces: Option<u32>,
    /// Most iterations where the number of bounces is not limited, however many are still missing.
    pub max_iterations: u32,
    pub acceleration: Acceleration,
    /// Stop when the bounces still missing are estimated below this share of the largest irradiance.
    pub tolerance: f32,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InOrderSettings {
    /// Stop when no probe changes by this share of its largest unknown.
    pub tolerance: f32,
    /// Most passes over all probes.
    pub most: u32,
}

impl Default for InOrderSettings {
    fn default() -> Self {
        InOrderSettings { tolerance: 1e-3, most: 256 }
    }
}

/// Whether iterations are combined so that few do for many bounces. With a number of bounces they never are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Acceleration {
    Never,
    /// When plain iterations would go on for long.
    Auto,
    /// From the second iteration on.
    Always,
}

impl Default for BounceSettings {
    fn default() -> Self {
        BounceSettings { max_bounces: None, max_iterations: 256, acceleration: Acceleration::Auto, tolerance: 1e-4 }
    }
}

/// Iterations that combining them takes at most, by and large: 4 to 8 in the scenes of the project, 12 for stiff ones.
const ACCELERATED_ITERATIONS: u32 = 12;

impl BounceSettings {
    /// Whether differences of iterates are worth keeping.
    pub fn may_accelerate(&self) -> bool {
        self.max_bounces.is_none() && self.acceleration != Acceleration::Never
    }

    /// Bounces, or iterations, after which there are no more.
    pub fn most(&self) -> u32 {
        self.max_bounces.unwrap_or(self.max_iterations)
    }

    /// Iterations after which a geometric series in `ratio`, the mean albedo, leaves less than the tolerance of the light.
    pub fn expected_iterations(&self, ratio: f64) -> u32 {
        let most = self.most().min(if self.may_accelerate() { ACCELERATED_ITERATIONS } else { u32::MAX });
        let tolerance = f64::from(self.tolerance);
        if ratio <= 0.0 || tolerance <= 0.0 {
            return if ratio <= 0.0 { most.min(1) } else { most };
        }
        let bounces = ((tolerance * (1.0 - ratio) / ratio).ln() / ratio.ln()).ceil();
        // `as` saturates.
        (bounces.max(1.0) as u32).min(most)
    }
}

impl Transport {
    /// What a captured hit is lit by when it is captured.
    pub fn hit_light(&self) -> HitLight {
        match self {
            Transport::Bounces(BounceSettings { max_bounces: Some(0), .. }) => HitLight::None,
            Transport::Bounces(_) | Transport::InOrder(_) => HitLight::Direct,
            Transport::Paths { paths } => HitLight::Paths(*paths),
        }
    }

    /// Whether captures hold all light, so that nothing is left to iterate.
    pub fn is_complete(&self) -> bool {
        matches!(self, Transport::Paths { .. })
    }

    /// Whether a number of bounces was asked for, so that light is missing on purpose.
    pub fn is_limited(&self) -> bool {
        matches!(self, Transport::Bounces(BounceSettings { max_bounces: Some(_), .. }))
    }

    /// How the solver iterates: paths bring all light to the hits, which is one reflection from the probes.
    pub fn iteration(&self) -> BounceSettings {
        match self {
            Transport::Bounces(settings) => settings.clone(),
            Transport::InOrder(InOrderSettings { tolerance, most }) => BounceSettings {
                max_bounces: None,
                max_iterations: *most,
                acceleration: Acceleration::Never,
                tolerance: *tolerance,
            },
            Transport::Paths { .. } => BounceSettings { max_bounces: Some(1), ..BounceSettings::default() },
        }
    }

    /// The keys that let it go on for longer.
    pub fn patience_keys(&self) -> &'static str {
        match self {
            Transport::InOrder(_) => "transport.in_order.most or transport.in_order.tolerance",
            _ => "transport.bounces.max_iterations or transport.bounces.tolerance",
        }
    }

    /// The same without a limit of bounces, iterated to a share of its tolerance, at least `least`.
    pub fn settled(&self, share: f32, least: f32) -> Transport {
        match self {
            Transport::Bounces(settings) => Transport::Bounces(BounceSettings {
                max_bounces: None,
                tolerance: (share * settings.tolerance).max(least),
                ..settings.clone()
            }),
            Transport::InOrder(settings) => Transport::InOrder(InOrderSettings {
                tolerance: (share * settings.tolerance).max(least),
                ..settings.clone()
            }),
            Transport::Paths { .. } => self.clone(),
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        match self {
            Transport::Bounces(BounceSettings { max_bounces, max_iterations, tolerance, .. }) => {
                if let Some(bounces) = max_bounces {
                    let holds = *bounces <= 1 << 20;
                    rule(
                        "transport.bounces.max_bounces",
                        bounces.to_string(),
                        holds,
                        "use 0 to 1048576, or None for all",
                    );
                }
                let holds = (1..=1 << 20).contains(max_iterations);
                rule("transport.bounces.max_iterations", max_iterations.to_string(), holds, "use 1 to 1048576");
                let holds = tolerance.is_finite() && *tolerance >= 0.0;
                let text = "use a finite number, not negative";
                rule("transport.bounces.tolerance", tolerance.to_string(), holds, text);
            }
            Transport::InOrder(InOrderSettings { tolerance, most }) => {
                let holds = tolerance.is_finite() && *tolerance >= 0.0;
                let text = "use a finite number, not negative";
                rule("transport.in_order.tolerance", tolerance.to_string(), holds, text);
                let holds = (1..=1 << 20).contains(most);
                rule("transport.in_order.most", most.to_string(), holds, "use 1 to 1048576");
            }
            Transport::Paths { paths } => {
                rule("transport.paths.paths", paths.to_string(), (1..=1 << 20).contains(paths), "use 1 to 1048576");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_bounces_follows_from_the_albedo() {
        // 0.5¹⁴ < 10⁻⁴ < 0.5¹³.
        let expected = |ratio, tolerance, most| {
            BounceSettings { max_bounces: Some(most), tolerance, ..Default::default() }.expected_iterations(ratio)
        };
        assert_eq!(expected(0.5, 1e-4, 64), 14);
        assert_eq!(expected(0.999, 1e-4, 64), 64);
        assert_eq!(expected(0.0, 1e-4, 64), 1);
        assert_eq!(expected(0.5, 0.0, 64), 64);
        assert_eq!(expected(0.5, 1e-4, 0), 0);
        assert_eq!(BounceSettings::default().expected_iterations(0.999), ACCELERATED_ITERATIONS);
    }
}

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
    /// Through the probes, in frames of new rays that are mixed into what came before.
    Frames(FrameSettings),
    /// By a ray from every hit to the next surface, whose light the probes around there tell.
    Tracing(TracingSettings),
}

/// How frames follow one another, and when they end (Majercik et al. 2019, 2021; the sources give no end).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FrameSettings {
    /// Share of what came before that stays, in the domain in which irradiance is stored.
    pub hysteresis: f32,
    /// The end: the least variability of so many frames is not below that of as many before by the share `fall`.
    pub window: u32,
    pub fall: f32,
    /// Fewest frames, and most.
    pub least: u32,
    pub most: u32,
}

impl Default for FrameSettings {
    fn default() -> Self {
        FrameSettings { hysteresis: 0.97, window: 64, fall: 0.01, least: 64, most: 2048 }
    }
}

/// How light is traced from hit to hit (Luo 2022).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TracingSettings {
    /// Most iterations, one reflection each.
    pub iterations: u32,
    /// Stop when no texel gains more than this share of the brightest.
    pub tolerance: f32,
    pub filter: TracingFilter,
}

/// What takes the noise of one ray a texel away.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TracingFilter {
    None,
    /// Means of the texels within `radius`, by a Gaussian of half of it, cosⁿ of the angle between normals, n =
    /// `normal_power`, and a Gaussian of the difference of distances, `distance` of the texel's own wide.
    Bilateral {
        radius: u32,
        normal_power: f32,
        distance: f32,
    },
}

impl Default for TracingSettings {
    /// The source gives no size of its filter.
    fn default() -> Self {
        let filter = TracingFilter::Bilateral { radius: 3, normal_power: 32.0, distance: 0.1 };
        TracingSettings { iterations: 64, tolerance: 1e-3, filter }
    }
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
        InOrderSettings { tolerance: 1e-3, most: 1024 }
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

/// Bounces of a rough solution; where it is read another is added.
const ROUGH_BOUNCES: u32 = 2;

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

/// Plain iterations without end.
fn never() -> BounceSettings {
    BounceSettings { acceleration: Acceleration::Never, ..BounceSettings::default() }
}

impl Transport {
    /// What a captured hit is lit by when it is captured.
    pub fn hit_light(&self) -> HitLight {
        match self {
            Transport::Bounces(BounceSettings { max_bounces: Some(0), .. }) => HitLight::None,
            Transport::Bounces(_) | Transport::InOrder(_) | Transport::Frames(_) | Transport::Tracing(_) => {
                HitLight::Direct
            }
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

    /// Whether probes are captured once, before anything else; else anew in every iteration.
    pub fn captures_once(&self) -> bool {
        !matches!(self, Transport::Frames(_))
    }

    /// Whether emission must be what capture rays meet.
    pub fn needs_gathered_emission(&self) -> bool {
        matches!(self, Transport::Frames(_))
    }

    /// Whether irradiance is mixed with what it was before, in the domain in which it is stored.
    pub fn mixes_samples(&self) -> bool {
        matches!(self, Transport::Frames(_))
    }

    /// Whether what surfaces ask of probes is worked out once for all iterations, where it can be.
    pub fn keeps_rows(&self) -> bool {
        matches!(self, Transport::InOrder(_))
    }

    /// Whether it reads the light of surfaces in the probes' light fields.
    pub fn needs_light_field(&self) -> bool {
        matches!(self, Transport::Tracing(_))
    }

    /// Whether rays may be left out of what a probe learns.
    pub fn may_leave_out(&self) -> bool {
        matches!(self, Transport::Frames(_))
    }

    /// Iterations after which there are no more.
    pub fn most(&self) -> u32 {
        match self {
            Transport::Bounces(_) | Transport::InOrder(_) | Transport::Paths { .. } => self.iteration().most(),
            Transport::Frames(settings) => settings.most,
            Transport::Tracing(settings) => settings.iterations,
        }
    }

    /// Reflections that were asked for; `None` where that is not a number.
    pub fn max_bounces(&self) -> Option<u32> {
        match self {
            Transport::Bounces(_) | Transport::Paths { .. } => self.iteration().max_bounces,
            Transport::InOrder(_) | Transport::Frames(_) | Transport::Tracing(_) => None,
        }
    }

    /// Whether differences of iterates are kept.
    pub fn may_accelerate(&self) -> bool {
        matches!(self, Transport::Bounces(settings) if settings.may_accelerate())
    }

    /// Iterations that light losing all but `ratio` at every reflection is expected to take.
    pub fn expected_iterations(&self, ratio: f64) -> u32 {
        match self {
            Transport::Bounces(_) | Transport::InOrder(_) | Transport::Paths { .. } => {
                self.iteration().expected_iterations(ratio)
            }
            Transport::Frames(settings) => {
                // To a hundredth: each frame mixes 1 − hysteresis of a reflection in.
                let rate = (1.0 - f64::from(settings.hysteresis)) * (1.0 - ratio);
                let frames = if rate > 0.0 { (100f64.ln() / rate).ceil() } else { f64::INFINITY };
                // `as` saturates.
                (frames as u32).saturating_add(settings.window).clamp(settings.least.min(settings.most), settings.most)
            }
            Transport::Tracing(settings) => {
                let plain =
                    BounceSettings { tolerance: settings.tolerance, max_iterations: settings.iterations, ..never() };
                plain.expected_iterations(ratio)
            }
        }
    }

    /// What so many iterations came to that have converged, in words.
    pub fn settled_words(&self, done: u32) -> String {
        match self {
            Transport::Bounces(_) | Transport::Paths { .. } | Transport::Tracing(_) => {
                format!("{done} iterations; what further bounces would add is below the tolerance")
            }
            Transport::InOrder(_) => format!("{done} passes; the last changed no probe by more than the tolerance"),
            Transport::Frames(_) => format!("{done} frames; their variability no longer falls"),
        }
    }

    /// The key of the number of iterations, for who needs more.
    pub fn limit_key(&self) -> &'static str {
        match self {
            Transport::Bounces(_) | Transport::Paths { .. } => "transport.bounces.max_iterations",
            Transport::InOrder(_) => "transport.in_order.most",
            Transport::Frames(_) => "transport.frames.most",
            Transport::Tracing(_) => "transport.tracing.iterations",
        }
    }

    /// How the solver iterates: paths bring all light to the hits, which is one reflection from the probes.
    pub fn iteration(&self) -> BounceSettings {
        match self {
            Transport::Bounces(settings) => settings.clone(),
            Transport::InOrder(InOrderSettings { tolerance, most }) => {
                BounceSettings { max_iterations: *most, tolerance: *tolerance, ..never() }
            }
            Transport::Paths { .. } => BounceSettings { max_bounces: Some(1), ..BounceSettings::default() },
            Transport::Frames(_) | Transport::Tracing(_) => never(),
        }
    }

    /// Plain bounces by which a pilot learns roughly where light is; 0 where light is not brought by bounces.
    pub fn rough_bounces(&self) -> u32 {
        match self {
            Transport::Bounces(settings) => settings.most().min(ROUGH_BOUNCES),
            _ => 0,
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
            Transport::Tracing(settings) => Transport::Tracing(TracingSettings {
                tolerance: (share * settings.tolerance).max(least),
                ..settings.clone()
            }),
            Transport::Paths { .. } | Transport::Frames(_) => self.clone(),
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
            Transport::Frames(FrameSettings { hysteresis, window, fall, least, most }) => {
                let holds = (0.0..1.0).contains(hysteresis);
                let text = "use a number from 0 up to but not including 1";
                rule("transport.frames.hysteresis", hysteresis.to_string(), holds, text);
                rule("transport.frames.fall", fall.to_string(), (0.0..=1.0).contains(fall), "use a number from 0 to 1");
                for (key, value) in [
                    ("transport.frames.window", window),
                    ("transport.frames.least", least),
                    ("transport.frames.most", most),
                ] {
                    rule(key, value.to_string(), (1..=1 << 20).contains(value), "use 1 to 1048576");
                }
            }
            Transport::Tracing(TracingSettings { iterations, tolerance, filter }) => {
                let holds = (1..=1 << 20).contains(iterations);
                rule("transport.tracing.iterations", iterations.to_string(), holds, "use 1 to 1048576");
                let text = "use a finite number, not negative";
                let finite = |x: f32| x.is_finite() && x >= 0.0;
                rule("transport.tracing.tolerance", tolerance.to_string(), finite(*tolerance), text);
                if let TracingFilter::Bilateral { radius, normal_power, distance } = filter {
                    let key = "transport.tracing.filter.bilateral.radius";
                    rule(key, radius.to_string(), (1..=16).contains(radius), "use 1 to 16 texels");
                    let key = "transport.tracing.filter.bilateral.normal_power";
                    rule(key, normal_power.to_string(), finite(*normal_power), text);
                    let key = "transport.tracing.filter.bilateral.distance";
                    rule(
                        key,
                        distance.to_string(),
                        finite(*distance) && *distance > 0.0,
                        "use a finite number above 0",
                    );
                }
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

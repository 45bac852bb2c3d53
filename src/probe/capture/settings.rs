//! What a method says about capturing.

use serde::{Deserialize, Serialize};

use super::backs::Backs;
use super::rays::Rays;

/// How the light of emissive surfaces and the sky reaches the surfaces that probes see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EmissionTransport {
    /// Emitters are sampled with shadow rays at every hit and from every probe centre.
    Sampled,
    /// Emission is what capture rays happen to hit, and reaches surfaces through the probes.
    Gathered,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CaptureSettings {
    pub rays: Rays,
    pub emission: EmissionTransport,
    /// Emitter samples at every hit (with `emission: sampled`).
    pub emitter_samples: u32,
    /// Emitter samples from every probe centre (with `emission: sampled`).
    pub probe_emitter_samples: u32,
    pub backs: Backs,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        CaptureSettings {
            rays: Rays::default(),
            emission: EmissionTransport::Sampled,
            emitter_samples: 2,
            probe_emitter_samples: 64,
            backs: Backs::default(),
        }
    }
}

/// Most emitter samples of a probe.
const MOST_PROBE_SAMPLES: u32 = 1 << 20;

impl CaptureSettings {
    /// Whether surfaces find emission through the probes, and not by samples of their own.
    pub fn gathers_emission(&self) -> bool {
        self.emission == EmissionTransport::Gathered
    }

    /// The same with so many times as many rays and emitter samples of every probe.
    pub fn with_samples(&self, times: u32) -> CaptureSettings {
        CaptureSettings {
            rays: self.rays.multiplied(times as usize),
            probe_emitter_samples: self.probe_emitter_samples.saturating_mul(times).min(MOST_PROBE_SAMPLES),
            ..self.clone()
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, most_texels: usize, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        self.rays.check(most_texels, rule);
        let emitter = self.emitter_samples;
        rule("capture.emitter_samples", emitter.to_string(), (1..=65_536).contains(&emitter), "use 1 to 65536");
        let probe = self.probe_emitter_samples;
        rule("capture.probe_emitter_samples", probe.to_string(), probe <= MOST_PROBE_SAMPLES, "use 0 to 1048576");
        self.backs.check(rule);
    }
}

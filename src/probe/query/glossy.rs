//! What a method says about the light that glossy surfaces ask of probes.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::march::TraceSettings;

/// Where a method takes the light from that glossy surfaces reflect.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Glossy {
    /// Probes know of none.
    #[default]
    None,
    /// From levels of radiance, each blurred for a roughness.
    Prefiltered { parallax: Parallax },
    /// From rays that are traced in the probes' light fields.
    LightField(TraceSettings),
}

/// Where pictures take irradiance from, besides the look-up that bounces and figures of leaks ask.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Diffuse {
    /// From nowhere else.
    #[default]
    Stored,
    /// From rays that are traced in the probes' light fields, too.
    LightField(TraceSettings),
}

impl Diffuse {
    /// The settings of rays that are traced in the probes, where there are any.
    pub fn traced(&self) -> Option<&TraceSettings> {
        match self {
            Diffuse::LightField(settings) => Some(settings),
            Diffuse::Stored => None,
        }
    }

    /// Why the probes cannot answer it, with the remedy; `None` where they can.
    pub fn mismatch(&self, marches: bool) -> Option<String> {
        (self.traced().is_some() && !marches).then(|| {
            "query.diffuse is light_field: store.light_field must be march(lowest: 64); or make it stored".to_owned()
        })
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        if let Some(settings) = self.traced() {
            settings.check("query.diffuse.light_field", rule);
        }
    }
}

/// The proxy that reflected rays are taken to end at.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Parallax {
    /// None: rays end infinitely far away.
    None,
    /// The box that the probes were asked to cover, without padding.
    #[default]
    Volume,
    /// This box, world space, metres.
    Box { min: (f64, f64, f64), max: (f64, f64, f64) },
}

impl Glossy {
    pub fn is_none(&self) -> bool {
        *self == Glossy::None
    }

    /// The settings of rays that are traced in the probes, where there are any.
    pub fn traced(&self) -> Option<&TraceSettings> {
        match self {
            Glossy::LightField(settings) => Some(settings),
            Glossy::None | Glossy::Prefiltered { .. } => None,
        }
    }

    /// Whether levels of radiance are asked for.
    pub fn asks_levels(&self) -> bool {
        matches!(self, Glossy::Prefiltered { .. })
    }

    /// The same with the box that probes were asked to cover, world space, in place of its name.
    #[must_use]
    pub fn resolved(self, (low, high): (DVec3, DVec3)) -> Glossy {
        match self {
            Glossy::Prefiltered { parallax: Parallax::Volume } => {
                Glossy::Prefiltered { parallax: Parallax::Box { min: low.into(), max: high.into() } }
            }
            other => other,
        }
    }

    /// Why the probes cannot answer it, with the remedy; `None` where they can.
    pub fn mismatch(&self, has_radiance: bool, marches: bool) -> Option<String> {
        match self {
            Glossy::Prefiltered { .. } if !has_radiance => Some(
                "query.glossy is prefiltered: store.prefiltered must hold levels, or store.light_field maps; or make it none"
                    .to_owned(),
            ),
            Glossy::LightField(_) if !marches => Some(
                "query.glossy is light_field: store.light_field must be march(lowest: 64); or make it none".to_owned(),
            ),
            _ => None,
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        match self {
            Glossy::None => {}
            Glossy::Prefiltered { parallax: Parallax::Box { min, max } } => {
                let (low, high) = (DVec3::from(*min), DVec3::from(*max));
                let holds = low.is_finite() && high.is_finite() && low.cmple(high).all();
                let value = format!("(min: {min:?}, max: {max:?})");
                rule("query.glossy.prefiltered.parallax.box", value, holds, "min must not be above max, both finite");
            }
            Glossy::Prefiltered { .. } => {}
            Glossy::LightField(settings) => settings.check("query.glossy.light_field", rule),
        }
    }
}

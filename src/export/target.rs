//! The engines and forms that probes are exported to.

use serde::{Deserialize, Serialize};

use super::rules::Rules;

/// What probes are exported to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    Three,
    Bevy,
    Ddgi,
    Exr,
}

impl Target {
    /// As it is typed.
    pub fn name(self) -> &'static str {
        match self {
            Target::Three => "three",
            Target::Bevy => "bevy",
            Target::Ddgi => "ddgi",
            Target::Exr => "exr",
        }
    }

    /// Name in reports of its look-up beside a method's own.
    pub fn method(self) -> &'static str {
        match self {
            Target::Three => "as_three",
            Target::Bevy => "as_bevy",
            Target::Ddgi => "as_ddgi",
            Target::Exr => "as_exr",
        }
    }

    /// The look-up of engines that do no more than blend what is stored.
    pub fn rules(self) -> Option<Rules> {
        match self {
            Target::Three => Some(Rules::Three),
            Target::Bevy => Some(Rules::Bevy),
            Target::Ddgi | Target::Exr => None,
        }
    }
}

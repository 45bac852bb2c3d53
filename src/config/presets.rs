//! Presets: configurations compiled in, one file each under `configs/presets/`.

use super::{Config, ConfigError, Layers};

/// A named configuration.
pub struct Preset {
    pub name: &'static str,
    pub summary: &'static str,
    pub(super) text: &'static str,
}

pub const PRESETS: &[Preset] = &[
    Preset {
        name: "default",
        summary: "visibility measured at the surfaces, sampled emission, iterated bounces",
        text: include_str!("../../configs/presets/default.ron"),
    },
    Preset {
        name: "path",
        summary: "as default, but lit by full paths at every hit: the truth at the probes",
        text: include_str!("../../configs/presets/path.ron"),
    },
];

impl Preset {
    /// The preset over the defaults.
    ///
    /// # Errors
    /// None, as a test knows.
    pub fn config(&self) -> Result<Config, ConfigError> {
        Layers::default().preset(self.name)?.config()
    }
}

/// The preset of a name.
///
/// # Errors
/// There is none.
pub fn find(name: &str) -> Result<&'static Preset, ConfigError> {
    let known = || PRESETS.iter().map(|p| p.name).collect::<Vec<_>>().join(", ");
    PRESETS
        .iter()
        .find(|preset| preset.name == name)
        .ok_or_else(|| ConfigError::NoPreset { name: name.to_owned(), known: known() })
}

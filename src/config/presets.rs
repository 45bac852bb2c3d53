//! Presets: configurations compiled in, one file each under `configs/presets/`.

use super::ron_text::ConfigError;

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
    Preset {
        name: "threev8-uniform",
        summary: "Three.V8 (Fei Yang 2023): spherical harmonics, tiles of distance",
        text: include_str!("../../configs/presets/threev8-uniform.ron"),
    },
    Preset {
        name: "threev8-mixed",
        summary: "the same on a grid that is fine only where surfaces are",
        text: include_str!("../../configs/presets/threev8-mixed.ron"),
    },
];

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

//! Presets: configurations compiled in, one file each under `configs/presets/`.

use super::{Config, ConfigError};

/// A named configuration.
pub struct Preset {
    pub name: &'static str,
    pub summary: &'static str,
    text: &'static str,
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
    pub fn config(&self) -> Result<Config, ConfigError> {
        Config::parse(self.text, &format!("preset {}", self.name))
    }
}

pub fn find(name: &str) -> Result<Config, ConfigError> {
    match PRESETS.iter().find(|p| p.name == name) {
        Some(preset) => preset.config(),
        None => {
            let known = PRESETS.iter().map(|p| p.name).collect::<Vec<_>>().join(", ");
            Err(ConfigError::NoPreset { name: name.to_owned(), known })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_parses_and_default_is_the_default() {
        for preset in PRESETS {
            preset.config().unwrap();
        }
        assert_eq!(find("default").unwrap(), Config::default());
        assert!(find("defualt").unwrap_err().to_string().contains("default"));
    }
}

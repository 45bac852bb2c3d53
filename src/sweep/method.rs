//! What a sweep compares: presets and files of configuration.

use std::path::PathBuf;

use crate::config::{Config, ConfigError, Layers, presets};

/// What ladders start from.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    pub name: String,
    pub layers: Layers,
    /// The preset as it is published.
    pub preset: Option<Config>,
}

impl Method {
    /// A preset, and files over it; without a preset over [`presets::DEFAULT`]. Both name it.
    ///
    /// # Errors
    /// There is no such preset; a file cannot be read.
    pub fn new(preset: Option<&str>, files: &[PathBuf]) -> Result<Method, ConfigError> {
        let mut layers = Layers::of(preset)?;
        let published = preset.map(|_| layers.config()).transpose()?;
        let mut names = Vec::new();
        for path in files {
            layers = layers.file(path)?;
            let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
            names.push(stem.unwrap_or_else(|| path.display().to_string()));
        }
        // What is held alike by all is no part of a method's name.
        let name = match preset {
            Some(preset) => preset.to_owned(),
            None if names.is_empty() => presets::DEFAULT.to_owned(),
            None => names.join(", "),
        };
        Ok(Method { name, layers, preset: published })
    }

    /// What a configuration is called that came of the method: whether it is still the preset, but for the grid and the
    /// light that scenes bring.
    pub fn label(&self, config: &Config) -> String {
        let of_scene = |preset: &Config| Config {
            grid: config.grid.clone(),
            lights: config.lights.clone(),
            materials: config.materials.clone(),
            ..preset.clone()
        };
        match &self.preset {
            Some(preset) if of_scene(preset) != *config => format!("{}, changed", self.name),
            _ => self.name.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_that_are_not_as_published_say_so() {
        let method = Method::new(Some("default"), &[]).unwrap();
        let label = |set: &str| method.label(&method.layers.clone().set(&[set.to_owned()]).unwrap().config().unwrap());
        assert_eq!((label("grid.spacing_m=0.5"), label("lights.sky=(1, 1, 1)")), ("default".into(), "default".into()));
        assert_eq!(label("capture.resolution=4"), "default, changed");
        let plain = Method::new(None, &[]).unwrap();
        assert_eq!(
            plain.label(&plain.layers.clone().set(&["capture.resolution=4".to_owned()]).unwrap().config().unwrap()),
            "default"
        );
    }
}

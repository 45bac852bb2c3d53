//! RON as configurations are written, and what can be wrong with it.

use std::path::PathBuf;

use ron::extensions::Extensions;

use super::messages;

#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    #[error("cannot read the configuration {path}: {cause}; give the path of a RON file")]
    Unreadable { path: PathBuf, cause: std::io::Error },
    #[error("{place}: {what}")]
    Invalid { place: String, what: String },
    #[error("there is no preset '{name}'{}; there are: {known}", if is_file(name) { " (a file goes with --config)" } else { "" })]
    NoPreset { name: String, known: String },
    #[error("{place}: {key} is {value}: {rule}")]
    OutOfRange { place: String, key: &'static str, value: String, rule: &'static str },
}

/// Whether a name is that of a file rather than of a preset.
fn is_file(name: &str) -> bool {
    name.contains('/') || name.ends_with(".ron")
}

/// Reads RON text as configurations are written; `place` names it in errors.
pub fn from_ron<T: serde::de::DeserializeOwned>(text: &str, place: &str) -> Result<T, ConfigError> {
    // Some editors write a byte order mark.
    let text = text.trim_start_matches('\u{feff}');
    ron_options().from_str(text).map_err(|e| ConfigError::Invalid {
        place: format!("{place}, line {} column {}", e.span.start.line, e.span.start.col),
        what: messages::of_file(&e, text),
    })
}

/// RON in which optional values are written without `Some`, and the settings of a choice without a second pair of
/// parentheses.
pub(crate) fn ron_options() -> ron::Options {
    let extensions = Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES;
    ron::Options::default().with_default_extension(extensions)
}

//! The configuration of a bake: where probes stand in a scene, and a method — of the literature, or ours — as a value.
//!
//! RON, with every key optional and an unknown key an error. A file is a list of assignments: only the keys that stand in
//! it count. Layers lie on each other in this order: the preset `physical`, which has every key and is [`Config::default`];
//! `--preset`, or where none is named the preset `default`; `--config`; `--set key=value` ([`Layers`]).

mod aliases;
mod assignments;
mod check;
mod choices;
mod layers;
pub(crate) mod messages;
mod nearest;
pub mod presets;
mod ron_text;
mod settings;
#[cfg(test)]
mod tests;

pub use self::layers::Layers;
pub(crate) use self::ron_text::ron_options;
pub use self::ron_text::{ConfigError, from_ron};
pub use self::settings::{Config, LightSettings, MaterialSettings, PlanMode, PlanSettings, STAGES, VISIBILITY};

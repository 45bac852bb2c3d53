//! Layers of assignments, and the configuration that they make together.

use std::path::Path;

use ron::error::SpannedError;
use serde_json::Value;

use super::assignments::{self, Assignment, below, choice};
use super::ron_text::{ConfigError, ron_options};
use super::settings::Config;
use super::{aliases, choices, messages, nearest, presets};
use crate::system::input::read_text;

/// Assignments in the order in which they count: a later one replaces an earlier one.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layers {
    base: Config,
    assignments: Vec<Assignment>,
}

impl Layers {
    /// Layers over the preset of that name, or where none is named over [`presets::DEFAULT`].
    ///
    /// # Errors
    /// There is no such preset.
    pub fn of(preset: Option<&str>) -> Result<Layers, ConfigError> {
        Layers::default().preset(preset.unwrap_or(presets::DEFAULT))
    }

    /// Layers over a configuration instead of [`Config::default`].
    pub fn over(base: Config) -> Layers {
        Layers { base, assignments: Vec::new() }
    }

    /// Adds the keys that stand in RON text; `place` names it in errors.
    ///
    /// # Errors
    /// The text is not RON in parentheses. Keys and values are looked at by [`Self::config`].
    pub fn text(mut self, text: &str, place: &str) -> Result<Layers, ConfigError> {
        self.assignments.extend(assignments::of_text(text, place)?);
        Ok(self)
    }

    /// Adds the keys of a preset.
    ///
    /// # Errors
    /// There is no such preset.
    pub fn preset(self, name: &str) -> Result<Layers, ConfigError> {
        self.text(presets::find(name)?.text, &format!("preset {name}"))
    }

    /// Adds the keys that stand in a file.
    ///
    /// # Errors
    /// As [`Self::text`]; the file cannot be read.
    pub fn file(self, path: &Path) -> Result<Layers, ConfigError> {
        let unreadable = |cause| ConfigError::Unreadable { path: path.to_owned(), cause };
        let text = read_text(path).map_err(unreadable)?;
        self.text(&text, &path.display().to_string())
    }

    /// Adds `key=value` assignments. Values are RON as in a file, for example `0.5`, `f32`, `(3, 4, 5)` or
    /// `surface(voxels_per_cell: 4)`.
    ///
    /// # Errors
    /// One is not written as key=value.
    pub fn set(mut self, assignments: &[String]) -> Result<Layers, ConfigError> {
        for text in assignments {
            self.assignments.push(assignments::of_set(text)?);
        }
        Ok(self)
    }

    /// The configuration that all layers make.
    ///
    /// # Errors
    /// Keys or values that a configuration does not take, or that do not go together; the message names the place.
    pub fn config(&self) -> Result<Config, ConfigError> {
        let mut tree = Tree::new(&self.base);
        // Old keys of a choice that is not taken (yet): a later assignment may take it.
        let mut waiting: Vec<Assignment> = Vec::new();
        for assignment in &self.assignments {
            tree.apply(assignment, &mut waiting)?;
        }
        for assignment in &waiting {
            tree.apply_late(assignment)?;
        }
        let place = self.assignments.last().map_or("the configuration", |a| &a.place);
        let invalid = |place: &str, what: String| Err(ConfigError::Invalid { place: place.to_owned(), what });
        let config = tree.config;
        if config.grid.spacing_m.is_some() && config.grid.divisions.is_some() {
            let ends = |a: &&Assignment| a.path.ends_with("divisions") || a.path.ends_with("spacing_m");
            let last = self.assignments.iter().rfind(ends);
            let key = if last.is_some_and(|a| a.path.ends_with("divisions")) { "spacing_m" } else { "divisions" };
            let what = format!("grid.{key} is given too; remove one, or put --set grid.{key}=None before");
            return invalid(last.map_or(place, |a| &a.place), what);
        }
        match config.mismatch() {
            Some((sections, what)) => {
                let decides = |a: &&Assignment| sections.iter().any(|section| a.path.starts_with(section));
                invalid(self.assignments.iter().rfind(decides).map_or(place, |a| &a.place), what)
            }
            None => Ok(config),
        }
    }
}

impl Config {
    /// Reads RON text over [`Config::default`]; `place` names it in errors.
    ///
    /// # Errors
    /// The text is not RON, or has keys or values that a configuration does not take.
    pub fn parse(text: &str, place: &str) -> Result<Config, ConfigError> {
        Layers::default().text(text, place)?.config()
    }

    /// Applies `key=value` assignments in order.
    ///
    /// # Errors
    /// Keys or values that a configuration does not take.
    pub fn with_overrides(self, assignments: &[String]) -> Result<Config, ConfigError> {
        Layers::over(self).set(assignments)?.config()
    }
}

/// A configuration under assignment, as a tree of keys too.
struct Tree {
    config: Config,
    tree: Value,
}

impl Tree {
    fn new(config: &Config) -> Tree {
        Tree { config: config.clone(), tree: keys_of(config) }
    }

    fn at(&self, path: &str) -> Option<&Value> {
        choices::at(&self.tree, path)
    }

    /// Takes an assignment apart until it names a single key, and sets it.
    fn apply(&mut self, assignment: &Assignment, waiting: &mut Vec<Assignment>) -> Result<(), ConfigError> {
        let Assignment { place, path, value } = assignment;
        let part = |(path, value)| Assignment { place: place.clone(), path, value };
        if let Some(parts) = aliases::today(path, value) {
            for part in parts.into_iter().map(part) {
                let is_waiting = self.at(&part.path).is_none();
                if is_waiting {
                    waiting.push(part);
                } else {
                    self.apply(&part, waiting)?;
                }
            }
            return Ok(());
        }
        let has_keys = self.at(path).is_some_and(Value::is_object) || aliases::is_old_section(path);
        if has_keys
            && let Some(parts) = below(path, value)
            && !self.is_whole(path, &parts)
        {
            return parts.into_iter().try_for_each(|p| self.apply(&part(p), waiting));
        }
        // The settings of a choice that is taken already: those that are not named stay.
        if let Some((name, settings)) = choice(value) {
            let taken = format!("{path}.{name}");
            if self.at(&taken).is_some_and(Value::is_object)
                && let Some(parts) = if settings.is_empty() { None } else { below(&taken, settings) }
                && !self.is_whole(&taken, &parts)
            {
                return parts.into_iter().try_for_each(|p| self.apply(&part(p), waiting));
            }
        }
        self.set(assignment)
    }

    /// Whether these are all the keys below `path`, none with keys of its own: then they may only fit together.
    fn is_whole(&self, path: &str, parts: &[(String, String)]) -> bool {
        let Some(Value::Object(keys)) = self.at(path) else { return false };
        let is_named = |key: &String| parts.iter().any(|(part, _)| part.strip_prefix(path) == Some(&format!(".{key}")));
        keys.iter().all(|(key, value)| !value.is_object() && is_named(key)) && parts.len() == keys.len()
    }

    /// An old key of a choice that no assignment has taken. Whole files of before name keys of all choices, and those had
    /// no effect: they are only held against their range. A `--set` is meant.
    fn apply_late(&mut self, assignment: &Assignment) -> Result<(), ConfigError> {
        if self.at(&assignment.path).is_some() {
            return self.apply(assignment, &mut Vec::new());
        }
        if assignment.place.starts_with("--set") {
            return self.set(assignment);
        }
        let mut scratch = Tree::new(&self.config);
        if let Some((parent, choice, _)) = choices::missing(&self.tree, &assignment.path) {
            let taken = Assignment { path: parent, value: format!("{choice}()"), ..assignment.clone() };
            scratch.set(&taken)?;
        }
        scratch.set(assignment)
    }

    fn set(&mut self, Assignment { place, path, value }: &Assignment) -> Result<(), ConfigError> {
        let error = |what: String| ConfigError::Invalid { place: place.clone(), what };
        let mut alone = choices::alone(path, value);
        // `bounces` means `bounces()`, and `grid_points()` means `grid_points`.
        if let (Err(_), Some((name, "" | "()"))) = (&alone, choice(value)) {
            let other = if value.ends_with(')') { name.to_owned() } else { format!("{name}()") };
            alone = choices::alone(path, &other).or(alone);
        }
        if self.at(path).is_none()
            && let Some(what) = choices::not_taken(&self.tree, path)
        {
            return Err(error(what));
        }
        if self.at(path).is_none()
            && let Some(values) = aliases::values(path)
        {
            return Err(error(format!("{path} takes {values}")));
        }
        if let Ok(alone) = &alone {
            // Before JSON makes `null` of NaN and infinities, and so the default of a key that may be left out.
            alone.check(place)?;
        }
        let parsed = match &alone {
            Ok(alone) => choices::value_at(alone, path),
            // One key of several that are only there together: the others stand already.
            Err(error) if matches!(error.code, ron::Error::MissingStructField { .. }) => {
                ron_options().from_str(value).ok().filter(Value::is_array)
            }
            Err(_) => None,
        };
        if self.at(path).is_none()
            && let Some(meant) = nearest::elsewhere(&self.tree, path)
        {
            return Err(error(format!("there is no key '{path}'; did you mean {meant}?")));
        }
        set(&mut self.tree, path, parsed.unwrap_or_else(|| plain(value))).map_err(error)?;
        self.config = serde_json::from_value::<Config>(self.tree.clone())
            .map_err(|e| error(explain(&e, alone.as_ref().err(), value)))?;
        self.config.check(place)?;
        // Choices bring keys of their own.
        self.tree = keys_of(&self.config);
        Ok(())
    }
}

fn keys_of(config: &Config) -> Value {
    // Plain records of numbers and enums: nothing in them can fail to serialise.
    serde_json::to_value(config).unwrap_or_default()
}

/// What is wrong with a value: RON knows it better where it is about names.
fn explain(error: &serde_json::Error, alone: Option<&SpannedError>, value: &str) -> String {
    let is_about_names = matches!(
        alone.map(|e| &e.code),
        Some(ron::Error::NoSuchEnumVariant { .. } | ron::Error::NoSuchStructField { .. })
    );
    if !is_about_names
        && let Some((name, _)) = choice(value)
        && let Some(message) = messages::without_parameters(name)
    {
        return message;
    }
    match alone.map(|e| &e.code) {
        Some(code @ (ron::Error::NoSuchEnumVariant { .. } | ron::Error::NoSuchStructField { .. })) => {
            messages::of_value(code, value)
        }
        _ => messages::in_plain_words(&error.to_string()),
    }
}

fn set(tree: &mut Value, path: &str, value: Value) -> Result<(), String> {
    let mut node = tree;
    for key in path.split('.') {
        let Value::Object(map) = node else {
            return Err(format!("'{key}' cannot be set: what stands before it has no keys"));
        };
        if !map.contains_key(key) {
            return Err(messages::unknown_key(key, map.keys().map(String::as_str)));
        }
        node = &mut map[key];
    }
    *node = value;
    Ok(())
}

/// A number, `true`, JSON, or else the name of a choice.
fn plain(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_owned()))
}

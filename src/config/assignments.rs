//! Configuration text as a list of assignments: which keys stand there, and with what.

use std::fmt;

use ron::error::SpannedError;
use ron::value::RawValue;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};

use super::messages;
use super::ron_text::{ConfigError, ron_options};

/// One key and what it is set to.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// Where it stands, for messages: `a.ron, line 3` or `--set key=value`.
    pub place: String,
    /// Keys from the outermost inwards, with dots between.
    pub path: String,
    /// RON.
    pub value: String,
}

/// The named fields of one pair of parentheses, each with its RON.
struct Fields<'t>(Vec<(String, &'t str)>);

impl<'t> Deserialize<'t> for Fields<'t> {
    fn deserialize<D: Deserializer<'t>>(deserializer: D) -> Result<Self, D::Error> {
        struct Collect;
        impl<'t> Visitor<'t> for Collect {
            type Value = Fields<'t>;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("keys and values in parentheses")
            }

            fn visit_map<A: MapAccess<'t>>(self, mut map: A) -> Result<Fields<'t>, A::Error> {
                let mut fields = Vec::new();
                while let Some((Key(key), value)) = map.next_entry::<Key, &RawValue>()? {
                    fields.push((key, value.get_ron()));
                }
                Ok(Fields(fields))
            }
        }
        deserializer.deserialize_struct("Config", &[], Collect)
    }
}

/// The name of a field.
struct Key(String);

impl<'t> Deserialize<'t> for Key {
    fn deserialize<D: Deserializer<'t>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;
        impl Visitor<'_> for Name {
            type Value = Key;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("the name of a key")
            }

            fn visit_str<E>(self, name: &str) -> Result<Key, E> {
                Ok(Key(name.to_owned()))
            }
        }
        deserializer.deserialize_identifier(Name)
    }
}

fn fields(text: &str) -> Result<Vec<(String, &str)>, SpannedError> {
    ron_options().from_str::<Fields>(text).map(|fields| fields.0)
}

/// A choice with its settings, `name(key: value)`, as the name and the text of the parentheses; `None` for other values.
pub fn choice(value: &str) -> Option<(&str, &str)> {
    let value = value.trim();
    let end = value.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(value.len());
    let (name, rest) = value.split_at(end);
    let is_name = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    let rest = rest.trim();
    (is_name && (rest.is_empty() || rest.starts_with('('))).then_some((name, rest))
}

/// The keys that stand in a value of parentheses, each below `path`; `None` where the value has no keys.
pub fn below(path: &str, value: &str) -> Option<Vec<(String, String)>> {
    let value = value.trim();
    if value.is_empty() || !value.starts_with('(') {
        return None;
    }
    let fields = fields(value).ok()?;
    Some(fields.into_iter().map(|(key, value)| (format!("{path}.{key}"), value.trim().to_owned())).collect())
}

/// The assignments of a file's outermost keys.
///
/// # Errors
/// The text is not RON in parentheses.
pub fn of_text(text: &str, place: &str) -> Result<Vec<Assignment>, ConfigError> {
    // Some editors write a byte order mark.
    let text = text.trim_start_matches('\u{feff}');
    let found = fields(text).map_err(|e| ConfigError::Invalid {
        place: format!("{place}, line {} column {}", e.span.start.line, e.span.start.col),
        what: messages::of_file(&e, text),
    })?;
    let mut assignments = Vec::new();
    for (section, value) in found {
        let line = |part: &str| {
            // Both are parts of the same text.
            let offset = (part.as_ptr() as usize).saturating_sub(text.as_ptr() as usize).min(text.len());
            let start = offset + part.len() - part.trim_start().len();
            1 + text.get(..start).map_or(0, |before| before.matches('\n').count())
        };
        match fields(value) {
            Ok(inner) if value.trim().starts_with('(') => {
                for (key, value) in inner {
                    let place = format!("{place}, line {}", line(value));
                    assignments.push(Assignment {
                        place,
                        path: format!("{section}.{key}"),
                        value: value.trim().into(),
                    });
                }
            }
            _ => {
                let place = format!("{place}, line {}", line(value));
                assignments.push(Assignment { place, path: section, value: value.trim().into() });
            }
        }
    }
    for (i, later) in assignments.iter().enumerate() {
        if assignments[..i].iter().any(|earlier| earlier.path == later.path) {
            let what = format!("{} is given twice; remove one", later.path);
            return Err(ConfigError::Invalid { place: later.place.clone(), what });
        }
    }
    Ok(assignments)
}

/// The assignment of a `--set`.
///
/// # Errors
/// It is not written as key=value.
pub fn of_set(text: &str) -> Result<Assignment, ConfigError> {
    let place = format!("--set {text}");
    match text.split_once('=') {
        Some((path, value)) => Ok(Assignment { place, path: path.trim().to_owned(), value: value.trim().to_owned() }),
        None => {
            let what = "write it as key=value, for example grid.spacing_m=0.5".to_owned();
            Err(ConfigError::Invalid { place, what })
        }
    }
}

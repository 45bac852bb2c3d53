//! Keys that stand below a choice: which choices there are, what keys each has, and what is wrong with a key of another
//! choice than the one that is taken.

use ron::error::SpannedError;
use serde_json::Value;

use super::messages;
use super::ron_text::ron_options;
use super::settings::Config;

/// No choice and no key is called this.
const NO_NAME: &str = "no_such_name";

/// The node of a tree at a path of keys with dots between.
pub fn at<'v>(tree: &'v Value, path: &str) -> Option<&'v Value> {
    path.split('.').try_fold(tree, |node, key| node.get(key))
}

/// Where a path leaves the tree: the key that stands there, how the path goes on, and what follows that.
pub fn missing<'p>(tree: &Value, path: &'p str) -> Option<(String, &'p str, Option<&'p str>)> {
    let keys: Vec<&str> = path.split('.').collect();
    let out = (1..keys.len()).find(|&i| at(tree, &keys[..=i].join(".")).is_none())?;
    Some((keys[..out].join("."), keys[out], keys.get(out + 1).copied()))
}

/// What is wrong with a path that asks for the settings of a choice that is not taken, with what would be right; `None`
/// where it leaves the tree at a key that holds no choice.
pub fn not_taken(tree: &Value, path: &str) -> Option<String> {
    let (parent, choice, key) = missing(tree, path)?;
    let choices = choices_of(&parent)?;
    let held = at(tree, &parent)?;
    let taken = name_of(held);
    let keys: Vec<&str> =
        held.get(&taken).and_then(Value::as_object).into_iter().flatten().map(|(k, _)| &**k).collect();
    let listed = if keys.is_empty() { "no keys".to_owned() } else { format!("keys: {}", keys.join(", ")) };
    let remedy = match key.map(|key| (key, keys_of_choice(&parent, choice, key))) {
        _ if !choices.contains(&choice) => messages::unknown_choice(choice, choices),
        Some((_, Some([]))) => format!("{choice} has no keys: write {parent}={choice}"),
        Some((key, Some(known))) if keys.contains(&key) => {
            format!("{choice} has no such key, only {}; did you mean {parent}.{taken}.{key}?", known.join(", "))
        }
        Some((_, Some(known))) => format!("{choice} has no such key, only {}", known.join(", ")),
        _ => format!("write {parent}={choice}(...)"),
    };
    Some(format!("{parent} is {taken} ({listed}), so '{path}' has no effect; {remedy}"))
}

/// The choices of a key; `None` where it takes something else.
fn choices_of(path: &str) -> Option<&'static [&'static str]> {
    match alone(path, NO_NAME).err()?.code {
        ron::Error::NoSuchEnumVariant { expected, .. } => Some(expected),
        _ => None,
    }
}

/// The keys of a choice that has no key of this name; `None` where it has it.
fn keys_of_choice(path: &str, choice: &str, key: &str) -> Option<&'static [&'static str]> {
    // A choice without settings stands without parentheses.
    if matches!(alone(path, choice).map(|config| value_at(&config, path)), Ok(Some(Value::String(_)))) {
        return Some(&[]);
    }
    match alone(path, &format!("{choice}({key}: {NO_NAME})")).err()?.code {
        ron::Error::NoSuchStructField { expected, found, .. } if found == key => Some(expected),
        _ => None,
    }
}

/// What a configuration holds at a path.
pub fn value_at(config: &Config, path: &str) -> Option<Value> {
    serde_json::to_value(config).ok().and_then(|tree| at(&tree, path).cloned())
}

/// The name of a choice, with its settings or without.
fn name_of(choice: &Value) -> String {
    let with_settings = choice.as_object().and_then(|map| map.keys().next());
    with_settings.map(String::as_str).or(choice.as_str()).unwrap_or("something else").to_owned()
}

/// A configuration with nothing but this key. A key may be a field, or a choice and then stand before its settings.
pub fn alone(path: &str, value: &str) -> Result<Config, SpannedError> {
    let keys: Vec<&str> = path.split('.').collect();
    let text = |choices: usize| {
        keys.iter().enumerate().rev().fold(value.to_owned(), |inner, (i, key)| match choices >> i & 1 {
            1 => format!("{key}{inner}"),
            _ => format!("({key}: {inner})"),
        })
    };
    let parse = |choices: usize| ron_options().from_str::<Config>(&text(choices));
    let mut best: Option<SpannedError> = None;
    // Choices stand before settings in parentheses: those of a field, or the value's own.
    let last = keys.len().min(8);
    let fits = |choices: usize| {
        let followed = |i: usize| if i + 1 < last { choices >> (i + 1) & 1 == 0 } else { value.starts_with('(') };
        (0..last).all(|i| choices >> i & 1 == 0 || i > 0 && followed(i))
    };
    for choices in (0..1usize << last).filter(|&choices| fits(choices)) {
        match parse(choices) {
            Ok(config) => return Ok(config),
            // Who gets as far as the value knows best what is wrong with it.
            Err(error) => {
                let is_about_value = matches!(
                    &error.code,
                    ron::Error::NoSuchEnumVariant { found, .. } | ron::Error::NoSuchStructField { found, .. }
                        if !keys.contains(&found.as_str())
                );
                if best.is_none() || is_about_value {
                    best = Some(error);
                }
            }
        }
    }
    match best {
        Some(error) => Err(error),
        None => parse(0),
    }
}

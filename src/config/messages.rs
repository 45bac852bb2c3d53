//! Mistakes in a configuration in words, with the nearest known name where a name is wrong.

use ron::error::SpannedError;

/// Choices with parameters, and how they are written.
const FORMS: &[(&str, &str)] = &[
    ("cosine", "cosine(floor: 0.05)"),
    ("wrap", "wrap(offset: 0.2)"),
    ("eccentric", "eccentric(kappa: 0.9)"),
    ("bilateral", "bilateral(radius: 3, normal_power: 32, distance: 0.1)"),
    ("path_traced", "path_traced(paths: 16)"),
    ("paths", "paths(paths: 16)"),
    ("chebyshev", "chebyshev(power: 3, floor: 0.05)"),
    ("moments", "moments(power: 3, floor: 0.05)"),
    ("surface", "surface(voxels_per_cell: 8)"),
    ("diffuse", "diffuse(albedo: 0.8)"),
];

/// What is wrong in a configuration file of this text.
pub fn of_file(error: &SpannedError, text: &str) -> String {
    if text.trim().is_empty() {
        return "it is empty; write () to change nothing".to_owned();
    }
    // The identifier that stands before the place of the error.
    let line = text.lines().nth(error.span.start.line.saturating_sub(1)).unwrap_or("");
    let before: String = line.chars().take(error.span.start.col.saturating_sub(1)).collect();
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let start = before.trim_end().rfind(|c| !is_part(c)).map_or(0, |at| at + 1);
    of_value(&error.code, before.trim_end().get(start..).unwrap_or(""))
}

/// What RON found wrong with a value.
pub fn of_value(error: &ron::Error, value: &str) -> String {
    match error {
        ron::Error::NoSuchStructField { expected, found, .. } => unknown_key(found, expected.iter().copied()),
        ron::Error::NoSuchEnumVariant { expected, found, .. } => unknown_choice(found, expected),
        ron::Error::ExpectedDifferentStructName { found, .. } => {
            format!("a list of keys in parentheses is expected, and '{found}' stands there; is it a RON file?")
        }
        ron::Error::ExpectedNamedStructLike("Config") => {
            "the keys stand in parentheses, as in (grid: (spacing_m: 0.5)); () changes nothing".to_owned()
        }
        other => without_parameters(value).unwrap_or_else(|| other.to_string()),
    }
}

/// Message for a choice whose parameters are missing.
pub fn without_parameters(value: &str) -> Option<String> {
    let (name, form) = FORMS.iter().find(|(name, _)| *name == value)?;
    Some(format!("'{name}' needs its parameters: write it as {form}"))
}

/// Serde's words for a value of another kind, without the names of types.
pub fn in_plain_words(message: &str) -> String {
    let Some((found, expected)) =
        message.strip_prefix("invalid type: ").and_then(|rest| rest.split_once(", expected "))
    else {
        return message.to_owned();
    };
    let expected = match expected {
        "f32" | "f64" => "a number, such as 0.5",
        "u32" | "usize" => "a whole number, such as 8",
        "a sequence" => "a list of texts, such as [\"visibility\"]",
        "a tuple of size 3" => "three numbers, such as (8, 4, 8)",
        "a boolean" => "true or false",
        other if other.starts_with("struct ") => "keys in parentheses, such as (key: value)",
        other => other,
    };
    let found = found.split_once(' ').map_or(found, |(_, value)| value);
    format!("{found} does not fit: write {expected}")
}

/// Message for a choice that does not exist.
pub fn unknown_choice(found: &str, known: &[&str]) -> String {
    format!("there is no choice '{found}'{}; the choices are {}", suggestion(found, known.iter()), known.join(", "))
}

/// Message for a key that does not exist.
pub fn unknown_key<'k>(found: &str, known: impl Iterator<Item = &'k str> + Clone) -> String {
    let names: Vec<&str> = known.clone().collect();
    format!("there is no key '{found}'{}; the keys here are {}", suggestion(found, names.iter()), names.join(", "))
}

/// The nearest known name, where it is near enough that it may have been meant.
fn suggestion<'k>(found: &str, known: impl Iterator<Item = &'k &'k str>) -> String {
    let distance = |name: &str| match name.starts_with(found) && found.len() >= 3 {
        true => 0,
        // Units are left out more often than they are misspelt.
        false => strsim::damerau_levenshtein(name, found)
            .min(strsim::damerau_levenshtein(name.trim_end_matches("_m"), found)),
    };
    let nearest = known.map(|name| (distance(name), *name)).min();
    match nearest {
        // Half the letters wrong is another word.
        Some((distance, name)) if 2 * distance < found.chars().count() => format!(" (did you mean '{name}'?)"),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_near_names_are_suggested() {
        let keys = ["spacing_m", "bounds", "grid", "padding"];
        for (found, meant) in
            [("spacing", "spacing_m"), ("spaceing", "spacing_m"), ("gird", "grid"), ("bouds", "bounds")]
        {
            let message = unknown_key(found, keys.into_iter());
            assert!(message.contains(&format!("did you mean '{meant}'")), "{message}");
        }
        let message = unknown_key("seed", keys.into_iter());
        assert!(!message.contains("did you mean") && message.contains("spacing_m, bounds, grid, padding"), "{message}");
    }
}

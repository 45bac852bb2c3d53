//! Keys that are written without their section, and flags that are taken for keys.

use serde_json::Value;

use super::aliases;

/// What the command line sets and a configuration does not.
const FLAGS: &[&str] = &["seed", "threads", "env", "preset", "config", "size", "camera", "exposure"];

/// What may be meant by a path whose first key is in no section: the whole path of a key of this name, or a flag.
pub fn elsewhere(tree: &Value, path: &str) -> Option<String> {
    let first = path.split('.').next().unwrap_or(path);
    if tree.get(first).is_some() || aliases::is_old_section(first) {
        return None;
    }
    if FLAGS.contains(&path) {
        return Some(format!("the flag --{path}"));
    }
    let mut known = Vec::new();
    paths(tree, "", &mut known);
    known.extend(aliases::old_keys().map(str::to_owned));
    let ending = format!(".{path}");
    // The least deep comes first: the others belong to choices.
    let found = known.iter().filter(|known| known.ends_with(&ending));
    found.min_by_key(|known| (known.matches('.').count(), (*known).clone())).map(|known| format!("'{known}'"))
}

fn paths(node: &Value, above: &str, found: &mut Vec<String>) {
    for (key, value) in node.as_object().into_iter().flatten() {
        let path = if above.is_empty() { key.clone() } else { format!("{above}.{key}") };
        paths(value, &path, found);
        found.push(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    #[test]
    fn keys_get_their_section() {
        let tree = serde_json::to_value(Config::default()).unwrap();
        for (path, meant) in [
            ("spacing_m", Some("'grid.spacing_m'")),
            ("visibility", Some("'query.visibility'")),
            ("sky", Some("'lights.sky'")),
            ("seed", Some("the flag --seed")),
            ("grid.spaceing", None),
            ("nothing_of_the_kind", None),
        ] {
            assert_eq!(elsewhere(&tree, path).as_deref(), meant, "{path}");
        }
    }
}

//! What two effective configurations differ in.

pub use crate::report::page::ConfigChange;

/// The keys of two effective configurations, in RON, whose lines differ.
pub fn config_changes(base: Option<&str>, candidate: Option<&str>) -> Vec<ConfigChange> {
    let (Some(base), Some(candidate)) = (base, candidate) else { return Vec::new() };
    let (a, b) = (keys(base), keys(candidate));
    let value = |lines: &[(String, String)], key: &str| lines.iter().find(|l| l.0 == key).map(|l| l.1.clone());
    let mut names: Vec<&String> = a.iter().map(|l| &l.0).collect();
    names.extend(b.iter().map(|l| &l.0).filter(|key| value(&a, key).is_none()));
    let change = |key: &String| ConfigChange { key: key.clone(), base: value(&a, key), candidate: value(&b, key) };
    names.into_iter().map(change).filter(|c| c.base != c.candidate).collect()
}

/// Lines of RON as `Config::to_ron` writes it: key with those of the levels above it, value.
fn keys(ron: &str) -> Vec<(String, String)> {
    let mut above: Vec<String> = Vec::new();
    let mut lines = Vec::new();
    for line in ron.lines().map(str::trim) {
        let name = |above: &[String], key: &str| {
            above.iter().map(String::as_str).filter(|part| !part.is_empty()).chain([key]).collect::<Vec<_>>().join(".")
        };
        let (key, value) = line.split_once(": ").unwrap_or(("", line));
        if let Some(opened) = value.strip_suffix('(') {
            if !opened.is_empty() {
                lines.push((name(&above, key), opened.to_owned()));
            }
            above.push(key.to_owned());
        } else if value.starts_with(')') {
            above.pop();
        } else if !key.is_empty() {
            lines.push((name(&above, key), value.trim_end_matches(',').to_owned()));
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn configurations_are_compared_by_key() {
        let with = |assignments: &[&str]| {
            let assignments: Vec<String> = assignments.iter().map(|a| (*a).to_owned()).collect();
            crate::config::Config::default().with_overrides(&assignments).unwrap().to_ron()
        };
        let base = with(&[]);
        assert_eq!(config_changes(Some(&base), Some(&base)), []);
        let changes = config_changes(Some(&base), Some(&with(&["query.visibility=none", "encoding.border=0"])));
        let names: Vec<&str> = changes.iter().map(|c| c.key.as_str()).collect();
        assert_eq!(names, ["query.visibility", "query.visibility.voxels_per_cell", "encoding.border"], "{changes:?}");
        assert_eq!(changes[2].candidate.as_deref(), Some("0"));
    }
}

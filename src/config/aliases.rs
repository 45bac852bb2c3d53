//! Keys by which configurations were written before, and what they are called now.

use super::assignments::choice;

/// Keys that only have another place.
const RENAMED: &[(&str, &str)] = &[
    ("capture.resolution", "capture.rays.octahedral.resolution"),
    ("capture.samples_per_texel", "capture.rays.octahedral.per_texel"),
    ("capture.reflected.path_traced.paths", "transport.paths.paths"),
    ("encoding.irradiance", "store.irradiance.octahedral.format"),
    ("encoding.curve", "store.irradiance.octahedral.curve"),
    ("encoding.border", "store.border"),
    ("filter.irradiance_resolution", "store.irradiance.octahedral.resolution"),
    ("filter.distance_resolution", "store.occlusion.moments.resolution"),
    ("filter.distance_exponent", "store.occlusion.moments.exponent"),
    ("filter.distance_clamp", "store.occlusion.moments.clamp"),
    ("placement.rays", "placement.rule.settle.rays"),
    ("placement.back_face_share", "placement.rule.settle.back_face_share"),
    ("placement.relocate", "placement.rule.settle.relocate"),
    ("query.visibility.moments.power", "query.test.chebyshev.power"),
    ("query.visibility.moments.floor", "query.test.chebyshev.floor"),
    ("query.visibility.surface.voxels_per_cell", "store.occlusion.surface.voxels_per_cell"),
    ("solver.max_bounces", "transport.bounces.max_bounces"),
    ("solver.max_sweeps", "transport.bounces.max_iterations"),
    ("solver.acceleration", "transport.bounces.acceleration"),
    ("solver.tolerance", "transport.bounces.tolerance"),
    ("solver.albedo_max", "materials.albedo_max"),
];

/// Keys of before that still work.
pub fn old_keys() -> impl Iterator<Item = &'static str> {
    RENAMED.iter().map(|(old, _)| *old).chain(["query.visibility", "capture.reflected"])
}

/// Sections that there are no longer.
pub fn is_old_section(path: &str) -> bool {
    matches!(path, "filter" | "encoding" | "solver")
}

/// What an old key takes whose values have other names now; `None` for other keys.
pub fn values(path: &str) -> Option<&'static str> {
    Some(match path {
        "capture.reflected" => {
            "through_probes, or path_traced(paths: 16); today: transport=bounces() or paths(paths: 16)"
        }
        "query.visibility" => "none, moments(power: 3, floor: 0.05) or surface(voxels_per_cell: 8)",
        _ => return None,
    })
}

/// What an old key and its value are now, in the order in which they are set; `None` for keys of today.
pub fn today(path: &str, value: &str) -> Option<Vec<(String, String)>> {
    if let Some((_, now)) = RENAMED.iter().find(|(old, _)| *old == path) {
        return Some(vec![((*now).to_owned(), value.to_owned())]);
    }
    let set = |pairs: &[(&str, String)]| Some(pairs.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect());
    let written = from_json(value).unwrap_or_else(|| value.to_owned());
    match (path, choice(&written)?) {
        // One number of search points holds for all surfaces of a voxel.
        ("placement.survey.group_search_points", _) => set(&[]),
        ("plan", (mode, "")) => set(&[("plan.mode", mode.to_owned())]),
        ("capture.reflected", ("through_probes", "")) => set(&[("transport", "bounces()".to_owned())]),
        ("capture.reflected", ("path_traced", settings)) => set(&[("transport", format!("paths{settings}"))]),
        ("query.visibility", ("none", "")) => {
            set(&[("store.occlusion", "none".to_owned()), ("query.test", "none".to_owned())])
        }
        ("query.visibility", ("moments", settings)) => {
            set(&[("store.occlusion", "moments()".to_owned()), ("query.test", format!("chebyshev{settings}"))])
        }
        ("query.visibility", ("surface", settings)) => {
            let settings = if settings.is_empty() { "()" } else { settings };
            set(&[("store.occlusion", format!("surface{settings}")), ("query.test", "table()".to_owned())])
        }
        _ => None,
    }
}

/// A choice written in JSON, `{"moments": {"power": 3}}`, as RON.
fn from_json(value: &str) -> Option<String> {
    let serde_json::Value::Object(map) = serde_json::from_str(value).ok()? else { return None };
    let (name, serde_json::Value::Object(settings)) = map.iter().next()? else { return None };
    let settings: Vec<String> = settings.iter().map(|(key, value)| format!("{key}: {value}")).collect();
    Some(format!("{name}({})", settings.join(", ")))
}

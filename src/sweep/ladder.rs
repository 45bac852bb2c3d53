//! Ladders: configurations that differ in a few keys, one curve in a plot each.
//!
//! A file holds several; all keys but `name` may be left out:
//!
//! ```ron
//! (ladders: [(
//!     name: "spacing",
//!     preset: "physical",                    // and config: "file.ron"; neither: the methods of the command line
//!     set: ["transport.bounces.max_bounces=8"],
//!     axes: [(key: "grid.spacing_m", values: [1.0, 0.5]), (key: "query.visibility", values: [none])],
//! )])
//! ```
//!
//! The axes are multiplied, the last one varies fastest.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use ron::value::RawValue;
use serde::Deserialize;

use super::SweepError;
use super::method::Method;
use crate::config::{Config, ConfigError, Layers};
use crate::system::input::read_text;

/// Configurations of a sweep at most: more is a mistake in an axis.
const MOST: usize = 4096;

/// One configuration of a ladder.
#[derive(Debug, Clone, PartialEq)]
pub struct Rung {
    pub label: String,
    /// Keys and values in which it differs from the others of its ladder.
    pub axes: Vec<(String, String)>,
    pub config: Config,
    /// The same on shifted grids, each with its shift in cells; none where the grid stays. See [`super::offsets`].
    pub shifted: Vec<([f64; 3], Config)>,
}

impl Rung {
    /// All that is baked, with the shift of its grid.
    pub fn configs(&self) -> Vec<(Option<[f64; 3]>, &Config)> {
        match &self.shifted[..] {
            [] => vec![(None, &self.config)],
            shifted => shifted.iter().map(|(shift, config)| (Some(*shift), config)).collect(),
        }
    }
}

/// One curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Ladder {
    pub name: String,
    /// Name of the method that it starts from.
    pub method: String,
    pub rungs: Vec<Rung>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LadderFile {
    ladders: Vec<Entry>,
    #[serde(skip)]
    path: PathBuf,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    #[serde(default)]
    preset: Option<String>,
    /// Relative to the ladder's own folder.
    #[serde(default)]
    config: Option<PathBuf>,
    #[serde(default)]
    set: Vec<String>,
    #[serde(default)]
    axes: Vec<Axis>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Axis {
    key: String,
    /// RON as in a configuration file.
    values: Vec<Box<RawValue>>,
}

impl LadderFile {
    /// Reads and checks a file of ladders.
    ///
    /// # Errors
    /// [`SweepError::Unreadable`], [`SweepError::Ladder`].
    pub fn read(path: &Path) -> Result<LadderFile, SweepError> {
        let unreadable = |cause| SweepError::Unreadable { path: path.to_owned(), cause };
        let text = read_text(path).map_err(unreadable)?;
        LadderFile::parse(&text, path)
    }

    fn parse(text: &str, path: &Path) -> Result<LadderFile, SweepError> {
        let mut file: LadderFile = crate::config::from_ron(text, &path.display().to_string())?;
        file.path = path.to_owned();
        let mut names = BTreeSet::new();
        let error = |what: String| SweepError::Ladder { place: path.display().to_string(), what };
        if file.ladders.is_empty() {
            return Err(error("it has no ladder; write (ladders: [(name: \"…\", axes: […])])".to_owned()));
        }
        for entry in &file.ladders {
            let name = &entry.name;
            if !names.insert(name) {
                return Err(error(format!("two ladders are named '{name}'; rename one")));
            }
            if let Some(axis) = entry.axes.iter().find(|axis| axis.values.is_empty()) {
                return Err(error(format!(
                    "ladder '{name}': the axis {} has no values; give some or remove it",
                    axis.key
                )));
            }
        }
        Ok(file)
    }

    /// Whether some ladder asks for the methods of the command line.
    pub fn wants_methods(&self) -> bool {
        self.ladders.iter().any(|entry| entry.preset.is_none() && entry.config.is_none())
    }

    /// Presets that its ladders start from, each once.
    pub fn presets(&self) -> BTreeSet<&str> {
        self.ladders.iter().filter_map(|entry| entry.preset.as_deref()).collect()
    }

    /// Files that it refers to.
    pub fn files(&self) -> Vec<PathBuf> {
        self.ladders.iter().filter_map(|entry| entry.config.as_ref()).map(|file| self.beside(file)).collect()
    }

    fn beside(&self, file: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(file)
    }

    fn own_method(&self, entry: &Entry) -> Result<Option<Method>, SweepError> {
        if entry.preset.is_none() && entry.config.is_none() {
            return Ok(None);
        }
        let files: Vec<PathBuf> = entry.config.iter().map(|file| self.beside(file)).collect();
        Ok(Some(Method::new(entry.preset.as_deref(), &files)?))
    }
}

/// All ladders: every one of the file that has no method of its own with each of `methods`; without a file one ladder with one
/// configuration for each. `set` is applied before the axes, `finish` at the end.
///
/// # Errors
/// Keys and values that the configuration does not know or take, too many configurations.
pub fn expand(
    file: Option<&LadderFile>,
    methods: &[Method],
    set: &[String],
    finish: impl Fn(&mut Config),
) -> Result<Vec<Ladder>, SweepError> {
    let mut ladders = Vec::new();
    let Some(file) = file else {
        for method in methods {
            let mut config = method.layers.clone().set(set)?.config()?;
            finish(&mut config);
            let rung = Rung { label: method.label(&config), axes: Vec::new(), config, shifted: Vec::new() };
            ladders.push(Ladder { name: method.name.clone(), method: method.name.clone(), rungs: vec![rung] });
        }
        return Ok(ladders);
    };
    let mut count = 0;
    for entry in &file.ladders {
        let place = format!("{}: ladder '{}'", file.path.display(), entry.name);
        let product = entry.axes.iter().map(|axis| axis.values.len()).fold(1usize, usize::saturating_mul);
        let own = file.own_method(entry)?;
        let starts = own.as_ref().map_or(methods, std::slice::from_ref);
        count += product.saturating_mul(starts.len());
        if count > MOST {
            return Err(SweepError::Ladder {
                place,
                what: format!("more than {MOST} configurations; shorten its axes"),
            });
        }
        for method in starts {
            let name = if starts.len() > 1 { format!("{}: {}", method.name, entry.name) } else { entry.name.clone() };
            let base = method.layers.clone().set(&entry.set).map_err(|e| in_ladder(&place, &e))?;
            // Mistakes of the ladder are told from those of the command line.
            base.config().map_err(|e| in_ladder(&place, &e))?;
            let base = base.set(set)?;
            base.config()?;
            let rungs = rungs(&name, &base, &entry.axes, &finish).map_err(|e| in_ladder(&place, &e))?;
            ladders.push(Ladder { name, method: method.name.clone(), rungs });
        }
    }
    Ok(ladders)
}

/// The message of a configuration's mistake, which is no `--set` here.
fn in_ladder(place: &str, error: &ConfigError) -> SweepError {
    let what = error.to_string();
    SweepError::Ladder { place: place.to_owned(), what: what.strip_prefix("--set ").unwrap_or(&what).to_owned() }
}

/// The product of the axes.
fn rungs(name: &str, base: &Layers, axes: &[Axis], finish: &dyn Fn(&mut Config)) -> Result<Vec<Rung>, ConfigError> {
    let mut found = vec![(Vec::new(), base.clone())];
    for axis in axes {
        let mut next = Vec::with_capacity(found.len() * axis.values.len());
        for (values, layers) in &found {
            for value in &axis.values {
                let value = value.get_ron().trim();
                let layers = layers.clone().set(&[format!("{}={value}", axis.key)])?;
                let values: &Vec<(String, String)> = values;
                next.push(([&values[..], &[(axis.key.clone(), value.to_owned())]].concat(), layers));
            }
        }
        found = next;
    }
    let rung = |(axes, layers): (Vec<(String, String)>, Layers)| {
        let mut config = layers.config()?;
        finish(&mut config);
        let parts: Vec<String> = axes.iter().map(|(key, value)| format!("{}={value}", short(key, &axes))).collect();
        let label = if parts.is_empty() { name.to_owned() } else { format!("{name} {}", parts.join(" ")) };
        Ok(Rung { label, axes, config, shifted: Vec::new() })
    };
    found.into_iter().map(rung).collect()
}

/// The end of a key that tells it from the other axes.
fn short<'k>(key: &'k str, axes: &[(String, String)]) -> &'k str {
    let ends = key.rmatch_indices('.').map(|(dot, _)| &key[dot + 1..]).chain([key]);
    let is_alone = |end: &&str| {
        let dotted = format!(".{end}");
        axes.iter().filter(|(other, _)| other == end || other.ends_with(&dotted)).count() == 1
    };
    ends.into_iter().find(is_alone).unwrap_or(key)
}

/// Refuses ladders that cannot share a reference: its light and its albedos are those of the scene.
///
/// # Errors
/// [`SweepError::NotShared`].
pub fn check_shared(ladders: &[Ladder]) -> Result<(), SweepError> {
    let rungs = || ladders.iter().flat_map(|ladder| &ladder.rungs);
    let Some(first) = rungs().next() else { return Ok(()) };
    type Value = fn(&Config) -> String;
    let keys: [(&'static str, Value); 4] = [
        ("lights.punctual_scale", |c| c.lights.punctual_scale.to_string()),
        ("lights.sky", |c| c.lights.sky.map_or("None".to_owned(), |sky| format!("{sky:?}"))),
        ("materials.albedo_max", |c| c.materials.albedo_max.to_string()),
        ("materials.unassigned", |c| c.materials.unassigned.to_string()),
    ];
    for (key, value) in keys {
        if let Some(other) = rungs().find(|rung| value(&rung.config) != value(&first.config)) {
            return Err(SweepError::NotShared {
                key,
                first: value(&first.config),
                first_label: first.label.clone(),
                second: value(&other.config),
                second_label: other.label.clone(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe::query::VisibilityTest;
    use crate::probe::transport::Transport;

    fn expanded(text: &str) -> Result<Vec<Ladder>, SweepError> {
        let methods = [Method::new(None, &[]).unwrap()];
        expand(Some(&LadderFile::parse(text, Path::new("a.ron"))?), &methods, &["placement.rays=64".to_owned()], |_| {})
    }

    #[test]
    fn axes_are_multiplied_and_take_any_value_of_a_configuration() {
        let ladders = expanded(
            "(ladders: [(name: \"a\", set: [\"solver.tolerance=1e-3\"], axes: [
                (key: \"grid.spacing_m\", values: [1.0, 0.5]),
                (key: \"query.visibility\", values: [none, moments(power: 3, floor: 0.05), surface(voxels_per_cell: 4)]),
             ]), (name: \"b\", preset: \"path\")])",
        )
        .unwrap();
        assert_eq!(ladders.len(), 2);
        let rungs = &ladders[0].rungs;
        assert_eq!(rungs.len(), 6);
        assert_eq!(rungs[1].label, "a spacing_m=1.0 visibility=moments(power: 3, floor: 0.05)");
        assert_eq!(rungs[1].config.query.test, VisibilityTest::Chebyshev { power: 3.0, floor: 0.05 });
        assert_eq!(rungs[5].config.grid.spacing_m, Some(0.5));
        let set = ["solver.tolerance=1e-3", "placement.rays=64"].map(str::to_owned);
        let expected = Layers::of(None).unwrap().set(&set).unwrap().config().unwrap();
        assert!(rungs.iter().all(|rung| rung.config.transport == expected.transport));
        assert!(rungs.iter().all(|rung| rung.config.placement == expected.placement));
        assert!(matches!(ladders[1].rungs[0].config.transport, Transport::Paths { .. }));
        assert_eq!((ladders[1].method.as_str(), ladders[1].rungs.len()), ("path", 1));
        assert_eq!(ladders[1].rungs[0].label, "b");
    }

    #[test]
    fn a_method_each_where_there_are_several() {
        let methods = ["one", "two"];
        let methods = methods.map(|name| Method { name: name.to_owned(), layers: Layers::default(), preset: None });
        let file = "(ladders: [(name: \"a\", axes: [(key: \"grid.spacing_m\", values: [1, 2])])])";
        let file = LadderFile::parse(file, Path::new("a.ron")).unwrap();
        let ladders = expand(Some(&file), &methods, &[], |_| {}).unwrap();
        assert_eq!(ladders.iter().map(|l| l.name.as_str()).collect::<Vec<_>>(), ["one: a", "two: a"]);
        let plain = expand(None, &methods, &[], |_| {}).unwrap();
        assert_eq!(plain.iter().map(|l| l.rungs[0].label.as_str()).collect::<Vec<_>>(), ["one", "two"]);
    }

    #[test]
    fn mistakes_are_named_with_file_ladder_and_nearest_key() {
        for (text, words) in [
            (
                "(ladders: [(name: \"a\", axes: [(key: \"grid.spacing\", values: [1])])])",
                &["a.ron", "'a'", "'spacing_m'"][..],
            ),
            (
                "(ladders: [(name: \"a\", axes: [(key: \"capture.resolution\", values: [8, 0])])])",
                &["'a'", "1 to 1024"],
            ),
            ("(ladders: [(name: \"a\", axes: [(key: \"grid.spacing_m\", values: [])])])", &["no values"]),
            ("(ladders: [(name: \"a\"), (name: \"a\")])", &["two ladders"]),
            ("(ladders: [])", &["no ladder"]),
            ("(ladder: [])", &["a.ron, line 1", "'ladders'"]),
            ("(ladders: [(name: \"a\", preset: \"defualt\")])", &["default"]),
        ] {
            let error = expanded(text).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{text}: {error}");
            assert!(!error.contains("--set"), "{error}");
        }
    }

    #[test]
    fn what_the_reference_depends_on_must_agree() {
        for (key, value) in [
            ("lights.punctual_scale", "2.0"),
            ("materials.albedo_max", "0.5"),
            ("materials.unassigned", "gltf"),
            ("lights.sky", "(1, 1, 1)"),
        ] {
            let text = format!("(ladders: [(name: \"a\"), (name: \"b\", set: [\"{key}={value}\"])])");
            let error = check_shared(&expanded(&text).unwrap()).unwrap_err().to_string();
            assert!(error.contains(key) && error.contains("'a'") && error.contains("'b'"), "{error}");
        }
        check_shared(&expanded("(ladders: [(name: \"a\"), (name: \"b\")])").unwrap()).unwrap();
    }
}

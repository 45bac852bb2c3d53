//! The floors of `src/lib.rs`: no file imports from a floor above its own, and no files import each other in a circle.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use syn::visit::{self, Visit};

/// A file's place in the tree of modules, for example `["probe", "query"]`.
type Module = Vec<String>;

/// Every source file but `lib.rs` and `main.rs`, by its module.
fn files(folder: &Path, at: &[String], found: &mut BTreeMap<Module, syn::File>) {
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            files(&path, &[at, &[stem]].concat(), found);
        } else if path.extension().is_some_and(|e| e == "rs") && !(at.is_empty() && (stem == "lib" || stem == "main")) {
            let module = if stem == "mod" { at.to_vec() } else { [at, &[stem]].concat() };
            found.insert(module, syn::parse_file(&std::fs::read_to_string(&path).unwrap()).unwrap());
        }
    }
}

/// Paths of the crate that a file names, in `use` or in passing; what only its tests name does not count.
struct Named<'a> {
    module: &'a [String],
    paths: BTreeSet<Module>,
}

impl Named<'_> {
    /// Without leading `crate`, `self` and `super`; `None` for names of other crates and of the file itself.
    fn add(&mut self, segments: &[String]) {
        let ups = segments.iter().take_while(|s| *s == "super").count();
        let base: &[String] = match segments.first().map(String::as_str) {
            Some("crate") => &[],
            Some("self") => self.module,
            Some("super") => &self.module[..self.module.len().saturating_sub(ups)],
            _ => return,
        };
        self.paths.insert([base, &segments[ups.max(1)..]].concat());
    }

    fn add_tree(&mut self, before: &[String], tree: &syn::UseTree) {
        let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
        match tree {
            syn::UseTree::Path(path) => self.add_tree(&with(&path.ident), &path.tree),
            syn::UseTree::Name(name) => self.add(&with(&name.ident)),
            syn::UseTree::Rename(name) => self.add(&with(&name.ident)),
            syn::UseTree::Glob(_) => self.add(before),
            syn::UseTree::Group(group) => group.items.iter().for_each(|tree| self.add_tree(before, tree)),
        }
    }
}

impl<'ast> Visit<'ast> for Named<'_> {
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.add_tree(&[], &item.tree);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.add(&path.segments.iter().map(|s| s.ident.to_string()).collect::<Vec<_>>());
        visit::visit_path(self, path);
    }

    /// `pub(super)` names a folder to limit who may import, and imports nothing itself.
    fn visit_vis_restricted(&mut self, _: &'ast syn::VisRestricted) {}

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !item.attrs.iter().any(|a| a.path().is_ident("cfg")) {
            visit::visit_item_mod(self, item);
        }
    }
}

/// Which files each file imports from.
fn imports() -> BTreeMap<Module, BTreeSet<Module>> {
    let mut found = BTreeMap::new();
    files(Path::new("src"), &[], &mut found);
    let file_of = |mut path: &[String]| loop {
        match found.get_key_value(path) {
            Some((module, _)) => return Some(module.clone()),
            None => path = path.split_last()?.1,
        }
    };
    let of = |(module, file): (&Module, &syn::File)| {
        let mut named = Named { module, paths: BTreeSet::new() };
        named.visit_file(file);
        let targets = named.paths.iter().filter_map(|path| file_of(path)).filter(|target| target != module).collect();
        (module.clone(), targets)
    };
    found.iter().filter(|(module, _)| !module.iter().any(|name| name == "tests")).map(of).collect()
}

/// The floor of every top-level module: the groups of `lib.rs`.
fn floors() -> BTreeMap<String, usize> {
    let text = std::fs::read_to_string("src/lib.rs").unwrap();
    let groups = text.split("\n\n").filter(|group| group.contains("\npub mod ") || group.starts_with("pub mod "));
    let named = |(floor, group): (usize, &str)| -> Vec<(String, usize)> {
        let name = |line: &str| Some((line.strip_prefix("pub mod ")?.strip_suffix(';')?.to_owned(), floor));
        group.lines().filter_map(name).collect()
    };
    groups.enumerate().flat_map(named).collect()
}

#[test]
fn no_import_goes_upwards() {
    let (imports, floors) = (imports(), floors());
    assert!(imports.len() > 150 && floors.len() > 12 && floors["math"] < floors["commands"]);
    for (module, targets) in &imports {
        let upwards: Vec<String> =
            targets.iter().filter(|t| floors[&t[0]] > floors[&module[0]]).map(|t| t.join("::")).collect();
        assert!(upwards.is_empty(), "{} imports {upwards:?} from a floor above its own", module.join("::"));
    }
}

#[test]
fn no_files_import_each_other() {
    let imports = imports();
    let reached_from = |module: &Module| {
        let (mut reached, mut next) = (BTreeSet::new(), vec![module]);
        while let Some(at) = next.pop() {
            next.extend(imports[at].iter().filter(|target| reached.insert((*target).clone())));
        }
        reached
    };
    let circular: Vec<String> = imports.keys().filter(|m| reached_from(m).contains(*m)).map(|m| m.join("::")).collect();
    assert!(circular.is_empty(), "files that import each other in circles: {circular:#?}");
}

/// Causes are printed after what they caused. A message that holds its cause as well would say it twice.
#[test]
fn no_message_repeats_its_cause() {
    struct Errors(Vec<String>);
    impl<'ast> Visit<'ast> for Errors {
        fn visit_variant(&mut self, variant: &'ast syn::Variant) {
            let message = |a: &&syn::Attribute| a.path().is_ident("error");
            let message = variant.attrs.iter().find(message).and_then(|a| a.parse_args::<syn::LitStr>().ok());
            for (i, field) in variant.fields.iter().enumerate() {
                let name = field.ident.as_ref().map_or_else(|| i.to_string(), ToString::to_string);
                let is_cause = name == "source"
                    || field.attrs.iter().any(|a| a.path().is_ident("from") || a.path().is_ident("source"));
                if is_cause && message.as_ref().is_some_and(|m| m.value().contains(&format!("{{{name}"))) {
                    self.0.push(variant.ident.to_string());
                }
            }
        }
    }
    let (mut found, mut errors) = (BTreeMap::new(), Errors(Vec::new()));
    files(Path::new("src"), &[], &mut found);
    found.values().for_each(|file| errors.visit_file(file));
    assert!(errors.0.is_empty(), "{:?}", errors.0);
}

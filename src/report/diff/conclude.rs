//! From what was found to the report: gates judged and sorted, verdict, names of pictures.

use std::collections::BTreeSet;

use super::config_changes::config_changes;
use super::gate::{self, Finding, Gate};
use super::images::ImageReport;
use super::sides::Side;
use super::thresholds::Exception;
use super::{About, Command, Compared, DiffReport, Found, Request, SCHEMA, SideReport, Verdict};
use crate::image::Picture8;

/// Gates that a scene which is allowed to change does not fail by that alone.
const OF_THE_SCENE: &[&str] = &["scene", "image.surface"];

pub(super) fn conclude(request: &Request, sides: &[Side; 2], mut found: Found) -> Compared {
    let count = |name, list: &[String], words: &str| {
        let explanation = if list.is_empty() { words.to_owned() } else { format!("{words}: {}.", list.join(", ")) };
        Finding { scale: 1.0, ..Finding::count(name, "", list.len(), 1, explanation) }
    };
    found.findings.push(count("missing", &found.missing, "What only the base has"));
    found.findings.push(count("added", &found.added, "What only the candidate has"));
    let scene_changed = found.findings.iter().any(|f| f.name == "scene" && f.value == Some(1.0));
    let mut gates: Vec<Gate> = found.findings.into_iter().map(|finding| request.thresholds.judge(finding)).collect();
    for gate in &mut gates {
        let of_the_scene = OF_THE_SCENE.contains(&gate.name.as_str()) && scene_changed;
        if request.allow_scene_change && of_the_scene && !gate.passed {
            gate.waived = true;
            gate.source = "--allow-scene-change".to_owned();
        }
    }
    gate::sort(&mut gates);
    let pictures = name_maps(&mut found.images, found.maps);
    let [about_base, about_candidate] = &found.about;
    let side = |side: &Side, about: &About| SideReport {
        path: side.path.display().to_string(),
        kind: side.description(),
        items: side.items.len(),
        seed: about.seed,
        config: about.config.clone(),
        scene_blake3: about.scene.clone(),
    };
    let mut notes = Vec::new();
    if let (Some(a), Some(b)) = (about_base.seed, about_candidate.seed) {
        notes.push(match a == b {
            true => format!("Both sides have the seed {a}: without any change their noise would be the same."),
            false => format!("The seeds are {a} and {b}: the sides differ by their noise at least."),
        });
    }
    for Exception { item, gate, .. } in request.thresholds.without_effect(&gates) {
        notes.push(format!("The exception for item {item}, gate {gate} fits no gate of this comparison."));
    }
    let mut commands = vec![Command { purpose: "compare".to_owned(), line: request.command_line.clone() }];
    for (about, side) in found.about.iter().zip(sides) {
        commands.extend(about.commands.iter().cloned());
        if about.commands.is_empty() {
            let path = side.path.display();
            notes.push(format!("What made {path} is not known: only reports hold their command, and none lies there."));
        }
    }
    let report = DiffReport {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        base: side(&sides[0], about_base),
        candidate: side(&sides[1], about_candidate),
        verdict: verdict(&gates),
        gates,
        images: found.images,
        probes: found.probes,
        figures: found.figures,
        added: found.added,
        missing: found.missing,
        config_changes: config_changes(about_base.config.as_deref(), about_candidate.config.as_deref()),
        thresholds: request.thresholds.clone(),
        notes,
        commands,
    };
    Compared { report, shown: found.shown, pictures }
}

/// Gives the difference maps names that are safe in any folder.
fn name_maps(images: &mut [ImageReport], maps: Vec<Option<Picture8>>) -> Vec<(String, Picture8)> {
    let mut named = Vec::new();
    let mut taken = BTreeSet::new();
    for (image, map) in images.iter_mut().zip(maps) {
        let Some(map) = map else { continue };
        let safe = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '-' | '_') { c } else { '_' };
        let stem: String = image.item.chars().map(safe).collect();
        let stem = if stem.is_empty() { "difference".to_owned() } else { format!("difference_{stem}") };
        let names = std::iter::once(stem.clone()).chain((2..).map(|n| format!("{stem}_{n}")));
        // Endless: one of them is free.
        let name = names.map(|name| format!("{name}.png")).find(|name| !taken.contains(name)).unwrap_or_default();
        taken.insert(name.clone());
        image.difference_map = Some(name.clone());
        named.push((name, map));
    }
    named
}

fn verdict(gates: &[Gate]) -> Verdict {
    let failed: Vec<&Gate> = gates.iter().filter(|g| g.fails()).collect();
    let waived = gates.iter().filter(|g| g.waived).count();
    let judged = gates.iter().filter(|g| g.is_judged()).count();
    let first = failed.first().map(|g| g.title());
    let allowed = if waived > 0 { format!(", {waived} waived") } else { String::new() };
    let sentence = match &first {
        Some(first) => format!("Beyond thresholds: {} of {judged} gates fail{allowed}, first {first}.", failed.len()),
        None => format!("Within thresholds: all {judged} gates pass{allowed}."),
    };
    Verdict { passed: failed.is_empty(), gates: judged, failed: failed.len(), waived, first, sentence }
}

//! What of the two sides belongs together, and whether it can be compared.

use std::path::Path;

use serde_json::Value;

use super::images::{self, LIGHT, Pair, join};
use super::mask::Mask;
use super::noise::Noise;
use super::sides::{Item, RENDER_PICTURES, Side};
use super::{DiffError, Request, figures};

/// Items by name: of both, and of one side only.
pub(super) struct Pairs<'a> {
    pub(super) both: Vec<(&'a str, &'a Item, &'a Item)>,
    pub(super) added: Vec<String>,
    pub(super) missing: Vec<String>,
}

pub(super) fn pair_up(sides: &[Side; 2]) -> Result<Pairs<'_>, DiffError> {
    let [base, candidate] = sides;
    let incomparable =
        |what: String| DiffError::Incomparable { base: base.path.clone(), candidate: candidate.path.clone(), what };
    if let (Some((_, a)), Some((_, b))) = (base.single(), candidate.single()) {
        if a.kind() != b.kind() {
            return Err(incomparable(format!("one is {}, the other {}", a.kind().name(), b.kind().name())));
        }
        if base.items.contains_key("") && candidate.items.contains_key("") {
            return Ok(Pairs { both: vec![("", a, b)], added: Vec::new(), missing: Vec::new() });
        }
    }
    if base.items.contains_key("") != candidate.items.contains_key("") {
        return Err(incomparable(format!(
            "one is {}, the other {}; give two of a kind",
            base.description(),
            candidate.description()
        )));
    }
    let mut both = Vec::new();
    for (name, a) in &base.items {
        let Some(b) = candidate.items.get(name) else { continue };
        if a.kind() != b.kind() {
            let (a, b) = (a.kind().name(), b.kind().name());
            return Err(incomparable(format!("{name} is {a} in one and {b} in the other")));
        }
        both.push((name.as_str(), a, b));
    }
    if both.is_empty() {
        return Err(incomparable("no name is in both folders; name the files of both alike".to_owned()));
    }
    let only = |x: &Side, y: &Side| x.items.keys().filter(|name| !y.items.contains_key(*name)).cloned().collect();
    Ok(Pairs { both, added: only(candidate, base), missing: only(base, candidate) })
}

/// The pictures of two folders of `render` that are there on both sides.
pub(super) fn pictures<'m>(
    name: &str,
    [base, candidate]: [&Path; 2],
    report: &Value,
    mask: Option<&'m Mask>,
) -> Vec<Pair<'m>> {
    let exposure_ev = figures::number(report, "exposure_ev").map(|ev| ev as f32);
    let pair = |&(picture, judged): &(&str, bool)| {
        let [base, candidate] = [base, candidate].map(|folder| folder.join(format!("{picture}.exr")));
        Pair { item: join(name, picture), base, candidate, judged, exposure_ev, noise: Noise::Unknown, mask }
    };
    RENDER_PICTURES.iter().map(pair).collect()
}

/// Refuses what cannot be compared, before anything is. `kept`: see [`images::check`].
pub(super) fn check(base: &Item, candidate: &Item, request: &Request, kept: f64) -> Result<f64, DiffError> {
    let mask = request.mask;
    match (base, candidate) {
        (Item::Render { folder: a, report: b_report }, Item::Render { folder: b, report: c_report }) => {
            same_view([a, b], [b_report, c_report])?;
            let pairs = pictures("", [a, b], b_report, mask);
            pairs
                .iter()
                .filter(|p| p.base.is_file() && p.candidate.is_file())
                .try_fold(kept, |kept, pair| images::check(pair, kept))
        }
        (Item::Sweep(a), Item::Sweep(b)) => same_view([request.base, request.candidate], [a, b]).map(|()| kept),
        (Item::Image(a), Item::Image(b)) => images::check(&image_pair("", a, b, mask), kept),
        _ => Ok(kept),
    }
}

/// Refuses reports of other cameras or sizes.
fn same_view([base, candidate]: [&Path; 2], [a, b]: [&Value; 2]) -> Result<(), DiffError> {
    for key in ["camera", "width", "height"] {
        if a[key] != b[key] {
            let what = format!("{key} {} and {key} {}; make both with the same --camera and --size", a[key], b[key]);
            return Err(DiffError::Incomparable { base: base.to_owned(), candidate: candidate.to_owned(), what });
        }
    }
    Ok(())
}

pub(super) fn image_pair<'m>(name: &str, base: &Path, candidate: &Path, mask: Option<&'m Mask>) -> Pair<'m> {
    Pair {
        item: name.to_owned(),
        base: base.to_owned(),
        candidate: candidate.to_owned(),
        judged: true,
        exposure_ev: None,
        noise: Noise::Unknown,
        mask,
    }
}

/// How many pairs of pictures the page shows, at most: two layers of a render's pictures, one of an image.
pub(super) fn shown_pairs(pairs: &Pairs) -> usize {
    let of_item = |(_, base, candidate): &(&str, &Item, &Item)| match (base, candidate) {
        (Item::Render { folder: a, report }, Item::Render { folder: b, .. }) => {
            let both = pictures("", [a, b], report, None);
            LIGHT.len() * both.iter().filter(|p| p.base.is_file() && p.candidate.is_file()).count()
        }
        (Item::Image(_), Item::Image(_)) => 1,
        _ => 0,
    };
    pairs.both.iter().map(of_item).sum()
}

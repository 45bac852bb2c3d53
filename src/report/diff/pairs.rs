//! What of the two sides belongs together, and whether it can be compared.

use super::error::DiffError;
use super::figures::{Seeds, join};
use super::images::{self, Pair};
use super::mask::Mask;
use super::sides::{Item, Kind, Side};

/// Pictures of `render` that are compared, with whether they decide.
const PICTURES: [(&str, bool); 2] = [("visibility_on.exr", true), ("visibility_off.exr", false)];

/// An item of the candidate and the base's of the same name: one, or one for each of several seeds.
pub struct Paired<'a> {
    pub name: &'a str,
    pub bases: Vec<&'a Item>,
    pub candidate: &'a Item,
}

/// Items by name: of both, and of one side only.
pub struct Pairs<'a> {
    pub both: Vec<Paired<'a>>,
    pub added: Vec<String>,
    pub missing: Vec<String>,
}

/// # Errors
/// Sides without a common name, of two kinds, or of cameras or sizes that differ.
pub fn pair_up([base, candidate]: &[Side; 2]) -> Result<Pairs<'_>, DiffError> {
    let common = |(name, item)| Some(Paired { name, bases: vec![base.items.get(name)?], candidate: item });
    let names = candidate.items.iter().map(|(name, item)| (name.as_str(), item));
    let mut both: Vec<Paired> = names.filter_map(common).collect();
    let mut only = [(candidate, base), (base, candidate)]
        .map(|(x, y)| x.items.keys().filter(|name| !y.items.contains_key(*name)).cloned().collect::<Vec<_>>());
    if both.is_empty()
        && let Some(of_seeds) = seeds_side_by_side(base, candidate)
    {
        (both, only) = (of_seeds, Default::default());
    }
    if both.is_empty() {
        let (a, b) = (base.description(), candidate.description());
        let what = format!("one is {a}, the other {b}, and no name is in both; give two of a kind, with names alike");
        return Err(DiffError::incomparable([&base.path, &candidate.path], what));
    }
    for Paired { bases, candidate, .. } in &mut both {
        bases.iter().try_for_each(|base| alike(base, candidate))?;
        let seeds = |a: &Item, b: &Item| Seeds::of([&a.facts, &b.facts]);
        // The noise of an equal seed is no noise at all.
        if let Some(equal) = bases.iter().position(|base| seeds(base, candidate) == Seeds::Equal) {
            *bases = vec![bases[equal]];
        }
        let mut pairs = bases.iter().enumerate().flat_map(|(i, a)| bases[..i].iter().map(move |b| (a, b)));
        if let Some((a, b)) = pairs.find(|(a, b)| seeds(a, b) != Seeds::Other) {
            let what = "both are of one seed, or do not tell it; give the base's results with a seed each";
            return Err(DiffError::incomparable([&a.path, &b.path], what));
        }
    }
    let [added, missing] = only;
    Ok(Pairs { both, added, missing })
}

/// A base that holds the candidate's items several times, in folders or files of a seed each; `None` where it is something else.
fn seeds_side_by_side<'a>(base: &'a Side, candidate: &'a Side) -> Option<Vec<Paired<'a>>> {
    let mut paired: Vec<Paired> =
        candidate.items.iter().map(|(name, candidate)| Paired { name, bases: Vec::new(), candidate }).collect();
    for (name, item) in &base.items {
        let is_end = |end: &str| end.is_empty() || name.strip_suffix(end).is_some_and(|start| start.ends_with('/'));
        let fitting = paired.iter_mut().filter(|paired| is_end(paired.name) && paired.candidate.kind == item.kind);
        fitting.max_by_key(|paired| paired.name.len())?.bases.push(item);
    }
    paired.iter().all(|paired| paired.bases.len() > 1).then_some(paired)
}

/// The pictures of two folders of `render`, or two images.
pub fn pictures<'m>(name: &str, [base, candidate]: [&Item; 2], mask: Option<&'m Mask>) -> Vec<Pair<'m>> {
    let exposure_ev = base.facts.number("exposure_ev").map(|ev| ev as f32);
    let seeds = Seeds::of([&base.facts, &candidate.facts]);
    let pair = |(file, judged): (&str, bool)| {
        let [a, b] =
            [base, candidate].map(|item| if file.is_empty() { item.path.clone() } else { item.path.join(file) });
        let item = join(name, file.trim_end_matches(".exr"));
        Pair { item, base: a, candidate: b, judged, exposure_ev, seeds, mask }
    };
    match base.kind {
        Kind::Render => PICTURES.map(pair).into(),
        Kind::Image => vec![pair(("", true))],
        _ => Vec::new(),
    }
}

/// Refuses pictures that cannot be compared, before any is. Returns how many pairs the page shows, at most.
///
/// # Errors
/// See [`images::check`]; a mask that is for no picture.
pub fn check(pairs: &Pairs, mask: Option<&Mask>) -> Result<usize, DiffError> {
    let (mut kept, mut shown, mut found) = (0.0, 0, false);
    for paired in &pairs.both {
        for (i, base) in paired.bases.iter().enumerate() {
            let pictures = pictures(paired.name, [base, paired.candidate], mask);
            found |= !pictures.is_empty();
            for pair in pictures.iter().filter(|pair| pair.base.is_file() && pair.candidate.is_file()) {
                let after = images::check(pair, kept)?;
                // Only the first of several seeds is shown.
                if i == 0 {
                    (kept, shown) = (after, shown + if base.kind == Kind::Render { images::LIGHT.len() } else { 1 });
                }
            }
        }
    }
    let what = "no picture is compared; leave --mask out, or compare renders or images";
    mask.filter(|_| !found).map_or(Ok(shown), |mask| Err(DiffError::file(&mask.path, what)))
}

/// Refuses items of two kinds, and reports of other cameras or sizes.
fn alike(base: &Item, candidate: &Item) -> Result<(), DiffError> {
    let differs = |key: &&str| base.report.get(key) != candidate.report.get(key);
    let what = if base.kind != candidate.kind {
        format!("one is {}, the other {}", base.kind.names()[1], candidate.kind.names()[1])
    } else if let Some(key) = ["camera", "width", "height"].into_iter().find(differs) {
        let [a, b] = [base, candidate].map(|item| &item.report[key]);
        format!("{key} {a} and {key} {b}; make both with the same --camera and --size")
    } else {
        return Ok(());
    };
    Err(DiffError::incomparable([&base.path, &candidate.path], what))
}

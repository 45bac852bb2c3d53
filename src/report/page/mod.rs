//! Pages: one HTML file each that holds its pictures, plots, style and script, and asks nothing of any network. One is of a
//! comparison, the other, [`look`], of a bake.
//!
//! A policy in its head (Content Security Policy, W3C, level 3) forbids every load but those of its own data, and every script but
//! its own, which it knows by a number that no name from outside can foresee.

mod budget;
mod codes;
mod data;
mod embed;
mod histogram;
mod images;
pub mod look;
mod pack;
mod shrink;
pub mod still;
mod view;
mod visible;

use minijinja::{Value, context};

pub use codes::{code_of_radiance, radiance_of_code};
pub use data::{Command, ConfigChange, PageError, PairPixels};
pub use embed::MOST_PIXELS;
pub use histogram::histogram;
pub use images::PackedImage;
pub use shrink::PixelExtent;

use crate::report::gate::Gate;

const STYLE: &str = include_str!("../assets/page/page.css");
const START: &str = include_str!("../assets/page/start.js");
const THEME: &str = include_str!("../assets/page/theme.js");
const SCRIPTS: [&str; 4] = [
    include_str!("../assets/page/codec.js"),
    THEME,
    include_str!("../assets/page/viewer.js"),
    include_str!("../assets/page/page.js"),
];

/// What stands for the nonce until it is known. Never in a page that is handed out.
const NO_NONCE: &str = "0";

/// The page as HTML. `report`: of the comparison, as its JSON has it, with `plots` (each a
/// `title` and an `svg`, shown as a picture: whatever it holds, it cannot run or load anything), and with `figures` and `histograms` of its probes.
///
/// # Errors
/// None in practice: the templates are part of the program.
pub fn render(report: Value, gates: &[Gate], images: Vec<PackedImage>) -> Result<String, PageError> {
    document("page.html", &view::view(report, gates, images), "", &SCRIPTS)
}

/// A template of what it reads as `page`, with its style besides that of all pages, and its scripts.
fn document(template: &str, page: &Value, style: &str, scripts: &[&'static str]) -> Result<String, PageError> {
    let environment = view::environment()?;
    let template = environment.get_template(template)?;
    let (style, scripts) = (format!("{STYLE}{style}"), Value::from(scripts.to_vec()));
    let with_nonce = |nonce: &str| {
        template.render(
            context! { page => page.clone(), style => style.as_str(), start => START, scripts => scripts.clone(), nonce => nonce },
        )
    };
    // A name that is to pass for a script of ours would have to hold the hash of a page that holds that name.
    let nonce = blake3::hash(with_nonce(NO_NONCE)?.as_bytes()).to_hex();
    Ok(with_nonce(&nonce[..32])?)
}

#[cfg(test)]
mod tests {
    use minijinja::value::Serde;
    use serde_json::json;

    use super::*;
    use crate::report::page::embed::tests::{differences, pair, pictures};

    /// A page whose every text is `text`.
    fn page_of(text: &str) -> String {
        let gates = [Gate {
            name: text.to_owned(),
            item: text.to_owned(),
            base: None,
            candidate: Some(1.0),
            value: Some(2.0),
            unit: "%",
            side_unit: "",
            threshold: Some(1.0),
            margin: Some(-1.0),
            standard_error: Some(0.1),
            passed: false,
            waived: false,
            source: text.to_owned(),
            explanation: text.to_owned(),
        }];
        let pictures = pictures(24, 16);
        let difference = differences(&pictures);
        let pair = PairPixels { name: text, unit: text, ..pair(&pictures, &difference) };
        let figure = json!({"item": text, "name": text, "unit": text, "difference": 1.0});
        let image = json!({"width": 24, "height": 16, "exposure_ev": 0.5, "quantity": text, "figures": [figure]});
        let side = json!({"path": text, "kind": text, "seed": 7, "scene_blake3": text, "config": text});
        let row = json!({"index": 3, "position_m": [1.0, null, -2.0], "irradiance_difference_relative": 0.1,
                         "state_base": text, "state_candidate": format!("{text}!"), "moved_m": 0.0});
        let report = json!({
            "base": side, "candidate": side,
            "verdict": {"passed": false, "gates": 1, "failed": 1, "waived": 0},
            "figures": [figure],
            "plots": [{"title": text, "svg": format!("<svg>{text}</svg>")}],
            "added": [text], "missing": [text],
            "commands": [{"purpose": text, "line": text}],
            "config_changes": [{"key": text, "base": text, "candidate": null}],
            "notes": [text],
        });
        let probes = context! {
            histograms => [histogram(text, &[0.1, -0.2], 1.0, text, text)],
            ..Value::from(Serde(json!({"item": text, "figures": [figure], "worst": [row]})))
        };
        let packed = PackedImage::new(&pair, Value::from(Serde(image)), 1).unwrap();
        render(context! { probes => [probes], ..Value::from(Serde(report)) }, &gates, vec![packed]).unwrap()
    }

    #[test]
    fn hostile_names_stay_names() {
        let harmless = page_of("x");
        let count = |page: &str, what: &str| page.matches(what).count();
        for hostile in [
            "</script><script>boom()</script>",
            "\"><img src=x onerror=boom()>",
            "' onfocus='boom()",
            "<!--",
            "]]>{{ 7*7 }}",
        ] {
            let page = page_of(hostile);
            for markup in ["<script", "</script", "<img", "<!--", "<svg", "<style"] {
                assert_eq!(count(&page, markup), count(&harmless, markup), "{markup} by {hostile}");
            }
            assert!(!page.contains("onerror=boom") || page.contains("&lt;img src=x onerror=boom"), "{hostile}");
            assert!(!page.contains("<img src=x") && !page.contains("' onfocus='"), "{hostile}");
        }
        assert!(page_of("]]>{{ 7*7 }}").contains("{{ 7*7 }}"));
    }

    #[test]
    fn direction_marks_are_spelled_out() {
        let page = page_of("gnp.\u{202E}exr\u{0007}");
        // Only the exact line for the clipboard keeps them.
        let lines = page.lines().filter(|line| line.contains('\u{202E}') || line.contains('\u{0007}'));
        assert!(lines.clone().all(|line| line.contains("data-copy=")), "{:?}", lines.collect::<Vec<_>>());
        assert!(page.contains("⟨U+202E⟩"));
    }

    #[test]
    fn nothing_is_loaded_from_anywhere() {
        let page = page_of("x");
        assert!(page.contains("default-src 'none'"));
        let links = ["src=", "href=", "url(", "@import", "fetch(", "XMLHttpRequest", "import("];
        for (link, at) in links.iter().flat_map(|link| page.match_indices(link).map(|(at, _)| (*link, at))) {
            let rest = page[at + link.len()..].trim_start_matches(['"', '\'']);
            assert!(rest.starts_with("data:") || rest.starts_with('#'), "{link}{}", &rest[..rest.len().min(40)]);
        }
        assert!(!page.contains("unsafe-inline") && !page.contains(" style=") && !page.contains(" onclick="));
    }

    #[test]
    fn the_same_input_gives_the_same_page_and_another_another_nonce() {
        let nonce = |page: &str| page.split("'nonce-").nth(1).map(|rest| rest[..32].to_owned()).unwrap();
        assert_eq!(page_of("x"), page_of("x"));
        assert_ne!(nonce(&page_of("x")), nonce(&page_of("y")));
    }

    #[test]
    fn pixels_must_match_their_size() {
        let [base, _] = pictures(24, 16);
        let [_, candidate] = pictures(25, 16);
        let pictures = [base, candidate];
        let packed = PackedImage::new(&pair(&pictures, &differences(&pictures)), Value::UNDEFINED, 1);
        assert!(matches!(packed, Err(PageError::Size { base: 384, candidate: 400, .. })));
    }
}

//! Sizes of windows, colours, paper, no scripts.

use crate::browser::Opened;
use crate::fixture;

fn assert_fits(opened: &Opened, what: &str) {
    let [needed, there] = ["document.documentElement.scrollWidth", "innerWidth"].map(|length| opened.number(length));
    assert!(needed <= there, "{what}: the page is {needed} px wide in a window of {there} px");
}

pub fn the_page_fits_telephones_screens_and_paper() {
    let opened = Opened::new(&fixture::page(), 1280, 900);
    for (width, height) in [(1280, 900), (390, 844), (320, 640)] {
        opened.resize(width, height);
        for colors in ["light", "dark"] {
            opened.emulate(colors, "screen");
            for image in ["image-1", "image-2", "image-3"] {
                opened.show_image(image);
            }
            opened.eval("scrollTo({top: 0, behavior: 'instant'})");
            opened.settle();
            assert_fits(&opened, colors);
            opened.shoot(&format!("fixture-{width}-{colors}"));
        }
    }
    // A4 at 96 px an inch: narrower than some screens, but no telephone.
    opened.resize(794, 1123);
    opened.emulate("dark", "print");
    assert_eq!(opened.text("getComputedStyle(document.querySelector('tbody.gate')).display"), "table-row-group");
    assert_eq!(opened.text("getComputedStyle(document.body).backgroundColor"), "rgb(255, 255, 255)");
    let is_shown =
        |selector: &str| opened.eval(&format!("document.querySelector('{selector}').checkVisibility()")) == true;
    assert!(
        !is_shown(".viewer") && !is_shown("#image-1 .tools") && !is_shown("button.theme") && !is_shown("button.copy")
    );
    let base = opened.place("#image-1 .stills figure:nth-child(1) img");
    let candidate = opened.place("#image-1 .stills figure:nth-child(2) img");
    assert!(base[1] == candidate[1] && candidate[0] > base[0] + base[2] - 1.0, "side by side: {base:?} {candidate:?}");
    assert!(
        opened.number("[...document.querySelectorAll('tbody.gate')].filter((g) => !g.checkVisibility()).length") == 0.0
    );
    opened.emulate("light", "");
    opened.print("fixture");
    opened.assert_quiet();
}

pub fn without_scripts_there_is_all_but_the_controls() {
    let opened = Opened::with_scripts(&fixture::page(), 1280, 900, false);
    // The protocol evaluates although the page's own scripts are off.
    let is_shown =
        |selector: &str| opened.eval(&format!("document.querySelector('{selector}').checkVisibility()")) == true;
    assert!(is_shown("h1") && is_shown("noscript p") && is_shown("#image-1 .stills img") && is_shown("#gates-table"));
    assert!(!is_shown(".viewer") && !is_shown("#failing-only") && !is_shown("button.copy"));
    assert!(
        opened.number("[...document.querySelectorAll('tbody.gate')].filter((g) => !g.checkVisibility()).length") == 0.0
    );
    assert_fits(&opened, "no scripts");
    opened.shoot("fixture-noscript");
    opened.assert_quiet();
}

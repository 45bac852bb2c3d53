//! A page of large pictures stays small, and says what it gave up for it.

use std::time::Instant;

use crate::browser::Opened;
use crate::fixture;

/// What the project promises of a run of 1920 × 1080 pixels, bytes.
const MOST_BYTES: usize = 8_000_000;

/// As a run of two cameras, beauty and irradiance each, without noise.
fn full_hd_page() -> String {
    fixture::large_page(4, 0.0)
}

pub fn a_full_hd_page_is_small_at_full_resolution() {
    let html = full_hd_page();
    assert!(html.len() < MOST_BYTES, "{}", html.len());
    assert!(!html.contains("resolution, so that"), "pictures were shrunk");
}

pub fn a_full_hd_page_loads() {
    let opened = Opened::new(&full_hd_page(), 1280, 900);
    opened.eval("document.getElementById('image-1').scrollIntoView()");
    let start = Instant::now();
    opened.wait_for("document.getElementById('image-1').dataset.state === 'ready'");
    let load = opened.number("performance.getEntriesByType('navigation')[0].loadEventEnd");
    // Told, not judged: other work on the machine decides as well.
    eprintln!("load event after {load:.0} ms, first pair decoded {:.0} ms later", start.elapsed().as_secs_f64() * 1e3);
    opened.assert_quiet();
}

pub fn noise_costs_resolution_and_the_page_says_so() {
    let html = fixture::large_page(3, 0.5);
    assert!(html.len() < MOST_BYTES, "{}", html.len());
    assert!(html.contains("Shown at 1/") && html.contains("Figures and histogram are of all pixels"));
}

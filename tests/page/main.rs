//! The page of a comparison in a real browser: what it draws, how it is driven, and that it asks nothing of any network.
//!
//! Needs Chromium or Chrome: `CHROME` names one, else it is looked for on the path. `LIGHTPROBE_PAGE_SHOTS=DIR` keeps
//! screenshots.

#[path = "../common/needs.rs"]
mod needs;

mod browser;
mod fixture;

mod driving;
mod layout;
mod weight;

use std::process::ExitCode;

use needs::Need;

fn main() -> ExitCode {
    needs::run(vec![
        test!(driving::divide_zoom_and_exposure, Need::Browser),
        test!(driving::both_views_zoom_together, Need::Browser),
        test!(driving::gates_are_sorted_and_filtered, Need::Browser),
        test!(driving::a_keyboard_is_enough, Need::Browser),
        test!(layout::the_page_fits_telephones_screens_and_paper, Need::Browser),
        test!(layout::without_scripts_there_is_all_but_the_controls, Need::Browser),
        test!(weight::a_full_hd_page_is_small_at_full_resolution),
        test!(weight::a_full_hd_page_loads, Need::Browser),
        test!(weight::noise_costs_resolution_and_the_page_says_so),
    ])
}

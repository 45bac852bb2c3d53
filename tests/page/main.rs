//! Pages in a real browser, that of a comparison and that of a bake: what they draw, how they are driven, and that they ask
//! nothing of any network.
//!
//! Needs Chromium or Chrome: `CHROME` names one, else it is looked for on the path. `LIGHTPROBE_PAGE_SHOTS=DIR` keeps
//! screenshots.

#[path = "../common/needs.rs"]
mod needs;

mod browser;
mod fixture;

mod driving;
mod layout;
mod look;
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
        test!(look::a_bake_is_turned_picked_and_switched, Need::Browser),
        test!(look::keys_are_enough_to_look_at_a_bake, Need::Browser),
        test!(look::the_look_at_a_bake_fits_telephones, Need::Browser),
        test!(look::the_shader_looks_up_as_the_tool_does, Need::Browser),
        test!(look::the_shader_knows_the_published_methods, Need::Browser),
        test!(look::its_picture_is_that_of_render, Need::Browser),
        test!(look::old_files_are_shown_as_the_tool_looks_them_up, Need::Browser),
        test!(look::a_hostile_camera_stays_a_name),
        test!(weight::a_full_hd_page_is_small_at_full_resolution),
        test!(weight::a_full_hd_page_loads, Need::Browser),
        test!(weight::noise_costs_resolution_and_the_page_says_so),
    ])
}

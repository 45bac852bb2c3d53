//! Exports in real engines: their pixels against `render` of the exported folder.
//!
//! Needs a browser, and npm's `three` in the folder that `LIGHTPROBE_THREE` names; `scripts/engines.sh` sees to both.
//! `LIGHTPROBE_PAGE_SHOTS=DIR` keeps screenshots.

#[path = "../common/needs.rs"]
mod needs;

mod server;
mod three;

use std::process::ExitCode;

use needs::Need;

fn main() -> ExitCode {
    if three::package().is_none() {
        eprintln!("note: no test of engines: LIGHTPROBE_THREE names no npm package three; run scripts/engines.sh");
        return ExitCode::SUCCESS;
    }
    needs::run(vec![
        test!(three::pixels_of_three_are_those_of_render, Need::Browser),
        test!(three::the_exported_page_shows_the_scene, Need::Browser),
    ])
}

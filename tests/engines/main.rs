//! Exports in real engines: their pixels against `render` of the exported folder.
//!
//! three.js needs a browser, and npm's `three` in the folder that `LIGHTPROBE_THREE` names; Bevy the program of
//! tests/engines/bevy, which `LIGHTPROBE_BEVY` names, and Vulkan. `scripts/engines.sh` sees to all of it.
//! `LIGHTPROBE_PAGE_SHOTS=DIR` keeps pictures.

#[path = "../common/needs.rs"]
mod needs;

mod agree;
mod album;
mod bevy;
mod mutants;
mod server;
mod three;

use std::process::ExitCode;

use needs::Need;

fn main() -> ExitCode {
    let mut tests = Vec::new();
    if three::package().is_some() {
        tests.push(test!(three::pixels_of_three_are_those_of_render, Need::Browser));
        tests.push(test!(three::several_volumes_in_three_are_those_of_render, Need::Browser));
        tests.push(test!(three::the_exported_page_shows_the_scene, Need::Browser));
    } else {
        eprintln!("note: no test of three.js: LIGHTPROBE_THREE names no npm package three; run scripts/engines.sh");
    }
    if bevy::program().is_some() {
        tests.push(test!(bevy::pixels_of_bevy_are_those_of_render));
        tests.push(test!(bevy::several_volumes_in_bevy_are_those_of_render));
    } else {
        eprintln!("note: no test of Bevy: LIGHTPROBE_BEVY names no program; run scripts/engines.sh");
    }
    // Not tests: pictures to look at.
    three::album(&album::entries("three"));
    bevy::album(&album::entries("bevy"));
    if tests.is_empty() { ExitCode::SUCCESS } else { needs::run(tests) }
}

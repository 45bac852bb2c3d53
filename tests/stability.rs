//! Where the numbers could break: stiff and extreme scenes, each with a figure that has a known answer or a bound.
//!
//! Every row of the table is a test. With `STABILITY_JSON=FILE` the figures are written there; `scripts/stability.sh` sets
//! it and prints them.

#[path = "common/mod.rs"]
mod common;
#[allow(dead_code)] // Each user of these needs another part.
#[path = "pipeline/probe_file.rs"]
mod probe_file;
#[allow(dead_code)]
#[path = "pipeline/program.rs"]
mod program;
#[allow(dead_code)]
#[path = "pipeline/shapes.rs"]
mod shapes;
#[path = "stability/mod.rs"]
mod suite;

use std::process::ExitCode;

use libtest_mimic::Arguments;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let table = suite::case::Table::default();
    let trials = suite::cases().into_iter().map(|case| table.trial(case)).collect();
    let conclusion = libtest_mimic::run(&arguments, trials);
    if let Some(path) = std::env::var_os("STABILITY_JSON") {
        table.write(path.as_ref());
    }
    conclusion.exit_code()
}

//! Arguments → command → exit code.

use std::process::ExitCode;

use clap::Parser;
use lightprobe::cli::Cli;
use lightprobe::commands;

/// Exit code of every error, as against 1 for "beyond thresholds".
const EXIT_ERROR: u8 = 2;

fn main() -> ExitCode {
    match commands::run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(EXIT_ERROR)
        }
    }
}

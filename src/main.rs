//! Arguments → command → exit code.

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use lightprobe::cli::Cli;
use lightprobe::commands::{self, Outcome};

/// Exit code of a comparison that was made and is beyond its thresholds.
const EXIT_BEYOND_THRESHOLDS: u8 = 1;

/// Exit code of every error.
const EXIT_ERROR: u8 = 2;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(message) => return print(&message),
    };
    match commands::run(cli) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::BeyondThresholds) => ExitCode::from(EXIT_BEYOND_THRESHOLDS),
        Err(error) => {
            commands::tell(format!("error: {error:#}"));
            ExitCode::from(EXIT_ERROR)
        }
    }
}

/// Prints help, the version, or what is wrong with the arguments.
fn print(message: &clap::Error) -> ExitCode {
    let printed = message.print().and_then(|()| std::io::stdout().flush());
    match printed {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            commands::tell(format!("error: cannot write to standard output: {error}"));
            ExitCode::from(EXIT_ERROR)
        }
        _ if message.use_stderr() => ExitCode::from(EXIT_ERROR),
        _ => ExitCode::SUCCESS,
    }
}

//! One file a subcommand. Here errors become one line and an exit code.

pub mod bake;
mod camera;
pub mod convert;
pub mod diff_report;
pub mod export;
mod grid_advice;
pub mod help;
pub mod inspect;
mod kinds;
pub mod reference;
pub mod render;
mod session;
pub mod sweep;
mod target;
mod tell;
pub mod view;

use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result};

use crate::cli::{Cli, Command, OutputFlags, PictureSize};
use crate::system::interrupt;
use crate::system::memory::{TooLittleMemory, check_available};
use crate::system::output::write_atomically;
use crate::system::progress::Progress;
use crate::system::terminal;

/// How a command speaks to its user: results on standard output, all else on standard error.
#[derive(Debug, Clone, Copy)]
pub struct Console {
    quiet: bool,
    verbose: bool,
    pub json: bool,
    pub progress: Progress,
}

impl Console {
    fn new(flags: &OutputFlags) -> Console {
        let progress = Progress::new(!flags.no_progress && !flags.quiet);
        Console { quiet: flags.quiet, verbose: flags.verbose, json: flags.json, progress }
    }

    pub fn warn(&self, message: impl AsRef<str>) {
        if !self.quiet {
            tell(format!("warning: {}", message.as_ref()));
        }
    }

    pub fn say(&self, message: impl AsRef<str>) {
        if self.verbose {
            tell(message);
        }
    }

    /// What was done, for people: on standard error, as results go to standard output.
    pub fn note(&self, message: impl AsRef<str>) {
        if !self.quiet {
            tell(message);
        }
    }

    /// Prints a result. A reader that has gone away (`| head`) is no error, and changes nothing of what is done.
    pub fn print(&self, text: &str) -> Result<()> {
        let text = text.trim_end();
        let text = if self.json { text.to_owned() } else { terminal::fitted(text) };
        match writeln!(std::io::stdout().lock(), "{text}") {
            Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            done => done.context("cannot write to standard output"),
        }
    }
}

/// A line on standard error, whether or not anyone reads it.
pub fn tell(message: impl AsRef<str>) {
    // Nobody is left to be told of it.
    let _ = writeln!(std::io::stderr().lock(), "{}", message.as_ref());
}

/// How a command ended that did its work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    Done,
    /// Of `diff-report`: some gate failed.
    BeyondThresholds,
}

/// Runs the command that was typed.
pub fn run(cli: Cli) -> Result<Outcome> {
    interrupt::listen();
    let console = Console::new(&cli.output);
    match cli.command {
        Command::Bake(args) => bake::run(&args, &console)?,
        Command::Render(args) => render::run(&args, &console)?,
        Command::Reference(args) => reference::run(&args, &console)?,
        Command::Sweep(args) => sweep::run(&args, &console)?,
        Command::DiffReport(args) => return diff_report::run(&args, &console),
        Command::Convert(args) => convert::run(&args, &console)?,
        Command::Export(args) => export::run(&args, &console)?,
        Command::View(args) => view::run(&args, &console)?,
        Command::Inspect(args) => inspect::run(&args, &console)?,
        Command::Help(args) => help::run(&args, &console)?,
    }
    Ok(Outcome::Done)
}

/// Refuses pictures of this size where they take more memory than there is.
fn check_picture_memory(size: PictureSize, bytes_per_pixel: f64) -> Result<(), TooLittleMemory> {
    let PictureSize { width, height } = size;
    let needed = (f64::from(width) * f64::from(height) * bytes_per_pixel) as u64;
    check_available(needed, |available| TooLittleMemory {
        key: format!("--size {width}x{height}"),
        what: "the pictures",
        needed,
        available,
        remedy: "choose a smaller size",
    })
}

/// Writes a report as JSON.
fn write_json(path: &Path, report: &impl serde::Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(report).context("cannot write the report as JSON")?;
    write_atomically(path, |file| writeln!(file, "{text}"))?;
    Ok(())
}

//! One file a subcommand. Here errors become one line and an exit code.

pub mod bake;
mod camera;
pub mod diff_report;
pub mod inspect;
pub mod reference;
pub mod render;
pub mod sweep;
mod tell;

use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result};

use crate::cli::{Cli, Command, ConfigArgs, OutputFlags, PictureSize, TraceArgs};
use crate::config::{Config, presets};
use crate::scene::{self, EnvironmentSource, LoadOptions, Scene};
use crate::system::memory::{TooLittleMemory, check_available, peak_memory_bytes};
use crate::system::output::{Named, check_apart, write_atomically};
use crate::system::progress::Progress;

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
        match writeln!(std::io::stdout().lock(), "{}", text.trim_end()) {
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
    let console = Console::new(&cli.output);
    match cli.command {
        Command::Bake(args) => bake::run(&args, &console)?,
        Command::Render(args) => render::run(&args, &console)?,
        Command::Reference(args) => reference::run(&args, &console)?,
        Command::Sweep(args) => sweep::run(&args, &console)?,
        Command::DiffReport(args) => return diff_report::run(&args, &console),
        Command::Inspect(args) => inspect::run(&args, &console)?,
    }
    Ok(Outcome::Done)
}

/// Binds the work to so many threads; 0 means one per core.
fn set_threads(threads: usize) -> Result<usize> {
    /// More than any machine has; guards against typing errors that would exhaust memory.
    const MOST: usize = 1024;
    anyhow::ensure!(threads <= MOST, "--threads {threads}: at most {MOST} make sense; use 0 for one per core");
    // Fails only when a pool stands already, as when commands run twice in one process.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    Ok(rayon::current_num_threads())
}

/// What a command reads, for the checks of its outputs.
fn inputs(scene: &Path, trace: &TraceArgs, others: impl IntoIterator<Item = Named>) -> Vec<Named> {
    let mut inputs = vec![Named::new("the scene", scene)];
    if let Some(EnvironmentSource::File(map)) = &trace.env {
        inputs.push(Named::new("the environment map", map));
    }
    inputs.extend(others);
    inputs
}

/// Refuses outputs that are files of a loaded scene: its buffers and images.
fn check_apart_from(scene: &Scene, outputs: &[Named]) -> Result<()> {
    let files: Vec<Named> = scene.files.iter().map(|file| Named::new("a file of the scene", file)).collect();
    Ok(check_apart(outputs, &files)?)
}

/// Defaults, then preset or file, then `--set`, then a constant `--env`, which a probe file so carries to `render`.
fn resolve_config(args: &ConfigArgs, trace: &TraceArgs) -> Result<Config> {
    let mut config = match (&args.config, &args.preset) {
        (Some(path), _) => Config::load(path)?,
        (None, Some(name)) => presets::find(name)?,
        (None, None) => Config::default(),
    };
    config = config.with_overrides(&args.set)?;
    set_sky(&mut config, trace);
    Ok(config)
}

/// A constant `--env` in place of the configured sky.
fn set_sky(config: &mut Config, trace: &TraceArgs) {
    match &trace.env {
        Some(EnvironmentSource::Constant(sky)) => config.lights.sky = Some((*sky).into()),
        // A map replaces the configured sky; its path has no place in the file.
        Some(EnvironmentSource::File(_)) => config.lights.sky = None,
        None => {}
    }
}

/// Loads a scene with the sky from the command line, else from the configuration, and passes its warnings on.
fn load_scene(path: &Path, trace: &TraceArgs, config: &Config, console: &Console) -> Result<Scene> {
    let from_config = config.lights.sky.map(|sky| EnvironmentSource::Constant(sky.into()));
    let environment = trace.env.clone().or(from_config);
    let collapse_constant_images = config.plan == crate::config::PlanMode::LeaveOut;
    let scene = scene::load(path, &LoadOptions { environment, collapse_constant_images, ..Default::default() })?;
    for warning in &scene.warnings {
        console.warn(format!("{}: {warning}", path.display()));
    }
    Ok(scene)
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

//! `lightprobe bake --target-error`: the grid that an error asks for.

use anyhow::{Context, Result, bail, ensure};

use super::session::Session;
use super::{Console, tell};
use crate::bake::{Circumstances, saving};
use crate::cli::BakeArgs;
use crate::config::Config;
use crate::light::World;
use crate::report::table::{Column, Table};
use crate::report::target::{SeenReport, StepReport, StoppedBecause, TargetReport};
use crate::sweep::target::search::{Found, Search};
use crate::system::{format, journal};

/// Refuses what does not go together with a search.
pub fn check(args: &BakeArgs, config: &Config) -> Result<()> {
    if args.target_error.is_none() {
        return Ok(());
    }
    for (is_given, flag, why) in [
        (args.dry_run, "--dry-run", "which grids it bakes is known only once the first is measured"),
        (args.resume, "--resume", "it bakes several grids, and none of them is saved before it is done"),
        (args.measure_raw, "--measure-raw", "it bakes several grids; measure the one that it has chosen"),
    ] {
        if is_given {
            bail!("--target-error does not go with {flag}: {why}; leave one of them out");
        }
    }
    ensure!(
        config.grid.divisions.is_none(),
        "--target-error chooses grid.spacing_m, and grid.divisions fixes the grid; set grid.divisions=None, and \
         grid.spacing_m to begin elsewhere than at the default"
    );
    Ok(())
}

/// Searches and writes the file. Its bytes.
pub fn run(
    args: &BakeArgs,
    error: f64,
    config: &Config,
    (session, world): (&Session, &World),
    accel_build_s: f64,
) -> Result<(Found, u64)> {
    let output = args.output.as_ref().context("no output: give -o OUT.probes")?;
    let console = session.console;
    let circumstances = Circumstances {
        seed: session.seed,
        memory_budget_bytes: args.memory_budget,
        progress: console.progress,
        checkpoint: None,
    };
    let search = Search {
        world,
        config,
        circumstances: &circumstances,
        scene: &session.scene_record(),
        output,
        error,
        most_probes: args.max_probes,
    };
    let mut found = search.run(|prepared| tell::prepared(console, prepared), |step| say_step(step, console))?;
    tell::baked(console, &found.baked);
    let before_write_s = session.elapsed_s();
    let file_bytes = found.baked.container.write(output)?;
    journal::remove(&saving::path_for(output));
    let times = &mut found.baked.times;
    times.write = session.elapsed_s() - before_write_s;
    (times.load, times.accel_build) = (session.load_s, accel_build_s);
    // Of all bakes: what the command took.
    times.total = session.elapsed_s();
    Ok((found, file_bytes))
}

fn say_step(step: &StepReport, console: &Console) {
    console.say(format!(
        "bake: {} m, {} probes, error {}, {}, {}",
        spacing(step.spacing_m),
        step.probes,
        error_in_words(step.error, step.standard_error),
        format::bytes(step.bytes),
        format::seconds(step.time_s)
    ));
}

/// Warns where the error was not reached.
pub fn warn(report: &TargetReport, console: &Console) {
    if !report.met {
        let asked = format::percent(report.error);
        let reached = match report.reached {
            Some(_) => format!("the best is {}", error_in_words(report.reached, report.standard_error)),
            None => "none can be told".to_owned(),
        };
        console.warn(format!("--target-error: an error of {asked} is not reached, {reached}: {}", report.message));
    }
}

/// The steps, what was reached, and what the next would cost.
pub fn summary(report: &TargetReport) -> String {
    let mut table = Table::new(&[
        ("spacing", Column::Number),
        ("samples", Column::Number),
        ("probes", Column::Number),
        ("error", Column::Number),
        ("bytes", Column::Number),
        ("time", Column::Number),
    ]);
    for step in &report.steps {
        table.push([
            format!("{} m", spacing(step.spacing_m)),
            format!("{} ×", step.samples_factor),
            step.probes.to_string(),
            error_in_words(step.error, step.standard_error),
            format::bytes(step.bytes),
            format::seconds(step.time_s),
        ]);
    }
    let asked = format::percent(report.error);
    let reached = error_in_words(report.reached, report.standard_error);
    let outcome = match (report.met, report.stopped_because) {
        (true, StoppedBecause::Reached) => format!("error {asked} asked for: {reached} reached"),
        (true, _) => format!(
            "error {asked} asked for: {reached} reached, a smaller file not looked for further: {}",
            report.message
        ),
        (false, _) => format!("error {asked} asked for: not reached, the best is {reached}: {}", report.message),
    };
    let next = report.next.map_or_else(String::new, |next| {
        format!(
            "\nthe next step, {} m with {} × the samples, would come to about {}, {} and {}",
            spacing(next.spacing_m),
            next.samples_factor,
            format::percent(next.predicted_error),
            format::bytes(next.predicted_bytes),
            format::seconds(next.predicted_time_s)
        )
    });
    let (points, paths) = (report.points, report.paths);
    let of_camera = |seen: &SeenReport| format!("{} {}", seen.camera, error_in_words(seen.error, seen.standard_error));
    let seen: Vec<String> = report.seen.iter().map(of_camera).collect();
    let seen = if seen.is_empty() { String::new() } else { format!("\nover what cameras see: {}", seen.join(", ")) };
    format!(
        "{table}\n{outcome}{seen}\njudged at {points} points of surfaces by {paths} paths each; all in {}{next}",
        format::seconds(report.time_s)
    )
}

fn spacing(metres: f64) -> String {
    format::significant(metres, 3)
}

fn error_in_words(error: Option<f64>, standard_error: Option<f64>) -> String {
    let percent = |share: f64| 100.0 * share;
    format::or_undefined(error, |error| {
        format!("{} %", format::with_error(percent(error), standard_error.map(percent)))
    })
}

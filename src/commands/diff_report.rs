//! `lightprobe diff-report`: two results → gates, verdict, files.

use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result, bail};

use super::{Console, Outcome, write_json};
use crate::cli::DiffArgs;
use crate::report::diff::mask::Mask;
use crate::report::diff::shown;
use crate::report::diff::thresholds::Thresholds;
use crate::report::diff::{Compared, DiffReport, Request, SCHEMA, compare, junit, markdown};
use crate::report::gate::Gate;
use crate::report::header::command_line;
use crate::report::table::{Column, Table};
use crate::report::words::{in_unit, margin, of_side, outcome, value};
use crate::system::output::{self, Named, check_folder, check_outputs, create_folder, write_atomically};
use crate::system::terminal;

/// Files that the folder gets besides the difference maps.
const JSON: &str = "diff.json";
const MARKDOWN: &str = "diff.md";
const JUNIT: &str = "junit.xml";
const PAGE: &str = "index.html";

/// How the names of difference maps begin.
const MAP: &str = "difference";

/// Columns from which on a terminal shows all there is of a gate.
const WIDE: usize = 120;

/// Gates that pass and are printed all the same, the closest to their thresholds first.
const CLOSEST: usize = 10;

pub fn run(args: &DiffArgs, console: &Console) -> Result<Outcome> {
    let thresholds = Thresholds::load(args.thresholds.as_deref())?;
    if args.update_baseline {
        output::recover(&args.base)?;
    }
    check_paths(args)?;
    let mask = args.mask.as_deref().map(Mask::read).transpose()?;
    let request = Request {
        base: &args.base,
        candidate: &args.candidate,
        thresholds: &thresholds,
        allow_scene_change: args.allow_scene_change,
        mask: mask.as_ref(),
        // After an update it would be another comparison.
        command_line: command_line(|word| word != "--update-baseline"),
    };
    let mut compared =
        compare(&request, |item| console.say(format!("comparing {}", if item.is_empty() { "the two" } else { item })))?;
    write(args, &mut compared)?;
    if args.update_baseline {
        output::replace(&args.base, &args.candidate)?;
        console.note(format!("{} is now what {} was", args.base.display(), args.candidate.display()));
        print(args, console, &compared.report)?;
        return Ok(Outcome::Done);
    }
    print(args, console, &compared.report)?;
    Ok(if compared.report.verdict.passed { Outcome::Done } else { Outcome::BeyondThresholds })
}

/// Refuses outputs that would be, or lie in, what is compared.
fn check_paths(args: &DiffArgs) -> Result<()> {
    check_folder(&args.output)?;
    let real = |path: &Path| std::fs::canonicalize(path).ok();
    let (base, candidate) = (real(&args.base), real(&args.candidate));
    if args.update_baseline && base.is_some() && base == candidate {
        bail!("--update-baseline: {} and {} are one; give two", args.base.display(), args.candidate.display());
    }
    // The folder need not be there yet: the nearest that is decides.
    let output = args.output.ancestors().find_map(|p| real(if p == Path::new("") { Path::new(".") } else { p }));
    for (name, side, path) in [("BASE", &base, &args.base), ("CANDIDATE", &candidate, &args.candidate)] {
        if let (Some(output), Some(side)) = (&output, side)
            && output.starts_with(side)
        {
            bail!("-o {}: it lies in {name}, {}; choose a folder beside it", args.output.display(), path.display());
        }
    }
    if args.output.is_dir() {
        let outputs: Vec<Named> =
            [JSON, MARKDOWN, JUNIT, PAGE].map(|name| Named::new("-o", args.output.join(name))).into();
        let mut inputs = vec![Named::new("BASE", &args.base), Named::new("CANDIDATE", &args.candidate)];
        inputs.extend(args.thresholds.as_ref().map(|path| Named::new("the thresholds", path)));
        inputs.extend(args.mask.as_ref().map(|path| Named::new("the mask", path)));
        check_outputs(&outputs, &inputs)?;
    }
    Ok(())
}

fn write(args: &DiffArgs, compared: &mut Compared) -> Result<()> {
    let (images, plots) = (std::mem::take(&mut compared.images), std::mem::take(&mut compared.plots));
    let report = &compared.report;
    // All texts are made before the first file is written.
    let markdown = markdown::text(report)?;
    let junit = junit::text(report).context("cannot write the gates as JUnit XML")?;
    let page = shown::page(report, images, plots)?;
    create_folder(&args.output)?;
    remove_earlier(&args.output)?;
    for (name, picture) in &compared.pictures {
        picture.write_png(&args.output.join(name))?;
    }
    // The largest first: a verdict is not left alone where the disk gets full.
    write_atomically(&args.output.join(PAGE), |file| file.write_all(page.as_bytes()))?;
    write_atomically(&args.output.join(MARKDOWN), |file| file.write_all(markdown.as_bytes()))?;
    write_atomically(&args.output.join(JUNIT), |file| file.write_all(junit.as_bytes()))?;
    // Last: whoever waits for it finds the others there.
    write_json(&args.output.join(JSON), report)
}

/// Removes what an earlier comparison left in the folder: its verdict and its maps are of other sides. Folders that no
/// comparison wrote are left alone.
fn remove_earlier(folder: &Path) -> Result<()> {
    let report = folder.join(JSON);
    let is_ours = std::fs::read_to_string(&report).is_ok_and(|text| {
        let report: Result<serde_json::Value, _> = serde_json::from_str(&text);
        report.is_ok_and(|report| report["schema"] == SCHEMA)
    });
    if !is_ours {
        return Ok(());
    }
    let names = std::fs::read_dir(folder).with_context(|| format!("cannot read the folder {}", folder.display()))?;
    let maps = names.filter_map(Result::ok).map(|entry| entry.path()).filter(|path| is_map(path));
    // The report goes first: without it the folder is no result.
    for path in [report, folder.join(PAGE), folder.join(MARKDOWN), folder.join(JUNIT)].into_iter().chain(maps) {
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(error).with_context(|| format!("cannot remove {} of an earlier run", path.display()));
            }
            _ => {}
        }
    }
    Ok(())
}

fn is_map(path: &Path) -> bool {
    let rest = path.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_prefix(MAP));
    rest.is_some_and(|rest| rest == ".png" || rest.starts_with('_') && rest.ends_with(".png"))
}

fn print(args: &DiffArgs, console: &Console, report: &DiffReport) -> Result<()> {
    if console.json {
        return console.print(&serde_json::to_string_pretty(report)?);
    }
    let failing = report.gates.iter().filter(|g| g.fails() || g.waived);
    let passing = report.gates.iter().filter(|g| !g.fails() && !g.waived && g.is_judged());
    let times = report.gates.iter().filter(|g| !g.is_judged());
    let listed: Vec<&Gate> = failing.chain(passing.clone().take(CLOSEST)).chain(times).collect();
    let table = if terminal::width().is_some_and(|width| width < WIDE) { narrow(&listed) } else { wide(&listed) };
    console.print(&table.to_string())?;
    let more = passing.count().saturating_sub(CLOSEST);
    if more > 0 {
        console.print(&format!("and {more} more gates that pass"))?;
    }
    console.print(&report.verdict.sentence)?;
    console.print(&format!("wrote {}", args.output.display()))
}

/// All columns side by side.
fn wide(gates: &[&Gate]) -> Table {
    let mut table = Table::new(&[
        ("", Column::Text),
        ("gate", Column::Text),
        ("of", Column::Text),
        ("base", Column::Number),
        ("candidate", Column::Number),
        ("difference", Column::Number),
        ("threshold", Column::Number),
        ("margin", Column::Number),
        ("from", Column::Text),
    ]);
    for gate in gates {
        table.push([
            outcome(gate).to_owned(),
            gate.name.clone(),
            gate.item.clone(),
            of_side(gate.base, gate.side_unit),
            of_side(gate.candidate, gate.side_unit),
            value(gate),
            in_unit(gate.threshold, gate.unit),
            margin(gate),
            gate.source.clone(),
        ]);
    }
    table
}

/// For terminals that are too narrow for that: the sides' own figures are in the files.
fn narrow(gates: &[&Gate]) -> Table {
    let mut table = Table::new(&[
        ("gate", Column::Text),
        ("difference", Column::Number),
        ("threshold", Column::Number),
        ("margin", Column::Number),
    ]);
    for gate in gates {
        table.push([
            format!("{} {} {}", outcome(gate), gate.name, gate.item),
            value(gate),
            in_unit(gate.threshold, gate.unit),
            margin(gate),
        ]);
    }
    table
}

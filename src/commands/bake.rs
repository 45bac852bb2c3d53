//! `lightprobe bake`: scene → probe file and report.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, anyhow};

use super::session::{Opening, Session, list_presets, lists_presets, resolve_config};
use super::{Console, grid_advice, kinds, target, tell, write_json};
use crate::bake::{Baked, Checkpoint, Circumstances, Foretold, foretell, prepare, saving};
use crate::cli::BakeArgs;
use crate::config::Config;
use crate::plan::{Line, stage_in_words};
use crate::probe::fit::FitFigures;
use crate::report::bake::{BakeReport, BytesPerProbe, SCHEMA, SolverReport};
use crate::report::table::{Column, Table};
use crate::scene::Detail;
use crate::system::memory::peak_memory_bytes;
use crate::system::output::Named;
use crate::system::{format, interrupt, journal};

pub fn run(args: &BakeArgs, console: &Console) -> Result<()> {
    if lists_presets(&args.config.preset) {
        return list_presets(console);
    }
    let config = resolve_config(&args.config, &args.trace)?;
    if args.print_config {
        return console.print(&config.to_ron());
    }
    if let Some(scene) = &args.scene {
        kinds::expect_scene(scene, "bake SCENE -o OUT.probes")?;
    }
    target::check(args, &config)?;
    tell::configuration(console, &args.config);
    let session = Session::open(opening(args, &config)?, console)?;
    let (world, accel_build_s) = session.world()?;
    grid_advice::warn(&config.grid, &session.scene, console);
    if let Some(error) = args.target_error {
        let (found, file_bytes) = target::run(args, error, &config, (&session, &world), accel_build_s)?;
        let config = found.config;
        let target = Some(found.report);
        let report = BakeReport { target, ..report(&found.baked, &config, &session, file_bytes, None) };
        return finish(args, &report, &config, &session);
    }
    let circumstances = circumstances(args, &config, &session)?;
    if args.dry_run {
        return dry_run(&foretell(&world, &config, &circumstances)?, &config, console);
    }
    let prepared = prepare(&world, &config, &circumstances)?;
    tell::prepared(console, &prepared);
    let raw_started = Instant::now();
    let raw = args.measure_raw.then(|| prepared.raw_rays_per_s(&circumstances)).flatten();
    let raw_s = raw_started.elapsed().as_secs_f64();
    let mut baked = prepared.bake(&circumstances, &session.scene_record())?;
    tell::baked(console, &baked);
    if let Some(why) = &baked.unsaved {
        console.warn(format!("the work was not saved on the way: {why}"));
    }

    let Some(output) = &args.output else { return Ok(()) };
    let write_started = Instant::now();
    let file_bytes = write(&baked, output)?;
    baked.times.write = write_started.elapsed().as_secs_f64();
    (baked.times.load, baked.times.accel_build) = (session.load_s, accel_build_s);
    // The measurement is no part of the bake.
    baked.times.total = session.elapsed_s() - raw_s;

    finish(args, &report(&baked, &config, &session, file_bytes, raw), &config, &session)
}

/// Writes the file, and removes what was saved on the way. Where it cannot be written, that is kept.
fn write(baked: &Baked, output: &Path) -> Result<u64> {
    let saved = saving::path_for(output);
    match baked.container.write(output) {
        Err(error) if journal::holds_records(&saved) => {
            let kept = if baked.unsaved.is_some() { "a part of the work" } else { "the work" };
            Err(anyhow!("{error}; {} keeps {kept}, --resume goes on from it", saved.display()))
        }
        // A journal without any work is removed too.
        written => {
            journal::remove(&saved);
            Ok(written?)
        }
    }
}

/// Says what was done.
fn finish(args: &BakeArgs, report: &BakeReport, config: &Config, session: &Session) -> Result<()> {
    let (Some(output), console) = (&args.output, session.console) else { return Ok(()) };
    warn_about(report, config, console);
    tell::written(console, output);
    if let Some(path) = &args.report {
        write_json(path, report)?;
        tell::written(console, path);
    }
    session.print(report, || summary(report, config, output))
}

fn opening<'a>(args: &'a BakeArgs, config: &Config) -> Result<Opening<'a>> {
    let config_file = args.config.config.as_ref().map(|file| Named::new("the configuration", file));
    Ok(Opening {
        scene: args.scene.as_deref().context("no scene: give a .glb or .gltf file")?,
        trace: &args.trace,
        light: config.light(),
        probes: None,
        detail: Detail::LIGHT,
        keep_images: config.plan.keeps_everything(),
        inputs: config_file.into_iter().collect(),
        outputs: outputs(args)?,
    })
}

/// Memory, progress and checkpoints of the bake. What cannot be resumed from is refused before anything is traced.
fn circumstances(args: &BakeArgs, config: &Config, session: &Session) -> Result<Circumstances> {
    let checkpoint = args.output.as_ref().filter(|_| !args.dry_run).map(|output| Checkpoint {
        path: saving::path_for(output),
        resume: args.resume,
        interval: args.checkpoint_every,
    });
    if let Some(Checkpoint { path, resume: true, .. }) = &checkpoint {
        if path.exists() {
            let identity = saving::identity(&session.scene.blake3, session.seed, &config.to_ron());
            let saved = saving::check(path, &identity)?;
            session.console.note(format!("going on from {}: {}", path.display(), saved.in_words()));
        } else {
            session.console.warn(format!("--resume: there is no {}; starting anew", path.display()));
        }
    }
    if let Some(Checkpoint { path, resume, .. }) = &checkpoint {
        interrupt::leaves(path.clone(), "the same command with --resume goes on from there", *resume);
    }
    Ok(Circumstances {
        seed: session.seed,
        memory_budget_bytes: args.memory_budget,
        progress: session.console.progress,
        checkpoint,
    })
}

/// What will be written; nothing in a dry run.
fn outputs(args: &BakeArgs) -> Result<Vec<Named>> {
    if args.dry_run {
        return Ok(Vec::new());
    }
    let output = args.output.as_ref().context("no output: give -o OUT.probes")?;
    let report = args.report.as_ref().map(|report| Named::new("--report", report));
    let checkpoint = Named::new("the file that --resume reads", saving::path_for(output));
    Ok([Named::new("-o", output), checkpoint].into_iter().chain(report).collect())
}

fn dry_run(p: &Foretold, config: &Config, console: &Console) -> Result<()> {
    if console.json {
        let report = serde_json::json!({
            "schema": "lightprobe-plan/1",
            "probes": p.grid.probe_count(),
            "probes_active": p.probes_active,
            "cells": p.grid.cell_count(),
            "cells_looked_at": p.cells,
            "predicted_time_s": p.time_s(),
            "predicted_survey_s": p.survey_s,
            "predicted_capture_s": p.capture_s,
            "predicted_bounce_s": p.bounce_s,
            "predicted_bounces": p.bounces,
            "predicted_fit_s": p.fit_s,
            "predicted_memory_bytes": p.memory_bytes(),
            "predicted_capture_bytes": p.capture_bytes,
            "predicted_map_bytes": p.map_bytes,
            "predicted_scene_bytes": p.resident_bytes,
            "predicted_survey_bytes": p.survey_bytes,
            "plan": p.plan.lines,
        });
        return console.print(&serde_json::to_string_pretty(&report)?);
    }
    console.print(&plan_table(&p.plan.lines))?;
    let capture = format::seconds(p.capture_s);
    let iterations = match config.transport.captures_once() {
        true => {
            let bounces = format::counted(u64::from(p.bounces), "bounce", "bounces");
            format!("capture {capture}, {bounces} of {} each", format::seconds(p.bounce_s))
        }
        false => format!("capture {capture} in {}", format::counted(u64::from(p.bounces), "frame", "frames")),
    };
    let fit = if config.fit.is_none() { String::new() } else { format!(", fit {}", format::seconds(p.fit_s)) };
    console.print(&format!(
        "{} probes, about {} of them to bake\n\
         about {}: survey {}, {}{}\n\
         about {} of memory: captures {}, maps, filters and rows {}, scene {}; up to the survey {}",
        p.grid.probe_count(),
        p.probes_active,
        format::seconds(p.time_s()),
        format::seconds(p.survey_s),
        iterations,
        fit,
        format::bytes(p.memory_bytes()),
        format::bytes(p.capture_bytes),
        format::bytes(p.map_bytes),
        format::bytes(p.resident_bytes),
        format::bytes(p.survey_bytes),
    ))
}

fn plan_table(lines: &[Line]) -> String {
    let mut table =
        Table::new(&[("stage", Column::Text), ("", Column::Text), ("why", Column::Text), ("saved", Column::Number)]);
    for line in lines {
        let saved = [line.saved_bytes.map(format::bytes), line.saved_s.map(format::seconds)];
        let saved: Vec<String> = saved.into_iter().flatten().collect();
        let kept = if line.kept { "kept" } else { "left out" };
        table.push([line.stage.to_owned(), kept.to_owned(), line.reason.clone(), saved.join(", ")]);
    }
    table.to_string()
}

fn report(baked: &Baked, config: &Config, session: &Session, file_bytes: u64, raw: Option<f64>) -> BakeReport {
    let probes = baked.volume.states.len();
    let traced = (baked.rays.primary + baked.rays.shadow) as f64;
    let (runtime, runtime_kept) = baked.runtime_bytes;
    let tensors = baked.container.tensors.iter();
    BakeReport {
        header: session.header(SCHEMA, "bake", config.to_ron()),
        probes,
        probes_active: baked.volume.active_count(),
        rays: baked.rays,
        time_s: baked.times,
        rays_per_s: (baked.times.capture > 0.0).then(|| traced / baked.times.capture),
        raw_embree_rays_per_s: raw,
        peak_memory_bytes: peak_memory_bytes(),
        bytes_per_probe: BytesPerProbe {
            runtime,
            runtime_kept,
            published: config.store.layout.published,
            file: file_bytes as f64 / probes as f64,
            tensors: tensors.map(|(n, t)| (n.clone(), t.bytes.len() as f64 / probes as f64)).collect(),
        },
        bounces: baked.solution.bounces.clone(),
        converged: baked.solution.converged,
        spectral_radius_estimate: baked.solution.spectral_radius_estimate,
        solver: SolverReport::of(&baked.solution),
        fit: baked.fit.as_ref().map(FitFigures::report),
        target: None,
        numerics: baked.numerics.clone(),
        plan: baked.plan.lines.clone(),
    }
}

fn warn_about(report: &BakeReport, config: &Config, console: &Console) {
    let numerics = &report.numerics;
    report.target.iter().for_each(|report| target::warn(report, console));
    if report.probes_active == 0 {
        console
            .warn("no probe is active: all lie inside geometry or where no surface can sample them; change the grid");
    }
    if numerics.hits_outside_volume > 0 {
        let hits = format::counted(numerics.hits_outside_volume, "captured hit lies", "captured hits lie");
        let remedy = match config.grid.bounds {
            Some(_) => "enlarge grid.bounds",
            None => "give every axis two probes or more",
        };
        console.warn(format!("{hits} outside the probes' hull, where the nearest cell is used; {remedy}"));
    }
    if numerics.non_finite > 0 {
        let values =
            format::counted(numerics.non_finite, "value was not finite and counts", "values were not finite and count");
        console.warn(format!("{values} as zero"));
    }
    tell::too_bright(console, numerics.light_clamped, ["light or lit hit", "lights or lit hits"]);
    if numerics.albedo_clamped > 0 {
        console.say(format!(
            "{} material(s) reach an albedo above materials.albedo_max and are clamped to it",
            numerics.albedo_clamped
        ));
    }
    for (tensor, &count) in numerics.underflowed.iter().filter(|c| *c.1 > 0) {
        console.say(format!("{count} value(s) of tensor '{tensor}' are too small for its format and stored as 0"));
    }
    if !report.converged && !config.transport.is_limited() {
        let key = config.transport.limit_key();
        console.warn(format!("the bounces did not converge; raise {key} or the tolerance beside it"));
    }
    for (tensor, &count) in numerics.clamped.iter().filter(|c| *c.1 > 0) {
        console.warn(format!("{count} value(s) of tensor '{tensor}' are beyond its format's range and clamped"));
    }
}

fn summary(report: &BakeReport, config: &Config, output: &Path) -> String {
    let t = &report.time_s;
    let mut table = Table::new(&[("bake", Column::Text), ("", Column::Number)]);
    let rate =
        |r: Option<f64>| r.map_or(format::UNDEFINED.to_owned(), |r| format!("{} M/s", format::significant(r / 1e6, 3)));
    for (name, value) in [
        ("probes (active)", format!("{} ({})", report.probes, report.probes_active)),
        ("rays", format!("{} M", format::significant((report.rays.primary + report.rays.shadow) as f64 / 1e6, 3))),
        ("ray rate", rate(report.rays_per_s)),
        ("bounces", bounces(report, config)),
        ("load and build", format::seconds(t.load + t.accel_build)),
        ("survey", format::seconds(t.survey)),
        ("capture", format::seconds(t.capture)),
        ("bounce time", format::seconds(t.bounces)),
        ("fit", if report.fit.is_some() { format::seconds(t.fit) } else { format::UNDEFINED.to_owned() }),
        ("total", format::seconds(t.total)),
        ("memory per probe", format::bytes(report.bytes_per_probe.runtime_kept.round() as u64)),
        ("peak memory", format::bytes(report.peak_memory_bytes)),
    ] {
        table.push([name.to_owned(), value]);
    }
    if let Some(raw) = report.raw_embree_rays_per_s {
        let share = report.rays_per_s.map_or(0.0, |r| r / raw);
        table.push([
            "bare Embree".to_owned(),
            format!("{} ({} of it reached)", rate(Some(raw)), format::percent(share)),
        ]);
    }
    let target = report.target.as_ref().map_or_else(String::new, |report| target::summary(report) + "\n");
    format!("{}\n{}\n{target}wrote {}", table, plan_summary(&report.plan), output.display())
}

/// How many there are, and by how many iterations where these are combined.
fn bounces(report: &BakeReport, config: &Config) -> String {
    let iterations = format::counted(report.bounces.len() as u64, "iteration", "iterations");
    if let Some(stopped) = report.solver.stopped {
        return format!("all, by {iterations}: {}", stopped.in_words());
    }
    match report.solver.accelerated {
        _ if config.transport.is_complete() => "all, by paths".to_owned(),
        0 => report.bounces.last().map_or(0, |bounce| bounce.index).to_string(),
        _ => format!("all, by {iterations}"),
    }
}

fn plan_summary(lines: &[Line]) -> String {
    let left_out: Vec<&str> = lines.iter().filter(|l| !l.kept).map(|l| stage_in_words(l.stage, l.kept)).collect();
    if left_out.is_empty() { "left out: nothing".to_owned() } else { format!("left out: {}", left_out.join(", ")) }
}

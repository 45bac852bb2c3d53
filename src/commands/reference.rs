//! `lightprobe reference`: scene → path-traced picture.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};

use super::camera::cameras;
use super::session::{Opening, Session, list_presets, lists_presets, resolve_config};
use super::{Console, check_picture_memory, kinds, tell, write_json};
use crate::cli::{ReferenceArgs, TransportName};
use crate::config::Config;
use crate::light::World;
use crate::light::bsdf::ReflectionModel;
use crate::light::path::Strategy;
use crate::math::blocks::BLOCK;
use crate::report::reference::{NoiseReport, Rays, ReferenceReport, ReferenceTimes, SCHEMA};
use crate::report::table::{Column, Table};
use crate::scene::{Camera, Detail};
use crate::shade::film::NoiseLevel;
use crate::shade::points::has_blend;
use crate::shade::reference::{Reference, ReferenceSettings, State, Tracing};
use crate::shade::reference_file::{Identity, resume};
use crate::system::memory::peak_memory_bytes;
use crate::system::output::Named;
use crate::system::{format, interrupt};

/// How much work a kill may lose.
const SAVE_INTERVAL: Duration = Duration::from_secs(60);

/// Memory that a reference takes at its peak, per pixel: measured at 960 × 540, rounded up; the second where all layers
/// are accumulated, with translucent surfaces or glossy ones.
pub(super) const PIXEL_BYTES: f64 = 850.0;
pub(super) const LAYERED_PIXEL_BYTES: f64 = 2000.0;

pub fn run(args: &ReferenceArgs, console: &Console) -> Result<()> {
    if lists_presets(&args.config.preset) {
        return list_presets(console);
    }
    if args.view.camera.as_deref() == Some("all") {
        bail!("--camera all: a reference is one picture; name one camera");
    }
    kinds::expect_scene(&args.scene, "reference SCENE -o FILE.exr --spp N")?;
    check_extension(&args.output)?;
    let config = resolve_config(&args.config, &args.trace)?;
    tell::configuration(console, &args.config);
    let session = Session::open(opening(args, &config), console)?;
    let (world, accel_build_s) = session.world()?;
    let settings = settings(args);
    let camera =
        cameras(&args.view, &world, console)?.into_iter().next().context("there is no camera; use --look-at")?;
    let size = args.view.size;
    let layered = settings.transport == ReflectionModel::Gltf || has_blend(&world);
    check_picture_memory(size, if layered { LAYERED_PIXEL_BYTES } else { PIXEL_BYTES })?;

    let identity = Identity::new(&world, &camera, size.width, size.height, &settings);
    let before = previous(args, &identity, &world, &settings, console)?;
    let resumed = before
        .as_ref()
        .map_or(Resumed::default(), |state| Resumed { spp: state.film.blocks * BLOCK, rays: state.rays.total() });
    let mut tracing = Tracing::new(&world, &camera, size.width, size.height, &settings, before);
    tell::reference_begins(console, &camera.name, size, settings.rounded_spp(), resumed.spp);
    let is_complete = tracing.remaining() == 0;
    if is_complete {
        let (file, spp) = (args.output.display(), resumed.spp);
        console
            .warn(format!("{file} has {spp} samples per pixel already: there is nothing to add; raise --spp for more"));
    }
    let mut times = ReferenceTimes { load: session.load_s, accel_build: accel_build_s, ..Default::default() };
    times.trace = trace(
        &mut tracing,
        (&args.output, &identity),
        ("the same command with --resume adds to it", resumed.spp > 0),
        console,
    )?;
    let reference = tracing.develop();
    tell::traced(console, reference.spp, reference.rays, times.trace);
    if !is_complete {
        let write_started = Instant::now();
        reference.write(&args.output, &identity)?;
        times.write = write_started.elapsed().as_secs_f64();
        tell::written(console, &args.output);
    }
    times.total = session.elapsed_s();
    tell::not_finite(console, reference.non_finite);
    tell::too_bright(console, tracing.clamped(), ["point of the picture", "points of the picture"]);
    let mut report = report(&session, &config, args, (&camera, &settings, resumed), &reference, times);
    report.light_clamped += tracing.clamped();
    if let Some(path) = &args.report {
        write_json(path, &report)?;
        tell::written(console, path);
    }
    let outcome = if is_complete { "nothing to add to" } else { "wrote" };
    session.print(&report, || format!("{}\n{outcome} {}", summary(&report), args.output.display()))
}

fn opening<'a>(args: &'a ReferenceArgs, config: &Config) -> Opening<'a> {
    let report = args.report.as_ref().map(|report| Named::new("--report", report));
    let config_file = args.config.config.as_ref().map(|file| Named::new("the configuration", file));
    Opening {
        scene: &args.scene,
        trace: &args.trace,
        light: config.light(),
        probes: None,
        detail: match args.transport {
            TransportName::Lambert => Detail::PICTURE,
            TransportName::Gltf => Detail::GLOSSY,
        },
        keep_images: false,
        inputs: config_file.into_iter().collect(),
        outputs: [Named::new("-o", &args.output)].into_iter().chain(report).collect(),
    }
}

fn settings(args: &ReferenceArgs) -> ReferenceSettings {
    ReferenceSettings {
        spp: args.spp,
        seed: args.trace.seed,
        transport: match args.transport {
            TransportName::Lambert => ReflectionModel::Lambert,
            TransportName::Gltf => ReflectionModel::Gltf,
        },
        max_bounces: args.max_bounces,
        strategy: Strategy::Mis,
        firefly_clamp: args.firefly_clamp,
    }
}

/// What was there before this run.
#[derive(Clone, Copy, Default)]
struct Resumed {
    spp: u32,
    rays: u64,
}

fn report(
    session: &Session,
    config: &Config,
    args: &ReferenceArgs,
    (camera, settings, resumed): (&Camera, &ReferenceSettings, Resumed),
    reference: &Reference,
    time_s: ReferenceTimes,
) -> ReferenceReport {
    let rays = reference.rays;
    let traced = (rays.total() - resumed.rays) as f64;
    ReferenceReport {
        header: session.header(SCHEMA, "reference", config.to_ron()),
        camera: camera.name.clone(),
        width: args.view.size.width,
        height: args.view.size.height,
        transport: format!("{:?}", settings.transport).to_lowercase(),
        max_bounces: settings.max_bounces,
        firefly_clamp: settings.firefly_clamp,
        spp: reference.spp,
        spp_resumed: resumed.spp,
        rays: Rays { primary: rays.primary, shadow: rays.shadow },
        time_s,
        rays_per_s: (traced > 0.0 && time_s.trace > 0.0).then(|| traced / time_s.trace),
        irradiance_indirect_mean: reference.irradiance_indirect_mean(),
        noise: reference.noise.map(noise_report),
        non_finite: reference.non_finite,
        light_clamped: session.scene.light_clamped,
        peak_memory_bytes: peak_memory_bytes(),
    }
}

/// An EXR by the name of another format would be found out by whoever opens it.
fn check_extension(output: &Path) -> Result<()> {
    let is_exr = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    ensure!(
        is_exr,
        "-o {}: references are OpenEXR files; give it the extension .exr: {}",
        output.display(),
        output.with_extension("exr").display()
    );
    Ok(())
}

/// What `--resume` continues.
fn previous(
    args: &ReferenceArgs,
    identity: &Identity,
    world: &World,
    settings: &ReferenceSettings,
    console: &Console,
) -> Result<Option<State>> {
    if !args.resume {
        return Ok(None);
    }
    if !args.output.exists() {
        console.warn(format!("--resume: there is no {}; beginning anew", args.output.display()));
        return Ok(None);
    }
    let state = resume(&args.output, identity, world, settings)?;
    if state.is_some() {
        console.note(format!("going on from {}", args.output.display()));
    }
    if state.is_none() {
        console.warn(format!("--resume: {} has less than {BLOCK} samples; beginning anew", args.output.display()));
    }
    Ok(state)
}

/// Adds blocks until there are enough, and saves what there is now and then; the seconds without saving.
pub(super) fn trace(
    tracing: &mut Tracing,
    (path, identity): (&Path, &Identity),
    (how_to_go_on, resumed): (&str, bool),
    console: &Console,
) -> Result<f64> {
    let bar = console.progress.stage("reference", tracing.remaining() as usize);
    interrupt::leaves(path.to_owned(), how_to_go_on, resumed);
    let (started, mut saved, mut saving) = (Instant::now(), Instant::now(), Duration::ZERO);
    while tracing.remaining() > 0 {
        tracing.advance();
        bar.inc(1);
        if let Some(noise) = tracing.noise() {
            bar.set_message(noise.to_message());
        }
        if tracing.remaining() > 0 && saved.elapsed() >= SAVE_INTERVAL {
            let save_started = Instant::now();
            tracing.develop().write(path, identity)?;
            saving += save_started.elapsed();
            saved = Instant::now();
        }
    }
    bar.finish_and_clear();
    Ok((started.elapsed() - saving).as_secs_f64())
}

fn noise_report(noise: NoiseLevel) -> NoiseReport {
    NoiseReport {
        mean: noise.mean,
        mean_standard_error: noise.mean_standard_error,
        relative: (noise.mean > 0.0).then(|| noise.mean_standard_error / noise.mean),
        rms_standard_error: noise.rms_standard_error,
    }
}

fn summary(report: &ReferenceReport) -> Table {
    let mut table = Table::new(&[("reference", Column::Text), ("", Column::Number)]);
    let millions = |n: u64| format!("{} M", format::significant(n as f64 / 1e6, 3));
    let standard_error = match &report.noise {
        Some(noise) => format::or_undefined(noise.relative, format::percent),
        None => format!("not known below {} samples", 2 * BLOCK),
    };
    for (name, value) in [
        ("camera", format!("{}, {}×{}", report.camera, report.width, report.height)),
        ("samples per pixel", report.spp.to_string()),
        (
            "irradiance, whole picture",
            format::or_undefined(report.irradiance_indirect_mean, |e| format!("{} W·m⁻²", format::significant(e, 4))),
        ),
        ("standard error", standard_error),
        ("rays", millions(report.rays.primary + report.rays.shadow)),
        ("ray rate", format::or_undefined(report.rays_per_s, |r| format!("{} M/s", format::significant(r / 1e6, 3)))),
        ("tracing", format::seconds(report.time_s.trace)),
        ("total", format::seconds(report.time_s.total)),
        ("peak memory", format::bytes(report.peak_memory_bytes)),
    ] {
        table.push([name.to_owned(), value]);
    }
    table
}

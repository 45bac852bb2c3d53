//! `lightprobe render`: scene + probes → pictures and report.

mod check;
mod pictures;
mod reference;
mod table;

use std::path::Path;
use std::time::Instant;

use anyhow::{Result, bail};

use self::check::{check_pictures, check_view, pictures};
use self::reference::{Reference, Source};
use super::camera::cameras;
use super::{Console, check_apart_from, inputs, load_scene, peak_memory_bytes, set_threads, tell, write_json};
use crate::cli::RenderArgs;
use crate::config::Config;
use crate::evaluate::{BakedTruth, Comparison, PATH_RAY, Scenery, Shaded, runtime_bytes, volume_as_planned};
use crate::light::World;
use crate::probe::Volume;
use crate::probe::file::{self, ProbeFile};
use crate::probe::query::Query;
use crate::report::header::Header;
use crate::report::render::{RenderReport, RenderTimes, SCHEMA};
use crate::scene::{Camera, Scene};
use crate::shade::points::see;
use crate::shade::visibility_modes::VisibilityMode;
use crate::system::output::{Named, create_folder};

/// What all cameras of a run share.
struct Run<'a> {
    args: &'a RenderArgs,
    console: &'a Console,
    world: &'a World<'a>,
    config: &'a Config,
    volume: &'a Volume,
    bytes_per_probe: f64,
    bake_seed: Option<u64>,
    scene_changed: bool,
    reference: Option<Source>,
    truth: Option<BakedTruth>,
    threads: usize,
    times: RenderTimes,
    started: Instant,
}

pub fn run(args: &RenderArgs, console: &Console) -> Result<()> {
    let started = Instant::now();
    let inputs = inputs(&args.scene, &args.trace, [Named::new("the probe file", &args.probes)]);
    check_pictures(args, &args.output, &inputs)?;
    let threads = set_threads(args.trace.threads)?;
    let reference = Source::of(args)?;
    let probes = file::read(&args.probes)?;
    let config = Config::parse(&probes.config, &format!("{}: its configuration", args.probes.display()))?;
    let scene = load_scene(&args.scene, &args.trace, &config, console)?;
    let scene_changed = check_scene(args, &probes, &scene, console)?;
    let mut times = RenderTimes { load: started.elapsed().as_secs_f64(), ..Default::default() };
    tell::scene(console, &args.scene, &scene, times.load);

    let accel_started = Instant::now();
    let world = World::new(&scene, config.lights.punctual_scale, config.solver.albedo_max)?;
    times.accel_build = accel_started.elapsed().as_secs_f64();
    tell::accel(console, times.accel_build);
    tell::probes(console, &args.probes, &probes);

    let volume = volume_as_planned(&probes, &scene);
    let bytes_per_probe = runtime_bytes(&probes, &config);
    let cameras = cameras(&args.view, &world, console)?;
    if args.reference_image.is_some() && cameras.len() > 1 {
        bail!("--reference-image is of one camera and --camera all asks for {}; name one", cameras.len());
    }
    let folder = |camera: &Camera| match args.view.camera.as_deref() {
        Some("all") => args.output.join(folder_name(&camera.name)),
        _ => args.output.clone(),
    };
    for camera in &cameras {
        check_pictures(args, &folder(camera), &inputs)?;
        check_apart_from(&scene, &pictures(args, &folder(camera)))?;
        check_view(args, &world, camera, console)?;
    }
    let truth = match &reference {
        Some(Source::Trace { settings }) => {
            let truth = BakedTruth::trace(&world, &config, &volume, settings, console.progress);
            tell::truth(console, truth.report.paths_per_hit, truth.report.time_s);
            Some(truth)
        }
        _ => None,
    };
    let run = Run {
        args,
        console,
        world: &world,
        config: &config,
        volume: &volume,
        bytes_per_probe,
        bake_seed: probes.seed,
        scene_changed,
        reference,
        truth,
        threads,
        times,
        started,
    };
    let mut reports = Vec::new();
    for camera in &cameras {
        reports.push(render_camera(&run, camera, &folder(camera))?);
    }
    if console.json {
        let json = if let [report] = &reports[..] {
            serde_json::to_string_pretty(report)?
        } else {
            serde_json::to_string_pretty(&reports)?
        };
        return console.print(&json);
    }
    for report in &reports {
        console.print(&table::table(report))?;
    }
    console.print(&format!("wrote {}", args.output.display()))
}

/// Whether the scene is another than the probes were baked from; an error unless allowed.
fn check_scene(args: &RenderArgs, probes: &ProbeFile, scene: &Scene, console: &Console) -> Result<bool> {
    if probes.scene.blake3 == scene.blake3 {
        return Ok(false);
    }
    let what = format!(
        "{} was baked from another scene than {} now is (its files or its sky have changed)",
        args.probes.display(),
        args.scene.display()
    );
    if !args.allow_scene_change {
        bail!("{what}; bake it again, give the --env of the bake, or pass --allow-scene-change");
    }
    console.warn(what);
    Ok(true)
}

/// A camera's name as the name of a folder.
fn folder_name(camera: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '#' | ' ') { c } else { '_' };
    camera.chars().map(safe).collect()
}

fn render_camera(run: &Run, camera: &Camera, folder: &Path) -> Result<RenderReport> {
    let (args, volume) = (run.args, run.volume);
    let query = Query { volume, settings: &run.config.query };
    let bar = run.console.progress.stage("rendering", 2 + VisibilityMode::ALL.len());
    let primary_started = Instant::now();
    let view = see(run.world, camera, args.view.size.width, args.view.size.height, args.trace.seed);
    let primary_s = primary_started.elapsed().as_secs_f64();
    bar.inc(1);
    let scenery = Scenery { world: run.world, view: &view, primary_s };
    let (masks, masks_s) = scenery.masks(&query);
    bar.inc(1);
    let mut shaded = scenery.shade(&query, &masks, masks_s, run.bytes_per_probe, || bar.inc(1));
    // What is left of the error when the probes are right and visibility exact comes from interpolation between probes.
    let mut path_traced = run.truth.as_ref().map(|BakedTruth { truth, .. }| {
        let query = Query { volume: &truth.volume, settings: &run.config.query };
        scenery.shade_again(&query, &masks, VisibilityMode::Ray, PATH_RAY, &shaded[2].report)
    });
    let baked = run.truth.as_ref().map(|t| t.report.clone());
    for s in &mut shaded {
        s.report.leak.baked = baked.as_ref().and_then(|b| b.figures.light);
    }
    bar.finish_and_clear();
    let reference = Reference::obtain(run, camera, &view)?;

    let exposure_ev = args.exposure.unwrap_or_else(|| exposure(&shaded[2], reference.as_ref()));
    if let Some(reference) = &reference {
        let Reference { layers, regions, glossy, .. } = reference;
        let comparison = Comparison { layers, regions, glossy: *glossy, exposure_ev, seed: args.trace.seed };
        let bar = run.console.progress.stage("comparing", VisibilityMode::ALL.len());
        for s in shaded.iter_mut().chain(&mut path_traced) {
            s.compare(&comparison);
            bar.inc(1);
        }
        bar.finish_and_clear();
    }
    create_folder(folder)?;
    pictures::write(run, camera, &view, &shaded, reference.as_ref(), exposure_ev, folder)?;
    let report = RenderReport {
        header: Header::new(
            SCHEMA,
            "render",
            args.trace.seed,
            run.threads,
            &run.world.scene.blake3,
            run.config.to_ron(),
        ),
        bake_seed: run.bake_seed,
        scene_changed: run.scene_changed,
        camera: camera.name.clone(),
        width: view.width,
        height: view.height,
        points: view.points.len(),
        exposure_ev,
        probes: volume.states.len(),
        probes_active: volume.active_count(),
        time_s: RenderTimes { primary: primary_s, total: run.started.elapsed().as_secs_f64(), ..run.times },
        peak_memory_bytes: peak_memory_bytes(),
        reference: reference.map(|r| r.summary),
        baked,
        methods: shaded.into_iter().chain(path_traced).map(|s| s.report).collect(),
    };
    write_json(&folder.join("report.json"), &report)?;
    tell::rendered(run.console, &report);
    pictures(args, folder).iter().for_each(|picture| tell::written(run.console, &picture.path));
    Ok(report)
}

/// Exposure of the whole run: that of the reference, else of the picture with exact visibility.
fn exposure(exact: &Shaded, reference: Option<&Reference>) -> f32 {
    let own = || exact.image.picture("beauty").map_or(0.0, |p| p.auto_exposure_ev());
    reference.map_or_else(own, |r| r.layers.beauty.auto_exposure_ev())
}

//! `lightprobe render`: scene + probes → pictures and report.

mod check;
mod pictures;
mod reference;
mod table;

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, bail};

use self::check::{check_pictures, check_view, pictures};
use self::reference::{Reference, Shot, Source};
use super::camera::cameras;
use super::session::{Opening, Probes, Session, inputs};
use super::{Console, tell, write_json};
use crate::cli::RenderArgs;
use crate::config::Config;
use crate::evaluate::{BakedTruth, Comparison, PATH_RAY, Scenery, Seen, Shaded};
use crate::light::World;
use crate::probe::Volume;
use crate::probe::file::{self, ProbeFile};
use crate::probe::query::Query;
use crate::report::baked;
use crate::report::render::{RenderReport, RenderTimes, SCHEMA};
use crate::scene::{Camera, Detail};
use crate::shade::points::see;
use crate::shade::visibility_modes::VisibilityMode;
use crate::system::memory::peak_memory_bytes;
use crate::system::output::{Named, create_folder};

/// What all cameras of a run share.
struct Run<'a> {
    args: &'a RenderArgs,
    session: &'a Session<'a>,
    world: &'a World<'a>,
    probes: &'a ProbeFile,
    volume: Volume,
    reference: Option<Source>,
    truth: Option<BakedTruth>,
    accel_build_s: f64,
}

pub fn run(args: &RenderArgs, console: &Console) -> Result<()> {
    let inputs = inputs(&args.scene, &args.trace, [Named::new("the probe file", &args.probes)]);
    check_pictures(args, &args.output, &inputs)?;
    let reference = Source::of(args)?;
    let probes = file::read(&args.probes)?;
    let session = Session::open(opening(args, &probes), console)?;
    let (world, accel_build_s) = session.world()?;
    tell::probes(console, &args.probes, &probes);

    let cameras = cameras(&args.view, &world, console)?;
    if args.reference_image.is_some() && cameras.len() > 1 {
        bail!("--reference-image is of one camera and --camera all asks for {}; name one", cameras.len());
    }
    for camera in &cameras {
        check_pictures(args, &folder(args, camera), &inputs)?;
        session.check_apart(&pictures(args, &folder(args, camera)))?;
        check_view(args, &world, camera, console)?;
    }
    let volume = probes.volume_as_planned(session.scene.origin_world);
    let truth = if args.bake_error { Some(truth(args, &session, &world, &probes, &volume)) } else { None };
    let run = Run { args, session: &session, world: &world, probes: &probes, volume, reference, truth, accel_build_s };
    let reports: Vec<RenderReport> =
        cameras.iter().map(|camera| render_camera(&run, camera, &folder(args, camera))).collect::<Result<_>>()?;
    let text = || {
        let tables: Vec<String> = reports.iter().map(table::table).collect();
        format!("{}\nwrote {}", tables.join("\n"), args.output.display())
    };
    match &reports[..] {
        [report] => session.print(report, text),
        _ => session.print(&reports, text),
    }
}

fn opening<'a>(args: &'a RenderArgs, probes: &'a ProbeFile) -> Opening<'a> {
    Opening {
        scene: &args.scene,
        trace: &args.trace,
        light: probes.query.light,
        probes: Some(Probes { path: &args.probes, file: probes, allow_change: args.allow_scene_change }),
        detail: Detail::PICTURE,
        keep_images: false,
        inputs: vec![Named::new("the probe file", &args.probes)],
        // Each camera has pictures of its own, in a folder of its own.
        outputs: Vec::new(),
    }
}

/// Where a camera's pictures go.
fn folder(args: &RenderArgs, camera: &Camera) -> PathBuf {
    match args.view.camera.as_deref() {
        Some("all") => args.output.join(folder_name(&camera.name)),
        _ => args.output.clone(),
    }
}

/// The file's probes lit by full paths: what is wrong with the probes themselves. Rays are those of the bake, as far as the
/// file's provenance tells them.
fn truth(args: &RenderArgs, session: &Session, world: &World, probes: &ProbeFile, volume: &Volume) -> BakedTruth {
    let place = format!("{}: its configuration", args.probes.display());
    let config = Config::parse(&probes.config, &place).unwrap_or_else(|error| {
        session
            .console
            .warn(format!("{error}; the probes' own error is measured with the rays of the preset physical"));
        Config::default()
    });
    let paths = args.reference.map_or(1, BakedTruth::paths_for);
    let truth = BakedTruth::trace(world, &config.capture, volume, paths, session.seed, session.console.progress);
    tell::truth(session.console, truth.report.paths_per_hit, truth.report.time_s);
    truth
}

/// A camera's name as the name of a folder.
fn folder_name(camera: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '#' | ' ') { c } else { '_' };
    camera.chars().map(safe).collect()
}

fn render_camera(run: &Run, camera: &Camera, folder: &Path) -> Result<RenderReport> {
    let (args, session, volume) = (run.args, run.session, &run.volume);
    let settings = &run.probes.query.weights;
    let query = Query { volume, settings };
    let bar = session.console.progress.stage("rendering", 3 + VisibilityMode::ALL.len());
    let primary_started = Instant::now();
    let view = see(run.world, camera, args.view.size.width, args.view.size.height, session.seed);
    let primary_s = primary_started.elapsed().as_secs_f64();
    tell::too_bright(session.console, view.clamped(), ["point of the picture", "points of the picture"]);
    bar.inc(1);
    let scenery = Scenery { world: run.world, view: &view, primary_s, seed: session.seed };
    let (masks, masks_s) = scenery.masks(&query);
    bar.inc(1);
    let air = scenery.air(&query);
    bar.inc(1);
    let seen = Seen { masks: &masks, masks_s, air: &air };
    let mut shaded = scenery.shade(&query, seen, run.probes.runtime_bytes(), || bar.inc(1));
    // What is left of the error when the probes are right and visibility exact comes from interpolation between probes.
    let mut path_traced = run.truth.as_ref().map(|BakedTruth { truth, .. }| {
        let query = Query { volume: &truth.volume, settings };
        scenery.shade_again(&query, seen, VisibilityMode::Ray, PATH_RAY, &shaded[2].report)
    });
    let fitted = run.probes.fit.is_some();
    let baked = run.truth.as_ref().filter(|_| !fitted).map(|t| t.report.clone());
    for s in &mut shaded {
        s.report.leak.baked = baked.as_ref().and_then(|b| b.figures.light);
    }
    bar.finish_and_clear();
    let shot = Shot { session, world: run.world, camera, view: &view };
    let reference = Reference::obtain(run.reference.as_ref(), shot, args.allow_scene_change)?;
    let exposure_ev = args.exposure.unwrap_or_else(|| exposure(&shaded[2], reference.as_ref()));
    if let Some(reference) = &reference {
        compare(run, reference, exposure_ev, shaded.iter_mut().chain(&mut path_traced));
    }
    if let Some(spp) = args.reference {
        let truth = air.truth(run.world, spp, session.seed);
        shaded.iter_mut().chain(&mut path_traced).for_each(|shaded| shaded.compare_in_air(&air, &truth));
    }
    create_folder(folder)?;
    pictures::write(volume, (camera, &view), &shaded, reference.as_ref(), exposure_ev, folder)?;
    let report = RenderReport {
        header: session.header(SCHEMA, "render", run.probes.config.clone()),
        bake_seed: run.probes.seed,
        scene_changed: session.scene_changed,
        camera: camera.name.clone(),
        width: view.width,
        height: view.height,
        points: view.points.len(),
        light_clamped: session.scene.light_clamped + view.clamped(),
        exposure_ev,
        probes: volume.states.len(),
        probes_active: volume.active_count(),
        time_s: RenderTimes {
            load: session.load_s,
            accel_build: run.accel_build_s,
            primary: primary_s,
            total: session.elapsed_s(),
        },
        peak_memory_bytes: peak_memory_bytes(),
        reference: reference.map(|r| r.summary),
        baked,
        fitted,
        baked_reason: (fitted && run.truth.is_some()).then_some(baked::FITTED),
        methods: shaded.into_iter().chain(path_traced).map(|s| s.report).collect(),
    };
    write_json(&folder.join("report.json"), &report)?;
    tell::rendered(session.console, &report);
    pictures(args, folder).iter().for_each(|picture| tell::written(session.console, &picture.path));
    Ok(report)
}

/// Adds the figures that need a reference.
fn compare<'s>(run: &Run, reference: &Reference, exposure_ev: f32, shaded: impl Iterator<Item = &'s mut Shaded>) {
    let Reference { layers, regions, glossy, .. } = reference;
    let comparison = Comparison { layers, regions, glossy: *glossy, exposure_ev, seed: run.session.seed };
    let bar = run.session.console.progress.stage("comparing", VisibilityMode::ALL.len());
    shaded.for_each(|shaded| {
        shaded.compare(&comparison);
        bar.inc(1);
    });
    bar.finish_and_clear();
}

/// Exposure of the whole run: that of the reference, else of the picture with exact visibility.
fn exposure(exact: &Shaded, reference: Option<&Reference>) -> f32 {
    let own = || exact.image.picture("beauty").map_or(0.0, |p| p.auto_exposure_ev());
    reference.map_or_else(own, |r| r.layers.beauty.auto_exposure_ev())
}

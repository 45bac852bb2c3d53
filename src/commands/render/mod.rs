//! `lightprobe render`: scene + probes → pictures and report.

mod check;
mod pictures;
mod reference;
mod table;

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail};

use self::check::{REPORT, check_pictures, check_view, pictures, remove_stale};
use self::reference::{Reference, Shot, Source};
use super::camera::cameras;
use super::export::{self, unfitted};
use super::session::{Opening, Probes, Session, inputs};
use super::{Console, kinds, tell, write_json};
use crate::cli::{EngineName, RenderArgs};
use crate::config::Config;
use crate::evaluate::{BakedTruth, Comparison, PATH_RAY, Scenery, Seen, Shaded};
use crate::export::{Export, ExportError, Target, Written};
use crate::light::World;
use crate::probe::Volume;
use crate::probe::file::{self, LightRecord, ProbeFile};
use crate::probe::query::{Answers, Query, QuerySettings};
use crate::report::baked;
use crate::report::render::{MethodReport, RenderReport, RenderTimes, SCHEMA};
use crate::scene::{Camera, Detail};
use crate::shade::points::{View, see};
use crate::shade::visibility_modes::VisibilityMode;
use crate::system::format;
use crate::system::memory::peak_memory_bytes;
use crate::system::output::{Named, create_folder};

/// Beyond this a picture shows something else than was meant: 2¹⁰ times as much light as a lit room, or as little.
const EXTREME_EV: f32 = 10.0;

/// Share of a picture outside the probes' hull that is worth a word.
const MUCH_OUTSIDE: f64 = 0.01;

/// What all cameras of a run share.
struct Run<'a, A> {
    args: &'a RenderArgs,
    session: &'a Session<'a>,
    world: &'a World<'a>,
    probes: Shown<'a, A>,
    reference: Option<Source>,
    truth: Option<BakedTruth>,
    accel_build_s: f64,
}

/// What is shaded: a probe file, or an export.
struct Shown<'a, A> {
    look_up: A,
    /// For pictures of the probes.
    volume: &'a Volume,
    bytes_per_probe: f64,
    seed: Option<u64>,
    config: &'a str,
    is_fitted: bool,
    /// Of a probe file; `None` for an export, whose probes have no truth of their own.
    settings: Option<&'a QuerySettings>,
    /// The engine of an export in place of a probe file.
    export: Option<Target>,
    /// The look-up of `--as`, its name and its bytes per probe.
    also: Option<(Target, Written, f64)>,
}

impl From<EngineName> for Target {
    fn from(name: EngineName) -> Target {
        match name {
            EngineName::Three => Target::Three,
            EngineName::Bevy => Target::Bevy,
            EngineName::Ddgi => Target::Ddgi,
        }
    }
}

pub fn run(args: &RenderArgs, console: &Console) -> Result<()> {
    let usage = "render SCENE PROBES -o DIR";
    kinds::expect_scene(&args.scene, usage)?;
    kinds::expect_probes(&args.probes, usage)?;
    check_pictures(args, &args.output, &read(args))?;
    let reference = Source::of(args)?;
    if args.probes.is_dir() {
        return run_export(args, reference, console);
    }
    let probes = file::read(&args.probes)?;
    let origin = Probes::of(&args.probes, &probes, args.allow_scene_change);
    let shows_gloss = !probes.query.weights.glossy.is_none();
    let detail = if shows_gloss { Detail::GLOSSY } else { Detail::PICTURE };
    let session = Session::open(opening(args, probes.query.light, origin, detail), console)?;
    let (world, accel_build_s) = session.world()?;
    tell::probes(console, &args.probes, &probes);
    let cameras = prepare(args, &session, &world)?;
    let mut volume = probes.volume_as_planned(session.scene.origin_world);
    if probes.query.weights.glossy.asks_levels() {
        volume.radiance.make_levels();
    }
    let truth = args.bake_error.then(|| truth(args, &session, &world, &probes, &volume));
    let settings = &probes.query.weights;
    let shown = Shown {
        look_up: Query { volume: &volume, settings },
        volume: &volume,
        bytes_per_probe: probes.runtime_bytes(),
        seed: probes.seed,
        config: &probes.config,
        is_fitted: probes.fit.is_some(),
        settings: Some(settings),
        export: None,
        also: args.engine.map(|engine| as_engine(args, engine, &probes, &volume, &world)).transpose()?,
    };
    let (session, world) = (&session, &world);
    finish(&Run { args, session, world, probes: shown, reference, truth, accel_build_s }, &cameras)
}

/// The look-up of an engine on what `export` would write.
fn as_engine(
    args: &RenderArgs,
    engine: EngineName,
    probes: &ProbeFile,
    volume: &Volume,
    world: &World,
) -> Result<(Target, Written, f64)> {
    let (to, place) = (Target::from(engine), args.probes.display());
    let export = unfitted(to, volume, probes, &export::origin(probes), Some(world))
        .with_context(|| format!("{place}: as an export to {}", to.name()))?;
    let written = export.as_read().map_err(|what| anyhow!("{place}: its export cannot be read back: {what}"))?;
    let bytes = export.bytes() as f64 / export.probes().max(1) as f64;
    Ok((to, written.relative_to(world.scene.origin_world), bytes))
}

/// A folder that `export` wrote in place of a probe file.
fn run_export(args: &RenderArgs, reference: Option<Source>, console: &Console) -> Result<()> {
    let place = args.probes.display();
    if args.engine.is_some() || args.bake_error {
        let flag = if args.bake_error { "--bake-error" } else { "--as" };
        bail!(
            "{flag} asks for a probe file, and {place} is an export; leave {flag} out, or give the file that `bake` wrote"
        );
    }
    let export = Export::read(&args.probes)?;
    let damaged = |what| ExportError::Damaged { path: args.probes.clone(), what };
    let written = export.as_read().map_err(damaged)?;
    let record = &export.record;
    let origin = Probes {
        path: &args.probes,
        scene: &record.scene,
        environment: record.environment.as_deref(),
        allow_change: args.allow_scene_change,
    };
    let session = Session::open(opening(args, record.light, origin, Detail::PICTURE), console)?;
    let (world, accel_build_s) = session.world()?;
    let cameras = prepare(args, &session, &world)?;
    let written = written.relative_to(session.scene.origin_world);
    let volume = written.drawn();
    let shown = Shown {
        look_up: &written,
        volume: &volume,
        bytes_per_probe: export.bytes() as f64 / export.probes().max(1) as f64,
        seed: record.seed,
        config: &record.config,
        is_fitted: record.fit.is_some(),
        settings: None,
        export: Some(record.to),
        also: None,
    };
    let (session, world) = (&session, &world);
    finish(&Run { args, session, world, probes: shown, reference, truth: None, accel_build_s }, &cameras)
}

/// What the command reads.
fn read(args: &RenderArgs) -> Vec<Named> {
    inputs(&args.scene, &args.trace, [Named::new("the probe file", &args.probes)])
}

/// The cameras, once all that they need is known to be possible.
fn prepare(args: &RenderArgs, session: &Session, world: &World) -> Result<Vec<Camera>> {
    let cameras = cameras(&args.view, world, session.console)?;
    if args.reference_image.is_some() && cameras.len() > 1 {
        bail!("--reference-image is of one camera and --camera all asks for {}; name one", cameras.len());
    }
    for camera in &cameras {
        check_pictures(args, &folder(args, camera), &read(args))?;
        session.check_apart(&pictures(args, &folder(args, camera)))?;
        check_view(args, world, camera, session.console)?;
    }
    Ok(cameras)
}

/// Renders all cameras and prints what was found.
fn finish<A: Answers>(run: &Run<A>, cameras: &[Camera]) -> Result<()> {
    let args = run.args;
    let reports: Vec<RenderReport> =
        cameras.iter().map(|camera| render_camera(run, camera, &folder(args, camera))).collect::<Result<_>>()?;
    let text = || {
        let tables: Vec<String> = reports.iter().map(table::table).collect();
        format!("{}\nwrote {}", tables.join("\n"), args.output.display())
    };
    match &reports[..] {
        [report] => run.session.print(report, text),
        _ => run.session.print(&reports, text),
    }
}

fn opening<'a>(args: &'a RenderArgs, light: LightRecord, probes: Probes<'a>, detail: Detail) -> Opening<'a> {
    Opening {
        scene: &args.scene,
        trace: &args.trace,
        light,
        probes: Some(probes),
        detail,
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

fn render_camera<A: Answers>(run: &Run<A>, camera: &Camera, folder: &Path) -> Result<RenderReport> {
    let (args, session, probes) = (run.args, run.session, &run.probes);
    let (query, volume) = (&probes.look_up, probes.volume);
    let bar = session.console.progress.stage("rendering", 3 + VisibilityMode::ALL.len());
    let primary_started = Instant::now();
    let view = see(run.world, camera, args.view.size.width, args.view.size.height, session.seed);
    let primary_s = primary_started.elapsed().as_secs_f64();
    tell::too_bright(session.console, view.clamped(), ["point of the picture", "points of the picture"]);
    bar.inc(1);
    let scenery = Scenery::new(run.world, &view, primary_s, session.seed);
    let (masks, masks_s) = scenery.masks(query);
    bar.inc(1);
    let air = scenery.air(query);
    bar.inc(1);
    let seen = Seen { masks: &masks, masks_s, air: &air };
    let mut shaded = scenery.shade(query, seen, probes.bytes_per_probe, || bar.inc(1));
    // What is left of the error when the probes are right and visibility exact comes from interpolation between probes.
    let mut path_traced = run.truth.as_ref().zip(probes.settings).map(|(BakedTruth { truth, .. }, settings)| {
        let query = Query { volume: &truth.volume, settings };
        scenery.shade_again(&query, seen, VisibilityMode::Ray, PATH_RAY, &shaded[2].report)
    });
    let of_engine =
        |(to, written, bytes): &(Target, Written, f64)| scenery.shade_as(written, to.method(), &air, *bytes);
    let mut by_rays = scenery.shade_diffuse_rays(query, &masks, &shaded[1]);
    let mut as_engine = probes.also.as_ref().map(of_engine);
    let fitted = probes.is_fitted;
    let baked = run.truth.as_ref().filter(|_| !fitted).map(|t| t.report.clone());
    for s in &mut shaded {
        s.report.leak.baked = baked.as_ref().and_then(|b| b.figures.light);
    }
    bar.finish_and_clear();
    let shot = Shot { session, world: run.world, camera, view: &view };
    let reference = Reference::obtain(run.reference.as_ref(), shot, args.allow_scene_change)?;
    let exposure_ev = args.exposure.unwrap_or_else(|| exposure(&view, &shaded[2], reference.as_ref()));
    scenery.shade_glossy(query, &masks, &mut shaded, reference.as_ref().and_then(Reference::glossy_layers));
    if let Some(reference) = &reference {
        let all = shaded.iter_mut().chain(&mut path_traced).chain(&mut by_rays).chain(&mut as_engine);
        compare(session, reference, exposure_ev, all);
    }
    if let Some(spp) = args.reference {
        let in_air = air.truth(run.world, spp, session.seed);
        let bent = scenery.bent.truth(run.world, spp, session.seed);
        let all = shaded.iter_mut().chain(&mut path_traced).chain(&mut as_engine);
        all.for_each(|shaded| shaded.compare_at_points(&air, (&in_air, &bent)));
    }
    warn_about(&camera.name, exposure_ev, &shaded[1].report, args, session.console);
    create_folder(folder)?;
    remove_stale(args, folder)?;
    let shown = (&shaded, as_engine.as_ref());
    pictures::write(volume, (camera, &view), shown, reference.as_ref(), exposure_ev, folder)?;
    let report = RenderReport {
        header: session.header(SCHEMA, "render", probes.config.to_owned()),
        bake_seed: probes.seed,
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
        export: probes.export.map(Target::name),
        methods: shaded.into_iter().chain(path_traced).chain(by_rays).chain(as_engine).map(|s| s.report).collect(),
    };
    write_json(&folder.join(REPORT), &report)?;
    tell::rendered(session.console, &report);
    let written = pictures(args, folder).into_iter().filter(|picture| picture.path.exists());
    written.for_each(|picture| tell::written(session.console, &picture.path));
    Ok(report)
}

/// Warns of a picture that shows next to no light, and of one that shows much that the probes do not reach.
fn warn_about(camera: &str, exposure_ev: f32, on: &MethodReport, args: &RenderArgs, console: &Console) {
    if args.exposure.is_none() && exposure_ev.abs() > EXTREME_EV {
        let (what, remedy) = match exposure_ev > 0.0 {
            true => ("hardly any light", "look from elsewhere (--camera, --look-at), or give a sky (--env)"),
            false => ("very much light", "lights in lumens want --set lights.punctual_scale=0.001464 in the bake"),
        };
        console.warn(format!(
            "camera {camera}: {what} reaches what it sees, the exposure is {exposure_ev:+.1} EV; {remedy}"
        ));
    }
    if let Some(share) = on.outside_hull.filter(|share| *share > MUCH_OUTSIDE) {
        console.warn(format!(
            "camera {camera}: {} of what it sees lies outside the probes' hull, where the probes at its rim are used; bake \
             with grid.bounds that hold it, or without",
            format::percent(share)
        ));
    }
}

/// Adds the figures that need a reference.
fn compare<'s>(
    session: &Session,
    reference: &Reference,
    exposure_ev: f32,
    shaded: impl Iterator<Item = &'s mut Shaded>,
) {
    let Reference { layers, regions, glossy, .. } = reference;
    let comparison = Comparison { layers, regions, glossy: *glossy, exposure_ev, seed: session.seed };
    let bar = session.console.progress.stage("comparing", VisibilityMode::ALL.len());
    shaded.for_each(|shaded| {
        shaded.compare(&comparison);
        bar.inc(1);
    });
    bar.finish_and_clear();
}

/// Exposure of the whole run: that of the reference, else of the picture with exact visibility.
fn exposure(view: &View, exact: &Shaded, reference: Option<&Reference>) -> f32 {
    let own = || exact.image.picture("beauty").map_or(0.0, |picture| view.auto_exposure_ev(&picture));
    reference.map_or_else(own, |r| view.auto_exposure_ev(&r.layers.beauty))
}

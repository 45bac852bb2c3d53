//! `lightprobe render`: scene + probes → pictures and report.

mod check;
mod pictures;
mod reference;
mod table;

use std::path::Path;
use std::time::Instant;

use anyhow::{Result, bail};
use glam::Vec3;

use self::check::{check_pictures, check_view, pictures};
use self::reference::{Reference, Source};
use super::camera::cameras;
use super::{Console, check_apart_from, inputs, load_scene, peak_memory_bytes, set_threads, tell, write_json};
use crate::cli::RenderArgs;
use crate::config::Config;
use crate::image::LayeredImage;
use crate::light::World;
use crate::math::color::luminance;
use crate::output::{Named, create_folder};
use crate::probe::file::{self, ProbeFile};
use crate::probe::query::{Query, VisibilitySettings};
use crate::probe::truth::Truth;
use crate::probe::{Volume, layout};
use crate::report::baked::{self, BakedReport};
use crate::report::header::Header;
use crate::report::render::{MethodReport, RenderReport, RenderTimes, SCHEMA, Spread};
use crate::report::{error, leak};
use crate::scene::{Camera, Scene};
use crate::shade::layers::compose;
use crate::shade::methods::{Method, exact_masks, irradiance, time_lookup, time_shading};
use crate::shade::points::{View, see};
use crate::shade::reference::ReferenceSettings;

/// Name in the report of probes lit by full paths, with exact visibility.
pub const PATH_RAY: &str = "path_ray";

/// What all cameras of a run share.
struct Run<'a> {
    args: &'a RenderArgs,
    console: &'a Console,
    world: &'a World<'a>,
    config: &'a Config,
    volume: &'a Volume,
    bytes_per_probe: f64,
    scene_changed: bool,
    reference: Option<Source>,
    truth: Option<BakedTruth>,
    threads: usize,
    times: RenderTimes,
    started: Instant,
}

/// The file's probes lit by full paths, and how the file's own differ from them.
struct BakedTruth {
    truth: Truth,
    report: BakedReport,
}

impl BakedTruth {
    /// Hits are many, and each path that leaves one is a sample of its own: few from each do.
    const REFERENCE_SPP_PER_PATH: u32 = 128;

    /// With a traced reference, and in proportion to its samples.
    fn trace(world: &World, config: &Config, volume: &Volume, settings: &ReferenceSettings, console: &Console) -> Self {
        let started = Instant::now();
        let paths = (settings.spp / Self::REFERENCE_SPP_PER_PATH).max(1);
        let truth = Truth::trace(world, &config.capture, volume, paths, settings.seed, console.progress);
        let (figures, standard_error) = baked::measure(volume, &truth);
        let paths_per_hit = u64::from(paths) * truth.runs.len() as u64;
        let report = BakedReport { figures, standard_error, paths_per_hit, time_s: started.elapsed().as_secs_f64() };
        tell::truth(console, paths_per_hit, report.time_s);
        BakedTruth { truth, report }
    }
}

/// One method's results.
struct Shaded {
    method: Method,
    irradiance: Vec<Vec3>,
    report: MethodReport,
    image: LayeredImage,
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
        Some(Source::Trace { settings }) => Some(BakedTruth::trace(&world, &config, &volume, settings, console)),
        _ => None,
    };
    let run = Run {
        args,
        console,
        world: &world,
        config: &config,
        volume: &volume,
        bytes_per_probe,
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

/// The volume without what the plan found unnecessary, should the file hold it all the same.
fn volume_as_planned(probes: &ProbeFile, scene: &Scene) -> Volume {
    let mut volume = probes.volume(scene.origin_world);
    if probes.plan["visibility"] == serde_json::Value::Bool(false) {
        volume.distance = None;
        volume.surface_visibility = None;
    }
    volume
}

/// Bytes per probe of what the file holds, in the layout that shading uses.
fn runtime_bytes(probes: &ProbeFile, config: &Config) -> f64 {
    let count = probes.volume_in_grid().states.len();
    let surface = probes.volume_in_grid().surface_visibility.as_ref().map_or(0, |s| s.bytes());
    let visibility = match config.query.visibility {
        _ if probes.plan["visibility"] == serde_json::Value::Bool(false) => VisibilitySettings::None,
        visibility => visibility,
    };
    layout::irradiance_bytes(&config.filter, &config.encoding, config.placement.relocate) as f64
        + layout::visibility_bytes(visibility, &config.filter, &config.encoding, surface, count)
}

/// A camera's name as the name of a folder.
fn folder_name(camera: &str) -> String {
    let safe = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '#' | ' ') { c } else { '_' };
    camera.chars().map(safe).collect()
}

fn render_camera(run: &Run, camera: &Camera, folder: &Path) -> Result<RenderReport> {
    let (args, volume) = (run.args, run.volume);
    let query = Query { volume, settings: &run.config.query };
    let bar = run.console.progress.stage("rendering", 2 + Method::ALL.len());
    let primary_started = Instant::now();
    let view = see(run.world, camera, args.view.size.width, args.view.size.height, args.trace.seed);
    let primary_s = primary_started.elapsed().as_secs_f64();
    bar.inc(1);
    let masks_started = Instant::now();
    let masks = exact_masks(run.world, &query, &view.points);
    let masks_s = masks_started.elapsed().as_secs_f64();
    bar.inc(1);

    let exact = irradiance(&query, &view.points, &masks, Method::Ray);
    let shade = |method: Method| {
        let irradiance = irradiance(&query, &view.points, &masks, method);
        let ray_s = if method == Method::Ray { primary_s + masks_s } else { primary_s };
        let report = MethodReport {
            name: method.name(),
            shade_ms: Spread::of(time_shading(&query, &view.points, &masks, method)),
            ray_ms: ray_s * 1e3,
            lookup_ns: time_lookup(&query, &view.points, &masks, method),
            bytes_per_probe: run.bytes_per_probe,
            irradiance_indirect_mean: mean_luminance(&view, &irradiance),
            leak: leak::measure(&query, &view.points, &masks, method, &irradiance, &exact),
            error: None,
            error_gltf: None,
        };
        bar.inc(1);
        Shaded { method, image: compose(&view, &irradiance), irradiance, report }
    };
    let mut shaded = Method::ALL.map(shade);
    // What is left of the error when the probes are right and visibility exact comes from interpolation between probes.
    let mut path_traced = run.truth.as_ref().map(|BakedTruth { truth, .. }| {
        let query = Query { volume: &truth.volume, settings: &run.config.query };
        let irradiance = irradiance(&query, &view.points, &masks, Method::Ray);
        let report = MethodReport {
            name: PATH_RAY,
            irradiance_indirect_mean: mean_luminance(&view, &irradiance),
            leak: leak::measure(&query, &view.points, &masks, Method::Ray, &irradiance, &irradiance),
            ..shaded[2].report.clone()
        };
        Shaded { method: Method::Ray, image: compose(&view, &irradiance), irradiance, report }
    });
    let baked = run.truth.as_ref().map(|t| t.report.clone());
    for s in &mut shaded {
        s.report.leak.baked = baked.as_ref().and_then(|b| b.figures.light);
    }
    bar.finish_and_clear();
    let reference = Reference::obtain(run, camera, &view)?;

    let exposure_ev = args.exposure.unwrap_or_else(|| exposure(&shaded[2], reference.as_ref()));
    if let Some(reference) = &reference {
        let bar = run.console.progress.stage("comparing", Method::ALL.len());
        for s in shaded.iter_mut().chain(&mut path_traced) {
            compare(s, reference, exposure_ev, args.trace.seed);
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

/// Mean over the pixels that show a surface.
fn mean_luminance(view: &View, irradiance: &[Vec3]) -> Option<f64> {
    let sum: f64 = view.points.iter().zip(irradiance).map(|(p, e)| f64::from(p.weight * luminance(*e))).sum();
    // The points of a pixel stand together.
    let pixels = view.points.chunk_by(|a, b| a.pixel == b.pixel).count();
    (pixels > 0).then(|| sum / pixels as f64)
}

/// Exposure of the whole run: that of the reference, else of the picture with exact visibility.
fn exposure(exact: &Shaded, reference: Option<&Reference>) -> f32 {
    let own = || exact.image.picture("beauty").map_or(0.0, |p| p.auto_exposure_ev());
    reference.map_or_else(own, |r| r.layers.beauty.auto_exposure_ev())
}

/// Adds the figures that need a reference to a method's report.
fn compare(shaded: &mut Shaded, reference: &Reference, exposure_ev: f32, seed: u64) {
    let Reference { layers, regions, .. } = reference;
    let irradiance = shaded.image.layer("irradiance_indirect").unwrap_or_default();
    let flips = shaded.image.picture("beauty").map(|p| error::flip::measure(layers, &p, exposure_ev, regions, seed));
    let error = Some(error::measure(layers, irradiance, regions, flips.as_ref()));
    if reference.glossy {
        shaded.report.error_gltf = error;
    } else {
        shaded.report.error = error;
    }
    let shown: Vec<bool> = regions.iter().map(Option::is_some).collect();
    shaded.report.leak.dark_region = leak::dark_region(irradiance, layers, &shown);
}

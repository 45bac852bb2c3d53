//! `lightprobe sweep`: scene + ladders → errors against time, bytes and leaks.

mod outputs;
mod reference;
mod summary;
mod table;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result, bail};

use self::summary::Measured;
use super::camera::cameras;
use super::{Console, check_apart_from, check_picture_memory, inputs, load_scene, set_sky, set_threads, tell};
use crate::bake::{self, Circumstances};
use crate::cli::{EqualName, SweepArgs};
use crate::config::{Config, PlanMode, presets};
use crate::evaluate::{Comparison, Scenery};
use crate::light::World;
use crate::report::sweep::{FloorReport, SweepTimes};
use crate::scene::Scene;
use crate::shade::points::see;
use crate::shade::reference::ReferenceSettings;
use crate::shade::regions::regions;
use crate::sweep::ladder::{Ladder, LadderFile, Method, check_shared, expand, method_name};
use crate::sweep::run::{Finished, Setting};
use crate::sweep::split::Spread;
use crate::sweep::store::Store;
use crate::sweep::{SweepError, equal, floor};
use crate::system::output::{Named, check_folder, check_outputs, create_folder};

/// Memory that evaluation takes at its peak, per pixel: as a render's with a reference, and the sums over the seeds.
const PIXEL_BYTES: f64 = 1500.0;

pub fn run(args: &SweepArgs, console: &Console) -> Result<()> {
    let started = Instant::now();
    if args.view.camera.as_deref() == Some("all") {
        bail!("--camera all: a sweep is of one camera; name one");
    }
    let file = args.ladder.as_deref().map(LadderFile::read).transpose()?;
    let mut ladders = expand(file.as_ref(), &methods(args, file.as_ref())?, &args.set, |c| set_sky(c, &args.trace))?;
    if args.equal == Some(EqualName::Positions) {
        equal::share_positions(&mut ladders);
    }
    check_shared(&ladders)?;
    let outputs: Vec<Named> = outputs::FILES.iter().map(|name| Named::new("-o", args.output.join(name))).collect();
    check_folder(&args.output)?;
    if args.output.is_dir() {
        check_outputs(&outputs, &inputs(&args.scene, &args.trace, configurations(args, file.as_ref())))?;
    }
    let threads = set_threads(args.trace.threads)?;

    let scene = load_scene(&args.scene, &args.trace, &shared_config(&ladders)?, console)?;
    check_apart_from(&scene, &outputs)?;
    let mut times = SweepTimes { load: started.elapsed().as_secs_f64(), ..Default::default() };
    tell::scene(console, &args.scene, &scene, times.load);
    check_all(&ladders, &scene)?;
    let size = args.view.size;
    check_picture_memory(size, PIXEL_BYTES)?;
    let accel_started = Instant::now();
    let config = shared_config(&ladders)?;
    let world = World::new(&scene, config.lights.punctual_scale, config.solver.albedo_max)?;
    times.accel_build = accel_started.elapsed().as_secs_f64();
    tell::accel(console, times.accel_build);
    let found = cameras(&args.view, &world, console)?;
    let camera = found.first().context("there is no camera; use --look-at")?;
    check_captures(&ladders, &world, args.trace.seed)?;

    create_folder(&args.output)?;
    let store = Store::new(&args.output)?;
    let settings = ReferenceSettings { spp: args.reference, seed: args.trace.seed, ..Default::default() };
    let reference = reference::obtain(args, &world, camera, &settings, console)?;
    times.reference = reference.time_s.unwrap_or(0.0);
    let primary_started = Instant::now();
    let view = see(&world, camera, size.width, size.height, args.trace.seed);
    let primary_s = primary_started.elapsed().as_secs_f64();
    let regions = regions(&world, &view);
    let (mean, standard_error) = reference.layers.means(|i| regions[i].is_some());
    let exposure_ev = reference.layers.beauty.auto_exposure_ev();
    let setting = Setting {
        scenery: Scenery { world: &world, view: &view, primary_s },
        comparison: Comparison {
            layers: &reference.layers,
            regions: &regions,
            glossy: false,
            exposure_ev,
            seed: args.trace.seed,
        },
        reference_mean: mean.filter(|mean| *mean > 0.0),
        reference_settings: ReferenceSettings { spp: reference.spp, ..settings },
        store,
        // Times depend on the threads.
        identity: format!("{}spp = {}\nthreads = {threads}\n", reference.identity.to_text(), reference.spp),
    };
    let mut work = Work::new(&setting, &ladders, args, console);
    let measured = work.run_all()?;
    let sets = summary::ladders(&ladders, &measured);
    let floor = work.floors(&sets, &measured)?;
    work.bar.finish_and_clear();
    let kept = work.kept;

    times.total = started.elapsed().as_secs_f64();
    let report = summary::report(summary::Parts {
        args,
        threads,
        camera,
        view: &view,
        scene: &scene,
        reference: reference.summary(mean, standard_error),
        exposure_ev,
        times,
        ladders: sets,
        measured,
        floor,
    });
    outputs::write(&report, &args.output)?;
    outputs.iter().for_each(|output| tell::written(console, &output.path));
    if console.json {
        return console.print(&serde_json::to_string_pretty(&report)?);
    }
    console.print(&table::text(&report))?;
    let from_before = if kept > 0 { format!(", {kept} runs kept from before") } else { String::new() };
    console.print(&format!("wrote {}{from_before}", args.output.display()))
}

/// The configurations that the command line names; the default where neither it nor all ladders name any.
fn methods(args: &SweepArgs, file: Option<&LadderFile>) -> Result<Vec<Method>> {
    let mut methods: Vec<Method> = Vec::new();
    let mut add = |name: String, config: Config| {
        if methods.iter().any(|m| m.name == name) {
            bail!("two configurations are called '{name}'; rename a file, or give each preset once");
        }
        methods.push(Method { name, config });
        Ok(())
    };
    for name in &args.preset {
        if name == "all" {
            for preset in presets::PRESETS {
                add(preset.name.to_owned(), preset.config()?)?;
            }
        } else {
            add(name.clone(), presets::find(name)?)?;
        }
    }
    for path in &args.config {
        add(method_name(path), Config::load(path)?)?;
    }
    if methods.is_empty() && file.is_none_or(LadderFile::wants_methods) {
        methods.push(Method { name: "default".to_owned(), config: Config::default() });
    }
    if !methods.is_empty() && file.is_some_and(|file| !file.wants_methods()) {
        bail!("--preset, --config: every ladder of the file has a configuration of its own; leave them out");
    }
    Ok(methods)
}

/// Files that configurations come from.
fn configurations(args: &SweepArgs, file: Option<&LadderFile>) -> Vec<Named> {
    let named = |path: &PathBuf| Named::new("a configuration", path);
    let of_ladders = file.map(LadderFile::files).unwrap_or_default();
    let ladder = args.ladder.iter().map(|path| Named::new("the ladder", path));
    args.config.iter().chain(&of_ladders).map(named).chain(ladder).collect()
}

/// What loading a scene asks of the configurations, which agree but for the plan.
fn shared_config(ladders: &[Ladder]) -> Result<Config> {
    let rungs = || ladders.iter().flat_map(|ladder| &ladder.rungs);
    let first = rungs().next().context("there is no configuration to run")?;
    let keeps = rungs().any(|rung| rung.config.plan == PlanMode::KeepEverything);
    let plan = if keeps { PlanMode::KeepEverything } else { PlanMode::LeaveOut };
    Ok(Config { plan, ..first.config.clone() })
}

/// Refuses what cannot be baked, before anything is traced.
fn check_all(ladders: &[Ladder], scene: &Scene) -> Result<(), SweepError> {
    for rung in ladders.iter().flat_map(|ladder| &ladder.rungs) {
        let named = |cause| SweepError::Bake { label: rung.label.clone(), cause };
        bake::check(&rung.config, scene).map_err(named)?;
    }
    Ok(())
}

/// Refuses what may not fit and, looked at closer, does not.
fn check_captures(ladders: &[Ladder], world: &World, seed: u64) -> Result<(), SweepError> {
    let progress = crate::system::progress::Progress::hidden();
    let circumstances = Circumstances { seed, memory_budget_bytes: None, progress, checkpoint: None };
    for rung in ladders.iter().flat_map(|ladder| &ladder.rungs) {
        let named = |cause| SweepError::Bake { label: rung.label.clone(), cause };
        if bake::surely_fits(&rung.config, world.scene).map_err(named)? {
            continue;
        }
        let prepared = bake::prepare(world, &rung.config, &circumstances).map_err(named)?;
        prepared.check_memory(&circumstances).map_err(|cause| named(cause.into()))?;
    }
    Ok(())
}

/// All bakes, one after the other: each has all threads.
struct Work<'a, 's> {
    setting: &'a Setting<'a, 's>,
    ladders: &'a [Ladder],
    seeds: Vec<u64>,
    console: &'a Console,
    bar: indicatif::ProgressBar,
    /// Runs that were there before.
    kept: usize,
}

impl<'a, 's> Work<'a, 's> {
    fn new(setting: &'a Setting<'a, 's>, ladders: &'a [Ladder], args: &SweepArgs, console: &'a Console) -> Self {
        let seeds: Vec<u64> = (0..u64::from(args.seeds)).map(|k| args.trace.seed.wrapping_add(k)).collect();
        let runs = ladders.iter().map(|ladder| ladder.rungs.len()).sum::<usize>() * seeds.len();
        let bar = console.progress.stage("sweep", runs + floor::STEPS * ladders.len());
        Work { setting, ladders, seeds, console, bar, kept: 0 }
    }

    /// Every configuration with every seed, in the order of the ladders.
    fn run_all(&mut self) -> Result<Vec<Measured>> {
        let view = self.setting.scenery.view;
        let mut all = Vec::new();
        for (ladder, rung) in self.ladders.iter().enumerate().flat_map(|(i, l)| l.rungs.iter().map(move |r| (i, r))) {
            let mut spread = Spread::new(view.width as usize * view.height as usize);
            let mut runs = Vec::new();
            self.bar.set_message(rung.label.clone());
            for &seed in &self.seeds {
                let warn = |what: String| self.console.warn(what);
                let Finished { record, irradiance, kept } =
                    self.setting.obtain(&rung.label, &rung.config, seed, warn)?;
                spread.add(&irradiance);
                self.kept += usize::from(kept);
                let from = if kept { "kept from before" } else { "done" };
                self.console.say(format!("{}, seed {seed}: {from}, bake {:.3} s", rung.label, record.bake_s));
                runs.push(record);
                self.bar.inc(1);
            }
            let Comparison { layers, regions, .. } = &self.setting.comparison;
            let split = spread.split(layers, regions);
            all.push(Measured::new(ladder, rung, runs, split, self.setting.reference_mean));
        }
        Ok(all)
    }

    /// What limits each ladder's best configuration.
    fn floors(
        &self,
        ladders: &[crate::report::sweep::LadderReport],
        measured: &[Measured],
    ) -> Result<Vec<FloorReport>> {
        let mut floors = Vec::new();
        for ladder in ladders {
            let Some((index, best)) = ladder.best.and_then(|i| Some((i, measured.get(i)?))) else { continue };
            let Some(base) = best.report.runs.first() else { continue };
            self.bar.set_message(format!("what limits {}", best.report.label));
            let which = (ladder.name.as_str(), index, best.report.label.as_str());
            let warn = |what: String| self.console.warn(what);
            floors.push(floor::measure(self.setting, which, &best.config, base, &warn, &|| self.bar.inc(1))?);
        }
        Ok(floors)
    }
}

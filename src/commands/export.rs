//! `lightprobe export`: probes as an engine takes them.

use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use serde_json::{Value, json};

use super::session::{Opening, Probes, Session, inputs, set_threads};
use super::{Console, kinds, tell};
use crate::cli::{ExportArgs, TargetName, VolumesName};
use crate::config::{Config, Layers};
use crate::export::ddgi::Ddgi;
use crate::export::{Export, File, Grids, Origin, Rules, Target, made, record, rooms};
use crate::light::World;
use crate::plan;
use crate::probe::Volume;
use crate::probe::file::{self, ProbeFile};
use crate::probe::fit::{self, Fit, RowSettings};
use crate::scene::Detail;
use crate::system::format;
use crate::system::output::{Named, check_folder, check_outputs};

/// The scene's name beside an export to three.js, where its page looks for it.
const SCENE_BESIDE: &str = "scene.glb";

impl From<TargetName> for Target {
    fn from(name: TargetName) -> Target {
        match name {
            TargetName::Three => Target::Three,
            TargetName::Bevy => Target::Bevy,
            TargetName::Ddgi => Target::Ddgi,
            TargetName::Exr => Target::Exr,
        }
    }
}

/// An export and what there is to say of it.
struct Made {
    export: Export,
    fit: Value,
    warnings: Vec<String>,
}

pub fn run(args: &ExportArgs, console: &Console) -> Result<()> {
    kinds::expect_probes(&args.probes, "export PROBES --to ENGINE -o DIR --scene SCENE")?;
    if let Some(scene) = &args.scene {
        kinds::expect_scene(scene, "export PROBES --to ENGINE -o DIR --scene SCENE")?;
    }
    let to = Target::from(args.to);
    check_arguments(args, to)?;
    check_folder(&args.output)?;
    let settings = fit_settings(args, to)?;
    let probes = file::read(&args.probes)?;
    tell::probes(console, &args.probes, &probes);
    let place = args.probes.display();
    let made = match &args.scene {
        None => {
            set_threads(args.trace.threads)?;
            make(args, to, &probes, probes.volume_in_grid(), None)
        }
        Some(scene) => {
            let session = Session::open(opening(args, scene, &probes), console)?;
            let (world, _) = session.world()?;
            let volume = probes.volume_as_planned(session.scene.origin_world);
            make(args, to, &probes, &volume, Some((&session, &world, &settings)))
        }
    };
    let mut made = made.map_err(|error| anyhow!("{place}: {error:#}"))?;
    if let Some(scene) = args.scene.as_deref().filter(|scene| to == Target::Three && is_binary(scene)) {
        let bytes = std::fs::read(scene).with_context(|| format!("cannot read {} again", scene.display()))?;
        made.export.files.push(File { name: SCENE_BESIDE.to_owned(), bytes });
    }
    made.warnings.iter().for_each(|warning| console.warn(format!("{place}: {warning}")));
    let outputs = outputs(args, &made.export);
    // In a folder that is not there nothing is in the way.
    if args.output.is_dir() {
        check_outputs(&outputs, &read(args))?;
    }
    made.export.write(&args.output)?;
    outputs.iter().for_each(|output| tell::written(console, &output.path));
    report(args, &made, console)
}

fn is_binary(scene: &Path) -> bool {
    scene.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb"))
}

/// Refuses what a target cannot do.
fn check_arguments(args: &ExportArgs, to: Target) -> Result<()> {
    let name = to.name();
    if to.rules().is_none() {
        ensure!(!args.fit, "--fit: {name} is no sum of what is stored; leave --fit out, or export to three or bevy");
        ensure!(
            args.volumes == VolumesName::One,
            "--volumes auto: {name} has one volume; leave it out, or export to three or bevy"
        );
    }
    if args.volumes == VolumesName::Auto && args.scene.is_none() {
        bail!("--volumes auto looks for rooms in the scene; give it with --scene");
    }
    Ok(())
}

/// The settings of the fit: the defaults of the engine, and what `--set` says of them.
fn fit_settings(args: &ExportArgs, to: Target) -> Result<RowSettings> {
    let own = RowSettings::default();
    let air = to.rules().map_or(own.air, Rules::air_weight);
    let base = Config { fit: Fit::Rows(RowSettings { air, ..own }), ..Config::default() };
    if let Some(other) = args.set.iter().find(|set| !set.starts_with("fit")) {
        bail!("--set {other}: an export has the keys of fit.rows alone; bake again to change others");
    }
    match Layers::over(base).set(&args.set)?.config()?.fit {
        Fit::Rows(settings) => Ok(settings),
        Fit::None => bail!("--set fit=none beside --fit; leave one of them out"),
    }
}

fn opening<'a>(args: &'a ExportArgs, scene: &'a Path, probes: &'a ProbeFile) -> Opening<'a> {
    Opening {
        scene,
        trace: &args.trace,
        light: probes.query.light,
        probes: Some(Probes::of(&args.probes, probes, args.allow_scene_change)),
        detail: Detail::LIGHT,
        keep_images: false,
        inputs: vec![Named::new("the probe file", &args.probes)],
        outputs: Vec::new(),
    }
}

/// What the command reads.
fn read(args: &ExportArgs) -> Vec<Named> {
    let probes = Named::new("the probe file", &args.probes);
    match &args.scene {
        Some(scene) => inputs(scene, &args.trace, [probes]),
        None => vec![probes],
    }
}

/// What it writes.
fn outputs(args: &ExportArgs, export: &Export) -> Vec<Named> {
    let names = export.files.iter().map(|file| file.name.as_str()).chain([record::RECORD]);
    names.map(|name| Named::new("-o", args.output.join(name))).collect()
}

/// Where a file's probes come from.
pub fn origin(probes: &ProbeFile) -> Origin {
    Origin {
        scene: probes.scene.clone(),
        light: probes.query.light,
        environment: plan::environment_map(&probes.plan).map(str::to_owned),
        seed: probes.seed,
        probes_fitted: probes.fit.is_some(),
        config: probes.config.clone(),
    }
}

/// What stands beside the probes where the scene is given.
type Beside<'a> = (&'a Session<'a>, &'a World<'a>, &'a RowSettings);

fn make(args: &ExportArgs, to: Target, probes: &ProbeFile, volume: &Volume, beside: Option<Beside>) -> Result<Made> {
    let origin = origin(probes);
    let Some(rules) = to.rules() else {
        let export = unfitted(to, volume, probes, &origin, beside.map(|(_, world, _)| world))?;
        return Ok(Made { export, fit: Value::Null, warnings: Vec::new() });
    };
    let query = &probes.query.weights;
    let mut warnings = Vec::new();
    let (mut grids, notes) = match (args.volumes, beside) {
        (VolumesName::Auto, Some((_, world, _))) => {
            let found = rooms::blocks(world, volume, query, rules);
            warnings.extend(found.warnings);
            (found.grids, found.notes)
        }
        (_, beside) => {
            warnings.extend(beside.and_then(|(_, world, _)| rooms::shared(world, volume)));
            made::one_block(volume, query, rules, beside.map(|(_, world, _)| world))
        }
    };
    let (record, report) = match beside {
        Some(beside) if args.fit => fitted(&mut grids, beside),
        _ => (None, Value::Null),
    };
    Ok(Made { export: Export::of_grids(&grids, &notes, &origin, record), fit: report, warnings })
}

/// Gives the grids the values that interpolate best; what the files and what the report say of it.
fn fitted(grids: &mut Grids, (session, world, settings): Beside) -> (Option<Value>, Value) {
    let steps = settings.points(grids.positions.len()).iter().sum();
    let bar = session.console.progress.stage("fitting", steps);
    let figures = fit::run_on(grids, settings, world, session.seed, &mut (), |done| bar.inc(done));
    bar.finish_and_clear();
    tell::not_finite(session.console, figures.non_finite);
    (Some(figures.record()), figures.report())
}

/// An export of the file's own values as one volume.
pub fn unfitted(
    to: Target,
    volume: &Volume,
    probes: &ProbeFile,
    origin: &Origin,
    world: Option<&World>,
) -> Result<Export> {
    let query = &probes.query.weights;
    let grids = |rules: Rules| {
        let (grids, notes) = made::one_block(volume, query, rules, world);
        Export::of_grids(&grids, &notes, origin, None)
    };
    Ok(match (to, to.rules()) {
        (_, Some(rules)) => grids(rules),
        (Target::Ddgi, None) => {
            let (ddgi, notes) = Ddgi::of(volume, query, world).map_err(|what| anyhow!(what))?;
            Export::of_ddgi(&ddgi, &notes, origin)
        }
        (_, None) => Export::of_atlas(volume, origin)?,
    })
}

fn report(args: &ExportArgs, made: &Made, console: &Console) -> Result<()> {
    let Made { export, fit, warnings } = made;
    let volumes = &export.record.volumes;
    let (probes, bytes) = (export.probes(), export.bytes());
    let holes: usize = volumes.iter().map(|volume| volume.holes.len()).sum();
    let moved: usize = volumes.iter().map(|volume| volume.moved.len()).sum();
    if console.json {
        let report = json!({
            "schema": "lightprobe-export/1",
            "to": export.record.to,
            "volumes": volumes.len(),
            "probes": probes,
            "holes": holes,
            "moved": moved,
            "bytes": bytes,
            "bytes_per_probe": bytes as f64 / probes.max(1) as f64,
            "fit": fit,
            "warnings": warnings,
        });
        return console.print(&serde_json::to_string_pretty(&report)?);
    }
    let mut text = format!(
        "{} of {}, {}; {holes} without light of their own, {moved} moved in the bake\n",
        format::counted(volumes.len() as u64, "volume", "volumes"),
        format::counted(probes as u64, "probe", "probes"),
        format::bytes(bytes),
    );
    if let (Some(before), Some(after)) = (fit["held_out_before"].as_f64(), fit["held_out_after"].as_f64()) {
        let air = |key: &str| fit[key].as_f64().map_or(format::UNDEFINED.to_owned(), format::percent);
        text.push_str(&format!(
            "fit: error of the engine's look-up at points kept from it {} → {}, in the air {} → {}\n",
            format::percent(before),
            format::percent(after),
            air("air_before"),
            air("air_after"),
        ));
    }
    console.print(&format!("{text}wrote {}", args.output.display()))
}

//! What every command on a scene does first: check what it will write, bind its threads, load, say what was loaded.

use std::path::Path;
use std::time::Instant;

use anyhow::{Result, bail, ensure};
use serde::Serialize;

use super::{Console, tell};
use crate::cli::{ConfigArgs, TraceArgs};
use crate::config::presets::Preset;
use crate::config::{Config, Layers, presets};
use crate::light::World;
use crate::plan;
use crate::probe::file::{LightRecord, ProbeFile, SceneRecord};
use crate::report::header::{Header, command_line};
use crate::scene::light::LIGHT_MAX;
use crate::scene::{self, Detail, EnvironmentSource, LoadOptions, Scene};
use crate::system::output::{Named, check_apart, check_outputs};
use crate::system::terminal;

/// What a session is opened with.
pub struct Opening<'a> {
    pub scene: &'a Path,
    pub trace: &'a TraceArgs,
    /// The light that the configuration, or the probe file, gives the scene.
    pub light: LightRecord,
    /// The probes that the scene is to be the one of; `None` where the command reads none.
    pub probes: Option<Probes<'a>>,
    /// What the command looks at of materials.
    pub detail: Detail,
    /// Whether images whose texels are all equal are kept whole.
    pub keep_images: bool,
    /// Files that the command reads besides the scene and its sky.
    pub inputs: Vec<Named>,
    /// Files that it will write.
    pub outputs: Vec<Named>,
}

/// Probes that a command reads beside the scene.
#[derive(Clone, Copy)]
pub struct Probes<'a> {
    pub path: &'a Path,
    /// The scene of their bake.
    pub scene: &'a SceneRecord,
    /// The environment map of their bake, in words.
    pub environment: Option<&'a str>,
    /// Whether the scene may be another than that of the bake.
    pub allow_change: bool,
}

impl<'a> Probes<'a> {
    pub fn of(path: &'a Path, file: &'a ProbeFile, allow_change: bool) -> Probes<'a> {
        Probes { path, scene: &file.scene, environment: plan::environment_map(&file.plan), allow_change }
    }
}

/// A loaded scene and the circumstances of the command that works on it.
pub struct Session<'c> {
    pub console: &'c Console,
    pub scene: Scene,
    pub light: LightRecord,
    /// Whether the scene is another than the probes were baked from.
    pub scene_changed: bool,
    pub seed: u64,
    pub threads: usize,
    pub started: Instant,
    pub load_s: f64,
}

impl<'c> Session<'c> {
    /// Checks, binds threads and loads. Nothing is traced, nothing written.
    ///
    /// # Errors
    /// An output cannot be written, or is an input; the scene cannot be loaded, or is another than that of the probes.
    pub fn open(opening: Opening, console: &'c Console) -> Result<Session<'c>> {
        let Opening { scene: path, trace, light, .. } = opening;
        check_sky_flags(trace, light.sky)?;
        check_outputs(&opening.outputs, &inputs(path, trace, opening.inputs))?;
        let threads = set_threads(trace.threads)?;
        let started = Instant::now();
        let from_light = light.sky.map(|sky| EnvironmentSource::Constant(sky.into()));
        let environment = trace.env.clone().or(from_light);
        let options = LoadOptions {
            unassigned: light.unassigned,
            detail: opening.detail,
            environment,
            environment_rotate_deg: trace.env_rotate,
            environment_scale: trace.env_scale,
            collapse_constant_images: !opening.keep_images,
            ..Default::default()
        };
        let scene = scene::load(path, &options)?;
        // Before warnings: what the scene lacks may be the sky of the bake.
        let is_dark = trace.env.is_none() && light.sky.is_none();
        let lost_sky = opening.probes.and_then(|probes| probes.environment).filter(|_| is_dark);
        let scene_changed = match opening.probes {
            Some(probes) => check_scene(probes, path, &scene, lost_sky, console)?,
            None => false,
        };
        for warning in &scene.warnings {
            console.warn(format!("{}: {warning}", path.display()));
        }
        if lost_sky.is_none() {
            tell::darkness(console, path, &scene);
        }
        let load_s = started.elapsed().as_secs_f64();
        if !opening.detail.gloss {
            tell::metal(console, path, &scene);
        }
        let session = Session { console, scene, light, scene_changed, seed: trace.seed, threads, started, load_s };
        session.check_apart(&opening.outputs)?;
        tell::scene(console, path, &session.scene, load_s);
        Ok(session)
    }

    /// Refuses outputs that are files of the scene: its buffers and images.
    pub fn check_apart(&self, outputs: &[Named]) -> Result<()> {
        let file = |file| Named::new("a file of the scene", file);
        let files: Vec<Named> = self.scene.files.iter().map(file).collect();
        Ok(check_apart(outputs, &files)?)
    }

    /// The scene with what asks about its light, and the seconds that this took to build.
    ///
    /// # Errors
    /// Embree refuses the scene.
    pub fn world(&self) -> Result<(World<'_>, f64)> {
        let started = Instant::now();
        let world = World::new(&self.scene, self.light.punctual_scale, self.light.albedo_max)?;
        let seconds = started.elapsed().as_secs_f64();
        tell::accel(self.console, seconds);
        Ok((world, seconds))
    }

    /// Seconds since the session was opened.
    pub fn elapsed_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    pub fn scene_record(&self) -> SceneRecord {
        SceneRecord { name: self.scene.name.clone(), blake3: self.scene.blake3.clone() }
    }

    /// What a report begins with; `config` is the configuration in effect, RON.
    pub fn header(&self, schema: &'static str, command: &'static str, config: String) -> Header {
        let (version, command_line) = (env!("CARGO_PKG_VERSION"), command_line(|_| true));
        let (seed, threads, scene_blake3) = (self.seed, self.threads, self.scene.blake3.clone());
        Header { schema, version, command, command_line, seed, threads, scene_blake3, config }
    }

    /// Prints a report as JSON where that was asked for, else what `text` makes of it.
    pub fn print(&self, report: &impl Serialize, text: impl FnOnce() -> String) -> Result<()> {
        match self.console.json {
            true => self.console.print(&serde_json::to_string_pretty(report)?),
            false => self.console.print(&text()),
        }
    }
}

/// Binds the work to this many threads; 0 means one per core.
pub fn set_threads(threads: usize) -> Result<usize> {
    /// More than any machine has; guards against typing errors that would exhaust memory.
    const MOST: usize = 1024;
    ensure!(threads <= MOST, "--threads {threads}: at most {MOST} make sense; use 0 for one per core");
    // Fails only when a pool stands already, as when commands run twice in one process.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    Ok(rayon::current_num_threads())
}

/// What a command reads, for the checks of its outputs.
pub fn inputs(scene: &Path, trace: &TraceArgs, others: impl IntoIterator<Item = Named>) -> Vec<Named> {
    let mut inputs = vec![Named::new("the scene", scene)];
    if let Some(EnvironmentSource::Map { file, .. }) = &trace.env {
        inputs.push(Named::new("the environment map", file));
    }
    inputs.extend(others);
    inputs
}

/// Whether the presets are asked for, and not one of them.
pub fn lists_presets<'n>(names: impl IntoIterator<Item = &'n String>) -> bool {
    names.into_iter().any(|name| name == "list")
}

/// Prints the presets.
pub fn list_presets(console: &Console) -> Result<()> {
    console.print(&preset_lines(terminal::width()).join("\n"))
}

/// Names and what they stand for, side by side in so many columns.
fn preset_lines(width: Option<usize>) -> Vec<String> {
    /// Columns of the names.
    const NAMES: usize = 21;
    let of_preset = |preset: &Preset| -> Vec<String> {
        let summary = match width {
            Some(width) => terminal::wrapped(preset.summary, width.saturating_sub(NAMES).max(NAMES), 0),
            None => vec![preset.summary.to_owned()],
        };
        let name = |line: usize| if line == 0 { preset.name } else { "" };
        summary.iter().enumerate().map(|(line, text)| format!("{:<NAMES$}{text}", name(line))).collect()
    };
    presets::PRESETS.iter().flat_map(of_preset).collect()
}

/// The preset, or [`presets::DEFAULT`] where there is none, then file, then `--set`, then a constant `--env`, which a probe file so carries to `render`.
pub fn resolve_config(args: &ConfigArgs, trace: &TraceArgs) -> Result<Config> {
    let mut layers = Layers::of(args.preset.as_deref())?;
    if let Some(path) = &args.config {
        layers = layers.file(path)?;
    }
    let mut config = layers.set(&args.set)?.config()?;
    check_sky_flags(trace, config.lights.sky)?;
    set_sky(&mut config, trace);
    Ok(config)
}

/// `--env-rotate` and `--env-scale` change the sky of `--env`. Others are used as they are: a probe file's is scaled
/// already.
fn check_sky_flags(trace: &TraceArgs, sky: Option<(f32, f32, f32)>) -> Result<()> {
    let flag = match trace {
        TraceArgs { env: Some(EnvironmentSource::Constant(sky)), env_scale, .. } => {
            let is_bounded = (*sky * *env_scale).max_element() <= LIGHT_MAX;
            ensure!(
                is_bounded,
                "--env-scale {env_scale:?}: the sky is brighter than {LIGHT_MAX:e} then; give a smaller one"
            );
            return Ok(());
        }
        TraceArgs { env: Some(_), .. } => return Ok(()),
        TraceArgs { env_rotate, .. } if *env_rotate != 0.0 => "--env-rotate",
        TraceArgs { env_scale, .. } if *env_scale != 1.0 => "--env-scale",
        _ => return Ok(()),
    };
    match sky {
        None => bail!("{flag} changes the sky that --env gives, and there is no --env; give one, or leave {flag} out"),
        Some((r, g, b)) => bail!(
            "{flag} changes the sky that --env gives, and the sky is lights.sky of the configuration or the probe file, \
             which is used as it is; give it as --env {r:?},{g:?},{b:?} too, or leave {flag} out"
        ),
    }
}

/// Whether the scene is another than the probes were baked from; an error unless allowed.
fn check_scene(
    probes: Probes,
    scene_path: &Path,
    scene: &Scene,
    lost_sky: Option<&str>,
    console: &Console,
) -> Result<bool> {
    let Probes { path, scene: baked, allow_change, .. } = probes;
    if baked.blake3 == scene.blake3 {
        return Ok(false);
    }
    let (path, scene_path) = (path.display(), scene_path.display());
    let what = match lost_sky {
        Some(map) => format!("{path} was baked under {map}, and there is no --env"),
        None => {
            format!("{path} was baked from another scene than {scene_path} now is (its files or its sky have changed)")
        }
    };
    if allow_change {
        console.warn(what);
        return Ok(true);
    }
    let bake_again = if lost_sky.is_some() { "" } else { "bake it again, " };
    bail!("{what}; {bake_again}give the --env, --env-rotate and --env-scale of the bake, or pass --allow-scene-change")
}

/// A constant `--env` in place of the configured sky.
pub fn set_sky(config: &mut Config, trace: &TraceArgs) {
    match &trace.env {
        Some(EnvironmentSource::Constant(sky)) => config.lights.sky = Some((*sky * trace.env_scale).into()),
        // A map replaces the configured sky; its path has no place in the file.
        Some(EnvironmentSource::Map { .. }) => config.lights.sky = None,
        None => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_stand_in_columns_of_any_terminal() {
        let names: Vec<&str> = presets::PRESETS.iter().map(|preset| preset.name).collect();
        for width in [None, Some(40), Some(80), Some(200)] {
            let lines = preset_lines(width);
            let firsts: Vec<&str> =
                lines.iter().filter_map(|line| line.split(' ').next()).filter(|n| !n.is_empty()).collect();
            assert_eq!(firsts, names, "{width:?}");
            assert!(width.is_none_or(|width| lines.iter().all(|line| line.chars().count() <= width)), "{lines:?}");
        }
    }
}

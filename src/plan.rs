//! What a bake computes for this scene, and what it leaves out because the scene does not need it.
//!
//! Every line says what, why, and what it saved. Leaving out never changes the result: `plan: keep_everything` computes
//! and stores all of it, and a test compares.

use serde::Serialize;
use serde_json::Value;

use crate::config::{Config, VISIBILITY};
use crate::light::World;
use crate::probe::Grid;
use crate::probe::lattice::ProbeState;
use crate::probe::place::Placement;
use crate::probe::transport::Transport;
use crate::scene::{AlphaMode, Environment, MaterialIndex, Scene};

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Line {
    pub stage: &'static str,
    pub kept: bool,
    pub reason: String,
    /// Of the probe file or, for images and captures, of memory; `null` where not known.
    pub saved_bytes: Option<u64>,
    /// What as much of it as was done took, for as much as was left out; `null` where none was done.
    pub saved_s: Option<f64>,
}

/// What was seen of a grid and its probes.
#[derive(Debug, Clone, PartialEq)]
pub struct Looked {
    /// Cells that were looked at, and all of them; `None`: all.
    pub cells: Option<(usize, usize)>,
    pub unsampled: usize,
    pub inside: usize,
    /// Whether some surface does not see some probe around it.
    pub blocked: bool,
    /// Of what the method knows about occlusion, of all probes.
    pub occlusion_bytes: f64,
}

impl Looked {
    /// All that placement and the survey of the surfaces found.
    pub fn at(config: &Config, grid: &Grid, placement: &Placement) -> Looked {
        let survey = placement.survey.as_ref();
        Looked {
            cells: None,
            unsampled: placement.count(ProbeState::NeverSampled),
            inside: placement.count(ProbeState::InsideGeometry),
            blocked: survey.is_none_or(|survey| !survey.all_visible(grid, &placement.states)),
            occlusion_bytes: occlusion_bytes(config, placement),
        }
    }

    /// What a reason says after what all cells were not looked at for.
    fn as_far_as(&self) -> String {
        self.cells.map_or_else(String::new, |(cells, all)| format!(", as far as {cells} of {all} cells tell"))
    }
}

/// Bytes of what the method knows about occlusion, of all probes.
pub fn occlusion_bytes(config: &Config, placement: &Placement) -> f64 {
    let (store, probes) = (&config.store, placement.states.len());
    let per_probe = store.occlusion.runtime_bytes(store.border, placement.regions.as_ref(), probes, &store.layout);
    per_probe * probes as f64
}

/// What an active probe took in the mean, and how many others there are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PerProbe {
    pub left_out: usize,
    /// Of capture, bounces and fit.
    pub seconds: f64,
    pub capture_bytes: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub lines: Vec<Line>,
    /// Whether the visibility factor can differ from 1 for any surface.
    pub visibility: bool,
    /// Whether levels of radiance for glossy surfaces are stored.
    pub radiance_levels: bool,
}

/// The stage of probes that are not baked.
const UNUSED_PROBES: &str = "unused_probes";

/// The stage of images.
const TEXTURES: &str = "textures";

/// The stage whose line is added last.
const BOUNCES: &str = "bounces";

/// The name of a line's stage for people: of bounces, those are left out that would come after the last.
pub fn stage_in_words(stage: &str, kept: bool) -> &str {
    if stage == BOUNCES && !kept { "further iterations" } else { stage }
}

impl Plan {
    /// Decides from the scene, the configuration and what was seen of the grid.
    pub fn of(world: &World, config: &Config, grid: &Grid, looked: &Looked) -> Plan {
        let scene = world.scene;
        let mut lines = vec![
            punctual(scene),
            emission(world),
            sky(scene),
            alpha(scene),
            textures(scene),
            glossy(scene, config, grid.probe_count()),
            unsampled(config, looked),
        ];
        // The survey knows nothing of surfaces beyond the probes' hull.
        let blocked = looked.blocked || !grid.covers(&scene.mesh);
        let wanted = config.plan.keep.iter().any(|stage| stage == VISIBILITY);
        let visibility = (blocked || wanted) && !config.store.occlusion.is_none();
        lines.push(visibility_line(config, looked, visibility, blocked));
        for line in lines.iter_mut().filter(|l| !l.kept && config.plan.keeps(l.stage)) {
            line.reason = format!("kept by configuration; {}", line.reason);
            (line.kept, line.saved_bytes, line.saved_s) = (true, None, None);
        }
        let radiance_levels = lines.iter().any(|l| l.stage == RADIANCE_LEVELS && l.kept);
        Plan { lines, visibility, radiance_levels }
    }

    /// Says what was saved: of probes that were left out what as many others took, of images their bytes. Files say none of it:
    /// that memory and time are those of a run.
    pub fn measure(&mut self, scene: &Scene, probes: &PerProbe) {
        for line in &mut self.lines {
            let left_out = probes.left_out as f64;
            match line.stage {
                UNUSED_PROBES if !line.kept => {
                    line.saved_s = Some(probes.seconds * left_out);
                    line.saved_bytes = Some((probes.capture_bytes * left_out).round() as u64);
                }
                TEXTURES if scene.collapsed_bytes > 0 => line.saved_bytes = Some(scene.collapsed_bytes),
                _ => {}
            }
        }
    }

    /// Adds the line about bounces, known only afterwards: `done` iterations in `bounces_s` seconds.
    pub fn add_bounces(&mut self, done: u32, transport: &Transport, converged: bool, bounces_s: f64) {
        let limit = transport.max_bounces();
        let saved = limit.map_or(0, |most| most.saturating_sub(done));
        let per_bounce = bounces_s / f64::from(done.max(1));
        let reason = match limit {
            _ if transport.is_complete() => "every captured hit holds all light already".to_owned(),
            _ if converged => transport.settled_words(done),
            Some(most) => format!("all {most} bounces that were asked for; the tolerance was not reached"),
            None => format!("all {done} iterations; the tolerance was not reached"),
        };
        let saved_s = (converged && saved > 0).then_some(per_bounce * f64::from(saved));
        self.lines.push(Line { stage: BOUNCES, kept: !converged, reason, saved_bytes: None, saved_s });
    }
}

fn line(stage: &'static str, kept: bool, reason: impl Into<String>) -> Line {
    Line { stage, kept, reason: reason.into(), saved_bytes: None, saved_s: None }
}

fn punctual(scene: &Scene) -> Line {
    match scene.lights.len() {
        0 => line("punctual_shadow_rays", false, "the scene has no punctual light"),
        n => line("punctual_shadow_rays", true, format!("{n} punctual light(s)")),
    }
}

fn emission(world: &World) -> Line {
    match world.emitters.triangle_count() {
        0 => line("emissive_surfaces", false, "no surface emits"),
        n => line("emissive_surfaces", true, format!("{n} emissive triangle(s)")),
    }
}

/// What the line about a sky begins with that is a map.
const MAP: &str = "an environment map";

/// The environment map that a bake had, in words, by the plan that its file holds; `None` where it had none or does not
/// say.
pub fn environment_map(plan: &Value) -> Option<&str> {
    let sky = plan["lines"].as_array()?.iter().find(|line| line["stage"] == "sky")?;
    sky["reason"].as_str().filter(|reason| reason.starts_with(MAP))
}

fn sky(scene: &Scene) -> Line {
    match &scene.environment {
        environment if environment.is_black() => line("sky", false, "there is no sky"),
        Environment::Map(map) => line("sky", true, format!("{MAP} of {}×{}", map.width, map.height)),
        _ => line("sky", true, "a constant sky"),
    }
}

fn alpha(scene: &Scene) -> Line {
    let needs_test = |t: &&MaterialIndex| scene.materials[t.0 as usize].alpha_mode != AlphaMode::Opaque;
    let tested = scene.mesh.materials.iter().filter(needs_test).count();
    let blended = scene.materials.iter().filter(|m| m.alpha_mode == AlphaMode::Blend).count();
    match tested {
        0 => line("alpha_test", false, "every surface is opaque"),
        n => line("alpha_test", true, format!("{n} triangle(s) with an alpha test, {blended} blended material(s)")),
    }
}

fn textures(scene: &Scene) -> Line {
    let constant = scene.textures.iter().filter(|t| t.width == 1 && t.height == 1).count();
    let fetched = scene.textures.len() - constant;
    let collapsed = match constant {
        0 => String::new(),
        n => format!(", {n} constant one(s) reduced to one texel"),
    };
    match fetched {
        0 => line(TEXTURES, false, format!("no texture that varies{collapsed}")),
        n => line(TEXTURES, true, format!("{n} texture(s){collapsed}")),
    }
}

/// The stage of levels of radiance for glossy surfaces.
const RADIANCE_LEVELS: &str = "radiance_levels";

/// Materials of a scene that reflect more at some angles than at others.
pub fn glossy_materials(scene: &Scene) -> usize {
    scene.materials.iter().filter(|m| !m.unlit && (m.metallic > 0.0 || m.roughness < 1.0)).count()
}

fn glossy(scene: &Scene, config: &Config, probes: usize) -> Line {
    let levels = config.store.prefiltered.len();
    match glossy_materials(scene) {
        0 if levels == 0 => line(RADIANCE_LEVELS, false, "no glossy material"),
        0 => {
            let (_, per_probe) = config.store.radiance().runtime_bytes(0, false);
            Line {
                saved_bytes: Some((per_probe * probes) as u64),
                ..line(RADIANCE_LEVELS, false, "no glossy material")
            }
        }
        n if levels == 0 && config.query.glossy.is_none() => {
            let reason = format!("{n} glossy material(s), but the method stores irradiance only");
            line(RADIANCE_LEVELS, false, reason)
        }
        n if levels == 0 => {
            line(RADIANCE_LEVELS, true, format!("{n} glossy material(s), shaded from the probes' light fields"))
        }
        n => line(RADIANCE_LEVELS, true, format!("{n} glossy material(s), {levels} level(s)")),
    }
}

fn unsampled(config: &Config, looked: &Looked) -> Line {
    let Looked { unsampled, inside, .. } = *looked;
    let about = looked.as_far_as();
    let reason = format!("{unsampled} probe(s) that no surface can sample, {inside} inside geometry{about}");
    line(UNUSED_PROBES, unsampled + inside == 0 || config.placement.keep_unsampled && inside == 0, reason)
}

fn visibility_line(config: &Config, looked: &Looked, kept: bool, blocked: bool) -> Line {
    const ALL_SEE: &str = "every surface sees all probes around it";
    match () {
        _ if config.store.occlusion.is_none() => line(VISIBILITY, false, "the method has none"),
        _ if blocked => line(VISIBILITY, true, "some surfaces do not see all probes around them"),
        _ if kept => line(VISIBILITY, true, format!("kept by configuration; {ALL_SEE}")),
        _ => {
            let saved_bytes = Some(looked.occlusion_bytes.round() as u64);
            Line { saved_bytes, ..line(VISIBILITY, false, format!("{ALL_SEE}{}", looked.as_far_as())) }
        }
    }
}

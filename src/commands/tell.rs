//! What `--verbose` says, one line each.

use std::path::Path;

use super::Console;
use crate::bake::{Baked, Prepared};
use crate::cli::{ConfigArgs, PictureSize};
use crate::config::presets;
use crate::light::sampled::RayCount;
use crate::plan::{Line, stage_in_words};
use crate::probe::file::ProbeFile;
use crate::probe::lattice::ProbeState;
use crate::report::render::RenderReport;
use crate::scene::Scene;
use crate::scene::light::LIGHT_MAX;
use crate::system::format;

/// Where the configuration in effect comes from.
pub fn configuration(console: &Console, args: &ConfigArgs) {
    let preset = format!("preset {}", args.preset.as_deref().unwrap_or(presets::DEFAULT));
    let file = args.config.iter().map(|path| path.display().to_string());
    let sets = args.set.iter().map(|set| format!("--set {set}"));
    let text = [preset].into_iter().chain(file).chain(sets).collect::<Vec<_>>().join(", ");
    console.say(format!("configuration: {text}"));
}

pub fn scene(console: &Console, path: &Path, scene: &Scene, load_s: f64) {
    let counted = |number: usize, one, many| format::counted(number as u64, one, many);
    console.say(format!(
        "scene: {}, {}, {}, {}, {}, loaded in {}",
        path.display(),
        counted(scene.mesh.triangles.len(), "triangle", "triangles"),
        counted(scene.lights.len(), "punctual light", "punctual lights"),
        counted(scene.cameras.len(), "camera", "cameras"),
        counted(scene.files.len(), "file", "files"),
        format::seconds(load_s),
    ));
}

/// Warns of light that was clamped; `what` is one such thing and several.
pub fn too_bright(console: &Console, number: u64, what: [&str; 2]) {
    if number > 0 {
        console.warn(format!(
            "{} brighter than {LIGHT_MAX:e} and clamped to that; lower the intensities, or set lights.punctual_scale",
            format::counted(number, &format!("{} is", what[0]), &format!("{} are", what[1]))
        ));
    }
}

/// Warns of samples of a reference that are no numbers.
pub fn not_finite(console: &Console, number: u64) {
    if number > 0 {
        let samples = format::counted(number, "sample of the reference was", "samples of the reference were");
        console.warn(format!("{samples} not finite: counted as 0"));
    }
}

/// Warns of a scene without any light.
pub fn darkness(console: &Console, path: &Path, scene: &Scene) {
    if scene.is_dark() {
        console
            .warn(format!("{}: nothing in the scene sends out light; give it a sky with --env 1,1,1", path.display()));
    }
}

/// Warns of metal, which is black where all surfaces are Lambertian.
pub fn metal(console: &Console, path: &Path, scene: &Scene) {
    /// Shares that are printed as 0 % are of no use.
    const LEAST: f64 = 0.005;
    let share = scene.metal_share();
    if share < LEAST {
        return;
    }
    let all = if share > 1.0 - LEAST { "all".to_owned() } else { format!("{:.0} %", 100.0 * share) };
    console.warn(format!(
        "{}: {all} of the surface area is metal, which reflects no diffuse light and bakes black; give its materials a lower \
         metallicFactor (it is 1 where a material names none), or see the metal with `reference --transport gltf`",
        path.display()
    ));
}

pub fn accel(console: &Console, seconds: f64) {
    console.say(format!("acceleration structure: built in {}", format::seconds(seconds)));
}

pub fn prepared(console: &Console, prepared: &Prepared) {
    let grid = &prepared.grid;
    let (spacing, origin) = (grid.spacing(), grid.origin_world());
    console.say(format!("grid: {}, spacing {spacing} m, origin {origin} m", grid.describe()));
    let placement = &prepared.placement;
    let count = |state| placement.count(state);
    console.say(format!(
        "placement: {} probes active, {} inside geometry, {} never sampled, {} moved; with the survey {} rays in {}",
        count(ProbeState::Active),
        count(ProbeState::InsideGeometry),
        count(ProbeState::NeverSampled),
        placement.relocated,
        placement.rays,
        format::seconds(prepared.survey_s),
    ));
    prepared.plan.lines.iter().for_each(|line| plan_line(console, line));
}

pub fn plan_line(console: &Console, line: &Line) {
    let kept = if line.kept { "kept" } else { "left out" };
    console.say(format!("plan: {} {kept}: {}", stage_in_words(line.stage, line.kept), line.reason));
}

pub fn baked(console: &Console, baked: &Baked) {
    let times = &baked.times;
    console.say(format!(
        "capture: {} primary and {} shadow rays in {}",
        baked.rays.primary,
        baked.rays.shadow,
        format::seconds(times.capture)
    ));
    console.say(format!(
        "bounces: {} in {}, {}",
        format::counted(baked.solution.bounces.len() as u64, "iteration", "iterations"),
        format::seconds(times.bounces),
        if baked.solution.converged { "converged" } else { "not converged" }
    ));
    console.say(format!("encoding: {}", format::seconds(times.encode)));
    // The lines before were said before the work.
    baked.plan.lines.iter().filter(|line| line.stage == "bounces").for_each(|line| plan_line(console, line));
}

pub fn probes(console: &Console, path: &Path, file: &ProbeFile) {
    let [x, y, z] = file.volume_in_grid().grid.divisions().to_array();
    console.say(format!(
        "probes: {}, {}, {x} × {y} × {z}, {} active, all hashes match",
        path.display(),
        format::bytes(file.file_bytes),
        file.volume_in_grid().active_count(),
    ));
}

pub fn rendered(console: &Console, report: &RenderReport) {
    console.say(format!(
        "camera {}: {} points in {}×{} pixels, primary rays in {}, exposure {:+.2} EV",
        report.camera,
        report.points,
        report.width,
        report.height,
        format::seconds(report.time_s.primary),
        report.exposure_ev,
    ));
    for method in &report.methods {
        console.say(format!(
            "{}: shading {}, rays {}",
            method.name,
            format::seconds(method.shade_ms.median / 1e3),
            format::seconds(method.ray_ms / 1e3),
        ));
    }
}

pub fn reference_begins(console: &Console, camera: &str, size: PictureSize, spp: u32, spp_resumed: u32) {
    let PictureSize { width, height } = size;
    console.say(format!(
        "camera {camera}: {width}×{height} pixels, {spp} samples each, {spp_resumed} of them there already"
    ));
}

/// `rays` are those of all samples, resumed ones too.
pub fn traced(console: &Console, spp: u32, rays: RayCount, seconds: f64) {
    console.say(format!(
        "reference: {spp} samples per pixel, in all {} primary and {} shadow rays, traced in {}",
        rays.primary,
        rays.shadow,
        format::seconds(seconds),
    ));
}

/// The file's probes, lit by full paths.
pub fn truth(console: &Console, paths_per_hit: u64, seconds: f64) {
    console
        .say(format!("probes by full paths: {paths_per_hit} from every hit, traced in {}", format::seconds(seconds)));
}

pub fn written(console: &Console, path: &Path) {
    let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
    console.say(format!("wrote {}, {}", path.display(), format::bytes(bytes)));
}

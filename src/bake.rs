//! The bake: grid → placement → survey → plan → capture → bounces → filter → encode.
//!
//! `bake` runs it once; whatever compares configurations runs it many times on one [`World`].

use std::path::PathBuf;
use std::time::{Duration, Instant};

use glam::Vec2;
use rayon::prelude::*;

use crate::config::{Config, PlanMode};
use crate::light::World;
use crate::plan::Plan;
use crate::probe::capture::{Capture, EmissionTransport, ProbeCapture};
use crate::probe::checkpoint;
use crate::probe::container::{Container, FileError};
use crate::probe::file::{self, EncodingLosses, SceneRecord};
use crate::probe::filter::Kernel;
use crate::probe::grid::GridError;
use crate::probe::map::{OctahedralMaps, fill_with_border};
use crate::probe::need;
use crate::probe::placement::{Placement, ProbeState, Settler, place};
use crate::probe::query::VisibilitySettings;
use crate::probe::solver::{Captures, Solution, Solver};
use crate::probe::surface_visibility::SurfaceVisibility;
use crate::probe::{Grid, Volume};
use crate::progress::Progress;
use crate::report::bake::{Numerics, Rays, Times};
use crate::scene::Mesh;

/// Hits this far outside the hull of the probes, in spacings, still count as inside: rounding of the bounds.
const HULL_TOLERANCE: f32 = 1e-3;

/// Voxels per cell at which the survey decides whether moments are needed at all.
const SURVEY_VOXELS: u32 = 4;

/// Probes whose rays are logged at a time for the bare replay; bounds the log's memory.
const REPLAY_CHUNK: usize = 256;

/// One bake's circumstances that are not part of the method.
#[derive(Debug, Clone)]
pub struct Circumstances {
    pub seed: u64,
    /// Most bytes of captures kept in memory; the rest is traced again for every bounce, with the same result.
    pub memory_budget_bytes: Option<u64>,
    pub progress: Progress,
    /// Where sweeps are saved while a long bake runs, and whether to go on from there.
    pub checkpoint: Option<Checkpoint>,
}

#[derive(Debug, Clone)]
pub struct Checkpoint {
    pub path: PathBuf,
    pub resume: bool,
    /// Least time between two checkpoints.
    pub interval: Duration,
}

impl Checkpoint {
    /// Short bakes write none.
    pub const INTERVAL: Duration = Duration::from_secs(10);
}

/// Everything decided before tracing the captures.
pub struct Prepared<'w, 's> {
    pub world: &'w World<'s>,
    pub config: &'w Config,
    pub grid: Grid,
    pub placement: Placement,
    pub surface: Option<SurfaceVisibility>,
    pub plan: Plan,
    pub survey_rays: u64,
    pub survey_s: f64,
    /// Hull of the probes relative to the scene's origin, a little enlarged.
    hull: (glam::Vec3, glam::Vec3),
}

/// A finished bake.
pub struct Baked {
    pub volume: Volume,
    pub container: Container,
    pub losses: EncodingLosses,
    pub solution: Solution,
    pub plan: Plan,
    pub rays: Rays,
    pub times: Times,
    pub numerics: Numerics,
    pub surface_bytes: u64,
}

/// Places the probes, surveys the surfaces and makes the plan.
pub fn prepare<'w, 's>(
    world: &'w World<'s>,
    config: &'w Config,
    circumstances: &Circumstances,
) -> Result<Prepared<'w, 's>, GridError> {
    let started = Instant::now();
    let grid = Grid::new(&config.grid, world.scene)?;
    let mut placement_settings = config.placement.clone();
    placement_settings.keep_unsampled |= config.plan == PlanMode::KeepEverything;
    let bar = circumstances.progress.stage("placing", 1);
    let mut placement = place(world, &grid, &placement_settings, config.query.reach());
    bar.set_prefix("surveying");
    let mut survey_rays = placement.rays;
    let voxels = match config.query.visibility {
        VisibilitySettings::None => None,
        VisibilitySettings::Moments { .. } => Some(SURVEY_VOXELS),
        VisibilitySettings::Surface { voxels_per_cell } => Some(voxels_per_cell),
    };
    let mut survey = |placement: &Placement| {
        voxels.map(|voxels| {
            let (states, positions) = (&placement.states, &placement.positions);
            let seed = circumstances.seed;
            let measured =
                SurfaceVisibility::measure(world.scene, &world.tracer, &grid, states, positions, voxels, seed);
            survey_rays += measured.rays;
            measured
        })
    };
    let mut surface = survey(&placement);
    if let Some(measured) = &surface {
        let settler = Settler { world, settings: &placement_settings, spacing_m: grid.spacing.min_element() };
        if placement_settings.relocate && need::relocate(&settler, &grid, &mut placement, measured) > 0 {
            surface = survey(&placement);
        }
    }
    let mut surface = surface.map(|measured| measured.table);
    if let (Some(table), VisibilitySettings::Surface { .. }) = (&mut surface, config.query.visibility) {
        table.far = need::far_probes(&world.tracer, &grid, &placement, table);
    }
    // Only where shading asks this very table does a probe that no surface sees weigh nothing.
    if let (Some(table), VisibilitySettings::Surface { .. }) = (&surface, config.query.visibility)
        && !placement_settings.keep_unsampled
    {
        retire_unseen(&world.scene.mesh, &grid, &mut placement, table);
    }
    bar.finish_and_clear();
    let plan = Plan::new(world, config, &grid, &placement, surface.as_ref());
    let survey_s = started.elapsed().as_secs_f64();
    let hull = grid.hull(HULL_TOLERANCE);
    Ok(Prepared { world, config, grid, placement, surface, plan, survey_rays, survey_s, hull })
}

/// Active probes that no surface sees are not worth baking.
fn retire_unseen(mesh: &Mesh, grid: &Grid, placement: &mut Placement, table: &SurfaceVisibility) {
    let mut seen = need::seen_probes(mesh, grid, placement, table, |_| true);
    table.far.iter().for_each(|&(_, probe)| seen[probe as usize] = true);
    for (state, seen) in placement.states.iter_mut().zip(seen) {
        if *state == ProbeState::Active && !seen {
            *state = ProbeState::NeverSampled;
        }
    }
}

/// Captures in memory as far as the budget goes; the others are traced again whenever they are asked for.
struct Budgeted<'p, F> {
    stored: Vec<Option<ProbeCapture>>,
    trace: &'p F,
}

impl<F: Fn(usize) -> ProbeCapture + Sync> Captures for Budgeted<'_, F> {
    fn with<R>(&self, probe: usize, visit: impl FnOnce(&ProbeCapture) -> R) -> R {
        match &self.stored[probe] {
            Some(capture) => visit(capture),
            None => visit(&(self.trace)(probe)),
        }
    }
}

impl Prepared<'_, '_> {
    fn capture<'a>(&'a self, circumstances: &Circumstances) -> Capture<'a, 'a> {
        Capture {
            world: self.world,
            settings: &self.config.capture,
            distance_clamp_m: self
                .wants_distance()
                .then(|| self.config.filter.distance_clamp * self.grid.spacing.length()),
            emitter_coverage: self.placement.emitter_coverage,
            seed: circumstances.seed,
        }
    }

    fn active(&self) -> Vec<usize> {
        let states = &self.placement.states;
        (0..states.len()).filter(|&p| states[p] == ProbeState::Active).collect()
    }

    /// Traces one active probe.
    fn trace(&self, capture: &Capture, probe: usize) -> ProbeCapture {
        let position = self.placement.positions[probe];
        let (low, high) = self.hull;
        capture.probe(probe, position, |p| p.cmpge(low).all() && p.cmple(high).all())
    }

    /// Rays per second of bare Embree over the rays of the capture, in its order.
    pub fn raw_rays_per_s(&self, circumstances: &Circumstances) -> Option<f64> {
        let capture = self.capture(circumstances);
        let active = self.active();
        let bar = circumstances.progress.stage("raw rays", active.len());
        let (mut rays, mut seconds) = (0usize, 0.0);
        for chunk in active.chunks(REPLAY_CHUNK) {
            self.world.tracer.set_recording(true);
            let record = |&probe: &usize| self.world.tracer.record(|| drop(self.trace(&capture, probe)));
            let logs: Vec<_> = chunk.par_iter().map(record).collect();
            self.world.tracer.set_recording(false);
            let started = Instant::now();
            logs.par_iter().for_each(|log| self.world.tracer.replay(log));
            seconds += started.elapsed().as_secs_f64();
            rays += logs.iter().map(|l| l.len()).sum::<usize>();
            bar.inc(chunk.len() as u64);
        }
        bar.finish_and_clear();
        (seconds > 0.0).then(|| rays as f64 / seconds)
    }

    /// Time and memory that the bake would take, from a few probes; seconds and bytes.
    pub fn predict(&self, circumstances: &Circumstances) -> (f64, u64) {
        /// Probes traced to predict.
        const PILOT: usize = 32;
        let capture = self.capture(circumstances);
        let active = self.active();
        let pilot: Vec<usize> = active.iter().copied().step_by(active.len().div_ceil(PILOT).max(1)).collect();
        let started = Instant::now();
        let traced: Vec<ProbeCapture> = pilot.par_iter().map(|&p| self.trace(&capture, p)).collect();
        let share = active.len() as f64 / pilot.len().max(1) as f64;
        let bytes = traced.iter().map(ProbeCapture::bytes).sum::<u64>() as f64 * share;
        let budget = circumstances.memory_budget_bytes.unwrap_or(u64::MAX);
        (self.survey_s + started.elapsed().as_secs_f64() * share, (bytes as u64).min(budget))
    }

    /// Runs the rest of the pipeline. `load` and `accel_build` times are the caller's to fill.
    pub fn bake(mut self, circumstances: &Circumstances, scene: &SceneRecord) -> Result<Baked, FileError> {
        let config = self.config;
        let (filter, encoding) = (&config.filter, &config.encoding);
        let probes = self.grid.probe_count();
        let mut times = Times { survey: self.survey_s, ..Default::default() };
        let mut numerics = Numerics {
            probes_inside_geometry: count(&self.placement, ProbeState::InsideGeometry),
            dropped_triangles: self.world.scene.dropped.total(),
            albedo_clamped: self.world.clamped_materials(),
            ..Default::default()
        };
        let mut rays = Rays { survey: self.survey_rays, ..Default::default() };

        let started = Instant::now();
        let capture = self.capture(circumstances);
        let trace = |probe: usize| self.trace(&capture, probe);
        let (captures, distance) =
            self.trace_all(&trace, circumstances, self.distance_kernel().as_ref(), &mut rays, &mut numerics);
        times.capture = started.elapsed().as_secs_f64();

        let started = Instant::now();
        let is_surface = matches!(config.query.visibility, VisibilitySettings::Surface { .. });
        let surface_bytes = self.surface.as_ref().filter(|_| is_surface).map_or(0, SurfaceVisibility::bytes);
        let mut volume = Volume {
            positions: self.placement.positions.clone(),
            states: self.placement.states.clone(),
            irradiance: OctahedralMaps::new(probes, filter.irradiance_resolution, encoding.border, glam::Vec3A::ZERO),
            curve: encoding.curve,
            distance: distance.clone().filter(|_| self.plan.visibility),
            surface_visibility: self.surface.clone().filter(|_| is_surface && self.plan.visibility),
            grid: self.grid.clone(),
        };
        let kernel = Kernel::cosine(config.capture.resolution, filter.irradiance_resolution);
        times.filter += started.elapsed().as_secs_f64();

        let started = Instant::now();
        let bar = circumstances.progress.stage("bounces", config.solver.max_bounces as usize);
        let solver = Solver {
            captures: &captures,
            kernel: &kernel,
            query: &config.query,
            settings: &config.solver,
            gathers_emission: config.capture.emission == EmissionTransport::Gathered,
        };
        let identity = format!("{} seed {} {}", scene.blake3, circumstances.seed, config.to_ron());
        let mut progress = Solution::default();
        if let Some(Checkpoint { path, resume: true, .. }) = &circumstances.checkpoint
            && path.exists()
        {
            progress = checkpoint::read(path, &identity, &mut volume)?;
        }
        let mut saved = Ok(());
        let mut last_saved = Instant::now();
        let solution = solver.solve(&mut volume, progress, |progress, volume| {
            bar.set_position(progress.bounces.len() as u64);
            let residual = progress.bounces.last().map_or(0.0, |b| b.residual);
            bar.set_message(format!("residual {residual:.1e}"));
            if let Some(Checkpoint { path, interval, .. }) = &circumstances.checkpoint
                && last_saved.elapsed() >= *interval
                && saved.is_ok()
            {
                saved = checkpoint::write(path, &identity, progress, volume);
                last_saved = Instant::now();
            }
        });
        bar.finish_and_clear();
        saved?;
        times.bounces = started.elapsed().as_secs_f64();
        numerics.non_finite += solution.non_finite;
        let done = solution.bounces.len().saturating_sub(1) as u32;
        let mut plan = self.plan.clone();
        plan.add_bounces(done, config.solver.max_bounces, solution.converged, times.bounces);

        let started = Instant::now();
        if config.plan == PlanMode::KeepEverything {
            volume.distance = distance;
            volume.surface_visibility = self.surface.take().filter(|_| is_surface);
        }
        // Times stay out of the file: the same input must give the same bytes.
        let record: Vec<_> = plan.lines.iter().map(|l| crate::plan::Line { saved_s: None, ..l.clone() }).collect();
        let record = serde_json::json!({ "visibility": plan.visibility, "lines": record });
        let (container, losses) = file::encode(&volume, encoding, &config.to_ron(), scene, &record);
        times.encode = started.elapsed().as_secs_f64();
        numerics.clamped = losses.clamped.clone();
        numerics.variance_floor_hits = losses.variance_floor_hits;
        Ok(Baked { volume, container, losses, solution, plan, rays, times, numerics, surface_bytes })
    }

    /// Whether the method has distance maps and the plan or the configuration keeps them.
    fn wants_distance(&self) -> bool {
        matches!(self.config.query.visibility, VisibilitySettings::Moments { .. })
            && (self.plan.visibility || self.config.plan == PlanMode::KeepEverything)
    }

    /// The filter of the distance maps, where there are any.
    fn distance_kernel(&self) -> Option<Kernel> {
        let config = self.config;
        self.wants_distance().then(|| {
            Kernel::lobe(config.capture.resolution, config.filter.distance_resolution, config.filter.distance_exponent)
        })
    }

    /// Captures every active probe; filters distances on the way, as their texels are not kept.
    fn trace_all<'p, F: Fn(usize) -> ProbeCapture + Sync>(
        &self,
        trace: &'p F,
        circumstances: &Circumstances,
        kernel: Option<&Kernel>,
        rays: &mut Rays,
        numerics: &mut Numerics,
    ) -> (Budgeted<'p, F>, Option<OctahedralMaps<Vec2>>) {
        let (filter, border) = (&self.config.filter, self.config.encoding.border);
        let probes = self.grid.probe_count();
        let active = self.active();
        let bar = circumstances.progress.stage("capturing", active.len());
        let mut stored: Vec<Option<ProbeCapture>> = (0..probes).map(|_| None).collect();
        let mut distance = kernel.map(|_| OctahedralMaps::new(probes, filter.distance_resolution, border, Vec2::ZERO));
        let mut bytes = 0;
        for chunk in active.chunks(REPLAY_CHUNK) {
            let traced: Vec<(ProbeCapture, Option<Vec<Vec2>>)> = chunk
                .par_iter()
                .map(|&probe| {
                    let mut capture = trace(probe);
                    let distances = kernel.map(|kernel| {
                        let moments = kernel.distance(&capture.distances);
                        moments.iter().map(|m| Vec2::new(m.mean() as f32, m.variance().sqrt() as f32)).collect()
                    });
                    capture.distances = Vec::new();
                    bar.inc(1);
                    (capture, distances)
                })
                .collect();
            for (&probe, (capture, distances)) in chunk.iter().zip(traced) {
                rays.primary += capture.rays.primary;
                rays.shadow += capture.rays.shadow;
                numerics.hits_outside_volume += capture.hits_outside_volume;
                numerics.non_finite += capture.non_finite;
                if let (Some(maps), Some(interior)) = (&mut distance, distances) {
                    fill_with_border(&interior, filter.distance_resolution, border, maps.probe_mut(probe));
                }
                bytes += capture.bytes();
                if circumstances.memory_budget_bytes.is_none_or(|budget| bytes <= budget) {
                    stored[probe] = Some(capture);
                }
            }
        }
        bar.finish_and_clear();
        (Budgeted { stored, trace }, distance)
    }
}

fn count(placement: &Placement, state: ProbeState) -> usize {
    placement.states.iter().filter(|&&s| s == state).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{self, LoadOptions};

    /// Bakes the open rooms coarsely.
    fn bake(checkpoint: Option<Checkpoint>, max_bounces: u32) -> Baked {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/two_rooms_open.glb");
        let scene = scene::load(&path, &LoadOptions::default()).unwrap();
        let set = ["grid.spacing_m=2".to_owned(), format!("solver.max_bounces={max_bounces}")];
        let config = Config::default().with_overrides(&set).unwrap();
        let world = World::new(&scene, config.lights.punctual_scale, config.solver.albedo_max).unwrap();
        let circumstances =
            Circumstances { seed: 1, memory_budget_bytes: None, progress: Progress::hidden(), checkpoint };
        let record = SceneRecord { name: scene.name.clone(), blake3: scene.blake3.clone() };
        prepare(&world, &config, &circumstances).unwrap().bake(&circumstances, &record).unwrap()
    }

    #[test]
    fn a_resumed_bake_gives_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.resume");
        let checkpoint = |resume| Checkpoint { path: path.clone(), resume, interval: Duration::ZERO };
        let whole = bake(None, 64);
        assert!(!path.exists());
        // With an interval of zero every sweep is saved; the last stands.
        bake(Some(checkpoint(false)), 64);
        let saved = std::fs::read(&path).unwrap();
        let resumed = bake(Some(checkpoint(true)), 64);
        assert_eq!(std::fs::read(&path).unwrap(), saved, "nothing was left to sweep");
        assert_eq!(resumed.container, whole.container);
        assert_eq!(resumed.solution, whole.solution);
    }

    #[test]
    fn a_bake_is_resumed_from_the_middle() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.resume");
        let checkpoint = |resume| Checkpoint { path: path.clone(), resume, interval: Duration::ZERO };
        bake(Some(checkpoint(false)), 3);
        // The checkpoint of a bake with other settings, relabelled as one of this: three sweeps done, the rest to do.
        let mut container = Container::read(&path).unwrap();
        let identity = container.metadata["identity"].replace("max_bounces: 3", "max_bounces: 64");
        container.metadata.insert("identity".into(), identity);
        container.write(&path).unwrap();
        assert_eq!(bake(Some(checkpoint(true)), 64).container, bake(None, 64).container);
    }
}

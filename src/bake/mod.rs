//! The bake: grid → placement → survey → plan → capture → bounces → filter → encode.
//!
//! `bake` runs it once; whatever compares configurations runs it many times on one [`World`].

pub mod figures;
mod memory;
mod predict;
mod replay;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use glam::{Vec2, Vec3A};
use rayon::prelude::*;

use crate::config::{Config, PlanMode};
use crate::light::World;
use crate::plan::Plan;
use crate::probe::capture::{Capture, EmissionTransport, ProbeCapture, ReflectedLight};
use crate::probe::file::container::{Container, FileError};
use crate::probe::file::{self, EncodingLosses, Origin, SceneRecord};
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::GridError;
use crate::probe::place::need;
use crate::probe::place::survey::Measured;
use crate::probe::place::{Placement, Settler, place};
use crate::probe::query::VisibilitySettings;
use crate::probe::store::kernel::Kernel;
use crate::probe::store::map::{OctahedralMaps, fill_with_border};
use crate::probe::store::surface::SurfaceVisibility;
use crate::probe::transport::checkpoint;
use crate::probe::transport::operator::{Captures, Sweep};
use crate::probe::transport::solver::{self, Solution, State};
use crate::probe::{Grid, Volume};
use crate::scene::Mesh;
use crate::system::memory::TooLittleMemory;
use crate::system::progress::Progress;

use self::figures::{Numerics, Rays, Times};
pub use self::memory::{Memory, check, surely_fits};
pub use self::predict::Prediction;

/// Hits this far outside the hull of the probes, in spacings, still count as inside: rounding of the bounds.
const HULL_TOLERANCE: f32 = 1e-3;

/// Voxels per cell at which the survey decides whether moments are needed at all.
const SURVEY_VOXELS: u32 = 4;

/// Probes that are traced before the next are begun: bounds the memory of what is not kept, and of replay's logs.
const CHUNK: usize = 256;
/// The same in bytes, where captures are large; but never fewer than there are threads.
const CHUNK_BYTES: u64 = 256 << 20;

/// Why there is no bake.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    #[error(transparent)]
    Grid(#[from] GridError),
    #[error(transparent)]
    Memory(#[from] TooLittleMemory),
    #[error(transparent)]
    File(#[from] FileError),
}

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
    memory: Memory,
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
) -> Result<Prepared<'w, 's>, BakeError> {
    let started = Instant::now();
    let grid = Grid::new(&config.grid, world.scene)?;
    let memory = Memory::of(config, &grid, &world.scene.mesh);
    memory.check(config, 0)?;
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
            let measured = Measured::survey(world.scene, &world.tracer, &grid, states, positions, voxels, seed);
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
        table.far = need::far_probes(world, &grid, &placement, table);
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
    Ok(Prepared { world, config, grid, placement, surface, plan, survey_rays, survey_s, memory, hull })
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

    /// Runs the rest of the pipeline. `load` and `accel_build` times are the caller's to fill.
    pub fn bake(mut self, circumstances: &Circumstances, scene: &SceneRecord) -> Result<Baked, BakeError> {
        self.check_memory(circumstances)?;
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
        let zero = OctahedralMaps::new(probes, filter.irradiance_resolution, encoding.border, Vec3A::ZERO);
        // The maps are large: what the bounces do not ask for waits here, and is not copied.
        let (asked, unasked) = if self.plan.visibility { (distance, None) } else { (None, distance) };
        let mut volume = self.volume(zero, asked);
        let kernel = Kernel::cosine(config.capture.resolution, filter.irradiance_resolution);
        times.filter += started.elapsed().as_secs_f64();

        let started = Instant::now();
        let bar = circumstances.progress.stage("bounces", config.solver.most() as usize);
        let sweep = Sweep {
            captures: &captures,
            kernel: &kernel,
            query: &config.query,
            gathers_emission: config.capture.emission == EmissionTransport::Gathered,
        };
        let identity = checkpoint::identity(&scene.blake3, circumstances.seed, &config.to_ron());
        let mut progress = State::default();
        if let Some(Checkpoint { path, resume: true, .. }) = &circumstances.checkpoint
            && path.exists()
        {
            progress = checkpoint::read(path, &identity, &mut volume)?;
        }
        let mut saved = Ok(());
        let mut last_saved = Instant::now();
        let mut solution = solver::solve(&sweep, &config.solver, &mut volume, progress, |progress, volume| {
            bar.set_position(progress.solution.bounces.len() as u64);
            let residual = progress.solution.bounces.last().map_or(0.0, |b| b.residual);
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
        // Full paths leave nothing to bounce.
        solution.converged |= matches!(config.capture.reflected, ReflectedLight::PathTraced { .. });
        numerics.non_finite += solution.non_finite;
        let done = solution.bounces.len().saturating_sub(1) as u32;
        let mut plan = self.plan.clone();
        plan.add_bounces(done, &config.solver, solution.converged, times.bounces);

        let started = Instant::now();
        if config.plan == PlanMode::KeepEverything {
            volume.distance = volume.distance.or(unasked);
            volume.surface_visibility = self.surface.take().filter(|_| is_surface);
        }
        // Times stay out of the file: the same input must give the same bytes.
        let record: Vec<_> = plan.lines.iter().map(|l| crate::plan::Line { saved_s: None, ..l.clone() }).collect();
        let record = serde_json::json!({ "visibility": plan.visibility, "lines": record });
        let (container, losses) = {
            let config = config.to_ron();
            file::encode(&volume, encoding, &Origin { config: &config, scene, seed: circumstances.seed, plan: &record })
        };
        times.encode = started.elapsed().as_secs_f64();
        numerics.clamped = losses.clamped.clone();
        numerics.underflowed = losses.underflowed.clone();
        numerics.variance_floor_hits = losses.variance_floor_hits;
        Ok(Baked { volume, container, losses, solution, plan, rays, times, numerics, surface_bytes })
    }

    /// The volume before the first bounce.
    fn volume(&self, irradiance: OctahedralMaps<Vec3A>, distance: Option<OctahedralMaps<Vec2>>) -> Volume {
        let is_surface = matches!(self.config.query.visibility, VisibilitySettings::Surface { .. });
        Volume {
            positions: self.placement.positions.clone(),
            states: self.placement.states.clone(),
            irradiance,
            curve: self.config.encoding.curve,
            distance,
            surface_visibility: self.surface.clone().filter(|_| is_surface && self.plan.visibility),
            grid: self.grid.clone(),
        }
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
        let at_once = (CHUNK_BYTES / memory::surfels_bytes(self.config).max(1)) as usize;
        for chunk in active.chunks(at_once.clamp(rayon::current_num_threads().min(CHUNK), CHUNK)) {
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
mod tests;

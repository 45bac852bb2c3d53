//! The bake: place → plan → capture → transport → encode.
//!
//! `bake` runs it once; whatever compares configurations runs it many times on one [`World`].

pub mod figures;
mod gather;
mod log;
mod memory;
mod predict;
mod replay;

use std::path::PathBuf;
use std::time::Duration;

use glam::Vec3;

use self::gather::{Budgeted, gather};
use self::log::Log;
use crate::config::{Config, VISIBILITY};
use crate::light::World;
use crate::plan::{Line, Plan};
use crate::probe::capture::{Capture, ProbeCapture};
use crate::probe::container::{Container, FileError};
use crate::probe::file::{self, Provenance, SceneRecord};
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::GridError;
use crate::probe::place::{Placement, PlacementSettings, PlacementTask, place};
use crate::probe::store::occlusion::OcclusionBuilder;
use crate::probe::store::{Occlusion, OcclusionStore, head_bytes};
use crate::probe::transport::operator::Operator;
use crate::probe::transport::solver::{Progress as Iterations, Solution};
use crate::probe::transport::{self, checkpoint};
use crate::probe::{Grid, Volume};
use crate::system::memory::TooLittleMemory;
use crate::system::progress::Progress;

pub use self::figures::{Numerics, Rays, Times};
pub use self::memory::{Memory, check, surely_fits};
pub use self::predict::Prediction;

/// Hits this far outside the hull of the probes, in spacings, still count as inside: rounding of the bounds.
const HULL_TOLERANCE: f32 = 1e-3;

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
    /// Where iterations are saved while a long bake runs, and whether to go on from there.
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

impl Circumstances {
    /// A bake that no one watches: all memory, no progress, no checkpoint.
    pub fn quiet(seed: u64) -> Circumstances {
        Circumstances { seed, memory_budget_bytes: None, progress: Progress::hidden(), checkpoint: None }
    }
}

/// Everything decided before tracing the captures.
pub struct Prepared<'w, 's> {
    pub world: &'w World<'s>,
    pub config: &'w Config,
    pub grid: Grid,
    pub placement: Placement,
    pub plan: Plan,
    pub survey_s: f64,
    memory: Memory,
    /// Hull of the probes relative to the scene's origin, a little enlarged.
    hull: (Vec3, Vec3),
}

/// A finished bake.
pub struct Baked {
    pub volume: Volume,
    pub container: Container,
    pub solution: Solution,
    pub plan: Plan,
    pub rays: Rays,
    pub times: Times,
    pub numerics: Numerics,
    /// Bytes per probe in the layout that shading uses: in full, and after the plan.
    pub runtime_bytes: (f64, f64),
}

/// Places the probes, surveys the surfaces and makes the plan.
///
/// # Errors
/// There is no such grid, or it needs more memory than there is.
pub fn prepare<'w, 's>(
    world: &'w World<'s>,
    config: &'w Config,
    circumstances: &Circumstances,
) -> Result<Prepared<'w, 's>, BakeError> {
    let mut log = Log::new(circumstances.progress);
    let grid = Grid::new(&config.grid, world.scene)?;
    let memory = Memory::of(config, &grid, &world.scene.mesh);
    memory.check(config, 0)?;
    let keep_unsampled = config.placement.keep_unsampled || config.plan.keeps("unused_probes");
    let settings = PlacementSettings { keep_unsampled, ..config.placement.clone() };
    let task = PlacementTask {
        grid: &grid,
        settings: &settings,
        occlusion: &config.store.occlusion,
        reach: config.query.reach(),
        seed: circumstances.seed,
    };
    let placement =
        log.stage(|times| &mut times.survey, "placing", 1, |bar| place(world, &task, || bar.set_prefix("surveying")));
    let plan = Plan::new(world, config, &grid, &placement);
    let hull = grid.hull(HULL_TOLERANCE);
    Ok(Prepared { world, config, grid, placement, plan, survey_s: log.times.survey, memory, hull })
}

impl Prepared<'_, '_> {
    /// Runs the rest of the pipeline. `load` and `accel_build` times are the caller's to fill.
    ///
    /// # Errors
    /// Too little memory for the captures; a checkpoint that cannot be read or written.
    pub fn bake(self, circumstances: &Circumstances, scene: &SceneRecord) -> Result<Baked, BakeError> {
        self.check_memory(circumstances)?;
        let config = self.config;
        let mut log = Log::new(circumstances.progress);
        log.times.survey = self.survey_s;
        log.rays.survey = self.placement.rays;
        log.numerics.probes_inside_geometry = self.placement.count(ProbeState::InsideGeometry);
        log.numerics.dropped_triangles = self.world.scene.dropped.total();
        log.numerics.albedo_clamped = self.world.clamped_materials();

        let capture = self.capture(circumstances);
        let trace = |probe: usize| self.trace(&capture, probe);
        let (captures, occlusion) = gather(&self, &trace, circumstances, &mut log);
        // What neither bounces nor shading ask for is only stored.
        let (asked, unasked) =
            if self.plan.visibility { (occlusion, None) } else { (Occlusion::None, Some(occlusion)) };
        let mut volume = self.volume(asked);
        let solution = self.transport(&captures, &mut volume, circumstances, scene, &mut log)?;
        let mut plan = self.plan.clone();
        let done = solution.bounces.len().saturating_sub(1) as u32;
        plan.add_bounces(done, &config.transport, solution.converged, log.times.bounces);
        if let Some(unasked) = unasked {
            volume.occlusion = unasked;
        }
        let container = self.encode(&volume, &plan, circumstances.seed, scene, &mut log);
        let Log { rays, times, numerics, .. } = log;
        let runtime_bytes = self.runtime_bytes();
        Ok(Baked { volume, container, solution, plan, rays, times, numerics, runtime_bytes })
    }

    /// Brings light from surface to surface until it has settled; saves it now and then.
    fn transport<F: Fn(usize) -> ProbeCapture + Sync>(
        &self,
        captures: &Budgeted<F>,
        volume: &mut Volume,
        circumstances: &Circumstances,
        scene: &SceneRecord,
        log: &mut Log,
    ) -> Result<Solution, BakeError> {
        let config = self.config;
        let kernel =
            log.time(|times| &mut times.filter, || volume.irradiance.kernel(&config.capture.rays.directions()));
        let operator = Operator {
            captures,
            kernel: &kernel,
            query: &config.query,
            gathers_emission: config.capture.gathers_emission(),
        };
        let identity = checkpoint::identity(&scene.blake3, circumstances.seed, &config.to_ron());
        let mut progress = Iterations::default();
        if let Some(Checkpoint { path, resume: true, .. }) = &circumstances.checkpoint
            && path.exists()
        {
            progress = checkpoint::read(path, &identity, volume)?;
        }
        let most = config.transport.iteration().most() as usize;
        let mut saver = Saver::new(circumstances.checkpoint.as_ref(), &identity);
        let solution = log.stage(
            |times| &mut times.bounces,
            "bounces",
            most,
            |bar| {
                transport::run(&config.transport, &operator, volume, progress, |progress, volume| {
                    bar.set_position(progress.solution.bounces.len() as u64);
                    let residual = progress.solution.bounces.last().map_or(0.0, |b| b.residual);
                    bar.set_message(format!("residual {residual:.1e}"));
                    saver.save(progress, volume);
                })
            },
        );
        saver.saved?;
        log.numerics.non_finite += solution.non_finite;
        Ok(solution)
    }

    /// The volume as a file's content.
    fn encode(&self, volume: &Volume, plan: &Plan, seed: u64, scene: &SceneRecord, log: &mut Log) -> Container {
        let config = self.config;
        // Times stay out of the file: the same input must give the same bytes.
        let lines: Vec<_> = plan.lines.iter().map(|l| Line { saved_s: None, ..l.clone() }).collect();
        let plan = serde_json::json!({ "visibility": plan.visibility, "lines": lines });
        let (text, query) = (config.to_ron(), config.query_record());
        let border = config.store.border;
        let provenance = Provenance { config: &text, query: &query, scene, seed, plan: &plan, border };
        let (container, losses) = log.time(|times| &mut times.encode, || file::encode(volume, &provenance));
        log.numerics.clamped = losses.clamped;
        log.numerics.underflowed = losses.underflowed;
        log.numerics.variance_floor_hits = losses.variance_floor_hits;
        container
    }

    fn capture<'a>(&'a self, circumstances: &Circumstances) -> Capture<'a, 'a> {
        let clamp = self.config.store.occlusion.distance_clamp().filter(|_| self.stores_occlusion());
        Capture {
            world: self.world,
            settings: &self.config.capture,
            distance_clamp_m: clamp.map(|diagonals| diagonals * self.grid.spacing().length()),
            hit_light: self.config.transport.hit_light(),
            emitter_coverage: self.placement.emitter_coverage,
            seed: circumstances.seed,
        }
    }

    /// Whether the plan or the configuration keeps what the method knows about occlusion.
    fn stores_occlusion(&self) -> bool {
        self.plan.visibility || self.config.plan.keeps(VISIBILITY)
    }

    /// What collects occlusion while probes are captured.
    fn occlusion_builder(&self) -> OcclusionBuilder {
        let (store, probes) = (&self.config.store, self.grid.probe_count());
        let occlusion = if self.stores_occlusion() { &store.occlusion } else { &OcclusionStore::None };
        let directions = self.config.capture.rays.directions();
        occlusion.builder(self.placement.survey.as_ref(), &directions, probes, store.border)
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

    /// The volume before any light is in it.
    fn volume(&self, occlusion: Occlusion) -> Volume {
        let store = &self.config.store;
        Volume {
            positions: self.placement.positions.clone(),
            states: self.placement.states.clone(),
            irradiance: store.irradiance.zeros(self.grid.probe_count(), store.border),
            occlusion,
            grid: self.grid.clone(),
        }
    }

    /// Bytes per probe in the layout that shading uses: in full, and after the plan.
    fn runtime_bytes(&self) -> (f64, f64) {
        let (store, probes) = (&self.config.store, self.grid.probe_count());
        let head = head_bytes(self.config.placement.rule.moves()) + store.irradiance.runtime_bytes(store.border);
        let survey = self.placement.survey.as_ref();
        let full = head as f64 + store.occlusion.runtime_bytes(store.border, survey, probes);
        (full, if self.plan.visibility { full } else { head as f64 })
    }
}

/// Saves iterations as often as a checkpoint asks for.
struct Saver<'a> {
    checkpoint: Option<&'a Checkpoint>,
    identity: &'a str,
    last: std::time::Instant,
    /// The first failure; nothing is saved after it.
    saved: Result<(), FileError>,
}

impl<'a> Saver<'a> {
    fn new(checkpoint: Option<&'a Checkpoint>, identity: &'a str) -> Saver<'a> {
        Saver { checkpoint, identity, last: std::time::Instant::now(), saved: Ok(()) }
    }

    fn save(&mut self, progress: &Iterations, volume: &Volume) {
        if let Some(Checkpoint { path, interval, .. }) = self.checkpoint
            && self.last.elapsed() >= *interval
            && self.saved.is_ok()
        {
            self.saved = checkpoint::write(path, self.identity, progress, volume);
            self.last = std::time::Instant::now();
        }
    }
}

#[cfg(test)]
mod tests;

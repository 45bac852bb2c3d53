//! The bake itself, from captures to the file's content.

use super::circumstances::{BakeError, Circumstances};
use super::figures::{Numerics, Rays, Times};
use super::gather::{Budgeted, gather};
use super::log::Log;
use super::memory::capture_budget;
use super::prepared::Prepared;
use super::saving::{self, Saving};
use crate::plan::{Line, PerProbe, Plan};
use crate::probe::Volume;
use crate::probe::capture::Capture;
use crate::probe::container::Container;
use crate::probe::file::{self, Provenance, SceneRecord};
use crate::probe::fit::{self, FitFigures};
use crate::probe::lattice::ProbeState;
use crate::probe::store::Occlusion;
use crate::probe::transport;
use crate::probe::transport::operator::Operator;
use crate::probe::transport::solver::{Bounce, Solution};
use crate::system::progress::FINE_STEPS;

/// A finished bake.
pub struct Baked {
    pub volume: Volume,
    pub container: Container,
    pub solution: Solution,
    /// `None` where the probes hold the light where they stand.
    pub fit: Option<FitFigures>,
    pub plan: Plan,
    pub rays: Rays,
    pub times: Times,
    pub numerics: Numerics,
    /// Bytes per probe in the layout that shading uses: in full, and after the plan.
    pub runtime_bytes: (f64, f64),
    /// Why work could not be saved on the way; `None` where it could, or needed not be.
    pub unsaved: Option<String>,
}

impl Prepared<'_, '_> {
    /// Runs the rest of the pipeline. `load` and `accel_build` times are the caller's to fill.
    ///
    /// # Errors
    /// Too little memory; saved work that cannot be gone on from.
    pub fn bake(self, circumstances: &Circumstances, scene: &SceneRecord) -> Result<Baked, BakeError> {
        self.memory.check(self.config)?;
        let config = self.config;
        let mut log = Log::new(circumstances.progress);
        log.times.survey = self.survey_s;
        log.rays.survey = self.placement.rays;
        log.numerics.probes_inside_geometry = self.placement.count(ProbeState::InsideGeometry);
        log.numerics.dropped_triangles = self.world.scene.dropped.total();
        log.numerics.albedo_clamped = self.world.clamped_materials();
        log.numerics.light_clamped += self.world.scene.light_clamped;

        let identity = saving::identity(&scene.blake3, circumstances.seed, &config.to_ron());
        let mut saving = Saving::new(circumstances.checkpoint.as_ref(), identity)?;
        let budget = capture_budget(&self.memory, circumstances);
        let guide = self.pilot(circumstances, budget, &mut saving, &mut log);
        let expected = log.time(|times| &mut times.capture, || self.expected());
        let (guide, expected) = (guide.as_ref(), expected.as_ref());
        let capture = Capture { guide, expected, ..self.capture(circumstances) };
        let (captures, occlusion) = gather(&self, &capture, budget, &mut saving, &mut log);
        // What neither bounces nor shading ask for is only stored. Frames make it as they go, and so ask it.
        let asks = self.plan.visibility || !config.transport.captures_once();
        let (asked, unasked) = if asks { (occlusion, None) } else { (Occlusion::None, Some(occlusion)) };
        let mut volume = self.volume(asked);
        let solution = self.transport(&captures, &mut volume, &mut saving, &mut log);
        let fit = self.fit(&mut volume, circumstances.seed, &mut saving, &mut log);
        let mut plan = self.plan.clone();
        let done = solution.bounces.len() as u32;
        plan.add_bounces(done, &config.transport, solution.converged, log.times.bounces);
        if let Some(unasked) = unasked {
            volume.occlusion = unasked;
        }
        let container = self.encode(&volume, &plan, fit.as_ref(), circumstances.seed, scene, &mut log);
        plan.measure(self.world.scene, &self.per_probe(&captures, &log));
        let Log { rays, times, numerics, .. } = log;
        let runtime_bytes = self.runtime_bytes();
        let unsaved = saving.failure();
        Ok(Baked { volume, container, solution, fit, plan, rays, times, numerics, runtime_bytes, unsaved })
    }

    /// What an active probe took, and how many were left out.
    fn per_probe(&self, captures: &Budgeted, log: &Log) -> PerProbe {
        let states = &self.placement.states;
        let active = states.iter().filter(|state| **state == ProbeState::Active).count();
        let Times { capture, bounces, fit, .. } = log.times;
        let of_one = |all: f64| all / active.max(1) as f64;
        PerProbe {
            left_out: states.len() - active,
            seconds: of_one(capture + bounces + fit),
            capture_bytes: of_one(captures.bytes as f64),
        }
    }

    /// Brings light from surface to surface until it has settled; saves it now and then.
    fn transport(&self, captures: &Budgeted, volume: &mut Volume, saving: &mut Saving, log: &mut Log) -> Solution {
        let config = self.config;
        let kernel = log.time(|times| &mut times.filter, || self.kernel(volume));
        let operator = Operator {
            captures,
            kernel: &kernel,
            query: &config.query,
            gathers_emission: config.capture.gathers_emission(),
        };
        let progress = saving.progress(volume);
        let captures_once = config.transport.captures_once();
        let solution = log.stage(
            |times| if captures_once { &mut times.bounces } else { &mut times.capture },
            if captures_once { "bounces" } else { "frames" },
            FINE_STEPS as usize,
            |bar| {
                transport::run(&config.transport, &operator, volume, progress, |progress, volume| {
                    let bounces = &progress.solution.bounces;
                    let residual = |bounce: Option<&Bounce>| bounce.map_or(0.0, |b| b.residual);
                    let (first, now) = (residual(bounces.first()), residual(bounces.last()));
                    bar.set_position(config.transport.steps_done(first, now, bounces.len()));
                    bar.set_message(format!("residual {now:.1e}"));
                    saving.save_progress(progress, volume);
                })
            },
        );
        log.rays.primary += solution.rays.0;
        log.rays.shadow += solution.rays.1;
        log.numerics.non_finite += solution.non_finite;
        log.numerics.hits_outside_volume += solution.hits_outside_volume;
        log.numerics.light_clamped += solution.light_clamped;
        solution
    }

    /// Fits the probes to their look-ups, where that is asked for. It changes no light that bounces.
    fn fit(&self, volume: &mut Volume, seed: u64, saving: &mut Saving, log: &mut Log) -> Option<FitFigures> {
        let config = self.config;
        if config.fit.is_none() {
            return None;
        }
        let figures = log.stage(
            |times| &mut times.fit,
            "fitting",
            fit::steps(&config.fit, volume.active_count()),
            |bar| fit::run(&config.fit, self.world, &config.query, volume, seed, saving, |steps| bar.inc(steps)),
        );
        log.numerics.non_finite += figures.map_or(0, |figures| figures.non_finite);
        figures
    }

    /// The volume as a file's content.
    fn encode(
        &self,
        volume: &Volume,
        plan: &Plan,
        fit: Option<&FitFigures>,
        seed: u64,
        scene: &SceneRecord,
        log: &mut Log,
    ) -> Container {
        let config = self.config;
        // Times stay out of the file: the same input must give the same bytes.
        let lines: Vec<_> = plan.lines.iter().map(|l| Line { saved_s: None, ..l.clone() }).collect();
        let plan = serde_json::json!({ "visibility": plan.visibility, "lines": lines });
        let mut query = config.query_record();
        query.weights.glossy = query.weights.glossy.resolved(config.grid.bounds_in(self.world.scene));
        let text = config.to_ron();
        let border = config.store.border;
        let fit = fit.map(FitFigures::record);
        let provenance =
            Provenance { config: &text, query: &query, scene, seed, plan: &plan, fit: fit.as_ref(), border };
        let (container, losses) = log.time(|times| &mut times.encode, || file::encode(volume, &provenance));
        log.numerics.clamped = losses.clamped;
        log.numerics.underflowed = losses.underflowed;
        log.numerics.variance_floor_hits = losses.variance_floor_hits;
        container
    }
}

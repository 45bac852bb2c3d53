//! Everything that is decided before captures are traced.

use glam::{Vec2, Vec3};

use super::circumstances::{BakeError, Circumstances};
use super::convert;
use super::log::Log;
use super::memory::Memory;
use crate::config::{Config, VISIBILITY};
use crate::light::World;
use crate::light::expected::Expected;
use crate::math::random::Purpose;
use crate::plan::{Looked, Plan, occlusion_bytes};
use crate::probe::capture::{Capture, CaptureSettings, HitLight, ProbeCapture, Resampling};
use crate::probe::lattice::ProbeState;
use crate::probe::place::{Placement, PlacementSettings, PlacementTask, place};
use crate::probe::store::kernel::Kernel;
use crate::probe::store::occlusion::OcclusionBuilder;
use crate::probe::store::radiance::{LightFieldStore, RadianceStore};
use crate::probe::store::{Occlusion, OcclusionStore};
use crate::probe::{Grid, ProbeIndex, Volume};

/// Hits this far outside the hull of the probes, in spacings, still count as inside: rounding of the bounds.
const HULL_TOLERANCE: f32 = 1e-3;

/// Everything decided before tracing the captures.
pub struct Prepared<'w, 's> {
    pub world: &'w World<'s>,
    pub config: &'w Config,
    pub grid: Grid,
    pub placement: Placement,
    pub plan: Plan,
    pub survey_s: f64,
    pub(super) memory: Memory,
    /// The configuration's, less the rays that placement keeps for itself.
    pub(super) capture: CaptureSettings,
    resampling: Option<Resampling>,
    /// Hull of the probes relative to the scene's origin, a little enlarged.
    hull: (Vec3, Vec3),
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
    let grid = Grid::refined(&config.grid, config.placement.refine, world.scene)?;
    prepare_on(world, config, circumstances, grid)
}

/// The same on a grid that may be another than the configuration's.
///
/// # Errors
/// It needs more memory than there is.
pub(super) fn prepare_on<'w, 's>(
    world: &'w World<'s>,
    config: &'w Config,
    circumstances: &Circumstances,
    grid: Grid,
) -> Result<Prepared<'w, 's>, BakeError> {
    let mut log = Log::new(circumstances.progress);
    let memory = Memory::of(config, &grid, &world.scene.mesh);
    memory.check(config)?;
    let keep_unsampled = config.placement.keep_unsampled || config.plan.keeps("unused_probes");
    let settings = PlacementSettings { keep_unsampled, ..config.placement.clone() };
    let task = PlacementTask {
        grid: &grid,
        settings: &settings,
        occlusion: &config.store.occlusion,
        reach: config.query.reach(),
    };
    let placement =
        log.stage(|times| &mut times.survey, "placing", 1, |bar| place(world, &task, || bar.set_prefix("surveying")));
    let plan = Plan::of(world, config, &grid, &Looked::at(config, &grid, &placement));
    let hull = grid.hull(HULL_TOLERANCE);
    let rays = config.capture.rays.without(config.placement.rule.reserved_rays());
    let capture = CaptureSettings { rays, ..config.capture.clone() };
    let resampling = log.time(|times| &mut times.filter, || capture.rays.resampling());
    let survey_s = log.times.survey;
    Ok(Prepared { world, config, grid, placement, plan, survey_s, memory, capture, resampling, hull })
}

impl Prepared<'_, '_> {
    pub(super) fn capture<'a>(&'a self, circumstances: &Circumstances) -> Capture<'a, 'a> {
        let clamp = self.config.store.occlusion.distance_clamp().filter(|_| self.stores_occlusion());
        Capture {
            world: self.world,
            settings: &self.capture,
            distance_clamp_m: clamp.map(|diagonals| diagonals * self.grid.spacing().length()),
            voxels: self.config.store.occlusion.survey_voxels().map(|voxels| (&self.grid, voxels)),
            hit_light: self.config.transport.hit_light(),
            expected: None,
            keeps_geometric: self.config.query.needs_geometric(),
            sees: self.config.store.light_field != LightFieldStore::None,
            shows: !self.radiance_store().is_empty(),
            resampling: self.resampling.as_ref(),
            guide: None,
            counts: None,
            purpose: Purpose::Capture,
            seed: circumstances.seed,
        }
    }

    /// What places around the probes are expected to receive; `None` where no paths ask for it.
    pub(super) fn expected(&self) -> Option<Expected> {
        let asks = matches!(self.config.transport.hit_light(), HitLight::Paths(_));
        let probes = self.placement.positions.iter().zip(&self.placement.states);
        let active = probes.filter(|(_, state)| **state == ProbeState::Active).map(|(position, _)| *position);
        asks.then(|| self.world.expect_around(&active.collect::<Vec<_>>()))
    }

    /// Whether the plan or the configuration keeps what the method knows about occlusion.
    pub(super) fn stores_occlusion(&self) -> bool {
        self.plan.visibility || self.config.plan.keeps(VISIBILITY)
    }

    /// What collects occlusion while probes are captured.
    pub(super) fn occlusion_builder(&self) -> OcclusionBuilder {
        let store = &self.config.store;
        let occlusion = if self.stores_occlusion() { &store.occlusion } else { &OcclusionStore::None };
        let directions = self.capture.rays.directions();
        occlusion.builder(self.placement.regions.as_ref(), &directions, &self.grid, store.border)
    }

    /// Whether some surface does not see some probe around it, as far as the survey knows.
    pub(super) fn is_blocked(&self) -> bool {
        let placement = &self.placement;
        placement.survey.as_ref().is_none_or(|survey| !survey.all_visible(&self.grid, &placement.states))
    }

    /// Bytes of what the method knows about occlusion, of all probes.
    pub(super) fn occlusion_bytes(&self) -> f64 {
        occlusion_bytes(self.config, &self.placement)
    }

    /// At most `most` active probes, spread evenly, and how many each of them stands for.
    pub(super) fn some_probes(&self, most: usize) -> (Vec<usize>, f64) {
        let active = self.active();
        let pilot: Vec<usize> = active.iter().copied().step_by(active.len().div_ceil(most).max(1)).collect();
        let share = active.len() as f64 / pilot.len().max(1) as f64;
        (pilot, share)
    }

    pub(super) fn active(&self) -> Vec<usize> {
        let states = &self.placement.states;
        (0..states.len()).filter(|&p| states[p] == ProbeState::Active).collect()
    }

    /// Traces one active probe.
    pub(super) fn trace(&self, capture: &Capture, probe: usize) -> ProbeCapture {
        let (capture, stream) = self.at(capture, probe);
        capture.probe(stream, self.viewpoint(probe), |p| self.contains(p))
    }

    /// Traces one frame of an active probe.
    pub(super) fn frame(&self, capture: &Capture, probe: usize, frame: u32) -> ProbeCapture {
        let (capture, stream) = self.at(capture, probe);
        capture.frame(stream, self.viewpoint(probe), |p| self.contains(p), frame)
    }

    /// A probe's own capture, and what numbers its random sequences.
    fn at<'c>(&self, capture: &Capture<'c, 'c>, probe: usize) -> (Capture<'c, 'c>, usize) {
        let index = ProbeIndex(probe as u32);
        // A probe that stands for a larger cell must know distances as much farther.
        let farther = self.grid.width(index) as f32;
        let distance_clamp_m = capture.distance_clamp_m.map(|m| m * farther);
        let counts = capture.guide.and_then(|guide| guide.of(probe));
        let capture = Capture { distance_clamp_m, counts, ..*capture };
        (capture, self.grid.stream(index) as usize)
    }

    /// What a probe's occlusion keeps of distances: those of its capture, which lets go of them, or of rays of their own.
    pub(super) fn look(&self, occlusion: &OcclusionBuilder, probe: usize, captured: &mut ProbeCapture) -> Vec<Vec2> {
        let mut distances = std::mem::take(&mut captured.distances);
        if occlusion.has_rays() {
            distances = convert::distances(self.world, occlusion, probe, self.viewpoint(probe));
            captured.rays.primary += distances.len() as u64;
        }
        occlusion.filter(probe, &distances)
    }

    /// Where a probe's rays start.
    fn viewpoint(&self, probe: usize) -> Vec3 {
        self.placement.contacts.viewpoint(probe, self.placement.positions[probe])
    }

    fn contains(&self, p: Vec3) -> bool {
        let (low, high) = self.hull;
        p.cmpge(low).all() && p.cmple(high).all()
    }

    /// The filter from captures to the volume's irradiance.
    pub(super) fn kernel(&self, volume: &Volume) -> Kernel {
        // Frames make filters of their own.
        match self.config.transport.captures_once() {
            true => volume.irradiance.kernel(&self.capture.rays.directions()),
            false => Kernel::of_rows(std::iter::empty()),
        }
    }

    /// The volume before any light is in it.
    pub(super) fn volume(&self, occlusion: Occlusion) -> Volume {
        let store = &self.config.store;
        Volume {
            positions: self.placement.positions.clone(),
            states: self.placement.states.clone(),
            irradiance: store.irradiance.zeros(self.grid.probe_count(), store.border),
            occlusion,
            radiance: self.radiance_store().zeros(self.grid.probe_count(), self.capture.rays.side().unwrap_or(0)),
            layout: store.layout.clone(),
            grid: self.grid.clone(),
        }
    }

    /// What is stored of radiance: the levels for glossy surfaces only where the plan keeps them.
    fn radiance_store(&self) -> RadianceStore<'_> {
        let store = self.config.store.radiance();
        RadianceStore { prefiltered: if self.plan.radiance_levels { store.prefiltered } else { &[] }, ..store }
    }

    /// Bytes per probe in the layout that shading uses: in full, and after the plan.
    pub(super) fn runtime_bytes(&self) -> (f64, f64) {
        let (store, probes) = (&self.config.store, self.grid.probe_count());
        let side = self.capture.rays.side().unwrap_or(0);
        let (field, levels) = store.radiance().runtime_bytes(side, store.layout.g_buffer);
        let moved = self.config.placement.rule.moves();
        let own = store.layout.head_bytes(moved) + store.irradiance.runtime_bytes(store.border) + field;
        let always = own as f64 + self.grid.runtime_bytes(moved);
        let regions = self.placement.regions.as_ref();
        let occlusion = store.occlusion.runtime_bytes(store.border, regions, probes, &store.layout);
        let kept_levels = if self.plan.radiance_levels { levels } else { 0 } as f64;
        let kept = always + kept_levels + if self.plan.visibility { occlusion } else { 0.0 };
        (always + levels as f64 + occlusion, kept)
    }
}

//! How much memory a bake takes: the arrays that grow with probes, resolutions and surfaces, by formulas beside which the
//! rest is small.

use super::circumstances::{BakeError, Circumstances};
use crate::config::Config;
use crate::probe::Grid;
use crate::probe::capture::surfel::{PackedNormal, Surfel};
use crate::probe::capture::{ProbeCapture, Seen};
use crate::probe::fit;
use crate::probe::place::survey;
use crate::probe::store::radiance::LightFieldStore;
use crate::probe::transport::anderson::History;
use crate::scene::{Mesh, Scene};
use crate::system::memory::{TooLittleMemory, available_bytes, resident_bytes};

/// What every probe takes besides its maps: position and state, twice, what placement found around it, and the heads of
/// its capture, of its masks and of an iteration's result.
const PROBE_BYTES: u64 = size_of::<Option<ProbeCapture>>() as u64 + 160;

/// A captured surface with the mask that the bounces keep of it.
const SURFEL_BYTES: u64 = size_of::<Surfel>() as u64 + 1;
/// A ray that met something that emits, in a list that grows by doubling, and packed for the file.
const EMITTED_BYTES: u64 = 3 * size_of::<(u32, glam::Vec3)>() as u64;

/// Bytes of a bake's large arrays, by what they grow with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    pub probes: u64,
    /// The survey of the surfaces; gone before captures are made.
    pub survey: u64,
    /// Filters from captures to maps.
    pub kernels: u64,
    /// Maps of irradiance and distance with their copies, and what the solver remembers of iterations.
    pub maps: u64,
    /// Captures that are traced at the same time.
    pub in_flight: u64,
    /// Rows and vectors of a fit; captures are there still.
    pub fit: u64,
}

impl Memory {
    pub fn of(config: &Config, grid: &Grid, mesh: &Mesh) -> Memory {
        let (store, texels) = (&config.store, config.capture.rays.texels());
        let probes = grid.probe_count() as u64;
        let unknowns = store.irradiance.unknowns();
        let (distance_kernel, distances) = store.occlusion.filter_bytes(texels);
        let history = if config.transport.may_accelerate() { History::bytes(probes * unknowns as u64) } else { 0 };
        let radiance = store.radiance().working_bytes(config.capture.rays.side().unwrap_or(0));
        // The last reflection, twice for checkpoints, the one that is being traced, and their sum.
        let traced = if config.transport.needs_light_field() { 4 * size_of::<glam::Vec3>() * texels } else { 0 } as u64;
        let per_probe = store.irradiance.working_bytes(store.border)
            + store.occlusion.working_bytes(store.border)
            + radiance
            + traced;
        let (resampling, resampled) = config.capture.rays.resampling_bytes();
        let survey = store.occlusion.survey_voxels();
        // A capture is there once more while it is packed for the file.
        let in_hand = surfels_bytes(config) + config.capture.rays.kept() as u64 * EMITTED_BYTES;
        Memory {
            probes: probes * PROBE_BYTES,
            survey: survey.map_or(0, |voxels| survey::estimated_bytes(mesh, grid, voxels)),
            kernels: store.irradiance.filter_bytes(texels) + distance_kernel + resampling,
            maps: probes * per_probe + history,
            in_flight: (surfels_bytes(config) + in_hand + distances + resampled) * rayon::current_num_threads() as u64,
            fit: fit::bytes(&config.fit, probes, unknowns as u64),
        }
    }

    /// All that is there together while bounces run and the fit after them, without kept captures.
    pub fn standing(&self) -> u64 {
        let bounces = self.probes.saturating_add(self.kernels).saturating_add(self.maps);
        bounces.saturating_add(self.in_flight).saturating_add(self.fit)
    }

    /// Refuses what does not fit, whatever is kept of captures.
    pub fn check(&self, config: &Config) -> Result<(), TooLittleMemory> {
        let Some(available) = available_bytes() else { return Ok(()) };
        let needed = self.standing().max(self.survey.saturating_add(self.probes));
        if needed <= available {
            return Ok(());
        }
        let grid = if config.grid.divisions.is_some() { "grid.divisions" } else { "grid.spacing_m" };
        let (irradiance, large_irradiance) = config.store.irradiance.size_key();
        let occlusion = config.store.occlusion.size_key();
        let large_occlusion = occlusion.filter(|(_, large)| *large);
        let maps = if large_irradiance { irradiance } else { large_occlusion.map_or(grid, |(key, _)| key) };
        let capture = config.capture.rays.size_key();
        // Filters grow with what they come from and what they lead to.
        let kernels = if maps == grid { capture } else { maps };
        let parts = [
            (self.probes, grid, "that many probes"),
            (self.survey, grid, "the survey of the surfaces"),
            (self.kernels, kernels, "filtering captures of that size into maps of that size"),
            (self.maps, maps, "the probes' maps"),
            (self.in_flight, capture, "one capture for each thread"),
            (self.fit, "fit.rows.rows_per_probe", "the rows of the fit"),
        ];
        let largest = parts.into_iter().max_by_key(|part| part.0).unwrap_or(parts[0]);
        Err(TooLittleMemory {
            key: largest.1.to_owned(),
            what: largest.2,
            needed,
            available,
            remedy: match largest.2 {
                _ if largest.1 == "grid.spacing_m" => "raise it",
                _ => "lower it",
            },
        })
    }
}

/// Refuses, before anything is traced, what cannot be baked: grids without probes, and what needs more memory than there is
/// whatever the survey finds.
///
/// # Errors
/// [`BakeError::Grid`], [`BakeError::Memory`].
pub fn check(config: &Config, scene: &Scene) -> Result<(), BakeError> {
    let grid = Grid::refined(&config.grid, config.placement.refine, scene)?;
    Ok(Memory::of(config, &grid, &scene.mesh).check(config)?)
}

/// Most that one probe's captured surfaces can take.
pub fn surfels_bytes(config: &Config) -> u64 {
    let geometric = if config.query.needs_geometric() { size_of::<PackedNormal>() as u64 } else { 0 };
    let seen = if config.store.light_field == LightFieldStore::None { 0 } else { size_of::<Seen>() as u64 };
    config.capture.rays.kept() as u64 * (SURFEL_BYTES + geometric) + config.capture.rays.texels() as u64 * seen
}

/// Bytes of captures that are kept in memory: what the budget, or without one the machine, leaves beside all else.
pub fn capture_budget(memory: &Memory, circumstances: &Circumstances) -> u64 {
    /// Of the machine's memory: the rest is for what changes there meanwhile.
    const MACHINE_SHARE: f64 = 0.9;
    let standing = memory.standing();
    match circumstances.memory_budget_bytes {
        Some(budget) => budget.saturating_sub(standing.saturating_add(resident_bytes())),
        None => match available_bytes() {
            Some(available) => ((available as f64 * MACHINE_SHARE) as u64).saturating_sub(standing),
            None => u64::MAX,
        },
    }
}

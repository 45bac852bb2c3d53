//! How much memory a bake takes: the arrays that grow with probes, resolutions and surfaces, by formulas beside which the
//! rest is small.

use crate::config::Config;
use crate::probe::Grid;
use crate::probe::capture::ProbeCapture;
use crate::probe::capture::surfel::Surfel;
use crate::probe::place::survey;
use crate::probe::query::VisibilitySettings;
use crate::probe::store::kernel::{FilterSettings, Kernel};
use crate::probe::transport::anderson::History;
use crate::scene::{Mesh, Scene};
use crate::system::memory::{TooLittleMemory, available_bytes};

use super::{BakeError, SURVEY_VOXELS};

/// What every probe takes besides its maps: position and state, twice, what placement found around it, and the heads of
/// its capture, of its masks and of a sweep's result.
const PROBE_BYTES: u64 = size_of::<Option<ProbeCapture>>() as u64 + 160;

/// Four floats: what a texel of irradiance takes in memory.
const IRRADIANCE_TEXEL_BYTES: u64 = 16;
/// Three floats: the same on its way into the file.
const PLAIN_TEXEL_BYTES: u64 = 12;
/// Two floats, and on the way into the file two codes, twice.
const DISTANCE_TEXEL_BYTES: u64 = 8 + 8;
/// Moments of distance: three f64 for each captured texel, until they are filtered.
const MOMENTS_BYTES: u64 = 24;
/// A captured surface with the mask that the bounces keep of it.
pub const SURFEL_BYTES: u64 = size_of::<Surfel>() as u64 + 1;
/// A texel that emits, in a list that grows by doubling.
pub const EMITTED_BYTES: u64 = 2 * size_of::<(u32, glam::Vec3)>() as u64;

/// Bytes of a bake's large arrays, by what they grow with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    pub probes: u64,
    /// The survey of the surfaces; gone before captures are made.
    pub survey: u64,
    /// Filters from captures to maps.
    pub kernels: u64,
    /// Maps of irradiance and distance with their copies, and what the solver remembers of sweeps.
    pub maps: u64,
    /// Captures that are traced at the same time.
    pub in_flight: u64,
}

impl Memory {
    pub fn of(config: &Config, grid: &Grid, mesh: &Mesh) -> Memory {
        let (filter, encoding, capture) = (&config.filter, &config.encoding, &config.capture);
        let probes = grid.probe_count() as u64;
        let texels = |resolution: usize| ((resolution + 2 * encoding.border) as u64).pow(2);
        let has_distance = matches!(config.query.visibility, VisibilitySettings::Moments { .. });
        // While a sweep runs the maps stand beside its results; while they are encoded, beside a copy and the codes.
        let encoded = PLAIN_TEXEL_BYTES + encoding.irradiance.bytes_per_texel() as u64;
        let irradiance = IRRADIANCE_TEXEL_BYTES + IRRADIANCE_TEXEL_BYTES.max(encoded);
        let distance = if has_distance { texels(filter.distance_resolution) * DISTANCE_TEXEL_BYTES } else { 0 };
        let voxels = match config.query.visibility {
            VisibilitySettings::None => None,
            VisibilitySettings::Moments { .. } => Some(SURVEY_VOXELS),
            VisibilitySettings::Surface { voxels_per_cell } => Some(voxels_per_cell),
        };
        let mut kernels = Kernel::bytes(capture.resolution, filter.irradiance_resolution, 1.0);
        if has_distance {
            kernels += Kernel::bytes(capture.resolution, filter.distance_resolution, filter.distance_exponent);
        }
        let moments = if has_distance { capture.resolution.pow(2) as u64 * MOMENTS_BYTES } else { 0 };
        let interior = probes * filter.irradiance_resolution.pow(2) as u64;
        let history = if config.solver.may_accelerate() { History::bytes(interior) } else { 0 };
        Memory {
            probes: probes * PROBE_BYTES,
            survey: voxels.map_or(0, |voxels| survey::estimated_bytes(mesh, grid, voxels)),
            kernels,
            maps: probes * (texels(filter.irradiance_resolution) * irradiance + distance) + history,
            in_flight: (surfels_bytes(config) + moments) * rayon::current_num_threads() as u64,
        }
    }

    /// All that is there together while bounces run, without kept captures.
    pub fn standing(&self) -> u64 {
        self.probes.saturating_add(self.kernels).saturating_add(self.maps).saturating_add(self.in_flight)
    }

    /// Refuses what does not fit; `captures` are the bytes of those that are kept.
    pub fn check(&self, config: &Config, captures: u64) -> Result<(), TooLittleMemory> {
        let Some(available) = available_bytes() else { return Ok(()) };
        let needed = self.standing().saturating_add(captures).max(self.survey.saturating_add(self.probes));
        if needed <= available {
            return Ok(());
        }
        let grid = if config.grid.divisions.is_some() { "grid.divisions" } else { "grid.spacing_m" };
        let default = FilterSettings::default();
        let maps = match &config.filter {
            f if f.irradiance_resolution > default.irradiance_resolution => "filter.irradiance_resolution",
            f if f.distance_resolution > default.distance_resolution => "filter.distance_resolution",
            _ => grid,
        };
        let kernels = match config.filter.irradiance_resolution.max(config.filter.distance_resolution) {
            r if r < config.capture.resolution => "capture.resolution",
            _ => maps,
        };
        let parts = [
            (self.probes, grid, "so many probes"),
            (self.survey, grid, "the survey of the surfaces"),
            (self.kernels, kernels, "filtering captures of that size into maps of that size"),
            (self.maps, maps, "the probes' maps"),
            (self.in_flight, "capture.resolution", "one capture for each thread"),
            (captures, "capture.resolution", "keeping all captures"),
        ];
        let largest = parts.into_iter().max_by_key(|part| part.0).unwrap_or(parts[0]);
        Err(TooLittleMemory {
            key: largest.1.to_owned(),
            what: largest.2,
            needed,
            available,
            remedy: match largest.2 {
                "keeping all captures" => "give a --memory-budget, or lower capture.resolution or the number of probes",
                _ if largest.1 == "grid.spacing_m" => "raise it",
                _ => "lower it",
            },
        })
    }
}

/// Refuses, before anything is traced, what cannot be baked: a grid that is none, and what needs more memory than there is
/// whatever the survey finds.
///
/// # Errors
/// [`BakeError::Grid`], [`BakeError::Memory`].
pub fn check(config: &Config, scene: &Scene) -> Result<(), BakeError> {
    let grid = Grid::new(&config.grid, scene)?;
    Ok(Memory::of(config, &grid, &scene.mesh).check(config, 0)?)
}

/// Whether all captures fit into memory even where every probe is baked and every ray meets a surface; else only
/// [`Prepared::check_memory`] can tell whether they do.
///
/// # Errors
/// [`BakeError::Grid`].
pub fn surely_fits(config: &Config, scene: &Scene) -> Result<bool, BakeError> {
    let grid = Grid::new(&config.grid, scene)?;
    let captures = (grid.probe_count() as u64).saturating_mul(surfels_bytes(config));
    Ok(Memory::of(config, &grid, &scene.mesh).check(config, captures).is_ok())
}

/// Most that one probe's captured surfaces can take.
pub fn surfels_bytes(config: &Config) -> u64 {
    let rays = config.capture.resolution.pow(2) as u64 * config.capture.samples_per_texel as u64;
    rays * SURFEL_BYTES
}

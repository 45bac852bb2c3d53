//! Time and memory of a bake, foretold from pieces of it: some cells of its grid are placed, surveyed, captured and lit as if
//! each were a grid of its own, and a few paths of the fit are traced. What that takes stands for the whole.

mod fit;
mod light;
mod parts;

use glam::UVec3;

use self::parts::{FEW_CELLS, Part, part, scan, some_parts};
use super::circumstances::{BakeError, Circumstances};
use super::memory::{Memory, capture_budget};
use crate::config::Config;
use crate::light::World;
use crate::plan::{Looked, Plan};
use crate::probe::lattice::ProbeState;
use crate::probe::{self, Grid};
use crate::system::memory::{peak_memory_bytes, resident_bytes};
use crate::system::progress::Progress;

/// Captures in a file are read, checked and unpacked at about this rate, measured where the system still holds the file.
const FILE_BYTES_PER_S: f64 = 1e9;

/// What a bake would take.
#[derive(Debug, Clone, PartialEq)]
pub struct Foretold {
    pub grid: Grid,
    /// About so many.
    pub probes_active: usize,
    /// Cells that were looked at.
    pub cells: usize,
    pub plan: Plan,
    pub survey_s: f64,
    /// Where iterations capture anew, all of them.
    pub capture_s: f64,
    /// One bounce, where captures stand before.
    pub bounce_s: f64,
    /// As many as the mean albedo that the probes see asks for.
    pub bounces: u32,
    pub fit_s: f64,
    /// Captures kept in memory.
    pub capture_bytes: u64,
    /// Maps with their copies, filters, what is traced at the same time, the rows of a fit.
    pub map_bytes: u64,
    /// What the process takes before: scene and acceleration structure.
    pub resident_bytes: u64,
    /// The most that loading the scene and surveying it take together.
    pub survey_bytes: u64,
}

impl Foretold {
    /// All stages but loading and writing.
    pub fn time_s(&self) -> f64 {
        self.survey_s + self.capture_s + f64::from(self.bounces) * self.bounce_s + self.fit_s
    }

    pub fn memory_bytes(&self) -> u64 {
        (self.capture_bytes + self.map_bytes + self.resident_bytes).max(self.survey_bytes)
    }
}

/// Foretells a bake.
///
/// # Errors
/// As those of [`super::prepare`].
pub fn foretell(world: &World, config: &Config, circumstances: &Circumstances) -> Result<Foretold, BakeError> {
    let grid = Grid::refined(&config.grid, config.placement.refine, world.scene)?;
    let memory = Memory::of(config, &grid, &world.scene.mesh);
    memory.check(config)?;
    // Many small bars would say nothing.
    let circumstances = &Circumstances { progress: Progress::hidden(), ..circumstances.clone() };
    let (resident, loaded) = (resident_bytes(), peak_memory_bytes());
    let budget = capture_budget(&memory, circumstances);
    let cells = grid.divisions().max(UVec3::splat(2)) - 1;
    let cell_count = cells.as_u64vec3().element_product() as usize;
    let is_whole = cell_count <= FEW_CELLS || grid.tree().is_some();
    // What but scans the scene is done once for the whole grid, and for every part.
    let scan_s = if is_whole { 0.0 } else { scan(world, config, circumstances, &grid)? };
    let parts = match is_whole {
        true => vec![part(world, config, circumstances, grid.clone())?],
        false => some_parts(world, config, circumstances, (&grid, cells))?,
    };
    let looked_at = if is_whole { cell_count } else { parts.iter().map(|part| part.cells()).sum() };
    let share = cell_count as f64 / looked_at.max(1) as f64;
    let surveyed: f64 = parts.iter().map(|part| (part.seconds - scan_s).max(0.0)).sum();
    // As if no thread had to wait.
    let threads = rayon::current_num_threads() as f64;
    let survey_s = match config.store.occlusion.survey_voxels() {
        Some(_) => scan_s + surveyed * share,
        // Probes alone are placed, and parts have more of them for each cell.
        None => {
            let probes: usize = parts.iter().map(|part| part.prepared.grid.probe_count()).sum();
            surveyed * grid.probe_count() as f64 / probes.max(1) as f64
        }
    };
    let judged: usize = parts.iter().map(|part| part.judged.len()).sum();
    let count = |state: ProbeState| -> f64 {
        let of = |part: &Part| part.judged.iter().filter(|&&p| part.prepared.placement.states[p] == state).count();
        let found: usize = parts.iter().map(of).sum();
        found as f64 / judged.max(1) as f64 * grid.probe_count() as f64
    };
    let active = count(ProbeState::Active);
    let looked = Looked {
        cells: (!is_whole).then_some((looked_at, cell_count)),
        unsampled: count(ProbeState::NeverSampled).round() as usize,
        inside: count(ProbeState::InsideGeometry).round() as usize,
        blocked: parts.iter().any(|part| part.prepared.is_blocked()),
        occlusion_bytes: parts.iter().map(|part| part.prepared.occlusion_bytes()).sum::<f64>() * share,
    };
    let plan = Plan::of(world, config, &grid, &looked);
    let light = light::of(&parts, circumstances, active);
    let unknowns = config.store.irradiance.unknowns() as u64;
    let likely_fit = probe::fit::likely_bytes(&config.fit, active.round() as u64, unknowns);
    let once = config.transport.captures_once();
    let filed_s = (light.bytes - budget as f64).max(0.0) / FILE_BYTES_PER_S;
    let survey_bytes = resident + memory.survey + memory.probes;
    Ok(Foretold {
        probes_active: active.round() as usize,
        cells: looked_at,
        plan,
        survey_s: survey_s / threads,
        capture_s: light.capture_s,
        bounce_s: if once { light.bounce_s + filed_s } else { 0.0 },
        bounces: light.bounces,
        fit_s: fit::seconds(&config.fit, world, &grid, active.round() as usize),
        capture_bytes: if once { (light.bytes as u64).min(budget) } else { 0 },
        map_bytes: memory.standing() - memory.fit + likely_fit,
        resident_bytes: resident,
        survey_bytes: survey_bytes.max(loaded),
        grid,
    })
}

//! Two probe files, probe by probe.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use glam::{DVec3, IVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};

use super::error::DiffError;
use crate::math::color::luminance;
use crate::math::fibonacci;
use crate::probe::file;
use crate::probe::lattice::ProbeState;
use crate::probe::{ProbeIndex, Volume};

/// Directions that each probe is asked in: as many as the maps of the preset physical have texels, but not their centres, so
/// that what lies between them (borders, seams) counts too.
const DIRECTIONS: usize = 64;

/// The volume is divided into so many regions along each axis.
const REGIONS: u32 = 4;

/// Irradiance below this share of the mean does not count as a probe's own: ratios to darkness say nothing.
const DARK_SHARE: f64 = 0.05;

/// A probe has changed when its irradiance has by more than this share of its own. Between seeds the largest in a few
/// hundred probes reach this near lamps.
const CHANGED_SHARE: f64 = 0.25;

/// Probes that a region must have for its mean to be judged.
const MIN_REGION: usize = 8;

/// Regions below this share of the mean irradiance are dark.
const DARK_REGION: f64 = 0.01;

/// A probe moved when it stands farther off than this share of the spacing: relocation depends on few random rays.
const MOVED_SHARE: f32 = 0.05;

/// Points of two grids that lie within this share of the spacing are one.
const SAME_POINT: f64 = 0.01;

/// Rows that are listed.
const WORST: usize = 10;

/// One probe of both sides.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProbeRow {
    pub index: usize,
    /// Where the candidate's grid counts differently.
    pub candidate_index: usize,
    /// Of the base, world space.
    pub position_m: [f64; 3],
    pub state_base: ProbeState,
    pub state_candidate: ProbeState,
    pub moved_m: f64,
    /// Mean over all directions, luminance, W·m⁻².
    pub irradiance_base: f64,
    pub irradiance_candidate: f64,
    /// Root mean square over directions and channels, W·m⁻².
    pub irradiance_difference: f64,
    /// That ÷ the mean of both sides.
    pub irradiance_difference_relative: f64,
    /// Root mean square over the map, of the mean distances; `null` without distances.
    pub distance_difference_m: Option<f64>,
}

/// The comparison of two probe files.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProbesReport {
    pub item: String,
    #[serde(flatten)]
    pub figures: Value,
    /// By `irradiance_difference_relative`, the largest first.
    pub worst: Vec<ProbeRow>,
    /// Of every compared probe, percent of the base's: for histograms.
    #[serde(skip)]
    pub changes_percent: Vec<f32>,
    /// Likewise `distance_difference_m`; empty without distances.
    #[serde(skip)]
    pub distance_differences_m: Vec<f32>,
}

/// Probes of the same grid point, base and candidate.
fn matches(base: &Volume, candidate: &Volume) -> Vec<(ProbeIndex, ProbeIndex)> {
    let (grid, other) = (&base.grid, &candidate.grid);
    let spacing = grid.spacing().as_dvec3();
    // Grid points of the candidate in half steps of the base's grid: cells of mixed grids have their middles there too.
    let halves = |step: DVec3| (2.0 * step).round().as_ivec3();
    let mut points: HashMap<IVec3, ProbeIndex> = HashMap::new();
    for index in other.probes() {
        let world = other.origin_world() + other.steps(index).as_dvec3() * other.spacing().as_dvec3();
        let step = (world - grid.origin_world()) / spacing;
        if (step - halves(step).as_dvec3() / 2.0).abs().max_element() <= SAME_POINT {
            points.insert(halves(step), index);
        }
    }
    let found = |index| Some((index, *points.get(&halves(grid.steps(index).as_dvec3()))?));
    grid.probes().filter_map(found).collect()
}

fn row(base: &Volume, candidate: &Volume, (a, b): (ProbeIndex, ProbeIndex), directions: &[Vec3]) -> ProbeRow {
    let (i, j) = (a.0 as usize, b.0 as usize);
    let (mut sums, mut squares) = ([0.0; 2], 0.0);
    for &direction in directions {
        let e = [base.probe_irradiance(a, direction), candidate.probe_irradiance(b, direction)];
        sums = [0, 1].map(|side| sums[side] + f64::from(luminance(e[side])));
        squares += f64::from((e[1] - e[0]).length_squared());
    }
    let n = directions.len() as f64;
    let world = |volume: &Volume, probe| volume.grid.origin_world() + volume.position(probe).as_dvec3();
    let position = world(base, a);
    ProbeRow {
        index: i,
        candidate_index: j,
        position_m: position.to_array(),
        state_base: base.states[i],
        state_candidate: candidate.states[j],
        moved_m: position.distance(world(candidate, b)),
        irradiance_base: sums[0] / n,
        irradiance_candidate: sums[1] / n,
        irradiance_difference: (squares / (3.0 * n)).sqrt(),
        irradiance_difference_relative: 0.0,
        distance_difference_m: base.occlusion.distance_difference(i, &candidate.occlusion, j),
    }
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0_f64), |(sum, count), value| (sum + value * value, count + 1.0));
    (sum / count.max(1.0)).sqrt()
}

/// Compares two probe files.
///
/// # Errors
/// Files that cannot be read.
pub fn compare(item: &str, base: &Path, candidate: &Path) -> Result<ProbesReport, DiffError> {
    let files = [file::read(base)?, file::read(candidate)?];
    let [base, candidate] = files.each_ref().map(|file| file.volume_in_grid());
    let directions: Vec<Vec3> = (0..DIRECTIONS).map(|i| fibonacci::direction(i, DIRECTIONS)).collect();
    let pairs = matches(base, candidate);
    let mut rows: Vec<ProbeRow> = pairs.par_iter().map(|&pair| row(base, candidate, pair, &directions)).collect();
    let matched = rows.len();
    let is_active = |state| state == ProbeState::Active;
    let flipped = rows.iter().filter(|r| is_active(r.state_base) != is_active(r.state_candidate)).count();
    rows.retain(|r| is_active(r.state_base) && is_active(r.state_candidate));
    let spacing = base.grid.spacing_max();
    let moved = rows.iter().filter(|r| r.moved_m > f64::from(MOVED_SHARE * spacing)).count();

    let n = rows.len().max(1) as f64;
    let mean = |of: fn(&ProbeRow) -> f64| rows.iter().map(of).sum::<f64>() / n;
    let (irradiance_base, irradiance_candidate) = (mean(|r| r.irradiance_base), mean(|r| r.irradiance_candidate));
    let scale = irradiance_base.max(irradiance_candidate);
    let floor = DARK_SHARE * scale;
    for row in &mut rows {
        let own = 0.5 * (row.irradiance_base + row.irradiance_candidate) + floor;
        row.irradiance_difference_relative = if own > 0.0 { row.irradiance_difference / own } else { 0.0 };
    }
    let region = worst_region(base, &rows, scale);
    rows.sort_by(|a, b| b.irradiance_difference_relative.total_cmp(&a.irradiance_difference_relative));
    let relative = || rows.iter().map(|r| r.irradiance_difference_relative);
    let lit = rows.iter().filter(|r| r.irradiance_base > floor);
    let distances: Vec<f32> = rows.iter().filter_map(|r| r.distance_difference_m).map(|d| d as f32).collect();
    let distance = root_mean_square(distances.iter().map(|d| f64::from(*d))) / f64::from(spacing);
    let figures = json!({
        "probes_base": base.states.len(),
        "probes_candidate": candidate.states.len(),
        // Probes of grid points that both have.
        "matched": matched,
        "added": candidate.states.len() - matched,
        "removed": base.states.len() - matched,
        "moved": moved,
        // Between active and not; `compared` are active on both sides.
        "flipped": flipped,
        "compared": rows.len(),
        // Mean over probes and directions, luminance, W·m⁻².
        "irradiance_base": irradiance_base,
        "irradiance_candidate": irradiance_candidate,
        // Of `irradiance_difference_relative`: root mean square, largest, share of probes with more than a quarter.
        "irradiance_rms_percent": 100.0 * root_mean_square(relative()),
        "worst_percent": 100.0 * relative().next().unwrap_or(0.0),
        "changed_percent": 100.0 * relative().filter(|r| *r > CHANGED_SHARE).count() as f64 / n,
        // Root mean square of `distance_difference_m` ÷ spacing.
        "distance_percent": (!distances.is_empty()).then_some(100.0 * distance),
        // The region that changed most; no percentage where its base is dark.
        "region_place_m": region.map(|(place_m, _)| place_m),
        "region_base": region.map(|(_, figures)| figures[1]),
        "region_candidate": region.map(|(_, figures)| figures[2]),
        "region_percent": region.map(|(_, figures)| figures[0]),
    });
    Ok(ProbesReport {
        item: item.to_owned(),
        figures,
        changes_percent: lit.map(|r| (100.0 * (r.irradiance_candidate / r.irradiance_base - 1.0)) as f32).collect(),
        distance_differences_m: distances,
        worst: rows.into_iter().take(WORST).collect(),
    })
}

/// Of the region of the volume whose mean irradiance changed most: the centre of its probes, world space, to the centimetre; by how
/// many percent of the base's (infinite where that is dark), base and candidate. `scale`: mean irradiance. `None` where no region has
/// enough light and probes.
fn worst_region(volume: &Volume, rows: &[ProbeRow], scale: f64) -> Option<([f64; 3], [f64; 3])> {
    let mut members: BTreeMap<[u32; 3], Vec<&ProbeRow>> = BTreeMap::new();
    for row in rows {
        let coordinate = volume.grid.coordinate(ProbeIndex(row.index as u32));
        members.entry((coordinate * REGIONS / volume.grid.divisions()).to_array()).or_default().push(row);
    }
    let region = |rows: &Vec<&ProbeRow>| {
        let n = rows.len() as f64;
        let place = rows.iter().map(|r| DVec3::from(r.position_m)).sum::<DVec3>() / n;
        let base = rows.iter().map(|r| r.irradiance_base).sum::<f64>() / n;
        let candidate = rows.iter().map(|r| r.irradiance_candidate).sum::<f64>() / n;
        let place_m = ((place * 100.0).round() / 100.0).to_array();
        let percent = 100.0 * (candidate / base - 1.0).abs();
        let is_judged = rows.len() >= MIN_REGION && base.max(candidate) > DARK_REGION * scale;
        is_judged.then_some((place_m, [percent, base, candidate]))
    };
    members.values().filter_map(region).max_by(|a, b| a.1[0].total_cmp(&b.1[0]))
}

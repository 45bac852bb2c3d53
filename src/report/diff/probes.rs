//! Two probe files, probe by probe.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec3, IVec3, UVec3, Vec3};
use rayon::prelude::*;
use serde::Serialize;

use super::DiffError;
use super::gate::{Direction, Finding};
use super::noise::Noise;
use super::ratio::{Change, Part, change, effective_count, unevenness};
use super::storage::structure;
use crate::math::color::luminance;
use crate::math::fibonacci;
use crate::probe::file::{self, ProbeFile};
use crate::probe::lattice::ProbeState;
use crate::probe::{ProbeIndex, Volume};

/// Directions that each probe is asked in: as many as the default has texels, but not their centres, so that what lies
/// between them (borders, seams) counts too.
const DIRECTIONS: usize = 64;

/// The volume is divided into so many blocks along each axis for the noise of its mean: 64 blocks leave the bounces
/// between near probes within one.
const BLOCKS: u32 = 4;

/// The least standard error of the mean between seeds, over the unevenness of the probes ÷ √(effective count): where all light comes
/// through one door, blocks show too little. The largest change was 2.6 of that (332 pairs in 15 scenes and spacings).
const OF_PROBES: f64 = 0.6;

/// Irradiance below this share of the mean does not count as a probe's own: ratios to darkness say nothing.
const DARK_SHARE: f64 = 0.05;

/// A probe has changed when its irradiance has by more than this share of its own. Between seeds the largest in a few
/// hundred probes reach this near lamps.
const CHANGED_SHARE: f64 = 0.25;

/// Share of a normal population's deviations that its largest tenth begins at, in standard deviations: what is estimated
/// from it is not moved by the few that are looked for.
const TENTH_SIGMAS: f64 = 1.645;

/// Probes that a region must have lit for its mean to be judged.
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
    pub probes_base: usize,
    pub probes_candidate: usize,
    /// Probes of grid points that both have.
    pub matched: usize,
    pub added: usize,
    pub removed: usize,
    pub moved: usize,
    /// Between valid (active) and invalid.
    pub flipped: usize,
    /// Active on both sides.
    pub compared: usize,
    /// Mean over probes and directions, luminance, W·m⁻².
    pub irradiance_base: f64,
    pub irradiance_candidate: f64,
    pub irradiance_change_percent: Option<f64>,
    pub irradiance_change_standard_error_percent: Option<f64>,
    /// Root mean square of `irradiance_difference_relative`.
    pub irradiance_rms_percent: f64,
    /// By `irradiance_difference_relative`, the largest first.
    pub worst: Vec<ProbeRow>,
    /// Of every compared probe, percent of the base's: for histograms.
    #[serde(skip)]
    pub changes_percent: Vec<f32>,
    /// Likewise `distance_difference_m`; empty without distances.
    #[serde(skip)]
    pub distance_differences_m: Vec<f32>,
}

/// A region of the volume whose mean changed.
struct Region {
    percent: f64,
    error: f64,
    place: DVec3,
}

pub fn compare(
    item: &str,
    base: &Path,
    candidate: &Path,
) -> Result<(ProbesReport, Vec<Finding>, [ProbeFile; 2]), DiffError> {
    let files = [file::read(base)?, file::read(candidate)?];
    let (report, findings) = compare_files(item, &files[0], &files[1]);
    Ok((report, findings, files))
}

/// Probes of the same grid point, base and candidate.
fn matches(base: &Volume, candidate: &Volume) -> Vec<(ProbeIndex, ProbeIndex)> {
    let (grid, other) = (&base.grid, &candidate.grid);
    let spacing = grid.spacing().as_dvec3();
    // Grid points of the candidate in steps of the base's grid.
    let mut points: HashMap<IVec3, ProbeIndex> = HashMap::new();
    for index in (0..other.probe_count() as u32).map(ProbeIndex) {
        let world = other.origin_world() + other.coordinate(index).as_dvec3() * other.spacing().as_dvec3();
        let step = (world - grid.origin_world()) / spacing;
        if (step - step.round()).abs().max_element() <= SAME_POINT {
            points.insert(step.round().as_ivec3(), index);
        }
    }
    let all = (0..grid.probe_count() as u32).map(ProbeIndex);
    all.filter_map(|index| Some((index, *points.get(&grid.coordinate(index).as_ivec3())?))).collect()
}

fn mean_square(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len().max(1) as f64;
    values.map(|v| v * v).sum::<f64>() / n
}

fn directions() -> Vec<Vec3> {
    (0..DIRECTIONS).map(|i| fibonacci::direction(i, DIRECTIONS)).collect()
}

fn row(base: &Volume, candidate: &Volume, (a, b): (ProbeIndex, ProbeIndex), directions: &[Vec3]) -> ProbeRow {
    let (i, j) = (a.0 as usize, b.0 as usize);
    let (mut sums, mut squares) = ([0.0; 2], 0.0);
    for &direction in directions {
        let e = [base.probe_irradiance(a, direction), candidate.probe_irradiance(b, direction)];
        for (sum, e) in sums.iter_mut().zip(e) {
            *sum += f64::from(luminance(e));
        }
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

fn compare_files(item: &str, base_file: &ProbeFile, candidate_file: &ProbeFile) -> (ProbesReport, Vec<Finding>) {
    let (base, candidate) = (base_file.volume_in_grid(), candidate_file.volume_in_grid());
    let pairs = matches(base, candidate);
    let directions = directions();
    let mut rows: Vec<ProbeRow> = pairs.par_iter().map(|&pair| row(base, candidate, pair, &directions)).collect();
    let spacing = base.grid.spacing_max();
    let active = |row: &ProbeRow| row.state_base == ProbeState::Active && row.state_candidate == ProbeState::Active;
    let moved = rows.iter().filter(|r| active(r) && r.moved_m > f64::from(MOVED_SHARE * spacing)).count();
    let is_active = |state| state == ProbeState::Active;
    let flipped = rows.iter().filter(|r| is_active(r.state_base) != is_active(r.state_candidate)).count();
    let matched = rows.len();
    let (removed, added) = (base.states.len() - matched, candidate.states.len() - matched);
    rows.retain(active);

    let n = rows.len().max(1) as f64;
    let mean = |of: fn(&ProbeRow) -> f64| rows.iter().map(of).sum::<f64>() / n;
    let (mean_base, mean_candidate) = (mean(|r| r.irradiance_base), mean(|r| r.irradiance_candidate));
    let floor = DARK_SHARE * mean_base.max(mean_candidate);
    for row in &mut rows {
        let own = 0.5 * (row.irradiance_base + row.irradiance_candidate) + floor;
        row.irradiance_difference_relative = if own > 0.0 { row.irradiance_difference / own } else { 0.0 };
    }
    let noise = Noise::of([base_file.seed, candidate_file.seed]);
    let whole = whole(base, &rows, noise);
    let rms = 100.0 * mean_square(rows.iter().map(|r| r.irradiance_difference_relative)).sqrt();
    let changes_percent = rows.iter().filter(|r| r.irradiance_base > floor);
    let changes_percent =
        changes_percent.map(|r| (100.0 * (r.irradiance_candidate / r.irradiance_base - 1.0)) as f32).collect();
    let mut findings = structure(item, base_file, candidate_file);
    findings.extend([
        Finding::count("probes.added", item, added, matched, "Probes at places where the base has none."),
        Finding::count("probes.removed", item, removed, matched, "Probes of the base that the candidate lacks."),
        Finding::count("probes.moved", item, moved, matched, "Probes that stand elsewhere than in the base."),
        Finding::count("probes.flipped", item, flipped, matched, "Probes that are active on one side only."),
    ]);
    findings.push(
        Finding {
            value: whole.map(|w| w.percent),
            ..Finding::ratio(
                "irradiance.mean",
                item,
                [mean_base, mean_candidate].map(Some),
                Direction::Both,
                "Mean irradiance of all probes active on both sides, over all directions.",
            )
        }
        .with_error(whole.and_then(|w| w.standard_error)),
    );
    findings.extend(light(item, base, &rows, rms, mean_base.max(mean_candidate), noise));
    findings.extend(distances(item, base, &rows));
    rows.sort_by(|a, b| b.irradiance_difference_relative.total_cmp(&a.irradiance_difference_relative));
    let compared = rows.len();
    let distance_differences_m = rows.iter().filter_map(|r| r.distance_difference_m).map(|d| d as f32).collect();
    rows.truncate(WORST);
    let report = ProbesReport {
        item: item.to_owned(),
        probes_base: base.states.len(),
        probes_candidate: candidate.states.len(),
        matched,
        added,
        removed,
        moved,
        flipped,
        compared,
        irradiance_base: mean_base,
        irradiance_candidate: mean_candidate,
        irradiance_change_percent: whole.map(|w| w.percent),
        irradiance_change_standard_error_percent: whole.and_then(|w| w.standard_error),
        irradiance_rms_percent: rms,
        worst: rows,
        changes_percent,
        distance_differences_m,
    };
    (report, findings)
}

/// The block of the volume that a probe of the base lies in.
fn block(volume: &Volume, row: &ProbeRow) -> usize {
    let coordinate = volume.grid.coordinate(ProbeIndex(row.index as u32));
    let cell = coordinate * UVec3::splat(BLOCKS) / volume.grid.divisions();
    (cell.x + BLOCKS * (cell.y + BLOCKS * cell.z)) as usize
}

fn blocks(volume: &Volume, rows: &[ProbeRow]) -> Vec<Part> {
    let mut parts = vec![Part::default(); BLOCKS.pow(3) as usize];
    for row in rows {
        parts[block(volume, row)].add(row.irradiance_base, row.irradiance_candidate);
    }
    parts
}

/// The change of the mean. Its error is that which the blocks show, and with other random numbers no less than [`OF_PROBES`] of that
/// which the probes do; where light is in too few blocks to tell, it is the latter.
fn whole(volume: &Volume, rows: &[ProbeRow], noise: Noise) -> Option<Change> {
    let found = change(&blocks(volume, rows))?;
    let pairs = rows.iter().map(|r| [r.irradiance_base, r.irradiance_candidate]);
    let count = effective_count(pairs.clone().map(|pair| pair[0]));
    let of_probes = unevenness(pairs).map(|share| 100.0 * share / count.sqrt());
    let standard_error = match (found.standard_error, of_probes) {
        (Some(of_blocks), Some(of_probes)) if noise == Noise::Other => Some(of_blocks.max(OF_PROBES * of_probes)),
        (of_blocks, of_probes) => of_blocks.or(of_probes),
    };
    Some(Change { standard_error: standard_error.map(|error| noise.at_most(error)), ..found })
}

/// Findings about the light of single probes and regions.
fn light(item: &str, volume: &Volume, rows: &[ProbeRow], rms: f64, scale: f64, noise: Noise) -> Vec<Finding> {
    let mut relative: Vec<f64> = rows.iter().map(|r| r.irradiance_difference_relative).collect();
    let changed = relative.iter().filter(|r| **r > CHANGED_SHARE).count();
    relative.sort_by(f64::total_cmp);
    // Of the lit probes: in a scene whose half is dark, the dark half would make all noise seem small.
    let lit: Vec<f64> = {
        let lit = rows.iter().filter(|r| r.irradiance_base.max(r.irradiance_candidate) > DARK_SHARE * scale);
        let mut lit: Vec<f64> = lit.map(|r| r.irradiance_difference_relative).collect();
        lit.sort_by(f64::total_cmp);
        lit
    };
    let tenth = lit.get((lit.len() * 9 / 10).min(lit.len().saturating_sub(1))).copied().unwrap_or(0.0);
    let worst = relative.last().copied().unwrap_or(0.0);
    let share = 100.0 * changed as f64 / rows.len().max(1) as f64;
    let mut findings = vec![
        Finding::percentage(
            "probes.rms",
            item,
            Some(rms),
            "Root mean square of the probes' differences, each relative to its own irradiance.",
        ),
        Finding::percentage(
            "probes.worst",
            item,
            Some(100.0 * worst),
            "Largest difference of one probe relative to its own irradiance; its standard error is what the differences of the other probes let expect.",
        )
        .with_error((lit.len() >= MIN_REGION).then(|| noise.of_probe_at_most(100.0 * tenth / TENTH_SIGMAS))),
        Finding::percentage(
            "probes.changed",
            item,
            Some(share),
            "Share of probes whose irradiance changed by more than a quarter of its own.",
        ),
    ];
    findings.push(match worst_region(volume, rows, scale, noise) {
        None => {
            let words = "No region has enough lit probes to tell its noise; the mean and single probes are judged.";
            Finding::percentage("irradiance.region", item, None, words)
        }
        Some(region) => {
            let place = region.place;
            let words = format!(
                "Mean irradiance of the region, one of {BLOCKS}×{BLOCKS}×{BLOCKS}, that changed most beside its noise: around ({:.2}, {:.2}, {:.2}) m.",
                place.x, place.y, place.z
            );
            Finding::percentage("irradiance.region", item, Some(region.percent), words).with_error(Some(region.error))
        }
    });
    findings
}

/// The region whose change is largest against its own noise.
fn worst_region(volume: &Volume, rows: &[ProbeRow], scale: f64, noise: Noise) -> Option<Region> {
    let mut members: Vec<Vec<&ProbeRow>> = vec![Vec::new(); BLOCKS.pow(3) as usize];
    for row in rows {
        members[block(volume, row)].push(row);
    }
    let region = |rows: &Vec<&ProbeRow>| {
        let lit = rows.iter().map(|r| r.irradiance_base.max(r.irradiance_candidate)).sum::<f64>();
        if rows.len() < MIN_REGION || lit < DARK_REGION * scale * rows.len() as f64 {
            return None;
        }
        let parts: Vec<Part> = rows
            .iter()
            .map(|r| Part { base: r.irradiance_base, difference: r.irradiance_candidate - r.irradiance_base })
            .collect();
        let place = rows.iter().map(|r| DVec3::from(r.position_m)).sum::<DVec3>() / rows.len() as f64;
        // Dark before and lit now is a change beyond all measure.
        let Some(found) = change(&parts) else { return Some(Region { percent: f64::MAX.sqrt(), error: 0.0, place }) };
        // Too few lit probes to know their noise.
        let error = if found.percent == 0.0 { 0.0 } else { noise.at_most(found.standard_error?) };
        Some(Region { percent: found.percent, error, place })
    };
    // Against the error and a percent: where there is no noise the largest change counts.
    let weight = |r: &Region| r.percent.abs() / r.error.max(1.0);
    members.iter().filter_map(region).max_by(|a, b| weight(a).total_cmp(&weight(b)))
}

fn distances(item: &str, volume: &Volume, rows: &[ProbeRow]) -> Vec<Finding> {
    let found: Option<Vec<f64>> = rows.iter().map(|r| r.distance_difference_m).collect();
    let Some(found) = found.filter(|found| !found.is_empty()) else { return Vec::new() };
    let percent = 100.0 * mean_square(found.into_iter()).sqrt() / f64::from(volume.grid.spacing_max());
    vec![Finding::percentage(
        "probes.distance",
        item,
        Some(percent),
        "Root mean square difference of the stored distances, as a share of the spacing.",
    )]
}

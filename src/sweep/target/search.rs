//! The bakes of a search, each judged at the same points.

use std::path::Path;
use std::time::Instant;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::align::Walls;
use super::rule::{self, Choice, Next, Step};
use crate::bake::{BakeError, Baked, Circumstances, Prepared, prepare};
use crate::config::Config;
use crate::light::World;
use crate::probe::Grid;
use crate::probe::file::{self, ProbeFile, SceneRecord};
use crate::probe::lattice::Refine;
use crate::probe::query::{Query, Visibility};
use crate::report::error::sampled;
use crate::report::target::{NextReport, NoiseReport, SeenReport, StepReport, StoppedBecause, TargetReport};
use crate::scene::Camera;
use crate::shade::framing::{USUAL_ASPECT, frame};
use crate::shade::held_out::HeldOut;
use crate::system::format;

/// Cameras whose pictures are judged, the first of a scene.
const MOST_CAMERAS: usize = 8;

/// What a search works on.
pub struct Search<'a, 's> {
    pub world: &'a World<'s>,
    /// Its spacing, or that of the default grid, is the first.
    pub config: &'a Config,
    pub circumstances: &'a Circumstances,
    pub scene: &'a SceneRecord,
    /// The file that is to be written, for messages.
    pub output: &'a Path,
    /// Relative error that is asked for.
    pub error: f64,
    /// Probes × samples ÷ those of the configuration that a bake may have: what bounds the time.
    pub most_probes: u64,
}

/// The bake that is kept.
pub struct Found {
    pub config: Config,
    pub baked: Baked,
    pub report: TargetReport,
}

/// Why there is no bake.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    #[error(transparent)]
    Bake(#[from] BakeError),
    #[error(
        "--max-probes {most}: the grid with the largest cells has {least} probes; raise it, or lower placement.refine.mixed.levels"
    )]
    TooFew { most: u64, least: u64 },
}

/// A bake that was judged.
struct Judged {
    config: Config,
    baked: Baked,
    /// Irradiance at the points.
    found: Vec<Vec3>,
    report: StepReport,
}

/// Why there is no further step, with what the user can do.
struct Stop {
    because: StoppedBecause,
    message: String,
}

impl Search<'_, '_> {
    /// Bakes until the error is reached, or something ends the search. `prepared` and `step` are told of every bake.
    ///
    /// # Errors
    /// The first bake fails; or a later one for another reason than too little memory.
    pub fn run(&self, prepared: impl Fn(&Prepared), step: impl Fn(&StepReport)) -> Result<Found, SearchError> {
        let started = Instant::now();
        let scene = self.world.scene;
        let bounds = self.config.grid.bounds.map(|bounds| {
            let relative = |corner: (f64, f64, f64)| (DVec3::from(corner) - scene.origin_world).as_vec3();
            (relative(bounds.min), relative(bounds.max))
        });
        let held_out = HeldOut::new(self.world, bounds, self.error, self.circumstances.seed);
        let points = held_out.points.iter().map(|(_, point)| (point.position.as_dvec3(), point.geometric.as_dvec3()));
        let walls = Walls::of(&points.collect::<Vec<_>>());
        let first = self.first()?;
        let mut kept = self.judge(first, self.circumstances, &held_out, &prepared)?;
        step(&kept.report);
        let mut reports = vec![kept.report.clone()];
        let mut steps: Vec<Step> = Vec::new();
        let mut noise = None;
        let stop = loop {
            let Some(latest) = reports.last().and_then(measured) else { break nothing_to_judge_by(&held_out) };
            steps.push(latest);
            let choice = match rule::next(&steps, self.error, noise.map(|n: NoiseReport| n.error)) {
                Next::Bake(choice) => choice,
                Next::Reached => break Stop::of(StoppedBecause::Reached, "it is reached"),
                Next::NotFalling => {
                    let what = "the error does not fall any more with finer grids and more samples";
                    break Stop::of(StoppedBecause::NotFalling, what);
                }
                Next::Steps => break Stop::of(StoppedBecause::Steps, "that many bakes are the most"),
            };
            let is_finer = steps.iter().all(|s| choice.spacing_m <= s.spacing_m);
            let choice = if is_finer && noise.is_none() && steps.len() == 1 {
                noise = Some(self.noise(&kept, &held_out)?);
                match rule::next(&steps, self.error, noise.map(|n| n.error)) {
                    Next::Bake(choice) => choice,
                    _ => choice,
                }
            } else {
                choice
            };
            if let Some(stop) = self.hopeless(&steps, noise.map(|n| n.error)).filter(|_| is_finer) {
                break stop;
            }
            let choice = match self.within_limit(choice, &steps) {
                Ok(choice) => choice,
                Err(stop) => break stop,
            };
            let choice = self.aligned(choice, &steps, &walls);
            let judged = match self.judge(choice, self.circumstances, &held_out, &prepared) {
                Err(BakeError::Memory(error)) => break Stop::of(StoppedBecause::Memory, &error.to_string()),
                judged => judged?,
            };
            step(&judged.report);
            reports.push(judged.report.clone());
            let with_it: Vec<Step> = reports.iter().filter_map(measured).collect();
            if rule::best(&with_it, self.error) == Some(with_it.len() - 1) {
                kept = judged;
            }
        };
        let next = self.next(&steps, &kept, noise);
        let met = measured(&kept.report).is_some_and(|step| step.meets(self.error));
        let few = (!met).then(|| self.few_points(&kept, &held_out)).flatten();
        let report = TargetReport {
            error: self.error,
            reached: kept.report.error,
            standard_error: kept.report.standard_error,
            met,
            seen: self.seen(&kept)?,
            points: held_out.points.len(),
            paths: held_out.paths(),
            most_bakes: rule::MOST_STEPS,
            most_probes: self.most_probes,
            steps: reports,
            noise,
            stopped_because: stop.because,
            message: [Some(stop.message), few].into_iter().flatten().collect::<Vec<_>>().join("; "),
            next,
            time_s: started.elapsed().as_secs_f64(),
        };
        Ok(Found { config: kept.config, baked: kept.baked, report })
    }

    /// Where the error is, in words, if few points hold it: beside a small lamp, say, which no grid resolves.
    fn few_points(&self, kept: &Judged, held_out: &HeldOut) -> Option<String> {
        /// Share of the points that are few.
        const FEW: f64 = 1e-3;
        let of = held_out.points.len();
        let few = sampled::concentration(&kept.found, &held_out.truth)?;
        let (_, point) = held_out.points.get(few.worst).filter(|_| few.points as f64 <= FEW * of as f64)?;
        let [x, y, z] = (self.world.scene.origin_world + point.position.as_dvec3()).to_array();
        let (points, times) = (few.points, format::significant(few.times_mean, 2));
        Some(format!(
            "half of the squared error is that of {points} of {of} points, most of it at ({x:.2}, {y:.2}, {z:.2}) with \
             {times} times the mean light"
        ))
    }

    fn config(&self, choice: Choice) -> Config {
        let mut config = self.config.with_samples(choice.samples);
        config.grid.spacing_m = Some(choice.spacing_m);
        config
    }

    /// Bakes, and asks what would be read of the file.
    fn judge(
        &self,
        choice: Choice,
        circumstances: &Circumstances,
        held_out: &HeldOut,
        prepared: &impl Fn(&Prepared),
    ) -> Result<Judged, BakeError> {
        let started = Instant::now();
        let config = self.config(choice);
        let bake = prepare(self.world, &config, circumstances)?;
        prepared(&bake);
        let baked = bake.bake(circumstances, self.scene)?;
        let time_s = started.elapsed().as_secs_f64();
        let file = file::as_read(&baked.container, self.output)?;
        let found = self.ask(&file, held_out);
        let error = sampled::relative(&found, &held_out.truth);
        let report = StepReport {
            spacing_m: choice.spacing_m,
            samples_factor: choice.samples,
            probes: file.volume_in_grid().states.len(),
            error: error.map(|(error, _)| error),
            standard_error: error.map(|(_, standard_error)| standard_error),
            bytes: file.file_bytes,
            time_s,
        };
        Ok(Judged { config, baked, found, report })
    }

    /// Look-ups of the file at the points.
    fn ask(&self, file: &ProbeFile, held_out: &HeldOut) -> Vec<Vec3> {
        let volume = file.volume_as_planned(self.world.scene.origin_world);
        let query = Query { volume: &volume, settings: &file.query.weights };
        let ask = |(_, point): &(_, _)| query.irradiance(point, Visibility::Stored);
        held_out.points.par_iter().map(ask).collect()
    }

    /// The error over what cameras see; nothing where there is no light to judge by.
    fn seen(&self, kept: &Judged) -> Result<Vec<SeenReport>, BakeError> {
        let (world, seed) = (self.world, self.circumstances.seed);
        if kept.report.error.is_none() {
            return Ok(Vec::new());
        }
        let file = file::as_read(&kept.baked.container, self.output)?;
        let of_camera = |(index, camera): (usize, &Camera)| {
            let picture = HeldOut::in_picture(world, camera, index as u64, self.error, seed);
            let error = sampled::relative(&self.ask(&file, &picture), &picture.truth);
            SeenReport {
                camera: camera.name.clone(),
                error: error.map(|(error, _)| error),
                standard_error: error.map(|(_, standard_error)| standard_error),
            }
        };
        let framed = match (world.scene.cameras.is_empty(), world.scene.mesh.bounds()) {
            (true, Some(bounds)) => vec![frame(world, bounds, USUAL_ASPECT).0],
            _ => Vec::new(),
        };
        Ok(framed.iter().chain(&world.scene.cameras).take(MOST_CAMERAS).enumerate().map(of_camera).collect())
    }

    /// What random numbers of the bake add to its error: half of the squared difference from the same bake by others.
    fn noise(&self, of: &Judged, held_out: &HeldOut) -> Result<NoiseReport, BakeError> {
        let circumstances =
            Circumstances { seed: self.circumstances.seed.wrapping_add(1), ..self.circumstances.clone() };
        let choice = Choice { spacing_m: of.report.spacing_m, samples: of.report.samples_factor };
        let other = self.judge(choice, &circumstances, held_out, &|_| ())?;
        let error = sampled::relative_difference(&of.found, &other.found, &held_out.truth);
        Ok(NoiseReport { error: error.unwrap_or(0.0) / 2f64.sqrt(), time_s: other.report.time_s })
    }

    fn probes(&self, choice: Choice) -> Result<u64, BakeError> {
        let config = self.config(choice);
        Ok(Grid::refined(&config.grid, config.placement.refine, self.world.scene)?.probe_count() as u64)
    }

    /// The same with a spacing that fits the walls better, unless a step has it already or it has too many probes.
    fn aligned(&self, choice: Choice, steps: &[Step], walls: &Walls) -> Choice {
        /// Spacings so near to each other are the same.
        const SAME: f64 = 1.02;
        let config = self.config(choice);
        // Each mixed grid would be a tree of its own.
        let is_uniform = config.placement.refine == Refine::default();
        let Some(voxels) = config.store.occlusion.survey_voxels().filter(|_| is_uniform) else { return choice };
        let lattice = |spacing_m: f64| {
            let settings = self.config(Choice { spacing_m, ..choice }).grid;
            let grid = Grid::refined(&settings, Refine::default(), self.world.scene).ok()?;
            Some((grid.origin().as_dvec3(), grid.spacing().as_dvec3() / f64::from(voxels)))
        };
        let aligned = Choice { spacing_m: walls.aligned(choice.spacing_m, lattice), ..choice };
        let is_new = |step: &Step| (step.spacing_m / aligned.spacing_m).ln().abs() > SAME.ln();
        // Samples are raised at the spacing that there is.
        let is_tried = steps.iter().any(|step| step.spacing_m == choice.spacing_m);
        let fits = || self.probes(aligned).is_ok_and(|probes| self.is_allowed(probes, aligned.samples));
        if !is_tried && steps.iter().all(is_new) && fits() { aligned } else { choice }
    }

    fn is_allowed(&self, probes: u64, samples: u32) -> bool {
        probes.saturating_mul(u64::from(samples)) <= self.most_probes
    }

    /// Whether the error takes a grid beyond the limit, at the pace of the errors so far: finer bakes would only cost.
    fn hopeless(&self, steps: &[Step], noise: Option<f64>) -> Option<Stop> {
        let wanted = rule::wanted(steps, self.error, noise)?;
        let samples = most_samples(steps);
        let probes = self.probes(wanted);
        if probes.as_ref().is_ok_and(|&probes| self.is_allowed(probes, samples)) {
            return None;
        }
        let (asked, spacing_m) = (format::percent(self.error), format::significant(wanted.spacing_m, 3));
        let many = probes.map_or_else(|error| error.to_string(), |probes| format!("{probes} probes"));
        let (times, most) = (times(samples), self.most_probes);
        let what = format!(
            "at the pace of the errors so far {asked} takes a grid of {spacing_m} m or finer{times}, {many}: beyond {most} \
             (--max-probes)"
        );
        Some(Stop::of(StoppedBecause::Probes, &what))
    }

    /// The spacing that is there; where it has more probes than allowed, one larger.
    fn first(&self) -> Result<Choice, SearchError> {
        let spacing_m = self.config.grid.spacing_in(self.world.scene).map_err(BakeError::from)?;
        let mut choice = Choice { spacing_m, samples: 1 };
        let mut least = u64::MAX;
        loop {
            let probes = self.probes(choice)?;
            if probes <= self.most_probes {
                return Ok(choice);
            }
            // Twice the spacing has fewer probes, as long as there are several cells.
            if probes >= least {
                return Err(SearchError::TooFew { most: self.most_probes, least });
            }
            least = probes;
            choice.spacing_m = rule::rounded_up(choice.spacing_m / rule::FINEST_STEP);
        }
    }

    /// The choice, or one as near to it as the limit of probes allows.
    fn within_limit(&self, choice: Choice, steps: &[Step]) -> Result<Choice, Stop> {
        /// Spacings that are tried are so far apart.
        const RATIO: f64 = 1.05;
        let finest = steps.iter().map(|s| s.spacing_m).fold(f64::INFINITY, f64::min);
        let samples = most_samples(steps);
        let mut tried = choice;
        loop {
            let probes = self.probes(tried);
            if probes.as_ref().is_ok_and(|&probes| self.is_allowed(probes, tried.samples)) {
                return Ok(tried);
            }
            // Chance is the lesser part of most errors.
            if tried.samples > samples {
                tried.samples = (tried.samples / 2).max(samples);
            } else {
                tried.spacing_m = rule::rounded_up(tried.spacing_m * RATIO);
            }
            if tried.samples <= samples && tried.spacing_m > rule::LEAST_STEP * finest {
                let (spacing_m, times) = (format::significant(choice.spacing_m, 3), times(samples));
                let what = match probes {
                    Ok(_) => {
                        format!("a grid of {spacing_m} m{times} is beyond {} probes (--max-probes)", self.most_probes)
                    }
                    Err(error) => error.to_string(),
                };
                return Err(Stop::of(StoppedBecause::Probes, &what));
            }
        }
    }

    /// What the bake would be that follows: that of the rule, or with half the spacing where the error is reached.
    fn next(&self, steps: &[Step], kept: &Judged, noise: Option<NoiseReport>) -> Option<NextReport> {
        let known = noise.map(|noise| noise.error);
        let from = measured(&kept.report)?;
        let choice = if from.meets(self.error) { rule::halved(&from) } else { rule::finer(steps, self.error, known) };
        let more = self.probes(choice).ok()? as f64 / kept.report.probes as f64;
        let samples = f64::from(choice.samples) / f64::from(kept.report.samples_factor);
        Some(NextReport {
            spacing_m: choice.spacing_m,
            samples_factor: choice.samples,
            predicted_error: rule::predicted(steps, &from, &choice, known),
            predicted_bytes: (more * kept.report.bytes as f64) as u64,
            predicted_time_s: more * samples * kept.report.time_s,
        })
    }
}

impl Stop {
    fn of(because: StoppedBecause, message: &str) -> Stop {
        Stop { because, message: message.to_owned() }
    }
}

/// The most samples of all steps.
fn most_samples(steps: &[Step]) -> u32 {
    steps.iter().map(|step| step.samples).max().unwrap_or(1)
}

/// Samples in words; nothing where they are those of the configuration.
fn times(samples: u32) -> String {
    if samples > 1 { format!(" with {samples} × the samples") } else { String::new() }
}

fn nothing_to_judge_by(held_out: &HeldOut) -> Stop {
    if held_out.points.is_empty() {
        let what = "no surface faces the box of the probes (grid.bounds), so that there is nothing to judge a bake by";
        return Stop::of(StoppedBecause::NoSurface, what);
    }
    let what = "no indirect light arrives at the surfaces, so that no error is relative to it";
    Stop::of(StoppedBecause::Dark, what)
}

fn measured(report: &StepReport) -> Option<Step> {
    Some(Step {
        spacing_m: report.spacing_m,
        samples: report.samples_factor,
        error: report.error?,
        standard_error: report.standard_error?,
        bytes: report.bytes,
    })
}

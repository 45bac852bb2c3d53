//! The bakes of a sweep, one after the other: each has all threads.

use glam::Vec3;

use super::sheet::Shown;
use super::summary::Outcome;
use crate::cli::SweepArgs;
use crate::commands::Console;
use crate::evaluate::Comparison;
use crate::report::sweep::{FloorReport, LadderReport};
use crate::sweep::ladder::Ladder;
use crate::sweep::run::{Finished, Setting};
use crate::sweep::split::{SeedScatter, Split};
use crate::sweep::{SweepError, floor};

pub struct Work<'a, 's> {
    setting: &'a Setting<'a, 's>,
    ladders: &'a [Ladder],
    seeds: Vec<u64>,
    console: &'a Console,
    pub bar: indicatif::ProgressBar,
    /// Runs that were there before.
    pub kept: usize,
}

impl<'a, 's> Work<'a, 's> {
    pub fn new(
        setting: &'a Setting<'a, 's>,
        ladders: &'a [Ladder],
        args: &SweepArgs,
        wants_floors: bool,
        console: &'a Console,
    ) -> Self {
        let seeds: Vec<u64> = (0..u64::from(args.seeds)).map(|k| args.trace.seed.wrapping_add(k)).collect();
        let rungs = ladders.iter().flat_map(|ladder| &ladder.rungs);
        let runs = rungs.map(|rung| rung.configs().len()).sum::<usize>() * seeds.len();
        let floors = if wants_floors { floor::STEPS * ladders.len() } else { 0 };
        let bar = console.progress.stage("sweep", runs + floors);
        Work { setting, ladders, seeds, console, bar, kept: 0 }
    }

    /// Every configuration on every grid with every seed, in the order of the ladders.
    pub fn run_all(&mut self) -> Result<Vec<Outcome>, SweepError> {
        let view = self.setting.scenery.view;
        let mut all = Vec::new();
        for (ladder, rung) in self.ladders.iter().enumerate().flat_map(|(i, l)| l.rungs.iter().map(move |r| (i, r))) {
            let (mut runs, mut splits) = (Vec::new(), Vec::new());
            self.bar.set_message(rung.label.clone());
            for (offset, config) in rung.configs() {
                let mut scatter = SeedScatter::new(view.width as usize * view.height as usize);
                for &seed in &self.seeds {
                    let warn = |what: String| self.console.warn(what);
                    let Finished { mut record, irradiance, kept } =
                        self.setting.obtain(&rung.label, config, seed, warn)?;
                    scatter.add(&irradiance);
                    self.kept += usize::from(kept);
                    let from = if kept { "kept from before" } else { "done" };
                    self.console.say(format!("{}, seed {seed}: {from}, bake {:.3} s", rung.label, record.bake_s));
                    record.offset = offset;
                    runs.push(record);
                    self.bar.inc(1);
                }
                let Comparison { layers, regions, .. } = &self.setting.comparison;
                splits.push(scatter.split(layers, regions));
            }
            all.push(Outcome::new(ladder, rung, runs, Split::pooled(&splits), self.setting.reference_mean));
        }
        Ok(all)
    }

    /// What each ladder's best configuration shows: its first run, which is kept by now.
    pub fn shown(&self, ladders: &[LadderReport], outcomes: &[Outcome]) -> Result<Vec<Shown>, SweepError> {
        let mut all = Vec::new();
        for ladder in ladders {
            let best = ladder.best.or(ladder.configurations.first().copied());
            let Some((configuration, best)) = best.and_then(|i| Some((i, outcomes.get(i)?))) else { continue };
            let Some(seed) = self.seeds.first() else { continue };
            let warn = |what: String| self.console.warn(what);
            let Finished { irradiance, .. } = self.setting.obtain(&best.report.label, &best.config, *seed, warn)?;
            all.push(Shown { configuration, irradiance });
        }
        Ok(all)
    }

    /// What each configuration shows, per pixel, W·m⁻²: its first run, which is kept by now.
    pub fn irradiance(&self, outcomes: &[Outcome]) -> Result<Vec<Vec<Vec3>>, SweepError> {
        let seed = self.seeds.first().copied().unwrap_or_default();
        let first = |outcome: &Outcome| {
            let warn = |what: String| self.console.warn(what);
            Ok(self.setting.obtain(&outcome.report.label, &outcome.config, seed, warn)?.irradiance)
        };
        outcomes.iter().map(first).collect()
    }

    /// What limits each ladder's best configuration.
    pub fn floors(&self, ladders: &[LadderReport], outcomes: &[Outcome]) -> Result<Vec<FloorReport>, SweepError> {
        let mut floors = Vec::new();
        for ladder in ladders {
            let Some((index, best)) = ladder.best.and_then(|i| Some((i, outcomes.get(i)?))) else { continue };
            let Some(base) = best.report.runs.first() else { continue };
            self.bar.set_message(format!("what limits {}", best.report.label));
            let which = (ladder.name.as_str(), index, best.report.label.as_str());
            let warn = |what: String| self.console.warn(what);
            floors.push(floor::measure(self.setting, which, &best.config, base, &warn, &|| self.bar.inc(1))?);
        }
        Ok(floors)
    }
}

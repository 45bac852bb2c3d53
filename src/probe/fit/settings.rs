//! What a method says about fitting its probes.

use serde::{Deserialize, Serialize};

use crate::probe::query::QuerySettings;
use crate::probe::store::IrradianceStore;

/// Which values probes get in place of those that light has where they stand.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// They keep them.
    #[default]
    None,
    /// Those by which look-ups come nearest to path-traced light at points of surfaces and of the air.
    Rows(RowSettings),
}

/// Which of three kinds a point is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// On a surface, with its shading normal.
    Surface,
    /// On a surface, with a normal beside its own, as normal maps have them. Without these only the few directions are right
    /// that walls ask for.
    Bent,
    /// In free air, with any normal.
    Air,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RowSettings {
    /// Points on surfaces for each active probe; half as many more with bent normals, and half as many in the air.
    pub rows_per_probe: u32,
    /// Paths from each point where there are [`USUAL_ROWS`], in proportion more where there are fewer: see [`RowSettings::paths`].
    pub paths: u32,
    /// The same for points of surfaces where fewer leave much noise. With 8 errors in pictures of two_rooms_open's dark side,
    /// cornell, courtyard and office are 1.01 to 1.08 × those with 16, for 0.74 to 0.98 × the time.
    pub most_paths: u32,
    /// Weight of a row with a bent normal, beside 1 of the surface's own; 0: there are none.
    pub bent: f32,
    /// Weight of a row in the air; 0: there are none. With 0.2 errors are 1.1 times as large in pictures of office and cornell, and
    /// as they are in their air. With half as many rows and 0.03 they were up to a tenth larger in courtyard's air.
    pub air: f32,
    /// How much a squared difference of values from those before the fit counts beside one of a row. With 0.02 errors in pictures
    /// of cornell, courtyard and office are 1.01 to 1.03 × as large, in their air 0.97 to 1 ×; with 0.06 in office and cornell 1.09 and
    /// 1.15 × and 0.97 and 0.95 ×. Maps of few rows want more: with 30 for 8² texels 0.01 makes the air of two_rooms_open worse.
    pub lambda: f32,
    /// Most iterations of the solver.
    pub iterations: u32,
}

/// Rows a probe that the numbers of paths are given for. With 75 errors in office are 1.1 times as large, and with a quarter of
/// them 1.4 times as large as that.
const USUAL_ROWS: u32 = 150;

/// Most rows of a probe, paths of a row and iterations.
const MOST_ROWS: u32 = 65_536;

impl Default for RowSettings {
    fn default() -> Self {
        RowSettings {
            rows_per_probe: USUAL_ROWS,
            paths: 2,
            most_paths: 10,
            bent: 0.5,
            air: 0.1,
            lambda: 0.01,
            iterations: 40,
        }
    }
}

impl RowSettings {
    /// Points that are looked for: on surfaces, there with bent normals, in the air. At least as many as the probes of a cell have:
    /// the fewer rows there are in all, the more their noise shows.
    pub fn points(&self, active: usize) -> [usize; 3] {
        const CELL: usize = 8;
        let all = self.rows_per_probe as usize * active.max(CELL);
        let half = |weight: f32| if weight > 0.0 { all / 2 } else { 0 };
        [all, half(self.bent), half(self.air)]
    }

    /// How many times fewer rows there are than usually; 1 where there are as many or more.
    pub fn scarcity(&self) -> f32 {
        (USUAL_ROWS as f32 / self.rows_per_probe as f32).max(1.0)
    }

    /// Paths from each point of a kind of row, least and most.
    ///
    /// The fewer rows there are the more each of them counts, noise and all. With 38 rows errors in pictures of ten are 1.04 to
    /// 1.17 times those with 150.
    ///
    /// A row of weight ω adds ω²σ²/n of noise to the sums. For a given number of paths in all that is least with n in proportion to ω,
    /// but for the least: with half of it for bent normals and the air, probes that hang on few rows of the air differed by 109 %
    /// between two seeds in a corner of courtyard.
    pub fn paths(&self, kind: Kind) -> [u32; 2] {
        let weight = match kind {
            Kind::Surface => 1.0,
            Kind::Bent => self.bent.min(1.0),
            Kind::Air => self.air.min(1.0),
        };
        let of_row = |paths: u32, share: f32| (paths as f32 * share * self.scarcity()).ceil() as u32;
        let least = of_row(self.paths, 1.0);
        [least, of_row(self.most_paths, weight).max(least)]
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        let count = "use 1 to 65536";
        for (key, value) in [
            ("fit.rows.rows_per_probe", self.rows_per_probe),
            ("fit.rows.paths", self.paths),
            ("fit.rows.most_paths", self.most_paths),
            ("fit.rows.iterations", self.iterations),
        ] {
            rule(key, value.to_string(), (1..=MOST_ROWS).contains(&value), count);
        }
        for (key, value) in [("fit.rows.bent", self.bent), ("fit.rows.air", self.air)] {
            rule(key, value.to_string(), (0.0..=1e3).contains(&value), "use a number from 0 to 1000");
        }
        let holds = (1e-6..=1e9).contains(&self.lambda);
        rule("fit.rows.lambda", self.lambda.to_string(), holds, "use a number from 1e-6 to 1e9");
    }
}

impl Fit {
    pub fn is_none(&self) -> bool {
        *self == Fit::None
    }

    /// The same from so many times as many rows, or, where these are as many as there may be, nearly so many.
    pub fn with_samples(&self, times: u32) -> Fit {
        match self {
            Fit::None => Fit::None,
            Fit::Rows(settings) => {
                let rows_per_probe = settings.rows_per_probe.saturating_mul(times).min(MOST_ROWS);
                Fit::Rows(RowSettings { rows_per_probe, ..settings.clone() })
            }
        }
    }

    /// Why these look-ups cannot be fitted, with the remedy; `None` where they can. Least squares need sums: means of roots
    /// and curves are none.
    pub fn mismatch(&self, query: &QuerySettings, store: &IrradianceStore) -> Option<String> {
        if self.is_none() {
            return None;
        }
        let what = if query.is_linear() { store.unfit() } else { Some("query.blend must be linear") };
        what.map(|what| format!("fit is rows: {what}; or set fit to none"))
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        match self {
            Fit::None => {}
            Fit::Rows(settings) => settings.check(rule),
        }
    }
}

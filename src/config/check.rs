//! What values a configuration may have. Every number is held against its range here, NaN and infinities included.

use super::{Config, ConfigError};
use crate::probe::capture::ReflectedLight;
use crate::probe::lattice::grid::Bounds;
use crate::probe::query::{DirectionWeight, VisibilitySettings};
use crate::probe::store::surface::MAX_VOXELS_PER_CELL;

/// Largest resolution of any octahedral map, texels per side.
const MAX_RESOLUTION: usize = 1024;

/// Coordinates and distances, metres: squares and cubes of such lengths are far from the end of f32.
const MAX_LENGTH_M: f64 = 1e9;
/// Smallest distance of probes, metres: its cube is not yet denormal in f32.
const MIN_SPACING_M: f64 = 1e-12;

const SIZE_RULE: &str = "use 1 to 1024 texels";
const UNIT_RULE: &str = "use a number from 0 to 1";
const POSITIVE_RULE: &str = "use a finite number, not negative";

impl Config {
    /// Refuses what no stage could work with.
    pub(super) fn check(&self, place: &str) -> Result<(), ConfigError> {
        let mut first_error = Ok(());
        let mut rule = |key: &'static str, value: String, holds: bool, rule: &'static str| {
            if !holds && first_error.is_ok() {
                first_error = Err(ConfigError::OutOfRange { place: place.to_owned(), key, value, rule });
            }
        };
        let size = |n: usize| (1..=MAX_RESOLUTION).contains(&n);
        let not_negative = |x: f32| x.is_finite() && x >= 0.0;
        let unit = |x: f32| (0.0..=1.0).contains(&x);
        let g = &self.grid;
        if let Some(spacing) = g.spacing_m {
            let holds = (MIN_SPACING_M..=MAX_LENGTH_M).contains(&spacing);
            rule("grid.spacing_m", spacing.to_string(), holds, "use a positive number of metres, 1e-12 to 1e9");
        }
        if let Some(divisions) = g.divisions {
            let holds = divisions.0 > 0 && divisions.1 > 0 && divisions.2 > 0;
            rule("grid.divisions", format!("{divisions:?}"), holds, "every axis needs at least one probe");
        }
        if let Some(Bounds { min, max }) = g.bounds {
            let axis = |low: f64, high: f64| -MAX_LENGTH_M <= low && low <= high && high <= MAX_LENGTH_M;
            let holds = axis(min.0, max.0) && axis(min.1, max.1) && axis(min.2, max.2);
            let rule_text = "min must not be above max, both from -1e9 to 1e9 m";
            rule("grid.bounds", format!("(min: {min:?}, max: {max:?})"), holds, rule_text);
        }
        rule("grid.padding", g.padding.to_string(), (0.0..=1.0).contains(&g.padding), UNIT_RULE);
        let (c, f, q, s) = (&self.capture, &self.filter, &self.query, &self.solver);
        rule("capture.resolution", c.resolution.to_string(), size(c.resolution), SIZE_RULE);
        let samples = c.samples_per_texel;
        rule("capture.samples_per_texel", samples.to_string(), (1..=65_536).contains(&samples), "use 1 to 65536");
        let emitter = c.emitter_samples;
        rule("capture.emitter_samples", emitter.to_string(), (1..=65_536).contains(&emitter), "use 1 to 65536");
        if let ReflectedLight::PathTraced { paths } = c.reflected {
            let holds = (1..=1 << 20).contains(&paths);
            rule("capture.reflected.path_traced.paths", paths.to_string(), holds, "use 1 to 1048576");
        }
        let probe = c.probe_emitter_samples;
        rule("capture.probe_emitter_samples", probe.to_string(), probe <= 1 << 20, "use 0 to 1048576");
        rule(
            "filter.irradiance_resolution",
            f.irradiance_resolution.to_string(),
            size(f.irradiance_resolution),
            SIZE_RULE,
        );
        rule("filter.distance_resolution", f.distance_resolution.to_string(), size(f.distance_resolution), SIZE_RULE);
        let exponent = f.distance_exponent;
        rule("filter.distance_exponent", exponent.to_string(), (1.0..=1e4).contains(&exponent), "use 1 to 10000");
        let clamp = f.distance_clamp;
        rule("filter.distance_clamp", clamp.to_string(), (1.0..=1e3).contains(&clamp), "use 1 to 1000 cell diagonals");
        rule(
            "placement.rays",
            self.placement.rays.to_string(),
            (1..=65_536).contains(&self.placement.rays),
            "use 1 to 65536",
        );
        let share = self.placement.back_face_share;
        rule("placement.back_face_share", share.to_string(), unit(share), UNIT_RULE);
        let scale = self.lights.punctual_scale;
        rule("lights.punctual_scale", scale.to_string(), not_negative(scale), POSITIVE_RULE);
        if let Some(sky) = self.lights.sky {
            let holds = not_negative(sky.0) && not_negative(sky.1) && not_negative(sky.2);
            rule("lights.sky", format!("{sky:?}"), holds, POSITIVE_RULE);
        }
        rule("solver.tolerance", s.tolerance.to_string(), not_negative(s.tolerance), POSITIVE_RULE);
        if let Some(bounces) = s.max_bounces {
            rule("solver.max_bounces", bounces.to_string(), bounces <= 1 << 20, "use 0 to 1048576, or None for all");
        }
        let sweeps = s.max_sweeps;
        rule("solver.max_sweeps", sweeps.to_string(), (1..=1 << 20).contains(&sweeps), "use 1 to 1048576");
        let albedo = s.albedo_max;
        rule(
            "solver.albedo_max",
            albedo.to_string(),
            (0.0..1.0).contains(&albedo),
            "use a number from 0 up to but not including 1",
        );
        rule("encoding.border", self.encoding.border.to_string(), self.encoding.border <= 1, "use 0 or 1");
        for (key, value) in [
            ("query.trilinear_floor", q.trilinear_floor),
            ("query.weight_floor", q.weight_floor),
            ("query.crush_below", q.crush_below),
            ("query.normal_bias", q.normal_bias),
            ("query.view_bias", q.view_bias),
        ] {
            rule(key, value.to_string(), unit(value), UNIT_RULE);
        }
        match q.direction {
            DirectionWeight::Uniform => {}
            DirectionWeight::Cosine { floor } => {
                rule("query.direction.cosine.floor", floor.to_string(), unit(floor), UNIT_RULE)
            }
            DirectionWeight::Wrap { offset } => {
                rule("query.direction.wrap.offset", offset.to_string(), unit(offset), UNIT_RULE)
            }
        }
        match q.visibility {
            VisibilitySettings::None => {}
            VisibilitySettings::Moments { power, floor } => {
                rule("query.visibility.moments.power", power.to_string(), not_negative(power), POSITIVE_RULE);
                rule("query.visibility.moments.floor", floor.to_string(), unit(floor), UNIT_RULE);
            }
            VisibilitySettings::Surface { voxels_per_cell: n } => {
                let holds = (1..=MAX_VOXELS_PER_CELL).contains(&n);
                rule("query.visibility.surface.voxels_per_cell", n.to_string(), holds, "use 1 to 22");
            }
        }
        first_error
    }
}

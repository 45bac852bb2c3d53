//! What values a configuration may have. Every number is held against its range, NaN and infinities included: here, and
//! in the settings of the stages.

use super::ron_text::ConfigError;
use super::settings::{Config, STAGES};
use crate::probe::lattice::grid::Bounds;
use crate::probe::store::radiance::LightFieldStore;
use crate::scene::Unassigned;
use crate::scene::light::LIGHT_MAX;

/// Largest resolution of any octahedral map, texels per side.
pub const MAX_RESOLUTION: usize = 1024;

/// Largest factor on punctual lights. Units differ by 683 at most, and the product with the brightest light that is
/// computed with, 1e30, must be finite in f32.
const MAX_PUNCTUAL_SCALE: f32 = 1e6;

/// Coordinates and distances, metres: squares and cubes of such lengths are far from the end of f32.
const MAX_LENGTH_M: f64 = 1e9;
/// Smallest distance of probes, metres: its cube is not yet denormal in f32.
const MIN_SPACING_M: f64 = 1e-12;

const UNIT_RULE: &str = "use a number from 0 to 1";

impl Config {
    /// What of two stages does not go together, with the remedy, and the sections that say it; `None` where all does.
    pub(super) fn mismatch(&self) -> Option<(&'static [&'static str], String)> {
        let Config { capture, placement, transport, store, fit, query, .. } = self;
        if let Some(what) = query.mismatch(&store.occlusion) {
            return Some((&["store", "query"], what));
        }
        if let Some(what) = fit.mismatch(query, &store.irradiance) {
            return Some((&["fit", "query", "store"], what));
        }
        if let Some(what) = store.radiance().mismatch(capture.rays.side()) {
            return Some((&["store", "capture"], what));
        }
        let both: &[&str] = &["transport", "capture", "store"];
        if transport.needs_gathered_emission() && !capture.gathers_emission() {
            return Some((both, "transport is frames: capture.emission must be gathered".to_owned()));
        }
        if transport.mixes_samples() && !store.irradiance.is_irradiance() {
            return Some((both, "transport is frames: store.irradiance must be octahedral".to_owned()));
        }
        if transport.needs_light_field() && store.light_field == LightFieldStore::None {
            return Some((both, "transport is tracing: store.light_field must be maps".to_owned()));
        }
        if !transport.captures_once() && !store.radiance().is_empty() {
            let what = "transport is frames: store.light_field must be none and store.prefiltered empty";
            return Some((both, what.to_owned()));
        }
        if capture.backs.are_left_out() && !transport.may_leave_out() {
            let what = "capture.backs.radiance leave_out is for transport frames; use reflect with others";
            return Some((both, what.to_owned()));
        }
        let (rays, reserved) = (capture.rays.count(), placement.rule.reserved_rays());
        if capture.rays.lends_rays() && rays <= reserved {
            let what =
                format!("capture.rays.fibonacci.count is {rays}: placement.rule keeps {reserved} of them; use more");
            return Some((&["capture", "placement"], what));
        }
        let has_radiance = !store.radiance().is_empty();
        let marches = store.light_field.marches();
        if let Some(what) = query.glossy.mismatch(has_radiance, marches).or(query.diffuse.mismatch(marches)) {
            return Some((&["store", "query"], what));
        }
        None
    }

    /// Refuses what no stage could work with.
    pub(super) fn check(&self, place: &str) -> Result<(), ConfigError> {
        let mut first_error = Ok(());
        let mut rule = |key: &'static str, value: String, holds: bool, rule: &'static str| {
            if !holds && first_error.is_ok() {
                let (place, value) = (place.to_owned(), shown(value));
                first_error = Err(ConfigError::OutOfRange { place, key, value, rule });
            }
        };
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
        let scale = self.lights.punctual_scale;
        let scale_rule = "use a number from 0 to 1e6";
        rule("lights.punctual_scale", scale.to_string(), (0.0..=MAX_PUNCTUAL_SCALE).contains(&scale), scale_rule);
        if let Some(sky) = self.lights.sky {
            let holds = [sky.0, sky.1, sky.2].iter().all(|channel| (0.0..=LIGHT_MAX).contains(channel));
            rule("lights.sky", format!("{sky:?}"), holds, "use numbers from 0 to 1e30");
        }
        let albedo = self.materials.albedo_max;
        let albedo_rule = "use a number from 0 up to but not including 1";
        rule("materials.albedo_max", albedo.to_string(), (0.0..1.0).contains(&albedo), albedo_rule);
        if let Unassigned::Diffuse { albedo } = self.materials.unassigned {
            let key = "materials.unassigned.diffuse.albedo";
            rule(key, albedo.to_string(), (0.0..=1.0).contains(&albedo), UNIT_RULE);
        }
        rule("store.border", self.store.border.to_string(), self.store.border <= 1, "use 0 or 1");
        self.placement.refine.check(&mut rule);
        self.placement.rule.check(&mut rule);
        self.placement.survey.check(&mut rule);
        self.capture.check(MAX_RESOLUTION, &mut rule);
        self.transport.check(&mut rule);
        self.store.irradiance.check(MAX_RESOLUTION, &mut rule);
        self.store.occlusion.check(MAX_RESOLUTION, &mut rule);
        self.fit.check(&mut rule);
        self.query.check(&mut rule);
        for stage in &self.plan.keep {
            let known = STAGES.contains(&stage.as_str());
            rule(
                "plan.keep",
                stage.clone(),
                known,
                "use punctual_shadow_rays, emissive_surfaces, sky, alpha_test, textures, radiance_levels, unused_probes or visibility",
            );
        }
        first_error
    }
}

/// A value for a message: numbers of more than a line's part of digits with an exponent.
fn shown(value: String) -> String {
    const MOST_CHARACTERS: usize = 20;
    match value.parse::<f64>() {
        Ok(number) if value.len() > MOST_CHARACTERS => format!("{number:e}"),
        _ => value,
    }
}

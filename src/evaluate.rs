//! A volume of probes judged by a picture: the light that it gives with each way of treating visibility, what leaks, what it costs,
//! and how far it is from a reference. `render` does it once for every camera, `sweep` for every configuration.

use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;

use crate::image::LayeredImage;
use crate::light::World;
use crate::math::color::luminance;
use crate::probe::Volume;
use crate::probe::capture::CaptureSettings;
use crate::probe::query::Answers;
use crate::probe::transport::truth::Truth;
use crate::report::baked::{self, BakedReport};
use crate::report::reference_layers::ReferenceLayers;
use crate::report::render::{MethodReport, Timing};
use crate::report::{air, error, leak};
use crate::shade::air::{Air, AirTruth};
use crate::shade::layers::compose;
use crate::shade::points::View;
use crate::shade::regions::Region;
use crate::shade::visibility_modes::{VisibilityMode, exact_masks, irradiance, time_lookup, time_shading};
use crate::system::progress::Progress;

/// Name in the report of probes lit by full paths, with exact visibility.
pub const PATH_RAY: &str = "path_ray";

/// Where a picture is evaluated: what a camera sees, which is the same for all probes.
pub struct Scenery<'a, 's> {
    pub world: &'a World<'s>,
    pub view: &'a View,
    /// Time of the primary rays.
    pub primary_s: f64,
    /// Of the points in the air.
    pub seed: u64,
}

/// The picture and the figures of one visibility mode.
pub struct Shaded {
    pub mode: VisibilityMode,
    /// At every point of the view, W·m⁻².
    pub irradiance: Vec<Vec3>,
    /// At every point of the air, W·m⁻².
    pub in_air: Vec<Vec3>,
    pub report: MethodReport,
    pub image: LayeredImage,
}

/// What all pictures are compared with.
pub struct Comparison<'a> {
    pub layers: &'a ReferenceLayers,
    /// Of every pixel, `None` where it shows no surface.
    pub regions: &'a [Option<Region>],
    /// Whether the reference's surfaces are glossy, as those of probes are not.
    pub glossy: bool,
    pub exposure_ev: f32,
    pub seed: u64,
}

/// What rays found out about the points that ask some probes.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    /// Which probes the view's points see, and the seconds that it took to find out.
    pub masks: &'a [u8],
    pub masks_s: f64,
    pub air: &'a Air,
}

impl Scenery<'_, '_> {
    /// Which probes the view's points see, and the seconds that it took to find out.
    pub fn masks(&self, query: &impl Answers) -> (Vec<u8>, f64) {
        let started = Instant::now();
        let masks = exact_masks(self.world, query, &self.view.points);
        (masks, started.elapsed().as_secs_f64())
    }

    /// Points of free air, and which probes they see.
    pub fn air(&self, query: &impl Answers) -> Air {
        Air::new(self.world, query, self.seed)
    }

    /// The three ways of treating visibility; `step` is called after each.
    pub fn shade(
        &self,
        query: &impl Answers,
        Seen { masks, masks_s, air }: Seen,
        bytes_per_probe: f64,
        step: impl Fn(),
    ) -> [Shaded; 3] {
        let points = &self.view.points;
        let exact = irradiance(query, points, masks, VisibilityMode::Ray);
        let exact_in_air = air.irradiance(query, VisibilityMode::Ray);
        let outside_hull = outside_hull(query, self.view);
        VisibilityMode::ALL.map(|mode| {
            let in_air = air.irradiance(query, mode);
            let irradiance = irradiance(query, points, masks, mode);
            let lookup = Some(time_lookup(query, points, masks, mode)).filter(|runs| !runs.is_empty()).map(Timing::of);
            let ray_s = if mode == VisibilityMode::Ray { self.primary_s + masks_s } else { self.primary_s };
            let report = MethodReport {
                name: mode.name(),
                shade_ms: Timing::of(time_shading(query, points, masks, mode)),
                ray_ms: ray_s * 1e3,
                lookup_ns: lookup.map(|lookup| lookup.median),
                lookup_spread_ns: lookup,
                bytes_per_probe,
                irradiance_indirect_mean: mean_luminance(self.view, &irradiance),
                leak: leak::measure(query, points, masks, mode, &irradiance, &exact),
                outside_hull,
                air: air::measure(air, &in_air, &exact_in_air),
                error: None,
                error_gltf: None,
            };
            step();
            Shaded { mode, image: compose(self.view, &irradiance), irradiance, in_air, report }
        })
    }

    /// One look-up by its own rules, at these points of the air.
    pub fn shade_as(&self, look_up: &impl Answers, name: &'static str, air: &Air, bytes_per_probe: f64) -> Shaded {
        let (masks, masks_s) = self.masks(look_up);
        let air = Air::of(self.world, look_up, Arc::clone(&air.points));
        let seen = Seen { masks: &masks, masks_s, air: &air };
        let [_, mut own, _] = self.shade(look_up, seen, bytes_per_probe, || {});
        own.report.name = name;
        own
    }

    /// The same probes with other light in them; times and bytes are those of `like`.
    pub fn shade_again(
        &self,
        query: &impl Answers,
        Seen { masks, air, .. }: Seen,
        mode: VisibilityMode,
        name: &'static str,
        like: &MethodReport,
    ) -> Shaded {
        let points = &self.view.points;
        let shown = irradiance(query, points, masks, mode);
        let (in_air, exact_in_air) = (air.irradiance(query, mode), air.irradiance(query, VisibilityMode::Ray));
        let exact = if mode == VisibilityMode::Ray {
            shown.clone()
        } else {
            irradiance(query, points, masks, VisibilityMode::Ray)
        };
        let report = MethodReport {
            name,
            irradiance_indirect_mean: mean_luminance(self.view, &shown),
            leak: leak::measure(query, points, masks, mode, &shown, &exact),
            air: air::measure(air, &in_air, &exact_in_air),
            ..like.clone()
        };
        Shaded { mode, image: compose(self.view, &shown), irradiance: shown, in_air, report }
    }
}

impl Shaded {
    /// Per pixel, W·m⁻².
    pub fn irradiance_indirect(&self) -> &[Vec3] {
        self.image.layer("irradiance_indirect").unwrap_or_default()
    }

    /// Adds the figures that need a reference.
    pub fn compare(&mut self, with: &Comparison) {
        let Comparison { layers, regions, exposure_ev, .. } = *with;
        let irradiance = self.irradiance_indirect();
        let beauty = self.image.picture("beauty");
        let flips = beauty.map(|p| error::flip::measure(layers, &p, exposure_ev, regions, with.seed));
        let error = Some(error::measure(layers, irradiance, regions, flips.as_ref()));
        let shown: Vec<bool> = regions.iter().map(Option::is_some).collect();
        let dark_region = leak::dark_region(irradiance, layers, &shown);
        let black = leak::false_black(irradiance, layers, &shown);
        if with.glossy {
            self.report.error_gltf = error;
        } else {
            self.report.error = error;
        }
        self.report.leak.dark_region = dark_region;
        self.report.leak.black = black;
    }

    /// Adds the error in the air.
    pub fn compare_in_air(&mut self, air: &Air, truth: &AirTruth) {
        self.report.air.compare(air, &self.in_air, truth);
    }
}

/// Share of the view's points outside the probes' hull.
fn outside_hull(query: &impl Answers, view: &View) -> Option<f64> {
    /// Points on the hull's faces lie inside, whatever rounding makes of them; spacings.
    const TOLERANCE: f32 = 1e-4;
    let (low, high) = query.grid().hull(TOLERANCE);
    let is_outside = |p: Vec3| p.cmplt(low).any() || p.cmpgt(high).any();
    let (mut outside, mut all) = (0.0f64, 0.0f64);
    for point in &view.points {
        let weight = f64::from(point.weight);
        outside += if is_outside(point.surface.position) { weight } else { 0.0 };
        all += weight;
    }
    (all > 0.0).then(|| outside / all)
}

/// Mean over the pixels that show a surface.
fn mean_luminance(view: &View, irradiance: &[Vec3]) -> Option<f64> {
    let sum: f64 = view.points.iter().zip(irradiance).map(|(p, e)| f64::from(p.weight * luminance(*e))).sum();
    // The points of a pixel stand together.
    let pixels = view.points.chunk_by(|a, b| a.pixel == b.pixel).count();
    (pixels > 0).then(|| sum / pixels as f64)
}

/// A file's probes lit by full paths, and how the file's own differ from them.
pub struct BakedTruth {
    pub truth: Truth,
    pub report: BakedReport,
}

impl BakedTruth {
    /// Paths from every hit, in proportion to the samples per pixel of a reference: hits are many, and each path that leaves
    /// one is a sample of its own, so that few from each do.
    pub fn paths_for(reference_spp: u32) -> u32 {
        const REFERENCE_SPP_PER_PATH: u32 = 128;
        (reference_spp / REFERENCE_SPP_PER_PATH).max(1)
    }

    /// Lights the probes by `paths` paths from every hit, in each of the truth's runs.
    pub fn trace(
        world: &World,
        capture: &CaptureSettings,
        volume: &Volume,
        paths: u32,
        seed: u64,
        progress: Progress,
    ) -> Self {
        let started = Instant::now();
        let truth = Truth::trace(world, capture, volume, paths, seed, progress);
        let (figures, standard_error) = baked::measure(volume, &truth);
        let paths_per_hit = u64::from(paths) * truth.runs.len() as u64;
        let report = BakedReport { figures, standard_error, paths_per_hit, time_s: started.elapsed().as_secs_f64() };
        BakedTruth { truth, report }
    }
}

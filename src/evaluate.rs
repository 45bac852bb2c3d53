//! A volume of probes judged by a picture: the light that it gives with each way of treating visibility, what leaks, what it costs,
//! and how far it is from a reference. `render` does it once for every camera, `sweep` for every configuration.

use std::time::Instant;

use glam::Vec3;

use crate::config::Config;
use crate::image::LayeredImage;
use crate::light::World;
use crate::math::color::luminance;
use crate::probe::Volume;
use crate::probe::file::ProbeFile;
use crate::probe::query::{Query, VisibilitySettings};
use crate::probe::store::layout;
use crate::probe::transport::truth::Truth;
use crate::report::baked::{self, BakedReport};
use crate::report::reference_layers::ReferenceLayers;
use crate::report::render::{MethodReport, Timing};
use crate::report::{error, leak};
use crate::scene::Scene;
use crate::shade::layers::compose;
use crate::shade::methods::{Method, exact_masks, irradiance, time_lookup, time_shading};
use crate::shade::points::View;
use crate::shade::reference::ReferenceSettings;
use crate::shade::regions::Region;
use crate::system::progress::Progress;

/// Name in the report of probes lit by full paths, with exact visibility.
pub const PATH_RAY: &str = "path_ray";

/// Where a picture is evaluated: what a camera sees, which is the same for all probes.
pub struct Scenery<'a, 's> {
    pub world: &'a World<'s>,
    pub view: &'a View,
    /// Time of the primary rays.
    pub primary_s: f64,
}

/// One method's results.
pub struct Shaded {
    pub method: Method,
    /// At every point of the view, W·m⁻².
    pub irradiance: Vec<Vec3>,
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

impl Scenery<'_, '_> {
    /// Which probes the view's points see, and the seconds that it took to find out.
    pub fn masks(&self, query: &Query) -> (Vec<u8>, f64) {
        let started = Instant::now();
        let masks = exact_masks(self.world, query, &self.view.points);
        (masks, started.elapsed().as_secs_f64())
    }

    /// The three ways of treating visibility; `step` is called after each.
    pub fn shade(
        &self,
        query: &Query,
        masks: &[u8],
        masks_s: f64,
        bytes_per_probe: f64,
        step: impl Fn(),
    ) -> [Shaded; 3] {
        let points = &self.view.points;
        let exact = irradiance(query, points, masks, Method::Ray);
        Method::ALL.map(|method| {
            let irradiance = irradiance(query, points, masks, method);
            let ray_s = if method == Method::Ray { self.primary_s + masks_s } else { self.primary_s };
            let report = MethodReport {
                name: method.name(),
                shade_ms: Timing::of(time_shading(query, points, masks, method)),
                ray_ms: ray_s * 1e3,
                lookup_ns: time_lookup(query, points, masks, method),
                bytes_per_probe,
                irradiance_indirect_mean: mean_luminance(self.view, &irradiance),
                leak: leak::measure(query, points, masks, method, &irradiance, &exact),
                error: None,
                error_gltf: None,
            };
            step();
            Shaded { method, image: compose(self.view, &irradiance), irradiance, report }
        })
    }

    /// The same probes with other light in them; times and bytes are those of `like`.
    pub fn shade_again(
        &self,
        query: &Query,
        masks: &[u8],
        method: Method,
        name: &'static str,
        like: &MethodReport,
    ) -> Shaded {
        let points = &self.view.points;
        let shown = irradiance(query, points, masks, method);
        let exact = if method == Method::Ray { shown.clone() } else { irradiance(query, points, masks, Method::Ray) };
        let report = MethodReport {
            name,
            irradiance_indirect_mean: mean_luminance(self.view, &shown),
            leak: leak::measure(query, points, masks, method, &shown, &exact),
            ..like.clone()
        };
        Shaded { method, image: compose(self.view, &shown), irradiance: shown, report }
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
        if with.glossy {
            self.report.error_gltf = error;
        } else {
            self.report.error = error;
        }
        self.report.leak.dark_region = dark_region;
    }
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
    /// Hits are many, and each path that leaves one is a sample of its own: few from each do.
    const REFERENCE_SPP_PER_PATH: u32 = 128;

    /// In proportion to the samples of a traced reference.
    pub fn trace(
        world: &World,
        config: &Config,
        volume: &Volume,
        settings: &ReferenceSettings,
        progress: Progress,
    ) -> Self {
        let started = Instant::now();
        let paths = (settings.spp / Self::REFERENCE_SPP_PER_PATH).max(1);
        let truth = Truth::trace(world, &config.capture, volume, paths, settings.seed, progress);
        let (figures, standard_error) = baked::measure(volume, &truth);
        let paths_per_hit = u64::from(paths) * truth.runs.len() as u64;
        let report = BakedReport { figures, standard_error, paths_per_hit, time_s: started.elapsed().as_secs_f64() };
        BakedTruth { truth, report }
    }
}

/// The volume without what the plan found unnecessary, should the file hold it all the same.
pub fn volume_as_planned(probes: &ProbeFile, scene: &Scene) -> Volume {
    let mut volume = probes.volume(scene.origin_world);
    if probes.plan["visibility"] == serde_json::Value::Bool(false) {
        volume.distance = None;
        volume.surface_visibility = None;
    }
    volume
}

/// Bytes per probe of what the file holds, in the layout that shading uses.
pub fn runtime_bytes(probes: &ProbeFile, config: &Config) -> f64 {
    let count = probes.volume_in_grid().states.len();
    let surface = probes.volume_in_grid().surface_visibility.as_ref().map_or(0, |s| s.bytes());
    let visibility = match config.query.visibility {
        _ if probes.plan["visibility"] == serde_json::Value::Bool(false) => VisibilitySettings::None,
        visibility => visibility,
    };
    layout::irradiance_bytes(&config.filter, &config.encoding, config.placement.relocate) as f64
        + layout::visibility_bytes(visibility, &config.filter, &config.encoding, surface, count)
}

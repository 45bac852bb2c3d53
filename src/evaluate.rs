//! A volume of probes judged by a picture: the light that it gives with each way of treating visibility, what leaks, what it costs,
//! and how far it is from a reference. `render` does it once for every camera, `sweep` for every configuration.

use std::f32::consts::PI;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;

use crate::image::LayeredImage;
use crate::light::World;
use crate::math::color::luminance;
use crate::math::random::{Numbers, Purpose, Random};
use crate::math::sampling::cosine_hemisphere;
use crate::probe::Volume;
use crate::probe::capture::CaptureSettings;
use crate::probe::query::{Answers, Query};
use crate::probe::transport::truth::Truth;
use crate::report::baked::{self, BakedReport};
use crate::report::bent::BentFigures;
use crate::report::glossy::{self, GlossyPart, GlossyReport, TracedRays};
use crate::report::reference_layers::ReferenceLayers;
use crate::report::render::{MethodReport, Timing};
use crate::report::{air, error, leak};
use crate::shade::air::Air;
use crate::shade::bent::Bent;
use crate::shade::glossy::{Ends, Glossy, glosses};
use crate::shade::layers::{compose, to_pixels};
use crate::shade::point_truth::PointTruth;
use crate::shade::points::{ImagePoint, View};
use crate::shade::regions::Region;
use crate::shade::traced::Rays;
use crate::shade::visibility_modes::{RUNS, VisibilityMode, exact_masks, irradiance, time_lookup, time_shading};
use crate::system::progress::Progress;

/// Name in the report of probes lit by full paths, with exact visibility.
pub const PATH_RAY: &str = "path_ray";

/// Name in the report of irradiance by rays that are traced in the probes.
pub const DIFFUSE_RAYS: &str = "diffuse_rays";

/// Where a picture is evaluated: what a camera sees, which is the same for all probes.
pub struct Scenery<'a, 's> {
    pub world: &'a World<'s>,
    pub view: &'a View,
    pub bent: Bent,
    /// Time of the primary rays.
    pub primary_s: f64,
    /// Of the points in the air and of bent normals.
    pub seed: u64,
}

/// The picture and the figures of one visibility mode.
pub struct Shaded {
    pub mode: VisibilityMode,
    /// At every point of the view, W·m⁻².
    pub irradiance: Vec<Vec3>,
    /// At every point of the air, W·m⁻².
    pub in_air: Vec<Vec3>,
    /// At every point with a bent normal, W·m⁻².
    pub bent: Vec<Vec3>,
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

impl<'a, 's> Scenery<'a, 's> {
    pub fn new(world: &'a World<'s>, view: &'a View, primary_s: f64, seed: u64) -> Scenery<'a, 's> {
        Scenery { world, view, bent: Bent::of(view, seed), primary_s, seed }
    }

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
        let mut bent = self.bent.irradiance(self.world, query, VisibilityMode::ALL);
        VisibilityMode::ALL.map(|mode| {
            let in_air = air.irradiance(query, mode);
            let bent = std::mem::take(&mut bent[mode as usize]);
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
                bent: BentFigures::of(&bent),
                error: None,
                error_gltf: None,
                glossy: None,
            };
            step();
            Shaded { mode, image: compose(self.view, &irradiance), irradiance, in_air, bent, report }
        })
    }

    /// Adds what surfaces reflect as gloss of the probes' light: the layer `glossy`, and `beauty_gltf`, the picture with it.
    /// `reference` is of glossy transport, with the regions of its pixels and its samples a pixel. Nothing where the probes
    /// hold no light for it, and where the scene has no glossy material.
    pub fn shade_glossy(
        &self,
        query: &impl Answers,
        masks: &[u8],
        shaded: &mut [Shaded],
        reference: Option<(&ReferenceLayers, &[Option<Region>], u32)>,
    ) {
        let Some((query, glosses)) = query.glossy().zip(glosses(self.world, self.view)) else { return };
        let glossy = Glossy { world: self.world, view: self.view, glosses: &glosses, seed: self.seed };
        let pixels = |radiance: &[Vec3]| to_pixels(self.view, |i, _| radiance[i]);
        for s in shaded {
            let (radiance, rays) = glossy.shade(&query, masks, s.mode, Ends::Proxy);
            // The table and the caches are warm now.
            let runs = if rays.rays > 0 { 1 } else { RUNS };
            let time = |_| {
                let started = Instant::now();
                std::hint::black_box(glossy.shade(&query, masks, s.mode, Ends::Proxy));
                started.elapsed().as_secs_f64() * 1e3
            };
            let layer = pixels(&radiance);
            let beauty = to_pixels(self.view, |i, _| glossy.beauty(i, s.irradiance[i], radiance[i]));
            let beauty = beauty.into_iter().zip(&self.view.sky).map(|(pixel, sky)| pixel + *sky).collect();
            let parts = match reference {
                Some(reference) if s.mode == VisibilityMode::On => glossy_parts(&glossy, &query, masks, reference),
                _ => Vec::new(),
            };
            s.report.glossy = Some(GlossyReport {
                shade_ms: Timing::of((0..runs).map(time).collect()),
                bytes_per_probe: query.volume.radiance.glossy_bytes() as f64,
                radiance_mean: mean_luminance(self.view, &radiance),
                error_gltf: reference.map(|(layers, regions, _)| glossy::measure(layers, &layer, None, regions)),
                parts,
                traced: TracedRays::of(&rays),
            });
            s.image.push("glossy", layer);
            s.image.push("beauty_gltf", beauty);
        }
    }

    /// The picture whose irradiance comes from rays that are traced in the probes; `None` where a method traces none. All but
    /// the picture's own figures are those of `like`.
    pub fn shade_diffuse_rays(&self, query: &impl Answers, masks: &[u8], like: &Shaded) -> Option<Shaded> {
        let query = query.diffuse_rays()?;
        let (tracing, settings) = query.diffuse_tracing().zip(query.settings.diffuse.traced())?;
        let rays = Rays { view: self.view, tracing, settings, seed: self.seed };
        let direction = |_: usize, point: &ImagePoint, random: &mut Random| {
            Some(cosine_hemisphere(point.query.normal, random.pair()))
        };
        let started = Instant::now();
        let (radiance, _) = rays.trace(Purpose::DiffuseRays, direction, |_| 0.0);
        let shown: Vec<Vec3> = radiance.into_iter().map(|l| l * PI).collect();
        let shade_ms = Timing::of(vec![started.elapsed().as_secs_f64() * 1e3]);
        let points = &self.view.points;
        let exact = irradiance(&query, points, masks, VisibilityMode::Ray);
        let report = MethodReport {
            name: DIFFUSE_RAYS,
            shade_ms,
            lookup_ns: None,
            lookup_spread_ns: None,
            irradiance_indirect_mean: mean_luminance(self.view, &shown),
            leak: leak::measure(&query, points, masks, VisibilityMode::On, &shown, &exact),
            glossy: None,
            ..like.report.clone()
        };
        let image = compose(self.view, &shown);
        let (in_air, bent) = (like.in_air.clone(), like.bent.clone());
        Some(Shaded { mode: VisibilityMode::On, image, irradiance: shown, in_air, bent, report })
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
        let [bent] = self.bent.irradiance(self.world, query, [mode]);
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
            glossy: None,
            ..like.clone()
        };
        Shaded { mode, image: compose(self.view, &shown), irradiance: shown, in_air, bent, report }
    }
}

/// The error of gloss with one part after another made exact, and without its proxy: visibility of the probes, where reflected
/// rays end, and the light that comes from there, which leaves the error of the model.
fn glossy_parts(
    glossy: &Glossy,
    query: &Query,
    masks: &[u8],
    (layers, regions, spp): (&ReferenceLayers, &[Option<Region>], u32),
) -> Vec<GlossyPart> {
    /// Most paths from each point for exact light.
    const MOST_PATHS: u32 = 256;
    let view = glossy.view;
    let part = |name, radiance: &[Vec3]| {
        let pixels = to_pixels(view, |i, _| radiance[i]);
        GlossyPart { name, error_gltf: glossy::measure(layers, &pixels, None, regions) }
    };
    let shaded = |name, mode, ends| part(name, &glossy.shade(query, masks, mode, ends).0);
    let mut parts = Vec::new();
    if query.settings.glossy.asks_levels() {
        parts.push(shaded("without_parallax", VisibilityMode::On, Ends::Far));
        parts.push(shaded("exact_visibility", VisibilityMode::Ray, Ends::Proxy));
        parts.push(shaded("exact_parallax", VisibilityMode::Ray, Ends::Exact));
    }
    let model = glossy.model(spp.min(MOST_PATHS));
    let mean: Vec<Vec3> = model.iter().map(|light| light.mean.as_vec3()).collect();
    let pixels = to_pixels(view, |i, _| mean[i]);
    let mut variance = vec![Vec3::ZERO; pixels.len()];
    for (point, light) in view.points.iter().zip(&model) {
        variance[point.pixel as usize] += light.variance().as_vec3() * point.weight * point.weight;
    }
    let error_gltf = glossy::measure(layers, &pixels, Some(&variance), regions);
    parts.push(GlossyPart { name: "exact_light", error_gltf });
    parts
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

    /// Adds the error of the gloss, where it was shaded.
    pub fn compare_glossy(&mut self, layers: &ReferenceLayers, regions: &[Option<Region>]) {
        if let (Some(report), Some(layer)) = (&mut self.report.glossy, self.image.layer("glossy")) {
            report.error_gltf = Some(glossy::measure(layers, layer, None, regions));
        }
    }

    /// Adds the errors in the air and of bent normals, from the truths there.
    pub fn compare_at_points(&mut self, air: &Air, (in_air, bent): (&PointTruth, &PointTruth)) {
        self.report.air.compare(air, &self.in_air, in_air);
        self.report.bent.compare(&self.bent, bent);
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

//! One bake of a sweep, and what it is worth.

use std::cell::{OnceCell, RefCell};
use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;

use super::SweepError;
use super::store::{Key, Store, Stored};
use crate::bake::{Baked, Circumstances, prepare};
use crate::config::Config;
use crate::evaluate::{BakedTruth, Comparison, Scenery, Seen, Shaded};
use crate::image::Picture;
use crate::probe::Volume;
use crate::probe::file::{self, ProbeFile, SceneRecord};
use crate::probe::query::{Query, QueryPoint};
use crate::report::error::{ByRegion, ErrorEstimate};
use crate::report::reference_layers::ReferenceLayers;
use crate::report::sweep::{BakeTimes, GlossyFigures, MethodFigures, RunRecord, TruthRecord};
use crate::shade::air::{self, Air};
use crate::shade::point_truth::PointTruth;
use crate::shade::reference::ReferenceSettings;
use crate::shade::visibility_modes::VisibilityMode;
use crate::system::progress::Progress;

/// What all runs share.
pub struct Setting<'a, 's> {
    pub scenery: Scenery<'a, 's>,
    pub comparison: Comparison<'a>,
    /// A reference of glossy transport, where any configuration shades gloss.
    pub glossy: Option<&'a ReferenceLayers>,
    /// Mean of the reference that relative errors are relative to, W·m⁻²; `None` where it is black.
    pub reference_mean: Option<f64>,
    pub reference_settings: ReferenceSettings,
    pub store: Store,
    pub truths: Truths,
    /// All that runs depend on besides configuration and seed, as text.
    pub identity: String,
}

/// Points of the air, and the light there.
type KnownAir = (Arc<Vec<QueryPoint>>, Arc<PointTruth>);

/// What was traced already.
#[derive(Debug, Default)]
pub struct Truths {
    /// By the bits of the corners of the points' box.
    in_air: RefCell<HashMap<[[u32; 3]; 2], KnownAir>>,
    /// At points of the picture with bent normals.
    bent: OnceCell<PointTruth>,
}

/// A finished run, new or from the store.
#[derive(Debug, Clone)]
pub struct Finished {
    pub record: RunRecord,
    /// Of its own visibility, per pixel, W·m⁻².
    pub irradiance: Vec<Vec3>,
    /// Whether it was there before.
    pub kept: bool,
}

impl Setting<'_, '_> {
    fn key(&self, kind: &str, config: &Config, seed: u64) -> Key {
        Key::of(&[kind, &self.identity, &config.identity(), &seed.to_string()])
    }

    fn pixels(&self) -> usize {
        self.scenery.view.width as usize * self.scenery.view.height as usize
    }

    /// The run of a configuration and a seed, from the store or else made and stored.
    pub fn obtain(
        &self,
        label: &str,
        config: &Config,
        seed: u64,
        warn: impl Fn(String),
    ) -> Result<Finished, SweepError> {
        let key = self.key("run", config, seed);
        match self.store.load(&key, Some(self.pixels())) {
            Stored::Found(record, Some(irradiance)) => return Ok(Finished { record, irradiance, kept: true }),
            Stored::Damaged(what) => warn(format!("{what}; running '{label}' with seed {seed} again")),
            Stored::Missing | Stored::Found(_, None) => {}
        }
        let bake = self.bake(label, config, seed)?;
        let shaded = self.shade(config, &bake);
        let record = self.record(seed, &bake, &shaded);
        let irradiance = shaded[VisibilityMode::On as usize].irradiance_indirect().to_vec();
        let view = self.scenery.view;
        self.store.save(&key, &record, Some(Picture::from_pixels(view.width, view.height, irradiance.clone())))?;
        Ok(Finished { record, irradiance, kept: false })
    }

    /// The probes of a configuration lit by full paths: with their own visibility, and with exact visibility.
    pub fn obtain_truth(
        &self,
        label: &str,
        config: &Config,
        seed: u64,
        warn: impl Fn(String),
    ) -> Result<TruthRecord, SweepError> {
        let key = self.key("truth", config, seed);
        match self.store.load(&key, None) {
            Stored::Found(record, _) => return Ok(record),
            Stored::Damaged(what) => warn(format!("{what}; lighting the probes of '{label}' again")),
            Stored::Missing => {}
        }
        let bake = self.bake(label, config, seed)?;
        let world = self.scenery.world;
        let ReferenceSettings { spp, seed: truth_seed, .. } = self.reference_settings;
        let paths = BakedTruth::paths_for(spp);
        let truth = BakedTruth::trace(world, &config.capture, &bake.volume, paths, truth_seed, Progress::hidden());
        let file_query = Query { volume: &bake.volume, settings: &config.query };
        let (masks, masks_s) = self.scenery.masks(&file_query);
        let query = Query { volume: &truth.truth.volume, settings: &config.query };
        let (air, in_air) = self.in_air(&file_query);
        let seen = Seen { masks: &masks, masks_s, air: &air };
        let [_, mut on, mut ray] = self.scenery.shade(&query, seen, bake.bytes_per_probe, || {});
        let figures = |shaded: &mut Shaded| {
            shaded.compare(&self.comparison);
            shaded.compare_at_points(&air, (&in_air, self.bent()));
            self.figures(shaded)
        };
        let record = TruthRecord {
            visibility_on: figures(&mut on),
            visibility_ray: figures(&mut ray),
            // Of fitted values there are none.
            baked: if config.fit.is_none() { truth.report.figures } else { Default::default() },
        };
        self.store.save(&key, &record, None)?;
        Ok(record)
    }

    /// Bakes, writes the file and reads it back: what is judged is what a user gets.
    fn bake(&self, label: &str, config: &Config, seed: u64) -> Result<Bake, SweepError> {
        let scene = self.scenery.world.scene;
        let circumstances = Circumstances::quiet(seed);
        let record = SceneRecord { name: scene.name.clone(), blake3: scene.blake3.clone() };
        let baked = prepare(self.scenery.world, config, &circumstances).and_then(|p| p.bake(&circumstances, &record));
        let baked = baked.map_err(|cause| SweepError::Bake { label: label.to_owned(), cause })?;
        let path = self.store.scratch();
        baked.container.write(&path)?;
        let probes = file::read(&path)?;
        // It has served; the next run would replace it.
        let _ = std::fs::remove_file(&path);
        let (mut volume, bytes_per_probe) = (probes.volume_as_planned(scene.origin_world), probes.runtime_bytes());
        if probes.query.weights.glossy.asks_levels() {
            volume.radiance.make_levels();
        }
        Ok(Bake { volume, bytes_per_probe, baked, probes })
    }

    /// The three ways of treating visibility, compared with the reference.
    fn shade(&self, config: &Config, bake: &Bake) -> [Shaded; 3] {
        let query = Query { volume: &bake.volume, settings: &config.query };
        let (masks, masks_s) = self.scenery.masks(&query);
        let (air, in_air) = self.in_air(&query);
        let seen = Seen { masks: &masks, masks_s, air: &air };
        let mut shaded = self.scenery.shade(&query, seen, bake.bytes_per_probe, || {});
        for s in &mut shaded {
            s.compare(&self.comparison);
            s.compare_at_points(&air, (&in_air, self.bent()));
        }
        // The file's own weights: they know the box that rays end at.
        let query = Query { settings: &bake.probes.query.weights, ..query };
        // The other ways of treating visibility are not asked for, and no paths for the parts of the error.
        let [_, on, _] = &mut shaded;
        self.scenery.shade_glossy(&query, &masks, std::slice::from_mut(on), None);
        if let Some(layers) = self.glossy {
            on.compare_glossy(layers, self.comparison.regions);
        }
        shaded
    }

    /// Points of the air, and the truth there. Configurations that cover the same share both.
    fn in_air(&self, query: &Query) -> (Air, Arc<PointTruth>) {
        let world = self.scenery.world;
        let (low, high) = air::bounds(world, &query.volume.grid);
        let key = [low, high].map(|corner| corner.to_array().map(f32::to_bits));
        let mut known = self.truths.in_air.borrow_mut();
        if let Some((points, truth)) = known.get(&key) {
            return (Air::of(world, query, Arc::clone(points)), Arc::clone(truth));
        }
        let air = self.scenery.air(query);
        let ReferenceSettings { spp, seed, .. } = self.reference_settings;
        let truth = Arc::new(air.truth(world, spp, seed));
        known.insert(key, (Arc::clone(&air.points), Arc::clone(&truth)));
        (air, truth)
    }

    /// The truth of bent normals, which all configurations share.
    fn bent(&self) -> &PointTruth {
        let ReferenceSettings { spp, seed, .. } = self.reference_settings;
        self.truths.bent.get_or_init(|| self.scenery.bent.truth(self.scenery.world, spp, seed))
    }

    fn record(&self, seed: u64, bake: &Bake, shaded: &[Shaded; 3]) -> RunRecord {
        let Bake { baked, volume, .. } = bake;
        let times = BakeTimes {
            survey: baked.times.survey,
            capture: baked.times.capture,
            bounces: baked.times.bounces,
            fit: baked.times.fit,
            filter: baked.times.filter,
            encode: baked.times.encode,
        };
        let probes = volume.states.len();
        RunRecord {
            seed,
            offset: None,
            probes,
            probes_active: volume.active_count(),
            probes_blake3: positions_hash(volume),
            bytes_per_probe: bake.bytes_per_probe,
            bytes: bake.bytes_per_probe * probes as f64,
            file_bytes: bake.probes.file_bytes,
            bake_s: times.total(),
            time_s: times,
            rays: baked.rays,
            bounces: baked.solution.bounces.len(),
            converged: baked.solution.converged,
            methods: shaded.iter().map(|s| self.figures(s)).collect(),
        }
    }

    fn figures(&self, shaded: &Shaded) -> MethodFigures {
        let report = &shaded.report;
        let measured = report.error.as_ref().map(|error| &error.all);
        let region = |of: fn(&ByRegion) -> &ErrorEstimate| of(&report.error.as_ref()?.by_region).figures.nrmse;
        let error = measured.map(|m| m.figures).unwrap_or_default();
        MethodFigures {
            name: report.name.to_owned(),
            shade_ms: report.shade_ms.median,
            lookup_ns: report.lookup_ns,
            irradiance_indirect_mean: report.irradiance_indirect_mean,
            leak: report.leak,
            outside_hull: report.outside_hull,
            air: report.air,
            bent: report.bent,
            error_relative: error.nrmse,
            error_corner: region(|regions| &regions.corner),
            error_flat: region(|regions| &regions.flat),
            error,
            standard_error: measured.map(|m| m.standard_error).unwrap_or_default(),
            verdict: measured.and_then(|m| m.verdict).map(str::to_owned),
            glossy: report.glossy.as_ref().map(|glossy| GlossyFigures {
                shade_ms: glossy.shade_ms.median,
                bytes_per_probe: glossy.bytes_per_probe,
                error_gltf: glossy.error_gltf.as_ref().and_then(|error| error.all.figures.nrmse),
                relmse_gltf: glossy.error_gltf.as_ref().and_then(|error| error.all.figures.relmse),
            }),
        }
    }
}

/// A bake and the file that came of it.
struct Bake {
    baked: Baked,
    probes: ProbeFile,
    volume: Volume,
    bytes_per_probe: f64,
}

/// Where the probes stand, and which of them are baked.
fn positions_hash(volume: &Volume) -> String {
    let mut hasher = blake3::Hasher::new();
    for (position, state) in volume.positions.iter().zip(&volume.states) {
        position.to_array().iter().for_each(|x| {
            hasher.update(&x.to_le_bytes());
        });
        hasher.update(&[*state as u8]);
    }
    hasher.finalize().to_hex().to_string()
}

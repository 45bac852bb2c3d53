//! The metadata of a probe file.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::probe::container::Container;
use crate::probe::query::QuerySettings;
use crate::probe::store::Occlusion;
use crate::scene::Unassigned;

/// The metadata key `grid`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GridRecord {
    pub kind: GridKind,
    /// Point (0,0,0), world space, metres: a probe, or in mixed grids the centre of the first of the finest cells.
    pub origin: [f64; 3],
    pub spacing: [f32; 3],
    /// Points along each axis.
    pub divisions: [u32; 3],
    /// Levels of subdivision below the base cells, 2^levels of the finest wide; 0 for uniform grids.
    pub levels: u32,
    /// Border texels of the maps.
    pub border: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GridKind {
    /// A probe at every point.
    Uniform,
    /// The tensor `grid_index` says which probe stands for which point.
    Mixed,
}

/// The metadata key `scene`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneRecord {
    pub name: String,
    pub blake3: String,
}

/// Version of the metadata key `query` that this program writes. A change of what a look-up does raises it.
/// 2 added `light.unassigned`; 3 added to `weights` `weight_normal`, `look_up`, `bias_spacing`, `distance_bias` and
/// `blank_below`; 4 added visibility as trees, which tests ask without settings, and `sum_floor`; 5 added thin walls to the trees;
/// 6 added to `weights` `least_weight`, `glossy` and `diffuse`.
pub const QUERY_VERSION: u32 = 6;

/// The version of records without what version 6 added, which are written as they always were.
pub(super) const PLAIN_VERSION: u32 = 5;

/// Keys of `weights` that version 6 added.
const ADDED: &[&str] = &["least_weight", "glossy", "diffuse"];

/// The metadata key `query`: all that a look-up and the shading around it need beside the tensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QueryRecord {
    pub version: u32,
    pub weights: QuerySettings,
    /// Whether probes may stand elsewhere than at their grid points, so that shading needs `position`.
    pub moved: bool,
    pub light: LightRecord,
}

/// The light that the probes were baked in, as far as the configuration says it: shading adds what is direct of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightRecord {
    /// Factor on punctual lights.
    pub punctual_scale: f32,
    /// Constant radiance of the sky, linear RGB, W·m⁻²·sr⁻¹, in place of none.
    pub sky: Option<(f32, f32, f32)>,
    /// Albedos are clamped to this.
    pub albedo_max: f32,
    /// The material of meshes that have none. Files without this key are older, and took glTF's.
    #[serde(default = "of_old_files")]
    pub unassigned: Unassigned,
}

fn of_old_files() -> Unassigned {
    Unassigned::Gltf
}

impl QueryRecord {
    /// The version that look-ups with these weights need.
    pub fn version_of(weights: &QuerySettings) -> u32 {
        let plain = weights.glossy.is_none() && weights.diffuse.traced().is_none() && weights.least_weight == 0.0;
        if plain { PLAIN_VERSION } else { QUERY_VERSION }
    }

    /// As it stands in a file, without what its version does not have.
    pub fn to_json(&self) -> Value {
        // A plain record of numbers and enums: nothing in it can fail to serialise.
        let mut record = serde_json::to_value(self).unwrap_or_default();
        if self.version < QUERY_VERSION
            && let Some(weights) = record["weights"].as_object_mut()
        {
            ADDED.iter().for_each(|key| drop(weights.remove(*key)));
        }
        record
    }

    /// Refuses weights that no configuration could have asked for, and a test that the file's tensors do not fit.
    ///
    /// # Errors
    /// The key and what is wrong with it.
    pub fn check(&self, occlusion: &Occlusion) -> Result<(), String> {
        let mut first = Ok(());
        self.weights.check(&mut |key, value, holds, rule| {
            if !holds && first.is_ok() {
                first = Err(format!("metadata 'query': {key} is {value}: {rule}"));
            }
        });
        // What the plan left out is not asked.
        if let Some(test) = occlusion.test()
            && test != self.weights.test.name()
        {
            first = first
                .and(Err(format!("metadata 'query': the test {} does not fit the tensors", self.weights.test.name())));
        }
        first
    }
}

/// The version of a file's `query` where it is newer than this program.
pub fn newer(container: &Container) -> Result<Option<u64>, String> {
    if !container.metadata.contains_key("query") {
        return Ok(None);
    }
    let query: Value = container.json("query")?;
    let version = query["version"].as_u64().ok_or("metadata 'query' has no version")?;
    Ok((version > u64::from(QUERY_VERSION)).then_some(version))
}

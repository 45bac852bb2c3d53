//! What files without the metadata `query` mean, from the configuration that they hold. Frozen: such files are no longer
//! written, and nothing here follows the configuration as it is now.

use ron::extensions::Extensions;
use serde::Deserialize;

use super::record::{LightRecord, PLAIN_VERSION, QueryRecord};
use crate::probe::query::{
    BiasSpacing, Blend, Diffuse, DirectionWeight, Glossy, LookUp, QuerySettings, VisibilityTest, WeightNormal,
};
use crate::probe::store::surface::TableTest;
use crate::scene::Unassigned;

/// The keys that shading read; all others are passed over.
#[derive(Default, Deserialize)]
#[serde(default)]
struct OldConfig {
    placement: OldPlacement,
    lights: OldLights,
    query: OldQuery,
    solver: OldSolver,
}

#[derive(Deserialize)]
#[serde(default)]
struct OldPlacement {
    relocate: bool,
}

impl Default for OldPlacement {
    fn default() -> Self {
        OldPlacement { relocate: true }
    }
}

#[derive(Deserialize)]
#[serde(default)]
struct OldLights {
    punctual_scale: f32,
    sky: Option<(f32, f32, f32)>,
}

impl Default for OldLights {
    fn default() -> Self {
        OldLights { punctual_scale: 1.0, sky: None }
    }
}

#[derive(Deserialize)]
#[serde(default)]
struct OldSolver {
    albedo_max: f32,
}

impl Default for OldSolver {
    fn default() -> Self {
        OldSolver { albedo_max: 0.999 }
    }
}

#[derive(Deserialize)]
#[serde(default)]
struct OldQuery {
    direction: OldDirection,
    visibility: OldVisibility,
    trilinear_floor: f32,
    weight_floor: f32,
    crush_below: f32,
    blend: OldBlend,
    normal_bias: f32,
    view_bias: f32,
}

impl Default for OldQuery {
    fn default() -> Self {
        OldQuery {
            direction: OldDirection::Uniform,
            visibility: OldVisibility::Surface { voxels_per_cell: 8 },
            trilinear_floor: 0.0,
            weight_floor: 0.0,
            crush_below: 0.0,
            blend: OldBlend::Linear,
            normal_bias: 0.0,
            view_bias: 0.0,
        }
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum OldDirection {
    Uniform,
    Cosine { floor: f32 },
    Wrap { offset: f32 },
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum OldVisibility {
    None,
    Moments {
        power: f32,
        floor: f32,
    },
    Surface {
        #[expect(dead_code, reason = "the tensors say it too")]
        voxels_per_cell: u32,
    },
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum OldBlend {
    Linear,
    SquareRoot,
}

/// The record that a file with this configuration would have carried.
///
/// # Errors
/// The configuration is not RON.
pub fn query(config: &str) -> Result<QueryRecord, String> {
    let options = ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
    let old: OldConfig = options.from_str(config).map_err(|e| format!("metadata 'config': {e}"))?;
    let q = old.query;
    // Only Chebyshev's test saw the shifted point.
    let (test, sees_bias) = match q.visibility {
        OldVisibility::None => (VisibilityTest::None, false),
        OldVisibility::Moments { power, floor } => (VisibilityTest::Chebyshev { power, floor }, true),
        OldVisibility::Surface { .. } => (VisibilityTest::Table(TableTest { reach_voxels: 3, strip: 0.25 }), false),
    };
    let bias = |bias: f32| if sees_bias { bias } else { 0.0 };
    Ok(QueryRecord {
        version: PLAIN_VERSION,
        weights: QuerySettings {
            direction: match q.direction {
                OldDirection::Uniform => DirectionWeight::Uniform,
                OldDirection::Cosine { floor } => DirectionWeight::Cosine { floor },
                OldDirection::Wrap { offset } => DirectionWeight::Wrap { offset },
            },
            weight_normal: WeightNormal::Shading,
            test,
            trilinear_floor: q.trilinear_floor,
            weight_floor: q.weight_floor,
            crush_below: q.crush_below,
            blend: match q.blend {
                OldBlend::Linear => Blend::Linear,
                OldBlend::SquareRoot => Blend::SquareRoot,
            },
            normal_bias: bias(q.normal_bias),
            view_bias: bias(q.view_bias),
            biased_cell: false,
            bias_spacing: BiasSpacing::Largest,
            distance_bias: 0.0,
            blank_below: 0.0,
            sum_floor: 0.0,
            look_up: LookUp::Normal,
            least_weight: 0.0,
            glossy: Glossy::None,
            diffuse: Diffuse::Stored,
        },
        moved: old.placement.relocate,
        light: LightRecord {
            punctual_scale: old.lights.punctual_scale,
            sky: old.lights.sky,
            albedo_max: old.solver.albedo_max,
            unassigned: Unassigned::Gltf,
        },
    })
}

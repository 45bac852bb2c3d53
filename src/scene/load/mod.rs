//! From a glTF file to a [`Scene`]: container → JSON → buffers → nodes → meshes → materials → one list of triangles.
//!
//! Everything in a file is checked before it is used. The sizes that a header claims never decide how much is
//! allocated.

mod accessor;
mod buffers;
mod container;
mod coordinates;
mod coplanar;
mod document;
mod draws;
mod environment;
mod extensions;
mod flatten;
mod image;
mod inputs;
mod lights;
mod material;
mod materials;
mod nodes;
mod places;
mod poses;
mod primitive;
mod text;
mod texture_slot;
mod textures;
mod transform;

use std::path::Path;

use glam::Vec3;

use self::buffers::Buffers;
use self::document::Document;
use self::draws::Draws;
use self::flatten::{Flattened, flatten};
use self::inputs::Inputs;
use self::lights::SceneOrigin;
use self::materials::Materials;
use self::nodes::Nodes;
use self::primitive::Skipped;
use self::textures::Textures;
use self::transform::world_point;
use super::error::SceneError;
use super::light::LIGHT_MAX;
use super::options::LoadOptions;
use super::{DroppedTriangles, Environment, Scene};
use crate::system::format;

/// Loads a `.gltf` or `.glb` file with its buffers, its images and the sky.
///
/// Losses that leave a usable scene are no errors but [`Scene::warnings`]: skins at rest, material layers that are not
/// modelled, dropped triangles.
///
/// # Errors
/// Every [`SceneError`] names file, place and remedy.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let mut warnings = Vec::new();
    let mut inputs = Inputs::new();
    let bytes = inputs.read(path).map_err(|cause| SceneError::Read {
        file: path.to_owned(),
        place: "scene".to_owned(),
        cause,
        remedy: "check the path; scenes are .gltf or .glb files",
    })?;
    let parts = container::split(&bytes).map_err(|what| SceneError::Format {
        file: path.to_owned(),
        what,
        remedy: "copy or export the file again",
    })?;
    let document = Document::parse(path, &bytes[parts.json], &mut warnings)?;
    let buffers = Buffers::load(&document, parts.bin.map(|bin| &bytes[bin]), &mut inputs)?;
    let nodes = Nodes::build(&document, options.scene, &mut warnings)?;
    let mut draws = Draws::collect(&document, &buffers, &nodes, options.detail.normal_maps)?;
    report_skipped(&draws.skipped, !draws.skeletons.is_empty(), &mut warnings);
    let empty = |what: String| SceneError::Empty { file: path.to_owned(), what };
    let Some(landmark) = draws.landmark() else {
        return Err(empty("the scene has no triangles".to_owned()));
    };

    let mut textures = Textures::new(&document, &buffers, &mut inputs, options.collapse_constant_images);
    let materials = Materials::load(&document, &draws, &mut textures, options, &mut warnings)?;
    coordinates::check(&mut draws, &materials, &textures.constant, &mut warnings)?;
    let (textures, collapsed_bytes) = (textures.textures, textures.collapsed_bytes);
    let Flattened { mut mesh, centre, dropped } = flatten(&draws, &landmark, &materials);
    report_dropped(&dropped, &mut warnings);
    if mesh.triangles.is_empty() {
        return Err(empty(format!("all of the scene's {} triangles are degenerate", dropped.total())));
    }

    let emitters = coplanar::settle(&mut mesh, &materials.materials);
    if emitters > 0 {
        let what = format::counted(emitters as u64, "emissive triangle lies", "emissive triangles lie");
        warnings.push(format!("{what} in the plane of another surface; the side that emits counts as in front"));
    }

    let origin = SceneOrigin { landmark: &landmark, centre };
    let lights = lights::lights(&document, &nodes, &origin, &mut warnings)?;
    let cameras = lights::cameras(&document, &nodes, &origin, &mut warnings);
    let mut environment = environment::load(options, &mut inputs, &mut warnings)?;
    let light_clamped = lights.clamped + materials.light_clamped + bound_sky(&mut environment, &mut warnings);
    let lights = lights.lights;
    Ok(Scene {
        name: path.file_stem().map_or_else(|| "scene".to_owned(), |stem| stem.to_string_lossy().into_owned()),
        origin_world: world_point(&landmark, centre),
        mesh,
        materials: materials.materials,
        textures,
        collapsed_bytes,
        lights,
        cameras,
        environment,
        unassigned: materials.unassigned,
        blake3: inputs.finish(),
        pictures_blake3: inputs.finish_pictures(),
        files: inputs.files,
        warnings,
        dropped,
        light_clamped,
    })
}

/// Clamps a sky to [`LIGHT_MAX`]; the number of texels that exceeded it.
fn bound_sky(environment: &mut Environment, warnings: &mut Vec<String>) -> u64 {
    let texels = match environment {
        Environment::None => return 0,
        Environment::Constant(radiance) => std::slice::from_mut(radiance),
        Environment::Map(map) => &mut map.texels,
    };
    let is_constant = texels.len() == 1;
    let mut clamped = 0;
    for texel in texels {
        if texel.max_element() > LIGHT_MAX {
            *texel = texel.min(Vec3::splat(LIGHT_MAX));
            clamped += 1;
        }
    }
    if clamped > 0 {
        let what = match is_constant {
            true => "the radiance of the sky is".to_owned(),
            false => format::counted(clamped, "texel of the environment map is", "texels of the environment map are"),
        };
        warnings.push(format!("{what} brighter than {LIGHT_MAX:e} and clamped to that"));
    }
    clamped
}

fn report_skipped(skipped: &Skipped, has_skins: bool, warnings: &mut Vec<String>) {
    let mut warn = |count: usize, what: &str| {
        if count > 0 {
            warnings.push(format!("{count} {what}"));
        }
    };
    warn(skipped.points_or_lines, "mesh primitives are points or lines and are left out");
    warn(skipped.without_positions, "mesh primitives have no POSITION and are left out");
    warn(skipped.incomplete_triangles, "mesh primitives end in an incomplete triangle, which is left out");
    warn(skipped.morph_targets, "mesh primitives have morph targets; their base shape is loaded");
    warn(
        skipped.more_influences,
        "mesh primitives have more than four joints per vertex; only the first four are used",
    );
    if has_skins {
        warnings.push("skinned meshes are loaded in the pose of their joints' nodes".to_owned());
    }
}

fn report_dropped(dropped: &DroppedTriangles, warnings: &mut Vec<String>) {
    if dropped.total() > 0 {
        warnings.push(format!(
            "{} dropped: {} not finite, {} without area",
            format::counted(dropped.total(), "triangle is", "triangles are"),
            dropped.non_finite,
            dropped.zero_area
        ));
    }
}

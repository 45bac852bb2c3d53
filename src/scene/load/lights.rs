//! Punctual lights and cameras at the positions of their nodes. Scale moves them, and turns them only where it mirrors:
//! see [`Nodes::orientations`].

use std::collections::HashSet;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use glam::{DMat3, DVec3, Mat3, Vec3};
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use gltf::json::validation::Checked;
use gltf::json::{Camera as CameraDefinition, camera::Type as CameraType};

use super::document::Document;
use super::nodes::{Nodes, node_label};
use super::text::{label, short};
use super::transform::{Pose, WorldPoint};
use crate::scene::camera::Projection;
use crate::scene::error::{RE_EXPORT, SceneError};
use crate::scene::light::LIGHT_MAX;
use crate::scene::{Camera, LightKind, PunctualLight};

/// The point to which the scene's positions are relative: landmark + centre.
pub(super) struct SceneOrigin<'a> {
    pub landmark: &'a WorldPoint,
    /// Relative to the landmark.
    pub centre: DVec3,
}

impl SceneOrigin<'_> {
    fn position(&self, pose: &Pose) -> Vec3 {
        // + 0.0 turns −0 into +0, as it does for vertices.
        ((pose.offset - self.centre) + DVec3::ZERO).as_vec3()
    }
}

/// The lights of a scene.
#[derive(Default)]
pub(super) struct Lights {
    pub lights: Vec<PunctualLight>,
    /// How many are brighter than [`LIGHT_MAX`], and clamped to it.
    pub clamped: u64,
}

/// The lights of the visible nodes (`KHR_lights_punctual`).
pub(super) fn lights(
    document: &Document,
    nodes: &Nodes,
    origin: &SceneOrigin,
    warnings: &mut Vec<String>,
) -> Result<Lights, SceneError> {
    let Lights { mut lights, mut clamped } = Lights::default();
    for &index in &nodes.visible {
        let node = &document.nodes[index];
        let Some(reference) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) else { continue };
        let light = document.get(&document.lights, "light", reference.light, &node_label(document, index))?;
        let place = label("light", reference.light.value(), light.name.as_deref());
        let pose = nodes.placements[index].relative_to(origin.landmark);
        let position = origin.position(&pose);
        if !position.is_finite() {
            return Err(document.invalid(place, "it is infinitely far from the scene", "move it closer"));
        }
        let direction = (nodes.orientations[index] * DVec3::NEG_Z).normalize_or(DVec3::NEG_Z).as_vec3();
        let mut intensity = intensity(document, light, &place, warnings)?;
        if intensity.max_element() > LIGHT_MAX {
            warnings.push(format!("{place}: its color × intensity exceeds {LIGHT_MAX:e} and is clamped to that"));
            intensity = intensity.min(Vec3::splat(LIGHT_MAX));
            clamped += 1;
        }
        let Some(kind) = kind(document, light, direction, position, &place, warnings)? else { continue };
        let name = node.name.as_deref().or(light.name.as_deref());
        let name = name.map_or_else(|| format!("light {}", lights.len()), short);
        lights.push(PunctualLight { name, kind, intensity });
    }
    Ok(Lights { lights, clamped })
}

/// Colour × intensity. Neither may be negative: each alone becomes 0, because the product of two would be light.
fn intensity(document: &Document, light: &Light, place: &str, warnings: &mut Vec<String>) -> Result<Vec3, SceneError> {
    let (color, intensity) = (Vec3::from_array(light.color), light.intensity);
    if !color.is_finite() || !intensity.is_finite() {
        let what = if color.is_finite() { "intensity" } else { "color" };
        return Err(document.invalid(place, format!("its {what} is not finite"), "correct the light"));
    }
    if intensity < 0.0 {
        warnings.push(format!("{place}: its negative intensity {intensity} is set to 0"));
    }
    if color.min_element() < 0.0 {
        warnings.push(format!("{place}: negative channels of its color {color} are set to 0"));
    }
    Ok(color.max(Vec3::ZERO) * intensity.max(0.0))
}

/// The light's kind, or `None` for a spot light without a cone.
fn kind(
    document: &Document,
    light: &Light,
    direction: Vec3,
    position: Vec3,
    place: &str,
    warnings: &mut Vec<String>,
) -> Result<Option<LightKind>, SceneError> {
    let range_m = match light.range {
        Some(range) if range > 0.0 => range,
        Some(range) => {
            warnings.push(format!("{place}: range {range} is not positive and counts as infinite"));
            f32::INFINITY
        }
        None => f32::INFINITY,
    };
    let (inner, outer) = match &light.type_ {
        Checked::Valid(Type::Directional) => return Ok(Some(LightKind::Directional { direction })),
        Checked::Valid(Type::Point) => return Ok(Some(LightKind::Point { position, range_m })),
        Checked::Valid(Type::Spot) => match &light.spot {
            Some(spot) => (spot.inner_cone_angle, spot.outer_cone_angle),
            None => (0.0, FRAC_PI_4),
        },
        Checked::Invalid => {
            return Err(document.invalid(place, "KHR_lights_punctual does not define its type", RE_EXPORT));
        }
    };
    if !inner.is_finite() || !outer.is_finite() {
        let what = if outer.is_finite() { "innerConeAngle" } else { "outerConeAngle" };
        return Err(document.invalid(place, format!("its {what} is not finite"), "correct the light"));
    }
    // The extension asks for 0 ≤ inner < outer ≤ π/2. Within a cone of no width no point can be lit.
    if outer <= 0.0 {
        warnings.push(format!("{place} is left out: its outerConeAngle is {outer}, but must be greater than 0"));
        return Ok(None);
    }
    let outer_cone_rad = outer.min(FRAC_PI_2);
    let inner_cone_rad = inner.clamp(0.0, outer_cone_rad);
    if (inner_cone_rad, outer_cone_rad) != (inner, outer) {
        warnings.push(format!(
            "{place}: cone angles {inner} and {outer} are clamped to 0 ≤ inner ≤ outer ≤ π/2: {inner_cone_rad} and \
             {outer_cone_rad}"
        ));
    }
    Ok(Some(LightKind::Spot { position, direction, range_m, inner_cone_rad, outer_cone_rad }))
}

/// The cameras of the visible nodes, with unique names. A camera that cannot be used is left out with a warning and is
/// no error, because a bake needs no camera.
pub(super) fn cameras(
    document: &Document,
    nodes: &Nodes,
    origin: &SceneOrigin,
    warnings: &mut Vec<String>,
) -> Vec<Camera> {
    let mut cameras: Vec<Camera> = Vec::new();
    let mut taken = HashSet::new();
    for &index in &nodes.visible {
        let node = &document.nodes[index];
        let Some(camera_index) = node.camera else { continue };
        let definition = document.parse_at(&document.cameras, "camera", camera_index, &node_label(document, index));
        let definition = match definition {
            Ok(definition) => definition,
            Err(fault) => {
                warnings.push(format!("a camera is left out: {}", fault.in_file()));
                continue;
            }
        };
        let pose = nodes.placements[index].relative_to(origin.landmark);
        let position = origin.position(&pose);
        let frame = frame(&nodes.orientations[index]).filter(|_| position.is_finite());
        let (Some(world_from_camera), Some(projection)) = (frame, projection(&definition)) else {
            let place = label("camera", camera_index.value(), definition.name.as_deref());
            warnings.push(format!("{place} is left out: its projection or its node's transform is not valid"));
            continue;
        };
        let name = [&node.name, &definition.name].into_iter().flatten().find(|name| !name.is_empty());
        let name = unique(name.map_or_else(|| cameras.len().to_string(), |name| short(name)), &mut taken);
        cameras.push(Camera { name, position, world_from_camera, projection });
    }
    cameras
}

/// The name itself if it is free, or the first free one of `name#2`, `name#3`, ….
fn unique(name: String, taken: &mut HashSet<String>) -> String {
    let mut candidate = name.clone();
    let mut number = 1;
    while !taken.insert(candidate.clone()) {
        number += 1;
        candidate = format!("{name}#{number}");
    }
    candidate
}

/// The right, up and back vectors of a view with this orientation, which may mirror. A picture is never mirrored: back
/// and up are kept, and right follows from them.
fn frame(orientation: &DMat3) -> Option<Mat3> {
    let back = orientation.z_axis.try_normalize()?;
    let right = orientation.y_axis.try_normalize()?.cross(back).try_normalize()?;
    Some(Mat3::from_cols(right.as_vec3(), back.cross(right).as_vec3(), back.as_vec3()))
}

fn projection(definition: &CameraDefinition) -> Option<Projection> {
    match definition.type_ {
        Checked::Valid(CameraType::Perspective) => {
            let fov_y_rad = definition.perspective.as_ref()?.yfov;
            (fov_y_rad > 0.0 && fov_y_rad < PI).then_some(Projection::Perspective { fov_y_rad })
        }
        Checked::Valid(CameraType::Orthographic) => {
            let half_height_m = definition.orthographic.as_ref()?.ymag.abs();
            (half_height_m > 0.0 && half_height_m.is_finite()).then_some(Projection::Orthographic { half_height_m })
        }
        Checked::Invalid => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_names_are_numbered() {
        let mut taken = HashSet::new();
        let names = ["a", "a", "a#2", "b", "a"].map(|n| unique(n.to_owned(), &mut taken));
        assert_eq!(names, ["a", "a#2", "a#2#2", "b", "a#3"]);
    }

    #[test]
    fn camera_frames_are_right_handed_and_orthonormal() {
        for linear in [DMat3::IDENTITY, DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)), DMat3::from_rotation_x(0.3)] {
            let frame = frame(&linear).expect("a frame");
            assert!((frame.determinant() - 1.0).abs() < 1e-6);
            assert!(frame.mul_mat3(&frame.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-6));
        }
        assert!(frame(&DMat3::ZERO).is_none());
    }
}

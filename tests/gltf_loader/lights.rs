//! Punctual lights: where they shine under scaled, mirrored and sheared nodes, and values that the extension forbids.

use std::f32::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use glam::Vec3;
use lightprobe::scene::light::LIGHT_MAX;
use lightprobe::scene::{LightKind, Scene};
use serde_json::{Value, json};

use crate::common::Gltf;
use crate::{TRIANGLE, error, loaded};

/// A triangle and one light.
fn with_light(light: Value) -> Gltf {
    let mut gltf = Gltf::of_triangles(&TRIANGLE);
    gltf.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [light] } });
    gltf.root(json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    gltf
}

/// Direction of a directional light and view of a camera on the last of these nodes, each the child of the one before.
fn directions(nodes: &[Value]) -> (Vec3, Vec3) {
    let mut gltf = with_light(json!({ "type": "directional" }));
    gltf.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }));
    let lamp = 1;
    gltf.json["nodes"][lamp]["camera"] = json!(0);
    let (own, parents) = nodes.split_last().expect("a node");
    for (key, value) in own.as_object().expect("an object") {
        gltf.json["nodes"][lamp][key] = value.clone();
    }
    let mut child = lamp;
    for parent in parents.iter().rev() {
        let mut parent = parent.clone();
        parent["children"] = json!([child]);
        child = gltf.push("nodes", parent);
    }
    gltf.json["scenes"][0]["nodes"] = json!([0, child]);
    let scene = loaded(&gltf);
    let LightKind::Directional { direction } = scene.lights[0].kind else { panic!("{:?}", scene.lights[0]) };
    (direction, -scene.cameras[0].world_from_camera.z_axis)
}

/// A turn by 45° about Y: the direction −Z becomes (−1, 0, −1)/√2.
const TURN: [f32; 4] = [0.0, 0.382_683_43, 0.0, 0.923_879_5];
const TURNED: Vec3 = Vec3::new(-FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2);

#[test]
fn scale_turns_no_light() {
    for scale in [[1.0, 1.0, 5.0], [3.0, 0.2, 1.0], [1.0, 1.0, -2.0], [-1.0, -1.0, -1.0], [0.0, 0.0, 0.0]] {
        // The node's own scale.
        let (light, view) = directions(&[json!({ "rotation": TURN, "scale": scale })]);
        assert!(light.abs_diff_eq(TURNED, 1e-6) && view.abs_diff_eq(TURNED, 1e-6), "{scale:?}: {light} {view}");
    }
    for scale in [[1.0, 1.0, 5.0], [3.0, 0.2, 1.0], [1e-12, 1.0, 1e12]] {
        // A parent's, which shears what is turned below it: the matrix would turn the light towards an axis.
        let (light, view) = directions(&[json!({ "scale": scale }), json!({ "rotation": TURN })]);
        assert!(light.abs_diff_eq(TURNED, 1e-6) && view.abs_diff_eq(TURNED, 1e-6), "{scale:?}: {light} {view}");
    }
}

#[test]
fn a_mirroring_parent_mirrors_directions() {
    // As it does with the walls: a lamp that lit the left wall lights what was the left wall.
    let (light, view) = directions(&[json!({ "scale": [-2.0, 2.0, 2.0] }), json!({ "rotation": TURN })]);
    let mirrored = TURNED * Vec3::new(-1.0, 1.0, 1.0);
    assert!(light.abs_diff_eq(mirrored, 1e-6) && view.abs_diff_eq(mirrored, 1e-6), "{light} {view}");
    let matrix = [-2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let (light, _) = directions(&[json!({ "matrix": matrix }), json!({ "rotation": TURN })]);
    assert!(light.abs_diff_eq(mirrored, 1e-6), "{light}");
}

#[test]
fn a_matrix_counts_by_its_rotation() {
    // Columns: TURN's axes times 2, 3 and 5.
    let (s, zero) = (FRAC_1_SQRT_2, 0.0);
    let matrix = [2.0 * s, 0.0, -2.0 * s, 0.0, 0.0, 3.0, 0.0, 0.0, 5.0 * s, 0.0, 5.0 * s, 0.0, zero, 0.0, 0.0, 1.0];
    let (light, view) = directions(&[json!({ "matrix": matrix })]);
    assert!(light.abs_diff_eq(TURNED, 1e-6) && view.abs_diff_eq(TURNED, 1e-6), "{light} {view}");
    // A shear, which glTF forbids: the symmetric one has no rotation in its polar decomposition.
    let sheared = [1.0, 0.0, 0.4, 0.0, 0.0, 1.0, 0.0, 0.0, 0.4, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let (light, view) = directions(&[json!({ "matrix": sheared })]);
    assert!(light.abs_diff_eq(Vec3::NEG_Z, 1e-6) && view.abs_diff_eq(Vec3::NEG_Z, 1e-6), "{light} {view}");
}

fn warned(scene: &Scene, word: &str) -> bool {
    scene.warnings.iter().any(|w| w.contains("light 0") && w.contains(word))
}

#[test]
fn negative_light_is_no_light() {
    for (color, intensity, expected, words) in [
        ([-1.0, -1.0, -1.0], -5.0, Vec3::ZERO, &["intensity -5", "color"][..]),
        ([1.0, 0.5, 1.0], -5.0, Vec3::ZERO, &["intensity -5"]),
        ([1.0, -0.5, 0.25], 4.0, Vec3::new(4.0, 0.0, 1.0), &["color"]),
        ([-1.0, 0.5, 1.0], 0.0, Vec3::ZERO, &["color"]),
    ] {
        let scene = loaded(&with_light(json!({ "type": "point", "color": color, "intensity": intensity })));
        assert_eq!(scene.lights[0].intensity, expected, "{color:?} {intensity}");
        assert!(words.iter().all(|word| warned(&scene, word)), "{:?}", scene.warnings);
    }
    let scene = loaded(&with_light(json!({ "type": "point", "color": [2.0, 0.5, 0.0], "intensity": 3.0 })));
    assert_eq!(scene.lights[0].intensity, Vec3::new(6.0, 1.5, 0.0));
    assert!(!warned(&scene, ""), "{:?}", scene.warnings);
}

#[test]
fn light_beyond_its_bound_is_clamped_and_what_is_not_finite_refused() {
    let scene = loaded(&with_light(json!({ "type": "point", "color": [1e20, 1.0, 0.0], "intensity": 1e25 })));
    assert_eq!(scene.lights[0].intensity, Vec3::new(LIGHT_MAX, 1e25, 0.0));
    assert!(warned(&scene, "clamped"), "{:?}", scene.warnings);
    // 10³⁹ is infinite in f32, and 0 times that not a number.
    for (color, intensity, word) in [(1.0, 1e39, "intensity"), (1e39, 1.0, "color"), (0.0, -1e39, "intensity")] {
        let message = error(&with_light(json!({ "type": "point", "color": vec![color; 3], "intensity": intensity })));
        assert!(message.contains("light 0") && message.contains(word), "{message}");
    }
}

#[test]
fn cones_that_the_extension_forbids() {
    let spot = |inner: f64, outer: f64| {
        with_light(json!({ "type": "spot", "spot": { "innerConeAngle": inner, "outerConeAngle": outer } }))
    };
    let cone = |scene: &Scene| match scene.lights[0].kind {
        LightKind::Spot { inner_cone_rad, outer_cone_rad, .. } => (inner_cone_rad, outer_cone_rad),
        other => panic!("{other:?}"),
    };
    for outer in [0.0, -0.3] {
        let scene = loaded(&spot(0.0, outer));
        assert!(scene.lights.is_empty() && warned(&scene, "outerConeAngle"), "{:?}", scene.warnings);
    }
    for (inner, outer, expected) in [
        (0.6, 0.3, (0.3, 0.3)),
        (0.1, 3.0, (0.1, FRAC_PI_2)),
        (-1.0, 0.5, (0.0, 0.5)),
        (2.0, 9.0, (FRAC_PI_2, FRAC_PI_2)),
    ] {
        let scene = loaded(&spot(inner, outer));
        assert_eq!(cone(&scene), expected);
        assert!(warned(&scene, "clamped"), "{:?}", scene.warnings);
    }
    let scene = loaded(&spot(0.3, 0.3));
    assert_eq!(cone(&scene), (0.3, 0.3));
    assert!(error(&spot(0.0, 1e39)).contains("outerConeAngle"));
    assert!(error(&spot(1e39, 0.5)).contains("innerConeAngle"));
}

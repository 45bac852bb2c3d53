//! Lamps on and in surfaces, by formula: neither rounding nor the order of nodes decides what they light.

use glam::{DQuat, DVec3, Vec3};
use lightprobe::light::path::Strategy;
use lightprobe::light::surface::SurfacePoint;
use lightprobe::scene::Camera;
use lightprobe::shade::points::see;
use lightprobe::trace::Ray;
use serde_json::{Value, json};

use super::{Check, STRATEGIES, camera, load, points, settings, small, world};
use crate::common::{Folder, Gltf};
use crate::probe_file::Vector;
use crate::program::{bake_physical, method, render, scene};
use crate::shapes::{Samples, add, add_light, diffuse, irradiance_from_quad, quad, room, save};

const DOWN: Vec3 = Vec3::NEG_Y;

fn double_sided(mut material: Value) -> Value {
    material["doubleSided"] = json!(true);
    material
}

/// A ceiling over the square [−1, 1]² at the height 1, of 2 × 2 × 2 triangles; its front faces down or up.
fn ceiling(faces_down: bool) -> Vec<[f32; 3]> {
    let (u, v) = ([2.0, 0.0, 0.0], [0.0, 0.0, 2.0]);
    let (u, v) = if faces_down { (u, v) } else { (v, u) };
    quad([-1.0, 1.0, -1.0], u, v, 2)
}

/// Light of 5 W·sr⁻¹ that looks down.
fn light(kind: &str, at: [f64; 3]) -> (Value, Value) {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let light = match kind {
        "spot" => json!({ "type": kind, "intensity": 5.0, "spot": { "innerConeAngle": 1.4, "outerConeAngle": 1.5 } }),
        _ => json!({ "type": kind, "intensity": 5.0 }),
    };
    (light, json!({ "translation": at, "rotation": [-half, 0.0, 0.0, half] }))
}

/// Irradiance from 5 W·sr⁻¹ at a point with this normal.
fn falloff(lamp: [f64; 3], point: Vec3, normal: Vec3) -> f64 {
    let to = DVec3::from(lamp) - point.as_dvec3();
    5.0 * to.dot(normal.as_dvec3()).max(0.0) / to.length().powi(3)
}

/// Direct irradiance at points of space at the heights 0 and 2 that face up and down, below and above the ceiling.
fn direct(gltf: Gltf, at: [f64; 3]) -> [f64; 2] {
    let folder = Folder::new();
    let scene = load(&save(gltf, &folder, "ceiling"));
    let world = world(&scene);
    let mut found = [0.0, 0.0];
    let sides = [(0.0, Vec3::Y), (2.0, DOWN)];
    for (share, (height, normal)) in found.iter_mut().zip(sides) {
        let grid = (0..49).map(|i| [f64::from(i % 7) * 0.3 - 0.9, height, f64::from(i / 7) * 0.3 - 0.9]);
        for place in grid {
            let position = (DVec3::from(place) - scene.origin_world).as_vec3();
            let point = SurfacePoint::in_space(position, normal);
            let (irradiance, _) = world.punctual_irradiance(&point, normal, 0);
            let exact = falloff(at, DVec3::from(place).as_vec3(), normal);
            // Spots of this cone are at full strength within 1.4 rad; all of the points are.
            let of_exact = f64::from(irradiance.x) / exact;
            // f32 positions of a metre, squared and divided.
            assert!(irradiance.x == 0.0 || (of_exact - 1.0).abs() < 1e-5, "{place:?}: {irradiance} of {exact}");
            *share += of_exact / 49.0;
        }
    }
    // The rounding of single points is checked above.
    found.map(|share| (share * 1e4).round() / 1e4)
}

/// Lamps in the plane of a ceiling, and a micrometre on either side: all below it is lit. Behind a single-sided ceiling it
/// is dark. Nothing tells the side of a point light in a double-sided sheet, so it lights both.
#[test]
fn a_lamp_in_a_ceiling_lights_the_room() {
    let plain = || diffuse([0.5; 3], [0.0; 3]);
    for dy in [0.0, 1e-6, -1e-6] {
        // Inside a triangle, on the edge between two, on the corner of six.
        for [x, z] in [[0.31, 0.17], [0.25, 0.25], [0.0, 0.0]] {
            let at = [x, 1.0 + dy, z];
            let case = |kind: &str, ceilings: &[(bool, Value)]| {
                let mut gltf = Gltf::new();
                ceilings.iter().for_each(|(down, material)| {
                    add(&mut gltf, &ceiling(*down), material.clone());
                });
                let (lamp, node) = light(kind, at);
                add_light(&mut gltf, lamp, node);
                direct(gltf, at)
            };
            for kind in ["point", "spot"] {
                assert_eq!(case(kind, &[(true, plain())]), [1.0, 0.0], "{kind} at {at:?}");
            }
            // The axis of a spot tells the side where the surface does not.
            assert_eq!(case("spot", &[(false, plain())]), [1.0, 0.0], "{at:?}");
            assert_eq!(case("spot", &[(true, double_sided(plain()))]), [1.0, 0.0], "{at:?}");
            assert_eq!(case("point", &[(false, plain())]), [0.0, 1.0], "{at:?}: the front is above");
            assert_eq!(case("point", &[(true, double_sided(plain()))]), [1.0, 1.0], "{at:?}");
            assert_eq!(case("point", &[(true, plain()), (false, plain())]), [1.0, 1.0], "{at:?}");
            // A floor above the ceiling is not in its plane: whatever the lamp does there, this one hides it.
            let mut gltf = Gltf::new();
            add(&mut gltf, &ceiling(true), double_sided(plain()));
            let above = ceiling(false).iter().map(|p| [p[0], 1.1, p[2]]).collect::<Vec<_>>();
            add(&mut gltf, &above, plain());
            let (lamp, node) = light("point", at);
            add_light(&mut gltf, lamp, node);
            assert_eq!(direct(gltf, at), [1.0, 0.0], "{at:?}");
        }
    }
}

/// In an edge and in a corner of a room, which sees all of the lamp, and outside, which sees nothing of it.
#[test]
fn a_lamp_in_a_corner_lights_the_room() {
    for at in [[0.3, 1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, -1.0]] {
        let folder = Folder::new();
        let mut gltf = Gltf::new();
        add(&mut gltf, &room(2), diffuse([0.5; 3], [0.0; 3]));
        let (lamp, node) = light("point", at);
        add_light(&mut gltf, lamp, node);
        let scene = load(&save(gltf, &folder, "corner"));
        let world = world(&scene);
        for i in 0..64 {
            let inside = Vec3::new((i % 4) as f32, (i / 4 % 4) as f32, (i / 16) as f32) * 0.5 - 0.75;
            for (place, lit) in [(inside, true), (inside * 3.0, (inside * 3.0).abs().max_element() < 1.0)] {
                let normal = (Vec3::from_array(at.map(|x| x as f32)) - place).normalize();
                let (irradiance, _) = world.punctual_irradiance(&SurfacePoint::in_space(place, normal), normal, 0);
                let exact = if lit { falloff(at, place, normal) } else { 0.0 };
                // f32 positions of a metre, squared and divided.
                assert!((f64::from(irradiance.x) - exact).abs() <= 1e-5 * exact, "{place}: {irradiance} of {exact}");
            }
        }
    }
}

/// Paths find the lamp by another function than direct light does, and bakes by a third way: all see the same light as
/// from a lamp that hangs a millimetre below the ceiling. The ceiling itself gets no light from a lamp in its plane, and
/// half of the lamp's light from one that hangs there, so it is black.
#[test]
fn paths_and_bakes_see_the_lamp_in_the_ceiling() {
    let folder = Folder::new();
    let found = ["hanging", "in", "spot_hanging", "spot_in"].map(|name| {
        let mut gltf = Gltf::new();
        let ceiling_at = |p: &[f32; 3]| p[1] == 1.0;
        let (top, others): (Vec<_>, Vec<_>) =
            room(1).chunks(3).map(<[_]>::to_vec).partition(|t| t.iter().all(ceiling_at));
        add(&mut gltf, &others.concat(), diffuse([0.5; 3], [0.0; 3]));
        add(&mut gltf, &top.concat(), diffuse([0.0; 3], [0.0; 3]));
        let kind = if name.starts_with("spot") { "spot" } else { "point" };
        let (lamp, node) = light(kind, [0.3, if name.ends_with("in") { 1.0 } else { 0.999 }, 0.1]);
        add_light(&mut gltf, lamp, node);
        let path = save(gltf, &folder, name);
        let baked = bake_physical(&folder, &path, "--set encoding.irradiance=f32 --set grid.divisions=(3,3,3)").file;
        let active = baked.active();
        let baked = active.iter().map(|&p| baked.mean_irradiance(p)[0]).sum::<f64>() / active.len() as f64;
        let scene = load(&path);
        let world = world(&scene);
        let camera = camera(&scene, [0.0, 0.5, 0.0], [0.2, -1.0, 0.1], 70.0);
        let reference = small(&world, &camera, &settings(256, Strategy::Mis));
        let traced = reference.irradiance_indirect().iter().map(|e| f64::from(e.x)).sum::<f64>();
        [baked, traced]
    });
    for (hanging, inside) in [(found[0], found[1]), (found[2], found[3])] {
        for (what, a, b) in [("bake", hanging[0], inside[0]), ("reference", hanging[1], inside[1])] {
            // Equal random numbers; a millimetre changes the light by a thousandth, and some paths by more.
            assert!(a > 0.0 && (b / a - 1.0).abs() < 0.01, "{what}: {b} in the ceiling, {a} below it");
        }
    }
}

/// Corner and sides of a lamp in the plane of the ceiling, facing down.
const LAMP: [Vector; 3] = [[-0.4, 1.0, -0.1], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]];
const RADIANCE: f64 = 10.0;

/// What a scene of coplanar surfaces is made of.
#[derive(Clone, Copy)]
enum Part {
    Ceiling {
        faces_down: bool,
        double_sided: bool,
    },
    /// Raised by so many metres.
    Lamp {
        dy: f32,
        faces_down: bool,
        double_sided: bool,
        radiance: f64,
    },
}

/// The parts in their order, turned as a whole.
fn assembled(parts: &[Part], turn: DQuat) -> Gltf {
    let mut gltf = Gltf::new();
    for part in parts {
        let (triangles, material, both) = match *part {
            Part::Ceiling { faces_down, double_sided } => {
                (ceiling(faces_down), diffuse([0.0; 3], [0.0; 3]), double_sided)
            }
            Part::Lamp { dy, faces_down, double_sided, radiance } => {
                let [corner, u, v] = LAMP.map(|p| p.map(|x| x as f32));
                let corner = [corner[0], corner[1] + dy, corner[2]];
                let (u, v) = if faces_down { (u, v) } else { (v, u) };
                (quad(corner, u, v, 1), diffuse([0.0; 3], [radiance; 3]), double_sided)
            }
        };
        let node = add(&mut gltf, &triangles, if both { double_sided(material) } else { material });
        gltf.json["nodes"][node]["rotation"] = json!(turn.to_array());
    }
    // A black floor, so that pictures show something.
    let floor = quad([-1.0, -1.0, -1.0], [0.0, 0.0, 2.0], [2.0, 0.0, 0.0], 1);
    let node = add(&mut gltf, &floor, diffuse([0.0; 3], [0.0; 3]));
    gltf.json["nodes"][node]["rotation"] = json!(turn.to_array());
    gltf
}

const CEILING: Part = Part::Ceiling { faces_down: true, double_sided: false };
const PLAIN: Part = lamp(0.0, true, false, RADIANCE);

const fn lamp(dy: f32, faces_down: bool, double_sided: bool, radiance: f64) -> Part {
    Part::Lamp { dy, faces_down, double_sided, radiance }
}

/// Scenes in which the lamp lights what is below it as if it were alone.
fn cases() -> Vec<(&'static str, Vec<Part>)> {
    let both = lamp(0.0, true, true, RADIANCE);
    let at = |dy| lamp(dy, true, false, RADIANCE);
    // They hide only the upper side of others.
    let brighter_above = lamp(0.0, false, false, 3.0 * RADIANCE);
    vec![
        ("single-sided", vec![PLAIN, CEILING]),
        ("a micrometre below", vec![at(-1e-6), CEILING]),
        ("a micrometre above", vec![at(1e-6), CEILING]),
        ("double-sided lamp", vec![both, CEILING]),
        ("double-sided ceiling", vec![PLAIN, Part::Ceiling { faces_down: true, double_sided: true }]),
        ("back plate", vec![PLAIN, Part::Ceiling { faces_down: false, double_sided: false }]),
        ("twice", vec![PLAIN, PLAIN, CEILING]),
        ("over a dimmer one", vec![PLAIN, lamp(0.0, true, false, 3.0)]),
        ("over a dimmer double-sided one", vec![PLAIN, lamp(0.0, true, true, 3.0)]),
        ("over a dimmer double-sided one, wound the other way", vec![PLAIN, lamp(0.0, false, true, 3.0)]),
        ("double-sided below a brighter one", vec![both, brighter_above]),
        (
            "double-sided below a brighter one, wound the other way",
            vec![lamp(0.0, false, true, RADIANCE), brighter_above],
        ),
    ]
}

#[test]
fn a_lamp_in_the_plane_of_the_ceiling_lights_as_if_alone() {
    let tilt = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    for (name, parts) in cases() {
        for (turn, strategies) in [(DQuat::IDENTITY, &STRATEGIES[..]), (tilt, &STRATEGIES[..1])] {
            for reversed in [false, true] {
                let mut parts = parts.clone();
                if reversed {
                    parts.reverse();
                }
                let folder = Folder::new();
                let scene = load(&save(assembled(&parts, turn), &folder, "coplanar"));
                assert!(scene.warnings.iter().any(|w| w.contains("plane of another surface")), "{:?}", scene.warnings);
                let world = world(&scene);
                let from = (turn * DVec3::new(0.0, 0.9, 0.0)).to_array();
                let camera: Camera = camera(&scene, from, (turn * DVec3::new(0.1, -1.0, 0.1)).to_array(), 30.0);
                let exact: Vec<DVec3> = points(&world, &camera)
                    .iter()
                    .map(|(_, place)| (turn.inverse() * *place).to_array())
                    .map(|place| DVec3::splat(RADIANCE * irradiance_from_quad(place, [0.0, 1.0, 0.0], LAMP, 60)))
                    .collect();
                for &strategy in strategies {
                    let reference = small(&world, &camera, &settings(256, strategy));
                    // The midpoint rule errs by (0.5/2/60)².
                    let what = format!("{name}, {strategy:?}, reversed {reversed}");
                    Check::indirect(&reference).floor(1e-4).against(&exact, &what);
                }
            }
        }
    }
}

/// Above the ceiling a lamp that faces down is never seen, and a double-sided one or one that faces up is.
#[test]
fn the_far_side_sees_what_faces_it() {
    for (name, parts) in cases() {
        for reversed in [false, true] {
            let mut parts = parts.clone();
            if reversed {
                parts.reverse();
            }
            let folder = Folder::new();
            let scene = load(&save(assembled(&parts, DQuat::IDENTITY), &folder, "above"));
            let world = world(&scene);
            for i in 0..100 {
                let place = [-0.38 + 0.046 * f64::from(i % 10), 1.5, -0.08 + 0.046 * f64::from(i / 10)];
                let origin = (DVec3::from(place) - scene.origin_world).as_vec3();
                let ray = Ray::new(origin, Vec3::new(0.03, -1.0, -0.02).normalize(), 0);
                let emits = world.surface(ray).expect("the ceiling").emission != Vec3::ZERO;
                let faces = |part: &Part| matches!(part, Part::Lamp { faces_down, double_sided, .. } if *double_sided || !faces_down);
                assert_eq!(emits, parts.iter().any(faces), "{name}, reversed {reversed}, {place:?}");
            }
        }
    }
}

#[test]
fn bakes_see_the_lamp_in_the_plane_of_the_ceiling() {
    let words = "--set encoding.irradiance=f32 --set placement.keep_unsampled=true --set solver.max_bounces=1 \
                 --set capture.resolution=64 --set capture.samples_per_texel=2 --set grid.divisions=(2,2,2) \
                 --set capture.probe_emitter_samples=4096 \
                 --set grid.bounds={\"min\":[-0.3,-0.5,-0.2],\"max\":[0.3,0.2,0.4]}";
    for reversed in [false, true] {
        let mut parts = vec![PLAIN, CEILING];
        if reversed {
            parts.reverse();
        }
        let folder = Folder::new();
        let path = save(assembled(&parts, DQuat::IDENTITY), &folder, "coplanar");
        let files: Vec<_> =
            (0..4).map(|seed| bake_physical(&folder, &path, &format!("{words} --seed {seed}")).file).collect();
        assert_eq!(files[0].active().len(), 8);
        for probe in files[0].active() {
            let (position, texels) = (files[0].position(probe), files[0].texels(probe));
            let exact: Vec<f64> =
                texels.iter().map(|t| RADIANCE * irradiance_from_quad(position, t.0, LAMP, 60)).collect();
            // As for lamps elsewhere (`closed_forms`): the horizon runs through texels.
            let floor = 0.006 * exact.iter().copied().fold(0.0, f64::max);
            Samples::of(&files, &[probe], 0).check(&exact, floor, &format!("probe {probe}, reversed {reversed}"));
        }
    }
}

/// Probes on the walls, in the edges and in the corners of a room that is as bright everywhere. They are captured from the
/// side of the room, and every point of the room sees all of them.
#[test]
fn probes_in_the_walls_of_a_room_see_all_of_it() {
    let folder = Folder::new();
    let bounds = "--set grid.bounds=(min:(-1,0,-1),max:(1,2,1)) --set grid.divisions=(3,3,3)";
    for rule in ["placement.rule=grid_points", "placement.relocate=false"] {
        let words = format!("{bounds} --set {rule} --set encoding.irradiance=f32 --set capture.emission=gathered");
        let baked = bake_physical(&folder, &scene("furnace"), &words);
        assert_eq!(baked.file.active().len(), 27, "{rule}");
        for probe in baked.file.active() {
            for (normal, _, irradiance) in baked.file.texels(probe) {
                // The rounding of some ten bounces in f32, and the solver's tolerance of 1e-4.
                let off = irradiance[0] / (2.0 * std::f64::consts::PI) - 1.0;
                assert!(off.abs() < 3e-4, "{rule}, probe {probe}, {normal:?}: {irradiance:?}");
            }
        }
        let report = render(&folder, &scene("furnace"), &baked.path, "walls", "--size 32x18");
        let mean = |name| method(&report, name)["irradiance_indirect_mean"].as_f64().unwrap();
        assert_eq!(mean("visibility_ray"), mean("visibility_off"), "{rule}: a convex room hides nothing");
        assert_eq!(method(&report, "visibility_ray")["leak"]["unseen"], 0.0, "{rule}");
    }
}

/// Two halves of a floor meet under the middle column of pixels: it shows one of them, and the same one in any order.
#[test]
fn pixels_on_an_edge_show_one_side() {
    let seen = [false, true].map(|reversed| {
        let mut halves = [(-1.0, 0.2), (0.0, 0.8)];
        if reversed {
            halves.reverse();
        }
        let mut gltf = Gltf::new();
        for (left, albedo) in halves {
            let floor = quad([left, 0.0, -1.0], [0.0, 0.0, 2.0], [1.0, 0.0, 0.0], 1);
            add(&mut gltf, &floor, diffuse([albedo; 3], [0.0; 3]));
        }
        let folder = Folder::new();
        let scene = load(&save(gltf, &folder, "halves"));
        let world = world(&scene);
        // It looks straight down, with +X to the right.
        let camera = camera(&scene, [0.0, 1.0, 0.0], [0.0, 0.0, 0.0], 60.0);
        let view = see(&world, &camera, 15, 9, 1);
        view.points.iter().map(|p| (p.pixel, p.surface.albedo.x)).collect::<Vec<_>>()
    });
    assert_eq!(seen[0], seen[1]);
    let middle: Vec<f32> = seen[0].iter().filter(|p| p.0 % 15 == 7).map(|p| p.1).collect();
    assert_eq!(middle.len(), 9);
    assert!(middle.iter().all(|albedo| *albedo == middle[0]), "{middle:?}");
}

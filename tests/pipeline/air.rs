//! Figures of the air, what objects get that move: where the light is known, and where geometry is.

use glam::Vec3;
use lightprobe::image::LayeredImage;
use lightprobe::light::World;
use lightprobe::probe::file;
use lightprobe::probe::query::Query;
use lightprobe::scene::{self, LoadOptions};
use lightprobe::shade::air::{Air, POINTS};
use serde_json::Value;

use crate::common::{Folder, Gltf};
use crate::program::{bake, bake_physical, method, render, scene};
use crate::shapes::{add, diffuse, quad, save};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// In a closed room whose walls are all equally bright, every point of the air gets πLe/(1 − ρ).
#[test]
fn the_air_of_a_furnace_is_evenly_lit() {
    let folder = Folder::new();
    // Objects in the air want the probes of the corners too, which surfaces can do without.
    let format = "--preset physical --set store.irradiance.octahedral.format=f32 --set grid.spacing_m=0.5 --set placement.keep_unsampled=true";
    let baked = bake(&folder, &scene("furnace"), format);
    let report = render(&folder, &scene("furnace"), &baked.path, "run", "--size 16x9 --reference 64");
    for name in ["visibility_off", "visibility_on", "visibility_ray"] {
        let air = &method(&report, name)["air"];
        assert_eq!((&air["points"], &air["black"], &air["unseen"]), (&POINTS.into(), &0.0.into(), &0.0.into()));
        assert!(number(&air["leak_light"]) < 1e-5 && number(&air["leak_dark"]) < 1e-5, "{air}");
        // 64 paths know each point to some 10 %; what is left of that in the mean of 4096 squares is a standard error.
        let (error, bar) = (number(&air["error"]), number(&air["standard_error"]["error"]));
        assert!(error < 0.02 && error < 5.0 * bar + 2e-3, "{air}");
    }
    let without = render(&folder, &scene("furnace"), &baked.path, "without", "--size 16x9");
    assert!(method(&without, "visibility_on")["air"]["error"].is_null());
}

/// Walls are solids of at least 0.09 m around and between two rooms of 4 m; the one in the middle is complete. Where solids
/// run into each other, half of what a point inside sees is the front of the other one, and nothing is said about it.
#[test]
fn points_lie_in_the_rooms_and_see_the_probes_of_their_own() {
    let folder = Folder::new();
    let baked = bake(&folder, &scene("two_rooms_sealed"), "--set grid.spacing_m=1");
    let loaded = scene::load(&scene("two_rooms_sealed"), &LoadOptions::default()).unwrap();
    let world = World::new(&loaded, 1.0, 0.999).unwrap();
    let probes = file::read(&baked.path).unwrap();
    let volume = probes.volume_as_planned(loaded.origin_world);
    let query = Query { volume: &volume, settings: &probes.query.weights };
    let origin = loaded.origin_world.as_vec3();
    let air = Air::new(&world, &query, 0);
    assert_eq!((air.points.len(), air.masks.len()), (POINTS as usize, POINTS as usize));
    let (mut left, mut normals) = (0usize, Vec3::ZERO);
    for (point, mask) in air.points.iter().zip(&air.masks) {
        let p = point.position + origin;
        // Beyond the inner faces by more than rounding, and before the outer ones; a wall's thickness off its neighbours.
        let depth = [p.x.abs() - 4.05, (p.y - 1.5).abs() - 1.5, p.z.abs() - 2.0];
        let beside = |axis: usize| (0..3).filter(|&other| other != axis).all(|other| depth[other] < -0.1);
        let in_wall = |axis: usize| (1e-3..0.089).contains(&depth[axis]) && beside(axis) && p.x.abs() > 0.15;
        let in_divider = p.x.abs() < 0.049 && beside(0);
        assert!(!in_divider && !(0..3).any(in_wall), "{p}");
        left += usize::from(p.x < 0.0);
        normals += point.normal;
        for (i, probe) in volume.grid.corners_around(&query.cell(point)).into_iter().enumerate() {
            let other_room = (volume.position(probe) + origin).x * p.x < 0.0;
            assert!(mask >> i & 1 == 0 || !other_room, "{p} sees through the wall");
        }
    }
    // Rooms of equal size: a half each, five deviations of 0.0078; the mean normal is 0 to five of 0.009 along each axis.
    assert!((left as f64 / f64::from(POINTS) - 0.5).abs() < 0.039, "{left}");
    assert!((normals / POINTS as f32).abs().max_element() < 0.045, "{normals}");
    // The same for any probes that cover the scene, and others with another seed.
    let finer = bake(&folder, &scene("two_rooms_sealed"), "--set grid.spacing_m=1.5");
    let finer = file::read(&finer.path).unwrap().volume_as_planned(loaded.origin_world);
    let again = Air::new(&world, &Query { volume: &finer, settings: &probes.query.weights }, 0);
    assert!(air.points.iter().zip(again.points.iter()).all(|(a, b)| a.position == b.position && a.normal == b.normal));
    assert_ne!(Air::new(&world, &query, 1).points[0].position, air.points[0].position);
}

#[test]
fn light_leaks_into_the_air_without_visibility() {
    let folder = Folder::new();
    let baked = bake_physical(&folder, &scene("two_rooms_open"), "--set grid.spacing_m=1");
    let run = |name: &str, threads: u32| {
        let words = format!("--size 16x9 --reference 32 --threads {threads}");
        render(&folder, &scene("two_rooms_open"), &baked.path, name, &words)
    };
    let report = run("two", 2);
    let air = |name: &str| &method(&report, name)["air"];
    assert!(number(&air("visibility_off")["leak_light"]) > 0.005, "{}", air("visibility_off"));
    let exact = air("visibility_ray");
    assert_eq!((&exact["leak_light"], &exact["leak_dark"]), (&0.0.into(), &0.0.into()));
    // Interpolation errs, and leaks add to it.
    assert!(number(&exact["error"]) < number(&air("visibility_off")["error"]), "{report}");
    let one = run("one", 1);
    for name in ["visibility_off", "visibility_on", "visibility_ray"] {
        assert_eq!(&method(&one, name)["air"], air(name), "{name}");
    }
}

/// A ball in the lit room that the bake did not know, looked at from its own height: half of what shows of it faces the floor.
#[test]
fn an_object_that_the_bake_did_not_know_is_lit() {
    let folder = Folder::new();
    let set = "--set grid.spacing_m=1 --set fit=rows(rows_per_probe:20,paths:2)";
    let baked = bake(&folder, &scene("two_rooms_open"), set);
    let view = "--camera ball --size 64x36 --reference 64 --allow-scene-change";
    let report = render(&folder, &scene("two_rooms_ball"), &baked.path, "run", view);
    assert_eq!(report["scene_changed"], true);
    let picture = |name: &str| LayeredImage::read_exr(&folder.path().join("run").join(name)).expect("a picture");
    let (found, reference) = (picture("visibility_on.exr"), picture("reference.exr"));
    // The camera is 1.749 m from the ball's centre. Nothing else is as near: a view of 19 degrees meets the floor at 2.7 m.
    let depth = found.scalar("depth").expect("a depth");
    let is_ball = |pixel: usize| (1e-3..1.749).contains(&depth[pixel]);
    let ball: Vec<(Vec3, Vec3)> = (0..depth.len())
        .filter(|&pixel| is_ball(pixel))
        .map(|pixel| {
            let at = |image: &LayeredImage| image.layer("irradiance_indirect").expect("a layer")[pixel];
            (at(&found), at(&reference))
        })
        .collect();
    // Its radius of 0.25 m is 8.22 of the view's 9.5 degrees up and down, its disc 758 pixels less what facets cut off.
    assert!((740..=765).contains(&ball.len()), "{} pixels", ball.len());
    let is_black = |(found, reference): &&(Vec3, Vec3)| (found.cmple(Vec3::ZERO) & reference.cmpgt(Vec3::ZERO)).any();
    let black = ball.iter().filter(is_black).count() as f64 / ball.len() as f64;
    assert!(black < 0.005, "{black} of the ball is black");
    let mean = ball.iter().map(|(_, reference)| reference.element_sum()).sum::<f32>() / (3 * ball.len()) as f32;
    let square = ball.iter().map(|(found, reference)| found.distance_squared(*reference)).sum::<f32>();
    let error = (square / (3 * ball.len()) as f32).sqrt() / mean;
    // 0.13 was found. Probes of the empty room know nothing of the ball's own shadow on the floor, which its lower side sees:
    // the empty room's light, traced, would err by 0.08 itself. The rest is a grid of 1 m and the noise of 64 paths, and half
    // as much again is allowed for. A ball without any light would err by more than 1.
    assert!(error < 0.2, "{error}");
    // 0.08 was found with the room behind it, and 0.44 by all probes of a cell, hidden ones too: twice the first is allowed.
    let whole = |name: &str| number(&method(&report, name)["error"]["nrmse"]);
    assert!(whole("visibility_on") < 0.16 && whole("visibility_off") > 0.3, "{report}");
}

/// A floor has no air inside of it, and nothing tells that of double-sided surfaces: things move above and below it.
#[test]
fn the_air_of_a_floor_is_not_inside_of_it() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    let mut material = diffuse([0.5; 3], [0.0; 3]);
    material["doubleSided"] = true.into();
    let (u, v) = ([6.0, 0.0, 0.0], [0.0, 0.0, 6.0]);
    add(&mut gltf, &[quad([0.0; 3], u, v, 1), quad([0.0, 0.3, 0.0], v, u, 1)].concat(), material);
    let floor = save(gltf, &folder, "floor");
    let baked = bake(&folder, &floor, "--preset physical --env 1,1,1 --set grid.spacing_m=1");
    let loaded = scene::load(&floor, &LoadOptions::default()).unwrap();
    let world = World::new(&loaded, 1.0, 0.999).unwrap();
    let probes = file::read(&baked.path).unwrap();
    let volume = probes.volume_as_planned(loaded.origin_world);
    let air = Air::new(&world, &Query { volume: &volume, settings: &probes.query.weights }, 0);
    let height = |position: Vec3| position.y + loaded.origin_world.as_vec3().y;
    let inside = air.points.iter().filter(|point| (0.0..0.3).contains(&height(point.position))).count();
    // Two layers of probes 1 m apart: 0.3 of the height, known to 0.007.
    assert!((inside as f64 / f64::from(POINTS) - 0.3).abs() < 0.036, "{inside}");
}

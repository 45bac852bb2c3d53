//! Distance maps: mean and deviation against integrals, and Chebyshev's bound made of them.

use glam::{DVec3, UVec3, Vec2, Vec3};
use lightprobe::probe::lattice::ProbeState;
use lightprobe::probe::query::{Query, QueryPoint, QuerySettings, Visibility, VisibilityTest};
use lightprobe::probe::store::map::OctahedralMaps;
use lightprobe::probe::store::surface::Facing;
use lightprobe::probe::store::{IrradianceStore, Occlusion};
use lightprobe::probe::{Grid, Volume};

use crate::common::{Folder, Gltf};
use crate::probe_file::Vector;
use crate::program::bake;
use crate::shapes::{add, diffuse, dot, moved, room, save};

const MOMENTS: &str = "--preset physical --set query.visibility={\"moments\":{\"power\":1,\"floor\":0}} --set plan=keep_everything \
                       --set grid.divisions=(2,2,2) --set grid.bounds={\"min\":[-0.5,-0.5,-0.5],\"max\":[0.4,0.4,0.4]} \
                       --set capture.resolution=64 --set capture.samples_per_texel=4";

/// From a point to the walls of [−1, 1]³ along a unit direction.
fn to_wall(point: Vector, direction: Vector) -> f64 {
    let along = |k: usize| (direction[k].signum() - point[k]) / direction[k];
    (0..3).filter(|&k| direction[k] != 0.0).map(along).fold(f64::INFINITY, f64::min)
}

/// Mean and deviation of the distance under the lobe (ω·axis)^50, clamped.
fn exact(point: Vector, axis: Vector, clamp: f64) -> (f64, f64) {
    const BANDS: usize = 160;
    const SECTORS: usize = 320;
    let (mut weight, mut first, mut second) = (0.0, 0.0, 0.0);
    for band in 0..BANDS {
        let y = (band as f64 + 0.5) / BANDS as f64 * 2.0 - 1.0;
        let r = (1.0 - y * y).sqrt();
        for sector in 0..SECTORS {
            let phi = (sector as f64 + 0.5) / SECTORS as f64 * std::f64::consts::TAU;
            let direction = [r * phi.cos(), y, r * phi.sin()];
            let w = dot(axis, direction).max(0.0).powi(50);
            if w > 1e-9 {
                let distance = to_wall(point, direction).min(clamp);
                weight += w;
                first += w * distance;
                second += w * distance * distance;
            }
        }
    }
    let mean = first / weight;
    (mean, (second / weight - mean * mean).max(0.0).sqrt())
}

#[test]
fn mean_and_deviation_are_those_of_the_room() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.5; 3], [1.0; 3]));
    let scene = save(gltf, &folder, "room");
    let file = bake(&folder, &scene, MOMENTS).file;
    // distance_clamp is 1.5 diagonals of cells of 0.9 m.
    let clamp = 1.5 * 0.9 * 3f64.sqrt();
    for probe in file.active() {
        for (direction, mean, deviation) in file.distances(probe) {
            let (exact_mean, exact_deviation) = exact(file.position(probe), direction, clamp);
            // Texels of 0.05 rad with four jittered rays each, some four hundred in the lobe; distances there vary by
            // up to 0.3 m: 0.3/√400 = 0.015 at the very most, as the rays are stratified. A variance that is E[r]² for
            // E[r²], or lost, is off by 0.1 to 0.3 m.
            assert!((mean - exact_mean).abs() < 0.015, "{direction:?}: mean {mean} instead of {exact_mean}");
            assert!(
                (deviation - exact_deviation).abs() < 0.015,
                "{direction:?}: deviation {deviation} instead of {exact_deviation}"
            );
        }
    }
}

#[test]
fn the_deviation_survives_large_scenes() {
    // The same room 10⁵ times larger, where not even r, let alone r², fits half floats (65,504).
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    let node = add(&mut gltf, &room(1), diffuse([0.5; 3], [1.0; 3]));
    gltf.json["nodes"][node]["scale"] = serde_json::json!([1e5, 1e5, 1e5]);
    let scene = save(gltf, &folder, "large");
    let words = MOMENTS.replace("-0.5", "-50000").replace("0.4", "40000");
    let file = bake(&folder, &scene, &words).file;
    let small = {
        let mut gltf = Gltf::new();
        add(&mut gltf, &room(1), diffuse([0.5; 3], [1.0; 3]));
        bake(&folder, &save(gltf, &folder, "room"), MOMENTS).file
    };
    for probe in small.active() {
        for (a, b) in small.distances(probe).iter().zip(file.distances(probe)) {
            // Codes of 1/65535 of the largest distance, and rays whose f32 origins round differently.
            assert!((a.1 - b.1 / 1e5).abs() < 1e-3 && (a.2 - b.2 / 1e5).abs() < 1e-3, "{a:?} {b:?}");
        }
    }
}

#[test]
fn a_miss_counts_as_the_clamp_distance() {
    // A floor alone: upwards there is nothing, and nothing is no occluder.
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    let floor = crate::shapes::quad([-50.0, -1.0, -50.0], [0.0, 0.0, 100.0], [100.0, 0.0, 0.0], 1);
    add(&mut gltf, &floor, diffuse([0.5; 3], [1.0; 3]));
    let scene = save(gltf, &folder, "floor");
    let file = bake(&folder, &scene, &format!("{MOMENTS} --set placement.keep_unsampled=true")).file;
    let clamp = 1.5 * 0.9 * 3f64.sqrt();
    for probe in file.active() {
        for (direction, mean, deviation) in file.distances(probe).iter().filter(|d| d.0[1] > 0.8) {
            // The lobe of exponent 50 ends well above the horizon here; codes of 1/65535.
            assert!((mean - clamp).abs() < 1e-3 && *deviation < 1e-2, "{direction:?}: {mean} ± {deviation}");
        }
    }
}

/// Two probes a metre apart along x, whose distance maps hold these values on either half (z above or below 0).
fn pair(above: Vec2, below: Vec2) -> Volume {
    let mut distance = OctahedralMaps::new(2, 1, 0, above);
    // Resolution 1 cannot tell halves apart; two columns can, along x.
    distance = OctahedralMaps { resolution: 2, texels: [[above, below]; 4].concat(), ..distance };
    Volume {
        grid: Grid::from_parts(DVec3::ZERO, Vec3::ONE, UVec3::new(2, 1, 1)).expect("a grid"),
        states: vec![ProbeState::Active; 2],
        positions: vec![Vec3::ZERO, Vec3::X],
        irradiance: IrradianceStore::default().zeros(2, 1),
        occlusion: Occlusion::Moments(distance),
        radiance: Default::default(),
        layout: Default::default(),
    }
}

/// Weight that visibility gives probe 0, seen from a point at this distance straight above it along Z.
fn weight(volume: &Volume, distance: f32) -> f32 {
    let settings =
        QuerySettings { test: VisibilityTest::Chebyshev { power: 1.0, floor: 0.0 }, ..QuerySettings::default() };
    let point = QueryPoint {
        position: Vec3::Z * distance,
        normal: Vec3::NEG_Z,
        geometric: Vec3::NEG_Z,
        facing: Facing::of(Vec3::NEG_Z),
        view: Vec3::NEG_Z,
    };
    Query { volume, settings: &settings }.weights(&point, Visibility::Stored).weights[0]
}

#[test]
fn chebyshev_is_the_bound_of_its_name() {
    // σ²/(σ² + (d − μ)²) behind the mean, 1 before it; a few roundings of f32.
    let volume = pair(Vec2::new(1.0, 0.5), Vec2::new(1.0, 0.5));
    for (distance, expected) in [(0.5, 1.0), (1.0, 1.0), (1.5, 0.5), (2.0, 0.2), (6.0, 0.25 / 25.25)] {
        let found = weight(&volume, distance);
        assert!((found - expected).abs() < 1e-5, "at {distance}: {found} instead of {expected}");
    }
    // No spread: a wall, and no light from behind it.
    assert_eq!(weight(&pair(Vec2::new(1.0, 0.0), Vec2::new(1.0, 0.0)), 2.0), 0.0);
}

#[test]
fn chebyshev_of_two_texels_is_that_of_their_mixture() {
    // Straight along Z the look-up takes all four texels alike: distances 1 and 3, without spread of their own, have
    // the mean 2 and the variance 1; so have far larger distances with the same spread, where squares would cancel:
    // at 20 km E[r²] − E[r]² of f32 is a multiple of 32.
    for offset in [0.0f32, 20_000.0] {
        let volume = pair(Vec2::new(offset + 1.0, 0.0), Vec2::new(offset + 3.0, 0.0));
        let found = weight(&volume, offset + 4.0);
        // 1/(1 + 2²); one rounding at 20 km is 0.002 of the 2 m behind the mean.
        assert!((found - 0.2).abs() < 1e-3, "{found}");
    }
}

#[test]
fn a_distant_scene_has_the_same_distances() {
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([0.5; 3], [1.0; 3]));
    let scene = save(gltf, &folder, "room");
    let words = "--preset physical --set query.visibility={\"moments\":{\"power\":1,\"floor\":0}} --set plan=keep_everything \
                 --set grid.spacing_m=0.7";
    let here = bake(&folder, &scene, words).file;
    let far = folder.write("far.glb", moved(&std::fs::read(&scene).unwrap(), [1e5, 0.0, -1e5]));
    let there = bake(&folder, &far, words).file;
    assert_eq!(here.tensors, there.tensors);
}

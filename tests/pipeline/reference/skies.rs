//! Light from the sky.

use std::f64::consts::PI;

use glam::{DVec3, Vec2, Vec3};
use lightprobe::scene::Environment;
use lightprobe::scene::environment::EnvironmentMap;

use super::{Check, STRATEGIES, camera, load, settings, small, world};
use crate::common::{Folder, Gltf};
use crate::shapes::{add, diffuse, quad, save};

/// One black square of a metre that faces `normal`.
fn square(folder: &Folder, normal: DVec3) -> std::path::PathBuf {
    let mut gltf = Gltf::new();
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    let f32s = |p: DVec3| p.as_vec3().to_array();
    add(&mut gltf, &quad(f32s(-(u + v) / 2.0), f32s(u), f32s(v), 1), diffuse([0.0; 3], [0.0; 3]));
    save(gltf, folder, "square")
}

#[test]
fn a_constant_sky() {
    let folder = Folder::new();
    let normal = DVec3::new(0.3, 1.0, -0.2).normalize();
    let mut scene = load(&square(&folder, normal));
    scene.environment = Environment::Constant(Vec3::new(1.0, 2.0, 0.5));
    let world = world(&scene);
    let camera = camera(&scene, (normal * 0.5).to_array(), [0.0; 3], 60.0);
    for strategy in STRATEGIES {
        let reference = small(&world, &camera, &settings(256, strategy));
        Check::indirect(&reference).against_constant([PI, 2.0 * PI, 0.5 * PI], &format!("constant sky, {strategy:?}"));
    }
}

/// Brighter to one side and upwards, with a small sun: a texel a hundred times as bright.
fn gradient() -> EnvironmentMap {
    let (width, height) = (64, 32);
    let texel = |i: usize| {
        let (x, y) = ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
        if i == 10 * width + 40 { Vec3::new(100.0, 90.0, 70.0) } else { Vec3::new(1.0 - y, x, 0.2 + 0.8 * x * y) }
    };
    EnvironmentMap { width, height, texels: (0..width * height).map(texel).collect() }
}

/// Irradiance around `normal`, by the midpoint rule on a grid of 8 × 8 in every texel.
fn irradiance(map: &EnvironmentMap, normal: DVec3) -> DVec3 {
    const FINE: usize = 8;
    let (columns, rows) = (map.width * FINE, map.height * FINE);
    let mut sum = DVec3::ZERO;
    for row in 0..rows {
        let edge = |r: usize| (PI * r as f64 / rows as f64).cos();
        let solid_angle = (edge(row) - edge(row + 1)) * 2.0 * PI / columns as f64;
        for column in 0..columns {
            let uv = Vec2::new((column as f32 + 0.5) / columns as f32, (row as f32 + 0.5) / rows as f32);
            let cosine = EnvironmentMap::direction(uv).as_dvec3().dot(normal).max(0.0);
            sum += map.texels[row / FINE * map.width + column / FINE].as_dvec3() * (cosine * solid_angle);
        }
    }
    sum
}

#[test]
fn a_sky_with_a_gradient_and_a_sun() {
    let folder = Folder::new();
    for normal in [DVec3::Y, DVec3::new(0.5, 0.4, -0.3).normalize(), DVec3::new(-0.2, -0.9, 0.4).normalize()] {
        let mut scene = load(&square(&folder, normal));
        scene.environment = Environment::Map(gradient());
        let expected = irradiance(&gradient(), normal).to_array();
        let world = world(&scene);
        let camera = camera(&scene, (normal * 0.5).to_array(), [0.0; 3], 60.0);
        for strategy in STRATEGIES {
            let reference = small(&world, &camera, &settings(4096, strategy));
            // The quadrature's own error, mostly where the horizon cuts through its cells.
            let what = format!("gradient, {normal}, {strategy:?}");
            Check::indirect(&reference).floor(1e-4).against_constant(expected, &what);
        }
    }
}

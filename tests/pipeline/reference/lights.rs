//! Punctual lights, whose direct light is exact, and area lights.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::{Check, STRATEGIES, camera, load, points, settings, small, world};
use crate::common::{Folder, Gltf};
use crate::shapes::{add, add_light, diffuse, quad, save};
use lightprobe::light::path::Strategy;

/// Side of small receivers, metres: they hide and reflect nothing to speak of.
const SPECK: f64 = 0.01;

/// A black square around `at` that faces `normal`.
fn receiver(gltf: &mut Gltf, at: DVec3, normal: DVec3) {
    let u = normal.any_orthonormal_vector() * SPECK;
    let v = normal.cross(u);
    let corner = at - (u + v) / 2.0;
    let f32s = |p: DVec3| p.as_vec3().to_array();
    add(gltf, &quad(f32s(corner), f32s(u), f32s(v), 1), diffuse([0.0; 3], [0.0; 3]));
}

/// A ground plane wide enough for any horizon: half a kilometre each way.
fn ground(albedo: [f64; 3]) -> Gltf {
    let mut gltf = Gltf::new();
    let plane = quad([-500.0, 0.0, -500.0], [0.0, 0.0, 1000.0], [1000.0, 0.0, 0.0], 1);
    add(&mut gltf, &plane, diffuse(albedo, [0.0; 3]));
    gltf
}

/// Every pixel's direct irradiance on the plane y = 0 within f32's rounding of what it should be, and nothing else.
fn direct_on_ground(light: Value, node: Value, exact: impl Fn(DVec3) -> f64) {
    let folder = Folder::new();
    let mut gltf = ground([0.5; 3]);
    add_light(&mut gltf, light, node);
    let scene = load(&save(gltf, &folder, "light"));
    let world = world(&scene);
    let camera = camera(&scene, [0.5, 3.0, 1.0], [0.1, 0.0, -0.2], 60.0);
    let reference = small(&world, &camera, &settings(32, Strategy::Mis));
    let direct = reference.image.layer("irradiance_direct").unwrap();
    let mut lit = 0;
    for (point, place) in points(&world, &camera) {
        let expected = exact(place);
        lit += u32::from(expected > 0.0);
        let found = direct[point.pixel as usize];
        // Positions of 3 m are good to 3e-7, and powers of the distance and cones amplify it a little.
        assert!((f64::from(found.x) - expected).abs() <= 1e-5 * expected.max(0.01), "{place}: {found} {expected}");
    }
    assert!(lit > 10, "{lit} pixels lit");
    assert!(reference.irradiance_indirect().iter().all(|e| *e == Vec3::ZERO), "a plane does not light itself");
    assert!(reference.beauty_variance().unwrap().iter().all(|v| *v == Vec3::ZERO));
}

#[test]
fn direct_light_is_exact() {
    let at = DVec3::new(-0.3, 1.5, 0.4);
    let falloff = |p: DVec3| {
        let to = at - p;
        to.y / to.length().powi(3)
    };
    let node = || json!({ "translation": at.to_array() });
    direct_on_ground(json!({ "type": "point", "intensity": 5.0 }), node(), |p| 5.0 * falloff(p));
    direct_on_ground(json!({ "type": "point", "intensity": 5.0, "range": 2.5 }), node(), |p| {
        5.0 * falloff(p) * (1.0 - ((at - p).length() / 2.5).powi(4)).clamp(0.0, 1.0)
    });
    // A node that looks along −Z, turned by −90° about X, looks down.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let down = json!({ "translation": at.to_array(), "rotation": [-half, 0.0, 0.0, half] });
    let spot = json!({ "type": "spot", "intensity": 5.0, "spot": { "innerConeAngle": 0.3, "outerConeAngle": 0.9 } });
    direct_on_ground(spot, down, |p| {
        let cosine = (at - p).normalize().y;
        let cone = ((cosine - 0.9f64.cos()) / (0.3f64.cos() - 0.9f64.cos())).clamp(0.0, 1.0);
        5.0 * falloff(p) * cone * cone
    });
    let (sin, cos) = (-30f64).to_radians().sin_cos();
    let tilted = json!({ "rotation": [sin, 0.0, 0.0, cos] });
    direct_on_ground(json!({ "type": "directional", "intensity": 10.0 }), tilted, |_| 10.0 * 30f64.to_radians().cos());
}

/// A sphere of radius 1 seen from within, of flat triangles; and its area.
pub fn sphere(rows: u32) -> (Vec<[f32; 3]>, f64) {
    let columns = 2 * rows;
    let at = |i: u32, j: u32| {
        let theta = PI * f64::from(i) / f64::from(rows);
        // The last column is the first, to the bit: no gaps.
        let phi = 2.0 * PI * f64::from(j % columns) / f64::from(columns);
        let ring = if i == 0 || i == rows { 0.0 } else { theta.sin() };
        DVec3::new(ring * phi.cos(), theta.cos(), ring * phi.sin())
    };
    let (mut triangles, mut area) = (Vec::new(), 0.0);
    for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        for corners in [[a, c, b], [a, d, c]] {
            let size = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length() / 2.0;
            if size > 1e-12 {
                area += size;
                // Fronts face the centre.
                let [p, q, r] = corners;
                let inwards = (q - p).cross(r - p).dot(p) < 0.0;
                triangles.extend(if inwards { [p, q, r] } else { [p, r, q] }.map(|v| v.as_vec3().to_array()));
            }
        }
    }
    (triangles, area)
}

#[test]
fn integrating_spheres() {
    // A sphere's inside lights all of itself alike: after one reflection light is even, E = Φ/A·ρ/(1 − ρ) whatever the
    // light's pattern. Facets of 3/64 rad let it vary: by their angle at most where a facet's own neighbours are lit
    // brighter, and far less on average; the area is the facets' own, so the mean over the sphere is exact.
    const FACETS: f64 = 2e-3;
    let folder = Folder::new();
    let albedo = [0.2, 0.5, 0.8];
    let (triangles, area) = sphere(64);
    let (inner, outer) = (0.4f64, 0.9f64);
    let cone = |inner: f64, outer: f64| 2.0 * PI * ((inner.cos() - outer.cos()) / 3.0 + 1.0 - inner.cos());
    let spot = json!({ "innerConeAngle": inner, "outerConeAngle": outer });
    // Power that arrives, W; with a range the window at the distance of the wall.
    let window = 1.0 - 0.5f64.powi(4);
    let cases = [
        ("point", json!({ "type": "point", "intensity": 3.0 }), 4.0 * PI * 3.0),
        ("range", json!({ "type": "point", "intensity": 3.0, "range": 2.0 }), 4.0 * PI * 3.0 * window),
        ("spot", json!({ "type": "spot", "intensity": 3.0, "spot": spot }), 3.0 * cone(inner, outer)),
    ];
    for (name, light, flux) in cases {
        let mut gltf = Gltf::new();
        add(&mut gltf, &triangles, diffuse(albedo, [0.0; 3]));
        add_light(&mut gltf, light, json!({}));
        let scene = load(&save(gltf, &folder, name));
        let world = world(&scene);
        let camera = camera(&scene, [0.2, 0.1, 0.3], [1.0, -0.4, 0.2], 80.0);
        let reference = small(&world, &camera, &settings(1024, Strategy::Mis));
        let expected = albedo.map(|rho| flux / area * rho / (1.0 - rho));
        Check::indirect(&reference).floor(FACETS).against_constant(expected, name);
    }
}

#[test]
fn several_lights_are_chosen_without_bias() {
    // Lights of very different strength at the centre of a sphere add up.
    let folder = Folder::new();
    let (triangles, area) = sphere(64);
    let mut gltf = Gltf::new();
    add(&mut gltf, &triangles, diffuse([0.5; 3], [0.0; 3]));
    let intensities = [0.01f64, 1.0, 0.2, 30.0];
    for intensity in intensities {
        // Off the centre, so that no light is the same as another anywhere.
        let at = [0.1 * intensity.min(1.0), 0.0, -0.1 * intensity.min(1.0)];
        add_light(&mut gltf, json!({ "type": "point", "intensity": intensity }), json!({ "translation": at }));
    }
    let scene = load(&save(gltf, &folder, "lights"));
    let world = world(&scene);
    let camera = camera(&scene, [0.2, 0.3, 0.3], [1.0, -0.4, 0.2], 80.0);
    let reference = small(&world, &camera, &settings(1024, Strategy::Mis));
    let flux: f64 = intensities.iter().sum::<f64>() * 4.0 * PI;
    Check::indirect(&reference).floor(2e-3).against_constant([flux / area; 3], "four lights");
}

#[test]
fn the_first_bounce_of_a_sun() {
    // Radiance ρ·E·cos 30°/π everywhere below: E(n) = ρ·E·cos 30°·(1 − n·up)/2.
    let folder = Folder::new();
    let albedo = [0.2, 0.5, 0.8];
    for tilt in [90.0f64, 135.0, 150.0] {
        let mut gltf = ground(albedo);
        let (sin, cos) = (-30f64).to_radians().sin_cos();
        let light = json!({ "type": "directional", "intensity": 10.0 });
        add_light(&mut gltf, light, json!({ "rotation": [sin, 0.0, 0.0, cos] }));
        let (y, x) = (tilt.to_radians().cos(), tilt.to_radians().sin());
        let (at, normal) = (DVec3::new(0.0, 1.0, 0.0), DVec3::new(x, y, 0.0));
        receiver(&mut gltf, at, normal);
        let scene = load(&save(gltf, &folder, "sun"));
        let world = world(&scene);
        // So narrow that the receiver fills the picture.
        let camera = camera(&scene, (at + normal * 0.05).to_array(), at.to_array(), 5.0);
        let expected = albedo.map(|rho| rho * 10.0 * 30f64.to_radians().cos() * (1.0 - y) / 2.0);
        let reference = small(&world, &camera, &settings(256, Strategy::Mis));
        // The receiver's own shadow and the end of the plane are each some 1e-4 of the hemisphere below; half a
        // kilometre away ends the plane 2e-3 rad below the horizon.
        Check::indirect(&reference).floor(1e-3).against_constant(expected, &format!("sun, {tilt}°"));
    }
}

/// Irradiance from a polygon of radiance 1 that lies wholly above the horizon, by Lambert's formula (Photometria, 1760):
/// half the sum over the edges of the angle under which they are seen × the cosine between their plane's normal and the
/// receiver's.
fn lambert_polygon(point: DVec3, normal: DVec3, corners: &[DVec3]) -> f64 {
    let edge = |i: usize| {
        let (a, b) = ((corners[i] - point).normalize(), (corners[(i + 1) % corners.len()] - point).normalize());
        a.cross(b).normalize().dot(normal) * a.dot(b).clamp(-1.0, 1.0).acos()
    };
    0.5 * (0..corners.len()).map(edge).sum::<f64>().abs()
}

#[test]
fn area_lights_by_lamberts_formula() {
    let folder = Folder::new();
    let radiance = [20.0, 12.0, 4.0];
    // Half a metre square, facing down.
    let (corner, u, v) = (DVec3::new(-0.25, 2.0, -0.25), DVec3::X * 0.5, DVec3::Z * 0.5);
    let corners = [corner, corner + u, corner + u + v, corner + v];
    for (at, normal) in [
        (DVec3::new(0.0, 0.0, 0.0), DVec3::Y),
        (DVec3::new(1.5, 0.0, -0.5), DVec3::Y),
        (DVec3::new(1.0, 1.0, 0.3), DVec3::new(-1.0, 0.5, 0.2).normalize()),
        (DVec3::new(0.1, 1.9, 0.0), DVec3::new(0.1, 1.0, -0.1).normalize()),
    ] {
        let mut gltf = Gltf::new();
        let f32s = |p: DVec3| p.as_vec3().to_array();
        add(&mut gltf, &quad(f32s(corner), f32s(u), f32s(v), 1), diffuse([0.0; 3], radiance));
        receiver(&mut gltf, at, normal);
        let scene = load(&save(gltf, &folder, "lamp"));
        let world = world(&scene);
        let camera = camera(&scene, (at + normal * 0.05).to_array(), at.to_array(), 5.0);
        let expected: Vec<DVec3> = points(&world, &camera)
            .iter()
            .map(|(_, place)| DVec3::from(radiance) * lambert_polygon(*place, normal, &corners))
            .collect();
        for strategy in STRATEGIES {
            let reference = small(&world, &camera, &settings(1024, strategy));
            // Normals of corners rounded to f32: 1e-7 of a centimetre.
            Check::indirect(&reference).floor(5e-5).against(&expected, &format!("lamp at {at}, {strategy:?}"));
        }
    }
}

#[test]
fn strategies_agree_where_there_is_no_formula() {
    // Two emitters, one of them double-sided and small, a point light and walls: the differences between strategies must
    // lie within three standard errors of the differences. Three comparisons of three channels.
    let folder = Folder::new();
    let mut gltf = Gltf::new();
    add(&mut gltf, &crate::shapes::room(1), diffuse([0.7, 0.5, 0.3], [0.0; 3]));
    add(&mut gltf, &quad([-0.3, 0.9, -0.3], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6], 1), diffuse([0.5; 3], [3.0, 2.0, 1.0]));
    let mut both = diffuse([0.2; 3], [0.0, 8.0, 16.0]);
    both["doubleSided"] = json!(true);
    add(&mut gltf, &quad([0.5, -0.5, 0.2], [0.0, 0.3, 0.0], [0.1, 0.0, 0.2], 1), both);
    add_light(&mut gltf, json!({ "type": "point", "intensity": 0.5 }), json!({ "translation": [-0.7, -0.6, 0.5] }));
    let scene = load(&save(gltf, &folder, "emitters"));
    let world = world(&scene);
    let camera = camera(&scene, [0.0, 0.0, 0.95], [0.1, -0.3, -1.0], 90.0);
    let all = STRATEGIES.map(|strategy| small(&world, &camera, &settings(2048, strategy)));
    for (i, j) in [(0, 1), (0, 2), (1, 2)] {
        let variance: Vec<Vec3> = all[i]
            .irradiance_indirect_variance()
            .unwrap()
            .iter()
            .zip(all[j].irradiance_indirect_variance().unwrap())
            .map(|(a, b)| *a + *b)
            .collect();
        let expected: Vec<DVec3> = all[j].irradiance_indirect().iter().map(|e| e.as_dvec3()).collect();
        let check = Check { found: all[i].irradiance_indirect(), variance: &variance, floor: super::ROUNDING };
        check.against(&expected, &format!("{:?} and {:?}", STRATEGIES[i], STRATEGIES[j]));
    }
}

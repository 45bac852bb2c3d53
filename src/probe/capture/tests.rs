//! Captures by different rays of the same surroundings.

use std::f32::consts::PI;

use glam::{Vec3, Vec3A};

use super::surfel::PackedNormal;
use super::*;
use crate::math::octahedral::texel_direction;
use crate::probe::store::kernel::{Directions, Kernel};
use crate::scene::{self, LoadOptions, Scene};

fn scene(name: &str) -> Scene {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.glb"));
    scene::load(&path, &LoadOptions::default()).unwrap()
}

fn settings(rays: Rays) -> CaptureSettings {
    CaptureSettings { rays, emission: EmissionTransport::Gathered, ..Default::default() }
}

fn capture<'a>(
    world: &'a World<'a>,
    settings: &'a CaptureSettings,
    resampling: Option<&'a Resampling>,
) -> Capture<'a, 'a> {
    let hit_light = HitLight::Direct;
    Capture {
        world,
        settings,
        distance_clamp_m: Some(10.0),
        hit_light,
        expected: None,
        voxels: None,
        keeps_geometric: true,
        sees: true,
        shows: true,
        resampling,
        guide: None,
        counts: None,
        purpose: Purpose::Capture,
        seed: 1,
    }
}

fn octahedral(resolution: usize, per_texel: usize) -> Rays {
    Rays::Octahedral(OctahedralRays { resolution, per_texel, guided: 0.0, centred: false })
}

/// What a capture's texels hold of light and of albedo.
fn light_and_albedo(captured: &ProbeCapture) -> (Vec<Vec3A>, Vec<Vec3A>) {
    let mut albedo = vec![Vec3A::ZERO; captured.texels];
    captured.surfels.iter().for_each(|s| albedo[s.texel as usize] += Vec3A::from(s.albedo()));
    (captured.emitted_radiance(), albedo)
}

const N: usize = 32;

/// What is seen near the middle of a scene by an octahedral map of [`N`]² texels, and by a cube resampled to one. The lobe of
/// 1/√128 = 0.09 rad is to the map's texels as that of the presets is.
fn map_and_cube(name: &str) -> [ProbeCapture; 2] {
    let scene = scene(name);
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let (low, high) = scene.mesh.bounds().unwrap();
    let position = low + (high - low) * Vec3::new(0.45, 0.6, 0.55);
    let fine = settings(octahedral(N, 64));
    let map = capture(&world, &fine, None).probe(0, position, |_| true);
    let rays = Rays::Cube(CubeRays { face: 128, resolution: Some(N), sharpness: 128.0 });
    let (resampling, coarse) = (rays.resampling().unwrap(), settings(rays.clone()));
    let cube = capture(&world, &coarse, Some(&resampling)).probe(0, position, |_| true);
    assert_eq!((cube.texels, cube.rays.primary), (N * N, rays.count() as u64));
    [map, cube]
}

fn coarse_axes() -> Vec<Vec3> {
    (0..16).map(|o| texel_direction(o % 4, o / 4, 4)).collect()
}

/// The cube's map is the octahedral one, blurred: under a cosine the light is the same.
#[test]
fn cubes_and_octahedral_maps_see_the_same_light() {
    let found = map_and_cube("cornell");
    let cosine = Kernel::cosine(&Directions::octahedral(N), &coarse_axes());
    let filtered = |texels: &[Vec3A]| {
        let mut out = vec![Vec3A::ZERO; cosine.rows()];
        cosine.irradiance(texels, &mut out);
        out
    };
    let [a, b] = found.each_ref().map(light_and_albedo);
    for (what, a, b) in [("emission", &a.0, &b.0), ("albedo", &a.1, &b.1)] {
        let largest = filtered(a).into_iter().fold(Vec3A::ZERO, Vec3A::max).max_element();
        for (a, b) in filtered(a).into_iter().zip(filtered(b)) {
            // The lamp is in the middle of a face. Of its light 6/k are lost there, see [`super::cube`], and 1/k to a cosine
            // by the blur: 5.5 % at k = 128. Its edges in texels of the map, whose places are off by a fifth of 0.1 rad, add
            // 2 %.
            assert!((a - b).abs().max_element() < 0.075 * largest, "{what}: {a} {b}");
        }
    }
}

/// What emitter samples take over of a lamp's light is not missing where someone looks at the probe: its texels show the lamp as
/// bright as it is, whether it is sampled or not.
#[test]
fn lamps_are_shown_in_full() {
    let scene = scene("cornell");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let (low, high) = scene.mesh.bounds().unwrap();
    let of_samples = |probe_emitter_samples| {
        let settings = CaptureSettings { rays: octahedral(N, 1), probe_emitter_samples, ..Default::default() };
        capture(&world, &settings, None).probe(0, 0.5 * (low + high), |_| true)
    };
    let brightest = |texels: Vec<Vec3A>| texels.into_iter().fold(Vec3A::ZERO, Vec3A::max).max_element();
    let (plain, sampled) = (of_samples(0), of_samples(64));
    assert!(plain.shown.is_empty() && !sampled.emitter_samples.is_empty());
    assert_eq!(plain.shown_radiance(), plain.emitted_radiance());
    let lamp = brightest(plain.emitted_radiance());
    assert_eq!(brightest(sampled.shown_radiance()), lamp);
    // A probe's 64 samples are several times as dense in a lamp's directions as rays to 32² texels are.
    assert!(brightest(sampled.emitted_radiance()) < 0.5 * lamp);
}

/// In a room of flat walls distances are the same under the lobe of the moments, and where a texel's lobe lies on one wall.
#[test]
fn cubes_and_octahedral_maps_see_the_same_walls() {
    let [map, cube] = map_and_cube("furnace");
    let lobe = Kernel::lobe(&Directions::octahedral(N), &coarse_axes(), 50.0);
    for (a, b) in lobe.distance(&map.distances).iter().zip(lobe.distance(&cube.distances)) {
        // Blur makes a wall that is seen under the angle θ farther by 1/k·(1 + tan²θ) of its distance, 2.3 % at 55°, and
        // a corner nearer by as much.
        assert!((a.mean() / b.mean() - 1.0).abs() < 0.03, "{} {}", a.mean(), b.mean());
    }
    let mut flat = 0;
    for o in 0..N * N {
        let (Some((na, da)), Some((nb, db))) = (map.surface_in(o), cube.surface_in(o)) else { continue };
        let variance = cube.distances[o].variance();
        // The mean of two walls' normals is along no axis.
        let on_one_wall = na.abs().max_element() > 0.9999 && nb.abs().max_element() > 0.9999;
        if on_one_wall && variance < 0.01 * f64::from(da * da) {
            flat += 1;
            // As above; the lobe's deviation of a tenth keeps θ below 50°.
            assert!((da / db - 1.0).abs() < 0.04, "texel {o}: {da} {db}");
        }
    }
    assert!(flat > N * N / 4, "{flat} flat texels");
}

/// The texels of a cube that is not resampled are kept with their solid angles: a filter makes of them what it makes of a fine
/// octahedral map, and of one radiance exactly π times it.
#[test]
fn cubes_are_kept_as_they_are() {
    let scene = scene("cornell");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let (low, high) = scene.mesh.bounds().unwrap();
    let position = low + (high - low) * Vec3::new(0.45, 0.6, 0.55);
    let fine = settings(octahedral(64, 16));
    let rays = Rays::Cube(CubeRays { face: 256, resolution: None, ..Default::default() });
    assert!(rays.resampling().is_none() && rays.side().is_none());
    assert_eq!((rays.texels(), rays.kept()), (rays.count(), 6 * 256 * 256));
    let plain = settings(rays.clone());
    let map = capture(&world, &fine, None).probe(0, position, |_| true);
    let cube = capture(&world, &plain, None).probe(0, position, |_| true);
    assert_eq!((cube.texels, cube.geometric.len()), (rays.count(), cube.surfels.len()));
    let filtered = |rays: &Rays, radiance: &[Vec3A]| {
        let mut out = vec![Vec3A::ZERO; 9];
        Kernel::harmonics(&rays.directions()).irradiance(radiance, &mut out);
        out
    };
    let even = filtered(&rays, &vec![Vec3A::ONE; cube.texels]);
    // Rounding of sums of 400,000 f32, in four lanes.
    assert!((even[0].x / PI - 1.0).abs() < 1e-4 && even[1..].iter().all(|e| e.x.abs() < 1e-4), "{even:?}");
    let albedo = |captured: &ProbeCapture| {
        let mut albedo = vec![Vec3A::ZERO; captured.texels];
        captured.surfels.iter().for_each(|s| albedo[s.texel as usize] += Vec3A::from(s.albedo()));
        albedo
    };
    for (what, a, b) in
        [("emission", map.emitted_radiance(), cube.emitted_radiance()), ("albedo", albedo(&map), albedo(&cube))]
    {
        let (a, b) = (filtered(&fine.rays, &a), filtered(&rays, &b));
        let largest = a.iter().copied().fold(Vec3A::ZERO, Vec3A::max).max_element();
        for (a, b) in a.iter().zip(&b) {
            // Edges of the lamp run along rows of the cube, which are in or out as a whole: it has about sixty each way.
            assert!((*a - *b).abs().max_element() < 0.03 * largest, "{what}: {a} {b}");
        }
    }
}

/// Surfels of a resampled cube stand on surfaces.
#[test]
fn resampled_hits_lie_on_surfaces() {
    let scene = scene("cornell");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let (low, high) = scene.mesh.bounds().unwrap();
    let position = 0.5 * (low + high);
    let rays = Rays::Cube(CubeRays { face: 32, resolution: Some(16), sharpness: 64.0 });
    let (resampling, settings) = (rays.resampling().unwrap(), settings(rays));
    let found = capture(&world, &settings, Some(&resampling)).probe(0, position, |_| true);
    assert!(found.surfels.len() > 200);
    assert_eq!(found.geometric.len(), found.surfels.len());
    for (surfel, geometric) in found.surfels.iter().zip(&found.geometric) {
        let hit = world.surface(Ray::new(position, (surfel.position - position).normalize(), 0)).unwrap();
        // Rounding of a ray of some metres.
        assert!((hit.hit.t - surfel.position.distance(position)).abs() < 1e-4, "{}", surfel.position);
        assert_eq!(*geometric, PackedNormal::of(hit.geometric_normal));
    }
}

/// From outside of a closed box whose fronts look inwards, every hit is a back.
#[test]
fn backs_are_left_out_and_count_as_nearer() {
    let scene = scene("furnace");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let (low, high) = scene.mesh.bounds().unwrap();
    let outside = Vec3::new(high.x + 0.5, 0.5 * (low.y + high.y), 0.0);
    let rays = Rays::Fibonacci(FibonacciRays { count: 128 });
    let plain = settings(rays);
    let mut strict = plain.clone();
    strict.backs = Backs { radiance: BackRadiance::LeaveOut { most: 0.1 }, distance_factor: 0.2 };
    let reflecting = capture(&world, &plain, None).probe(0, outside, |_| true);
    let left_out = capture(&world, &strict, None).probe(0, outside, |_| true);
    assert!(reflecting.backs.is_empty() && !reflecting.surfels.is_empty());
    let hits: Vec<u32> = reflecting.surfels.iter().map(|s| s.texel).collect();
    assert_eq!(left_out.backs, hits);
    assert!(left_out.surfels.is_empty() && left_out.emitted.is_empty());
    for t in 0..128 {
        let (a, b) = (reflecting.distances[t].mean(), left_out.distances[t].mean());
        let expected = if hits.contains(&(t as u32)) { 0.2 * a } else { a };
        assert!((b - expected).abs() < 1e-6, "ray {t}: {b} instead of {expected}");
    }
    // A tenth of 128 rays: 12 are fewer, 13 are not.
    assert!(strict.backs.allow(12, 128) && !strict.backs.allow(13, 128) && plain.backs.allow(128, 128));
    let inside = capture(&world, &strict, None).probe(0, 0.5 * (low + high), |_| true);
    assert!(inside.backs.is_empty() && inside.surfels.len() == 128);
}

#[test]
fn frames_turn_all_rays_alike_and_depend_on_nothing_else() {
    let scene = scene("furnace");
    let world = World::new(&scene, 1.0, 0.999).unwrap();
    let position = 0.5 * scene.mesh.bounds().map(|(low, high)| low + high).unwrap();
    let rays = Rays::Fibonacci(FibonacciRays { count: 64 });
    let settings = settings(rays.clone());
    let capture = capture(&world, &settings, None);
    let (one, again) = (capture.frame(0, position, |_| true, 3), capture.frame(0, position, |_| true, 3));
    let other = capture.frame(0, position, |_| true, 4);
    let points = |c: &ProbeCapture| c.surfels.iter().map(|s| s.position).collect::<Vec<_>>();
    assert_eq!(points(&one), points(&again));
    assert_ne!(points(&one), points(&other));
    let rotation = frame_rotation(1, 3);
    for (surfel, (direction, _)) in one.surfels.iter().zip(rays.directions().texel_means()) {
        let expected = rotation * direction;
        assert!((surfel.position - position).normalize().distance(expected) < 1e-5);
    }
    // A uniform rotation takes an axis to a uniform direction: its mean is 0 with a standard deviation of 1/√(3·4096) =
    // 0.009 in each component; five of them.
    let mean = (0..4096).map(|f| frame_rotation(7, f) * Vec3::X).sum::<Vec3>() / 4096.0;
    assert!(mean.abs().max_element() < 0.045, "{mean}");
}

#[test]
fn lone_rays_stand_for_equal_parts_of_the_sphere() {
    let rays = Rays::Fibonacci(FibonacciRays { count: 256 });
    assert_eq!((rays.without(32).count(), octahedral(8, 1).without(32).count()), (224, 64));
    let kernel = Kernel::cosine(&rays.directions(), &[Vec3::X, Vec3::new(0.6, 0.0, 0.8)]);
    let radiance: Vec<Vec3A> = rays.directions().texel_means().iter().map(|(d, _)| Vec3A::splat(1.0 + d.x)).collect();
    let mut e = [Vec3A::ZERO; 2];
    kernel.irradiance(&radiance, &mut e);
    // π·(1 + 2/3·n·x), by 256 even points.
    for (e, cosine) in e.iter().zip([1.0, 0.6]) {
        assert!((e.x / (PI * (1.0 + 2.0 / 3.0 * cosine)) - 1.0).abs() < 0.01, "{e}");
    }
    // Rays that are left out count neither as light nor as darkness.
    let out: Vec<u32> = (0..256).step_by(3).collect();
    let left = kernel.irradiance_without(&vec![Vec3A::ONE; 256], &out).unwrap();
    assert!(left.iter().all(|e| (e.x / PI - 1.0).abs() < 1e-5), "{left:?}");
    assert!(kernel.irradiance_without(&radiance, &(0..256).collect::<Vec<_>>()).is_none());
}

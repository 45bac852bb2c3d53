//! Emitters built in code: who is chosen how often, densities, and irradiance with a closed form.
//!
//! What is drawn at random is held to five standard errors: once in two million checks if all is right.

use glam::Mat3;

use super::made::*;
use super::*;
use crate::light::World;
use crate::light::sampled::RayCount;
use crate::math::random::Random;
use crate::scene::environment::EnvironmentMap;
use crate::scene::{AlphaMode, Environment, Texels, Texture, TextureIndex, TextureRef, TriangleIndex, Wrap};
use crate::trace::Ray;

const DRAWS: u32 = 100_000;

#[test]
fn reciprocal_densities_sum_to_solid_angles() {
    // Where directions are drawn with density p, the mean of 1/p over those within a set is the set's solid angle: p is
    // the density that it claims to be, and integrates to 1 over all that is drawn.
    for environment in [Environment::None, sky()] {
        let scene = scene(&[CEILING, SCREEN, TURNED], environment);
        let emitters = Emitters::new(&scene, 1.0);
        let mut random = random(2);
        let [mut ceiling, mut screen, mut turned, mut sky] = [Mean::default(); 4];
        for _ in 0..DRAWS {
            let sample = emitters.sample(&scene, &even(&emitters), &ORIGIN, bits(&mut random));
            let of =
                |is: &dyn Fn(&LightSample) -> bool| sample.as_ref().filter(|s| is(s)).map_or(0.0, |s| 1.0 / s.density);
            let radiance = |lamp: Lamp| Vec3::from_array(lamp.radiance);
            ceiling.add(of(&|s| matches!(s.origin, Origin::Surface(_)) && s.radiance == radiance(CEILING)));
            screen.add(of(&|s| matches!(s.origin, Origin::Surface(_)) && s.radiance == radiance(SCREEN)));
            turned.add(of(&|s| matches!(s.origin, Origin::Surface(_)) && s.radiance == radiance(TURNED)));
            sky.add(of(&|s| matches!(s.origin, Origin::Sky)));
            assert!(sample.is_none_or(|s| s.direction.is_normalized()));
        }
        ceiling.assert_is(solid_angle(&CEILING), ROUNDING, "ceiling");
        screen.assert_is(solid_angle(&SCREEN), ROUNDING, "screen");
        turned.assert_is(0.0, ROUNDING, "what is turned away");
        sky.assert_is(if emitters.has_sky() { 4.0 * std::f64::consts::PI } else { 0.0 }, ROUNDING, "sky");
    }
}

#[test]
fn both_techniques_state_the_same_density() {
    for environment in [Environment::None, sky()] {
        let scene = scene(&[CEILING, SCREEN, TURNED], environment);
        let world = World::new(&scene, 1.0, 0.999).expect("Embree");
        let emitters = &world.emitters;
        let shares = even(emitters);
        let mut random = random(3);
        for _ in 0..2_000 {
            let Some(sample) = emitters.sample(&scene, &shares, &ORIGIN, bits(&mut random)) else { continue };
            let density = match sample.origin {
                Origin::Punctual { .. } => unreachable!("the scene has no punctual light"),
                Origin::Sky => emitters.sky_along(&scene, &shares, sample.direction).1,
                Origin::Surface(target) => {
                    let hit = world.tracer.closest(Ray::new(Vec3::ZERO, sample.direction, 0)).expect("the lamp itself");
                    // The shadow segment ends just short of the lamp.
                    assert!(target.length() < hit.t && target.length() > 0.999 * hit.t, "{target} for {}", hit.t);
                    emitters.density_of_hit(&shares, &ORIGIN, sample.direction, &hit)
                }
            };
            // Found by a ray, the place on the triangle is off by some roundings.
            assert!((density / sample.density - 1.0).abs() < 1e-4, "{density} and {}", sample.density);
        }
        // What does not emit is never drawn.
        let dark = Hit { t: 1.0, triangle: TriangleIndex(7), barycentric: Vec2::ZERO };
        assert_eq!(emitters.density_of_hit(&shares, &ORIGIN, Vec3::X, &dark), 0.0);
    }
}

/// 16 × 8 texels with powers that differ, some black: blocks of two by two.
fn map() -> EnvironmentMap {
    let grey = [1.0, 0.0, 3.0, 0.5, 2.0, 9.0, 0.25, 0.0, 1.0, 4.0];
    let texels = (0..128).map(|i| Vec3::splat(grey[i % 10])).collect();
    EnvironmentMap { width: 16, height: 8, texels }
}

#[test]
fn texels_of_the_sky_are_drawn_by_power() {
    for lamps in [&[][..], &[TURNED][..]] {
        let scene = scene(lamps, Environment::Map(map()));
        let emitters = Emitters::new(&scene, 1.0);
        let shares = even(&emitters);
        assert_eq!(emitters.groups(), 32 + lamps.len());
        let edge = |row: usize| (row as f64 / 8.0 * std::f64::consts::PI).cos();
        let solid_angle = |texel: usize| (edge(texel / 16) - edge(texel / 16 + 1)) * std::f64::consts::TAU / 16.0;
        let block = |texel: usize| texel / 32 * 8 + texel % 16 / 2;
        let power = |texel: usize| f64::from(map().texels[texel].x) * solid_angle(texel);
        let of_block = |b: usize| (0..128).filter(|&t| block(t) == b).map(power).sum::<f64>();
        let mut random = random(4);
        let (mut drawn, mut solid_angles) = ([Mean::default(); 128], [Mean::default(); 128]);
        for _ in 0..DRAWS {
            let sample = emitters
                .sample(&scene, &shares, &ORIGIN, bits(&mut random))
                .filter(|s| matches!(s.origin, Origin::Sky));
            let found = sample.map(|sample| {
                let texel = map().texel_index(sample.direction);
                assert_eq!(sample.radiance, map().texels[texel]);
                let (radiance, density) = emitters.sky_along(&scene, &shares, sample.direction);
                assert_eq!((radiance, density), (sample.radiance, sample.density));
                (texel, sample)
            });
            for texel in 0..128 {
                let here = found.filter(|(t, _)| *t == texel);
                drawn[texel].add(f32::from(here.is_some()));
                solid_angles[texel].add(here.map_or(0.0, |(_, sample)| 1.0 / sample.density));
            }
        }
        let mut sum = 0.0;
        for texel in 0..128 {
            let within = power(texel) / of_block(block(texel));
            let expected = within / emitters.groups() as f64;
            drawn[texel].assert_is(expected, ROUNDING, &format!("share of texel {texel}"));
            let expected = if within > 0.0 { solid_angle(texel) } else { 0.0 };
            solid_angles[texel].assert_is(expected, ROUNDING, &format!("solid angle of texel {texel}"));
            let centre = Vec2::new((texel % 16) as f32 + 0.5, 2.0 * ((texel / 16) as f32 + 0.5)) / 16.0;
            let density = emitters.sky_along(&scene, &shares, EnvironmentMap::direction(centre)).1;
            sum += f64::from(density) * solid_angle(texel);
        }
        // The densities of all texels integrate to the sky's share.
        assert!((sum - 32.0 / emitters.groups() as f64).abs() < ROUNDING, "{sum}");
    }
}

/// Mean irradiance at the origin from samples towards emitters alone, green channel.
fn sampled_irradiance(scene: &Scene, normal: Vec3, geometric_normal: Vec3) -> Mean {
    let emitters = Emitters::new(scene, 1.0);
    let shares = even(&emitters);
    let receiver = Receiver { position: Vec3::ZERO, normal, geometric_normal };
    let mut random = random(5);
    let mut mean = Mean::default();
    for _ in 0..DRAWS {
        let sample = emitters.sample(scene, &shares, &receiver, bits(&mut random));
        mean.add(sample.map_or(0.0, |s| s.radiance.y * receiver.cosine(s.direction) / s.density));
    }
    mean
}

#[test]
fn irradiance_of_lamps_is_lamberts() {
    let up = Vec3::Y;
    let of_ceiling = form_factor(&CEILING, up);
    sampled_irradiance(&scene(&[CEILING], Environment::None), up, up).assert_is(of_ceiling, ROUNDING, "ceiling");
    // Two that emit differently, one that is turned away.
    let of_both = of_ceiling + 0.5 * form_factor(&SCREEN, up);
    let several = scene(&[CEILING, SCREEN, TURNED], Environment::None);
    sampled_irradiance(&several, up, up).assert_is(of_both, ROUNDING, "ceiling and screen");
    // With a sky that nothing hides: samples towards it stand for all of it, π times its radiance.
    let with_sky = of_both + 0.2 * std::f64::consts::PI;
    sampled_irradiance(&scene(&[CEILING, SCREEN, TURNED], sky()), up, up).assert_is(with_sky, ROUNDING, "with a sky");
    // A lamp of 2 cm in 2 m is a point: L·A·cosine·cosine/d² with A = 2e-4, both cosines 1.
    let small =
        Lamp { corners: [[-0.01, 2.0, -0.01], [0.01, 2.0, -0.01], [-0.01, 2.0, 0.01]], radiance: [50.0; 3], ..CEILING };
    let as_point = 50.0 * 2e-4 / 4.0;
    // Points of it lie up to r = 1.4 cm off the axis: 1 − 2r²/d² is 1 within 10⁻⁴.
    sampled_irradiance(&scene(&[small], Environment::None), up, up).assert_is(as_point, 1e-4, "small lamp");
}

#[test]
fn nothing_arrives_from_below_either_normal() {
    let screen = scene(&[SCREEN], Environment::None);
    sampled_irradiance(&screen, Vec3::X, Vec3::Y).assert_is(0.0, ROUNDING, "screen below the shading normal");
    sampled_irradiance(&screen, Vec3::Y, Vec3::X).assert_is(0.0, ROUNDING, "screen below the geometric normal");
    // Of the sky a quarter sphere: half of π.
    let sky = scene(&[], sky());
    sampled_irradiance(&sky, Vec3::X, Vec3::Y).assert_is(
        0.2 * std::f64::consts::FRAC_PI_2,
        ROUNDING,
        "a quarter of the sky",
    );
}

#[test]
fn any_division_between_the_techniques_gives_the_same_irradiance() {
    let up = Vec3::Y;
    let (ceiling, screen) = (form_factor(&CEILING, up), form_factor(&SCREEN, up));
    for environment in [Environment::None, sky()] {
        let of_sky = environment.radiance(up).y;
        let scene = scene(&[CEILING, SCREEN, TURNED], environment);
        let world = World::new(&scene, 1.0, 0.999).expect("Embree");
        let receiver = Receiver { normal: up, geometric_normal: up, ..ORIGIN };
        let shares = even(&world.emitters);
        // Lamps hide the sky behind them, and the one that is turned away does so with its dark back.
        let hidden = ceiling + screen + form_factor(&TURNED, up);
        let expected = ceiling + 0.5 * screen + f64::from(of_sky) * (std::f64::consts::PI - hidden);
        for (cosine, light) in [(4, 0), (3, 1), (1, 3), (0, 4)] {
            let mut random = random(6);
            let mut mean = Mean::default();
            for _ in 0..DRAWS / 4 {
                let mut rays = RayCount::default();
                mean.add(world.irradiance_by(&receiver, &shares, [cosine, light], &mut random, &mut rays).y);
            }
            mean.assert_is(expected, ROUNDING, &format!("{cosine} cosine rays, {light} light samples"));
        }
    }
}

#[test]
fn textured_lamps_emit_what_the_texture_says() {
    // The texture's left half is black, so only u > 1/2 emits: the triangle of half the size at the second corner.
    let mut scene = scene(&[CEILING], Environment::None);
    let data = vec![[0, 0, 0, 255], [255, 255, 255, 255]];
    scene.textures.push(Texture {
        width: 2,
        height: 1,
        wrap: [Wrap::ClampToEdge; 2],
        nearest: true,
        texels: Texels::Rgba8 { data, srgb: false },
    });
    scene.materials[0].emission_texture =
        Some(TextureRef { texture: TextureIndex(0), uv_set: 0, texture_from_uv: Mat3::IDENTITY });
    let [a, b, c] = CEILING.corners.map(Vec3::from_array);
    let bright = Lamp { corners: [(a + b) / 2.0, b, (b + c) / 2.0].map(|p| p.to_array()), ..CEILING };
    sampled_irradiance(&scene, Vec3::Y, Vec3::Y).assert_is(form_factor(&bright, Vec3::Y), ROUNDING, "half a lamp");
}

#[test]
fn what_lies_behind_is_known() {
    let only_lamps = scene(&[CEILING, SCREEN], Environment::None);
    let emitters = Emitters::new(&only_lamps, 1.0);
    assert!(!emitters.all_behind(Vec3::ZERO, Vec3::Y));
    assert!(emitters.all_behind(Vec3::ZERO, Vec3::NEG_Y));
    assert!(emitters.all_behind(Vec3::new(0.0, 2.6, 0.0), Vec3::Y));
    assert!(!emitters.all_behind(Vec3::new(0.0, 2.4, 0.0), Vec3::Y), "the screen reaches to 2.5");
    // From above, the ceiling's back is dark; the screen is seen from either side.
    let mut random = random(7);
    let draw = |from: Vec3, random: &mut Random| {
        (0..1000)
            .filter_map(|_| emitters.sample(&only_lamps, &even(&emitters), &Receiver::in_space(from), bits(random)))
            .map(|s| s.radiance.x)
            .collect::<Vec<_>>()
    };
    assert!(draw(Vec3::new(-1.0, 3.0, 0.0), &mut random).iter().all(|x| *x == 0.0), "the back of the ceiling");
    assert!(!draw(Vec3::new(-3.0, 3.0, 0.0), &mut random).is_empty(), "the other side of the screen");
    // No lamps: all is behind unless there is a sky.
    let empty = scene(&[DARK], Environment::None);
    let emitters = Emitters::new(&empty, 1.0);
    assert!(emitters.is_empty() && emitters.all_behind(Vec3::ZERO, Vec3::Y));
    let open = scene(&[DARK], sky());
    let emitters = Emitters::new(&open, 1.0);
    assert!(emitters.is_uniform_sky() && !emitters.all_behind(Vec3::ZERO, Vec3::NEG_Y));
    assert!(Emitters::new(&scene(&[DARK], Environment::Constant(Vec3::ZERO)), 1.0).is_empty(), "a black sky is none");
}

/// A lamp of 64 × 64 texels of which one is lit is as good as a lamp of that texel's shape.
#[test]
fn one_bright_texel_is_a_small_lamp() {
    for alpha in [false, true] {
        let mut scene = scene(&[CEILING], Environment::None);
        let black = if alpha { [255, 255, 255, 0] } else { [0, 0, 0, 255] };
        let mut data = vec![black; 64 * 64];
        data[20 * 64 + 10] = [255; 4];
        let texels = Texels::Rgba8 { data, srgb: false };
        scene.textures.push(Texture { width: 64, height: 64, wrap: [Wrap::Repeat; 2], nearest: true, texels });
        let reference = TextureRef { texture: TextureIndex(0), uv_set: 0, texture_from_uv: Mat3::IDENTITY };
        if alpha {
            scene.materials[0].base_color_texture = Some(reference);
            scene.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        } else {
            scene.materials[0].emission_texture = Some(reference);
        }
        let [a, b, c] = CEILING.corners.map(Vec3::from_array);
        let at = |u: f32, v: f32| (a + ((b - a) * u + (c - a) * v) / 64.0).to_array();
        let halves =
            [[at(10.0, 20.0), at(11.0, 20.0), at(10.0, 21.0)], [at(11.0, 21.0), at(10.0, 21.0), at(11.0, 20.0)]];
        let expected: f64 = halves.map(|corners| form_factor(&Lamp { corners, ..CEILING }, Vec3::Y)).iter().sum();
        let mean = sampled_irradiance(&scene, Vec3::Y, Vec3::Y);
        mean.assert_is(expected, ROUNDING, "the texel");
        // Every piece has the same share here. Those near the texel are as small as it, so some tens of draws meet it once;
        // of draws even over the lamp it would be one of 2048.
        let variance = mean.squares / mean.count / expected.powi(2);
        assert!(variance < 200.0, "second moment {variance} × the square of the mean");
    }
}

/// What places have learnt leaves no emitter out, and divides the samples as it should.
#[test]
fn places_learn_what_they_see() {
    // Between the origin and the screen there is a wall; the ceiling is seen.
    let wall = Lamp { corners: [[-1.0, -9.0, -9.0], [-1.0, -9.0, 9.0], [-1.0, 19.0, 0.0]], ..DARK };
    let scene = scene(&[CEILING, SCREEN, wall], Environment::None);
    let world = World::new(&scene, 1.0, 0.999).expect("Embree");
    let receiver = Receiver { normal: Vec3::Y, geometric_normal: Vec3::Y, ..ORIGIN };
    let (shares, ..) = world.learn(&[receiver], |_| true, &mut random(8));
    let group =
        |t| world.emitters.pieces.at(TriangleIndex(t), Vec2::splat(0.2)).map(|(p, _)| world.emitters.tree.group_of(p));
    let (ceiling, screen) = (group(0).expect("it emits"), group(1).expect("it emits"));
    assert!(shares.lit && shares.of(ceiling) > 0.9, "{}", shares.of(ceiling));
    // Unseen by a few rays is not unseen: a twentieth of the draws is spread over all, and half of that evenly.
    assert!(shares.of(screen) >= 0.0125, "{}", shares.of(screen));
    assert_eq!(group(2), None);
}

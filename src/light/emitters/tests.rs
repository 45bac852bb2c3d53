//! Emitters built in code: who is chosen how often, densities, and irradiance with a closed form.
//!
//! What is drawn at random is held to five standard errors: once in two million checks if all is right.

use glam::{DVec3, Mat3, Vec4};

use super::*;
use crate::light::World;
use crate::light::sampled::{Allocation, RayCount};
use crate::light::surface::SurfacePoint;
use crate::math::random::{Purpose, Random};
use crate::scene::{AlphaMode, Material, MaterialIndex, Mesh, Texels, Texture, TextureIndex, TextureRef, Wrap};
use crate::trace::Ray;

const DRAWS: u32 = 100_000;

/// A triangle that emits.
#[derive(Clone, Copy)]
struct Lamp {
    corners: [[f32; 3]; 3],
    radiance: [f32; 3],
    double_sided: bool,
}

/// 1 m above the origin, faces down. Area 1/2.
const CEILING: Lamp = Lamp {
    corners: [[-0.2, 1.0, -0.3], [0.8, 1.0, -0.3], [-0.2, 1.0, 0.7]],
    radiance: [1.0, 1.0, 1.0],
    double_sided: false,
};

/// Beside the origin at x = −2, both sides emit; the origin sees the back. Area 2.
const SCREEN: Lamp = Lamp {
    corners: [[-2.0, 0.5, -1.0], [-2.0, 0.5, 1.0], [-2.0, 2.5, -1.0]],
    radiance: [0.0, 0.5, 0.0],
    double_sided: true,
};

/// In front of the origin at z = 3, turned away from it. Area 1/2.
const TURNED: Lamp = Lamp {
    corners: [[0.0, 1.0, 3.0], [1.0, 1.0, 3.0], [0.0, 2.0, 3.0]],
    radiance: [2.0, 2.0, 2.0],
    double_sided: false,
};

const DARK: Lamp = Lamp { corners: [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]], radiance: [0.0; 3], ..CEILING };

fn scene(lamps: &[Lamp], environment: Environment) -> Scene {
    let material = |lamp: &Lamp| Material {
        name: String::new(),
        base_color: Vec4::ONE,
        base_color_texture: None,
        metallic: 0.0,
        roughness: 1.0,
        metallic_roughness_texture: None,
        emission: Vec3::from_array(lamp.radiance),
        emission_texture: None,
        normal_texture: None,
        normal_scale: 1.0,
        alpha_mode: AlphaMode::Opaque,
        double_sided: lamp.double_sided,
        unlit: false,
    };
    let vertices = 3 * lamps.len();
    let count = lamps.len() as u32;
    Scene {
        name: String::new(),
        origin_world: DVec3::ZERO,
        mesh: Mesh {
            positions: lamps.iter().flat_map(|lamp| lamp.corners).map(Vec3::from_array).collect(),
            normals: vec![Vec3::ZERO; vertices],
            // The triangle (0, 0), (1, 0), (0, 1) of a texture.
            uvs: [[Vec2::ZERO, Vec2::X, Vec2::Y].repeat(lamps.len()), vec![Vec2::ZERO; vertices]],
            triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            materials: (0..count).map(MaterialIndex).collect(),
            opaque_count: lamps.len(),
            ..Mesh::default()
        },
        materials: lamps.iter().map(material).collect(),
        textures: Vec::new(),
        lights: Vec::new(),
        cameras: Vec::new(),
        environment,
        blake3: String::new(),
        files: Vec::new(),
        warnings: Vec::new(),
        dropped: Default::default(),
    }
}

fn sky() -> Environment {
    Environment::Constant(Vec3::new(0.3, 0.2, 0.1))
}

/// Sums of many draws, and what their mean is off by.
#[derive(Default, Clone, Copy)]
struct Mean {
    sum: f64,
    squares: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f32) {
        self.sum += f64::from(value);
        self.squares += f64::from(value) * f64::from(value);
        self.count += 1.0;
    }

    /// Within five standard errors and `rounding`, relative: f32 sums of a few terms unless said otherwise.
    fn assert_is(&self, expected: f64, rounding: f64, what: &str) {
        let mean = self.sum / self.count;
        let error = ((self.squares / self.count - mean * mean).max(0.0) / self.count).sqrt();
        let off = (mean - expected).abs();
        assert!(off <= 5.0 * error + rounding * expected.abs(), "{what}: {mean} ± {error} instead of {expected}");
    }
}

const ROUNDING: f64 = 1e-5;

fn random(name: u64) -> Random {
    Random::new(1, Purpose::Capture, name, 0)
}

fn bits(random: &mut Random) -> [u32; 4] {
    std::array::from_fn(|_| random.bits())
}

/// Solid angle of a triangle seen from the origin, sr (Van Oosterom & Strackee 1983).
fn solid_angle(lamp: &Lamp) -> f64 {
    let [a, b, c] = lamp.corners.map(|p| Vec3::from_array(p).as_dvec3().normalize());
    2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// Irradiance at the origin per radiance of a triangle all above the horizon (Lambert 1760): half the sum over its edges
/// of angle × cosine between the normal and the edge's plane's normal.
fn form_factor(lamp: &Lamp, normal: Vec3) -> f64 {
    let [a, b, c] = lamp.corners.map(|p| Vec3::from_array(p).as_dvec3());
    let edge = |p: DVec3, q: DVec3| p.angle_between(q) * p.cross(q).normalize().dot(normal.as_dvec3());
    0.5 * (edge(a, b) + edge(b, c) + edge(c, a)).abs()
}

#[test]
fn triangles_are_chosen_by_area_radiance_and_sides() {
    // Luminance of (0, 1/2, 0) is 0.3576: powers 1/2·1, 2·0.3576·2 sides, 1/2·2.
    let powers = [0.5, 0.0, 1.4304, 1.0];
    let total: f64 = powers.iter().sum();
    for environment in [Environment::None, sky()] {
        let scene = scene(&[CEILING, DARK, SCREEN, TURNED], environment);
        let emitters = Emitters::new(&scene);
        assert_eq!(emitters.triangle_count(), 3);
        let of_triangles = if emitters.has_sky() { 0.5 } else { 1.0 };
        let mut random = random(1);
        let mut chosen = [Mean::default(); 4];
        let mut sky = Mean::default();
        for _ in 0..DRAWS {
            let drawn = match emitters.draw(&scene, bits(&mut random)).expect("there are emitters") {
                Drawn::Sky { .. } => None,
                Drawn::Triangle { triangle, .. } => Some(triangle.index.0 as usize),
            };
            (0..4).for_each(|t| chosen[t].add(f32::from(drawn == Some(t))));
            sky.add(f32::from(drawn.is_none()));
        }
        for (t, power) in powers.into_iter().enumerate() {
            chosen[t].assert_is(of_triangles * power / total, ROUNDING, &format!("share of triangle {t}"));
        }
        sky.assert_is(1.0 - of_triangles, ROUNDING, "share of the sky");
        // The density per area that is stated: times the areas 1/2, 2, 1/2 the probabilities.
        for (triangle, area) in emitters.triangles.iter().zip([0.5, 2.0, 0.5]) {
            let stated = f64::from(triangle.density_per_area) * area;
            let expected = powers[triangle.index.0 as usize] / total;
            assert!((stated / expected - 1.0).abs() < ROUNDING, "{stated} instead of {expected}");
        }
    }
}

#[test]
fn reciprocal_densities_sum_to_solid_angles() {
    // Where directions are drawn with density p, the mean of 1/p over those within a set is the set's solid angle: p is
    // the density that it claims to be, and integrates to 1 over all that is drawn.
    for environment in [Environment::None, sky()] {
        let scene = scene(&[CEILING, SCREEN, TURNED], environment);
        let emitters = Emitters::new(&scene);
        let mut random = random(2);
        let [mut ceiling, mut screen, mut turned, mut sky] = [Mean::default(); 4];
        for _ in 0..DRAWS {
            let sample = emitters.sample(&scene, Vec3::ZERO, bits(&mut random));
            let of =
                |is: &dyn Fn(&LightSample) -> bool| sample.as_ref().filter(|s| is(s)).map_or(0.0, |s| 1.0 / s.density);
            let radiance = |lamp: Lamp| Vec3::from_array(lamp.radiance);
            ceiling.add(of(&|s| s.target.is_some() && s.radiance == radiance(CEILING)));
            screen.add(of(&|s| s.target.is_some() && s.radiance == radiance(SCREEN)));
            turned.add(of(&|s| s.target.is_some() && s.radiance == radiance(TURNED)));
            sky.add(of(&|s| s.target.is_none()));
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
        let mut random = random(3);
        for _ in 0..2_000 {
            let Some(sample) = emitters.sample(&scene, Vec3::ZERO, bits(&mut random)) else { continue };
            let density = match sample.target {
                None => emitters.density_of_sky(&scene, sample.direction),
                Some(target) => {
                    let hit = world.tracer.closest(Ray::new(Vec3::ZERO, sample.direction, 0)).expect("the lamp itself");
                    // The shadow segment ends just short of the lamp.
                    assert!(target.length() < hit.t && target.length() > 0.999 * hit.t, "{target} for {}", hit.t);
                    emitters.density_of_hit(Vec3::ZERO, sample.direction, &hit)
                }
            };
            // Found by a ray, the place on the triangle is off by some roundings.
            assert!((density / sample.density - 1.0).abs() < 1e-4, "{density} and {}", sample.density);
        }
        // What does not emit is never drawn.
        let dark = Hit { t: 1.0, triangle: TriangleIndex(7), barycentric: Vec2::ZERO };
        assert_eq!(emitters.density_of_hit(Vec3::ZERO, Vec3::X, &dark), 0.0);
    }
}

/// 4 × 2 texels with powers that differ, one black.
fn map() -> EnvironmentMap {
    let grey = [1.0, 0.0, 3.0, 0.5, 2.0, 9.0, 0.25, 1.0];
    EnvironmentMap { width: 4, height: 2, texels: grey.map(Vec3::splat).to_vec() }
}

#[test]
fn texels_of_the_sky_are_drawn_by_power() {
    // A lamp beside it takes half of the draws, and must not change how the other half is spread.
    for (lamps, share) in [(&[][..], 1.0), (&[TURNED][..], 0.5)] {
        let scene = scene(lamps, Environment::Map(map()));
        let emitters = Emitters::new(&scene);
        // Two rows of four: every texel has an eighth of the sphere, π/2. Radiances sum to 16.75.
        let per_texel = std::f64::consts::PI / 2.0;
        let mut random = random(4);
        let (mut shares, mut solid_angles) = ([Mean::default(); 8], [Mean::default(); 8]);
        let mut height = Mean::default();
        for _ in 0..DRAWS {
            let sample = emitters.sample(&scene, Vec3::ZERO, bits(&mut random));
            let drawn = sample.map(|sample| {
                let texel = map().texel_index(sample.direction);
                assert_eq!((sample.radiance, sample.target), (map().texels[texel], None));
                assert_eq!(sample.density, emitters.density_of_sky(&scene, sample.direction));
                (texel, sample)
            });
            for texel in 0..8 {
                let here = drawn.filter(|(t, _)| *t == texel);
                shares[texel].add(f32::from(here.is_some()));
                solid_angles[texel].add(here.map_or(0.0, |(_, sample)| 1.0 / sample.density));
            }
            if let Some((0..4, sample)) = drawn {
                height.add(sample.direction.y);
            }
        }
        for texel in 0..8 {
            let radiance = f64::from(map().texels[texel].x);
            shares[texel].assert_is(share * radiance / 16.75, ROUNDING, &format!("share of texel {texel}"));
            let solid_angle = if radiance > 0.0 { per_texel } else { 0.0 };
            solid_angles[texel].assert_is(solid_angle, ROUNDING, &format!("solid angle of texel {texel}"));
        }
        // Within a texel uniform in solid angle: the mean of y over the upper half sphere is 1/2.
        height.assert_is(0.5, ROUNDING, "height in the upper row");
        // The densities of all texels integrate to the sky's share.
        let centre = |t| Vec2::new((t % 4) as f32 + 0.5, 2.0 * ((t / 4) as f32 + 0.5)) / 4.0;
        let density = |t| f64::from(emitters.density_of_sky(&scene, EnvironmentMap::direction(centre(t))));
        let sum: f64 = (0..8).map(|t: u32| density(t) * per_texel).sum();
        assert!((sum - share).abs() < ROUNDING, "{sum}");
    }
}

/// Mean irradiance at the origin from samples towards emitters alone, green channel.
fn sampled_irradiance(scene: &Scene, normal: Vec3, geometric_normal: Vec3) -> Mean {
    let emitters = Emitters::new(scene);
    let receiver = Receiver { position: Vec3::ZERO, normal, geometric_normal };
    let mut random = random(5);
    let mut mean = Mean::default();
    for _ in 0..DRAWS {
        let sample = emitters.irradiance_sample(scene, &receiver, [0.0, 1.0], bits(&mut random));
        mean.add(sample.map_or(0.0, |s| s.irradiance.y));
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
        let point = SurfacePoint::in_space(Vec3::ZERO, up);
        // Lamps hide the sky behind them, and the one that is turned away does so with its dark back.
        let hidden = ceiling + screen + form_factor(&TURNED, up);
        let expected = ceiling + 0.5 * screen + f64::from(of_sky) * (std::f64::consts::PI - hidden);
        for (cosine, light) in [(4, 0), (3, 1), (1, 3), (0, 4)] {
            let mut random = random(6);
            let mut mean = Mean::default();
            for _ in 0..DRAWS / 4 {
                let allocation = Allocation { cosine, light };
                let irradiance =
                    world.emitter_irradiance(&point, up, allocation, &mut random, &mut RayCount::default());
                mean.add(irradiance.y);
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
    let emitters = Emitters::new(&only_lamps);
    assert!(!emitters.all_behind(Vec3::ZERO, Vec3::Y));
    assert!(emitters.all_behind(Vec3::ZERO, Vec3::NEG_Y));
    assert!(emitters.all_behind(Vec3::new(0.0, 2.6, 0.0), Vec3::Y));
    assert!(!emitters.all_behind(Vec3::new(0.0, 2.4, 0.0), Vec3::Y), "the screen reaches to 2.5");
    // From above, the ceiling's back is dark; the screen is seen from either side.
    let mut random = random(7);
    let draw = |from: Vec3, random: &mut Random| {
        (0..1000)
            .filter_map(|_| emitters.sample(&only_lamps, from, bits(random)))
            .map(|s| s.radiance.x)
            .collect::<Vec<_>>()
    };
    assert!(draw(Vec3::new(-1.0, 3.0, 0.0), &mut random).iter().all(|x| *x == 0.0), "the back of the ceiling");
    assert!(!draw(Vec3::new(-3.0, 3.0, 0.0), &mut random).is_empty(), "the other side of the screen");
    // No lamps: all is behind unless there is a sky.
    let empty = scene(&[DARK], Environment::None);
    let emitters = Emitters::new(&empty);
    assert!(emitters.is_empty() && emitters.all_behind(Vec3::ZERO, Vec3::Y));
    assert!(emitters.sample(&empty, Vec3::ZERO, [1; 4]).is_none());
    let open = scene(&[DARK], sky());
    let emitters = Emitters::new(&open);
    assert!(emitters.is_uniform_sky() && !emitters.all_behind(Vec3::ZERO, Vec3::NEG_Y));
    assert!(Emitters::new(&scene(&[DARK], Environment::Constant(Vec3::ZERO))).is_empty(), "a black sky is none");
}

//! Lamps and skies built in code, and means of many draws, for the tests.

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::Emitters;
use super::receiver::Receiver;
use super::shares::Shares;
use crate::math::random::{Purpose, Random};
use crate::scene::{AlphaMode, Environment, Material, MaterialIndex, Mesh, Scene};

/// A triangle that emits.
#[derive(Clone, Copy)]
pub struct Lamp {
    pub corners: [[f32; 3]; 3],
    pub radiance: [f32; 3],
    pub double_sided: bool,
}

/// 1 m above the origin, faces down. Area 1/2.
pub const CEILING: Lamp = Lamp {
    corners: [[-0.2, 1.0, -0.3], [0.8, 1.0, -0.3], [-0.2, 1.0, 0.7]],
    radiance: [1.0, 1.0, 1.0],
    double_sided: false,
};

/// Beside the origin at x = −2, both sides emit; the origin sees the back. Area 2.
pub const SCREEN: Lamp = Lamp {
    corners: [[-2.0, 0.5, -1.0], [-2.0, 0.5, 1.0], [-2.0, 2.5, -1.0]],
    radiance: [0.0, 0.5, 0.0],
    double_sided: true,
};

/// In front of the origin at z = 3, turned away from it. Area 1/2.
pub const TURNED: Lamp = Lamp {
    corners: [[0.0, 1.0, 3.0], [1.0, 1.0, 3.0], [0.0, 2.0, 3.0]],
    radiance: [2.0, 2.0, 2.0],
    double_sided: false,
};

pub const DARK: Lamp =
    Lamp { corners: [[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]], radiance: [0.0; 3], ..CEILING };

pub fn scene(lamps: &[Lamp], environment: Environment) -> Scene {
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
        collapsed_bytes: 0,
        lights: Vec::new(),
        cameras: Vec::new(),
        environment,
        unassigned: None,
        blake3: String::new(),
        pictures_blake3: None,
        files: Vec::new(),
        warnings: Vec::new(),
        dropped: Default::default(),
        light_clamped: 0,
    }
}

pub fn sky() -> Environment {
    Environment::Constant(Vec3::new(0.3, 0.2, 0.1))
}

/// Sums of many draws, and what their mean is off by.
#[derive(Default, Clone, Copy)]
pub struct Mean {
    pub sum: f64,
    pub squares: f64,
    pub count: f64,
}

impl Mean {
    pub fn add(&mut self, value: f32) {
        self.sum += f64::from(value);
        self.squares += f64::from(value) * f64::from(value);
        self.count += 1.0;
    }

    /// Within five standard errors and `rounding`, relative: f32 sums of a few terms unless said otherwise.
    pub fn assert_is(&self, expected: f64, rounding: f64, what: &str) {
        let mean = self.sum / self.count;
        let error = ((self.squares / self.count - mean * mean).max(0.0) / self.count).sqrt();
        let off = (mean - expected).abs();
        assert!(off <= 5.0 * error + rounding * expected.abs(), "{what}: {mean} ± {error} instead of {expected}");
    }
}

pub const ROUNDING: f64 = 1e-5;

pub fn random(name: u64) -> Random {
    Random::new(1, Purpose::Capture, name, 0)
}

pub fn bits(random: &mut Random) -> [u32; 4] {
    std::array::from_fn(|_| random.bits())
}

/// Solid angle of a triangle seen from the origin, sr (Van Oosterom & Strackee 1983).
pub fn solid_angle(lamp: &Lamp) -> f64 {
    let [a, b, c] = lamp.corners.map(|p| Vec3::from_array(p).as_dvec3().normalize());
    2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// Irradiance at the origin per radiance of a triangle all above the horizon (Lambert 1760): half the sum over its edges
/// of angle × cosine between the normal and the edge's plane's normal.
pub fn form_factor(lamp: &Lamp, normal: Vec3) -> f64 {
    let [a, b, c] = lamp.corners.map(|p| Vec3::from_array(p).as_dvec3());
    let edge = |p: DVec3, q: DVec3| p.angle_between(q) * p.cross(q).normalize().dot(normal.as_dvec3());
    0.5 * (edge(a, b) + edge(b, c) + edge(c, a)).abs()
}

/// The same share for every group.
pub fn even(emitters: &Emitters) -> Shares {
    Shares::new(&vec![1.0; emitters.groups()])
}

pub const ORIGIN: Receiver = Receiver { position: Vec3::ZERO, normal: Vec3::ZERO, geometric_normal: Vec3::ZERO };

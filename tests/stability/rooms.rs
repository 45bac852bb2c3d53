//! Rooms: closed furnaces, and two rooms with a wall between them.

use serde_json::json;

use crate::common::Gltf;
use crate::shapes::{add, add_light, diffuse, quad, room};

pub type Triangles = Vec<[f32; 3]>;

/// The cube [−1, 1]³ from inside, emitting 1 W·m⁻²·sr⁻¹: irradiance π/(1 − ρ) everywhere.
pub fn furnace(albedo: f64) -> Gltf {
    let mut gltf = Gltf::new();
    add(&mut gltf, &room(1), diffuse([albedo; 3], [1.0; 3]));
    gltf
}

/// Probes within the furnace, as a bake's words: no noise, for every direction emits.
pub const IN_FURNACE: &str = "--set encoding.irradiance=f32 --set capture.resolution=16 --set grid.divisions=(3,3,3) \
                              --set grid.bounds={\"min\":[-0.8,-0.8,-0.8],\"max\":[0.8,0.8,0.8]}";

/// The irradiance in [`furnace`], W·m⁻².
pub fn in_furnace(albedo: f64) -> f64 {
    std::f64::consts::PI / (1.0 - albedo)
}

/// A look at a furnace's wall.
pub const AT_FURNACE: &str = "--look-at=0.1,0.2,0.3,1,0.1,0.2,80";

/// A box from inside.
pub fn inside_of(low: [f32; 3], high: [f32; 3]) -> Triangles {
    stretched(low, high)
}

fn stretched(low: [f32; 3], high: [f32; 3]) -> Triangles {
    // `room` spans ±1: its corners are chosen, not computed, so that boxes that touch share their coordinates.
    room(1).into_iter().map(|p| std::array::from_fn(|k| if p[k] < 0.0 { low[k] } else { high[k] })).collect()
}

/// A box from outside.
pub fn outside_of(low: [f32; 3], high: [f32; 3]) -> Triangles {
    flipped(&stretched(low, high))
}

/// The same triangles, their fronts on the other side.
pub fn flipped(triangles: &[[f32; 3]]) -> Triangles {
    triangles.chunks_exact(3).flat_map(|t| [t[0], t[2], t[1]]).collect()
}

/// What stands between the rooms.
#[derive(Clone, Copy, PartialEq)]
pub enum Wall {
    /// Two rooms with walls of their own, so far apart, metres: nothing can pass.
    Sealed(f32),
    /// One sheet with a front only, towards the lit room.
    Sheet,
    /// A wall so thick with a door of 1 × 2 m.
    Door(f32),
}

#[derive(Clone, Copy)]
pub enum Lamp {
    /// 0.5 × 0.5 m under the ceiling of the lit room, shining down, W·m⁻²·sr⁻¹.
    Area(f64),
    /// In the middle of the lit room, W·sr⁻¹.
    Point(f64),
}

/// Two rooms of 4 × 3 × 4 m side by side along x, their common wall at x = 0, a lamp in the one at −x; cameras `lit`
/// and `dark` look at the wall from both.
#[derive(Clone, Copy)]
pub struct Rooms {
    pub albedo: f64,
    pub wall: Wall,
    pub lamp: Lamp,
    /// Of all lengths.
    pub scale: f64,
    /// Of the root, metres.
    pub shift: f64,
    /// Between probes, before scaling, metres.
    pub spacing_m: f64,
}

/// Between probes of [`Rooms`], metres: no wall of the shell lies on a border of voxels, where rounding, which differs from
/// scale to scale, would decide which of two neighbours answers; the wall at x = 0 lies in the middle between two planes
/// of probes.
pub const SPACING_M: f64 = 0.97;

/// Side of [`Lamp::Area`], metres.
pub const LAMP_M: f64 = 0.5;

/// Longest side of [`Rooms`], metres.
pub const SIZE_M: f64 = 8.0;

impl Rooms {
    pub fn gltf(&self) -> Gltf {
        let mut gltf = Gltf::new();
        let (low, high) = ([-4.0, 0.0, -2.0], [4.0, 3.0, 2.0]);
        let surfaces = match self.wall {
            Wall::Sealed(thickness) => {
                let half = thickness / 2.0;
                [inside_of(low, [-half, 3.0, 2.0]), inside_of([half, 0.0, -2.0], high)].concat()
            }
            Wall::Sheet => {
                let sheet = quad([0.0, 0.0, -2.0], [0.0, 0.0, 4.0], [0.0, 3.0, 0.0], 1);
                [inside_of(low, high), sheet].concat()
            }
            Wall::Door(thickness) => [inside_of(low, high), wall_with_door(thickness)].concat(),
        };
        add(&mut gltf, &surfaces, diffuse([self.albedo; 3], [0.0; 3]));
        match self.lamp {
            Lamp::Area(radiance) => {
                let side = LAMP_M as f32;
                let lamp = quad([-2.25, 2.9, -0.25], [side, 0.0, 0.0], [0.0, 0.0, side], 1);
                add(&mut gltf, &lamp, diffuse([self.albedo; 3], [radiance; 3]));
            }
            Lamp::Point(intensity) => {
                let light = json!({ "type": "point", "intensity": intensity * self.scale * self.scale });
                add_light(&mut gltf, light, json!({ "translation": [-2.0, 2.0, 0.0] }));
            }
        }
        for (name, x, turn) in [("lit", -3.5, -1.0), ("dark", 3.5, 1.0)] {
            let camera = gltf.push(
                "cameras",
                json!({ "name": name, "type": "perspective", "perspective": { "yfov": 1.4, "znear": 0.01 } }),
            );
            // A quarter turn about y, so that it looks along ±x.
            let half = std::f64::consts::FRAC_1_SQRT_2;
            gltf.root(json!({
                "name": name, "camera": camera, "translation": [x, 1.5, 0.3], "rotation": [0.0, turn * half, 0.0, half]
            }));
        }
        let (scale, shift) = (self.scale, self.shift);
        under_root(&mut gltf, json!({ "scale": [scale, scale, scale], "translation": [shift, shift, shift] }));
        gltf
    }

    /// Words of its bake.
    pub fn words(&self) -> String {
        format!(
            "--set encoding.irradiance=f32 --set capture.resolution=16 --set grid.spacing_m={:e}",
            self.spacing_m * self.scale
        )
    }
}

/// Puts all that stands at the root of the scene below one node more.
pub fn under_root(gltf: &mut Gltf, mut node: serde_json::Value) {
    node["children"] = gltf.json["scenes"][0]["nodes"].take();
    gltf.json["scenes"][0]["nodes"] = json!([]);
    gltf.root(node);
}

/// A wall across the rooms at x = 0 with a door of 1 m × 2 m in its middle: faces, jambs and lintel.
fn wall_with_door(thickness: f32) -> Triangles {
    let half = thickness / 2.0;
    // Beside and above the door: z from, z to, y from, y to.
    let parts = [[-2.0, -0.5, 0.0, 3.0], [0.5, 2.0, 0.0, 3.0], [-0.5, 0.5, 2.0, 3.0f32]];
    let face = |x: f32| {
        parts
            .into_iter()
            .flat_map(move |[z0, z1, y0, y1]| quad([x, y0, z0], [0.0, 0.0, z1 - z0], [0.0, y1 - y0, 0.0], 1))
    };
    // z × y is −x: the front of the one towards the lit room.
    let lit: Triangles = face(-half).collect();
    let dark = flipped(&face(half).collect::<Triangles>());
    let jamb = |z: f32| quad([-half, 0.0, z], [thickness, 0.0, 0.0], [0.0, 2.0, 0.0], 1);
    // x × y is +z.
    let jambs = [jamb(-0.5), flipped(&jamb(0.5))].concat();
    // x × z is −y.
    let lintel = quad([-half, 2.0, -0.5], [thickness, 0.0, 0.0], [0.0, 0.0, 1.0], 1);
    [lit, dark, jambs, lintel].concat()
}

//! Meshes as they should not be; each closes a furnace, whose answer they must not change.

use serde_json::json;

use super::case::{Bound, Case};
use super::look::{Baked, bake, worse};
use super::rooms::{AT_FURNACE, Triangles, flipped, furnace, in_furnace, under_root};
use crate::common::Gltf;
use crate::shapes::{add, diffuse, quad, room};

const ALBEDO: f64 = 0.5;

/// Probes over the whole room and a little beyond, so that its walls are surveyed; no noise, for emission is gathered.
const WHOLE: &str = "--set encoding.irradiance=f32 --set capture.resolution=16 --set grid.spacing_m=0.55 \
                     --set capture.emission=gathered";

/// What the solver leaves, and rounding.
const EXACT: f64 = 2e-4 + 1e-5;

pub fn cases() -> Vec<Case> {
    let closed = |name: &'static str, gltf: fn() -> Gltf| {
        Case::new("mesh", name, "against πLe/(1 − ρ)", Bound::AtMost(EXACT), move || {
            let baked = bake(gltf(), WHOLE);
            worst(&baked)
        })
    };
    let mut cases = vec![
        closed("slivers of 10⁴:1", slivers),
        closed("every triangle twice", || walls(&room(1).repeat(2))),
        closed("coplanar surfaces that overlap", coplanar),
        closed("flipped, double-sided", || {
            let mut gltf = walls(&flipped(&room(1)));
            gltf.json["materials"][0]["doubleSided"] = json!(true);
            gltf
        }),
        closed("mirrored by a scale of −1", || {
            let mut gltf = furnace(ALBEDO);
            under_root(&mut gltf, json!({ "scale": [-1.0, 1.0, 1.0] }));
            gltf
        }),
        closed("divided into 10⁻² m", || walls(&room(100))),
        closed("triangles without area, or not numbers", broken),
    ];
    cases.push(Case::new("mesh", "triangles without area, or not numbers", "dropped", Bound::AtLeast(4.0), || {
        bake(broken(), WHOLE).report["numerics"]["dropped_triangles"].as_f64().expect("a count")
    }));
    // All that the probes within see are backs: none of them is active. The picture shows backs, which have no entry of their own
    // and are lit as the fronts beside them, from outside.
    cases.push(Case::new("mesh", "flipped, single-sided", "light", Bound::AtMost(0.0), || {
        let baked = super::look::bake_dark(walls(&flipped(&room(1))), WHOLE);
        let inside = baked.file.active().into_iter().filter(|&p| within(&baked, p));
        let texels = inside.flat_map(|p| baked.file.texels(p)).map(|t| t.2[0]).fold(0.0, worse);
        baked.look_dark(AT_FURNACE);
        texels
    }));
    // A lone sheet in the furnace, seen from both sides: it occludes and reflects on both, and emits on its front.
    cases.push(Case::new(
        "mesh",
        "open: a sheet hangs in the room",
        "brightest ÷ πLe/(1 − ρ)",
        Bound::AtMost(1.0 + EXACT),
        || {
            let mut gltf = furnace(ALBEDO);
            let sheet = quad([-0.5, 0.1, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], 1);
            add(&mut gltf, &sheet, diffuse([ALBEDO; 3], [1.0; 3]));
            let baked = bake(gltf, WHOLE);
            baked.look(AT_FURNACE);
            baked.texels().into_iter().fold(0.0, worse) / in_furnace(ALBEDO)
        },
    ));
    cases
}

fn walls(triangles: &[[f32; 3]]) -> Gltf {
    let mut gltf = Gltf::new();
    add(&mut gltf, triangles, diffuse([ALBEDO; 3], [1.0; 3]));
    gltf
}

fn within(baked: &Baked, probe: usize) -> bool {
    baked.file.position(probe).iter().all(|x| x.abs() < 1.0)
}

/// Largest relative error of the probes within the room, and of what is seen there.
fn worst(baked: &Baked) -> f64 {
    let probes: Vec<usize> = baked.file.active().into_iter().filter(|&p| within(baked, p)).collect();
    assert!(probes.len() >= 8, "{} active probes in the room", probes.len());
    let off = |e: f64| (e / in_furnace(ALBEDO) - 1.0).abs();
    let means = probes.into_iter().map(|p| off(baked.file.mean_irradiance(p)[0])).fold(0.0, worse);
    worse(means, off(baked.look(AT_FURNACE).mean("visibility_on")))
}

/// The floor's first fifth of 2,000 strips of 2 m × 0.2 mm.
fn slivers() -> Gltf {
    const STRIPS: usize = 2000;
    const BAND: f32 = 0.4;
    let full = room(1);
    // The second face of `room` along y is its low one: faces come in pairs, low then high, of six corners each.
    let floor = 2 * 6..3 * 6;
    let edge = |i: usize| -1.0 + BAND * i as f32 / STRIPS as f32;
    let strip = |i: usize| quad([-1.0, -1.0, edge(i)], [0.0, 0.0, edge(i + 1) - edge(i)], [2.0, 0.0, 0.0], 1);
    let mut triangles: Triangles = (0..STRIPS).flat_map(strip).collect();
    triangles.extend(quad([-1.0, -1.0, edge(STRIPS)], [0.0, 0.0, 1.0 - edge(STRIPS)], [2.0, 0.0, 0.0], 1));
    assert!(full[floor.clone()].iter().all(|p| p[1] == -1.0), "the floor");
    triangles.extend(full.iter().enumerate().filter(|(i, _)| !floor.contains(i)).map(|(_, p)| *p));
    walls(&triangles)
}

/// Patches in the planes of the walls, of another division.
fn coplanar() -> Gltf {
    let patches = [
        quad([-0.7, -1.0, -0.6], [0.0, 0.0, 1.3], [1.1, 0.0, 0.0], 3),
        quad([-1.0, -0.5, -0.4], [0.0, 0.9, 0.0], [0.0, 0.0, 0.8], 2),
    ];
    walls(&[room(1), patches.concat()].concat())
}

/// Beside the walls: a point, a line, a triangle with a NaN and one with an infinity.
fn broken() -> Gltf {
    let mut gltf = furnace(ALBEDO);
    let (nan, infinite) = (f32::NAN, f32::INFINITY);
    let triangles = [
        [[0.1; 3]; 3],
        [[0.0; 3], [0.1; 3], [0.2; 3]],
        [[0.0; 3], [nan, 0.0, 0.0], [0.0, 0.1, 0.0]],
        [[0.0; 3], [infinite, 0.0, 0.0], [0.0, 0.1, 0.0]],
    ];
    add(&mut gltf, triangles.as_flattened(), diffuse([ALBEDO; 3], [1.0; 3]));
    gltf
}

//! Walls that are thin against everything: light on one side stays there, at every size of the scene.

use super::case::{Bound, Case, Shared, shared};
use super::look::{Baked, bake, scaled, worse};
use super::rooms::{Lamp, Rooms, SPACING_M, Triangles, Wall, inside_of, outside_of};
use crate::common::Gltf;
use crate::shapes::{add, diffuse, quad};

/// Probes on both sides of the wall, and probes in its very plane.
const SPACINGS: [(&str, f64); 2] = [("between probes", SPACING_M), ("among probes", 1.03)];

/// Places before the foot of the wall, where floor of both rooms may share a voxel.
const FEET: [&str; 2] = ["--look-at=-0.7,0.6,0.5,0,0,0.3,60", "--look-at=0.7,0.6,0.5,0,0,0.3,60"];

struct Figures {
    /// The dark room's light ÷ the lit one's, and that at the foot of the wall ÷ the lit room's.
    through: f64,
    foot: f64,
    light: f64,
    dark: f64,
}

fn figures(wall: Wall, spacing_m: f64, scale: f64) -> Figures {
    let rooms = Rooms { albedo: 0.7, wall, lamp: Lamp::Area(10.0), scale, shift: 0.0, spacing_m };
    let baked = bake(rooms.gltf(), &rooms.words());
    let (lit, dark) = (baked.look("--camera lit"), baked.look_dark("--camera dark"));
    let [lit_foot, dark_foot] = FEET.map(|look| baked.look_dark(&scaled(look, scale)));
    let reference = lit.mean("visibility_on");
    let views = [&lit, &dark, &lit_foot, &dark_foot];
    // Where exact visibility finds no light, the ratio to it is undefined, and the means tell all.
    let most = |key: &str| views.into_iter().map(|v| v.leak(key)).filter(|v| !v.is_nan()).fold(0.0, f64::max);
    Figures {
        through: dark.mean("visibility_on") / reference,
        foot: dark_foot.mean("visibility_on") / reference,
        light: most("light"),
        dark: most("dark"),
    }
}

pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    let walls = [
        ("1 cm", Wall::Sealed(1e-2)),
        ("1 mm", Wall::Sealed(1e-3)),
        ("0.1 mm", Wall::Sealed(1e-4)),
        ("sheet", Wall::Sheet),
    ];
    for ((wall_name, wall), (place, spacing_m)) in walls.into_iter().flat_map(|w| SPACINGS.map(|s| (w, s))) {
        let name = format!("{wall_name}, {place}");
        let base: Shared<Figures> = shared(move || figures(wall, spacing_m, 1.0));
        for (checked, of) in [
            ("dark room ÷ lit room", (|f| f.through) as fn(&Figures) -> f64),
            ("the wall's dark foot ÷ lit room", |f| f.foot),
            ("leak.light", |f| f.light),
            ("leak.dark", |f| f.dark),
        ] {
            let base = base.clone();
            cases.push(Case::new("wall", &name, checked, Bound::AtMost(1e-3), move || of(&base)));
        }
        for scale in [1e-4, 1e4] {
            let base = base.clone();
            let name = format!("{name}, × {scale:e}");
            cases.push(Case::new("wall", name, "worst leak above that at × 1", Bound::AtMost(1e-4), move || {
                let there = figures(wall, spacing_m, scale);
                let worst = (there.light - base.light).max(there.dark - base.dark);
                worst.max(there.through - base.through).max(there.foot - base.foot)
            }));
        }
    }
    cases.extend(boxes());
    cases
}

/// A closed box of 2 m with walls of 0.1 m on a floor of 8 m, a lamp inside or above it.
fn closed_box(lamp: Triangles) -> Gltf {
    let mut gltf = Gltf::new();
    let walls =
        [inside_of([-1.0, 0.1, -1.0], [1.0, 2.1, 1.0]), outside_of([-1.1, 0.0, -1.1], [1.1, 2.2, 1.1])].concat();
    add(&mut gltf, &walls, diffuse([0.7; 3], [0.0; 3]));
    let floor = quad([-4.0, 0.0, -4.0], [0.0, 0.0, 8.0], [8.0, 0.0, 0.0], 1);
    add(&mut gltf, &floor, diffuse([0.7; 3], [0.0; 3]));
    add(&mut gltf, &lamp, diffuse([0.7; 3], [10.0; 3]));
    gltf
}

/// Light inside a closed box does not reach its outer faces, nor light outside its inner ones.
fn boxes() -> Vec<Case> {
    let lamp = |y: f32, side: f32| quad([-side / 2.0, y, -side / 2.0], [side, 0.0, 0.0], [0.0, 0.0, side], 1);
    // u × v = x × z is −y: both shine down.
    let inside = shared(move || baked_box(lamp(2.0, 0.5)));
    let outside = shared(move || baked_box(lamp(3.5, 2.0)));
    let within = "--look-at=-0.8,1.1,-0.8,0.8,0.9,0.8,80";
    let beside = "--look-at=3.5,2.8,3,0,1,0,60";
    let leak = |at_light: &'static str, in_dark: &'static str, baked: Shared<Baked>| {
        move || baked.look_dark(in_dark).mean("visibility_on") / baked.look(at_light).mean("visibility_on")
    };
    let both = |look: &'static str, baked: Shared<Baked>| {
        move || {
            let seen = baked.look(look);
            worse(seen.leak("light"), seen.leak("dark"))
        }
    };
    vec![
        Case::new(
            "box",
            "lamp inside",
            "outer faces ÷ inner ones",
            Bound::AtMost(1e-3),
            leak(within, beside, inside.clone()),
        ),
        Case::new(
            "box",
            "lamp outside",
            "inner faces ÷ outer ones",
            Bound::AtMost(1e-3),
            leak(beside, within, outside.clone()),
        ),
        Case::new("box", "lamp inside", "leak.light and .dark, inside", Bound::AtMost(1e-3), both(within, inside)),
        Case::new("box", "lamp outside", "leak.light and .dark, outside", Bound::AtMost(1e-3), both(beside, outside)),
    ]
}

fn baked_box(lamp: Triangles) -> Baked {
    bake(closed_box(lamp), "--set encoding.irradiance=f32 --set capture.resolution=16 --set grid.spacing_m=0.7")
}

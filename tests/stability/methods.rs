//! Every method where numbers could break: at other sizes, with light that hardly fades, with few probes, with probes in
//! walls.
//!
//! Captures are smaller than published, see [`METHODS`], so that all runs together take minutes: the table says so. What a
//! method loses by design its row says; what none may do is to make light, or numbers that are not finite.

use super::case::{Bound, Case, Found, Shared, shared};
use super::look::{Baked, Seen, bake};
use super::rooms::{AT_FURNACE, Lamp, Rooms, Wall, furnace, in_furnace, outside_of};
use crate::common::Gltf;
use crate::shapes::{add, diffuse};

/// A method, how it is scaled, and what it may lose.
struct Method {
    name: &'static str,
    words: &'static str,
    /// What one iteration is called.
    iterations: &'static str,
    /// Points of the finest grid along each axis for one base cell.
    base: u32,
    /// Most by which it may exceed the light that there is, relative: rounding of what it stores, and noise.
    above: f64,
    /// By how much it may fall short of the furnace's light at albedo 0.5, with probes within it: `above`, and what it loses
    /// by design.
    below: f64,
    /// What it finds at least at the albedos 0.99 and 0.999, as shares of the light.
    stiff: [f64; 2],
    /// What it finds at least where probes stand beyond the walls.
    walls: f64,
    /// Why it loses light by design, in these cases; empty where it does not.
    why: Why,
}

#[derive(Clone, Copy)]
struct Why {
    soft: &'static str,
    stiff: &'static str,
    walls: &'static str,
}

const NOTHING: Why = Why { soft: "", stiff: "", walls: "" };

/// Half a step of R11G11B10F's six bits for red, which pictures are judged by.
const STEP: f64 = 1.0 / 128.0;

/// What a path finds of a geometric series spreads by as much as its mean at the stiff albedos, where the picture hangs on
/// four probes, and by half of it at 1/2, where it may hang on one: half of 2,048 paths a probe that look its way give 1.6 %
/// in both. Three of these.
const PATHS: f64 = 0.05;

/// Picture against that of another size: random numbers are the same, and rounding moves a ray in a thousand.
const EQUAL: f64 = 1e-3;

const ONE_BOUNCE: &str = "one bounce";
const CORNERS: &str = "rays that end where walls meet find no probe, a tenth of them with maps this small";
const BACKS: &str = "a probe behind a wall sees the wall's back where the surface is";
const SOON: &str = "passes end when the last changed nothing by 0.1 %, though many such are to come";
/// Of 8.4 % that stored visibility loses against exact one, weights without anything behind a surface's own plane (κ = 1) would
/// mend 0.7: the rest is the test's.
const COARSE: &str = "near edges coarse distances reject probes behind the next wall only in part";

const METHODS: [Method; 8] = [
    Method {
        name: "physical",
        words: "--preset physical --set encoding.irradiance=f32 --set capture.resolution=16",
        iterations: "sweeps",
        base: 1,
        above: 1e-3,
        below: 1e-3,
        stiff: [0.999, 0.99],
        walls: 0.999,
        why: NOTHING,
    },
    Method {
        name: "default",
        words: "--preset default --set store.irradiance.sh9.format=f32",
        iterations: "sweeps",
        base: 1,
        above: PATHS,
        below: PATHS,
        stiff: [1.0 - PATHS; 2],
        walls: 1.0 - PATHS,
        why: NOTHING,
    },
    Method {
        name: "path",
        words: "--preset path --set transport=paths(paths:8) --set capture.resolution=16",
        iterations: "sweep",
        base: 1,
        above: PATHS,
        below: PATHS,
        stiff: [1.0 - PATHS; 2],
        walls: 1.0 - PATHS,
        why: NOTHING,
    },
    Method {
        name: "irradiance-2022",
        words: "--preset irradiance-2022 --set capture.rays.cube.face=32 --set capture.rays.cube.sharpness=64 \
                --set capture.rays.cube.resolution=16 --set store.irradiance.octahedral.resolution=16 \
                --set store.prefiltered=[16,8]",
        iterations: "sweep",
        base: 1,
        above: STEP,
        below: 0.25 + STEP,
        stiff: [0.0199 - 1e-4, 0.001_999 - 1e-5],
        walls: 0.15,
        why: Why { soft: ONE_BOUNCE, stiff: ONE_BOUNCE, walls: "one bounce, and no test of visibility" },
    },
    Method {
        name: "lightfield-2022",
        words: "--preset lightfield-2022 --set capture.rays.cube.face=32 --set capture.rays.cube.sharpness=64 \
                --set capture.rays.cube.resolution=16 --set store.irradiance.octahedral.resolution=16 \
                --set store.occlusion.moments.resolution=16",
        iterations: "iterations",
        base: 1,
        above: STEP,
        below: 0.15,
        stiff: [0.07, 0.007],
        walls: 0.2,
        why: Why { soft: CORNERS, stiff: CORNERS, walls: BACKS },
    },
    Method {
        name: "ddgi-2019",
        words: "--preset ddgi-2019",
        iterations: "frames",
        base: 1,
        above: STEP,
        below: STEP,
        stiff: [0.4, 0.05],
        walls: 1.0 - STEP,
        why: Why { stiff: "2048 frames at most, each of which mixes in 3 %", ..NOTHING },
    },
    Method {
        name: "threev8-uniform",
        words: "--preset threev8-uniform --set capture.rays.cube.face=16",
        iterations: "passes",
        base: 1,
        above: STEP,
        below: 1e-3 + STEP,
        stiff: [0.9, 0.4],
        walls: 0.8,
        why: Why { soft: "", stiff: SOON, walls: COARSE },
    },
    Method {
        name: "threev8-mixed",
        words: "--preset threev8-mixed --set capture.rays.cube.face=16",
        iterations: "passes",
        base: 4,
        above: STEP,
        below: 1e-3 + STEP,
        stiff: [0.9, 0.4],
        walls: 0.8,
        why: Why { soft: "", stiff: SOON, walls: COARSE },
    },
];

/// Albedos of [`Method::stiff`].
const STIFF: [f64; 2] = [0.99, 0.999];

impl Method {
    fn case(
        &self,
        name: &str,
        checked: &'static str,
        bound: Bound,
        of: impl FnOnce() -> Found + Send + 'static,
    ) -> Case {
        Case::new("method", format!("{} · {name}", self.name), checked, bound, of)
    }

    /// Words of a bake with so many base cells, their points evenly within ±`half`, metres.
    fn grid(&self, cells: [u32; 3], half: f64) -> String {
        let [x, y, z] = cells.map(|n| n * self.base);
        format!(
            "{} --set grid.divisions=({x},{y},{z}) \
             --set grid.bounds={{\"min\":[-{half},-{half},-{half}],\"max\":[{half},{half},{half}]}}",
            self.words
        )
    }

    /// Two rows of the share of the furnace's light that a picture shows: none too much, and not less than a share.
    fn shares(&self, name: &str, least: f64, share: Shared<Found>) -> [Case; 2] {
        let of = share.clone();
        let again = move |found: &Found| Found { figure: found.figure, note: found.note.clone() };
        [
            self.case(name, "÷ πLe/(1 − ρ)", Bound::AtMost(1.0 + self.above), move || again(&of)),
            self.case(name, "÷ πLe/(1 − ρ), at least", Bound::AtLeast(least), move || again(&share)),
        ]
    }

    /// What a bake and a picture of a furnace find.
    fn furnace(
        &self,
        albedo: f64,
        gltf: impl FnOnce() -> Gltf + Send + 'static,
        words: String,
        why: &'static str,
    ) -> Shared<Found> {
        let iterations = self.iterations;
        shared(move || {
            let baked = bake(gltf(), &words);
            let figure = baked.look(AT_FURNACE).mean("visibility_on") / in_furnace(albedo);
            let by_design = if why.is_empty() { String::new() } else { format!("; by design: {why}") };
            Found { figure, note: told(&baked, iterations) + &by_design }
        })
    }

    fn rooms(scale: f64) -> Rooms {
        Rooms { albedo: 0.7, wall: Wall::Door(0.1), lamp: Lamp::Area(10.0), scale, shift: 0.0, spacing_m: SPACING_M }
    }

    /// A size of the two rooms with a door.
    fn sized(&self, scale: f64) -> Shared<(Baked, Seen)> {
        let words = format!("{} --set grid.spacing_m={:e}", self.words, SPACING_M * scale);
        shared(move || {
            let baked = bake(Self::rooms(scale).gltf(), &words);
            let seen = baked.look("--camera lit");
            (baked, seen)
        })
    }

    fn cases(&'static self) -> Vec<Case> {
        let mut cases = Vec::new();
        let base = self.sized(1.0);
        for (scale, name) in [(1e-3, "× 10⁻³"), (1e3, "× 10³")] {
            let (base, there) = (base.clone(), self.sized(scale));
            cases.push(self.case(name, "picture against × 1", Bound::AtMost(EQUAL), move || {
                let mean = |seen: &Seen| seen.mean("visibility_on");
                let figure = (mean(&there.1) / mean(&base.1) - 1.0).abs();
                Found { figure, note: told(&there.0, self.iterations) }
            }));
        }
        for (albedo, least) in STIFF.into_iter().zip(self.stiff) {
            let share = self.furnace(albedo, move || furnace(albedo), self.grid([2; 3], 0.6), self.why.stiff);
            cases.extend(self.shares(&format!("albedo {albedo}"), least, share));
        }
        for (name, cells) in [("one probe", [1; 3]), ("1 × 1 × 5 probes", [1, 1, 5])] {
            let share = self.furnace(0.5, || furnace(0.5), self.grid(cells, 0.6), self.why.soft);
            cases.extend(self.shares(name, 1.0 - self.below, share));
        }
        // The points of one base cell of a mixed grid are so many.
        let cells = [4 / self.base; 3];
        let share = self.furnace(0.5, furnace_with_block, self.grid(cells, 1.2), self.why.walls);
        cases.extend(self.shares("probes in walls", self.walls, share));
        cases
    }
}

/// Between probes of the rooms, metres: few, for the methods that take long.
const SPACING_M: f64 = 1.94;

/// The furnace of albedo 0.5 with a block in it that is of the same kind, and so changes nothing: a probe at 0.4 m lies
/// within it.
fn furnace_with_block() -> Gltf {
    let mut gltf = furnace(0.5);
    add(&mut gltf, &outside_of([0.2; 3], [0.6; 3]), diffuse([0.5; 3], [1.0; 3]));
    gltf
}

/// How a bake ended, and what it clamped.
fn told(baked: &Baked, iterations: &str) -> String {
    let report = &baked.report;
    let done = report["bounces"].as_array().map_or(0, Vec::len);
    // A single one is all that was asked for.
    let end = if report["converged"] == true || done == 1 { "" } else { ", not settled" };
    let numerics = &report["numerics"];
    let of_tensors = numerics["clamped"].as_object().into_iter().flatten().filter_map(|(_, n)| n.as_u64());
    let clamped = of_tensors.sum::<u64>() + numerics["light_clamped"].as_u64().unwrap_or(0);
    let off = numerics["probes_inside_geometry"].as_u64().unwrap_or(0);
    let off = if off > 0 { format!(", {off} probes inside") } else { String::new() };
    format!("{done} {iterations}{end}{off}, {clamped} clamped")
}

pub fn cases() -> Vec<Case> {
    METHODS.iter().flat_map(Method::cases).collect()
}

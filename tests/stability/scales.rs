//! The same rooms at other sizes and in other places: no length is absolute.

use super::case::{Bound, Case, Shared, shared};
use super::look::{Baked, Seen, bake, difference};
use super::rooms::{Lamp, Rooms, SIZE_M, SPACING_M, Wall};

/// Results at another size: random numbers are the same, so only rays that pass an edge within rounding differ; each is
/// a thousandth of what a probe sees.
const EQUAL: f64 = 1e-3;

fn rooms(lamp: Lamp) -> Rooms {
    Rooms { albedo: 0.7, wall: Wall::Door(0.1), lamp, scale: 1.0, shift: 0.0, spacing_m: SPACING_M }
}

fn baked(rooms: Rooms) -> Shared<Baked> {
    shared(move || bake(rooms.gltf(), &rooms.words()))
}

fn dark(baked: &Baked) -> Seen {
    baked.look("--camera dark")
}

pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (light, lamp) in [("area light", Lamp::Area(10.0)), ("point light × s²", Lamp::Point(100.0))] {
        let base = baked(rooms(lamp));
        for scale in [1e-4, 1e-2, 1e2, 1e4] {
            let there = baked(Rooms { scale, ..rooms(lamp) });
            let name = format!("× {scale:e}, {light}");
            let (a, b) = (base.clone(), there.clone());
            cases.push(Case::new("scale", &name, "irradiance against × 1", Bound::AtMost(EQUAL), move || {
                difference(&a.texels(), &b.texels())
            }));
            let (a, b) = (base.clone(), there.clone());
            cases.push(Case::new("scale", &name, "picture against × 1", Bound::AtMost(EQUAL), move || {
                (dark(&b).mean("visibility_on") / dark(&a).mean("visibility_on") - 1.0).abs()
            }));
            let a = base.clone();
            cases.push(Case::new("scale", &name, "leak above that at × 1", Bound::AtMost(1e-4), move || {
                let (a, b) = (dark(&a), dark(&there));
                (b.leak("light") - a.leak("light")).max(b.leak("dark") - a.leak("dark"))
            }));
        }
    }
    let base = baked(rooms(Lamp::Area(10.0)));
    for sizes in [1e5, 1e6] {
        let there = baked(Rooms { shift: sizes * SIZE_M, ..rooms(Lamp::Area(10.0)) });
        let name = format!("by {sizes:e} × its size");
        let (a, b) = (base.clone(), there.clone());
        cases.push(Case::new("moved", &name, "irradiance: difference", Bound::AtMost(0.0), move || {
            difference(&a.texels(), &b.texels())
        }));
        let a = base.clone();
        cases.push(Case::new("moved", &name, "picture: difference", Bound::AtMost(0.0), move || {
            (dark(&there).mean("visibility_on") / dark(&a).mean("visibility_on") - 1.0).abs()
        }));
    }
    cases
}

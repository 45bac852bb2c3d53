//! What the user should know of rooms: where one volume, or what volumes there are, cannot tell them apart.

use std::collections::BTreeMap;

use glam::Vec3;

use super::parts::parts;
use super::room::Room;
use crate::export::sight::Sight;
use crate::light::World;
use crate::probe::{Grid, Volume};

/// Pairs of rooms that a warning names.
const NAMED: usize = 3;

/// Places in words, world space, metres.
fn place(frame: &Grid, p: Vec3) -> String {
    let at = frame.origin_world() + (p - frame.origin()).as_dvec3();
    format!("{:.2}, {:.2}, {:.2}", at.x, at.y, at.z)
}

/// A warning where cells of one volume have probes, and so hold surfaces, of two rooms: plain filtering mixes their light there.
/// It names for each pair of rooms the box of their cells.
pub fn shared(world: &World, volume: &Volume) -> Option<String> {
    let mut room = vec![usize::MAX; volume.states.len()];
    for (number, own) in parts(&Sight::new(world, volume), volume).iter().enumerate() {
        own.iter().for_each(|&probe| room[probe] = number);
    }
    let grid = &volume.grid;
    let mut found: BTreeMap<(usize, usize), (usize, Vec3, Vec3)> = BTreeMap::new();
    for cell in grid.cells() {
        let corners = grid.corners(cell).map(|probe| room[probe.0 as usize]);
        let known = || corners.into_iter().filter(|room| *room != usize::MAX);
        let (Some(a), Some(b)) = (known().min(), known().max()) else { continue };
        if a != b {
            let (low, sides) = grid.cell_box(cell);
            let own = found.entry((a, b)).or_insert((0, Vec3::INFINITY, Vec3::NEG_INFINITY));
            *own = (own.0 + 1, own.1.min(low), own.2.max(low + sides));
        }
    }
    let all: usize = found.values().map(|(count, ..)| count).sum();
    let mut boxes: Vec<&(usize, Vec3, Vec3)> = found.values().collect();
    boxes.sort_by_key(|(count, ..)| std::cmp::Reverse(*count));
    let name = |(count, low, high): &&(usize, Vec3, Vec3)| {
        format!("{count} from {} to {}", place(grid, *low), place(grid, *high))
    };
    let names: Vec<String> = boxes.iter().take(NAMED).map(name).collect();
    let more = if boxes.len() > NAMED { " and more" } else { "" };
    (all > 0).then(|| {
        format!(
            "{all} cells hold surfaces of two rooms, {}{more}: light passes their walls; --volumes auto makes a volume for \
             each room",
            names.join(", ")
        )
    })
}

/// How many active probes stand in no box.
pub fn strays(volume: &Volume, rooms: &[Room], margin: f32) -> usize {
    let margin = margin * volume.grid.spacing();
    let holds = |room: &Room, p: Vec3| p.cmpge(room.low - margin).all() && p.cmple(room.high + margin).all();
    let is_stray = |probe: &usize| !rooms.iter().any(|room| holds(room, volume.positions[*probe]));
    volume.active().filter(is_stray).count()
}

/// Which boxes of rooms hold places of two rooms. One that lies wholly within another is none: it counts alone there.
pub fn overlaps(rooms: &[Room], frame: &Grid) -> Vec<String> {
    /// Metres that rays and walls leave open.
    const TOUCHING: f32 = 1e-3;
    let mut found = Vec::new();
    for (i, a) in rooms.iter().enumerate() {
        for b in &rooms[i + 1..] {
            let (low, high) = (a.low.max(b.low), a.high.min(b.high));
            let size = high - low;
            let is_within = (b.high - b.low - size).max_element() < TOUCHING;
            if size.min_element() > TOUCHING && !is_within {
                found.push(format!(
                    "two volumes share {:.2} × {:.2} × {:.2} m around {}: surfaces of one room get light of the other there",
                    size.x,
                    size.y,
                    size.z,
                    place(frame, 0.5 * (low + high))
                ));
            }
        }
    }
    found
}

//! The boxes of rooms.

use glam::Vec3;
use rayon::prelude::*;

use super::parts::parts;
use crate::export::sight::Sight;
use crate::light::World;
use crate::probe::{ProbeIndex, Volume};
use crate::trace::Ray;

/// Spacings. What is thinner is the inside of a wall.
const THINNEST: f32 = 0.5;

/// A room: the box of its air, and how many probes stand in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    pub low: Vec3,
    pub high: Vec3,
    pub probes: usize,
}

/// The rooms of a volume, from large to small.
pub fn rooms(world: &World, volume: &Volume) -> Vec<Room> {
    let sight = Sight::new(world, volume);
    let spacing = volume.grid.spacing();
    let scene = world.scene.mesh.bounds().unwrap_or((Vec3::NEG_INFINITY, Vec3::INFINITY));
    let room = |own: &Vec<usize>| {
        let reaches: Vec<[[End; 3]; 2]> = own.par_iter().map(|&probe| reach(&sight, volume, probe)).collect();
        let along = |side: usize, sign: f32| {
            let face = |axis: usize| {
                let ends = reaches.iter().map(|reach| reach[side][axis]);
                sign * face(ends.map(|end| End { at: sign * end.at, ..end }).collect(), spacing[axis])
            };
            Vec3::from([0, 1, 2].map(face))
        };
        let (low, high) = (along(0, -1.0), along(1, 1.0));
        // Air beyond the scene lights nothing.
        Room { low: low.max(scene.0), high: high.min(scene.1), probes: own.len() }
    };
    let mut rooms: Vec<Room> = parts(&sight, volume).iter().map(room).collect();
    rooms.retain(|room| ((room.high - room.low) / spacing).min_element() > THINNEST);
    let volume_of = |room: &Room| (room.high - room.low).element_product();
    rooms.sort_by(|a, b| volume_of(b).total_cmp(&volume_of(a)));
    rooms
}

/// How far air reaches in one direction.
#[derive(Debug, Clone, Copy)]
struct End {
    /// Along its axis, relative to the scene's origin, metres.
    at: f32,
    /// Whether a surface ends it, and not merely the probe's cell.
    is_wall: bool,
}

/// Where a room ends: the middle of the walls within a spacing of the farthest end, so that it ends at the wall around a door
/// and not behind it, and at the ceiling and not at a lamp.
fn face(ends: Vec<End>, spacing: f32) -> f32 {
    let farthest = ends.iter().map(|end| end.at).fold(f32::NEG_INFINITY, f32::max);
    let is_near = |end: &End| end.is_wall && end.at > farthest - spacing;
    let mut walls: Vec<f32> = ends.into_iter().filter(is_near).map(|end| end.at).collect();
    walls.sort_by(f32::total_cmp);
    walls.get(walls.len() / 2).copied().unwrap_or(farthest)
}

/// How far the air reaches from a probe against the axes and along them, to the next surface or to its cell's end.
fn reach(sight: &Sight, volume: &Volume, probe: usize) -> [[End; 3]; 2] {
    let from = sight.viewpoint(probe);
    let spacing = volume.grid.spacing() * volume.grid.width(ProbeIndex(probe as u32)) as f32;
    [-1.0, 1.0].map(|sign| {
        [0, 1, 2].map(|axis| {
            let ray = Ray::new(from, sign * Vec3::AXES[axis], axis as u32);
            let met = sight.world.tracer.closest(ray).map_or(f32::INFINITY, |hit| hit.t);
            End { at: from[axis] + sign * met.min(spacing[axis]), is_wall: met <= spacing[axis] }
        })
    })
}

/// Whether most of a box lies in another.
fn holds(outer: &Room, inner: &Room) -> bool {
    /// Share of the inner one.
    const MOST: f32 = 0.5;
    size(outer.low.max(inner.low), outer.high.min(inner.high)) > MOST * size(inner.low, inner.high)
}

fn size(low: Vec3, high: Vec3) -> f32 {
    (high - low).max(Vec3::ZERO).element_product()
}

/// Rooms, from large to small, without those that consist of others for the most part: the open air around a house does.
pub fn without_shells(rooms: &[Room]) -> Vec<Room> {
    /// Share of the shell that the others in it have.
    const FILLED: f32 = 0.5;
    let is_room = |(i, room): &(usize, &Room)| {
        let within = rooms[i + 1..].iter().filter(|other| holds(room, other));
        within.map(|other| size(other.low, other.high)).sum::<f32>() <= FILLED * size(room.low, room.high)
    };
    rooms.iter().enumerate().filter(is_room).map(|(_, room)| *room).collect()
}

/// The same without those within others: the insides of cupboards.
pub fn without_pockets(rooms: &[Room]) -> Vec<Room> {
    let is_room = |(i, room): &(usize, &Room)| !rooms[..*i].iter().any(|larger| holds(larger, room));
    rooms.iter().enumerate().filter(is_room).map(|(_, room)| *room).collect()
}

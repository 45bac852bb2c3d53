//! Openings between the boxes of rooms: where rays pass from one to the other straight through the wall between them.

use glam::Vec3;

use super::room::Room;
use crate::light::World;
use crate::trace::Ray;

/// Rays for each spacing along the axes of a wall.
const RAYS: f32 = 8.0;

/// Most rays along an axis of a wall. The wider steps of large walls find their doors all the same.
const MOST_RAYS: f32 = 512.0;

/// Rays of the smallest opening. Fewer pass where walls do not quite meet.
const SMALLEST: usize = 4;

/// Spacings. Thicker walls are no walls, and boxes that overlap more have none between them.
const THICKEST: f32 = 1.0;
const OVERLAP: f32 = 0.05;

/// Spacings before and behind a wall that rays start and end at: what stands on the wall does not stop them.
const AWAY: f32 = 0.05;

/// Layers of probes that an opening's box reaches into both rooms.
const LAYERS: f32 = 1.0;

/// A box for each opening between two rooms, one layer into both of them.
pub fn openings(world: &World, rooms: &[Room], spacing: Vec3) -> Vec<Room> {
    let pairs = rooms.iter().enumerate().flat_map(|(i, a)| rooms[i + 1..].iter().flat_map(move |b| [(a, b), (b, a)]));
    let along_axes = pairs.flat_map(|pair| [0, 1, 2].map(|axis| (pair, axis)));
    along_axes.flat_map(|((before, behind), axis)| between(world, before, behind, spacing, axis)).collect()
}

/// Openings in the wall that lies behind a room along an axis, and before another.
fn between(world: &World, before: &Room, behind: &Room, spacing: Vec3, axis: usize) -> Vec<Room> {
    let (start, end) = (before.high[axis], behind.low[axis]);
    let thickness = (end - start) / spacing[axis];
    let (low, high) = (before.low.max(behind.low), before.high.min(behind.high));
    let [across, up] = [(axis + 1) % 3, (axis + 2) % 3];
    let size = high - low;
    if !(-OVERLAP..=THICKEST).contains(&thickness) || size[across] <= 0.0 || size[up] <= 0.0 {
        return Vec::new();
    }
    let count = (size / spacing * RAYS).ceil().clamp(Vec3::ONE, Vec3::splat(MOST_RAYS));
    let step = size / count;
    let (width, height) = (count[across] as usize, count[up] as usize);
    let away = AWAY * spacing[axis];
    let is_free = |i: usize| {
        let mut from = low;
        from[across] += ((i % width) as f32 + 0.5) * step[across];
        from[up] += ((i / width) as f32 + 0.5) * step[up];
        let mut to = from;
        (from[axis], to[axis]) = (start - away, end + away);
        !world.tracer.occluded(Ray::segment(from, to, i as u32))
    };
    let free: Vec<bool> = (0..width * height).map(is_free).collect();
    let of_patch = |[left, bottom, right, top]: [usize; 4]| {
        let (mut own_low, mut own_high) = (low, high);
        // A step more than the rays that pass, so that the opening's own sides lie within.
        let along = |place: usize, axis: usize| low[axis] + (place as f32 + 0.5) * step[axis];
        (own_low[across], own_high[across]) = (along(left, across) - step[across], along(right, across) + step[across]);
        (own_low[up], own_high[up]) = (along(bottom, up) - step[up], along(top, up) + step[up]);
        own_low = own_low.max(low);
        own_high = own_high.min(high);
        let layer = LAYERS * spacing[axis];
        own_low[axis] = (start.min(end) - layer).max(before.low[axis]);
        own_high[axis] = (start.max(end) + layer).min(behind.high[axis]);
        Room { low: own_low, high: own_high, probes: 0 }
    };
    patches(&free, width).into_iter().map(of_patch).collect()
}

/// Boxes around what is connected in a picture, in pixels: left, bottom, right, top, all of them within.
fn patches(picture: &[bool], width: usize) -> Vec<[usize; 4]> {
    let mut seen = vec![false; picture.len()];
    let mut found = Vec::new();
    for start in 0..picture.len() {
        if !picture[start] || std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let (mut next, mut pixels, mut own) = (vec![start], 0, [usize::MAX, usize::MAX, 0, 0]);
        while let Some(i) = next.pop() {
            let (x, y) = (i % width, i / width);
            own = [own[0].min(x), own[1].min(y), own[2].max(x), own[3].max(y)];
            pixels += 1;
            let left = (x > 0).then(|| i - 1);
            let right = (x + 1 < width).then_some(i + 1);
            let above = Some(i + width).filter(|&i| i < picture.len());
            for j in [left, right, i.checked_sub(width), above].into_iter().flatten() {
                if picture[j] && !std::mem::replace(&mut seen[j], true) {
                    next.push(j);
                }
            }
        }
        if pixels >= SMALLEST {
            found.push(own);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_connected_by_their_sides() {
        let rows = ["##....", "##..#.", "....##", ".#..#."];
        let picture: Vec<bool> = rows.iter().flat_map(|row| row.chars().map(|c| c == '#')).collect();
        // The single pixel is none.
        assert_eq!(patches(&picture, 6), [[0, 0, 1, 1], [4, 1, 5, 3]]);
    }
}

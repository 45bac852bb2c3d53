//! Values for probes that hold no light: engines know no states and blend all.
//!
//! A hole gets the mean of what the method's own look-up gives around it, over the cells in which an engine blends it and with
//! the weights that the engine gives it there. Each of these places asks the probes that it sees, by rays where the scene is
//! known, so that light does not come from behind a wall, but from neighbours that see the same surfaces. Places within
//! solids see none and do not count, nor do those that another volume answers.

use std::collections::VecDeque;

use glam::{UVec3, Vec3, Vec3A};
use rayon::prelude::*;

use super::block::Block;
use super::reader::Reader;
use super::sight::Sight;
use crate::probe::query::Visibility;

/// Places along each axis, from the probe before to the one after.
const PLACES: u32 = 4;

/// The values of a block's probes, `known` being those that the file has, and the numbers of the holes.
pub fn filled(
    reader: &Reader,
    block: &Block,
    known: Vec<Option<Vec<Vec3A>>>,
    sight: Option<&Sight>,
) -> (Vec<Vec<Vec3A>>, Vec<u32>) {
    let (low, high) = block.bounds();
    let visibility = |place: Vec3| sight.map_or(Visibility::Stored, |sight| sight.around(reader.look_up(), place));
    let holes: Vec<u32> = (0..known.len() as u32).filter(|&i| known[i as usize].is_none()).collect();
    let around = |&i: &u32| -> Option<Vec<Vec3A>> {
        let position = block.first + block.coordinate(i).as_vec3() * block.spacing;
        let within = places(position, block.spacing).filter(|(p, _)| p.cmpge(low).all() && p.cmple(high).all());
        let asked: Vec<(Vec3, f32, Visibility)> = within.map(|(p, weight)| (p, weight, visibility(p))).collect();
        reader.of_places(&asked)
    };
    let found: Vec<Option<Vec<Vec3A>>> = holes.par_iter().map(around).collect();
    let mut values = known;
    for (&hole, found) in holes.iter().zip(found) {
        values[hole as usize] = found;
    }
    (spread(block, values, reader.unknowns()), holes)
}

/// Places in the cells around a probe with the trilinear weight that it has there.
fn places(position: Vec3, spacing: Vec3) -> impl Iterator<Item = (Vec3, f32)> {
    let along = |k: u32| (2 * k + 1) as f32 / PLACES as f32 - 1.0;
    let all = (0..PLACES.pow(3)).map(|i| UVec3::new(i % PLACES, i / PLACES % PLACES, i / PLACES.pow(2)));
    all.map(move |k| {
        let offset = Vec3::new(along(k.x), along(k.y), along(k.z));
        (position + offset * spacing, (1.0 - offset.abs()).element_product())
    })
}

/// Gives what nothing is known of the values of the nearest by steps along the axes; black where there are none at all.
fn spread(block: &Block, mut values: Vec<Option<Vec<Vec3A>>>, unknowns: usize) -> Vec<Vec<Vec3A>> {
    let mut next: VecDeque<u32> = (0..values.len() as u32).filter(|&i| values[i as usize].is_some()).collect();
    while let Some(i) = next.pop_front() {
        let at = block.coordinate(i);
        for axis in 0..3 {
            let mut step = UVec3::ZERO;
            step[axis] = 1;
            let up = (at[axis] + 1 < block.divisions[axis]).then(|| at + step);
            let down = (at[axis] > 0).then(|| at - step);
            for neighbour in [up, down].into_iter().flatten().map(|c| block.index(c)) {
                if values[neighbour as usize].is_none() {
                    values[neighbour as usize] = values[i as usize].clone();
                    next.push_back(neighbour);
                }
            }
        }
    }
    values.into_iter().map(|value| value.unwrap_or_else(|| vec![Vec3A::ZERO; unknowns])).collect()
}

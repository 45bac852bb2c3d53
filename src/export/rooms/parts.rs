//! Which probes share a room.
//!
//! Neighbours along the axes that see each other do, from neighbour to neighbour, but not through openings: where the pairs of
//! neighbours along an axis between two planes of the lattice are seen as a picture, a wall is a patch of pairs that do not
//! see each other, and an opening is a patch of pairs that do, beside a wall of more pairs.

use glam::UVec3;
use rayon::prelude::*;

use crate::export::sight::Sight;
use crate::probe::{ProbeIndex, Volume};

/// Probes of the smallest room that nothing leads to. Fewer stand in pockets: within furniture, under a roof.
const SMALLEST: usize = 4;

/// Probes of the smallest room behind an opening: niches belong to their room.
const SMALLEST_BEHIND: usize = 8;

/// What stands between two neighbouring points of the lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Between {
    /// One of them holds no active probe, or lies beyond the lattice.
    Nothing,
    Air,
    Wall,
    Opening,
}

/// The probes of each room, in the order of their lowest.
pub fn parts(sight: &Sight, volume: &Volume) -> Vec<Vec<usize>> {
    let uniform = volume.grid.uniform();
    let divisions = uniform.divisions();
    // A mixed grid's probes stand for many points.
    let number = |at: UVec3| (at.x + divisions.x * (at.y + divisions.y * at.z)) as usize;
    let probe = |at: UVec3| volume.grid.tree().map_or(number(at), |tree| tree.probe(at) as usize);
    let active = |probe: usize| volume.is_active(ProbeIndex(probe as u32));
    let between = |at: UVec3, axis: usize| {
        let mut next = at;
        next[axis] += 1;
        if next[axis] >= divisions[axis] || !active(probe(at)) || !active(probe(next)) {
            return Between::Nothing;
        }
        let (a, b) = (probe(at), probe(next));
        if a == b || sight.is_free(a, b) { Between::Air } else { Between::Wall }
    };
    let points: Vec<UVec3> = uniform.probes().map(|point| uniform.coordinate(point)).collect();
    let mut pairs: Vec<[Between; 3]> = points.par_iter().map(|&at| [0, 1, 2].map(|axis| between(at, axis))).collect();
    for axis in 0..3 {
        find_openings(&mut pairs, divisions, axis);
    }
    let mut sets = Sets::new(volume.states.len());
    let mut openings = Vec::new();
    for (&at, pairs) in points.iter().zip(&pairs) {
        for (axis, between) in pairs.iter().enumerate() {
            let mut next = at;
            next[axis] += 1;
            match between {
                Between::Air => sets.join(probe(at), probe(next)),
                Between::Opening => openings.push((probe(at), probe(next))),
                Between::Nothing | Between::Wall => {}
            }
        }
    }
    // What is too small behind an opening belongs to what is before it.
    let sizes = sets.sizes();
    for (a, b) in openings {
        if sizes[a].min(sizes[b]) < SMALLEST_BEHIND {
            sets.join(a, b);
        }
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); volume.states.len()];
    for probe in volume.active() {
        members[sets.root(probe)].push(probe);
    }
    members.retain(|own| own.len() >= SMALLEST);
    members
}

/// Marks the pairs along an axis that are openings.
fn find_openings(pairs: &mut [[Between; 3]], divisions: UVec3, axis: usize) {
    let [across, up] = [(axis + 1) % 3, (axis + 2) % 3];
    let (width, height) = (divisions[across] as usize, divisions[up] as usize);
    let stride = UVec3::new(1, divisions.x, divisions.x * divisions.y);
    for layer in 0..divisions[axis] {
        let at = |i: usize| {
            let mut place = UVec3::ZERO;
            (place[axis], place[across], place[up]) = (layer, (i % width) as u32, (i / width) as u32);
            place.dot(stride) as usize
        };
        let picture = Picture {
            width,
            pixels: (0..width * height).map(|i| pairs[at(i)][axis]).collect(),
            links: (0..width * height).map(|i| [across, up].map(|axis| pairs[at(i)][axis] == Between::Air)).collect(),
        };
        for i in picture.openings() {
            pairs[at(i)][axis] = Between::Opening;
        }
    }
}

/// Pairs between two planes of the lattice.
struct Picture {
    width: usize,
    pixels: Vec<Between>,
    /// Whether the first point of a pixel's pair sees that of the next pixel in its row, and in the next row: the air above a
    /// roof is not that below it.
    links: Vec<[bool; 2]>,
}

impl Picture {
    /// Which pixels are openings.
    fn openings(&self) -> Vec<usize> {
        let mut found = Vec::new();
        let mut known = vec![false; self.pixels.len()];
        for start in 0..self.pixels.len() {
            if known[start] || self.pixels[start] != Between::Air {
                continue;
            }
            let (patch, rim) = self.flood(vec![start], Between::Air);
            patch.iter().for_each(|&i| known[i] = true);
            let walls: Vec<usize> = rim.into_iter().filter(|&i| self.pixels[i] == Between::Wall).collect();
            if self.flood(walls, Between::Wall).0.len() > patch.len() {
                found.extend(patch);
            }
        }
        found
    }

    /// The pixels of a kind that are connected to some of it, and those beside them.
    fn flood(&self, start: Vec<usize>, kind: Between) -> (Vec<usize>, Vec<usize>) {
        let mut seen = vec![false; self.pixels.len()];
        start.iter().for_each(|&i| seen[i] = true);
        let (mut patch, mut rim, mut next) = (Vec::new(), Vec::new(), start);
        while let Some(i) = next.pop() {
            patch.push(i);
            let left = (i % self.width > 0).then(|| (i - 1, self.links[i - 1][0]));
            let right = (i % self.width + 1 < self.width).then(|| (i + 1, self.links[i][0]));
            let below = i.checked_sub(self.width).map(|j| (j, self.links[j][1]));
            let above = Some(i + self.width).filter(|&j| j < self.pixels.len()).map(|j| (j, self.links[i][1]));
            for (j, is_linked) in [left, right, below, above].into_iter().flatten() {
                // Walls need no sight along them.
                let is_beside = is_linked || kind == Between::Wall;
                if is_beside && !std::mem::replace(&mut seen[j], true) {
                    if self.pixels[j] == kind { next.push(j) } else { rim.push(j) }
                }
            }
        }
        (patch, rim)
    }
}

/// Disjoint sets of probes.
struct Sets(Vec<usize>);

impl Sets {
    fn new(count: usize) -> Sets {
        Sets((0..count).collect())
    }

    fn root(&mut self, mut probe: usize) -> usize {
        while self.0[probe] != probe {
            self.0[probe] = self.0[self.0[probe]];
            probe = self.0[probe];
        }
        probe
    }

    /// The lower root stays, so that the order makes no difference.
    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b);
    }

    /// Of the set of each probe.
    fn sizes(&mut self) -> Vec<usize> {
        let roots: Vec<usize> = (0..self.0.len()).map(|probe| self.root(probe)).collect();
        let mut counts = vec![0; roots.len()];
        roots.iter().for_each(|&root| counts[root] += 1);
        roots.iter().map(|&root| counts[root]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(rows: &[&str], links: impl Fn(usize) -> [bool; 2]) -> Picture {
        let between = |c: char| match c {
            '.' => Between::Air,
            '#' => Between::Wall,
            _ => Between::Nothing,
        };
        let pixels: Vec<Between> = rows.iter().flat_map(|row| row.chars().map(between)).collect();
        let links = (0..pixels.len()).map(links).collect();
        Picture { width: rows[0].len(), pixels, links }
    }

    fn openings(rows: &[&str]) -> Vec<usize> {
        let mut found = picture(rows, |_| [true; 2]).openings();
        found.sort_unstable();
        found
    }

    #[test]
    fn doors_are_openings_and_passages_are_none() {
        // Two doors in one wall of eight; rows from the floor up.
        assert_eq!(openings(&["      ", " #..# ", " #.## ", " ##.# ", "      "]), [8, 9, 14, 21]);
        // Half of the wall is open.
        assert!(openings(&["..##", "..##"]).is_empty());
        // Air all around a wall is outside of it, and air without any is a room's.
        assert!(openings(&[".....", ".###.", "....."]).is_empty());
        assert!(openings(&["...", "..."]).is_empty());
    }

    #[test]
    fn the_air_above_a_roof_is_not_that_of_a_door_below() {
        let rows = ["######", "###.##", "###.##", "......"];
        assert_eq!(openings(&rows).len(), 8);
        // A roof lies between the third and the fourth row.
        let mut found = picture(&rows, |i| [true, i / 6 != 2]).openings();
        found.sort_unstable();
        assert_eq!(found, [9, 15]);
    }
}

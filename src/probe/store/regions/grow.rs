//! How a cell is divided: greedily, by the plane that leaves the least entropy of masks (Quinlan, *Induction of Decision
//! Trees*, 1986), until what the entries answer is exact.

use glam::{UVec3, Vec3};

use super::super::surface::{Entry, Facing, SurfaceVisibility, voxel_of, voxel_of_key};
use super::words::{AXIS_SHIFT, FAR, LEAF, LOW, NUMBER, Plane, THRESHOLD_SHIFT, words_of};
use crate::probe::lattice::grid::CellIndex;

/// What a part answers: a mask, or one of these.
type Answer = u32;
/// Nothing is seen.
const NOTHING: Answer = 256;
/// Only a probe farther away is seen: this plus its number.
const FARTHER: Answer = 257;

/// How much an entry's answer counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rank {
    /// It is what the surface sees, and has to stay exact.
    Own,
    /// It is what others see, and may be as wrong as the air.
    Lent,
    /// No one asks there.
    Buried,
}

/// A thin wall in a cell, and on which sides of it each of the cell's entries lies: bit 0 below, bit 1 beyond.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    pub plane: Plane,
    pub sides: Vec<u8>,
}

/// Of [`Wall::sides`].
pub const BELOW: u8 = 1;
pub const BEYOND: u8 = 2;

/// A place that a tree answers.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Voxel and facing.
    at: [u8; 4],
    answer: Answer,
    /// Whether a surface asks there: the answer has to be exact. In the air it may be wrong where that saves words.
    is_surface: bool,
    /// By wall, on which sides it lies, two bits each.
    sides: u8,
    /// Number of the answer among those of the part that is being divided.
    number: u32,
}

/// Weights in the entropy. Surfaces count more than the air between them.
const SURFACE_WEIGHT: u32 = 8;
const AIR_WEIGHT: u32 = 1;

/// Most places along an axis of a cell at which the air is asked; each counts once for each facing.
const MOST_PLACES: u32 = 4;

/// Bits of masks in the air that a word of a tree has to mend, see [`grow`]. From 12 to 0 the air's leaks fall by a tenth to a
/// half in the six scenes of [`crate::probe::place`]'s settings, for 1.2 to 1.6 times the bytes; from 12 to 48 `air.leak_dark`
/// nearly doubles, for 0.8 to 0.95 times.
const BITS_PER_WORD: u32 = 12;

/// What a place counts, in bits, that is left none of the probes that it sees: black is worse than any other error.
const BLACK: u32 = 32;

/// Places in the air of a cell, in shares of its sides, x fastest.
pub fn air_places(voxels_per_cell: u32) -> impl Iterator<Item = Vec3> {
    let n = MOST_PLACES.min(voxels_per_cell);
    (0..n.pow(3)).map(move |i| middle(UVec3::new(i % n, i / n % n, i / (n * n)), n))
}

/// The middle of one of n³ equal parts of a cell, in shares of its sides: a little off the planes of round numbers that walls like.
pub fn middle(part: UVec3, n: u32) -> Vec3 {
    /// Shares of a part's side.
    const SHIFT: f32 = 0.01;
    (part.as_vec3() + 0.5 + SHIFT) / n as f32
}

/// What is seen from the air of a cell.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CellAir {
    /// At the [`air_places`]; empty where that is not known.
    pub masks: Vec<u8>,
    /// In the middle of further voxels, none of which has such a place, by key with [`Facing::ALL`]'s first facing.
    pub further: Vec<(u16, u8)>,
}

impl CellAir {
    /// Places that see any probe, with what they see.
    fn places(&self, n: u32) -> impl Iterator<Item = (Vec3, u8)> {
        let further = self.further.iter().map(move |&(key, mask)| (middle(voxel_of_key(key, n), n), mask));
        air_places(n).zip(self.masks.iter().copied()).chain(further).filter(|(_, mask)| *mask != 0)
    }
}

/// Buffers that cells share.
#[derive(Default)]
pub struct Grower {
    /// By key: where a surface asks, one more than its number in the cell; else 0.
    known: Vec<u32>,
    samples: Vec<Sample>,
}

impl Grower {
    /// A cell's tree. `ranks` are those of all entries.
    pub fn tree(
        &mut self,
        table: &SurfaceVisibility,
        cell: CellIndex,
        ranks: &[Rank],
        air: &CellAir,
        walls: &[Wall],
    ) -> Vec<u16> {
        let mut words = Vec::new();
        let range = table.range(cell);
        if range.is_empty() {
            // Where no surface is known everything is seen.
            words.push(LEAF | LOW);
            return words;
        }
        let n = table.voxels_per_cell;
        self.samples.clear();
        self.known.clear();
        self.known.resize(n.pow(3) as usize * 6, 0);
        let sides_of = |entry: usize| walls.iter().rev().fold(0, |sides, wall| sides << 2 | wall.sides[entry]);
        for entry in table.entries(cell) {
            let (facing, answer) = (Facing::of(entry.facing), answer(table, &entry));
            let rank = ranks[entry.index];
            if rank == Rank::Buried {
                continue;
            }
            let own = entry.index - range.start;
            self.known[Self::place(n, entry.voxel, facing)] = own as u32 + 1;
            self.add(entry.voxel, facing, answer, rank == Rank::Own, sides_of(own));
        }
        // Who sees none of the eight is inside of something, or cannot be helped.
        for (place, mask) in air.places(n) {
            let voxel = voxel_of(place, n);
            for facing in Facing::ALL {
                let side = |wall: &Wall| if wall.plane.is_below(place, facing) { BELOW } else { BEYOND };
                let sides = walls.iter().rev().fold(0, |sides, wall| sides << 2 | side(wall));
                // On the other side of a wall a surface says nothing of the air.
                let known = self.known[Self::place(n, voxel, facing)].checked_sub(1);
                let is_here = known.is_some_and(|entry| meet(sides_of(entry as usize), sides, walls.len()));
                if !is_here {
                    self.add(voxel, facing, mask.into(), false, sides);
                }
            }
        }
        if self.samples.is_empty() {
            words.push(LEAF);
        } else {
            grow_between(&mut self.samples, walls, 0, &mut words);
        }
        words
    }

    fn place(n: u32, voxel: UVec3, facing: Facing) -> usize {
        ((voxel.x + n * (voxel.y + n * voxel.z)) * 6) as usize + usize::from(facing.index())
    }

    fn add(&mut self, voxel: UVec3, facing: Facing, answer: Answer, is_surface: bool, sides: u8) {
        let at = [voxel.x as u8, voxel.y as u8, voxel.z as u8, facing.index()];
        self.samples.push(Sample { at, answer, is_surface, sides, number: 0 });
    }
}

/// Whether two things lie on a common side of every wall.
fn meet(a: u8, b: u8, walls: usize) -> bool {
    (0..walls).all(|wall| (a & b) >> (2 * wall) & 3 != 0)
}

/// Appends the tree of some samples, divided by the walls from the `first` on where these tell different answers apart.
fn grow_between(samples: &mut [Sample], walls: &[Wall], first: usize, words: &mut Vec<u16>) {
    let Some(wall) = walls.get(first) else {
        grow(samples, words);
        return;
    };
    let on = |side: u8| -> Vec<Sample> {
        samples.iter().filter(|sample| sample.sides >> (2 * first) & side != 0).copied().collect()
    };
    let (mut below, mut beyond) = (on(BELOW), on(BEYOND));
    if End::of(samples).is_some_and(|end| end.wrong == 0) || below.is_empty() || beyond.is_empty() {
        grow_between(samples, walls, first + 1, words);
        return;
    }
    let own = words.len();
    words.extend(wall.plane.words());
    grow_between(&mut below, walls, first + 1, words);
    set_distance(words, own, wall.plane.words().len());
    grow_between(&mut beyond, walls, first + 1, words);
}

/// Writes how far it is from the word at `own`, of a head of so many words, to the end.
fn set_distance(words: &mut Vec<u16>, own: usize, head: usize) {
    let distance = words.len() - own;
    if distance <= usize::from(LOW) {
        words[own] |= distance as u16;
    } else {
        let number = words_of((distance + NUMBER) as u32);
        words.splice(own + head..own + head, number);
    }
}

fn answer(table: &SurfaceVisibility, entry: &Entry) -> Answer {
    match (entry.mask, table.far_probe(entry.index)) {
        (0, Some(probe)) => FARTHER + probe.0,
        (0, None) => NOTHING,
        (mask, _) => Answer::from(mask),
    }
}

/// Appends the tree of some samples. Parts that differ in the air alone are put together again where telling them apart mends
/// less than [`BITS_PER_WORD`] (cost-complexity pruning: Breiman et al., *Classification and Regression Trees*, 1984).
///
/// Returns the bits that are wrong in the air.
fn grow(samples: &mut [Sample], words: &mut Vec<u16>) -> u32 {
    let end = End::of(samples);
    if let Some(end) = end.filter(|end| end.wrong == 0) {
        end.push(words);
        return 0;
    }
    let (axis, threshold) = plane(samples, end.is_none());
    let below = partition(samples, |sample| sample.at[axis] < threshold);
    let (below, beyond) = samples.split_at_mut(below);
    let own = words.len();
    words.push((axis as u16) << AXIS_SHIFT | u16::from(threshold) << THRESHOLD_SHIFT);
    let mut wrong = grow(below, words);
    set_distance(words, own, 1);
    wrong += grow(beyond, words);
    let Some(end) = end else { return wrong };
    let saved = words.len() as u32 - own as u32 - end.words();
    if end.wrong > wrong + saved * BITS_PER_WORD {
        return wrong;
    }
    words.truncate(own);
    end.push(words);
    end.wrong
}

/// A part that is not divided.
#[derive(Debug, Clone, Copy)]
struct End {
    answer: Answer,
    /// In the air, bits.
    wrong: u32,
}

impl End {
    /// The part of some samples: it answers as its surfaces do, and without any as most of its air. `None` where the surfaces
    /// differ.
    fn of(samples: &[Sample]) -> Option<End> {
        let answers = |is_surface: bool| samples.iter().filter(move |s| s.is_surface == is_surface).map(|s| s.answer);
        let mut surfaces = answers(true);
        let answer = match surfaces.next() {
            Some(first) => surfaces.all(|answer| answer == first).then_some(first)?,
            None => most(answers(false))?,
        };
        let given = mask(answer);
        let wrong_of = |seen: Answer| match mask(seen) {
            seen if seen & given == 0 => BLACK,
            seen => (seen ^ given).count_ones(),
        };
        Some(End { answer, wrong: answers(false).map(wrong_of).sum() })
    }

    fn words(&self) -> u32 {
        if self.answer >= FARTHER { 1 + NUMBER as u32 } else { 1 }
    }

    fn push(&self, words: &mut Vec<u16>) {
        match self.answer {
            NOTHING => words.push(LEAF),
            FARTHER.. => {
                words.push(LEAF | FAR);
                words.extend(words_of(self.answer - FARTHER));
            }
            mask => words.push(LEAF | mask as u16),
        }
    }
}

/// The most frequent of some masks.
fn most(masks: impl Iterator<Item = Answer>) -> Option<Answer> {
    let mut counts = [0u32; 256];
    masks.for_each(|mask| counts[mask as usize & 0xff] += 1);
    let most = (0..=u8::MAX).max_by_key(|&mask| (counts[usize::from(mask)], mask))?;
    (counts[usize::from(most)] > 0).then_some(most.into())
}

fn mask(answer: Answer) -> u8 {
    if answer < NOTHING { answer as u8 } else { 0 }
}

/// Moves those that hold to the front; returns how many these are.
fn partition(samples: &mut [Sample], holds: impl Fn(&Sample) -> bool) -> usize {
    let mut count = 0;
    for i in 0..samples.len() {
        if holds(&samples[i]) {
            samples.swap(i, count);
            count += 1;
        }
    }
    count
}

/// Axis and threshold that leave the least entropy, with samples on both sides, and not of the air alone where `is_surface`.
fn plane(samples: &mut [Sample], is_surface: bool) -> (usize, u8) {
    let mut answers: Vec<Answer> = samples.iter().map(|sample| sample.answer).collect();
    answers.sort_unstable();
    answers.dedup();
    for sample in samples.iter_mut() {
        sample.number = answers.partition_point(|&answer| answer < sample.answer) as u32;
    }
    let mut best = (f64::INFINITY, 0, 1);
    for axis in 0..4 {
        let size = 1 + samples.iter().map(|sample| usize::from(sample.at[axis])).max().unwrap_or(0);
        let mut counts = vec![0u32; size * answers.len()];
        let mut sides = vec![0u32; size];
        for sample in samples.iter() {
            let place = usize::from(sample.at[axis]);
            sides[place] += u32::from(sample.is_surface || !is_surface);
            counts[place * answers.len() + sample.number as usize] +=
                if sample.is_surface { SURFACE_WEIGHT } else { AIR_WEIGHT };
        }
        let (mut below, mut beyond) = (Tally::new(answers.len()), Tally::new(answers.len()));
        for of_place in counts.chunks(answers.len()) {
            of_place.iter().enumerate().for_each(|(i, &count)| beyond.change(i, count, u32::wrapping_add));
        }
        let (mut count_below, count_all) = (0, sides.iter().sum::<u32>());
        for (place, of_place) in counts.chunks(answers.len()).enumerate() {
            if count_below > 0 && count_below < count_all {
                let left = below.entropy() + beyond.entropy();
                // Sums of logarithms carry rounding: equal planes are to stay equal.
                if left < best.0 - 1e-6 {
                    best = (left, axis, place as u8);
                }
            }
            count_below += sides[place];
            for (i, &count) in of_place.iter().enumerate().filter(|(_, count)| **count > 0) {
                below.change(i, count, u32::wrapping_add);
                beyond.change(i, count, u32::wrapping_sub);
            }
        }
    }
    (best.1, within_gap(samples, best.1, best.2))
}

/// Where a plane lies best in the gap of samples that it is in: next to a surface, for the air goes on up to it, or else in the
/// middle.
fn within_gap(samples: &[Sample], axis: usize, threshold: u8) -> u8 {
    // The nearest sample on either side, and whether a surface is among those there.
    let (mut below, mut beyond) = ((0, false), (u8::MAX, false));
    for sample in samples {
        let (at, is_surface) = (sample.at[axis], sample.is_surface);
        if at < threshold {
            below = below.max((at, is_surface));
        } else if at < beyond.0 || at == beyond.0 && is_surface {
            beyond = (at, is_surface);
        }
    }
    match (below.1, beyond.1) {
        (true, false) => below.0 + 1,
        (false, true) => beyond.0,
        _ => (below.0 + 1 + beyond.0) / 2,
    }
}

/// Weights of the answers on one side of a plane.
struct Tally {
    counts: Vec<u32>,
    all: u32,
    /// Σ c·log₂ c.
    sum: f64,
}

impl Tally {
    fn new(answers: usize) -> Tally {
        Tally { counts: vec![0; answers], all: 0, sum: 0.0 }
    }

    fn change(&mut self, answer: usize, by: u32, how: fn(u32, u32) -> u32) {
        let count = &mut self.counts[answer];
        self.sum -= scaled_logarithm(*count);
        (*count, self.all) = (how(*count, by), how(self.all, by));
        self.sum += scaled_logarithm(*count);
    }

    /// Entropy times weight, bits.
    fn entropy(&self) -> f64 {
        scaled_logarithm(self.all) - self.sum
    }
}

fn scaled_logarithm(count: u32) -> f64 {
    let count = f64::from(count);
    if count > 0.0 { count * count.log2() } else { 0.0 }
}

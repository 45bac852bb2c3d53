//! How a cell is divided: greedily, by the plane that leaves the least entropy of masks (Quinlan, *Induction of Decision
//! Trees*, 1986), until what the entries answer is exact.

use glam::{IVec3, UVec3, Vec3};

use super::super::surface::{Entry, Facing, SurfaceVisibility};
use super::{AXIS_SHIFT, FAR, LEAF, LOW, THRESHOLD_SHIFT, words_of};
use crate::probe::lattice::grid::CellIndex;

/// What a part answers: a mask, or one of these.
type Answer = u32;
/// Nothing is seen.
const NOTHING: Answer = 256;
/// Only a probe farther away is seen: this plus its number.
const FARTHER: Answer = 257;

/// A place that a tree answers.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Voxel and facing.
    at: [u8; 4],
    answer: Answer,
    /// Whether the answer has to be exact. The others only decide between planes.
    is_entry: bool,
    /// Number of the answer among those of the part that is being divided.
    number: u32,
}

/// Weights in the entropy. A surface counts more than what merely lies between surfaces: at 1 to 1 trees of two_rooms_open
/// are a third larger.
const ENTRY_WEIGHT: u32 = 8;
const OTHER_WEIGHT: u32 = 1;

/// Places along an axis at which voxels without a surface are sampled.
const OTHER_PLACES: u32 = 4;

/// The nearest entry that faces the same way counts before all others within so many voxels, as in look-ups of the table.
const REACH: f32 = 3.0;

/// Buffers that cells share.
#[derive(Default)]
pub struct Grower {
    /// By key: whether there is a sample that has to be exact.
    is_known: Vec<bool>,
    samples: Vec<Sample>,
}

impl Grower {
    /// A cell's tree.
    pub fn tree(&mut self, table: &SurfaceVisibility, cell: CellIndex) -> Vec<u16> {
        let mut words = Vec::new();
        let entries: Vec<Entry> = table.entries(cell).collect();
        if entries.is_empty() {
            // Where no surface is known everything is seen.
            words.push(LEAF | LOW);
            return words;
        }
        let n = table.voxels_per_cell;
        self.samples.clear();
        self.is_known.clear();
        self.is_known.resize(n.pow(3) as usize * 6, false);
        for entry in &entries {
            self.add(n, entry.voxel, entry.facing, answer(table, entry));
        }
        // Where an entry sees nothing, points close to its border ask beside, but only what surfaces answer there.
        for entry in entries.iter().filter(|entry| entry.mask == 0) {
            for neighbour in neighbours(entry.voxel, n) {
                self.add(n, neighbour, entry.facing, answer(table, entry));
            }
        }
        self.add_others(n, &entries);
        let samples = &mut self.samples;
        grow(samples, &mut words);
        words
    }

    fn place(n: u32, voxel: UVec3, facing: Facing) -> usize {
        ((voxel.x + n * (voxel.y + n * voxel.z)) * 6) as usize + usize::from(facing.index())
    }

    /// A sample that has to be exact, where there is none.
    fn add(&mut self, n: u32, voxel: UVec3, facing: Vec3, answer: Answer) {
        let facing = Facing::of(facing);
        let is_known = &mut self.is_known[Self::place(n, voxel, facing)];
        if !std::mem::replace(is_known, true) {
            self.samples.push(Sample { at: at(voxel, facing), answer, is_entry: true, number: 0 });
        }
    }

    /// Voxels between the surfaces see about what the nearest entry sees that faces them: of the same facing, or of any.
    /// Nothing stands between the two but other surfaces that face the voxel, which are nearer.
    fn add_others(&mut self, n: u32, entries: &[Entry]) {
        let step = n.div_ceil(OTHER_PLACES).max(1);
        let along = || (0..n).skip(step as usize / 2).step_by(step as usize);
        let places = along().flat_map(|z| along().flat_map(move |y| along().map(move |x| UVec3::new(x, y, z))));
        for voxel in places {
            let mut own = [(f32::INFINITY, 0u8); 6];
            let mut any = (f32::INFINITY, u8::MAX);
            for entry in entries.iter().filter(|entry| entry.mask != 0) {
                let way = voxel.as_vec3() - entry.voxel.as_vec3();
                let distance = way.length_squared();
                // Within a voxel the surface may lie on either side.
                if way.dot(entry.facing) < -0.5 {
                    continue;
                }
                let own = &mut own[usize::from(Facing::of(entry.facing).index())];
                if distance < own.0 && distance <= REACH * REACH {
                    *own = (distance, entry.mask);
                }
                if distance < any.0 {
                    any = (distance, entry.mask);
                }
            }
            for facing in Facing::all().filter(|&facing| !self.is_known[Self::place(n, voxel, facing)]) {
                let (distance, mask) = own[usize::from(facing.index())];
                let answer = Answer::from(if distance.is_finite() { mask } else { any.1 });
                self.samples.push(Sample { at: at(voxel, facing), answer, is_entry: false, number: 0 });
            }
        }
    }
}

fn at(voxel: UVec3, facing: Facing) -> [u8; 4] {
    [voxel.x as u8, voxel.y as u8, voxel.z as u8, facing.index()]
}

fn answer(table: &SurfaceVisibility, entry: &Entry) -> Answer {
    match (entry.mask, table.far_probe(entry.index)) {
        (0, Some(probe)) => FARTHER + probe.0,
        (0, None) => NOTHING,
        (mask, _) => Answer::from(mask),
    }
}

/// The up to 26 voxels around one within its cell.
fn neighbours(voxel: UVec3, n: u32) -> impl Iterator<Item = UVec3> {
    let offset = |i: i32| IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    let inside = move |v: &IVec3| v.cmpge(IVec3::ZERO).all() && v.cmplt(IVec3::splat(n as i32)).all();
    let all = (0..27).filter(|&i| i != 13).map(move |i| voxel.as_ivec3() + offset(i));
    all.filter(inside).map(|v| v.as_uvec3())
}

/// Appends the tree of some samples, of which at least one has to be exact.
fn grow(samples: &mut [Sample], words: &mut Vec<u16>) {
    let mut entries = samples.iter().filter(|sample| sample.is_entry).map(|sample| sample.answer);
    let first = entries.next().unwrap_or(Answer::from(u8::MAX));
    if entries.all(|answer| answer == first) {
        match first {
            NOTHING => words.push(LEAF),
            FARTHER.. => {
                words.push(LEAF | FAR);
                words.extend(words_of(first - FARTHER));
            }
            mask => words.push(LEAF | mask as u16),
        }
        return;
    }
    let (axis, threshold) = plane(samples);
    let below = partition(samples, |sample| sample.at[axis] < threshold);
    let (below, beyond) = samples.split_at_mut(below);
    let own = words.len();
    words.push((axis as u16) << AXIS_SHIFT | u16::from(threshold) << THRESHOLD_SHIFT);
    grow(below, words);
    let distance = words.len() - own;
    if distance <= usize::from(LOW) {
        words[own] |= distance as u16;
    } else {
        let number = words_of(distance as u32 + 2);
        words.splice(own + 1..own + 1, number);
    }
    grow(beyond, words);
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

/// Axis and threshold that leave the least entropy, with samples that have to be exact on both sides.
fn plane(samples: &mut [Sample]) -> (usize, u8) {
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
        let mut entries = vec![0u32; size];
        for sample in samples.iter() {
            let place = usize::from(sample.at[axis]);
            entries[place] += u32::from(sample.is_entry);
            counts[place * answers.len() + sample.number as usize] +=
                if sample.is_entry { ENTRY_WEIGHT } else { OTHER_WEIGHT };
        }
        let (mut below, mut beyond) = (Tally::new(answers.len()), Tally::new(answers.len()));
        for of_place in counts.chunks(answers.len()) {
            of_place.iter().enumerate().for_each(|(i, &count)| beyond.change(i, count, u32::wrapping_add));
        }
        let (mut entries_below, entries_all) = (0, entries.iter().sum::<u32>());
        for (place, of_place) in counts.chunks(answers.len()).enumerate() {
            if entries_below > 0 && entries_below < entries_all {
                let left = below.entropy() + beyond.entropy();
                // Sums of logarithms carry rounding: equal planes are to stay equal.
                if left < best.0 - 1e-6 {
                    best = (left, axis, place as u8);
                }
            }
            entries_below += entries[place];
            for (i, &count) in of_place.iter().enumerate().filter(|(_, count)| **count > 0) {
                below.change(i, count, u32::wrapping_add);
                beyond.change(i, count, u32::wrapping_sub);
            }
        }
    }
    (best.1, best.2)
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

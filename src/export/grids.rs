//! Blocks of probes with the values that an engine stores, asked and fitted by its look-up.

use glam::{DVec3, Vec3, Vec3A};

use super::block::Block;
use super::rules::Rules;
use crate::math::harmonics;
use crate::math::octahedral::oct_from_direction;
use crate::probe::fit::points::Asked;
use crate::probe::fit::rows::{Row, Rows};
use crate::probe::fit::{Fitted, ROUNDS, RowSettings, firmness, solve};
use crate::probe::query::{Answers, CornerWeights, Part, QueryPoint, Visibility};
use crate::probe::{Grid, ProbeIndex};

#[derive(Debug, Clone, PartialEq)]
pub struct Grids {
    pub rules: Rules,
    /// The lattice that they were made from.
    pub grid: Grid,
    /// In the order in which an engine that takes the last one looks at them.
    pub blocks: Vec<Block>,
    /// Of all probes, relative to the scene's origin, metres.
    pub positions: Vec<Vec3>,
    /// [`Rules::unknowns`] a probe, W·m⁻²: irradiance along the axes +x, −x, +y, −y, +z, −z, or coefficients of irradiance
    /// times Y₀ in the order of [`harmonics`].
    pub values: Vec<Vec3A>,
}

/// The most that a probe holds.
const MOST: usize = harmonics::COUNT;

impl Grids {
    /// Black blocks.
    pub fn new(rules: Rules, grid: Grid, blocks: Vec<Block>) -> Grids {
        let positions: Vec<Vec3> = blocks.iter().flat_map(|block| block.positions()).collect();
        let values = vec![Vec3A::ZERO; positions.len() * rules.unknowns()];
        Grids { rules, grid, blocks, positions, values }
    }

    /// Of one probe.
    pub fn of_probe(&self, probe: usize) -> &[Vec3A] {
        let n = self.rules.unknowns();
        &self.values[probe * n..][..n]
    }

    pub fn set_probe(&mut self, probe: usize, values: &[Vec3A]) {
        let n = self.rules.unknowns();
        self.values[probe * n..][..n].copy_from_slice(values);
    }

    /// The same, relative to another origin.
    pub fn relative_to(&self, origin_world: DVec3) -> Grids {
        let (grid, shift) = self.grid.relative_to(origin_world);
        let mut moved = Grids { grid, ..self.clone() };
        moved.blocks.iter_mut().for_each(|block| block.first += shift);
        moved.positions.iter_mut().for_each(|position| *position += shift);
        moved
    }

    /// Where a point is read: the block that counts most, and how much all count.
    fn main_block(&self, point: &QueryPoint) -> Option<(&Block, Vec3)> {
        let read = |block| {
            let place = self.rules.place(block, point.position, point.normal);
            (block, place, self.rules.share(block, place))
        };
        if self.rules.takes_last() {
            return self
                .blocks
                .iter()
                .rev()
                .map(read)
                .find(|(.., share)| *share > 0.0)
                .map(|(block, place, _)| (block, place));
        }
        let found = self.blocks.iter().map(read).filter(|(.., share)| *share > 0.0);
        found.max_by(|a, b| a.2.total_cmp(&b.2)).map(|(block, place, _)| (block, place))
    }

    /// Calls `add(probe, share)` for all probes that answer a point; their shares sum to 1. Calls it never where none does.
    fn each_share(&self, point: &QueryPoint, mut add: impl FnMut(ProbeIndex, f32)) {
        let mut of_block = |block: &Block, place: Vec3, share: f32| {
            let (probes, weights) = block.corners(place);
            let counted = probes.into_iter().zip(weights).filter(|(_, weight)| *weight > 0.0);
            counted.for_each(|(probe, weight)| add(probe, weight * share));
        };
        if self.rules.takes_last() {
            if let Some((block, place)) = self.main_block(point) {
                of_block(block, place, 1.0);
            }
            return;
        }
        let read = |block: &Block| {
            let place = self.rules.place(block, point.position, point.normal);
            (place, self.rules.share(block, place))
        };
        let total: f32 = self.blocks.iter().map(|block| read(block).1).sum();
        for block in &self.blocks {
            let (place, share) = read(block);
            if share > 0.0 {
                of_block(block, place, share / total);
            }
        }
    }

    /// What the rules take of a probe's values around a direction.
    fn around(&self, normal: Vec3) -> [f32; MOST] {
        let mut taken = [0.0; MOST];
        self.rules.factors().each(oct_from_direction(normal), Vec3::ZERO, |unknown, factor| taken[unknown] += factor);
        taken
    }

    #[inline]
    fn sum(&self, probe: ProbeIndex, taken: &[f32; MOST]) -> Vec3A {
        self.of_probe(probe.0 as usize).iter().zip(taken).map(|(value, factor)| *value * *factor).sum()
    }
}

impl Answers for Grids {
    fn grid(&self) -> &Grid {
        &self.grid
    }

    fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    fn is_active(&self, _: ProbeIndex) -> bool {
        true
    }

    fn corners(&self, point: &QueryPoint) -> [ProbeIndex; 8] {
        self.main_block(point).map_or([ProbeIndex(0); 8], |(block, place)| block.corners(place).0)
    }

    /// Those of the block that counts most.
    fn weights(&self, point: &QueryPoint, visibility: Visibility) -> CornerWeights {
        let Some((block, place)) = self.main_block(point) else {
            return CornerWeights { probes: [ProbeIndex(0); 8], weights: [0.0; 8] };
        };
        let (probes, mut weights) = block.corners(place);
        if let Visibility::Exact(mask) = visibility {
            weights.iter_mut().enumerate().filter(|(i, _)| mask >> i & 1 == 0).for_each(|(_, weight)| *weight = 0.0);
        }
        CornerWeights { probes, weights }
    }

    fn irradiance(&self, point: &QueryPoint, visibility: Visibility) -> Vec3 {
        let taken = self.around(point.normal);
        let mut sum = Vec3A::ZERO;
        match visibility {
            Visibility::Exact(_) => {
                let corners = self.weights(point, visibility);
                for (corner, share) in corners.shares().into_iter().flatten() {
                    sum += self.sum(corners.probes[corner], &taken) * share;
                }
            }
            Visibility::Off | Visibility::Stored => {
                self.each_share(point, |probe, share| sum += self.sum(probe, &taken) * share);
            }
        }
        self.rules.shown(sum.into())
    }

    fn probe_irradiance(&self, probe: ProbeIndex, normal: Vec3) -> Vec3 {
        self.rules.shown(self.sum(probe, &self.around(normal)).into())
    }

    fn knows_walls(&self) -> bool {
        false
    }
}

impl Fitted for Grids {
    fn look_up(&self) -> impl Answers {
        self
    }

    fn row(&self, asked: &Asked, target: Vec3) -> Row {
        let oct = oct_from_direction(asked.query.normal);
        let mut parts = Vec::with_capacity(8);
        self.each_share(&asked.query, |probe, share| parts.push(Part { probe, share, oct, offset: Vec3::ZERO }));
        Row { parts, target, noise: 0.0, weight: asked.weight, kind: asked.kind }
    }

    fn solve(&mut self, rows: Vec<Row>, settings: &RowSettings) -> u32 {
        let (factors, unknowns) = (self.rules.factors(), self.rules.unknowns());
        let mut rows = Rows::new(&factors, self.positions.len(), unknowns, rows.into_iter());
        let lambda = firmness(&rows, &factors, &self.values, settings.lambda);
        let (prior, iterations) = (&self.values, settings.iterations);
        let is_signed = self.rules.is_signed();
        // Beside a wall with light behind it least squares go below 0, where the shader shows black.
        let mut task = solve::Task { rows: &mut rows, prior, lambda, iterations, lightens: is_signed };
        let solved = task.solve(if is_signed { 0 } else { ROUNDS });
        let asked = rows.asked();
        for (p, values) in solved.values.chunks(unknowns).enumerate().filter(|(p, _)| asked[*p]) {
            self.set_probe(p, values);
        }
        solved.iterations
    }
}

//! A ray on its way through what one probe sees (McGuire, Mara, Nowrouzezahrai & Luebke, *Real-Time Global Illumination using
//! Precomputed Light Field Probes*, I3D 2017).
//!
//! Seen from the probe, a ray is a path over its octahedral map: a straight line in each octant, of which it crosses at most
//! four. The march follows it over the level of lowest distances, and where these are below the ray's own distance from the
//! probe, over the texels below:
//!
//! * the ray stays before what the probe sees: the texel is clear;
//! * it goes behind, by no more than the surface is taken to be thick, and the surface faces it: a **hit**;
//! * it goes behind, and nothing is known of what is there: **unknown**, from the texel's beginning on;
//! * it ends, everything being clear: a **miss**.
//!
//! # Most reads
//!
//! Whatever the maps hold, a march over R² texels with a level of M² reads at most [`most_reads`]
//! `= 4·(2⌈M/2⌉ − 1)·2·R/M` of them: less than `8·R` where M is even. The three planes through the probe divide a ray into at
//! most four parts. Each lies in one quarter of the map, ⌈M/2⌉ texels of the level wide and high. Every step goes to the next
//! column or to the next row, always in the same two directions, and ends where it would leave the quarter: a quarter of n
//! columns and n rows is left after at most 2n − 1 texels. Below each of them lie R/M columns and rows, of which the same rule
//! reads at most 2·R/M − 1; with the one above them these are 2·R/M. Nothing in this depends on how numbers are rounded.
//! [`super::trace`] has the bound of a whole ray.

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::math::octahedral::{direction_from_oct, texel_direction};
use crate::probe::store::radiance::LightField;

/// How rays are traced in light fields.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TraceSettings {
    /// Least thickness that a surface is taken to have, and most, in spacings. The source has metres, 0.03 and 0.5, in rooms
    /// whose probes stand some metres apart.
    pub thinnest: f32,
    pub thickest: f32,
    /// The joint bilateral filter over the picture: texels on either side, and how far apart those are that count.
    pub radius: u32,
    pub step: u32,
}

impl Default for TraceSettings {
    /// The source's filter for glossy light.
    fn default() -> Self {
        TraceSettings { thinnest: 0.03, thickest: 0.5, radius: 3, step: 1 }
    }
}

impl TraceSettings {
    /// Calls `rule(section, value, holds, rule)` for every number in it.
    pub fn check(&self, section: &'static str, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        let holds = (0.0..=self.thickest).contains(&self.thinnest) && self.thickest <= 1e3;
        let value = format!("(thinnest: {}, thickest: {})", self.thinnest, self.thickest);
        rule(section, value, holds, "use 0 to 1000 spacings, thinnest not above thickest");
        let value = format!("(radius: {}, step: {})", self.radius, self.step);
        let holds = self.radius <= 64 && (1..=16).contains(&self.step);
        rule(section, value, holds, "use a radius of 0 to 64 pixels and a step of 1 to 16");
    }
}

/// What a march found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// A surface, at this distance along the ray, in this texel.
    Hit { t: f32, texel: usize },
    /// Nothing, up to the ray's end.
    Miss,
    /// The ray is clear up to this distance, and what comes then the probe does not see.
    Unknown { clear: f32 },
}

/// Who is told which texels are read.
pub trait Watch {
    /// Of the level of lowest distances.
    fn coarse(&mut self, column: usize, row: usize);

    fn fine(&mut self, column: usize, row: usize);
}

/// How many texels are read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Reads {
    pub coarse: u64,
    pub fine: u64,
}

impl Watch for Reads {
    #[inline]
    fn coarse(&mut self, _: usize, _: usize) {
        self.coarse += 1;
    }

    #[inline]
    fn fine(&mut self, _: usize, _: usize) {
        self.fine += 1;
    }
}

/// A ray relative to a probe, from one distance along it to another, both finite.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    pub origin: Vec3,
    /// Unit.
    pub direction: Vec3,
    pub from: f32,
    pub to: f32,
}

/// Surfaces' thickness, metres.
#[derive(Debug, Clone, Copy)]
pub struct Thickness {
    pub thinnest: f32,
    pub thickest: f32,
    /// The source's metre: the length that distances along the ray are measured in, metres.
    pub unit: f32,
}

impl Thickness {
    /// Of a surface with the unit normal `normal` in the unit direction `seen` from the probe, for a ray that has come so far:
    /// the more, the more the ray goes away from the probe, the flatter it meets the surface, and the farther it has come.
    #[inline]
    fn of(&self, ray: Vec3, seen: Vec3, normal: Vec3, t: f32) -> f32 {
        let farther = (0.1 * t / self.unit).clamp(0.05, 1.0);
        let along = ray.dot(seen).max(0.0) * (2.0 - ray.dot(normal).abs());
        self.thinnest + (self.thickest - self.thinnest) * along * farther
    }
}

/// The maps of one probe.
#[derive(Clone, Copy)]
pub struct Maps<'a> {
    distance: &'a [f32],
    normal: &'a [Vec2],
    lowest: &'a [f32],
    /// Texels per side.
    side: usize,
    /// Of the level of lowest distances; divides `side`.
    coarse: usize,
}

impl<'a> Maps<'a> {
    /// Those of a probe; `None` where rays cannot march through the light field.
    pub fn of(field: &'a LightField, probe: usize) -> Option<Maps<'a>> {
        let lowest = field.lowest.as_ref()?;
        Some(Maps {
            distance: field.distance.probe(probe),
            normal: field.normal.probe(probe),
            lowest: lowest.probe(probe),
            side: field.distance.resolution,
            coarse: lowest.resolution,
        })
    }

    /// The march of a ray.
    pub fn march(&self, span: &Span, thickness: &Thickness, watch: &mut impl Watch) -> Step {
        let (ends, count) = octants(span);
        for pair in ends[..count].windows(2) {
            let Some(line) = Line::new(span, pair[0], pair[1]) else { continue };
            if let Some(step) = self.follow(&line, span, thickness, watch) {
                return step;
            }
        }
        Step::Miss
    }

    /// Follows a line over the coarse level.
    fn follow(&self, line: &Line, span: &Span, thickness: &Thickness, watch: &mut impl Watch) -> Option<Step> {
        let (low, size) = line.quarter(self.coarse);
        let mut cells = Cells::new(line, self.coarse, (0.0, 1.0), low, size);
        let mut before = span.distance(line.from);
        while let Some(Cell { column, row, to, .. }) = cells.current {
            watch.coarse(column, row);
            let after = span.distance(line.along(to));
            let from = cells.current.map_or(0.0, |cell| cell.from);
            if self.lowest[column + self.coarse * row] <= before.max(after) {
                let below = self.side / self.coarse;
                let fine = Cells::new(line, self.side, (from, to), [column * below, row * below], below);
                if let Some(step) = self.look_closer(fine, line, span, thickness, watch) {
                    return Some(step);
                }
            }
            before = after;
            cells.advance();
        }
        None
    }

    /// Follows a part of a line over the texels of one coarse one.
    fn look_closer(
        &self,
        mut cells: Cells,
        line: &Line,
        span: &Span,
        thickness: &Thickness,
        watch: &mut impl Watch,
    ) -> Option<Step> {
        let mut t_before = cells.current.map_or(line.from, |cell| line.along(cell.from));
        let mut before = span.distance(t_before);
        while let Some(Cell { column, row, to, .. }) = cells.current {
            watch.fine(column, row);
            let t_after = line.along(to);
            let after = span.distance(t_after);
            let texel = column + self.side * row;
            let seen = self.distance[texel];
            if before.max(after) >= seen {
                let direction = texel_direction(column, row, self.side);
                let normal = direction_from_oct(self.normal[texel]);
                let t = (direction * seen - span.origin).dot(span.direction);
                let thick = thickness.of(span.direction, direction, normal, t);
                let is_hit = before.min(after) < seen + thick && normal.dot(span.direction) < 0.0;
                return Some(if is_hit { Step::Hit { t, texel } } else { Step::Unknown { clear: t_before } });
            }
            (t_before, before) = (t_after, after);
            cells.advance();
        }
        None
    }
}

impl Span {
    #[inline]
    fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }

    /// From the probe to the ray at a distance along it.
    #[inline]
    fn distance(&self, t: f32) -> f32 {
        self.at(t).length()
    }
}

/// Most texels that a march reads of maps of `side`² texels with a level of `coarse`²; derived in the module's text.
pub fn most_reads(side: usize, coarse: usize) -> u64 {
    let lines = 2 * coarse.div_ceil(2) - 1;
    4 * (lines * 2 * (side / coarse)) as u64
}

/// Distances along a ray between which it stays in one octant around the probe, in ascending order: at most five.
fn octants(span: &Span) -> ([f32; 5], usize) {
    let mut ends = [span.from; 5];
    let mut count = 1;
    for axis in 0..3 {
        let t = -span.origin[axis] / span.direction[axis];
        if t > span.from && t < span.to {
            ends[count] = t;
            count += 1;
        }
    }
    ends[1..count].sort_unstable_by(f32::total_cmp);
    ends[count] = span.to;
    (ends, count + 1)
}

/// A part of a ray within one octant, as a line over the map.
struct Line {
    /// Distances along the ray.
    from: f32,
    to: f32,
    /// Sums of the absolute coordinates at both ends.
    sizes: [f32; 2],
    /// Both ends in the map, 0 to 1.
    start: Vec2,
    step: Vec2,
    /// Whether its quarter of the map is the upper half along each axis.
    upper: [bool; 2],
}

impl Line {
    /// `None` where the part has no length, or is not finite.
    fn new(span: &Span, from: f32, to: f32) -> Option<Line> {
        if from.partial_cmp(&to) != Some(std::cmp::Ordering::Less) {
            return None;
        }
        let middle = span.at(from + 0.5 * (to - from));
        let signs = Vec3::select(middle.cmpge(Vec3::ZERO), Vec3::ONE, Vec3::NEG_ONE);
        // Ends on the octant's faces stay in it.
        let ends = [from, to].map(|t| (span.at(t) * signs).max(Vec3::ZERO));
        let sizes = ends.map(Vec3::element_sum);
        let place = |i: usize| {
            let other = 1 - i;
            // The probe itself lies in no direction: the ray's other end tells.
            let p = if sizes[i] > 0.0 { ends[i] / sizes[i] } else { ends[other] / sizes[other] };
            let folded = if signs.z >= 0.0 { p.truncate() } else { Vec2::new(1.0 - p.y, 1.0 - p.x) };
            folded * signs.truncate() * 0.5 + 0.5
        };
        let (start, end) = (place(0), place(1));
        let upper = [signs.x > 0.0, signs.y > 0.0];
        (start.is_finite() && end.is_finite()).then_some(Line { from, to, sizes, start, step: end - start, upper })
    }

    /// The quarter of a map of `side`² texels that the line lies in: its lowest texel, and its sides. Where `side` is odd, the
    /// texels in the middle belong to all that they meet.
    fn quarter(&self, side: usize) -> ([usize; 2], usize) {
        (self.upper.map(|upper| if upper { side / 2 } else { 0 }), side.div_ceil(2))
    }

    /// Distance along the ray of a point of the line, 0 to 1. In its plane the map is a projection: a point (1 − u)a + u·b of
    /// the ray lies at u·|b|/((1 − u)·|a| + u·|b|) of the line, |·| the sum of the absolute coordinates.
    #[inline]
    fn along(&self, place: f32) -> f32 {
        let [a, b] = self.sizes;
        let sum = (1.0 - place) * b + place * a;
        let u = if sum > 0.0 { (place * a / sum).clamp(0.0, 1.0) } else { place };
        self.from + (self.to - self.from) * u
    }
}

/// A texel that a line crosses, and from where to where it does.
#[derive(Debug, Clone, Copy)]
struct Cell {
    column: usize,
    row: usize,
    from: f32,
    to: f32,
}

/// The texels that a line crosses, one after another (Amanatides & Woo, *A Fast Voxel Traversal Algorithm*, 1987): each step
/// goes to the next column or row, within a block of texels, so that it ends.
struct Cells {
    current: Option<Cell>,
    end: f32,
    /// Per axis: the texel, the step to the next, and where on the line the next begins; and how that goes on.
    at: [isize; 2],
    step: [isize; 2],
    next: [f32; 2],
    per_texel: [f32; 2],
    low: [isize; 2],
    size: isize,
}

impl Cells {
    /// Those of a map of `side`² texels from one place of the line to another, within `size`² texels from `low` on.
    fn new(line: &Line, side: usize, (from, to): (f32, f32), low: [usize; 2], size: usize) -> Cells {
        let low = low.map(|x| x as isize);
        let scale = side as f32;
        let (mut at, mut step, mut next, mut per_texel) = ([0; 2], [0; 2], [f32::INFINITY; 2], [f32::INFINITY; 2]);
        for axis in 0..2 {
            let (start, slope) = (line.start[axis], line.step[axis]);
            // `as` saturates.
            at[axis] =
                (((start + slope * from) * scale).floor() as isize).clamp(low[axis], low[axis] + size as isize - 1);
            if slope != 0.0 {
                step[axis] = if slope > 0.0 { 1 } else { -1 };
                let face = at[axis] + isize::from(slope > 0.0);
                next[axis] = (face as f32 / scale - start) / slope;
                per_texel[axis] = 1.0 / (scale * slope.abs());
            }
        }
        let mut cells = Cells { current: None, end: to, at, step, next, per_texel, low, size: size as isize };
        cells.current = Some(cells.cell(from));
        cells
    }

    #[inline]
    fn cell(&self, from: f32) -> Cell {
        let to = self.next[0].min(self.next[1]).min(self.end).max(from);
        Cell { column: self.at[0] as usize, row: self.at[1] as usize, from, to }
    }

    #[inline]
    fn advance(&mut self) {
        let Some(Cell { to, .. }) = self.current else { return };
        let axis = usize::from(self.next[1] < self.next[0]);
        self.current = None;
        if to >= self.end || self.step[axis] == 0 {
            return;
        }
        self.at[axis] += self.step[axis];
        self.next[axis] += self.per_texel[axis];
        if (self.low[axis]..self.low[axis] + self.size).contains(&self.at[axis]) {
            self.current = Some(self.cell(to));
        }
    }
}

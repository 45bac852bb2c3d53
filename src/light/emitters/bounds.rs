//! Bounds of lights, and how a set of lights is divided by them.

use glam::Vec3;

use super::cone::Cone;

/// Planes that a split is chosen from, per axis, plus one.
const BINS: usize = 12;

/// What is known of a light, or of several.
#[derive(Debug, Clone, Copy)]
pub struct LightBounds {
    /// Box, metres.
    pub low: Vec3,
    pub high: Vec3,
    /// Luminance of the irradiance at distance 1 that it makes in its main direction: radiance × area, or intensity.
    pub power: f32,
    /// The normals.
    pub normals: Cone,
    /// Cosine of the angle from a normal up to which it shines.
    pub cos_reach: f32,
    /// Whether it shines to both sides.
    pub two_sided: bool,
    /// It lights nothing farther away, metres.
    pub range_m: f32,
}

impl LightBounds {
    pub fn union(self, other: LightBounds) -> LightBounds {
        LightBounds {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            power: self.power + other.power,
            normals: self.normals.union(other.normals),
            cos_reach: self.cos_reach.min(other.cos_reach),
            two_sided: self.two_sided || other.two_sided,
            range_m: self.range_m.max(other.range_m),
        }
    }

    pub fn centre(&self) -> Vec3 {
        (self.low + self.high) * 0.5
    }

    pub fn diagonal(&self) -> f32 {
        (self.high - self.low).length()
    }

    /// What a node costs beside others: power × extent × directions.
    fn cost(&self) -> f32 {
        let side = self.high - self.low;
        let surface = side.x * side.y + side.y * side.z + side.z * side.x;
        // Lights in a row have no surface, and must still be told from those in a point.
        self.power * (surface + side.length_squared() * 1e-3) * self.normals.measure()
    }
}

/// Puts the lights of one side of the cheapest plane first, and counts them: at least one on either side.
pub fn split(lights: &[LightBounds], order: &mut [u32]) -> usize {
    let centre = |light: u32| lights[light as usize].centre();
    let low = order.iter().map(|&l| centre(l)).fold(Vec3::INFINITY, Vec3::min);
    let high = order.iter().map(|&l| centre(l)).fold(Vec3::NEG_INFINITY, Vec3::max);
    let bin = |light: u32, axis: usize| {
        let place = (centre(light)[axis] - low[axis]) / (high[axis] - low[axis]) * BINS as f32;
        // `as` sends NaN to 0.
        (place as usize).min(BINS - 1)
    };
    let join = |a: Option<LightBounds>, b: Option<LightBounds>| match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        (a, b) => a.or(b),
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| high[axis] > low[axis]) {
        let mut bins: [Option<LightBounds>; BINS] = [None; BINS];
        order.iter().for_each(|&l| bins[bin(l, axis)] = join(bins[bin(l, axis)], Some(lights[l as usize])));
        let mut above = [None; BINS];
        for i in (1..BINS).rev() {
            above[i - 1] = join(bins[i], above[i]);
        }
        let mut below = None;
        for plane in 0..BINS - 1 {
            below = join(below, bins[plane]);
            if let (Some(below), Some(above)) = (below, above[plane]) {
                let cost = below.cost() + above.cost();
                if best.is_none_or(|(least, _, _)| cost < least) {
                    best = Some((cost, axis, plane));
                }
            }
        }
    }
    let Some((_, axis, plane)) = best else { return halve(lights, order) };
    order.sort_by_key(|&l| bin(l, axis) > plane);
    order.partition_point(|&l| bin(l, axis) <= plane)
}

/// Halves the lights along the longest side of their centres.
pub fn halve(lights: &[LightBounds], order: &mut [u32]) -> usize {
    let centre = |light: u32| lights[light as usize].centre();
    let low = order.iter().map(|&l| centre(l)).fold(Vec3::INFINITY, Vec3::min);
    let high = order.iter().map(|&l| centre(l)).fold(Vec3::NEG_INFINITY, Vec3::max);
    let axis = (high - low).max_position();
    order.sort_by(|&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(&b)));
    order.len() / 2
}

//! Octahedral maps of all probes in one block of memory, and bilinear look-up in them.
//!
//! Layout: `[P][R′][R′]`, R′ = R + 2·border, row = v, column = u. With a border of one texel a bilinear look-up never
//! leaves the probe's own map; without one, it stops at the edge (a seam, which the methods without border have).

use glam::Vec2;
use std::ops::{Add, Mul};

use crate::math::octahedral::wrap_texel;

#[derive(Debug, Clone, PartialEq)]
pub struct OctahedralMaps<T> {
    /// Interior texels per side.
    pub resolution: usize,
    /// 0 or 1.
    pub border: usize,
    pub texels: Vec<T>,
}

/// The four texels of a bilinear look-up, the same in every probe for the same direction.
#[derive(Debug, Clone, Copy)]
pub struct Taps {
    pub offset: [u32; 4],
    pub weight: [f32; 4],
}

impl<T: Copy> OctahedralMaps<T> {
    pub fn new(probes: usize, resolution: usize, border: usize, value: T) -> Self {
        let side = resolution + 2 * border;
        OctahedralMaps { resolution, border, texels: vec![value; probes * side * side] }
    }

    /// Texels per side with border.
    pub fn side(&self) -> usize {
        self.resolution + 2 * self.border
    }

    pub fn texels_per_probe(&self) -> usize {
        self.side() * self.side()
    }

    pub fn probe(&self, probe: usize) -> &[T] {
        let n = self.texels_per_probe();
        &self.texels[probe * n..(probe + 1) * n]
    }

    pub fn probe_mut(&mut self, probe: usize) -> &mut [T] {
        let n = self.texels_per_probe();
        &mut self.texels[probe * n..(probe + 1) * n]
    }

    /// The maps of some probes, in this order.
    pub fn of_probes(&self, probes: &[usize]) -> Self {
        let texels = probes.iter().flat_map(|&probe| self.probe(probe).iter().copied()).collect();
        OctahedralMaps { texels, ..*self }
    }

    /// Where to look for `oct` ∈ [−1,1]²: half a texel in from the corner, shifted by the border.
    #[inline]
    pub fn taps(&self, oct: Vec2) -> Taps {
        let side = self.side();
        let p = (oct * 0.5 + 0.5) * self.resolution as f32 - 0.5 + self.border as f32;
        let p = p.clamp(Vec2::ZERO, Vec2::splat((side - 1) as f32));
        let inner = side.saturating_sub(2) as u32;
        let (x, y) = ((p.x as u32).min(inner), (p.y as u32).min(inner));
        let f = p - Vec2::new(x as f32, y as f32);
        let last = side as u32 - 1;
        let (x1, y1) = ((x + 1).min(last), (y + 1).min(last));
        let side = side as u32;
        Taps {
            offset: [y * side + x, y * side + x1, y1 * side + x, y1 * side + x1],
            weight: [(1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y],
        }
    }
}

impl<T: Copy + Add<Output = T> + Mul<f32, Output = T>> OctahedralMaps<T> {
    /// Bilinear value in one probe's map.
    #[inline]
    pub fn sample(&self, probe: usize, taps: &Taps) -> T {
        let map = self.probe(probe);
        let at = |i: usize| map[taps.offset[i] as usize] * taps.weight[i];
        at(0) + at(1) + at(2) + at(3)
    }
}

/// Where the interior texel with the number `o`, counted row by row, lies in a map with this border.
pub fn interior_texel(resolution: usize, border: usize) -> impl Fn(usize) -> usize + Copy {
    let side = resolution + 2 * border;
    move |o| (o / resolution + border) * side + o % resolution + border
}

/// Copies an interior map (row by row, `resolution`²) into one with a border and fills the border.
pub fn fill_with_border<T: Copy>(interior: &[T], resolution: usize, border: usize, out: &mut [T]) {
    let side = resolution + 2 * border;
    for row in 0..side {
        for column in 0..side {
            let (c, r) = wrap_texel(column as isize - border as isize, row as isize - border as isize, resolution);
            out[row * side + column] = interior[r * resolution + c];
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;
    use crate::math::octahedral::{oct_from_direction, texel_direction};
    use glam::Vec3;
    use proptest::prelude::*;

    /// A smooth function on the sphere, stored at texel centres.
    fn smooth(d: Vec3) -> f32 {
        2.0 + d.x + 0.5 * d.y * d.z
    }

    fn stored(resolution: usize, border: usize) -> OctahedralMaps<f32> {
        let interior: Vec<f32> = (0..resolution * resolution)
            .map(|i| smooth(texel_direction(i % resolution, i / resolution, resolution)))
            .collect();
        let mut maps = OctahedralMaps::new(1, resolution, border, 0.0);
        fill_with_border(&interior, resolution, border, maps.probe_mut(0));
        maps
    }

    proptest! {
        #[test]
        fn look_up_is_continuous_across_the_seams(phi in 0.0f32..2.0 * PI, z in -1.0f32..0.0) {
            let maps = stored(16, 1);
            let r = (1.0 - z * z).sqrt();
            let d = Vec3::new(r * phi.cos(), r * phi.sin(), z);
            let value = maps.sample(0, &maps.taps(oct_from_direction(d)));
            // Bilinear error of this function at 16² is below 0.03; a wrong border texel errs by up to 1.
            prop_assert!((value - smooth(d)).abs() < 0.05, "{d}: {value} instead of {}", smooth(d));
        }
    }

    #[test]
    fn weights_sum_to_one_everywhere() {
        for (resolution, border) in [(8, 1), (8, 0), (1, 1), (1, 0), (2, 0)] {
            let maps = OctahedralMaps::new(1, resolution, border, 1.0f32);
            for oct in [Vec2::ZERO, Vec2::ONE, Vec2::NEG_ONE, Vec2::new(0.3, -0.9)] {
                let value = maps.sample(0, &maps.taps(oct));
                assert!((value - 1.0).abs() < 1e-6, "{resolution} {border} {oct}: {value}");
            }
        }
    }

    #[test]
    fn texel_centres_are_met_exactly() {
        let maps = stored(6, 1);
        let d = texel_direction(4, 1, 6);
        assert!((maps.sample(0, &maps.taps(oct_from_direction(d))) - smooth(d)).abs() < 1e-5);
    }
}

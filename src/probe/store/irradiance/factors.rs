//! Irradiance as the linear function of a probe's numbers that a look-up makes of it: what a fit works on.

use glam::{Vec2, Vec3, Vec3A};

use crate::math::harmonics::{self, COUNT, Y0};
use crate::math::octahedral::direction_from_oct;
use crate::probe::store::map::{OctahedralMaps, fill_with_border};
use crate::probe::store::sh::{Functions, ShIrradiance};

/// By which factors a probe's unknowns add up to its irradiance around a direction.
pub struct Factors<'i>(Kind<'i>);

enum Kind<'i> {
    /// Four texels of a map; `interior`: which texel within the border each of all stands for.
    Maps { maps: &'i OctahedralMaps<Vec3A>, interior: Vec<u32> },
    /// Functions ÷ Y₀, and with a gradient the way from the probe.
    Functions { gradient: bool },
    /// Faces of a cube by the squares of the direction's components.
    Faces,
    /// Functions at the four texels of a map that shading reads.
    Presampled { maps: &'i OctahedralMaps<Vec3A>, functions: Vec<Functions> },
}

impl<'i> Factors<'i> {
    /// Of maps whose texels are the unknowns.
    pub fn of_maps(maps: &'i OctahedralMaps<Vec3A>) -> Factors<'i> {
        let own: Vec<u32> = (0..(maps.resolution * maps.resolution) as u32).collect();
        let mut interior = vec![0; maps.texels_per_probe()];
        fill_with_border(&own, maps.resolution, maps.border, &mut interior);
        Factors(Kind::Maps { maps, interior })
    }

    /// Of coefficients, read by what shading reads of them.
    pub fn of_harmonics(sh: &'i ShIrradiance) -> Factors<'i> {
        Factors(match sh.presampled() {
            Some((maps, functions)) => Kind::Presampled { maps, functions },
            None => Kind::Functions { gradient: sh.store().gradient },
        })
    }

    /// Of coefficients that are evaluated, times Y₀, without a gradient.
    pub fn of_functions() -> Factors<'static> {
        Factors(Kind::Functions { gradient: false })
    }

    /// Of irradiance along +x, −x, +y, −y, +z, −z: an ambient cube, whose face along each axis counts with the square of the
    /// direction's component (Mitchell, *Shading in Valve's Source Engine*, 2006).
    pub fn of_faces() -> Factors<'static> {
        Factors(Kind::Faces)
    }

    /// Calls `add(unknown, factor)` for all unknowns that count around `oct`, for a point that is `offset` from the probe, in
    /// its spacings. Irradiance is their sum where the store is linear.
    #[inline]
    pub fn each(&self, oct: Vec2, offset: Vec3, mut add: impl FnMut(usize, f32)) {
        match &self.0 {
            Kind::Maps { maps, interior } => {
                let taps = maps.taps(oct);
                for (texel, weight) in taps.offset.iter().zip(taps.weight) {
                    add(interior[*texel as usize] as usize, weight);
                }
            }
            Kind::Functions { gradient } => {
                for (unknown, y) in harmonics::basis(direction_from_oct(oct)).iter().enumerate() {
                    add(unknown, y / Y0);
                }
                if *gradient {
                    (0..3).for_each(|axis| add(COUNT + axis, offset[axis]));
                }
            }
            Kind::Faces => {
                let direction = direction_from_oct(oct);
                for axis in 0..3 {
                    let cosine = direction[axis];
                    add(2 * axis + usize::from(cosine < 0.0), cosine * cosine);
                }
            }
            Kind::Presampled { maps, functions } => {
                let taps = maps.taps(oct);
                for unknown in 0..COUNT {
                    let tap = |i: usize| functions[taps.offset[i] as usize].0[unknown] * taps.weight[i];
                    add(unknown, (0..4).map(tap).sum::<f32>() / Y0);
                }
            }
        }
    }

    /// How firmly a fit holds an unknown to its prior: how many squares of a difference of unknowns, W·m⁻², a squared difference
    /// of what the file holds is, and more for directions.
    pub fn stiffness(&self, unknown: usize) -> f64 {
        /// Surfaces ask around few directions, and leave the others to noise. From 1 to 10 errors in pictures of seven scenes
        /// change by 1 % at most (thin_wall 5), those of their air fall by 1 to 8 %; 100 costs up to a tenth of the former.
        const OF_DIRECTIONS: f64 = 10.0;
        match self.0 {
            Kind::Maps { .. } | Kind::Faces => 1.0,
            Kind::Functions { .. } | Kind::Presampled { .. } => {
                let is_direction = (1..COUNT).contains(&unknown);
                f64::from(Y0).powi(-2) * if is_direction { OF_DIRECTIONS } else { 1.0 }
            }
        }
    }
}

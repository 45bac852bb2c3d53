//! Irradiance as textures.

use super::{Irradiance, IrradianceCurve};
use crate::probe::store::textures::{Bound, Numbers, Texture};

const SIDES: [&str; 2] = ["LIGHT_RESOLUTION", "LIGHT_BORDER"];

impl Irradiance {
    /// `light`: of every probe its coefficients and, behind these, its gradient, or its map.
    pub fn bound(&self) -> Bound {
        let mut bound = Bound::default();
        let numbers: Vec<f32> = match self {
            Irradiance::Maps { maps, curve, .. } => {
                bound.define_sides(SIDES, maps);
                match curve {
                    IrradianceCurve::Linear => {}
                    IrradianceCurve::Gamma5Over2Pi => bound.define("LIGHT_GAMMA5", 1),
                }
                maps.texels.iter().flat_map(|texel| texel.to_array()).collect()
            }
            Irradiance::Sh9(sh) => match sh.maps() {
                Some(maps) => {
                    bound.define_sides(SIDES, maps);
                    maps.texels.iter().flat_map(|texel| texel.to_array()).collect()
                }
                None => {
                    let (per_probe, numbers) = sh.numbers();
                    bound.define("HARMONICS", per_probe);
                    numbers.flat_map(|number| number.to_array()).collect()
                }
            },
        };
        bound.textures.push(Texture { name: "light", channels: 3, numbers: Numbers::F32(numbers) });
        bound
    }
}

//! The look-ups of engines that blend what is stored, and nothing else: which block answers a point, where it is read, and
//! what the values of a probe add up to.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::block::Block;
use crate::math::harmonics;
use crate::probe::store::irradiance::Factors;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rules {
    /// `LightProbeGridWebGL` of three.js 0.187 (`lightprobes_pars_fragment.glsl.js`, `lights_fragment_begin.glsl.js`): nine
    /// coefficients, read half a spacing along the normal, of the last grid that has that place. Sums are not negative.
    Three,
    /// `IrradianceVolume` of Bevy 0.20 (`irradiance_volume.wesl`, `light_probe.wesl`): the three faces of a cube that look
    /// along the normal, each times the square of the normal's component, and the mean of all volumes that have the point.
    Bevy,
}

impl Rules {
    /// Values of a probe.
    pub fn unknowns(self) -> usize {
        match self {
            Rules::Three => harmonics::COUNT,
            Rules::Bevy => 6,
        }
    }

    /// What its values add up to.
    pub fn factors(self) -> Factors<'static> {
        match self {
            Rules::Three => Factors::of_functions(),
            Rules::Bevy => Factors::of_faces(),
        }
    }

    /// Whether stored values may be negative.
    pub fn is_signed(self) -> bool {
        self == Rules::Three
    }

    /// Where a block is read for a point.
    #[inline]
    pub fn place(self, block: &Block, position: Vec3, normal: Vec3) -> Vec3 {
        match self {
            Rules::Three => position + normal * block.spacing * 0.5,
            Rules::Bevy => position,
        }
    }

    /// How much a block counts that is read at this place: 0 where it has none.
    #[inline]
    pub fn share(self, block: &Block, place: Vec3) -> f32 {
        /// By which a grid of three.js is larger than its cells, spacings.
        const MARGIN: f32 = 0.01;
        /// Share of a volume of Bevy over which it fades at its faces where no fading is asked for.
        const FADE: f32 = 1e-4;
        let (low, high) = block.bounds();
        match self {
            Rules::Three => {
                let margin = block.spacing * MARGIN;
                f32::from(place.cmpge(low - margin).all() && place.cmple(high + margin).all())
            }
            Rules::Bevy => {
                let centred = (place - low) / (high - low) - 0.5;
                let along_axes = (1.0 - 2.0 * centred.abs()) / (2.0 * FADE);
                along_axes.min_element().clamp(0.0, 1.0)
            }
        }
    }

    /// Whether the last block that has a point is the only one that counts.
    #[inline]
    pub fn takes_last(self) -> bool {
        self == Rules::Three
    }

    /// Weight of rows in the air in its fit, where nothing else is asked for. three.js reads half a cell along the normal, and with
    /// 0.3 its surfaces err as with 0.1 and its air less. Bevy reads at the surface: within a cell of a wall between two rooms
    /// either surfaces or the air get their due. With 0.1, 0.3 and 1 the light in the dark room of two_rooms_sealed at 1 m is
    /// 1.4, 1.9 and 3.4 % of that in the lit one, and the air of two_rooms_open errs 1.19, 1.15 and 1.07 times as much as without
    /// a fit.
    pub fn air_weight(self) -> f32 {
        match self {
            Rules::Three => 0.3,
            Rules::Bevy => 0.1,
        }
    }

    /// Blocks that count at once, if there is a limit: `MAX_VIEW_LIGHT_PROBES` of Bevy (`light_probe/mod.rs`).
    pub fn most_blocks(self) -> Option<usize> {
        match self {
            Rules::Three => None,
            Rules::Bevy => Some(8),
        }
    }

    /// What is shown of a sum.
    #[inline]
    pub fn shown(self, sum: Vec3) -> Vec3 {
        match self {
            Rules::Three => sum.max(Vec3::ZERO),
            Rules::Bevy => sum,
        }
    }
}

//! Texels on a scene's surfaces: places, so many to a side, at which something is known that is not worked out where it is shown.
//!
//! A triangle has the texels of a rectangle: along the axis that it faces most, a, those of its bounds along the axes u and v that
//! follow, row by row. `low + (i + ½)·side` is the centre of texel i along u and v. A double-sided triangle has them twice, its
//! front's first.

mod charts;
mod light;

pub use self::charts::*;
pub use self::light::{NUDGE, Texel, light};

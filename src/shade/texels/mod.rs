//! Texels on a scene's surfaces: places, so many to a side, at which something is known that is not worked out where it is shown.

mod charts;
mod light;

pub use self::charts::{Chart, Charts, Place};
pub use self::light::{NUDGE, Texel, light};

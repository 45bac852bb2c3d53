//! From values to colours.

use colorous::{INFERNO, RED_BLUE};

/// What a false-colour picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Magnitudes: dark for low, bright for high (matplotlib's perceptually uniform "inferno").
    Sequential,
    /// Signed values: blue below, near white at 0, red above (ColorBrewer's "RdBu", reversed). The range is symmetric about 0.
    Diverging,
}

/// Colour of values that are no numbers. Neither scale has a middle grey.
pub const MISSING: [u8; 3] = [128, 128, 128];

/// A scale over a range of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Colormap {
    scale: Scale,
    low: f32,
    high: f32,
}

impl Colormap {
    /// A map over `range` (low, high), in the unit of the values. A diverging one is widened to be symmetric about 0; an empty or
    /// undefined range becomes one of length 1.
    pub fn new(scale: Scale, range: [f32; 2]) -> Colormap {
        let [mut low, mut high] = range.map(|end| if end.is_finite() { end } else { 0.0 });
        if scale == Scale::Diverging {
            high = low.abs().max(high.abs());
            low = -high;
        }
        if low >= high {
            (low, high) = match scale {
                Scale::Sequential => (low, low + 1.0_f32.max(low.abs())),
                Scale::Diverging => (-1.0, 1.0),
            };
        }
        Colormap { scale, low, high }
    }

    pub fn scale(&self) -> Scale {
        self.scale
    }

    /// The ends of the range as they are used, in the unit of the values.
    pub fn range(&self) -> [f32; 2] {
        [self.low, self.high]
    }

    /// The colour of a value; beyond the range that of its end, [`MISSING`] for NaN and infinities.
    pub fn color(&self, value: f32) -> [u8; 3] {
        if !value.is_finite() {
            return MISSING;
        }
        // In f64: the range may span all of f32.
        let (low, high) = (f64::from(self.low), f64::from(self.high));
        self.color_at((f64::from(value) - low) / (high - low))
    }

    /// The colour at a share of the range, clamped to [0,1]: what a legend's bar shows.
    pub fn color_at(&self, share: f64) -> [u8; 3] {
        let share = share.clamp(0.0, 1.0);
        match self.scale {
            Scale::Sequential => INFERNO.eval_continuous(share),
            Scale::Diverging => RED_BLUE.eval_continuous(1.0 - share),
        }
        .into_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle_have_their_colours() {
        let sequential = Colormap::new(Scale::Sequential, [0.0, 2.0]);
        assert_eq!(sequential.color(0.0), [0, 0, 4]);
        assert_eq!(sequential.color(2.0), [252, 255, 164]);
        assert_eq!(sequential.color(9.0), sequential.color(2.0));
        let diverging = Colormap::new(Scale::Diverging, [-0.5, 2.0]);
        assert_eq!(diverging.range(), [-2.0, 2.0]);
        let [red, _, blue] = diverging.color(2.0);
        assert!(red > blue);
        let neutral = diverging.color(0.0);
        assert!(neutral.iter().all(|&channel| channel > 230), "{neutral:?}");
    }

    #[test]
    fn odd_ranges_and_values_have_a_colour() {
        for scale in [Scale::Sequential, Scale::Diverging] {
            for range in [[0.0, 0.0], [3.0, 1.0], [f32::NAN, 1.0], [f32::MIN, f32::MAX], [f32::MAX, f32::MAX]] {
                let [low, high] = Colormap::new(scale, range).range();
                assert!(low < high, "{scale:?} {range:?}");
            }
            assert_eq!(Colormap::new(scale, [0.0, 1.0]).color(f32::NAN), MISSING);
            assert_eq!(Colormap::new(scale, [0.0, 1.0]).color(f32::INFINITY), MISSING);
        }
    }
}

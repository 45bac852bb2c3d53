//! False-colour pictures: one value a pixel, with a legend that says what the colours mean.

use super::canvas::{Rect, paste};
use super::colormap::{Colormap, Scale};
use super::legend::{self, Legend};
use super::ticks::round_up;
use crate::image::Picture8;

/// Share of the values, by magnitude, that [`range_of`] keeps within the range: some fireflies must not blacken all the rest.
const RANGE_PERCENTILE: f64 = 0.995;

/// Small maps are enlarged until they are as wide as a legend needs, but not beyond this height, px.
const MAX_ENLARGED_HEIGHT: u32 = 1080;

/// Maps up to this width get a legend at zoom 1, up to twice this width at zoom 2, and so on: px.
const WIDTH_PER_ZOOM: u32 = 1200;

/// What lies beside a map that is narrower than its legend.
const SURROUND: [u8; 3] = [242, 242, 243];

/// What to draw.
#[derive(Debug, Clone, Copy)]
pub struct Heatmap<'a> {
    /// Row 0 at the top, `width · height` of them; NaN and infinities are missing values.
    pub values: &'a [f32],
    pub width: u32,
    pub height: u32,
    /// Low and high end, in the unit of the values: [`range_of`] finds one. Beyond it the colour is that of the end.
    pub range: [f32; 2],
    pub scale: Scale,
    pub title: &'a str,
    /// Such as "W·m⁻²"; empty for a pure number.
    pub unit: &'a str,
    /// What the legend calls missing values, such as "no surface".
    pub missing: &'a str,
}

/// A drawn map, and where its parts lie.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DrawnHeatmap {
    pub picture: Picture8,
    /// The map without its legend. Each value covers `map_scale` × `map_scale` pixels.
    pub map: Rect,
    pub map_scale: u32,
    /// The legend's colour bar: low end left, high end right.
    pub bar: Rect,
}

impl Heatmap<'_> {
    /// Draws the map at full size in the top-left corner (enlarged by a whole number, and centred, where it is narrower than a
    /// legend) and the legend below it.
    ///
    /// # Panics
    /// When `values` does not hold `width · height` of them.
    pub fn draw(&self) -> DrawnHeatmap {
        assert_eq!(self.values.len(), self.width as usize * self.height as usize, "values of the map {}", self.title);
        let colormap = Colormap::new(self.scale, self.range);
        let map_scale = enlargement(self.width, self.height);
        let zoom = (self.width * map_scale).div_ceil(WIDTH_PER_ZOOM).max(1);
        let map_size = (self.width * map_scale, self.height * map_scale);
        let width = map_size.0.max(legend::MIN_WIDTH);
        let mut picture = Picture8::filled(width, map_size.1 + legend::HEIGHT * zoom, SURROUND);

        let pixels = self.values.iter().map(|&value| colormap.color(value)).collect();
        let colors = Picture8 { width: self.width, height: self.height, pixels };
        let map = Rect { x: (width - map_size.0) / 2, y: 0, width: map_size.0, height: map_size.1 };
        paste(&mut picture, &colors, map.x, map.y, map_scale);

        let bar = self.legend(colormap).draw(&mut picture, map_size.1, zoom);
        DrawnHeatmap { picture, map, map_scale, bar }
    }

    fn legend(&self, colormap: Colormap) -> Legend<'_> {
        let [low, high] = colormap.range();
        let finite = || self.values.iter().filter(|value| value.is_finite());
        Legend {
            title: self.title,
            unit: self.unit,
            colormap,
            missing: self.values.iter().any(|value| !value.is_finite()).then_some(self.missing),
            beyond: [finite().any(|&value| value < low), finite().any(|&value| value > high)],
        }
    }
}

/// A range for these values: from 0 (sequential) or its negative (diverging) to the round number above 99.5 % of the magnitudes
/// that are not 0. Without any such, 0 to 1.
pub fn range_of(values: &[f32], scale: Scale) -> [f32; 2] {
    let mut magnitudes: Vec<f32> =
        values.iter().map(|value| value.abs()).filter(|m| m.is_finite() && *m > 0.0).collect();
    let high = if magnitudes.is_empty() {
        1.0
    } else {
        let rank = (RANGE_PERCENTILE * (magnitudes.len() - 1) as f64).ceil() as usize;
        round_up(f64::from(*magnitudes.select_nth_unstable_by(rank, f32::total_cmp).1)) as f32
    };
    // Rounding up may leave f32 at its very top.
    let high = high.min(f32::MAX);
    match scale {
        Scale::Sequential => [0.0, high],
        Scale::Diverging => [-high, high],
    }
}

/// The whole number by which a small map is enlarged.
fn enlargement(width: u32, height: u32) -> u32 {
    if width == 0 || height == 0 {
        return 1;
    }
    legend::MIN_WIDTH.div_ceil(width).min(MAX_ENLARGED_HEIGHT / height).max(1)
}

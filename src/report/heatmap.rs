//! False-colour pictures of signed values, one a pixel, with a legend that says what the colours mean.

use super::colormap::color;
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
    /// The colours go from −`range` to `range` > 0, in the unit of the values: [`range_of`] finds one.
    pub range: f32,
    pub title: &'a str,
    /// Such as "W·m⁻²"; empty for a pure number.
    pub unit: &'a str,
    /// What the legend calls missing values, such as "no surface".
    pub missing: &'a str,
}

impl Heatmap<'_> {
    /// Draws the map at full size in the top-left corner (enlarged by a whole number, and centred, where it is narrower than a
    /// legend) and the legend below it.
    ///
    /// # Panics
    /// When `values` does not hold `width · height` of them.
    pub fn draw(&self) -> Picture8 {
        assert_eq!(self.values.len(), self.width as usize * self.height as usize, "values of the map {}", self.title);
        let Heatmap { values, range: end, title, unit, missing, .. } = *self;
        let fitting = MAX_ENLARGED_HEIGHT / self.height.max(1);
        let scale = legend::MIN_WIDTH.div_ceil(self.width.max(1)).min(fitting).max(1);
        let (map_width, height) = (self.width * scale, self.height * scale);
        let width = map_width.max(legend::MIN_WIDTH);
        let mut picture = Picture8::filled(width, height, SURROUND);
        let left = ((width - map_width) / 2) as usize;
        for (y, row) in picture.pixels.chunks_exact_mut(width as usize).enumerate() {
            let values = &values[y / scale as usize * self.width as usize..][..self.width as usize];
            for (pixels, value) in row[left..].chunks_exact_mut(scale as usize).zip(values) {
                pixels.fill(color(*value, end));
            }
        }
        let zoom = map_width.div_ceil(WIDTH_PER_ZOOM).max(1);
        let legend = Legend { title, unit, end, missing, values }.draw(width, zoom);
        picture.height += legend.height;
        picture.pixels.extend(legend.pixels);
        picture
    }
}

/// The end of a range for these values: the round number above 99.5 % of the magnitudes that are not 0; 1 without any such.
pub fn range_of(values: &[f32]) -> f32 {
    let mut magnitudes: Vec<f32> =
        values.iter().map(|value| value.abs()).filter(|m| m.is_finite() && *m > 0.0).collect();
    if magnitudes.is_empty() {
        return 1.0;
    }
    let rank = (RANGE_PERCENTILE * (magnitudes.len() - 1) as f64).ceil() as usize;
    // Rounding up may leave f32 at its very top.
    round_up(*magnitudes.select_nth_unstable_by(rank, f32::total_cmp).1).min(f32::MAX)
}

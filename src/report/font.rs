//! The one font of the pictures, compiled in so that every machine draws the same pixels.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, PxScale};

/// DejaVu Sans, cut down to what labels need: `assets/DejaVuSans-subset.md` says how, `assets/DejaVuSans-LICENSE.txt` on what terms.
pub(super) static BYTES: &[u8] = include_bytes!("assets/DejaVuSans-subset.ttf");

/// The parsed font. It is part of the program, so a failure to parse is a bug and not a user's problem.
pub static FONT: LazyLock<FontRef<'static>> =
    LazyLock::new(|| FontRef::try_from_slice(BYTES).expect("the bundled font parses"));

/// `ab_glyph`'s scale, the height from ascent to descent, for a font size as designers count it: pixels per em.
pub fn scale_from_em(em_px: f32) -> PxScale {
    // A font without units per em is no font; 2048 is DejaVu's.
    PxScale::from(em_px * FONT.height_unscaled() / FONT.units_per_em().unwrap_or(2048.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_subset_has_what_labels_need() {
        let needed = "aZ09 ·−×σπ²³⁻¹⁰⁴⁹→≤≥%µ–…ÊΔρ±∞";
        for character in needed.chars() {
            assert_ne!(FONT.glyph_id(character).0, 0, "no glyph for {character}");
        }
    }
}

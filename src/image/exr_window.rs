//! The two windows of an OpenEXR part: where pixels are stored, and which of the plane the picture shows.

use std::ops::Range;

use exr::math::Vec2;
use exr::meta::header::Header;

/// The picture of a part: its display window. What the data window lacks is black, and what it has more is cut off
/// (OpenEXR, "Technical Introduction", on display window and data window).
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub size: Vec2<usize>,
    /// Column and row of the picture in which the data window begins.
    offset: (i64, i64),
}

impl Window {
    pub(super) fn of(header: &Header) -> Window {
        let (data, display) = (header.data_window(), header.shared_attributes.display_window);
        // Files without a display window are damaged, but what they show is clear.
        let shown = if display.size.area() == 0 { data } else { display };
        let between = |data: i32, shown: i32| i64::from(data) - i64::from(shown);
        let offset = (between(data.position.x(), shown.position.x()), between(data.position.y(), shown.position.y()));
        Window { size: shown.size, offset }
    }

    /// Places in the picture's pixels of a stored line of `count` samples that begins in this column and row of the
    /// data window, and how many samples to the left of them are cut off. `None` if the picture shows nothing of it.
    pub(super) fn place(&self, column: usize, row: usize, count: usize) -> Option<(Range<usize>, usize)> {
        let (width, height) = (self.size.width() as i64, self.size.height() as i64);
        let (start, row) = (self.offset.0 + column as i64, self.offset.1 + row as i64);
        let shown = start.max(0)..(start + count as i64).min(width);
        if shown.is_empty() || !(0..height).contains(&row) {
            return None;
        }
        let first = row * width;
        let places = (first + shown.start) as usize..(first + shown.end) as usize;
        Some((places, (shown.start - start) as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_cut_to_the_picture() {
        let window = |x, y| Window { size: Vec2(4, 3), offset: (x, y) };
        assert_eq!(window(0, 0).place(0, 2, 4), Some((8..12, 0)));
        assert_eq!(window(-1, 1).place(0, 0, 7), Some((4..8, 1)), "longer on both sides");
        assert_eq!(window(3, 0).place(0, 0, 4), Some((3..4, 0)));
        assert_eq!(window(1, -1).place(1, 1, 1), Some((2..3, 0)), "in a tile");
        for (window, row) in [(window(4, 0), 0), (window(-4, 0), 0), (window(0, -1), 0), (window(0, 0), 3)] {
            assert_eq!(window.place(0, row, 4), None, "{window:?}");
        }
    }
}

//! Filled shapes and blending on an 8-bit picture. What lies outside the picture is cut off.

use crate::image::Picture8;

/// A box of whole pixels: `x`, `y` its top-left corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rect {
    pub x: u32,
    pub y: u32,
    pub width: u32,
    pub height: u32,
}

/// Samples along each axis of a pixel that find how much of it a triangle covers.
const COVERAGE_SAMPLES: u32 = 4;

/// Blends `color` over a pixel; `coverage` in [0,1], in sRGB codes as text renderers do.
pub fn blend(picture: &mut Picture8, x: i64, y: i64, color: [u8; 3], coverage: f32) {
    if x < 0 || y < 0 || x >= i64::from(picture.width) || y >= i64::from(picture.height) {
        return;
    }
    let pixel = &mut picture.pixels[y as usize * picture.width as usize + x as usize];
    for (under, over) in pixel.iter_mut().zip(color) {
        let mixed = f32::from(*under) + (f32::from(over) - f32::from(*under)) * coverage.clamp(0.0, 1.0);
        *under = mixed.round() as u8;
    }
}

/// Fills a box.
pub fn fill(picture: &mut Picture8, rect: Rect, color: [u8; 3]) {
    let right = rect.x.saturating_add(rect.width).min(picture.width);
    for y in rect.y..rect.y.saturating_add(rect.height).min(picture.height) {
        let row = y as usize * picture.width as usize;
        if rect.x < right {
            picture.pixels[row + rect.x as usize..row + right as usize].fill(color);
        }
    }
}

/// Draws the outline of a box, `thickness` pixels wide, just outside of it.
pub fn frame(picture: &mut Picture8, rect: Rect, thickness: u32, color: [u8; 3]) {
    let (x, y) = (rect.x.saturating_sub(thickness), rect.y.saturating_sub(thickness));
    let (width, height) = (rect.width + 2 * thickness, rect.height + 2 * thickness);
    fill(picture, Rect { x, y, width, height: thickness }, color);
    fill(picture, Rect { x, y: rect.y + rect.height, width, height: thickness }, color);
    fill(picture, Rect { x, y, width: thickness, height }, color);
    fill(picture, Rect { x: rect.x + rect.width, y, width: thickness, height }, color);
}

/// Fills a triangle with smooth edges; corners in pixels, either way round.
pub fn fill_triangle(picture: &mut Picture8, corners: [(f32, f32); 3], color: [u8; 3]) {
    let edge = |a: (f32, f32), b: (f32, f32), p: (f32, f32)| (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0);
    let [a, b, c] = corners;
    let inside = |p| {
        let sides = [edge(a, b, p), edge(b, c, p), edge(c, a, p)];
        sides.iter().all(|&side| side >= 0.0) || sides.iter().all(|&side| side <= 0.0)
    };
    let low = |f: fn((f32, f32)) -> f32| corners.map(f).into_iter().fold(f32::INFINITY, f32::min).floor() as i64;
    let high = |f: fn((f32, f32)) -> f32| corners.map(f).into_iter().fold(f32::NEG_INFINITY, f32::max).ceil() as i64;
    for y in low(|p| p.1)..high(|p| p.1) {
        for x in low(|p| p.0)..high(|p| p.0) {
            let mut covered = 0;
            for sample in 0..COVERAGE_SAMPLES * COVERAGE_SAMPLES {
                let offset = |i: u32| (i as f32 + 0.5) / COVERAGE_SAMPLES as f32;
                let within = (offset(sample % COVERAGE_SAMPLES), offset(sample / COVERAGE_SAMPLES));
                covered += u32::from(inside((x as f32 + within.0, y as f32 + within.1)));
            }
            let coverage = covered as f32 / (COVERAGE_SAMPLES * COVERAGE_SAMPLES) as f32;
            blend(picture, x, y, color, coverage);
        }
    }
}

/// Copies `source` into the picture, each of its pixels `scale` × `scale` large.
pub fn paste(picture: &mut Picture8, source: &Picture8, x: u32, y: u32, scale: u32) {
    for (row, line) in source.pixels.chunks_exact(source.width.max(1) as usize).enumerate() {
        for (column, &color) in line.iter().enumerate() {
            let rect = Rect { x: x + column as u32 * scale, y: y + row as u32 * scale, width: scale, height: scale };
            fill(picture, rect, color);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_cut_off_at_the_edges() {
        let mut picture = Picture8::filled(4, 4, [0; 3]);
        fill(&mut picture, Rect { x: 3, y: 3, width: 9, height: u32::MAX }, [255; 3]);
        fill(&mut picture, Rect { x: 9, y: 0, width: 9, height: 9 }, [255; 3]);
        fill_triangle(&mut picture, [(-9.0, -9.0), (-2.0, -9.0), (-9.0, -2.0)], [255; 3]);
        assert_eq!(picture.pixels.iter().filter(|pixel| **pixel != [0; 3]).count(), 1);
    }

    #[test]
    fn a_triangle_covers_its_area() {
        let mut picture = Picture8::filled(16, 16, [0; 3]);
        fill_triangle(&mut picture, [(2.0, 2.0), (14.0, 8.0), (2.0, 14.0)], [255; 3]);
        let area: f32 = picture.pixels.iter().map(|pixel| f32::from(pixel[0]) / 255.0).sum();
        // Half of 12 × 12; sixteen samples a pixel on 24 edge pixels err by a few pixels at most.
        assert!((area - 72.0).abs() < 4.0, "{area}");
    }
}

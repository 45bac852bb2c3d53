//! The two kinds of pictures: [`Picture`] holds linear light, [`Picture8`] holds what a screen shows.

use glam::Vec3;

use super::tonemap::{auto_exposure, tonemap};
use crate::math::color::{byte_from_unit, luminance};

/// Linear RGB (Rec. 709 primaries), radiometric, row 0 at the top; `pixels.len() == width · height`.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<Vec3>,
}

impl Picture {
    /// A black picture.
    pub fn new(width: u32, height: u32) -> Picture {
        Picture { width, height, pixels: vec![Vec3::ZERO; width as usize * height as usize] }
    }

    /// A picture of these pixels, row 0 at the top.
    ///
    /// # Panics
    /// If the number of `pixels` is not `width · height`.
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<Vec3>) -> Picture {
        assert_eq!(pixels.len(), width as usize * height as usize, "pixels of a {width}x{height} picture");
        Picture { width, height, pixels }
    }

    /// The pixel in column `x` and row `y`, counted from the top-left corner.
    ///
    /// # Panics
    /// If the pixel lies outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> Vec3 {
        self.pixels[index(self.width, self.height, x, y)]
    }

    /// The exposure, EV, that shows this picture at mid grey. See [`auto_exposure`].
    pub fn auto_exposure_ev(&self) -> f32 {
        auto_exposure(self.pixels.iter().map(|&pixel| luminance(pixel)))
    }

    /// The picture as a screen shows it at this exposure. See [`tonemap`].
    pub fn tonemapped(&self, exposure_ev: f32) -> Picture8 {
        let displayed = |&pixel| tonemap(pixel, exposure_ev).to_array().map(byte_from_unit);
        Picture8 { width: self.width, height: self.height, pixels: self.pixels.iter().map(displayed).collect() }
    }
}

/// 8-bit sRGB, row 0 at the top; `pixels.len() == width · height`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture8 {
    pub width: u32,
    pub height: u32,
    pub pixels: Vec<[u8; 3]>,
}

impl Picture8 {
    /// A picture of one colour.
    pub fn filled(width: u32, height: u32, color: [u8; 3]) -> Picture8 {
        Picture8 { width, height, pixels: vec![color; width as usize * height as usize] }
    }

    /// The pixel in column `x` and row `y`, counted from the top-left corner.
    ///
    /// # Panics
    /// If the pixel lies outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 3] {
        self.pixels[index(self.width, self.height, x, y)]
    }
}

fn index(width: u32, height: u32, x: u32, y: u32) -> usize {
    // Without this check, an x beyond the row would give a pixel of the next row.
    assert!(x < width && y < height, "pixel ({x}, {y}) of a {width}x{height} picture");
    y as usize * width as usize + x as usize
}

//! The two kinds of pictures: [`Picture`], what light there is, and [`Picture8`], what a screen shows.

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

    /// # Panics
    /// When `pixels` does not hold `width · height` of them.
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<Vec3>) -> Picture {
        assert_eq!(pixels.len(), width as usize * height as usize, "pixels of a {width}x{height} picture");
        Picture { width, height, pixels }
    }

    /// # Panics
    /// Outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> Vec3 {
        self.pixels[index(self.width, self.height, x, y)]
    }

    /// The exposure, EV, that shows this picture at mid grey: see [`auto_exposure`].
    pub fn auto_exposure_ev(&self) -> f32 {
        auto_exposure(self.pixels.iter().map(|&pixel| luminance(pixel)))
    }

    /// What a screen shows at this exposure: see [`tonemap`].
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

    /// # Panics
    /// Outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 3] {
        self.pixels[index(self.width, self.height, x, y)]
    }
}

fn index(width: u32, height: u32, x: u32, y: u32) -> usize {
    // Without this, an x too large would wrap into the next row.
    assert!(x < width && y < height, "pixel ({x}, {y}) of a {width}x{height} picture");
    y as usize * width as usize + x as usize
}

//! What a camera shows, from a few of its pixels: too much for memory, nothing, or the inside of a wall.

use super::points::{View, see};
use crate::light::World;
use crate::scene::Camera;

/// Pixels along the longer side of the picture that is looked at first.
const SIDE: u32 = 64;

/// Share of the points that may be backs of surfaces before the camera is taken to be inside geometry. Beside a sheet
/// that has only a front about half of them are.
const BACK_SHARE: f32 = 0.5;

/// A camera's picture in small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlook {
    /// Points per pixel: 0 where only sky is seen, above 1 where translucent surfaces overlap.
    pub points_per_pixel: f32,
    /// Of the points, how many show the back of a surface that has one.
    pub back_share: f32,
}

impl Outlook {
    pub fn new(world: &World, camera: &Camera, width: u32, height: u32, seed: u64) -> Outlook {
        let scale = f64::from(SIDE) / f64::from(width.max(height));
        let small = |side: u32| ((f64::from(side) * scale).ceil() as u32).clamp(1, SIDE);
        Outlook::of(&see(world, camera, small(width), small(height), seed))
    }

    fn of(view: &View) -> Outlook {
        let points = view.points.len() as f32;
        let backs = view.points.iter().filter(|point| point.surface.is_back()).count() as f32;
        Outlook {
            points_per_pixel: points / (view.width * view.height) as f32,
            back_share: if points > 0.0 { backs / points } else { 0.0 },
        }
    }

    /// What a user should know about the camera.
    pub fn warning(&self) -> Option<String> {
        if self.points_per_pixel == 0.0 {
            return Some("it sees no surface".to_owned());
        }
        (self.back_share > BACK_SHARE).then(|| {
            let percent = 100.0 * self.back_share;
            format!("{percent:.0} % of what it sees are backs of surfaces: it seems to stand inside geometry")
        })
    }
}

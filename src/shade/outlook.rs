//! A quick check of a camera from a few of its pixels. It predicts the memory of the picture, and it finds cameras that
//! see nothing or stand inside a wall.

use super::points::{View, see};
use crate::light::World;
use crate::scene::Camera;

/// Pixels along the longer side of the small picture.
const SIDE: u32 = 64;

/// The camera seems to stand inside geometry if more than this share of its points are backs of surfaces. A camera
/// beside a single-sided sheet sees about half of the points as backs.
const BACK_SHARE: f32 = 0.5;

/// Figures of a camera's small picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlook {
    /// Mean number of points per pixel. It is 0 if only sky is visible, and can exceed 1 if translucent surfaces
    /// overlap.
    pub points_per_pixel: f32,
    /// Share of the points that are backs of single-sided surfaces.
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

    /// A warning to the user about the camera.
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

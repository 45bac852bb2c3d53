//! What the user may say about the grid, and the box of points that this makes.

use glam::{DVec3, UVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::content::content_bounds;
use crate::scene::Scene;

/// Cells along the longest side of the bounds where neither spacing nor divisions are given.
const DEFAULT_CELLS: f64 = 16.0;

/// Most probes of a grid whose spacing follows the content of a scene that is much larger.
const MOST_BY_CONTENT: f64 = 16_384.0;

/// More probes than this are taken for a slip of the spacing.
pub const MAX_PROBES: u64 = 1 << 26;

/// The volume of scenes without extent along all axes, metres per side.
const POINT_SCENE_SIZE_M: f64 = 1.0;

/// What the user may say about the grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct GridSettings {
    /// Box that the probes must cover, world space, metres; the scene's bounding box where not given.
    pub bounds: Option<Bounds>,
    /// Distance between neighbours, metres, the same along all axes.
    pub spacing_m: Option<f64>,
    /// Number of probes along x, y and z; excludes `spacing_m`.
    pub divisions: Option<(u32, u32, u32)>,
    /// Margin around the scene's own bounding box as a share of the spacing, so that hits on its walls stay inside.
    pub padding: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    pub min: (f64, f64, f64),
    pub max: (f64, f64, f64),
}

impl Default for GridSettings {
    fn default() -> Self {
        GridSettings { bounds: None, spacing_m: None, divisions: None, padding: 0.05 }
    }
}

/// Why there is no such grid. Each message names the setting.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum GridError {
    #[error("grid.spacing_m is {0}: it must be a positive number of metres")]
    Spacing(f64),
    #[error("grid.divisions is {0:?}: every axis needs at least one probe")]
    Divisions((u32, u32, u32)),
    #[error("grid.spacing_m and grid.divisions are both given: remove one")]
    Both,
    #[error("grid.padding is {0}: it must be a number from 0 to 1")]
    Padding(f64),
    #[error("grid.bounds: min {min} must be finite and not above max {max}")]
    Bounds { min: DVec3, max: DVec3 },
    #[error("the grid would have {} probes, more than 2^26: raise grid.spacing_m or lower grid.divisions", in_words(*.0))]
    TooMany(f64),
}

/// A number of probes; rounded where no one counts.
fn in_words(count: f64) -> String {
    if count < 1e9 { count.to_string() } else { format!("about {count:.0e}") }
}

/// A spacing that was chosen for the user.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Automatic {
    /// Metres.
    pub spacing: f64,
    /// Longest side of the scene's box, metres.
    pub scene: f64,
    /// Longest side of what it follows, metres, where that is much smaller than the scene.
    pub content: Option<f64>,
}

/// Finest points along each axis, where the first lies, relative to the scene's origin, and how far they are apart, metres.
pub(super) struct Layout {
    pub origin: DVec3,
    pub spacing: DVec3,
    pub divisions: UVec3,
}

impl GridSettings {
    /// Largest distance of neighbours, metres, that these settings make of a scene.
    ///
    /// # Errors
    /// They make no grid.
    pub fn spacing_in(&self, scene: &Scene) -> Result<f64, GridError> {
        Ok(self.layout(scene, 1)?.spacing.max_element())
    }

    /// The box that the probes are to cover, without padding, world space, metres.
    pub fn bounds_in(&self, scene: &Scene) -> (DVec3, DVec3) {
        match self.bounds {
            Some(bounds) => (DVec3::from(bounds.min), DVec3::from(bounds.max)),
            None => {
                let (low, high) = scene_bounds(scene);
                (low + scene.origin_world, high + scene.origin_world)
            }
        }
    }

    /// The spacing that is chosen where these settings leave it open; `None` where they do not.
    pub fn automatic(&self, scene: &Scene) -> Option<Automatic> {
        if self.spacing_m.is_some() || self.divisions.is_some() {
            return None;
        }
        if let Some(Bounds { min, max }) = self.bounds {
            let longest = (DVec3::from(max) - DVec3::from(min)).max_element();
            return Some(Automatic { spacing: longest / DEFAULT_CELLS, scene: longest, content: None });
        }
        let (low, high) = scene_bounds(scene);
        let (extent, longest) = (high - low, (high - low).max_element());
        let usual = longest / DEFAULT_CELLS;
        let content = content_bounds(&scene.mesh).map(|(low, high)| f64::from((high - low).max_element()));
        let Some(content) = content.filter(|content| *content > 0.0) else {
            return Some(Automatic { spacing: usual, scene: longest, content: None });
        };
        // A few per cent at a time, so that the grid is nearly as fine as it may be.
        let too_many = |spacing: f64| {
            let probes = cover(extent, spacing, self.padding).map(|(_, points)| points.as_dvec3().element_product());
            !probes.is_ok_and(|probes| probes <= MOST_BY_CONTENT)
        };
        let mut spacing = content / DEFAULT_CELLS;
        while spacing < usual && too_many(spacing) {
            spacing *= 1.05;
        }
        Some(Automatic { spacing: spacing.min(usual), scene: longest, content: Some(content) })
    }

    /// The points that these settings ask for, `whole` or a multiple of it along each axis.
    pub(super) fn layout(&self, scene: &Scene, whole: u32) -> Result<Layout, GridError> {
        if self.spacing_m.is_some() && self.divisions.is_some() {
            return Err(GridError::Both);
        }
        if !(0.0..=1.0).contains(&self.padding) {
            return Err(GridError::Padding(self.padding));
        }
        // Relative to the scene's origin, so that a moved scene gives the same grid bit by bit.
        let (low, high) = match self.bounds {
            Some(bounds) => {
                let (min, max) = (DVec3::from(bounds.min), DVec3::from(bounds.max));
                if !(min.is_finite() && max.is_finite() && min.cmple(max).all()) {
                    return Err(GridError::Bounds { min, max });
                }
                (min - scene.origin_world, max - scene.origin_world)
            }
            None => scene_bounds(scene),
        };
        let padding = if self.bounds.is_some() { 0.0 } else { self.padding };
        let (spacing, divisions) = match (self.spacing_m, self.divisions) {
            (_, Some(divisions)) => {
                if divisions.0 == 0 || divisions.1 == 0 || divisions.2 == 0 {
                    return Err(GridError::Divisions(divisions));
                }
                let (low_scene, high_scene) = scene_bounds(scene);
                let usual = (high_scene - low_scene).max_element() / DEFAULT_CELLS;
                spread(high - low, UVec3::from(divisions), padding, usual)
            }
            (Some(spacing), None) => {
                if !(spacing > 0.0 && spacing.is_finite()) {
                    return Err(GridError::Spacing(spacing));
                }
                cover(high - low, spacing, padding)?
            }
            (None, None) => {
                let usual = (high - low).max_element() / DEFAULT_CELLS;
                let automatic = if self.bounds.is_some() { None } else { self.automatic(scene) };
                let spacing = automatic.map_or(usual, |automatic| automatic.spacing);
                cover(high - low, spacing, padding)?
            }
        };
        let asked = divisions;
        let divisions = UVec3::from(asked.to_array().map(|n| n.div_ceil(whole).saturating_mul(whole)));
        // Exact as far as it is compared, and beyond that not wrapped.
        let count: f64 = divisions.to_array().iter().map(|&n| f64::from(n)).product();
        if count > MAX_PROBES as f64 {
            return Err(GridError::TooMany(count));
        }
        let first = (low + high) / 2.0 - spacing * (asked - UVec3::ONE).as_dvec3() / 2.0;
        // Those that were asked for keep their places; as many more on either side, but for an odd one.
        let origin = first - spacing * ((divisions - asked) / 2).as_dvec3();
        Ok(Layout { origin, spacing, divisions })
    }
}

/// The scene's box; scenes that are flat or empty get some depth.
fn scene_bounds(scene: &Scene) -> (DVec3, DVec3) {
    let (low, high) = scene.mesh.bounds().unwrap_or((Vec3::ZERO, Vec3::ZERO));
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    if high == low {
        let half = DVec3::splat(POINT_SCENE_SIZE_M / 2.0);
        return (low - half, high + half);
    }
    (low, high)
}

/// Enough probes at this spacing that their hull covers the extent and the padding, as many on either side.
fn cover(extent: DVec3, spacing: f64, padding: f64) -> Result<(DVec3, UVec3), GridError> {
    let cells = (extent / spacing + 2.0 * padding).ceil().max(DVec3::ONE);
    // Before a long side is cut down to u32.
    if cells.max_element() > MAX_PROBES as f64 {
        return Err(GridError::TooMany((cells + 1.0).element_product()));
    }
    Ok((DVec3::splat(spacing), cells.as_uvec3() + UVec3::ONE))
}

/// The spacing at which this many probes cover the extent and the padding; `usual` where there is no extent.
fn spread(extent: DVec3, divisions: UVec3, padding: f64, usual: f64) -> (DVec3, UVec3) {
    let cells = (divisions - UVec3::ONE).as_dvec3();
    let room = (cells - 2.0 * padding).max(DVec3::splat(0.5));
    // A single layer needs a spacing too, for what is measured in spacings; so do axes along which the scene is flat.
    let layered = DVec3::select(divisions.cmpgt(UVec3::ONE), extent / room, extent);
    let fallback = if layered.max_element() > 0.0 { layered.max_element() } else { usual };
    (DVec3::select(layered.cmpgt(DVec3::splat(fallback * 1e-6)), layered, DVec3::splat(fallback)), divisions)
}

//! What is said about a grid before the bake: slips of units and axes, and a spacing that was chosen.

use glam::DVec3;

use super::Console;
use crate::probe::lattice::grid::GridSettings;
use crate::scene::Scene;
use crate::system::format::significant;

/// Warns of a grid that is hardly meant, and of one that follows the content of a scene.
pub fn warn(grid: &GridSettings, scene: &Scene, console: &Console) {
    let Some((low, high)) = scene.mesh.bounds() else { return };
    let (low, high) = (scene.origin_world + low.as_dvec3(), scene.origin_world + high.as_dvec3());
    let longest = (high - low).max_element();
    let metres = |length: f64| significant(length, 3);
    if let Some(bounds) = grid.bounds
        && (DVec3::from(bounds.max).cmplt(low).any() || DVec3::from(bounds.min).cmpgt(high).any())
    {
        console.warn(format!(
            "grid.bounds lie wholly outside of the scene, which spans {low} to {high} m: its surfaces use the probes at \
             the rim"
        ));
    }
    if let Some(spacing) = grid.spacing_m
        && longest > 0.0
        && spacing > longest
    {
        console.warn(format!(
            "grid.spacing_m is {} m, and the longest side of the scene {} m: no light that changes within it is kept; \
             lengths are metres, a room wants three or four probes along its height",
            metres(spacing),
            metres(longest),
        ));
    }
    if let Some(automatic) = grid.automatic(scene)
        && let Some(content) = automatic.content
    {
        console.warn(format!(
            "the scene is {} m long, and most of it lies within {} m: probes stand {} m apart to suit that; set \
             grid.spacing_m for another spacing, or grid.bounds for probes in a part of the scene only",
            metres(automatic.scene),
            metres(content),
            metres(automatic.spacing),
        ));
    }
}

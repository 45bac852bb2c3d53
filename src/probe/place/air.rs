//! Where things may move through a scene.

use glam::Vec3;

use crate::light::World;
use crate::probe::lattice::Grid;

/// The box of free air, relative to the scene's origin: that of the scene as far as the probes' hull covers it. What the
/// hull has beyond is no air that anything moves through, and grids that cover the scene have the same box. Along axes
/// in which the scene is flat the hull counts.
pub fn bounds(world: &World, grid: &Grid) -> (Vec3, Vec3) {
    /// Spacings.
    const FLAT: f32 = 1e-3;
    let hull = grid.hull(0.0);
    let scene = world.scene.mesh.bounds().unwrap_or(hull);
    let (mut low, mut high) = (hull.0.max(scene.0), hull.1.min(scene.1));
    for axis in 0..3 {
        if high[axis] - low[axis] <= FLAT * grid.spacing_max() {
            (low[axis], high[axis]) = (hull.0[axis], hull.1[axis]);
        }
    }
    (low, high)
}

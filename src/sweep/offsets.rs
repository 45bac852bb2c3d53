//! Grids shifted by fractions of a cell. How planes of probes meet walls decides much of a grid's error, and not
//! monotonically in its spacing: over several offsets chance averages out.

use glam::{DVec3, UVec3};

use super::ladder::Ladder;
use crate::math::random::{KroneckerSequence, Purpose, Random};
use crate::probe::lattice::grid::{Bounds, Grid, GridError, GridSettings};
use crate::scene::Scene;

/// Rounding of positions, in spacings.
const TOLERANCE: f64 = 1e-5;

/// `count` shifts along x, y and z as shares of a cell, each in [0,1): points that fill the cell evenly, from a start that
/// the seed chooses.
pub fn fractions(seed: u64, count: u32) -> Vec<[f64; 3]> {
    let mut random = Random::new(seed, Purpose::Offsets, 0, 0);
    let unit = |bits: u32| f64::from(bits) / (1u64 << 32) as f64;
    KroneckerSequence::new(&mut random).take(count as usize).map(|[x, y, z, _]| [x, y, z].map(unit)).collect()
}

/// The grid moved by these shares of its cells, with as many planes as cover what the grid covered: one more along an axis
/// where the shift needs it. Axes with a single layer of probes stay.
///
/// # Errors
/// There is no such grid.
pub fn shifted(settings: &GridSettings, scene: &Scene, fraction: [f64; 3]) -> Result<GridSettings, GridError> {
    let grid = Grid::new(settings, scene)?;
    let origin = grid.origin_world();
    let spacing = settings.spacing_m.map_or(grid.spacing().as_dvec3(), DVec3::splat);
    let mut divisions = grid.divisions();
    let (mut low, mut high) = covered(settings, scene, spacing, divisions);
    for axis in (0..3).filter(|&axis| grid.divisions()[axis] > 1) {
        let (spacing, first) = (spacing[axis], origin[axis] + fraction[axis] * spacing[axis]);
        let slack = TOLERANCE * spacing;
        let below = first + ((low[axis] + slack - first) / spacing).floor() * spacing;
        let cells = ((high[axis] - slack - below) / spacing).ceil().max(1.0);
        (low[axis], high[axis]) = (below, below + cells * spacing);
        divisions[axis] = cells as u32 + 1;
    }
    // What follows from a spacing is rounded up: a bit less than whole cells are the same number of them.
    let inset = if settings.spacing_m.is_some() { spacing * TOLERANCE } else { DVec3::ZERO };
    let inset = DVec3::select(divisions.cmpgt(UVec3::ONE), inset, DVec3::ZERO);
    Ok(GridSettings {
        bounds: Some(Bounds { min: (low + inset).into(), max: (high - inset).into() }),
        divisions: settings.spacing_m.is_none().then(|| divisions.into()),
        ..settings.clone()
    })
}

/// What the grid must cover, world space: the bounds, or the scene's with their padding.
fn covered(settings: &GridSettings, scene: &Scene, spacing: DVec3, divisions: UVec3) -> (DVec3, DVec3) {
    if let Some(bounds) = settings.bounds {
        return (bounds.min.into(), bounds.max.into());
    }
    let (low, high) = scene.mesh.bounds().unwrap_or_default();
    // A single layer lies in the middle, and has no cells to be padded by.
    let padding = DVec3::select(divisions.cmpgt(UVec3::ONE), spacing * settings.padding, DVec3::ZERO);
    (scene.origin_world + low.as_dvec3() - padding, scene.origin_world + high.as_dvec3() + padding)
}

/// Gives every configuration its shifted grids.
///
/// # Errors
/// A configuration, by its label, has no grid.
pub fn shift_all(ladders: &mut [Ladder], scene: &Scene, fractions: &[[f64; 3]]) -> Result<(), (String, GridError)> {
    for rung in ladders.iter_mut().flat_map(|ladder| &mut ladder.rungs) {
        for &fraction in fractions {
            let grid = shifted(&rung.config.grid, scene, fraction).map_err(|error| (rung.label.clone(), error))?;
            let mut config = rung.config.clone();
            config.grid = grid;
            rung.shifted.push((fraction, config));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::probe::lattice::Refine;
    use crate::scene::{self, LoadOptions};

    fn rooms() -> Scene {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/two_rooms_open.glb");
        scene::load(&path, &LoadOptions::default()).unwrap()
    }

    #[test]
    fn shifts_fill_the_cell_and_depend_on_the_seed() {
        let all = fractions(3, 64);
        assert_eq!(all.len(), 64);
        for axis in 0..3 {
            for quarter in 0..4 {
                let within = |f: &&[f64; 3]| (f[axis] * 4.0) as usize == quarter;
                // 16 of 64 points in each quarter, give or take what the sequence does from any of 2,000 starts: 9 to 19.
                // Of independent points a count of 8 or fewer, or 20 or more, would be no rarity.
                let count = all.iter().filter(within).count();
                assert!((9..=19).contains(&count), "axis {axis}, quarter {quarter}: {count}");
            }
        }
        assert_eq!(fractions(3, 2), all[..2]);
        assert_ne!(fractions(4, 2), all[..2]);
    }

    /// The finest points of a mixed grid are those of the shifted uniform one, and as many more as fill its base cells.
    #[test]
    fn a_shifted_mixed_grid_keeps_the_shifted_planes() {
        let scene = rooms();
        for settings in [
            GridSettings { spacing_m: Some(1.0), ..Default::default() },
            GridSettings { divisions: Some((9, 4, 5)), ..Default::default() },
        ] {
            let spacing = Grid::new(&settings, &scene).unwrap().spacing().as_dvec3();
            for fraction in fractions(1, 4) {
                let moved = shifted(&settings, &scene, fraction).unwrap();
                let uniform = Grid::new(&moved, &scene).unwrap();
                let mixed = Grid::refined(&moved, Refine::Mixed { levels: 2 }, &scene).unwrap();
                assert!((mixed.spacing().as_dvec3() / spacing - 1.0).abs().max_element() < 1e-5);
                let before = (uniform.origin_world() - mixed.origin_world()) / spacing;
                // Whole planes on either side.
                assert!((before - before.round()).abs().max_element() < 1e-3, "{settings:?}: {before}");
                let (low, more) = (before.round().as_uvec3(), mixed.divisions() - uniform.divisions());
                assert!(before.min_element() > -1e-3 && low.cmple(more).all() && more.cmplt(UVec3::splat(4)).all());
                assert_eq!(mixed.divisions() % 4, UVec3::ZERO);
            }
        }
    }

    #[test]
    fn a_shifted_grid_has_the_same_planes_moved_and_covers_the_same() {
        let scene = rooms();
        let bounds = Some(Bounds { min: (-4.0, 0.0, -2.0), max: (4.0, 3.0, 2.0) });
        for settings in [
            GridSettings { spacing_m: Some(1.0), ..Default::default() },
            GridSettings { spacing_m: Some(0.7), bounds, ..Default::default() },
            GridSettings { divisions: Some((9, 4, 5)), bounds, ..Default::default() },
            GridSettings { divisions: Some((9, 1, 5)), ..Default::default() },
            GridSettings::default(),
        ] {
            let plain = Grid::new(&settings, &scene).unwrap();
            let (low, high) = covered(&settings, &scene, plain.spacing().as_dvec3(), plain.divisions());
            for fraction in fractions(0, 8) {
                let shifted = Grid::new(&shifted(&settings, &scene, fraction).unwrap(), &scene).unwrap();
                let (spacing, origin) = (plain.spacing().as_dvec3(), plain.origin_world());
                for axis in 0..3 {
                    let (before, after) = (plain.divisions()[axis], shifted.divisions()[axis]);
                    if before == 1 {
                        assert_eq!(after, 1);
                        continue;
                    }
                    // A grid with slack may need a plane less, one without needs one more.
                    assert!(after.abs_diff(before) <= 1, "{settings:?}: {before} {after}");
                    let s = spacing[axis];
                    assert!((f64::from(shifted.spacing()[axis]) / s - 1.0).abs() < 1e-5, "{settings:?}");
                    let moved = (shifted.origin_world()[axis] - origin[axis]) / s - fraction[axis];
                    assert!((moved - moved.round()).abs() < 1e-3, "{settings:?}: {moved}");
                    let (first, last) = (shifted.origin_world()[axis], f64::from(after - 1) * s);
                    let slack = 1e-3 * s;
                    assert!(first <= low[axis] + slack && first + last >= high[axis] - slack, "{settings:?}");
                    // None is to spare.
                    assert!(first + s > low[axis] - slack && first + last - s < high[axis] + slack, "{settings:?}");
                }
            }
        }
    }
}

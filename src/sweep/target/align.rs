//! How a grid meets the walls between rooms.
//!
//! A voxel of the table of visibility that reaches through a wall has one answer for both of its sides. The floor on the lesser
//! side takes the light of the other room: in thin_wall, points within 3 cm of the feet of its walls, 0.3 % of all, hold half
//! of the squared error. Where a face of voxels lies in the wall there are none. So of spacings that are nearly alike, that is
//! taken whose voxels are parted by the walls.

use glam::DVec3;

use super::rule::rounded_up;

/// Points on a plane are so near to it, in sides of the box of all points (its longest).
const FLAT: f64 = 1e-5;
/// Least cosine of a normal to an axis.
const ALONG: f64 = 0.9999;
/// A plane has at least this share of all points, and so many lie on either side of it.
const LEAST_SHARE: f64 = 0.01;

/// Spacings that are tried, as a share of the one that was chosen.
const FINEST: f64 = 0.9;
const TRIED: u32 = 100;
/// Strips must become so much narrower for a finer spacing to be taken.
const GAIN: f64 = 0.5;
/// Strips so much wider than the narrowest are as good, metres per metre of spacing.
const ALIKE: f64 = 2e-3;

/// Walls along the axes that have surfaces on both sides.
pub struct Walls(Vec<Wall>);

struct Wall {
    axis: usize,
    at: f64,
    share: f64,
}

impl Walls {
    /// From points uniform over the area of surfaces, and their normals.
    pub fn of(points: &[(DVec3, DVec3)]) -> Walls {
        let low = points.iter().fold(DVec3::INFINITY, |low, p| low.min(p.0));
        let high = points.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(p.0));
        let near = FLAT * (high - low).max_element();
        let count = points.len() as f64;
        let mut walls = Vec::new();
        for axis in 0..3 {
            let is_on = |p: &&(DVec3, DVec3)| p.1[axis].abs() >= ALONG;
            let mut on: Vec<f64> = points.iter().filter(is_on).map(|p| p.0[axis]).collect();
            on.sort_unstable_by(f64::total_cmp);
            let is_large = |plane: &&[f64]| plane.len() as f64 >= LEAST_SHARE * count;
            for plane in on.chunk_by(|a, b| b - a <= near).filter(is_large) {
                let at = plane[plane.len() / 2];
                let below = points.iter().filter(|p| p.0[axis] < at - near).count();
                let above = points.iter().filter(|p| p.0[axis] > at + near).count();
                if below.min(above) as f64 >= LEAST_SHARE * count {
                    walls.push(Wall { axis, at, share: plane.len() as f64 / count });
                }
            }
        }
        Walls(walls)
    }

    /// Width of the strips beside walls that lie in a voxel with more of the other side, metres, weighted by the walls' share.
    fn strips(&self, origin: DVec3, voxel: DVec3) -> f64 {
        let of = |wall: &Wall| {
            let along = (wall.at - origin[wall.axis]) / voxel[wall.axis];
            wall.share * (along - along.round()).abs() * voxel[wall.axis]
        };
        self.0.iter().map(of).sum()
    }

    /// The spacing, or one a little finer whose voxels meet the walls better. `lattice`: origin and voxel of the grid of a
    /// spacing; `None` where it has none.
    pub fn aligned(&self, spacing_m: f64, lattice: impl Fn(f64) -> Option<(DVec3, DVec3)>) -> f64 {
        let strips = |spacing: f64| lattice(spacing).map(|(origin, voxel)| self.strips(origin, voxel));
        let Some(before) = strips(spacing_m).filter(|_| !self.0.is_empty()) else { return spacing_m };
        let finer = |i: u32| rounded_up(spacing_m * (1.0 - (1.0 - FINEST) * f64::from(i) / f64::from(TRIED)));
        let tried: Vec<(f64, f64)> = (0..=TRIED).map(finer).filter_map(|s| Some((s, strips(s)?))).collect();
        let least = tried.iter().map(|t| t.1).fold(before, f64::min);
        if least > GAIN * before {
            return spacing_m;
        }
        let shares: f64 = self.0.iter().map(|wall| wall.share).sum();
        let alike = least + ALIKE * shares * spacing_m;
        // The largest.
        tried.iter().find(|t| t.1 <= alike && t.1 <= GAIN * before).map_or(spacing_m, |t| t.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room from −3 to 3, with a wall at 1 whose one side has points; floors on either side.
    fn room() -> Vec<(DVec3, DVec3)> {
        let floor = (0..600).map(|i| (DVec3::new(-3.0 + 0.01 * f64::from(i), 0.0, 0.0), DVec3::Y));
        let wall = (0..100).map(|i| (DVec3::new(1.0, 0.02 * f64::from(i), 0.0), DVec3::NEG_X));
        let end = (0..100).map(|i| (DVec3::new(-3.0, 0.02 * f64::from(i), 0.0), DVec3::X));
        floor.chain(wall).chain(end).collect()
    }

    /// As grids are: planes symmetric about the middle, half a cell beyond the ends or more.
    fn lattice(spacing: f64) -> Option<(DVec3, DVec3)> {
        let cells = (6.0 / spacing).ceil();
        Some((DVec3::splat(-0.5 * cells * spacing), DVec3::splat(spacing / 8.0)))
    }

    #[test]
    fn walls_between_rooms_are_found_and_outer_ones_are_not() {
        let walls = Walls::of(&room());
        assert_eq!(walls.0.len(), 1);
        assert!((walls.0[0].axis, walls.0[0].at) == (0, 1.0) && (walls.0[0].share - 0.125).abs() < 1e-9);
    }

    /// Eight voxels a cell from a plane at 0 or half a cell: faces at 1 need 8/s to be whole.
    #[test]
    fn the_largest_spacing_is_taken_whose_voxels_a_wall_parts() {
        let walls = Walls::of(&room());
        for (spacing, expected) in [(0.75, 8.0 / 11.0), (0.375, 8.0 / 22.0), (0.5, 0.5), (1.0, 1.0)] {
            let found = walls.aligned(spacing, lattice);
            assert!((found / expected - 1.0).abs() < 2e-3, "{spacing}: {found}, not {expected}");
        }
        // Without walls nothing changes.
        assert_eq!(Walls::of(&[]).aligned(0.75, lattice), 0.75);
        assert_eq!(walls.aligned(0.75, |_| None), 0.75);
    }
}

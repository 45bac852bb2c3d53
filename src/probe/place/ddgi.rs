//! Relocation and classification of Majercik et al. 2021, from a few fixed rays of every probe.
//!
//! A probe is moved again and again until it stays. What its rays met decides:
//!
//! 1. more than `back_share` of all rays met backs: along the ray of the nearest back, by its distance and half of `min_front`
//!    more;
//! 2. the nearest front is nearer than `min_front`: towards the farthest front, by at most `max_step`, where that does not
//!    lead nearer to the nearest one; a ray that meets nothing counts as a front at infinity;
//! 3. else back towards the grid point, by no more than the nearest front is farther than `min_front`.
//!
//! An offset whose length, each axis divided by its spacing, is `max_offset` or more is refused, and the old one kept. From
//! where it comes to stand the probe is active where it is not inside geometry, and a front lies nearer along some ray than
//! the box of ±1 spacing around it ends.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::light::World;
use crate::math::fibonacci;
use crate::probe::lattice::ProbeState;
use crate::trace::Ray;

/// Lengths are in the smallest of the grid's three spacings; of mixed grids in as many of them as the probe's cell is wide. The sources' `min_front` and `max_step` are one unit of the
/// scene's; these are ours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DdgiSettings {
    /// Fixed rays of a probe. Captures of lone rays leave so many to it.
    pub rays: usize,
    /// Share of all rays above which backs tell that a probe is inside geometry.
    pub back_share: f32,
    /// Fronts nearer than this are moved away from.
    pub min_front: f32,
    /// Most that one step away from a front is long.
    pub max_step: f32,
    /// Most that a probe's offset may be, as the length of the vector whose axes are divided by their spacings.
    pub max_offset: f32,
    /// Most steps.
    pub max_steps: u32,
    pub relocate: bool,
    pub classify: bool,
}

impl Default for DdgiSettings {
    fn default() -> Self {
        DdgiSettings {
            rays: 32,
            back_share: 0.25,
            min_front: 0.2,
            max_step: 0.2,
            max_offset: 0.45,
            max_steps: 16,
            relocate: true,
            classify: true,
        }
    }
}

impl DdgiSettings {
    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        let rays = self.rays;
        rule("placement.rule.ddgi.rays", rays.to_string(), (1..=65_536).contains(&rays), "use 1 to 65536");
        for (key, value) in [
            ("placement.rule.ddgi.back_share", self.back_share),
            ("placement.rule.ddgi.min_front", self.min_front),
            ("placement.rule.ddgi.max_step", self.max_step),
            ("placement.rule.ddgi.max_offset", self.max_offset),
        ] {
            rule(key, value.to_string(), (0.0..=1.0).contains(&value), "use a number from 0 to 1");
        }
        let steps = self.max_steps;
        rule("placement.rule.ddgi.max_steps", steps.to_string(), steps <= 1024, "use 0 to 1024");
    }
}

/// What the fixed rays met.
#[derive(Debug, Clone, Default)]
struct Around {
    backs: usize,
    /// Distance and direction; `None` where there is none.
    nearest_back: Option<(f32, Vec3)>,
    nearest_front: Option<(f32, Vec3)>,
    /// Infinite where a ray met nothing.
    farthest_front: Option<(f32, Vec3)>,
    /// Whether a front lies within the box of ±1 spacing.
    front_in_box: bool,
}

/// Where a probe came to stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relocated {
    pub state: ProbeState,
    pub position: Vec3,
    pub moved: bool,
    /// Rays of all positions tried.
    pub rays: u64,
}

/// Moves and classifies the probe of a grid point; `cell`: the sides of the cell that it stands for, metres.
pub fn place(world: &World, cell: Vec3, settings: &DdgiSettings, grid_point: Vec3) -> Relocated {
    let mut offset = Vec3::ZERO;
    let mut around = look(world, cell, settings, grid_point);
    let mut rays = settings.rays as u64;
    let steps = if settings.relocate { settings.max_steps } else { 0 };
    for _ in 0..steps {
        let next = step(cell, settings, offset, &around);
        if next == offset {
            break;
        }
        offset = next;
        around = look(world, cell, settings, grid_point + offset);
        rays += settings.rays as u64;
    }
    let inside = is_inside(settings, &around);
    let active = !settings.classify || !inside && around.front_in_box;
    Relocated {
        state: if active { ProbeState::Active } else { ProbeState::NeverSampled },
        position: grid_point + offset,
        moved: offset != Vec3::ZERO,
        rays,
    }
}

fn look(world: &World, cell: Vec3, settings: &DdgiSettings, position: Vec3) -> Around {
    let mut around = Around::default();
    for i in 0..settings.rays {
        let direction = fibonacci::direction(i, settings.rays);
        // The same chance at every place: rays are fixed.
        let surface = world.surface(Ray::new(position, direction, i as u32));
        let (t, is_back) = surface.map_or((f32::INFINITY, false), |s| (s.hit.t, s.is_back()));
        around.add(t, direction, is_back, cell);
    }
    around
}

impl Around {
    fn add(&mut self, t: f32, direction: Vec3, is_back: bool, spacing: Vec3) {
        let found = Some((t, direction));
        if is_back {
            self.backs += 1;
            if self.nearest_back.is_none_or(|(nearest, _)| t < nearest) {
                self.nearest_back = found;
            }
            return;
        }
        if self.nearest_front.is_none_or(|(nearest, _)| t < nearest) {
            self.nearest_front = found;
        }
        if self.farthest_front.is_none_or(|(farthest, _)| t > farthest) {
            self.farthest_front = found;
        }
        // An axis that the ray does not move along is never left: infinity.
        let leaves = (spacing / direction.abs()).min_element();
        self.front_in_box |= t < leaves;
    }
}

fn is_inside(settings: &DdgiSettings, around: &Around) -> bool {
    around.backs as f32 > settings.back_share * settings.rays as f32
}

/// The offset after one step; the same where the probe stays.
fn step(cell: Vec3, settings: &DdgiSettings, offset: Vec3, around: &Around) -> Vec3 {
    let metres = cell.min_element();
    let min_front = settings.min_front * metres;
    let inside = is_inside(settings, around);
    let next = match (around.nearest_back, around.nearest_front, around.farthest_front) {
        (Some((t, direction)), _, _) if inside => offset + direction * (t + 0.5 * min_front),
        (_, Some((near, to_near)), Some((far, to_far))) if near < min_front => {
            if to_near.dot(to_far) > 0.0 {
                return offset;
            }
            offset + to_far * far.min(settings.max_step * metres)
        }
        (_, Some((near, _)), _) => offset - offset.normalize_or_zero() * (near - min_front).min(offset.length()),
        _ => return offset,
    };
    let allowed = (next / cell).length() < settings.max_offset;
    if allowed { next } else { offset }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: Vec3 = Vec3::new(1.0, 2.0, 1.0);

    /// What four rays met: (distance, direction, back).
    fn around(rays: &[(f32, Vec3, bool)]) -> (DdgiSettings, Around) {
        let mut found = Around::default();
        rays.iter().for_each(|&(t, d, back)| found.add(t, d, back, CELL));
        (DdgiSettings { rays: rays.len(), ..Default::default() }, found)
    }

    fn stepped(offset: Vec3, rays: &[(f32, Vec3, bool)]) -> Vec3 {
        let (settings, around) = around(rays);
        step(CELL, &settings, offset, &around)
    }

    #[test]
    fn probes_leave_geometry_through_the_nearest_back() {
        let rays = [(0.2, Vec3::X, true), (0.1, Vec3::NEG_Y, true), (0.5, Vec3::Z, false), (0.5, Vec3::NEG_Z, false)];
        // By 0.1 and half of 0.2.
        assert_eq!(stepped(Vec3::ZERO, &rays), Vec3::NEG_Y * 0.2);
        // A quarter of the rays is not more than a quarter.
        let fewer = [(0.1, Vec3::X, true), rays[2], rays[3], (9.0, Vec3::Y, false)];
        assert_eq!(stepped(Vec3::ZERO, &fewer), Vec3::ZERO);
        // 0.35 along x of a spacing of 1, and 0.2 more: 0.55 is beyond 0.45, and so is refused; along y of 2 it is not.
        let far = |d: Vec3| [(0.45, d, true), (0.5, d, true), rays[2], rays[3]];
        assert_eq!(stepped(Vec3::ZERO, &far(Vec3::X)), Vec3::ZERO);
        assert_eq!(stepped(Vec3::ZERO, &far(Vec3::Y)), Vec3::Y * 0.55);
    }

    #[test]
    fn probes_move_away_from_fronts_towards_the_farthest() {
        let near = (0.05, Vec3::X, false);
        let open = (f32::INFINITY, Vec3::NEG_X, false);
        // By the longest step, as nothing is there.
        assert_eq!(stepped(Vec3::ZERO, &[near, open]), Vec3::NEG_X * 0.2);
        // No farther than the farthest front.
        assert_eq!(stepped(Vec3::ZERO, &[near, (0.1, Vec3::NEG_X, false)]), Vec3::NEG_X * 0.1);
        // Not where that leads nearer to the nearest one.
        let same_side = Vec3::new(0.6, 0.8, 0.0);
        assert_eq!(stepped(Vec3::ZERO, &[near, (9.0, same_side, false)]), Vec3::ZERO);
    }

    #[test]
    fn probes_return_to_their_grid_points_where_there_is_room() {
        let offset = Vec3::X * 0.3;
        // 0.25 − 0.2 back, not the whole way; then the whole way.
        let back = stepped(offset, &[(0.25, Vec3::NEG_X, false), (9.0, Vec3::Y, false)]);
        assert!((back - Vec3::X * 0.25).length() < 1e-6, "{back}");
        assert_eq!(stepped(offset, &[(0.9, Vec3::NEG_X, false), (9.0, Vec3::Y, false)]), Vec3::ZERO);
    }

    #[test]
    fn fronts_count_within_the_box_of_one_spacing() {
        let in_box = |t: f32, d: Vec3| around(&[(t, d, false)]).1.front_in_box;
        assert!(in_box(0.99, Vec3::X) && !in_box(1.01, Vec3::X));
        assert!(in_box(1.99, Vec3::Y) && !in_box(2.01, Vec3::Y));
        // Towards a corner of the box's xz square: √2 away.
        let corner = Vec3::new(1.0, 0.0, 1.0).normalize();
        assert!(in_box(1.41, corner) && !in_box(1.42, corner));
        assert!(!around(&[(0.5, Vec3::X, true)]).1.front_in_box, "a back is no front");
    }
}

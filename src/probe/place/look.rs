//! What the surfaces of one voxel that face one way see of their cell's eight probes.

use glam::{Vec2, Vec3};

use super::piece::Piece;
use super::placement::Placement;
use super::settings::SurveySettings;
use super::surveyor::{Met, Surveyor};
use super::tally::Tally;
use crate::light::contact::{Facet, sight_line};
use crate::math::random::{KroneckerSequence, Purpose, Random, unit_from_bits};
use crate::probe::lattice::grid::CellIndex;
use crate::probe::store::surface::{Facing, active_corners, key, voxel_of_key};
use crate::scene::TriangleIndex;
use crate::trace::Ray;
use crate::trace::offset::ray_offset;

/// One side of a triangle in a voxel.
#[derive(Debug, Clone, Copy)]
struct Side {
    triangle: TriangleIndex,
    /// Whether this is the back of the triangle.
    is_back: bool,
}

/// What is known of one side of a voxel.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    pub cell: CellIndex,
    pub key: u16,
    pub mask: u8,
    pub is_front: bool,
    pub open: Option<Vec3>,
    /// Whether anything there asks: not the inside of a solid, nor a voxel that an edge merely touches.
    pub asks: bool,
    pub rays: u64,
}

/// How closely the surfaces of a voxel are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// From one point of a surface that is alone there, from the first points of several.
    Glance,
    /// From the first points: no one around sees a probe, but some have room before them.
    Room,
    /// From more points where the first disagree, or see no probe.
    Whole,
}

/// A look from the surfaces of a voxel that face one way.
pub struct Look<'a, 's> {
    surveyor: &'a Surveyor<'a, 's>,
    placement: &'a Placement,
    /// All that the voxel has, by triangle.
    met: &'a [Met],
    facing: Facing,
}

/// The looks from all surfaces of one voxel, by their keys.
pub fn looks<'a, 's>(
    surveyor: &'a Surveyor<'a, 's>,
    placement: &'a Placement,
    met: &'a [Met],
) -> impl Iterator<Item = Look<'a, 's>> {
    let any = move |&facing: &Facing| met.iter().any(|m| m.facing == facing || m.facing == facing.opposite());
    let faced = Facing::ALL.into_iter().filter(any);
    faced.map(move |facing| Look { surveyor, placement, met, facing })
}

impl Look<'_, '_> {
    fn cell(&self) -> CellIndex {
        self.met[0].cell
    }

    fn key(&self) -> u16 {
        let n = self.surveyor.n;
        key(voxel_of_key(self.met[0].voxel_key, n), self.facing, n)
    }

    pub fn look(&self, depth: Depth) -> Found {
        let Surveyor { grid, world, n, settings, .. } = *self.surveyor;
        let (cell, key) = (self.cell(), self.key());
        let side = |m: &Met| {
            let is_back = m.facing == self.facing.opposite();
            (is_back || m.facing == self.facing).then_some(Side { triangle: TriangleIndex(m.triangle), is_back })
        };
        let sides: Vec<Side> = self.met.iter().filter_map(side).collect();
        // Backs of surfaces that have only fronts are asked for where nothing else is.
        let is_outside = |side: &Side| !side.is_back || world.scene.material(side.triangle).double_sided;
        let is_front = sides.iter().any(is_outside);
        let mut found = Found { cell, key, mask: 0, is_front, open: None, asks: false, rays: 0 };
        let active = active_corners(grid, &self.placement.states, cell);
        if active == 0 {
            return found;
        }
        let centre = voxel_of_key(key, n).as_vec3() + 0.5;
        let piece = |side: &Side| {
            let corners = self.surveyor.mesh().corners(side.triangle);
            Piece::new(corners.map(|c| self.surveyor.in_voxels(cell, c) - centre), settings.voxel_margin)
        };
        let all = |counts: &dyn Fn(&Side) -> bool, has_area: bool| -> Vec<(&Side, Piece)> {
            let pieces = sides.iter().filter(|side| counts(side)).map(|side| (side, piece(side)));
            pieces.filter(|(_, piece)| (piece.area > 0.0) == has_area).collect()
        };
        // Outsides, backs, and what but touches the voxel: the next only where those before see no probe.
        for tier in 0..3 {
            let (pieces, search) = match tier {
                0 => (all(&is_outside, true), settings.search_points),
                1 => (all(&|side| !is_outside(side), true), settings.first_points),
                _ => (all(&|_| true, false), settings.first_points),
            };
            found.asks |= tier == 0 && !pieces.is_empty();
            if pieces.is_empty() {
                continue;
            }
            let tally = self.tally(&pieces, active, search, tier, depth);
            found.rays += tally.rays;
            found.open = if tier == 0 { tally.open } else { found.open };
            if tally.points > 0 {
                found.mask = tally.majority();
                break;
            }
        }
        found.asks |= found.mask != 0;
        found.open = found.open.filter(|_| found.mask == 0);
        found
    }

    /// Rays from points of these pieces, spread evenly over their area. Up to `search` points are tried until one sees any
    /// probe.
    fn tally(&self, pieces: &[(&Side, Piece)], active: u8, search: u32, tier: u64, depth: Depth) -> Tally {
        let Surveyor { grid, world, settings, .. } = *self.surveyor;
        let (cell, key) = (self.cell(), self.key());
        let probes = grid.corners(cell);
        let area: f32 = pieces.iter().map(|(_, piece)| piece.area).sum();
        let SurveySettings { first_points, all_points, .. } = *settings;
        // Several surfaces may see differently.
        let first = match depth {
            Depth::Glance if pieces.len() == 1 || tier == 1 => 1,
            _ => first_points.max((pieces.len() as u32).min(all_points / 2)),
        };
        let mut random = Random::new(0, Purpose::SurfaceVisibility, u64::from(cell.0) << 16 | u64::from(key), tier);
        let mut points = KroneckerSequence::new(&mut random);
        let mut tally = Tally::default();
        for tried in 0.. {
            let enough = match tally.points {
                0 if depth == Depth::Whole => search,
                _ if tally.agrees() => first,
                _ => all_points,
            };
            let (true, Some([place, x, y, salt])) = (tried < enough, points.next()) else { break };
            let (side, barycentric) =
                point(pieces, area * unit_from_bits(place), Vec2::new(unit_from_bits(x), unit_from_bits(y)));
            let triangle = side.triangle;
            let corners = &self.surveyor.mesh().corners(triangle);
            let front = self.surveyor.mesh().geometric_normal(triangle);
            let position =
                corners[0] + (corners[1] - corners[0]) * barycentric.x + (corners[2] - corners[0]) * barycentric.y;
            let normal = if side.is_back { -front } else { front };
            let facet = Facet { position, normal, offset: ray_offset(corners) };
            // Where the first points see nothing, the others mostly lie inside a solid or in a crack, and what only has a
            // front is seen from behind inside of solids: one ray tells.
            let is_last_hope = tried >= first && tally.points == 0;
            if is_last_hope || tier == 1 {
                tally.rays += 1;
                let least = if is_last_hope { self.crack() } else { 0.0 };
                if self.room(&facet, salt).is_none_or(|room| room <= least) {
                    continue;
                }
            }
            let mut seen = 0u8;
            for (corner, probe) in probes.iter().enumerate().filter(|(corner, _)| active >> corner & 1 == 1) {
                let probe = probe.0 as usize;
                let line = sight_line(&facet, self.placement.positions[probe], self.placement.contacts.of(probe));
                let Some((origin, target)) = line else { continue };
                tally.rays += 1;
                // From the surface: most rays that are blocked are blocked near it, where walls and solids meet, and
                // Embree looks there first.
                let salt = salt.wrapping_add(corner as u32);
                seen |= u8::from(!world.tracer.occluded(Ray::segment(origin, target, salt))) << corner;
            }
            tally.points += u32::from(seen != 0);
            if seen == 0 && tally.open.is_none() {
                tally.rays += 1;
                let room = self.room(&facet, salt).filter(|room| *room > self.crack());
                tally.open = room.map(|_| position + normal * self.crack());
            }
            (0..8).for_each(|corner| tally.visible[corner] += u32::from(seen >> corner & 1));
        }
        tally
    }

    /// How far it is from a point to what it faces, metres. `None` inside of a solid, where that is a back.
    fn room(&self, facet: &Facet, salt: u32) -> Option<f32> {
        let origin = facet.position + facet.normal * facet.offset;
        match self.surveyor.world.surface(Ray::new(origin, facet.normal, salt)) {
            Some(surface) => (!surface.is_back()).then_some(surface.hit.t),
            None => Some(f32::INFINITY),
        }
    }

    /// Metres: what lies this close before a surface leaves no room for anyone who asks, as between tiles and a wall.
    fn crack(&self) -> f32 {
        /// Voxels.
        const CRACK: f32 = 0.5;
        let Surveyor { grid, n, .. } = *self.surveyor;
        CRACK * grid.cell_box(self.cell()).1.min_element() / n as f32
    }
}

/// The side at a place within the pieces' whole area, and barycentric coordinates of a point of it. Pieces without any area
/// take turns.
fn point<'p>(pieces: &[(&'p Side, Piece)], place: f32, u: Vec2) -> (&'p Side, Vec2) {
    let mut left = place;
    for (side, piece) in pieces {
        if left < piece.area {
            return (side, piece.point(left, u));
        }
        left -= piece.area;
    }
    let (side, piece) = &pieces[(u.x * pieces.len() as f32) as usize % pieces.len()];
    (side, piece.point(u.y * piece.area, u))
}

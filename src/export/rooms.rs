//! One block for each closed room: what plain filtering cannot tell apart lies in different blocks then.
//!
//! Rooms are what probes of the lattice see of each other from neighbour to neighbour along the axes. A room's block is the
//! box of its air, up to the walls. Its probes stand at the centres of cells of about the lattice's size, and hold what the
//! method's own look-up gives there with exact visibility.

use glam::{UVec3, Vec3, Vec3A};
use rayon::prelude::*;

use super::block::Block;
use super::grids::Grids;
use super::holes;
use super::made::{form, one_block};
use super::reader::Reader;
use super::record::Notes;
use super::rules::Rules;
use crate::light::World;
use crate::light::contact::Contacts;
use crate::probe::lattice::grid::CellIndex;
use crate::probe::query::{Answers, Query, QueryPoint, QuerySettings, Visibility};
use crate::probe::store::surface::Facing;
use crate::probe::{Grid, ProbeIndex, Volume};
use crate::trace::Ray;

/// Probes of the smallest room. Fewer stand in pockets: within furniture, under a roof.
const SMALLEST: usize = 4;

/// Spacings. What is thinner is the inside of a wall.
const THINNEST: f32 = 0.5;

/// Spacings that rays may find a room shorter than it is.
const ROUNDING: f32 = 0.01;

/// By which a block reaches into the walls around it, spacings: surfaces lie in it, whatever rounding makes of them.
const INTO_WALLS: f32 = 0.01;

/// A room: the box of its air, and how many probes stand in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    pub low: Vec3,
    pub high: Vec3,
    pub probes: usize,
}

/// Blocks of rooms, what is noted of their probes, and what the user should know.
pub struct Blocks {
    pub grids: Grids,
    pub notes: Vec<Notes>,
    pub warnings: Vec<String>,
}

/// A block for each room, large ones first. Where probes stand outside of all rooms one of the whole lattice comes before them,
/// as far as the engine's rules take the last.
pub fn blocks(world: &World, volume: &Volume, query: &QuerySettings, rules: Rules) -> Blocks {
    let mut rooms = without_shells(&rooms(world, volume));
    // An engine that takes the mean of all volumes would mix what is closed to what is around it.
    if !rules.takes_last() {
        rooms = without_pockets(&rooms);
    }
    if rooms.len() < 2 {
        let (grids, notes) = one_block(volume, query, rules);
        let warnings = vec!["--volumes auto found no two rooms that are closed to each other: one volume".to_owned()];
        return Blocks { grids, notes, warnings };
    }
    let mut warnings = overlaps(&rooms, &volume.grid);
    let strays = strays(volume, &rooms);
    if strays > 0 && !rules.takes_last() {
        warnings.push(format!("{strays} probes stand outside of all rooms: surfaces there get no light"));
    }
    let (mut own, mut notes, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
    if strays > 0 && rules.takes_last() {
        let (grids, own_notes) = one_block(volume, query, rules);
        blocks.extend(grids.blocks);
        own.push(grids.values);
        notes.extend(own_notes);
    }
    let look_up = Query { volume, settings: query };
    let reader = Reader::new(look_up, form(rules));
    let contacts = Contacts::of_points(world.scene, &volume.positions);
    for room in &rooms {
        let size = room.high - room.low;
        // As many as planes of the lattice fit into the room.
        let divisions = (size / volume.grid.spacing() + ROUNDING).floor().as_uvec3() + UVec3::ONE;
        let margin = size / divisions.as_vec3() * INTO_WALLS;
        let start = blocks.iter().map(Block::count).sum::<usize>() as u32;
        let block = Block::filling(room.low - margin, room.high + margin, divisions, start);
        let at = |position: Vec3| {
            let visibility = Visibility::Exact(seen(world, &look_up, &contacts, position));
            reader.of_places(&[(position, 1.0, visibility)])
        };
        let known: Vec<Option<Vec<Vec3A>>> = block.positions().collect::<Vec<_>>().into_par_iter().map(at).collect();
        let (values, holes) = holes::filled(&reader, &block, known);
        own.push(values.concat());
        notes.push(Notes { holes, moved: Vec::new() });
        blocks.push(block);
    }
    let mut grids = Grids::new(rules, volume.grid.uniform(), blocks);
    grids.values = own.concat();
    Blocks { grids, notes, warnings }
}

/// Whether most of a box lies in another.
fn holds(outer: &Room, inner: &Room) -> bool {
    /// Share of the inner one.
    const MOST: f32 = 0.5;
    size(outer.low.max(inner.low), outer.high.min(inner.high)) > MOST * size(inner.low, inner.high)
}

fn size(low: Vec3, high: Vec3) -> f32 {
    (high - low).max(Vec3::ZERO).element_product()
}

/// Rooms, from large to small, without those that consist of others for the most part: the open air around a house does.
pub fn without_shells(rooms: &[Room]) -> Vec<Room> {
    /// Share of the shell that the others in it have.
    const FILLED: f32 = 0.5;
    let is_room = |(i, room): &(usize, &Room)| {
        let within = rooms[i + 1..].iter().filter(|other| holds(room, other));
        within.map(|other| size(other.low, other.high)).sum::<f32>() <= FILLED * size(room.low, room.high)
    };
    rooms.iter().enumerate().filter(is_room).map(|(_, room)| *room).collect()
}

/// The same without those within others: the insides of cupboards.
pub fn without_pockets(rooms: &[Room]) -> Vec<Room> {
    let is_room = |(i, room): &(usize, &Room)| !rooms[..*i].iter().any(|larger| holds(larger, room));
    rooms.iter().enumerate().filter(is_room).map(|(_, room)| *room).collect()
}

/// Which of the probes around a place are in sight of it.
fn seen(world: &World, look_up: &Query, contacts: &Contacts, position: Vec3) -> u8 {
    let normal = Vec3::Y;
    let point = QueryPoint { position, normal, geometric: normal, facing: Facing::of(normal), view: normal };
    let corners = Answers::corners(look_up, &point);
    corners.into_iter().enumerate().fold(0, |mask, (i, probe)| {
        let contact = contacts.of(probe.0 as usize);
        let target = contact.map_or(look_up.volume.position(probe), |contact| contact.target(position));
        let sees = || !world.tracer.occluded(Ray::segment(position, target, i as u32));
        mask | u8::from(look_up.volume.is_active(probe) && sees()) << i
    })
}

/// The rooms of a volume, from large to small.
pub fn rooms(world: &World, volume: &Volume) -> Vec<Room> {
    let contacts = Contacts::of_points(world.scene, &volume.positions);
    let spacing = volume.grid.spacing();
    let scene = world.scene.mesh.bounds().unwrap_or((Vec3::NEG_INFINITY, Vec3::INFINITY));
    let room = |own: &Vec<usize>| {
        let viewpoint = |probe: usize| contacts.viewpoint(probe, volume.positions[probe]);
        let reaches: Vec<[[End; 3]; 2]> =
            own.par_iter().map(|&probe| reach(world, volume, viewpoint(probe), probe)).collect();
        let along = |side: usize, sign: f32| {
            let face = |axis: usize| {
                let ends = reaches.iter().map(|reach| reach[side][axis]);
                sign * face(ends.map(|end| End { at: sign * end.at, ..end }).collect(), spacing[axis])
            };
            Vec3::from([0, 1, 2].map(face))
        };
        let (low, high) = (along(0, -1.0), along(1, 1.0));
        // Air beyond the scene lights nothing.
        Room { low: low.max(scene.0), high: high.min(scene.1), probes: own.len() }
    };
    let mut rooms: Vec<Room> = members(world, volume).iter().map(room).collect();
    rooms.retain(|room| ((room.high - room.low) / spacing).min_element() > THINNEST);
    let volume_of = |room: &Room| (room.high - room.low).element_product();
    rooms.sort_by(|a, b| volume_of(b).total_cmp(&volume_of(a)));
    rooms
}

/// How far air reaches in one direction.
#[derive(Debug, Clone, Copy)]
struct End {
    /// Along its axis, relative to the scene's origin, metres.
    at: f32,
    /// Whether a surface ends it, and not merely the probe's cell.
    is_wall: bool,
}

/// Where a room ends: the middle of the walls within a spacing of the farthest end, so that it ends at the wall around a door
/// and not behind it, and at the ceiling and not at a lamp.
fn face(ends: Vec<End>, spacing: f32) -> f32 {
    let farthest = ends.iter().map(|end| end.at).fold(f32::NEG_INFINITY, f32::max);
    let is_near = |end: &End| end.is_wall && end.at > farthest - spacing;
    let mut walls: Vec<f32> = ends.into_iter().filter(is_near).map(|end| end.at).collect();
    walls.sort_by(f32::total_cmp);
    walls.get(walls.len() / 2).copied().unwrap_or(farthest)
}

/// How many active probes stand in no room's box.
fn strays(volume: &Volume, rooms: &[Room]) -> usize {
    let margin = INTO_WALLS * volume.grid.spacing();
    let holds = |room: &Room, p: Vec3| p.cmpge(room.low - margin).all() && p.cmple(room.high + margin).all();
    let is_stray = |probe: &usize| !rooms.iter().any(|room| holds(room, volume.positions[*probe]));
    volume.active().filter(is_stray).count()
}

/// A warning where cells have probes of two rooms: plain filtering mixes their light there.
pub fn shared(world: &World, volume: &Volume) -> Option<String> {
    let members = members(world, volume);
    let mut room = vec![usize::MAX; volume.states.len()];
    for (number, own) in members.iter().enumerate() {
        own.iter().for_each(|&probe| room[probe] = number);
    }
    let grid = &volume.grid;
    let is_shared = |cell: &CellIndex| {
        let corners = grid.corners(*cell).map(|probe| room[probe.0 as usize]);
        let known = || corners.into_iter().filter(|room| *room != usize::MAX);
        known().min() != known().max()
    };
    let found: Vec<CellIndex> = grid.cells().filter(is_shared).collect();
    let first = found.first()?;
    let (low, sides) = grid.cell_box(*first);
    let at = grid.origin_world() + (low + 0.5 * sides - grid.origin()).as_dvec3();
    let number = found.len();
    Some(format!(
        "{number} cells have probes of two rooms, the first at {:.2}, {:.2}, {:.2}: light passes their walls; \
         --volumes auto makes a volume for each room",
        at.x, at.y, at.z
    ))
}

/// The probes of each room, in the order of their lowest.
fn members(world: &World, volume: &Volume) -> Vec<Vec<usize>> {
    let grid = &volume.grid;
    let contacts = Contacts::of_points(world.scene, &volume.positions);
    let viewpoint = |probe: usize| contacts.viewpoint(probe, volume.positions[probe]);
    // A mixed grid's probes stand for many points, and so have many neighbours.
    let uniform = grid.uniform();
    let probe_at = |coordinate: UVec3| {
        let divisions = uniform.divisions();
        let point = coordinate.x + divisions.x * (coordinate.y + divisions.y * coordinate.z);
        grid.tree().map_or(point, |tree| tree.probe(coordinate)) as usize
    };
    let neighbours = |point: ProbeIndex| -> Vec<(usize, usize)> {
        let coordinate = uniform.coordinate(point);
        let own = probe_at(coordinate);
        let next = [UVec3::X, UVec3::Y, UVec3::Z].map(|step| coordinate + step);
        let inside = next.into_iter().filter(|next| next.cmplt(uniform.divisions()).all());
        let active = |probe: usize| volume.is_active(ProbeIndex(probe as u32));
        let sees = |&other: &usize| {
            let is_pair = own != other && active(own) && active(other);
            is_pair && !world.tracer.occluded(Ray::segment(viewpoint(own), viewpoint(other), 0))
        };
        inside.map(probe_at).filter(sees).map(|other| (own, other)).collect()
    };
    let points: Vec<ProbeIndex> = uniform.probes().collect();
    let pairs: Vec<(usize, usize)> = points.into_par_iter().flat_map_iter(neighbours).collect();
    let mut parent: Vec<usize> = (0..volume.states.len()).collect();
    for (a, b) in pairs {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        // The lower number wins, so that the order of the pairs makes no difference.
        parent[a.max(b)] = a.min(b);
    }
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); parent.len()];
    for probe in volume.active() {
        let root = root(&mut parent, probe);
        members[root].push(probe);
    }
    members.retain(|own| own.len() >= SMALLEST);
    members
}

/// How far the air reaches from a probe against the axes and along them, to the next surface or to its cell's end.
fn reach(world: &World, volume: &Volume, from: Vec3, probe: usize) -> [[End; 3]; 2] {
    let spacing = volume.grid.spacing() * volume.grid.width(ProbeIndex(probe as u32)) as f32;
    [-1.0, 1.0].map(|sign| {
        [0, 1, 2].map(|axis| {
            let ray = Ray::new(from, sign * Vec3::AXES[axis], axis as u32);
            let met = world.tracer.closest(ray).map_or(f32::INFINITY, |hit| hit.t);
            End { at: from[axis] + sign * met.min(spacing[axis]), is_wall: met <= spacing[axis] }
        })
    })
}

fn root(parent: &mut [usize], mut probe: usize) -> usize {
    while parent[probe] != probe {
        parent[probe] = parent[parent[probe]];
        probe = parent[probe];
    }
    probe
}

/// Which boxes of rooms hold places of two rooms. One that lies wholly within another is none: it counts alone there.
fn overlaps(rooms: &[Room], frame: &Grid) -> Vec<String> {
    /// Metres that rays and walls leave open.
    const TOUCHING: f32 = 1e-3;
    let mut found = Vec::new();
    for (i, a) in rooms.iter().enumerate() {
        for b in &rooms[i + 1..] {
            let (low, high) = (a.low.max(b.low), a.high.min(b.high));
            let size = high - low;
            let is_within = (b.high - b.low - size).max_element() < TOUCHING;
            if size.min_element() > TOUCHING && !is_within {
                let at = frame.origin_world() + (0.5 * (low + high) - frame.origin()).as_dvec3();
                found.push(format!(
                    "two volumes share {:.2} × {:.2} × {:.2} m around {:.2}, {:.2}, {:.2}: surfaces of one room get light of \
                     the other there",
                    size.x, size.y, size.z, at.x, at.y, at.z
                ));
            }
        }
    }
    found
}

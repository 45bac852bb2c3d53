//! One block for each room: what plain filtering cannot tell apart lies in different blocks then.
//!
//! [`parts`] says which probes share a room, [`room`] makes boxes of their air, up to the walls, and [`openings`] finds the
//! doors between boxes, which get a block of their own that reaches one layer into both rooms. Probes of a block stand at the
//! centres of cells of about the lattice's size, and hold what the method's own look-up gives there with exact visibility.

mod openings;
mod parts;
mod room;
mod warnings;

use glam::{UVec3, Vec3, Vec3A};
use rayon::prelude::*;

use super::block::Block;
use super::grids::Grids;
use super::holes;
use super::made::{form, one_block};
use super::reader::Reader;
use super::record::Notes;
use super::rules::Rules;
use super::sight::Sight;
use crate::light::World;
use crate::probe::Volume;
use crate::probe::query::{Query, QuerySettings};

pub use self::openings::openings;
pub use self::room::{Room, rooms, without_pockets, without_shells};
pub use self::warnings::shared;

/// Spacings that rays may find a room shorter than it is.
const ROUNDING: f32 = 0.01;

/// By which a block reaches into the walls around it, spacings: surfaces lie in it, whatever rounding makes of them.
const INTO_WALLS: f32 = 0.01;

/// Blocks of rooms, what is noted of their probes, and what the user should know.
pub struct Blocks {
    pub grids: Grids,
    pub notes: Vec<Notes>,
    pub warnings: Vec<String>,
}

/// A block for each room, large ones first, and then one for each opening between them. Where probes stand outside of all of
/// these, one of the whole lattice comes before them, as far as the engine's rules take the last.
pub fn blocks(world: &World, volume: &Volume, query: &QuerySettings, rules: Rules) -> Blocks {
    let mut rooms = without_shells(&rooms(world, volume));
    // An engine that takes the mean of all volumes would mix what is closed to what is around it.
    if !rules.takes_last() {
        rooms = without_pockets(&rooms);
    }
    if rooms.len() < 2 {
        let (grids, notes) = one_block(volume, query, rules, Some(world));
        let warnings = vec!["--volumes auto found no two rooms: one volume".to_owned()];
        return Blocks { grids, notes, warnings };
    }
    let mut warnings = warnings::overlaps(&rooms, &volume.grid);
    let boxes = [rooms.clone(), openings(world, &rooms, volume.grid.spacing())].concat();
    let strays = warnings::strays(volume, &boxes, INTO_WALLS);
    if strays > 0 && !rules.takes_last() {
        warnings.push(format!("{strays} probes stand outside of all rooms: surfaces there get no light"));
    }
    if let Some(most) = rules.most_blocks().filter(|most| boxes.len() > *most) {
        let number = boxes.len();
        warnings.push(format!("{number} volumes, of which the engine takes the {most} nearest to the camera"));
    }
    let (mut own, mut notes, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
    if strays > 0 && rules.takes_last() {
        let (grids, own_notes) = one_block(volume, query, rules, Some(world));
        blocks.extend(grids.blocks);
        own.push(grids.values);
        notes.extend(own_notes);
    }
    let look_up = Query { volume, settings: query };
    let (reader, sight) = (Reader::new(look_up, form(rules)), Sight::new(world, volume));
    for room in &boxes {
        let start = blocks.iter().map(Block::count).sum::<usize>() as u32;
        let block = block(room, volume.grid.spacing(), start);
        let at = |position: Vec3| reader.of_places(&[(position, 1.0, sight.around(&look_up, position))]);
        let known: Vec<Option<Vec<Vec3A>>> = block.positions().collect::<Vec<_>>().into_par_iter().map(at).collect();
        let (values, holes) = holes::filled(&reader, &block, known, Some(&sight));
        own.push(values.concat());
        notes.push(Notes { holes, moved: Vec::new() });
        blocks.push(block);
    }
    let mut grids = Grids::new(rules, volume.grid.uniform(), blocks);
    grids.values = own.concat();
    Blocks { grids, notes, warnings }
}

/// The block of a box, with as many probes as planes of the lattice fit into it.
fn block(room: &Room, spacing: Vec3, start: u32) -> Block {
    let size = room.high - room.low;
    let divisions = (size / spacing + ROUNDING).floor().as_uvec3() + UVec3::ONE;
    let margin = size / divisions.as_vec3() * INTO_WALLS;
    Block::filling(room.low - margin, room.high + margin, divisions, start)
}

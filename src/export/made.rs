//! A volume in the form in which an engine stores it.

use glam::Vec3;

use super::block::Block;
use super::grids::Grids;
use super::holes;
use super::reader::{AXES, Form, Reader};
use super::record::{Moved, Notes, Number, VolumeRecord};
use super::rules::Rules;
use super::sight::Sight;
use crate::light::World;
use crate::probe::query::{Query, QuerySettings};
use crate::probe::{Grid, Volume};

/// The form in which an engine's rules store irradiance.
pub fn form(rules: Rules) -> Form {
    match rules {
        Rules::Three => Form::Harmonics,
        Rules::Bevy => Form::Along(AXES.to_vec()),
    }
}

/// A volume as one block: the probes of its lattice where they are active, neighbours' light where they are not. Where the
/// scene is known, rays tell which neighbours.
pub fn one_block(volume: &Volume, query: &QuerySettings, rules: Rules, world: Option<&World>) -> (Grids, Vec<Notes>) {
    let uniform = volume.grid.uniform();
    let block = Block::of(&uniform);
    let reader = Reader::new(Query { volume, settings: query }, form(rules));
    let found: Vec<_> = (0..block.count() as u32).map(|i| reader.at(block.coordinate(i))).collect();
    let known = found.iter().map(|found| found.map(|(probe, _)| reader.of_probe(probe))).collect();
    let sight = world.map(|world| Sight::new(world, volume));
    let (values, holes) = holes::filled(&reader, &block, known, sight.as_ref());
    let mut grids = Grids::new(rules, uniform, vec![block]);
    values.iter().enumerate().for_each(|(probe, values)| grids.set_probe(probe, values));
    let moved = moved(&found, volume.grid.spacing_min());
    (grids, vec![Notes { holes, moved }])
}

/// Which probes stand elsewhere than an engine takes them to.
pub fn moved(found: &[Option<(usize, Vec3)>], spacing: f32) -> Vec<Moved> {
    /// Spacings that rounding moves a probe by at most.
    const ROUNDING: f32 = 1e-3;
    let of = |(i, found): (usize, &Option<(usize, Vec3)>)| {
        let offset = found.map(|(_, offset)| offset).filter(|offset| offset.length() > ROUNDING * spacing)?;
        Some(Moved { probe: i as u32, offset: offset.to_array() })
    };
    found.iter().enumerate().filter_map(of).collect()
}

/// What a volume's record begins with.
pub fn volume_record(frame: &Grid, block: &Block, index: usize, notes: &Notes) -> VolumeRecord {
    let (low, high) = block.bounds();
    // In f64, so that a corner far from the origin keeps the digits of the box.
    let world = |p: Vec3| (frame.origin_world() + (p - frame.origin()).as_dvec3()).to_array();
    VolumeRecord {
        file: format!("probes.{index}"),
        number: Number::Half,
        resolution: block.divisions.to_array(),
        min: world(low),
        max: world(high),
        priority: index as u32,
        engine: serde_json::Value::Null,
        holes: notes.holes.clone(),
        moved: notes.moved.clone(),
    }
}

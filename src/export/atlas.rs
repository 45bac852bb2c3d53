//! The maps of all probes in one picture, for people.
//!
//! Every probe is a square of octahedral texels with their border, pole +Z; row z of a plane of the grid is a row of squares,
//! and the planes stand beside each other along y, as in DDGI. Probes without light are black.

use glam::{UVec3, Vec3};
use serde_json::json;

use super::block::Block;
use super::made::{moved, volume_record};
use super::reader::{Form, Reader};
use super::record::{ExportError, File, Notes, Number, VolumeRecord};
use crate::image::exr_bytes;
use crate::math::octahedral::texel_direction;
use crate::probe::Volume;
use crate::probe::query::{Query, QuerySettings};
use crate::probe::store::irradiance::Fineness;
use crate::probe::store::map::fill_with_border;

pub const NOTE: &str = "Irradiance, linear Rec. 709, W·m⁻², one octahedral map a probe, pole +Z, border of one texel; squares \
    run along x, rows along z, planes along y stand beside each other. For people: no engine reads it.";

/// Where a probe's square lies in an atlas of planes beside each other.
pub fn square(divisions: UVec3, coordinate: UVec3) -> (u32, u32) {
    (coordinate.x + divisions.x * coordinate.y, coordinate.z)
}

/// The atlas of squares of `side` texels that `of_probe` gives, row by row, and its size in texels.
pub fn atlas<T: Copy + Default>(block: &Block, side: usize, of_probe: impl Fn(u32) -> Vec<T>) -> (Vec<T>, u32, u32) {
    let divisions = block.divisions;
    let width = divisions.x as usize * divisions.y as usize * side;
    let height = divisions.z as usize * side;
    let mut out = vec![T::default(); width * height];
    for i in 0..block.count() as u32 {
        let (column, row) = square(divisions, block.coordinate(i));
        for (k, line) in of_probe(i).chunks(side).enumerate() {
            let at = (row as usize * side + k) * width + column as usize * side;
            out[at..at + side].copy_from_slice(line);
        }
    }
    (out, width as u32, height as u32)
}

/// The file of a volume.
///
/// # Errors
/// It cannot be encoded.
pub fn files(volume: &Volume) -> Result<(VolumeRecord, Vec<File>), ExportError> {
    let Fineness { resolution, .. } = volume.irradiance.fineness();
    let uniform = volume.grid.uniform();
    let block = Block::of(&uniform);
    let directions = (0..resolution * resolution).map(|o| texel_direction(o % resolution, o / resolution, resolution));
    let settings = QuerySettings::default();
    let reader = Reader::new(Query { volume, settings: &settings }, Form::Along(directions.collect()));
    let side = resolution + 2;
    let mut notes = Notes::default();
    let found: Vec<_> = (0..block.count() as u32).map(|i| reader.at(block.coordinate(i))).collect();
    notes.holes = (0..found.len() as u32).filter(|&i| found[i as usize].is_none()).collect();
    notes.moved = moved(&found, uniform.spacing_min());
    let (pixels, width, height) = atlas(&block, side, |i| {
        let mut map = vec![Vec3::ZERO; side * side];
        if let Some((probe, _)) = found[i as usize] {
            let interior: Vec<Vec3> = reader.of_probe(probe).into_iter().map(Vec3::from).collect();
            fill_with_border(&interior, resolution, 1, &mut map);
        }
        map
    });
    let channel = |c: usize| pixels.iter().map(|pixel| pixel[c]).collect::<Vec<f32>>();
    let bytes = exr_bytes(width, height, &[("R", channel(0)), ("G", channel(1)), ("B", channel(2))])
        .map_err(|error| ExportError::Impossible(format!("the atlas of {width}×{height} pixels: {error}")))?;
    let mut record = volume_record(&uniform, &block, 0, &notes);
    record.file.push_str(".exr");
    record.number = Number::Float;
    record.engine = json!({ "texelsPerProbe": resolution, "border": 1 });
    Ok((record.clone(), vec![File { name: record.file, bytes }]))
}

//! Files for RTXGI's `DDGIVolume` (RTXGI-DDGI, `ProbeIndexing.hlsl`, `ProbeOctahedral.hlsl`, `Irradiance.hlsl`) in its
//! right-handed coordinate system with +Y up, which is glTF's.
//!
//! Planes of the grid lie along y. A probe's square lies at column x and row z of its plane, and holds an octahedral map, pole
//! +Z, with a border of one texel that repeats the far side. Irradiance is stored as (E/2π)^(1/5), 6 texels a side; distances
//! halved, ½μ and ½E[r²], metres, 14 texels a side; of each probe one texel has its offset ÷ spacing and its state, 0 active,
//! 1 inactive. DDS files are arrays of planes; in EXR files planes stand beside each other.

use std::f32::consts::TAU;

use glam::{DVec3, UVec3, Vec2, Vec3, Vec3A};
use rayon::prelude::*;
use serde_json::json;

use super::atlas::atlas;
use super::block::Block;
use super::dds::{self, Texels};
use super::made::{moved, volume_record};
use super::reader::{Form, Reader};
use super::record::{File, Notes, Number, Record, VolumeRecord};
use super::target::Target;
use crate::image::exr_bytes;
use crate::light::World;
use crate::light::contact::Contacts;
use crate::math::fibonacci;
use crate::math::octahedral::{oct_from_direction, texel_direction};
use crate::math::statistics::Moments;
use crate::probe::lattice::ProbeState;
use crate::probe::query::{BiasSpacing, Blend, DirectionWeight, Query, QuerySettings, VisibilityTest};
use crate::probe::store::Occlusion;
use crate::probe::store::encode::ColorFormat;
use crate::probe::store::irradiance::{IrradianceCurve, IrradianceStore, OctahedralStore};
use crate::probe::store::kernel::Directions;
use crate::probe::store::map::{OctahedralMaps, fill_with_border, interior_texel};
use crate::probe::store::moments::{MomentsBuilder, MomentsStore};
use crate::probe::{Grid, ProbeIndex, Volume};
use crate::trace::Ray;

pub const NOTE: &str = "RTXGI atlases: irradiance (E/2π)^(1/5), distances halved, metres, linear Rec. 709; axes are glTF's: \
    RTXGI_COORDINATE_SYSTEM_RIGHT. The volume lights surfaces with all light that bounced, and with that of emissive surfaces \
    and of the sky: add punctual lights with shadows. Materials divide by π.";

/// Texels of a map's side without its border, as RTXGI has them by default.
const IRRADIANCE: usize = 6;
const DISTANCE: usize = 14;
const BORDER: usize = 1;

/// Rays of a probe that has no distances, as many as captures of the published method have.
const RAYS: usize = 1024;

/// A volume as the engine reads it.
#[derive(Debug, Clone, PartialEq)]
pub struct Ddgi {
    pub volume: Volume,
    pub settings: QuerySettings,
}

/// The engine's look-up: the weights of `DDGIGetVolumeIrradiance`, and biases as Majercik et al. 2021 have them.
pub fn look_up() -> QuerySettings {
    QuerySettings {
        direction: DirectionWeight::Wrap { offset: 0.2 },
        test: VisibilityTest::Chebyshev { power: 3.0, floor: 0.05 },
        trilinear_floor: 0.001,
        weight_floor: 1e-6,
        crush_below: 0.2,
        blend: Blend::SquareRoot,
        normal_bias: 0.045,
        view_bias: 0.18,
        biased_cell: true,
        bias_spacing: BiasSpacing::Smallest,
        ..QuerySettings::default()
    }
}

impl Ddgi {
    pub fn query(&self) -> Query<'_> {
        Query { volume: &self.volume, settings: &self.settings }
    }

    /// The same, relative to another origin.
    pub fn relative_to(&self, origin_world: DVec3) -> Ddgi {
        let mut moved = self.clone();
        let (grid, shift) = self.volume.grid.relative_to(origin_world);
        moved.volume.grid = grid;
        moved.volume.positions.iter_mut().for_each(|position| *position += shift);
        moved
    }

    /// A volume in this form. Distances are the volume's own where it has moments of them, else traced.
    ///
    /// # Errors
    /// It has none, and there is no scene to trace them in.
    pub fn of(volume: &Volume, query: &QuerySettings, world: Option<&World>) -> Result<(Ddgi, Notes), String> {
        let grid = volume.grid.uniform();
        let block = Block::of(&grid);
        let directions =
            (0..IRRADIANCE * IRRADIANCE).map(|o| texel_direction(o % IRRADIANCE, o / IRRADIANCE, IRRADIANCE));
        let reader = Reader::new(Query { volume, settings: query }, Form::Along(directions.collect()));
        let found: Vec<_> = (0..block.count() as u32).map(|i| reader.at(block.coordinate(i))).collect();
        let mut own = black(&grid);
        for (i, found) in found.iter().enumerate() {
            match found {
                Some((probe, offset)) => {
                    own.irradiance.set_probe(i, &reader.of_probe(*probe));
                    own.positions[i] += *offset;
                }
                None => own.states[i] = ProbeState::InsideGeometry,
            }
        }
        let known = volume.occlusion.moments().filter(|_| volume.grid.tree().is_none());
        own.occlusion = Occlusion::Moments(match (known, world) {
            (Some(maps), _) => resampled(maps, block.count()),
            (None, Some(world)) => traced(world, &own),
            (None, None) => {
                return Err(
                    "the probes know no distances, which DDGI needs: give the --scene to trace them in, or bake \
                            with store.occlusion=moments()"
                        .to_owned(),
                );
            }
        });
        let holes = (0..found.len() as u32).filter(|&i| found[i as usize].is_none()).collect();
        let notes = Notes { holes, moved: moved(&found, grid.spacing_min()) };
        Ok((Ddgi { volume: own, settings: look_up() }, notes))
    }
}

/// Black probes at the points of a grid.
fn black(grid: &Grid) -> Volume {
    let count = grid.probe_count();
    let store =
        OctahedralStore { resolution: IRRADIANCE, format: ColorFormat::F16, curve: IrradianceCurve::Gamma5Over2Pi };
    Volume {
        states: vec![ProbeState::Active; count],
        positions: grid.probes().map(|probe| grid.grid_point(probe)).collect(),
        irradiance: IrradianceStore::Octahedral(store).zeros(count, BORDER),
        occlusion: Occlusion::None,
        radiance: Default::default(),
        layout: Default::default(),
        grid: grid.clone(),
    }
}

/// Mean and deviation at the texels of the engine's maps.
fn resampled(maps: &OctahedralMaps<Vec2>, probes: usize) -> OctahedralMaps<Vec2> {
    let mut out = OctahedralMaps::new(probes, DISTANCE, BORDER, Vec2::ZERO);
    let interior = |probe: usize| -> Vec<Vec2> {
        let direction = |o: usize| texel_direction(o % DISTANCE, o / DISTANCE, DISTANCE);
        let taps = |o: usize| maps.taps(oct_from_direction(direction(o)));
        (0..DISTANCE * DISTANCE).map(|o| maps.sample(probe, &taps(o))).collect()
    };
    for probe in 0..probes {
        let own = interior(probe);
        fill_with_border(&own, DISTANCE, BORDER, out.probe_mut(probe));
    }
    out
}

/// The same by rays.
fn traced(world: &World, volume: &Volume) -> OctahedralMaps<Vec2> {
    let store = MomentsStore { resolution: DISTANCE, ..MomentsStore::default() };
    let rays: Vec<Vec3> = (0..RAYS).map(|i| fibonacci::direction(i, RAYS)).collect();
    let most = store.clamp * volume.grid.spacing().length();
    let contacts = Contacts::of_points(world.scene, &volume.positions);
    let count = volume.states.len();
    let mut builder = MomentsBuilder::new(&store, &Directions::even(rays.clone()), count, BORDER);
    let of_probe = |probe: usize| {
        if !volume.is_active(ProbeIndex(probe as u32)) {
            return vec![Vec2::ZERO; DISTANCE * DISTANCE];
        }
        let origin = contacts.viewpoint(probe, volume.positions[probe]);
        let distance = |(i, direction): (usize, &Vec3)| -> Moments {
            let hit = world.tracer.closest(Ray::new(origin, *direction, i as u32));
            [f64::from(hit.map_or(most, |hit| hit.t.min(most)))].into_iter().collect()
        };
        let distances: Vec<Moments> = rays.iter().enumerate().map(distance).collect();
        builder.filter(&distances)
    };
    let filtered: Vec<Vec<Vec2>> = (0..count).into_par_iter().map(of_probe).collect();
    filtered.iter().enumerate().for_each(|(probe, own)| builder.set(probe, own));
    builder.finish()
}

/// The names of the files that a volume of an export is read from.
pub fn names(to: Target, file: &str) -> Vec<String> {
    match to {
        Target::Ddgi => ["irradiance", "distance", "data"].map(|kind| format!("{file}.{kind}.dds")).to_vec(),
        _ => vec![file.to_owned()],
    }
}

/// One kind of texture: texels a side of a probe's square, and numbers of each texel.
struct Kind {
    name: &'static str,
    side: usize,
    texels: Texels,
}

const KINDS: [Kind; 3] = [
    Kind { name: "irradiance", side: IRRADIANCE + 2 * BORDER, texels: Texels::Rgba16 },
    Kind { name: "distance", side: DISTANCE + 2 * BORDER, texels: Texels::Rg32 },
    Kind { name: "data", side: 1, texels: Texels::Rgba16 },
];

/// Where texel `o` of a probe's square lies among those of an array of planes.
fn place(divisions: UVec3, side: usize, coordinate: UVec3, o: usize) -> usize {
    let [nx, _, nz] = divisions.to_array().map(|n| n as usize);
    let [x, plane, z] = coordinate.to_array().map(|n| n as usize);
    let (column, row) = (x * side + o % side, (plane * nz + z) * side + o / side);
    row * nx * side + column
}

/// The numbers of a probe's square, channel by channel within each texel.
fn numbers(ddgi: &Ddgi, kind: &Kind, i: u32) -> Vec<[f32; 4]> {
    let volume = &ddgi.volume;
    let probe = i as usize;
    match kind.name {
        "irradiance" => {
            // Stored texels, borders included, are in the domain of the curve already.
            let texels = volume.irradiance.stored().skip(probe * kind.side * kind.side).take(kind.side * kind.side);
            texels.map(|t| [t.x, t.y, t.z, 1.0]).collect()
        }
        "distance" => {
            let maps = volume.occlusion.moments();
            let of = |m: &Vec2| [0.5 * m.x, 0.5 * (m.x * m.x + m.y * m.y), 0.0, 0.0];
            maps.map_or_else(Vec::new, |maps| maps.probe(probe).iter().map(of).collect())
        }
        _ => {
            let offset = (volume.positions[probe] - volume.grid.grid_point(ProbeIndex(i))) / volume.grid.spacing();
            let state = if volume.is_active(ProbeIndex(i)) { 0.0 } else { 1.0 };
            vec![[offset.x, offset.y, offset.z, state]]
        }
    }
}

/// Record and files of a volume.
pub fn files(ddgi: &Ddgi, notes: &Notes) -> (VolumeRecord, Vec<File>) {
    let (volume, settings) = (&ddgi.volume, &ddgi.settings);
    let grid = &volume.grid;
    let block = Block::of(grid);
    let mut record = volume_record(grid, &block, 0, notes);
    let centre = [0, 1, 2].map(|i| 0.5 * (record.min[i] + record.max[i]));
    let spacing = settings.spacing(grid);
    record.number = Number::Half;
    record.engine = json!({
        "origin": centre,
        "probeSpacing": grid.spacing().to_array(),
        "probeCounts": grid.divisions().to_array(),
        "probeNumIrradianceTexels": IRRADIANCE,
        "probeNumDistanceTexels": DISTANCE,
        "probeIrradianceEncodingGamma": 5,
        "probeMaxRayDistance": MomentsStore::default().clamp * grid.spacing().length(),
        "probeNormalBias": settings.normal_bias * spacing,
        "probeViewBias": settings.view_bias * spacing,
        "probeRelocationEnabled": true,
        "probeClassificationEnabled": true,
    });
    let mut files = Vec::new();
    for kind in &KINDS {
        let channels = kind.texels.channels();
        let UVec3 { x, y, z } = block.divisions;
        let mut layered = vec![0.0; block.count() * kind.side * kind.side * channels];
        for i in 0..block.count() as u32 {
            for (o, texel) in numbers(ddgi, kind, i).iter().enumerate() {
                let at = place(block.divisions, kind.side, block.coordinate(i), o) * channels;
                layered[at..at + channels].copy_from_slice(&texel[..channels]);
            }
        }
        let (width, height) = (x * kind.side as u32, z * kind.side as u32);
        let bytes = dds::write(width, height, y, kind.texels, &layered);
        files.push(File { name: format!("{}.{}.dds", record.file, kind.name), bytes });
        let (texels, width, height) = atlas(&block, kind.side, |i| numbers(ddgi, kind, i));
        let names = ["R", "G", "B", "A"];
        let channel = |c: usize| (names[c], texels.iter().map(|texel| texel[c]).collect::<Vec<f32>>());
        // A picture beside it for people: where it cannot be encoded, there is none.
        if let Ok(bytes) = exr_bytes(width, height, &(0..channels).map(channel).collect::<Vec<_>>()) {
            files.push(File { name: format!("{}.{}.exr", record.file, kind.name), bytes });
        }
    }
    (record, files)
}

/// What the engine makes of the files; inverse of [`files`] up to rounding.
///
/// # Errors
/// They are not of this record.
pub fn read<'f>(
    record: &Record,
    grid: &Grid,
    file: &impl Fn(&str) -> Result<&'f [u8], String>,
) -> Result<Ddgi, String> {
    let [own] = &record.volumes[..] else { return Err("not one volume".to_owned()) };
    if own.resolution != grid.divisions().to_array() {
        return Err(format!("{}: its resolution is not that of 'grid'", own.file));
    }
    let [nx, planes, nz] = own.resolution;
    let divisions = grid.divisions();
    let count = own.count()?;
    let mut found = Vec::new();
    for kind in &KINDS {
        let name = format!("{}.{}.dds", own.file, kind.name);
        let (width, height) = (nx * kind.side as u32, nz * kind.side as u32);
        let numbers =
            dds::read(width, height, planes, kind.texels, file(&name)?).map_err(|what| format!("{name}: {what}"))?;
        if numbers.iter().any(|n| !n.is_finite()) {
            return Err(format!("{name} holds numbers that are not finite"));
        }
        found.push(numbers);
    }
    let mut volume = black(grid);
    let mut maps = OctahedralMaps::new(count, DISTANCE, BORDER, Vec2::ZERO);
    for i in 0..count as u32 {
        let at = grid.coordinate(ProbeIndex(i));
        let square = |k: usize| -> Vec<&[f32]> {
            let (side, channels) = (KINDS[k].side, KINDS[k].texels.channels());
            let texel = |o: usize| &found[k][place(divisions, side, at, o) * channels..][..channels];
            (0..side * side).map(texel).collect()
        };
        let irradiance = square(0);
        let interior = interior_texel(IRRADIANCE, BORDER);
        let decode = |o: usize| {
            let t = irradiance[interior(o)];
            Vec3A::new(t[0], t[1], t[2]).map(|t| TAU * t.powi(5))
        };
        volume.irradiance.set_probe(i as usize, &(0..IRRADIANCE * IRRADIANCE).map(decode).collect::<Vec<_>>());
        let of = |m: &[f32]| Vec2::new(2.0 * m[0], (2.0 * m[1] - 4.0 * m[0] * m[0]).max(0.0).sqrt());
        maps.probe_mut(i as usize).iter_mut().zip(square(1)).for_each(|(map, m)| *map = of(m));
        let data = square(2)[0];
        volume.positions[i as usize] += Vec3::new(data[0], data[1], data[2]) * grid.spacing();
        if data[3] != 0.0 {
            volume.states[i as usize] = ProbeState::InsideGeometry;
        }
    }
    volume.occlusion = Occlusion::Moments(maps);
    Ok(Ddgi { volume, settings: look_up() })
}

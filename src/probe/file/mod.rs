//! The probe file: a volume as tensors, and back.

pub mod container;

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec3, UVec3, Vec2, Vec3, Vec3A};
use safetensors::Dtype;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::probe::file::container::{Container, FileError, Tensor};
use crate::probe::lattice::ProbeState;
use crate::probe::lattice::grid::{Grid, MAX_PROBES};
use crate::probe::store::encode::{
    ColorFormat, EncodingSettings, decode_colors, encode_colors, u16_from_unit, unit_from_u16,
};
use crate::probe::store::map::OctahedralMaps;
use crate::probe::store::surface::{MAX_VOXELS_PER_CELL, SurfaceVisibility};
use crate::probe::store::volume::{IrradianceCurve, Volume};

/// Value of the metadata key `format`.
pub const FORMAT: &str = "lightprobe/1";

/// The metadata key `grid`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GridRecord {
    pub kind: GridKind,
    /// Probe (0,0,0), world space, metres.
    pub origin: [f64; 3],
    pub spacing: [f32; 3],
    /// Probes along each axis.
    pub divisions: [u32; 3],
    /// Levels of subdivision below the base cells; 0 for uniform grids.
    pub levels: u32,
    /// Border texels of the maps.
    pub border: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GridKind {
    Uniform,
}

/// The metadata key `scene`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneRecord {
    pub name: String,
    pub blake3: String,
}

/// What the encoder had to give up.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct EncodingLosses {
    /// Per tensor: values outside the format's range.
    pub clamped: BTreeMap<String, u64>,
    /// Per tensor: values above 0 that are too small for the format, and stored as 0.
    pub underflowed: BTreeMap<String, u64>,
    /// Distance texels whose deviation rounds to zero, so that only the floor of the test is left.
    pub variance_floor_hits: u64,
}

/// A file's content, decoded.
#[derive(Debug, Clone)]
pub struct ProbeFile {
    /// Positions relative to the scene that it is asked for, see [`ProbeFile::volume`].
    volume_in_grid: Volume,
    pub border: usize,
    pub irradiance_format: ColorFormat,
    pub irradiance_scale: f32,
    /// Effective configuration, RON.
    pub config: String,
    pub scene: SceneRecord,
    /// Of the bake's random numbers; `None` where the file does not say.
    pub seed: Option<u64>,
    pub plan: Value,
    /// Bytes of every tensor.
    pub tensor_bytes: BTreeMap<String, u64>,
    /// Shapes and number types of every tensor, for listings.
    pub tensor_shapes: BTreeMap<String, (String, Vec<usize>)>,
    pub file_bytes: u64,
}

fn tensor(dtype: Dtype, shape: &[usize], bytes: Vec<u8>) -> Tensor {
    Tensor { dtype, shape: shape.to_vec(), bytes }
}

fn le_bytes<const N: usize>(numbers: impl Iterator<Item = [u8; N]>) -> Vec<u8> {
    numbers.flatten().collect()
}

/// What a volume was made from.
#[derive(Debug, Clone, Copy)]
pub struct Origin<'a> {
    /// Effective configuration, RON.
    pub config: &'a str,
    pub scene: &'a SceneRecord,
    pub seed: u64,
    pub plan: &'a Value,
}

/// The volume as tensors. `encoding.border` must be that of the volume's maps.
pub fn encode(volume: &Volume, encoding: &EncodingSettings, origin: &Origin) -> (Container, EncodingLosses) {
    let mut container = Container::default();
    let mut losses = EncodingLosses::default();
    let probes = volume.states.len();
    let grid = &volume.grid;

    let relative = volume.positions.iter().flat_map(|p| (*p - grid.origin).to_array());
    container
        .tensors
        .insert("position".into(), tensor(Dtype::F32, &[probes, 3], le_bytes(relative.map(f32::to_le_bytes))));
    let states = volume.states.iter().map(|&s| s as u8).collect();
    container.tensors.insert("state".into(), tensor(Dtype::U8, &[probes], states));

    let side = volume.irradiance.side();
    let texels: Vec<Vec3> = volume.irradiance.texels.iter().map(|&t| t.into()).collect();
    let colors = encode_colors(&texels, encoding.irradiance);
    let (dtype, mut shape) = match encoding.irradiance {
        ColorFormat::R11G11B10F => (Dtype::U32, vec![probes, side, side]),
        ColorFormat::F16 => (Dtype::F16, vec![probes, side, side]),
        ColorFormat::F32 => (Dtype::F32, vec![probes, side, side]),
    };
    if encoding.irradiance != ColorFormat::R11G11B10F {
        shape.push(3);
    }
    losses.clamped.insert("irradiance".into(), colors.clamped);
    losses.underflowed.insert("irradiance".into(), colors.underflowed);
    container.tensors.insert("irradiance".into(), tensor(dtype, &shape, colors.bytes));

    if let Some(maps) = &volume.distance {
        encode_distance(maps, probes, &mut container, &mut losses);
    }
    if let Some(surface) = &volume.surface_visibility {
        let start = le_bytes(surface.cell_start.iter().map(|s| s.to_le_bytes()));
        let keys = le_bytes(surface.keys.iter().map(|k| k.to_le_bytes()));
        let n = surface.keys.len();
        container.tensors.insert("visibility_start".into(), tensor(Dtype::U32, &[surface.cell_start.len()], start));
        container.tensors.insert("visibility_key".into(), tensor(Dtype::U16, &[n], keys));
        container.tensors.insert("visibility".into(), tensor(Dtype::U8, &[n], surface.masks.clone()));
        if !surface.far.is_empty() {
            let far = le_bytes(surface.far.iter().flat_map(|&(entry, probe)| [entry, probe]).map(u32::to_le_bytes));
            container.tensors.insert("visibility_far".into(), tensor(Dtype::U32, &[surface.far.len(), 2], far));
        }
        container.metadata.insert("visibility.voxels_per_cell".into(), surface.voxels_per_cell.to_string());
    }
    let record = GridRecord {
        kind: GridKind::Uniform,
        origin: grid.origin_world.to_array(),
        spacing: grid.spacing.to_array(),
        divisions: grid.divisions.to_array(),
        levels: 0,
        border: encoding.border,
    };
    for (key, value) in [
        ("format", FORMAT.to_owned()),
        ("config", origin.config.to_owned()),
        ("grid", json(&record)),
        ("scene", json(origin.scene)),
        ("seed", origin.seed.to_string()),
        ("plan", json(origin.plan)),
        ("encoding.irradiance", volume.curve.name().to_owned()),
        ("scale.irradiance", json(&colors.scale)),
    ] {
        container.metadata.insert(key.into(), value);
    }
    (container, losses)
}

/// Compact JSON with sorted keys.
fn json(value: &impl Serialize) -> String {
    // Plain records of numbers and strings: nothing in them can fail to serialise.
    serde_json::to_value(value).unwrap_or_default().to_string()
}

fn encode_distance(maps: &OctahedralMaps<Vec2>, probes: usize, container: &mut Container, losses: &mut EncodingLosses) {
    let side = maps.side();
    let mut scales = Vec::with_capacity(probes);
    let mut codes = Vec::with_capacity(maps.texels.len() * 2);
    for probe in 0..probes {
        let map = maps.probe(probe);
        let scale = map.iter().map(|t| t.max_element()).fold(0.0, f32::max);
        scales.push(scale);
        let unit = if scale > 0.0 { 1.0 / scale } else { 0.0 };
        for texel in map {
            let code = [u16_from_unit(texel.x * unit), u16_from_unit(texel.y * unit)];
            losses.variance_floor_hits += u64::from(scale > 0.0 && code[1] == 0);
            codes.extend(code);
        }
    }
    let scales = le_bytes(scales.into_iter().map(f32::to_le_bytes));
    let codes = le_bytes(codes.into_iter().map(u16::to_le_bytes));
    container.tensors.insert("distance_scale".into(), tensor(Dtype::F32, &[probes], scales));
    container.tensors.insert("distance".into(), tensor(Dtype::U16, &[probes, side, side, 2], codes));
}

/// Reads a probe file, checking hashes, shapes and ranges.
pub fn read(path: &Path) -> Result<ProbeFile, FileError> {
    let container = Container::read(path)?;
    let found = container.metadata.get("format").cloned().unwrap_or_default();
    if found != FORMAT {
        return Err(FileError::Version { path: path.to_owned(), found, expected: FORMAT });
    }
    let file_bytes =
        std::fs::metadata(path).map_err(|cause| FileError::Unreadable { path: path.to_owned(), cause })?.len();
    decode(&container, file_bytes).map_err(|what| FileError::Damaged { path: path.to_owned(), what })
}

/// Looks tensors and metadata up by name, with the message for when they are not there.
struct Reader<'c>(&'c Container);

impl<'c> Reader<'c> {
    fn text(&self, key: &str) -> Result<&'c String, String> {
        self.0.metadata.get(key).ok_or_else(|| format!("metadata '{key}' is missing"))
    }

    fn json<T: serde::de::DeserializeOwned>(&self, key: &str) -> Result<T, String> {
        serde_json::from_str(self.text(key)?).map_err(|e| format!("metadata '{key}': {e}"))
    }

    fn tensor(&self, name: &str, dtypes: &[Dtype], shape: &[Option<usize>]) -> Result<&'c Tensor, String> {
        let tensor = self.0.tensors.get(name).ok_or_else(|| format!("tensor '{name}' is missing"))?;
        let fits = tensor.shape.len() == shape.len()
            && tensor.shape.iter().zip(shape).all(|(n, wanted)| wanted.is_none_or(|w| w == *n));
        if !fits || !dtypes.contains(&tensor.dtype) {
            return Err(format!(
                "tensor '{name}' is {} {:?}, expected {dtypes:?} {shape:?}",
                tensor.dtype, tensor.shape
            ));
        }
        Ok(tensor)
    }
}

fn f32s(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

fn u16s(bytes: &[u8]) -> impl Iterator<Item = u16> + '_ {
    bytes.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b))
}

fn decode(container: &Container, file_bytes: u64) -> Result<ProbeFile, String> {
    let reader = Reader(container);
    let record: GridRecord = reader.json("grid")?;
    let probes: u64 = record.divisions.iter().map(|&n| u64::from(n)).try_fold(1, u64::checked_mul).unwrap_or(0);
    let spacing = Vec3::from(record.spacing);
    let origin_world = DVec3::from(record.origin);
    if probes == 0 || probes > MAX_PROBES || !(spacing.is_finite() && spacing.min_element() > 0.0) {
        return Err(format!("metadata 'grid' is no grid: {:?} probes at spacing {spacing}", record.divisions));
    }
    if !origin_world.is_finite() || record.border > 1 {
        return Err("metadata 'grid' has no finite origin or an unknown border".into());
    }
    let probes = probes as usize;
    let grid = Grid { origin_world, origin: Vec3::ZERO, spacing, divisions: UVec3::from(record.divisions) };

    let positions = f32s(&reader.tensor("position", &[Dtype::F32], &[Some(probes), Some(3)])?.bytes);
    if positions.iter().any(|p| !p.is_finite()) {
        return Err("tensor 'position' holds numbers that are not finite".into());
    }
    let positions = positions.as_chunks::<3>().0.iter().map(|p| Vec3::from(*p)).collect();
    let states = reader.tensor("state", &[Dtype::U8], &[Some(probes)])?;
    let states: Option<Vec<ProbeState>> = states.bytes.iter().map(|&s| ProbeState::from_u8(s)).collect();
    let states = states.ok_or("tensor 'state' holds an unknown state")?;

    let irradiance_scale: f32 = reader.json("scale.irradiance")?;
    let curve: IrradianceCurve = serde_json::from_value(Value::String(reader.text("encoding.irradiance")?.clone()))
        .map_err(|e| format!("metadata 'encoding.irradiance': {e}"))?;
    let (irradiance_format, irradiance) = decode_irradiance(&reader, probes, record.border, irradiance_scale)?;
    let volume = Volume {
        distance: decode_distance(&reader, probes, record.border)?,
        surface_visibility: decode_surface(&reader, &grid)?,
        grid,
        states,
        positions,
        irradiance,
        curve,
    };
    Ok(ProbeFile {
        volume_in_grid: volume,
        border: record.border,
        irradiance_format,
        irradiance_scale,
        config: reader.text("config")?.clone(),
        scene: reader.json("scene")?,
        seed: container.metadata.contains_key("seed").then(|| reader.json("seed")).transpose()?,
        plan: reader.json("plan")?,
        tensor_bytes: container.tensors.iter().map(|(n, t)| (n.clone(), t.bytes.len() as u64)).collect(),
        tensor_shapes: container
            .tensors
            .iter()
            .map(|(n, t)| (n.clone(), (t.dtype.to_string(), t.shape.clone())))
            .collect(),
        file_bytes,
    })
}

/// Interior resolution of maps that are `side` texels wide with their border.
fn resolution(name: &str, tensor: &Tensor, border: usize) -> Result<usize, String> {
    let (rows, columns) = (tensor.shape[1], tensor.shape[2]);
    match columns.checked_sub(2 * border) {
        Some(r) if r > 0 && rows == columns => Ok(r),
        _ => Err(format!("tensor '{name}' has maps of {columns}×{rows} with border {border}")),
    }
}

fn decode_irradiance(
    reader: &Reader,
    probes: usize,
    border: usize,
    scale: f32,
) -> Result<(ColorFormat, OctahedralMaps<Vec3A>), String> {
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(format!("metadata 'scale.irradiance' is {scale}"));
    }
    let packed = reader.0.tensors.get("irradiance").is_some_and(|t| t.dtype == Dtype::U32);
    let (tensor, format) = if packed {
        (reader.tensor("irradiance", &[Dtype::U32], &[Some(probes), None, None])?, ColorFormat::R11G11B10F)
    } else {
        let shape = [Some(probes), None, None, Some(3)];
        let tensor = reader.tensor("irradiance", &[Dtype::F16, Dtype::F32], &shape)?;
        (tensor, if tensor.dtype == Dtype::F16 { ColorFormat::F16 } else { ColorFormat::F32 })
    };
    let texels = decode_colors(&tensor.bytes, format, scale);
    if texels.iter().any(|t| !t.is_finite()) {
        return Err("tensor 'irradiance' holds numbers that are not finite".into());
    }
    let texels = texels.into_iter().map(Vec3A::from).collect();
    Ok((format, OctahedralMaps { resolution: resolution("irradiance", tensor, border)?, border, texels }))
}

fn decode_distance(reader: &Reader, probes: usize, border: usize) -> Result<Option<OctahedralMaps<Vec2>>, String> {
    if !reader.0.tensors.contains_key("distance") {
        return Ok(None);
    }
    let tensor = reader.tensor("distance", &[Dtype::U16], &[Some(probes), None, None, Some(2)])?;
    let scales = f32s(&reader.tensor("distance_scale", &[Dtype::F32], &[Some(probes)])?.bytes);
    if scales.iter().any(|s| !(s.is_finite() && *s >= 0.0)) {
        return Err("tensor 'distance_scale' holds numbers that are no distances".into());
    }
    let resolution = resolution("distance", tensor, border)?;
    let per_probe = (resolution + 2 * border).pow(2);
    let units: Vec<f32> = u16s(&tensor.bytes).map(unit_from_u16).collect();
    let pairs = units.as_chunks::<2>().0;
    let texels = pairs.iter().enumerate().map(|(i, t)| Vec2::from(*t) * scales[i / per_probe]).collect();
    Ok(Some(OctahedralMaps { resolution, border, texels }))
}

fn decode_surface(reader: &Reader, grid: &Grid) -> Result<Option<SurfaceVisibility>, String> {
    if !reader.0.tensors.contains_key("visibility") {
        return Ok(None);
    }
    let voxels_per_cell: u32 = reader.json("visibility.voxels_per_cell")?;
    if !(1..=MAX_VOXELS_PER_CELL).contains(&voxels_per_cell) {
        return Err(format!("metadata 'visibility.voxels_per_cell' is {voxels_per_cell}"));
    }
    let cells = grid.cell_count();
    let masks = reader.tensor("visibility", &[Dtype::U8], &[None])?.bytes.clone();
    let keys = &reader.tensor("visibility_key", &[Dtype::U16], &[Some(masks.len())])?.bytes;
    let start = &reader.tensor("visibility_start", &[Dtype::U32], &[Some(cells + 1)])?.bytes;
    let cell_start: Vec<u32> = start.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
    let ordered = cell_start.is_sorted() && cell_start.last().is_some_and(|&n| n as usize == masks.len());
    if !ordered || cell_start[0] != 0 {
        return Err("tensor 'visibility_start' does not divide the entries among the cells".into());
    }
    let mut far = Vec::new();
    if reader.0.tensors.contains_key("visibility_far") {
        let tensor = reader.tensor("visibility_far", &[Dtype::U32], &[None, Some(2)])?;
        let numbers: Vec<u32> = tensor.bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        far = numbers.as_chunks::<2>().0.iter().map(|pair| (pair[0], pair[1])).collect();
        let in_range = |f: &(u32, u32)| (f.0 as usize) < masks.len() && (f.1 as usize) < grid.probe_count();
        if !far.is_sorted() || !far.iter().all(in_range) {
            return Err("tensor 'visibility_far' names entries or probes that there are not".into());
        }
    }
    Ok(Some(SurfaceVisibility { voxels_per_cell, cell_start, keys: u16s(keys).collect(), masks, far }))
}

impl ProbeFile {
    /// The volume relative to a scene's origin.
    pub fn volume(&self, scene_origin_world: DVec3) -> Volume {
        let mut volume = self.volume_in_grid.clone();
        volume.grid.origin = (volume.grid.origin_world - scene_origin_world).as_vec3();
        for position in &mut volume.positions {
            *position += volume.grid.origin;
        }
        volume
    }

    /// The volume relative to its own grid's origin.
    pub fn volume_in_grid(&self) -> &Volume {
        &self.volume_in_grid
    }
}

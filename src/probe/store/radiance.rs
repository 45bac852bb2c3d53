//! The light that probes see themselves: light fields, and levels of radiance for glossy surfaces.
//!
//! A light field holds of every texel the outgoing radiance, W·m⁻²·sr⁻¹, the normal, octahedral, and the distance of what
//! the probe sees there, metres; where it sees no surface, the normal is that of the direction back to the probe and the
//! distance [`FAR_M`]. Level 0 of the levels is the same radiance, and each of the others the mean of 2×2 texels of the one
//! above, as texture units do it, or blurred as rough surfaces do it ([`Prefilter`]). A probe takes
//! `R′²·(4 + 4 + 2) + Σ K²·4` bytes in the packed format.
//!
//! A light field that rays march through ([`crate::probe::query::march`]) has normals of two bytes and a level of lowest
//! distances, each the least of the texels below it: `R′²·(4 + 2 + 2) + M²·2` bytes.

mod colors;
mod levels;
#[cfg(test)]
mod tests;

use std::f32::consts::PI;

use glam::{Vec2, Vec3, Vec3A};
use half::f16;
use safetensors::Dtype;
use serde::{Deserialize, Serialize};

use self::colors::{byte_of, oct_of, read_colors, write_colors};
pub use self::levels::lowest_of;
use self::levels::{halved, shrunk};
use super::encode::ColorFormat;
use super::kernel::Kernel;
use super::map::{OctahedralMaps, fill_with_border, interior_texel};
use super::prefilter::Prefilter;
use crate::math::octahedral::{oct_from_direction, texel_direction};
use crate::probe::container::{Container, EncodingLosses};

/// Distance where there is no surface: the largest that f16 holds.
pub const FAR_M: f32 = 65_504.0;

/// Whether probes keep what they see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightFieldStore {
    #[default]
    None,
    /// Radiance, normals and distances in maps of the capture's resolution.
    Maps,
    /// The same for rays to march through: with a level of lowest distances of so many texels per side.
    March { lowest: usize },
}

/// Bytes of a normal and of a distance: two f16 and one.
const G_BUFFER_BYTES: usize = 4 + 2;
/// The same of two bytes and an f16.
const SMALL_G_BUFFER_BYTES: usize = 2 + 2;
/// Bytes of a lowest distance, f16.
const LOWEST_BYTES: usize = 2;

impl LightFieldStore {
    /// Bytes of a texel's normal and distance.
    fn g_buffer_bytes(self) -> usize {
        match self {
            LightFieldStore::None => 0,
            LightFieldStore::Maps => G_BUFFER_BYTES,
            LightFieldStore::March { .. } => SMALL_G_BUFFER_BYTES,
        }
    }

    /// Texels per side of the level of lowest distances, where there is one.
    fn lowest(self) -> Option<usize> {
        match self {
            LightFieldStore::None | LightFieldStore::Maps => None,
            LightFieldStore::March { lowest } => Some(lowest),
        }
    }

    /// Whether rays can march through it.
    pub fn marches(self) -> bool {
        self.lowest().is_some()
    }
}

/// What a probe sees.
#[derive(Debug, Clone, PartialEq)]
pub struct LightField {
    pub radiance: OctahedralMaps<Vec3>,
    pub normal: OctahedralMaps<Vec2>,
    pub distance: OctahedralMaps<f32>,
    /// The least distance of each block of texels; `None` where rays do not march.
    pub lowest: Option<OctahedralMaps<f32>>,
}

/// All radiance that a volume holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Radiance {
    pub light_field: Option<LightField>,
    /// From the finest to the coarsest.
    pub prefiltered: Vec<OctahedralMaps<Vec3>>,
    pub format: Option<ColorFormat>,
    /// From captured texels to each level; none where levels come from each other.
    pub filters: Vec<Kernel>,
}

/// Which radiance a method stores.
#[derive(Debug, Clone, Copy)]
pub struct RadianceStore<'a> {
    pub light_field: LightFieldStore,
    pub prefiltered: &'a [usize],
    pub prefilter: Prefilter,
    pub format: ColorFormat,
    pub border: usize,
}

impl RadianceStore<'_> {
    /// Whether there is none of it.
    pub fn is_empty(&self) -> bool {
        self.light_field == LightFieldStore::None && self.prefiltered.is_empty()
    }

    /// Black maps of captures with so many texels per side.
    pub fn zeros(&self, probes: usize, side: usize) -> Radiance {
        let border = self.border;
        let light_field = (self.light_field != LightFieldStore::None).then(|| LightField {
            radiance: OctahedralMaps::new(probes, side, border, Vec3::ZERO),
            normal: OctahedralMaps::new(probes, side, border, Vec2::ZERO),
            distance: OctahedralMaps::new(probes, side, border, FAR_M),
            lowest: self.light_field.lowest().map(|n| OctahedralMaps::new(probes, n, 0, FAR_M)),
        });
        let level = |&n: &usize| OctahedralMaps::new(probes, n, border, Vec3::ZERO);
        let format = (!self.is_empty()).then_some(self.format);
        let filters = self.prefilter.kernels(self.prefiltered);
        Radiance { light_field, prefiltered: self.prefiltered.iter().map(level).collect(), format, filters }
    }

    /// Bytes of a probe's light field and of its levels in the layout that shading uses; `g_buffer`: with normals and
    /// distances.
    pub fn runtime_bytes(&self, side: usize, g_buffer: bool) -> (usize, usize) {
        let texels = |n: usize| (n + 2 * self.border).pow(2);
        let texel = self.format.bytes_per_texel();
        let field = match self.light_field {
            LightFieldStore::None => 0,
            store => {
                let lowest = store.lowest().map_or(0, |n| n * n * LOWEST_BYTES);
                texels(side) * (texel + if g_buffer { store.g_buffer_bytes() } else { 0 }) + lowest
            }
        };
        (field, self.prefiltered.iter().map(|&n| texels(n) * texel).sum())
    }

    /// Most memory that one probe takes while it is baked and encoded.
    pub fn working_bytes(&self, side: usize) -> u64 {
        /// Radiance, normal and distance in floats, and radiance once more with its code.
        const FIELD: usize = 12 + 8 + 4 + 12 + 12;
        const LEVEL: usize = 12 + 12 + 12;
        let texels = |n: usize| (n + 2 * self.border).pow(2);
        let field = if self.light_field != LightFieldStore::None { texels(side) * FIELD } else { 0 };
        (field + self.prefiltered.iter().map(|&n| texels(n) * LEVEL).sum::<usize>()) as u64
    }

    /// Why captures with so many texels per side cannot fill it, with the remedy; `None` where they can.
    pub fn mismatch(&self, side: Option<usize>) -> Option<String> {
        if self.is_empty() {
            return None;
        }
        let Some(side) = side else {
            return Some(
                "store.light_field and store.prefiltered are maps of what is captured: capture.rays must be octahedral, \
                 or cube with a resolution"
                    .to_owned(),
            );
        };
        if let Some(lowest) = self.light_field.lowest()
            && (self.border != 0 || lowest == 0 || !side.is_multiple_of(lowest))
        {
            return Some(format!(
                "store.light_field is march(lowest: {lowest}) of maps of {side} texels: lowest must divide that, and \
                 store.border must be 0"
            ));
        }
        let mut finer = None;
        for &level in self.prefiltered {
            let wanted = finer.map_or(side, |n: usize| n / 2);
            if level != wanted || level == 0 || finer.is_some_and(|n| n % 2 == 1) {
                return Some(format!(
                    "store.prefiltered has a level of {level} texels where {wanted} are to be: the first level is as \
                     large as the capture's map, and each next one half of it"
                ));
            }
            finer = Some(level);
        }
        None
    }
}

impl Radiance {
    pub fn is_empty(&self) -> bool {
        self.light_field.is_none() && self.prefiltered.is_empty()
    }

    /// As [`RadianceStore::runtime_bytes`].
    pub fn runtime_bytes(&self, g_buffer: bool) -> (usize, usize) {
        let prefiltered: Vec<usize> = self.prefiltered.iter().map(|maps| maps.resolution).collect();
        let first = self.light_field.as_ref().map(|field| &field.radiance).or(self.prefiltered.first());
        let (Some(first), Some(format)) = (first, self.format) else { return (0, 0) };
        let light_field = match self.light_field.as_ref().map(|field| field.lowest.as_ref()) {
            Some(Some(lowest)) => LightFieldStore::March { lowest: lowest.resolution },
            Some(None) => LightFieldStore::Maps,
            None => LightFieldStore::None,
        };
        let (prefilter, border) = (Prefilter::Halved, first.border);
        let store = RadianceStore { light_field, prefiltered: &prefiltered, prefilter, format, border };
        store.runtime_bytes(first.resolution, g_buffer)
    }

    /// Sets what a probe sees: radiance by texel and, for light fields, the surfaces there.
    pub fn set(&mut self, probe: usize, radiance: &[Vec3A], surface: impl Fn(usize) -> Option<(Vec3, f32)>) {
        let texels: Vec<Vec3> = radiance.iter().map(|&l| l.into()).collect();
        if let Some(LightField { radiance, normal, distance, lowest }) = &mut self.light_field {
            let (n, border) = (radiance.resolution, radiance.border);
            let (normals, distances): (Vec<Vec2>, Vec<f32>) = (0..n * n)
                .map(|o| match surface(o) {
                    Some((normal, distance)) => (oct_from_direction(normal), distance.min(FAR_M)),
                    None => (oct_from_direction(-texel_direction(o % n, o / n, n)), FAR_M),
                })
                .unzip();
            fill_with_border(&texels, n, border, radiance.probe_mut(probe));
            fill_with_border(&normals, n, border, normal.probe_mut(probe));
            fill_with_border(&distances, n, border, distance.probe_mut(probe));
            if let Some(lowest) = lowest {
                let least = lowest_of(&distances, n, lowest.resolution);
                lowest.probe_mut(probe).copy_from_slice(&least);
            }
        }
        let mut level = texels;
        for (i, maps) in self.prefiltered.iter_mut().enumerate() {
            if let Some(filter) = self.filters.get(i) {
                let mut blurred = vec![Vec3A::ZERO; filter.rows()];
                filter.irradiance(radiance, &mut blurred);
                level = blurred.into_iter().map(|e| (e / PI).into()).collect();
            } else if i > 0 {
                level = halved(&level, maps.resolution);
            }
            fill_with_border(&level, maps.resolution, maps.border, maps.probe_mut(probe));
        }
    }

    /// Levels of the light field's own radiance where none are stored, as texture units make them of it: each half as large as
    /// the one before, down to [`SMALLEST_LEVEL`] texels. Maps whose sides are odd share texels among the next level's.
    pub fn make_levels(&mut self) {
        let Some(field) = self.light_field.as_ref().filter(|_| self.prefiltered.is_empty()) else { return };
        let (first, border) = (&field.radiance, field.radiance.border);
        let probes = first.texels.len() / first.texels_per_probe().max(1);
        let mut levels = vec![first.clone()];
        while let Some(finer) = levels.last().filter(|finer| finer.resolution >= 2 * SMALLEST_LEVEL) {
            let (n, side) = (finer.resolution, finer.resolution / 2);
            let mut next = OctahedralMaps::new(probes, side, border, Vec3::ZERO);
            let interior = interior_texel(n, border);
            for probe in 0..probes {
                let texels: Vec<Vec3> = (0..n * n).map(|o| finer.probe(probe)[interior(o)]).collect();
                fill_with_border(&shrunk(&texels, n, side), side, border, next.probe_mut(probe));
            }
            levels.push(next);
        }
        self.prefiltered = levels;
    }

    /// Bytes of a probe that glossy surfaces need: its levels, else its light field with all that rays march through.
    pub fn glossy_bytes(&self) -> usize {
        let (field, levels) = self.runtime_bytes(true);
        if self.prefiltered.is_empty() { field } else { levels }
    }

    /// Writes its tensors.
    pub fn write(&self, container: &mut Container, losses: &mut EncodingLosses) {
        let format = self.format.unwrap_or(ColorFormat::R11G11B10F);
        if let Some(LightField { radiance, normal, distance, lowest }) = &self.light_field {
            write_colors(RADIANCE, radiance, format, container, losses);
            let side = radiance.side();
            let probes = radiance.texels.len() / (side * side);
            let half = |x: f32| f16::from_f32(x).to_le_bytes();
            let shape = [probes, side, side, 2];
            if let Some(lowest) = lowest {
                let bytes = normal.texels.iter().flat_map(|n| [byte_of(n.x), byte_of(n.y)]).collect();
                container.put_bytes(NORMAL, Dtype::U8, &shape, bytes);
                let side = lowest.side();
                let numbers = lowest.texels.iter().map(|&d| half(d));
                container.put(LOWEST, Dtype::F16, &[probes, side, side], numbers);
            } else {
                let numbers = normal.texels.iter().flat_map(|n| [half(n.x), half(n.y)]);
                container.put(NORMAL, Dtype::F16, &shape, numbers);
            }
            let numbers = distance.texels.iter().map(|&d| half(d));
            container.put(DISTANCE, Dtype::F16, &[probes, side, side], numbers);
        }
        for (k, maps) in self.prefiltered.iter().enumerate() {
            write_colors(&level_name(k), maps, format, container, losses);
        }
    }

    /// Reads its tensors; inverse of [`Self::write`] up to rounding.
    ///
    /// # Errors
    /// What is missing or out of range.
    pub fn read(container: &Container, probes: usize, border: usize) -> Result<Radiance, String> {
        let mut out = Radiance::default();
        if container.has(RADIANCE) {
            let (radiance, format) = read_colors(RADIANCE, container, probes, border)?;
            let side = radiance.side();
            let halves = |name: &str, shape: &[Option<usize>]| -> Result<Vec<f32>, String> {
                let numbers = container.tensor(name, &[Dtype::F16], shape)?.u16s();
                let numbers: Vec<f32> = numbers.map(|bits| f16::from_bits(bits).to_f32()).collect();
                match numbers.iter().all(|x| x.is_finite()) {
                    true => Ok(numbers),
                    false => Err(format!("tensor '{name}' holds numbers that are not finite")),
                }
            };
            let shape = [Some(probes), Some(side), Some(side), Some(2)];
            let lowest = match container.has(LOWEST) {
                true => {
                    let numbers = halves(LOWEST, &[Some(probes), None, None])?;
                    let tensor = container.tensor(LOWEST, &[Dtype::F16], &[Some(probes), None, None])?;
                    let resolution = tensor.map_resolution(LOWEST, 0)?;
                    if border != 0 || resolution == 0 || !radiance.resolution.is_multiple_of(resolution) {
                        let side = radiance.resolution;
                        return Err(format!("tensor '{LOWEST}' has {resolution} texels a side, maps have {side}"));
                    }
                    Some(OctahedralMaps { resolution, border: 0, texels: numbers })
                }
                false => None,
            };
            let normals = match lowest {
                Some(_) => {
                    let bytes = &container.tensor(NORMAL, &[Dtype::U8], &shape)?.bytes;
                    bytes.iter().map(|&byte| oct_of(byte)).collect()
                }
                None => halves(NORMAL, &shape)?,
            };
            let distances = halves(DISTANCE, &shape[..3])?;
            let resolution = radiance.resolution;
            let texels = normals.as_chunks::<2>().0.iter().map(|n| Vec2::from(*n)).collect();
            let normal = OctahedralMaps { resolution, border, texels };
            let distance = OctahedralMaps { resolution, border, texels: distances };
            out.light_field = Some(LightField { radiance, normal, distance, lowest });
            out.format = Some(format);
        }
        for k in 0.. {
            let name = level_name(k);
            if !container.has(&name) {
                break;
            }
            let (maps, format) = read_colors(&name, container, probes, border)?;
            out.prefiltered.push(maps);
            out.format = Some(format);
        }
        Ok(out)
    }
}

/// Texels per side below which light fields have no further levels: 128 and 126 both have five.
const SMALLEST_LEVEL: usize = 7;

/// Names in the file.
const RADIANCE: &str = "radiance";
const NORMAL: &str = "normal";
const DISTANCE: &str = "radial_distance";
const LOWEST: &str = "lowest_distance";

fn level_name(k: usize) -> String {
    format!("prefiltered.{k}")
}

//! `probes.json`: what an export's files hold, where they belong, and where they come from.

use std::path::PathBuf;

use glam::{DVec3, UVec3, Vec3};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use super::block::Block;
use super::target::Target;
use crate::probe::Grid;
use crate::probe::file::{LightRecord, SceneRecord};
use crate::probe::lattice::grid::MAX_PROBES;

/// Its name in an export's folder.
pub const RECORD: &str = "probes.json";

/// Value of its key `format`. A change of what files mean raises the number.
pub const FORMAT: &str = "lightprobe-export/1";

/// An export cannot be read or made.
#[derive(Debug, Error)]
pub enum ExportError {
    #[error("cannot read {}; give a folder that `lightprobe export` wrote", .path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    #[error("{}: {what}; export it again", .path.display())]
    Damaged { path: PathBuf, what: String },
    #[error("{0}")]
    Impossible(String),
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    pub format: String,
    pub to: Target,
    /// What the numbers are and which light the engine has to add, in words.
    pub note: String,
    /// In the order in which the engine shall look at them.
    pub volumes: Vec<VolumeRecord>,
    /// Of the probe file.
    pub grid: LatticeRecord,
    pub scene: SceneRecord,
    pub light: LightRecord,
    /// The environment map of the bake, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<String>,
    pub seed: Option<u64>,
    /// What a fit did that chose the values for this engine; `null` where they are the probe file's own.
    pub fit: Option<Value>,
    /// Whether the probe file's own values were fitted, for its own look-up.
    pub probes_fitted: bool,
    /// Configuration of the bake, RON.
    pub config: String,
}

/// Probe (0, 0, 0), world space, metres; distance of neighbours; probes along each axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LatticeRecord {
    pub origin: [f64; 3],
    pub spacing: [f32; 3],
    pub divisions: [u32; 3],
}

/// A file of an export.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    pub name: String,
    pub bytes: Vec<u8>,
}

/// One box of probes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VolumeRecord {
    /// Name of its file in the same folder; of several the start of their names.
    pub file: String,
    /// Number type.
    #[serde(rename = "type")]
    pub number: Number,
    /// Probes along x, y, z.
    pub resolution: [u32; 3],
    /// Corners of the box, half a spacing beyond the outermost probes, world space, metres.
    pub min: [f64; 3],
    pub max: [f64; 3],
    /// Where boxes overlap the highest counts, in engines that take one.
    pub priority: u32,
    /// In the engine's own terms.
    #[serde(default, skip_serializing_if = "Value::is_null")]
    pub engine: Value,
    /// Numbers of probes that hold no light of their own, x fastest, then y: they have that of their neighbours.
    pub holes: Vec<u32>,
    /// Probes whose light is that of another place than the engine takes them to stand at.
    pub moved: Vec<Moved>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Moved {
    pub probe: u32,
    /// From where the engine takes it to stand to where it stood in the bake, metres.
    pub offset: [f32; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Number {
    Half,
    Float,
    Rgb9e5,
}

/// What is noted of the probes of a block.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Notes {
    pub holes: Vec<u32>,
    pub moved: Vec<Moved>,
}

impl LatticeRecord {
    pub fn of(grid: &Grid) -> LatticeRecord {
        LatticeRecord {
            origin: grid.origin_world().to_array(),
            spacing: grid.spacing().to_array(),
            divisions: grid.divisions().to_array(),
        }
    }

    /// The uniform grid of it, relative to its own origin.
    ///
    /// # Errors
    /// It makes none.
    pub fn grid(&self) -> Result<Grid, String> {
        let LatticeRecord { origin, spacing, divisions } = *self;
        Grid::from_parts(DVec3::from(origin), Vec3::from(spacing), UVec3::from(divisions))
            .ok_or_else(|| format!("'grid' makes no grid: {divisions:?} probes at spacing {spacing:?}"))
    }
}

impl VolumeRecord {
    /// Probes of the box.
    ///
    /// # Errors
    /// There are none, or more than there can be.
    pub fn count(&self) -> Result<usize, String> {
        let count = self.resolution.iter().map(|&n| u64::from(n)).try_fold(1, u64::checked_mul);
        match count {
            Some(count) if (1..=MAX_PROBES).contains(&count) => Ok(count as usize),
            _ => Err(format!("{}: a resolution of {:?} probes", self.file, self.resolution)),
        }
    }

    /// The box relative to a place in world space, its first probe having the number `start`.
    ///
    /// # Errors
    /// It is none.
    pub fn block(&self, origin_world: DVec3, start: u32) -> Result<Block, String> {
        self.count()?;
        let corner = |corner: [f64; 3]| (DVec3::from(corner) - origin_world).as_vec3();
        let (low, high) = (corner(self.min), corner(self.max));
        let is_box = low.is_finite() && high.is_finite() && high.cmpgt(low).all();
        if !is_box {
            return Err(format!("{}: no box from {:?} to {:?}", self.file, self.min, self.max));
        }
        Ok(Block::filling(low, high, UVec3::from(self.resolution), start))
    }
}

//! An export: made of a volume, written into a folder, and read back as an engine reads it.

use std::io::Write;
use std::path::Path;

use glam::{DVec3, Vec3};

use super::atlas;
use super::bevy;
use super::ddgi::{self, Ddgi};
use super::grids::Grids;
use super::made::volume_record;
use super::projection::Projection;
use super::record::{ExportError, FORMAT, File, LatticeRecord, Notes, RECORD, Record, VolumeRecord};
use super::rules::Rules;
use super::target::Target;
use super::three;
use crate::math::fibonacci;
use crate::probe::file::{LightRecord, SceneRecord};
use crate::probe::lattice::ProbeState;
use crate::probe::query::{Answers, CornerWeights, QueryPoint, Visibility};
use crate::probe::store::sh::ShStore;
use crate::probe::store::{IrradianceStore, Occlusion};
use crate::probe::{Grid, ProbeIndex, Volume};
use crate::system::input::read_file;
use crate::system::output::{OutputError, create_folder, write_atomically};

/// Where probes come from.
#[derive(Debug, Clone)]
pub struct Origin {
    pub scene: SceneRecord,
    pub light: LightRecord,
    /// The environment map of the bake, in words.
    pub environment: Option<String>,
    pub seed: Option<u64>,
    /// Whether the probes were fitted in their bake.
    pub probes_fitted: bool,
    /// Configuration of the bake, RON.
    pub config: String,
}

/// All files of an export.
#[derive(Debug, Clone)]
pub struct Export {
    pub record: Record,
    pub files: Vec<File>,
}

/// An export as its engine reads it.
#[derive(Debug, Clone)]
pub enum Written {
    Grids(Grids),
    Ddgi(Box<Ddgi>),
}

impl Export {
    /// Blocks, each with what is noted of its probes.
    pub fn of_grids(grids: &Grids, notes: &[Notes], origin: &Origin, fit: Option<serde_json::Value>) -> Export {
        let (to, note) = match grids.rules {
            Rules::Three => (Target::Three, three::NOTE),
            Rules::Bevy => (Target::Bevy, bevy::NOTE),
        };
        let mut files = Vec::new();
        let mut volumes = Vec::new();
        for (index, (block, notes)) in grids.blocks.iter().zip(notes).enumerate() {
            let mut record = volume_record(&grids.grid, block, index, notes);
            files.extend(match grids.rules {
                Rules::Three => three::files(grids, block, &mut record),
                Rules::Bevy => bevy::files(grids, block, &mut record),
            });
            volumes.push(record);
        }
        if to == Target::Three {
            files.extend(three::companions());
        }
        Export { record: Record::new(to, note, volumes, &grids.grid, origin, fit), files }
    }

    /// A look-up that is no engine's.
    pub fn of_ddgi(ddgi: &Ddgi, notes: &Notes, origin: &Origin) -> Export {
        let grid = &ddgi.volume.grid;
        let (volume, files) = ddgi::files(ddgi, notes);
        Export { record: Record::new(Target::Ddgi, ddgi::NOTE, vec![volume], grid, origin, None), files }
    }

    /// A picture of all maps.
    ///
    /// # Errors
    /// It cannot be encoded.
    pub fn of_atlas(volume: &Volume, origin: &Origin) -> Result<Export, ExportError> {
        let (record, files) = atlas::files(volume)?;
        let record = Record::new(Target::Exr, atlas::NOTE, vec![record], &volume.grid.uniform(), origin, None);
        Ok(Export { record, files })
    }

    /// What the engine makes of it.
    ///
    /// # Errors
    /// What is wrong with the files.
    pub fn as_read(&self) -> Result<Written, String> {
        let record = &self.record;
        let file = |name: &str| {
            let found = self.files.iter().find(|file| file.name == name);
            found.map(|file| file.bytes.as_slice()).ok_or_else(|| format!("{name} is missing"))
        };
        let grid = record.grid.grid()?;
        let Some(rules) = record.to.rules() else {
            return match record.to {
                Target::Ddgi => Ok(Written::Ddgi(Box::new(ddgi::read(record, &grid, &file)?))),
                _ => Err(format!("no engine looks up an export to {}", record.to.name())),
            };
        };
        let mut blocks = Vec::new();
        let mut start = 0;
        for volume in &record.volumes {
            let block = volume.block(grid.origin_world(), start)?;
            start = start.checked_add(block.count() as u32).ok_or("too many probes")?;
            blocks.push(block);
        }
        // Before memory is taken for them: the files hold what their record says.
        let short = record.volumes.iter().zip(&blocks).find_map(|(volume, block)| match file(&volume.file) {
            Ok(bytes) if bytes.len() >= block.count() => None,
            Ok(bytes) => Some(format!("{} has only {} bytes", volume.file, bytes.len())),
            Err(what) => Some(what),
        });
        if let Some(what) = short {
            return Err(what);
        }
        let mut grids = Grids::new(rules, grid, blocks.clone());
        for (block, volume) in blocks.iter().zip(&record.volumes) {
            let bytes = file(&volume.file)?;
            match rules {
                Rules::Three => three::read(&mut grids, block, volume, bytes)?,
                Rules::Bevy => bevy::read(&mut grids, block, volume, bytes)?,
            }
        }
        Ok(Written::Grids(grids))
    }

    /// Bytes of what the engine loads.
    pub fn bytes(&self) -> u64 {
        let of_volume = |file: &&File| self.record.volumes.iter().any(|volume| file.name.starts_with(&volume.file));
        // What lies in a second form beside is loaded instead.
        let is_second = |file: &&File| self.record.to == Target::Ddgi && file.name.ends_with(".exr");
        self.files.iter().filter(of_volume).filter(|file| !is_second(file)).map(|file| file.bytes.len() as u64).sum()
    }

    /// Probes of all boxes.
    pub fn probes(&self) -> usize {
        self.record.volumes.iter().filter_map(|volume| volume.count().ok()).sum()
    }

    /// Writes all files, the record last.
    ///
    /// # Errors
    /// Those of the disk.
    pub fn write(&self, folder: &Path) -> Result<(), OutputError> {
        create_folder(folder)?;
        for file in &self.files {
            write_atomically(&folder.join(&file.name), |out| out.write_all(&file.bytes))?;
        }
        // Plain records of numbers and texts: nothing in them can fail to serialise.
        let text = serde_json::to_string_pretty(&self.record).unwrap_or_default();
        write_atomically(&folder.join(RECORD), |out| writeln!(out, "{text}"))
    }

    /// Reads what [`Self::write`] wrote, without what goes with it for people.
    ///
    /// # Errors
    /// Files are missing or damaged.
    pub fn read(folder: &Path) -> Result<Export, ExportError> {
        let load = |name: &str| {
            let path = folder.join(name);
            read_file(&path).map_err(|source| ExportError::Unreadable { path, source })
        };
        let damaged = |what: String| ExportError::Damaged { path: folder.join(RECORD), what };
        let record: Record = serde_json::from_slice(&load(RECORD)?).map_err(|e| damaged(e.to_string()))?;
        if record.format != FORMAT {
            return Err(damaged(format!("its format is '{}', not {FORMAT}", record.format)));
        }
        if record.volumes.is_empty() {
            return Err(damaged("it holds no volume".to_owned()));
        }
        let mut files = Vec::new();
        for volume in &record.volumes {
            for name in ddgi::names(record.to, &volume.file) {
                // Only beside the record itself.
                if name.contains(['/', '\\']) {
                    return Err(damaged(format!("'{name}' is no name of a file")));
                }
                files.push(File { bytes: load(&name)?, name });
            }
        }
        Ok(Export { record, files })
    }
}

impl Record {
    fn new(
        to: Target,
        note: &str,
        volumes: Vec<VolumeRecord>,
        grid: &Grid,
        origin: &Origin,
        fit: Option<serde_json::Value>,
    ) -> Record {
        let Origin { scene, light, environment, seed, probes_fitted, config } = origin.clone();
        let (format, note, grid) = (FORMAT.to_owned(), note.to_owned(), LatticeRecord::of(grid));
        Record { format, to, note, volumes, grid, scene, light, environment, seed, fit, probes_fitted, config }
    }
}

impl Written {
    /// The same, relative to another origin.
    pub fn relative_to(&self, origin_world: DVec3) -> Written {
        match self {
            Written::Grids(grids) => Written::Grids(grids.relative_to(origin_world)),
            Written::Ddgi(ddgi) => Written::Ddgi(Box::new(ddgi.relative_to(origin_world))),
        }
    }
}

impl Written {
    /// Probes with their light, for pictures of them.
    pub fn drawn(&self) -> Volume {
        let grids = match self {
            Written::Ddgi(ddgi) => return ddgi.volume.clone(),
            Written::Grids(grids) => grids,
        };
        let count = grids.positions.len();
        let directions: Vec<(Vec3, f32)> = (0..DRAWN).map(|i| (fibonacci::direction(i, DRAWN), 1.0)).collect();
        let projection = Projection::of(&directions);
        let mut irradiance = IrradianceStore::Sh9(ShStore::default()).zeros(count, 0);
        for probe in 0..count {
            let along = directions.iter().map(|(d, _)| grids.probe_irradiance(ProbeIndex(probe as u32), *d).into());
            irradiance.set_probe(probe, &projection.coefficients(along));
        }
        Volume {
            grid: grids.grid.clone(),
            states: vec![ProbeState::Active; count],
            positions: grids.positions.clone(),
            irradiance,
            occlusion: Occlusion::None,
            radiance: Default::default(),
            layout: Default::default(),
        }
    }
}

/// Directions that a probe is drawn from.
const DRAWN: usize = 48;

/// Passes on to what is written.
macro_rules! each {
    ($written:expr, $own:ident => $answer:expr) => {
        match $written {
            Written::Grids($own) => $answer,
            Written::Ddgi(ddgi) => {
                let $own = &ddgi.query();
                $answer
            }
        }
    };
}

impl Answers for Written {
    fn grid(&self) -> &Grid {
        match self {
            Written::Grids(grids) => &grids.grid,
            Written::Ddgi(ddgi) => &ddgi.volume.grid,
        }
    }

    fn positions(&self) -> &[Vec3] {
        match self {
            Written::Grids(grids) => &grids.positions,
            Written::Ddgi(ddgi) => &ddgi.volume.positions,
        }
    }

    fn is_active(&self, probe: ProbeIndex) -> bool {
        each!(self, own => own.is_active(probe))
    }

    fn corners(&self, point: &QueryPoint) -> [ProbeIndex; 8] {
        each!(self, own => own.corners(point))
    }

    fn weights(&self, point: &QueryPoint, visibility: Visibility) -> CornerWeights {
        each!(self, own => own.weights(point, visibility))
    }

    fn irradiance(&self, point: &QueryPoint, visibility: Visibility) -> Vec3 {
        each!(self, own => own.irradiance(point, visibility))
    }

    fn probe_irradiance(&self, probe: ProbeIndex, normal: Vec3) -> Vec3 {
        each!(self, own => own.probe_irradiance(probe, normal))
    }

    fn knows_walls(&self) -> bool {
        each!(self, own => own.knows_walls())
    }
}

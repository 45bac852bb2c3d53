//! Flags of `export`.

use std::path::PathBuf;

use clap::Args;

use super::trace::TraceArgs;

#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Probe file that `bake` wrote.
    #[arg(value_name = "PROBES")]
    pub probes: PathBuf,
    /// Engine or form.
    #[arg(long, value_enum)]
    pub to: TargetName,
    /// Folder to write into; created where missing.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Scene of the bake, a .glb or .gltf file: needed by --fit, by --volumes auto, and by ddgi where the probes know no
    /// distances. A .glb is copied beside the probes for the page of three.
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Choose the values so that the engine's own look-up comes nearest to path-traced light at points of surfaces and of the
    /// air (three, bevy).
    #[arg(long, requires = "scene")]
    pub fit: bool,
    /// one: the grid as it is. auto: one volume for each room, up to its walls, and one for each opening between rooms, a layer
    /// of probes into both (three, bevy).
    #[arg(long, value_enum, default_value = "one")]
    pub volumes: VolumesName,
    /// Override one key of the fit, for example fit.rows.lambda=0.3; may be repeated.
    #[arg(long, value_name = "KEY=VALUE", requires = "fit")]
    pub set: Vec<String>,
    #[command(flatten)]
    pub trace: TraceArgs,
    /// Export although the scene has changed since the bake.
    #[arg(long)]
    pub allow_scene_change: bool,
}

/// Targets of exports by the names of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum TargetName {
    Three,
    Bevy,
    Ddgi,
    Exr,
}

/// Engines whose look-up `render` can make.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum EngineName {
    Three,
    Bevy,
    Ddgi,
}

/// How an export divides a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum VolumesName {
    One,
    Auto,
}

//! Flags of `convert`.

use std::path::PathBuf;

use clap::Args;

use super::trace::TraceArgs;

#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// Probe file that `bake` wrote.
    #[arg(value_name = "PROBES")]
    pub probes: PathBuf,
    /// Scene that it was baked from: a .glb or .gltf file.
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    #[command(flatten)]
    pub trace: TraceArgs,
    /// Probe file to write.
    #[arg(short, long, value_name = "OUT.probes")]
    pub output: PathBuf,
    /// The lattice that the probes are put on.
    #[arg(long, value_enum)]
    pub to: LatticeName,
    /// Convert although the scene has changed since the bake.
    #[arg(long)]
    pub allow_scene_change: bool,
}

/// Lattices by the names of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum LatticeName {
    Uniform,
}

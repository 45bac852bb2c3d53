//! Flags of `view`.

use std::path::PathBuf;

use clap::Args;

use super::trace::TraceArgs;
use super::values::parse_exposure;

#[derive(Debug, Args)]
pub struct LookArgs {
    /// Scene: a .glb or .gltf file.
    #[arg(value_name = "SCENE")]
    pub scene: PathBuf,
    #[command(flatten)]
    pub trace: TraceArgs,
    /// Probe file that `bake` wrote.
    #[arg(value_name = "PROBES")]
    pub probes: PathBuf,
    /// Page to write.
    #[arg(short, long, value_name = "FILE.html")]
    pub output: PathBuf,
    /// Exposure at first, in powers of two; from what the first camera sees where not given.
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = parse_exposure)]
    pub exposure: Option<f32>,
    /// Show the probes on the scene although it has changed since the bake.
    #[arg(long)]
    pub allow_scene_change: bool,
}

//! Flags of commands that only tell: `inspect` and `help`.

use std::path::PathBuf;

use clap::Args;

use super::values::{TraceRay, parse_index};

#[derive(Debug, Args)]
pub struct InspectArgs {
    /// Probe file that `bake` wrote.
    #[arg(value_name = "PROBES")]
    pub probes: PathBuf,
    /// Also print one probe: position, state, irradiance along the six axes.
    #[arg(long, value_name = "I", allow_negative_numbers = true, value_parser = parse_index)]
    pub probe: Option<u32>,
    /// Draw the way of a ray over the maps of the light fields that it is traced in, world space; with --probe over that one's.
    #[arg(long, value_name = "ox,oy,oz,dx,dy,dz", allow_hyphen_values = true, requires = "output")]
    pub trace: Option<TraceRay>,
    /// Picture of the ray's way to write.
    #[arg(short, long, value_name = "FILE.png", requires = "trace")]
    pub output: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct HelpArgs {
    /// A command or a topic.
    #[arg(value_name = "COMMAND|TOPIC")]
    pub name: Option<String>,
}

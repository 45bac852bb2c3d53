//! Flags of commands that only tell: `inspect` and `help`.

use std::path::PathBuf;

use clap::Args;

use super::values::parse_index;

#[derive(Debug, Args)]
pub struct InspectArgs {
    /// Probe file that `bake` wrote.
    #[arg(value_name = "PROBES")]
    pub probes: PathBuf,
    /// Also print one probe: position, state, irradiance along the six axes.
    #[arg(long, value_name = "I", allow_negative_numbers = true, value_parser = parse_index)]
    pub probe: Option<u32>,
}

#[derive(Debug, Args)]
pub struct HelpArgs {
    /// A command or a topic.
    #[arg(value_name = "COMMAND|TOPIC")]
    pub name: Option<String>,
}

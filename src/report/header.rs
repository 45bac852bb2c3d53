//! What every report starts with.

use serde::Serialize;

/// The first keys of every report: what was run, on what, with what. Reports flatten it.
#[derive(Debug, Clone, Serialize)]
pub struct Header {
    /// Layout of the report and its version, such as "lightprobe-bake/1".
    pub schema: &'static str,
    /// Of the program.
    pub version: &'static str,
    pub command: &'static str,
    pub seed: u64,
    pub threads: usize,
    pub scene_blake3: String,
    /// Effective configuration, RON; in reports on probes that of their bake.
    pub config: String,
}

impl Header {
    pub fn new(
        schema: &'static str,
        command: &'static str,
        seed: u64,
        threads: usize,
        scene_blake3: &str,
        config: String,
    ) -> Header {
        let version = env!("CARGO_PKG_VERSION");
        Header { schema, version, command, seed, threads, scene_blake3: scene_blake3.to_owned(), config }
    }
}

//! What every report begins with.

use serde::Serialize;

#[derive(Debug, Clone, Serialize)]
pub struct Header {
    /// Name and version of the report's layout.
    pub schema: &'static str,
    /// Of the program.
    pub version: &'static str,
    pub command: &'static str,
    pub seed: u64,
    pub threads: usize,
    /// Of every byte of the scene's files and of its sky.
    pub scene_blake3: String,
    /// Effective configuration, RON.
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

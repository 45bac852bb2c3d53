//! Flags of every command that loads a scene and traces it.

use std::str::FromStr;

use clap::Args;

use super::values::{parse_finite, parse_not_negative, parse_seed, parse_threads};
use crate::scene::EnvironmentSource;

/// Flags of every command that loads a scene and traces it.
#[derive(Debug, Args)]
pub struct TraceArgs {
    /// Sky: an equirectangular map, its centre −Z and its top +Y, or a constant radiance, W·m⁻²·sr⁻¹.
    ///
    /// Goes before `lights.sky`. A probe file keeps a constant sky for `render`; a map must be given to `render` again.
    /// FILE.exr:LAYER reads a layer or part of an OpenEXR file instead of its plain R, G, B. See `lightprobe help gltf`.
    #[arg(long, value_name = "FILE.hdr|FILE.exr[:LAYER]|R,G,B", value_parser = EnvironmentSource::from_str, allow_hyphen_values = true)]
    pub env: Option<EnvironmentSource>,
    /// Turn the map of --env about +Y, counterclockwise as seen from above: 90 takes its centre from −Z to −X.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, value_parser = parse_finite, allow_hyphen_values = true)]
    pub env_rotate: f64,
    /// Multiply the radiance of --env, from 0 up; a sky of the configuration is used as it is.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = parse_not_negative, allow_hyphen_values = true)]
    pub env_scale: f32,
    /// Seed of all random numbers.
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true, value_parser = parse_seed)]
    pub seed: u64,
    /// Threads to use; 0 means one per core. The result does not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true, value_parser = parse_threads)]
    pub threads: usize,
}

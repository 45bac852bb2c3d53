//! From cameras to pictures: which points a camera sees, how probes or paths light them, and the layers of the result.

pub mod air;
pub mod bent;
pub mod block_mean;
mod develop;
pub mod film;
pub mod framing;
pub mod glossy;
pub mod held_out;
pub mod layers;
pub mod outlook;
pub mod point_truth;
pub mod points;
pub mod reference;
pub mod reference_file;
pub mod regions;
pub mod spheres;
pub mod texels;
pub mod traced;
pub mod visibility_modes;

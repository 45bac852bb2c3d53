//! Cameras to pictures: what is seen, how probes light it, and the layers that come of it.

mod develop;
pub mod film;
pub mod framing;
pub mod layers;

pub mod outlook;
pub mod points;
pub mod reference;
pub mod reference_file;
pub mod regions;
pub mod spheres;
pub mod visibility_modes;

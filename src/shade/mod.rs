//! Cameras to pictures: what is seen, how probes light it, and the layers that come of it.

pub mod framing;
pub mod layers;
pub mod methods;
pub mod outlook;
pub mod points;
pub mod spheres;

//! What a place knows of the light.

use super::emitters::shares::Shares;

/// What a place has learnt by rays of its own.
#[derive(Debug)]
pub struct Learnt {
    pub shares: Shares,
    /// Luminance of the irradiance from emitters and punctual lights, W·m⁻²: the mean over the place's points, of few rays.
    pub direct: f32,
    /// The places that its cosine-distributed rays met.
    pub links: Box<[Link]>,
}

/// One cosine-distributed ray from place to place.
#[derive(Debug, Clone, Copy)]
pub struct Link {
    /// Key of the place.
    pub place: u32,
    /// Luminance of the albedo there × this ray's share of all rays of its place.
    pub albedo: f32,
}

//! From the accumulated quantities of the reference to the layers of its picture.

use glam::Vec3;

use super::film::{Film, Quantity};
use super::layers::{compose, to_pixels};
use super::points::{ImagePoint, View, has_blend};
use crate::image::LayeredImage;
use crate::light::World;
use crate::light::bsdf::{Bsdf, ReflectionModel};
use crate::light::lambert::reflected_radiance;

/// Names of the layers with variances.
pub const BEAUTY_VARIANCE: &str = "beauty_variance";
pub const IRRADIANCE_INDIRECT_VARIANCE: &str = "irradiance_indirect_variance";
pub const GLOSSY_VARIANCE: &str = "glossy_variance";

/// The quantities that are accumulated, by transport. `BLENDED` lists are for scenes whose pixels can show several
/// points.
const LAMBERT: &[Quantity] = &[Quantity::IrradianceIndirect];
const GLTF: &[Quantity] = &[Quantity::IrradianceIndirect, Quantity::Beauty, Quantity::Indirect, Quantity::Glossy];
const BLENDED: &[Quantity] = &[
    Quantity::IrradianceIndirect,
    Quantity::Beauty,
    Quantity::Indirect,
    Quantity::Emission,
    Quantity::Direct,
    Quantity::IrradianceDirect,
    Quantity::Albedo,
    Quantity::Normal,
    Quantity::Depth,
];
const BLENDED_GLTF: &[Quantity] = &[
    Quantity::IrradianceIndirect,
    Quantity::Beauty,
    Quantity::Indirect,
    Quantity::Glossy,
    Quantity::Emission,
    Quantity::Direct,
    Quantity::IrradianceDirect,
    Quantity::Albedo,
    Quantity::Normal,
    Quantity::Depth,
];

/// A view in which each pixel shows one point or the sky, the same for all samples.
pub(super) struct FixedView {
    pub view: View,
    /// Per pixel the index of its point in `view.points`, or [`NO_POINT`] for the sky.
    pub point_of_pixel: Vec<u32>,
    /// Per point the radiance that it reflects from punctual lights, W·m⁻²·sr⁻¹.
    pub direct: Vec<Vec3>,
}

pub(super) const NO_POINT: u32 = u32::MAX;

/// The quantities to accumulate for this scene and transport.
pub fn quantities(world: &World, transport: ReflectionModel) -> &'static [Quantity] {
    match (has_blend(world), transport) {
        (false, ReflectionModel::Lambert) => LAMBERT,
        (false, ReflectionModel::Gltf) => GLTF,
        (true, ReflectionModel::Lambert) => BLENDED,
        (true, ReflectionModel::Gltf) => BLENDED_GLTF,
    }
}

/// Radiance that a point reflects from punctual lights, W·m⁻²·sr⁻¹.
pub(super) fn direct_radiance(world: &World, point: &ImagePoint, transport: ReflectionModel, salt: u32) -> Vec3 {
    match transport {
        ReflectionModel::Lambert => reflected_radiance(point.surface.albedo, point.irradiance_direct),
        ReflectionModel::Gltf => {
            let bsdf = Bsdf::new(world, &point.surface, point.query.normal, point.query.view, transport);
            world.punctual_radiance(&point.surface, &bsdf, salt)
        }
    }
}

/// All layers of a picture whose pixels show one point each.
pub(super) fn develop_fixed(film: &Film, fixed: &FixedView) -> LayeredImage {
    let view = &fixed.view;
    let pixels = film.mean(Quantity::IrradianceIndirect).unwrap_or_default();
    let at_points: Vec<Vec3> = view.points.iter().map(|p| pixels[p.pixel as usize]).collect();
    let mut image = compose(view, &at_points);
    if film.quantities() == GLTF {
        for quantity in [Quantity::Beauty, Quantity::Indirect, Quantity::Glossy] {
            image.push(quantity.name(), film.mean(quantity).unwrap_or_default());
        }
        image.push(Quantity::Direct.name(), to_pixels(view, |i, _| fixed.direct[i]));
        push_variances(film, &mut image);
    } else if let Some(variance) = film.variance(Quantity::IrradianceIndirect) {
        let mut beauty = vec![Vec3::ZERO; variance.len()];
        for p in &view.points {
            // The reflected radiance is a factor times the irradiance, so its variance has the square of that factor.
            let factor = reflected_radiance(p.surface.albedo, Vec3::ONE);
            beauty[p.pixel as usize] = variance[p.pixel as usize] * factor * factor;
        }
        image.push(BEAUTY_VARIANCE, beauty);
        image.push(IRRADIANCE_INDIRECT_VARIANCE, variance);
    }
    image
}

/// All layers of a picture whose pixels can show several points. Each layer is an average over samples.
pub(super) fn develop_blended(film: &Film, width: u32, height: u32) -> LayeredImage {
    let mut image = LayeredImage::new(width, height);
    for &quantity in film.quantities() {
        if let Some(mean) = film.mean(quantity) {
            image.push(quantity.name(), mean);
        }
    }
    push_variances(film, &mut image);
    image
}

/// Adds the layers with the accumulated variances.
fn push_variances(film: &Film, image: &mut LayeredImage) {
    for (quantity, name) in [
        (Quantity::Beauty, BEAUTY_VARIANCE),
        (Quantity::IrradianceIndirect, IRRADIANCE_INDIRECT_VARIANCE),
        (Quantity::Glossy, GLOSSY_VARIANCE),
    ] {
        if let Some(variance) = film.variance(quantity) {
            image.push(name, variance);
        }
    }
}

//! The layers of a picture, from its points.

use glam::Vec3;

use super::points::{ImagePoint, View};
use crate::image::LayeredImage;
use crate::light::lambert::reflected_radiance;

/// Radiance towards the viewer, W·m⁻²·sr⁻¹: emission, and reflection of direct and indirect light.
pub fn beauty(point: &ImagePoint, irradiance_indirect: Vec3) -> Vec3 {
    let surface = &point.surface;
    surface.emission + reflected_radiance(surface.albedo, point.irradiance_direct + irradiance_indirect)
}

/// The pixels of a layer: each is the sum of `value` over its points, weighted by their shares of the pixel.
pub fn to_pixels(view: &View, value: impl Fn(usize, &ImagePoint) -> Vec3) -> Vec<Vec3> {
    let mut pixels = vec![Vec3::ZERO; view.width as usize * view.height as usize];
    for (i, point) in view.points.iter().enumerate() {
        pixels[point.pixel as usize] += value(i, point) * point.weight;
    }
    pixels
}

/// The beauty of a picture by its layers without indirect light, and the indirect irradiance of each pixel, W·m⁻²; radiance,
/// W·m⁻²·sr⁻¹. Where translucent surfaces overlap, the pixel's mean albedo stands for that of each.
pub fn lit(dark: &LayeredImage, irradiance: &[Vec3]) -> Vec<Vec3> {
    let layer = |name: &str| dark.layer(name).unwrap_or_default();
    let pixels = layer("beauty").iter().zip(layer("albedo")).zip(irradiance);
    pixels.map(|((beauty, albedo), irradiance)| *beauty + reflected_radiance(*albedo, *irradiance)).collect()
}

/// All layers of a picture. `indirect` is the indirect irradiance at every point, W·m⁻².
pub fn compose(view: &View, indirect: &[Vec3]) -> LayeredImage {
    let mut image = LayeredImage::new(view.width, view.height);
    let with_sky = |mut pixels: Vec<Vec3>| {
        pixels.iter_mut().zip(&view.sky).for_each(|(p, sky)| *p += *sky);
        pixels
    };
    image.push("beauty", with_sky(to_pixels(view, |i, p| beauty(p, indirect[i]))));
    image.push("emission", with_sky(to_pixels(view, |_, p| p.surface.emission)));
    let reflected = |p: &ImagePoint, irradiance| reflected_radiance(p.surface.albedo, irradiance);
    image.push("direct", to_pixels(view, |_, p| reflected(p, p.irradiance_direct)));
    image.push("indirect", to_pixels(view, |i, p| reflected(p, indirect[i])));
    image.push("irradiance_direct", to_pixels(view, |_, p| p.irradiance_direct));
    image.push("irradiance_indirect", to_pixels(view, |i, _| indirect[i]));
    image.push("albedo", to_pixels(view, |_, p| p.surface.albedo));
    image.push("normal", to_pixels(view, |_, p| p.query.normal));
    image.push("depth", to_pixels(view, |_, p| Vec3::splat(p.depth)));
    image
}

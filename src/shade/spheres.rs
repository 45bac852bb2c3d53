//! The probes as small spheres in a picture. Baked probes are shaded by their own irradiance; the colour of the others
//! tells why they are not baked.

use glam::{Vec2, Vec3};

use super::points::View;
use crate::image::{Picture, Picture8};
use crate::probe::lattice::ProbeState;
use crate::probe::{ProbeIndex, Volume};
use crate::scene::Camera;
use crate::scene::camera::Projection;

/// Radius of the spheres, as a share of the smallest grid spacing.
pub const RADIUS: f32 = 0.08;

/// sRGB colour of probes inside geometry.
pub const INSIDE_COLOR: [u8; 3] = [214, 48, 49];

/// sRGB colour of probes that no surface samples.
pub const UNSAMPLED_COLOR: [u8; 3] = [9, 132, 227];

/// sRGB colour of the rim around every sphere. The rim keeps dark spheres visible in front of a dark background.
pub const RIM_COLOR: [u8; 3] = [200, 204, 208];

/// Width of the rim, pixels.
const RIM_PX: f32 = 1.2;

/// Largest width of the rim as a share of the sphere's radius.
const RIM_SHARE: f32 = 0.25;

/// Draws the probes over a picture of the scene. Surfaces hide the probes behind them.
pub fn draw(scene_picture: &Picture8, view: &View, camera: &Camera, volume: &Volume, exposure_ev: f32) -> Picture8 {
    let (width, height) = (view.width, view.height);
    let mut picture = scene_picture.clone();
    let mut depth = vec![f32::INFINITY; width as usize * height as usize];
    for point in &view.points {
        let d = &mut depth[point.pixel as usize];
        *d = d.min(point.depth);
    }
    for p in 0..volume.states.len() {
        // Probes of larger cells are drawn larger.
        let radius = RADIUS * volume.grid.spacing_min() * volume.grid.width(ProbeIndex(p as u32)) as f32;
        let centre = volume.positions[p];
        let Some(Disc { low, high, radius_px }) = disc(camera, centre, radius, width, height) else { continue };
        let rim = RIM_SHARE.min(RIM_PX / radius_px);
        for y in low.1..high.1 {
            for x in low.0..high.0 {
                let (origin, direction) = camera.pixel_ray(x, y, width, height);
                let Some(t) = ray_sphere(origin, direction, centre, radius) else { continue };
                let pixel = (y * width + x) as usize;
                if t < depth[pixel] {
                    depth[pixel] = t;
                    let normal = (origin + direction * t - centre) / radius;
                    // The sine of the angle between normal and view is the distance from the disc's centre, in radii.
                    let from_centre = normal.cross(direction).length();
                    picture.pixels[pixel] = match from_centre > 1.0 - rim {
                        true => RIM_COLOR,
                        false => color(volume, p, normal, -direction, exposure_ev),
                    };
                }
            }
        }
    }
    picture
}

fn color(volume: &Volume, probe: usize, normal: Vec3, view: Vec3, exposure_ev: f32) -> [u8; 3] {
    let flat = |c: [u8; 3]| {
        let shade = 0.45 + 0.55 * normal.dot(view).clamp(0.0, 1.0);
        c.map(|v| (f32::from(v) * shade) as u8)
    };
    match volume.states[probe] {
        ProbeState::InsideGeometry => flat(INSIDE_COLOR),
        ProbeState::NeverSampled => flat(UNSAMPLED_COLOR),
        ProbeState::Active => {
            // A white sphere in the probe's own light.
            let radiance = crate::light::lambert::reflected_radiance(
                Vec3::ONE,
                volume.probe_irradiance(ProbeIndex(probe as u32), normal),
            );
            Picture::from_pixels(1, 1, vec![radiance]).tonemapped(exposure_ev).pixels[0]
        }
    }
}

/// The part of the picture that a sphere may cover.
struct Disc {
    /// First column and row that the sphere may cover.
    low: (u32, u32),
    /// Column and row after the last ones that it may cover.
    high: (u32, u32),
    /// Approximate radius, pixels.
    radius_px: f32,
}

/// The part of the picture that a sphere may cover. `None` if it lies behind the camera or outside the picture.
fn disc(camera: &Camera, centre: Vec3, radius: f32, width: u32, height: u32) -> Option<Disc> {
    let in_camera = camera.world_from_camera.transpose() * (centre - camera.position);
    let scale = match camera.projection {
        Projection::Perspective { fov_y_rad } => {
            // A sphere nearer than this would enclose the camera or fill the picture.
            let distance = -in_camera.z - radius;
            if distance <= radius {
                return None;
            }
            1.0 / (distance * (0.5 * fov_y_rad).tan())
        }
        Projection::Orthographic { half_height_m } if in_camera.z < 0.0 => 1.0 / half_height_m,
        Projection::Orthographic { .. } => return None,
    };
    let size = Vec2::new(width as f32, height as f32);
    let aspect = size.x / size.y;
    let middle = in_camera.truncate() * scale / Vec2::new(aspect, 1.0);
    let reach = Vec2::new(radius * scale / aspect, radius * scale) * 1.5;
    let to_pixel = |ndc: Vec2| (Vec2::new(ndc.x, -ndc.y) * 0.5 + 0.5) * size;
    let a = to_pixel(middle + Vec2::new(-reach.x, reach.y)).max(Vec2::ZERO).floor();
    let b = to_pixel(middle + Vec2::new(reach.x, -reach.y)).min(size).ceil();
    (a.x < b.x && a.y < b.y).then_some(Disc {
        low: (a.x as u32, a.y as u32),
        high: (b.x as u32, b.y as u32),
        radius_px: radius * scale * 0.5 * size.y,
    })
}

/// Distance along the unit `direction` to the front of a sphere. `None` if the ray misses the sphere.
fn ray_sphere(origin: Vec3, direction: Vec3, centre: Vec3, radius: f32) -> Option<f32> {
    let to_centre = centre - origin;
    let along = to_centre.dot(direction);
    let miss_squared = (to_centre - direction * along).length_squared();
    let half_chord_squared = radius * radius - miss_squared;
    (along > 0.0 && half_chord_squared >= 0.0).then(|| along - half_chord_squared.sqrt())
}

//! What light does at texels.

use glam::Vec3;
use rayon::prelude::*;

use super::charts::{Chart, Charts, Place};
use crate::light::World;
use crate::light::contact::Contacts;
use crate::light::lambert::reflected_radiance;
use crate::math::random::{Purpose, Random};
use crate::probe::query::{Query, QueryPoint, Visibility};
use crate::probe::store::surface::Facing;
use crate::shade::visibility_modes::exact_mask;
use crate::trace::Hit;

/// What is known at a texel.
#[derive(Debug, Clone, Copy)]
pub struct Texel {
    /// Bit i: whether the place sees corner i of the cell of the texel's centre, see [`NUDGE`].
    pub mask: u8,
    /// Diffuse albedo.
    pub albedo: Vec3,
    /// Radiance that probes have no part in: emission, and what punctual lights have reflected there, W·m⁻²·sr⁻¹.
    pub own: Vec3,
    /// Irradiance from the probes without visibility, with that of the file, and with the exact one, W·m⁻².
    pub irradiance: [Vec3; 3],
    /// Surface that it stands for, m².
    pub area_m2: f32,
}

/// The cell of a texel is that of its centre moved off the surface by this share of the smallest spacing: a surface in a plane of
/// the grid has a cell that rounding does not choose.
pub const NUDGE: f32 = 1.37e-3;

/// What light does at all texels, in their order. Surfaces are seen straight on.
pub fn light(world: &World, query: &Query, charts: &Charts, seed: u64) -> Vec<Texel> {
    let contacts = Contacts::of_points(world.scene, &query.volume.positions);
    let of_chart = |chart: &Chart| {
        let sides = if chart.is_double_sided { &[1.0, -1.0][..] } else { &[1.0] };
        let area_m2 = world.scene.mesh.area(chart.triangle) / (chart.width * chart.height) as f32;
        let mut texels = Vec::with_capacity(chart.texels());
        for side in sides {
            for place in charts.places(world.scene, chart) {
                let number = u64::from(chart.first) + texels.len() as u64;
                let salt = Random::new(seed, Purpose::Pixel, number, 0).bits();
                texels.push(texel(world, query, &contacts, (chart, &place, *side), (area_m2, salt)));
            }
        }
        texels
    };
    charts.charts.par_iter().flat_map_iter(of_chart).collect()
}

fn texel(
    world: &World,
    query: &Query,
    contacts: &Contacts,
    (chart, place, side): (&Chart, &Place, f32),
    (area_m2, salt): (f32, u32),
) -> Texel {
    let front = world.scene.mesh.geometric_normal(chart.triangle);
    let Place { centre, barycentrics } = *place;
    let grid = &query.volume.grid;
    let geometric = front * side;
    let cell = query.cell(&asker(centre + geometric * NUDGE * grid.spacing_min(), geometric, geometric));
    let corners = grid.corners_around(&cell);
    let surface_at = |barycentric| {
        let surface = world.surface_at(Hit { t: 0.0, triangle: chart.triangle, barycentric }, -geometric);
        (exact_mask(world, query, contacts, &surface, corners, salt), surface)
    };
    let centred = surface_at(barycentrics[0]);
    // Where the centre sees nothing, another place of the texel may be the one that is seen.
    let others = || barycentrics[1..].iter().map(|&place| surface_at(place)).find(|(mask, _)| *mask != 0);
    let (mask, surface) = if centred.0 != 0 { centred } else { others().unwrap_or(centred) };
    let point = asker(surface.position, surface.shading_normal, geometric);
    // The place and the centre may lie on two sides of a plane of the grid.
    let own_corners = grid.corners_around(&query.cell(&point));
    let is_same = own_corners == corners;
    let own_mask = if is_same { mask } else { exact_mask(world, query, contacts, &surface, own_corners, salt) };
    let modes = [Visibility::Off, Visibility::Stored, Visibility::Exact(own_mask)];
    let (direct, _) = world.punctual_irradiance(&surface, surface.shading_normal, salt);
    Texel {
        mask,
        albedo: surface.albedo,
        own: surface.emission + reflected_radiance(surface.albedo, direct),
        irradiance: modes.map(|visibility| query.irradiance(&point, visibility)),
        area_m2,
    }
}

/// A point of a surface that is seen straight on.
fn asker(position: Vec3, normal: Vec3, geometric: Vec3) -> QueryPoint {
    QueryPoint { position, normal, geometric, facing: Facing::of(geometric), view: geometric }
}

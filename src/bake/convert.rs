//! A baked volume on another lattice.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::light::World;
use crate::light::contact::Contacts;
use crate::math::statistics::Moments;
use crate::probe::store::Occlusion;
use crate::probe::store::occlusion::OcclusionBuilder;
use crate::probe::{ProbeIndex, Volume};
use crate::trace::Ray;

/// The volume of a mixed grid on the uniform grid of its finest cells: irradiance is copied to every cell that a probe
/// stands for, distances are those of probes that stand for one cell, and are traced again for the others.
///
/// # Errors
/// The grid is uniform already, or visibility or radiance is held in a form that a new place would have to be surveyed for.
pub fn to_uniform(world: &World, volume: &Volume) -> Result<Volume, String> {
    let mixed = &volume.grid;
    let Some(tree) = mixed.tree() else { return Err("its grid is uniform already".to_owned()) };
    let grid = mixed.uniform();
    let sources: Vec<usize> = grid.probes().map(|probe| tree.probe(grid.coordinate(probe)) as usize).collect();
    let is_own = |source: usize| mixed.width(ProbeIndex(source as u32)) == 1;
    let positions: Vec<_> = grid
        .probes()
        .zip(&sources)
        .map(|(probe, &source)| if is_own(source) { volume.positions[source] } else { grid.grid_point(probe) })
        .collect();
    if !volume.radiance.is_empty() {
        return Err("its radiance belongs to its probes; bake with placement.refine=uniform instead".to_owned());
    }
    let mut converted = Volume {
        states: sources.iter().map(|&source| volume.states[source]).collect(),
        irradiance: volume.irradiance.of_probes(&sources),
        occlusion: Occlusion::None,
        radiance: volume.radiance.clone(),
        layout: volume.layout.clone(),
        positions,
        grid,
    };
    if volume.occlusion == Occlusion::None {
        return Ok(converted);
    }
    let Some(mut builder) = volume.occlusion.retraced(&converted.grid) else {
        return Err(format!(
            "its visibility ({}) belongs to its probes; bake with placement.refine=uniform instead",
            volume.occlusion.describe()
        ));
    };
    let contacts = Contacts::of_points(world.scene, &converted.positions);
    let traced: Vec<Option<Vec<Vec2>>> = (0..sources.len())
        .into_par_iter()
        .map(|p| {
            let again = !is_own(sources[p]) && converted.is_active(ProbeIndex(p as u32));
            again.then(|| {
                let distances = distances(world, &builder, p, contacts.viewpoint(p, converted.positions[p]));
                builder.filter(p, &distances)
            })
        })
        .collect();
    for (p, tile) in traced.iter().enumerate() {
        match tile {
            Some(tile) => builder.set(p, tile),
            None => builder.copy(p, &volume.occlusion, sources[p]),
        }
    }
    converted.occlusion = builder.finish();
    Ok(converted)
}

/// Distances along a probe's own rays from `position`, metres.
pub(super) fn distances(world: &World, occlusion: &OcclusionBuilder, probe: usize, position: Vec3) -> Vec<Moments> {
    let distance = |(i, (direction, most)): (usize, (Vec3, f32))| {
        let hit = world.tracer.closest(Ray::new(position, direction, i as u32));
        [f64::from(hit.map_or(most, |hit| hit.t.min(most)))].into_iter().collect()
    };
    occlusion.rays(probe).into_iter().enumerate().map(distance).collect()
}

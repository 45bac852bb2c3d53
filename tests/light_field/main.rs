//! Rays that are traced in probes against the same rays in the scene: how many agree, what they cost, and what probes on a grid
//! miss.
//!
//! `cargo test --release --test light_field -- --ignored --nocapture` prints the figures of `configs/presets/README.md`;
//! LIGHTPROBE_MARCH names scenes, each with the points of its grid: `scenes/cornell.glb:5,5,5`; LIGHTPROBE_PASSAGES others, each
//! with a spacing: `scenes/thin_wall.glb:0.75`.

mod agreement;
mod passages;

use std::path::Path;

use glam::{Vec2, Vec3};
use lightprobe::light::World;
use lightprobe::math::octahedral::{oct_from_direction, texel_direction};
use lightprobe::probe::Volume;
use lightprobe::probe::lattice::{Grid, ProbeState};
use lightprobe::probe::store::map::OctahedralMaps;
use lightprobe::probe::store::radiance::{FAR_M, LightField, Radiance, lowest_of};
use lightprobe::probe::store::{IrradianceStore, Occlusion};
use lightprobe::scene::{self, LoadOptions, Scene};
use lightprobe::trace::Ray;
use rayon::prelude::*;

/// Texels of the finer maps below one of the coarser.
const BLOCK: usize = 16;

fn load(path: &Path) -> Scene {
    scene::load(path, &LoadOptions::default()).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Probes at the points of a grid with nothing but what rays march through.
fn volume(world: &World, grid: Grid, side: usize) -> Volume {
    let positions: Vec<Vec3> = grid.probes().map(|p| grid.grid_point(p)).collect();
    let texel = |position: Vec3, o: usize| {
        let direction = texel_direction(o % side, o / side, side);
        match world.surface(Ray::new(position, direction, 0)) {
            // As the file holds them: f16, and a normal of two bytes.
            Some(surface) => {
                let oct = oct_from_direction(surface.shading_normal) * 127.5 + 127.5;
                let distance = half::f16::from_f32(surface.hit.t.min(FAR_M)).to_f32();
                (distance, oct.round() / 127.5 - 1.0)
            }
            None => (FAR_M, oct_from_direction(-direction)),
        }
    };
    let of_probe = |position: &Vec3| -> (Vec<f32>, Vec<Vec2>) {
        (0..side * side).into_par_iter().map(|o| texel(*position, o)).unzip()
    };
    let (mut distance, mut normal, mut lowest) = (Vec::new(), Vec::new(), Vec::new());
    for position in &positions {
        let (distances, normals) = of_probe(position);
        lowest.extend(lowest_of(&distances, side, side / BLOCK));
        distance.extend(distances);
        normal.extend(normals);
    }
    let field = LightField {
        radiance: OctahedralMaps { resolution: side, border: 0, texels: Vec::new() },
        normal: OctahedralMaps { resolution: side, border: 0, texels: normal },
        distance: OctahedralMaps { resolution: side, border: 0, texels: distance },
        lowest: Some(OctahedralMaps { resolution: side / BLOCK, border: 0, texels: lowest }),
    };
    Volume {
        states: vec![ProbeState::Active; positions.len()],
        irradiance: IrradianceStore::default().zeros(positions.len(), 1),
        occlusion: Occlusion::None,
        radiance: Radiance { light_field: Some(field), ..Default::default() },
        layout: Default::default(),
        positions,
        grid,
    }
}

//! The scene's triangles, for the page.

use std::io;

use glam::Vec3;
use serde::Serialize;

use super::blocks::Block;
use crate::math::octahedral::oct_from_direction;
use crate::scene::{Scene, TriangleIndex};
use crate::shade::texels::Charts;

/// Most triangles that a page shows.
pub const MOST_TRIANGLES: usize = 1 << 19;

/// Steps of a coordinate across the scene: as fine as f32 is at the far end of the box.
const STEPS: f64 = ((1 << 24) - 1) as f64;

/// Steps of an octahedral coordinate: 0.003°.
const NORMAL_STEPS: f32 = 65_534.0;

/// Both coordinates of a vertex without normal.
const NO_NORMAL: u32 = 65_535;

/// Which triangles are shown, and what is not.
#[derive(Debug, Clone)]
pub struct Shown {
    pub triangles: Vec<TriangleIndex>,
    /// Triangles left out, the smallest.
    pub left_out: usize,
    /// Their share of the area.
    pub left_out_area: f64,
}

/// How to make positions of the blocks' numbers: `low + number·step`.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Quantised {
    pub low: [f64; 3],
    pub step: [f64; 3],
}

impl Shown {
    /// All triangles, or the largest of too many.
    pub fn of(scene: &Scene) -> Shown {
        Shown::at_most(scene, MOST_TRIANGLES)
    }

    fn at_most(scene: &Scene, most: usize) -> Shown {
        let mut triangles: Vec<TriangleIndex> = (0..scene.mesh.triangles.len() as u32).map(TriangleIndex).collect();
        let area = |t: &TriangleIndex| scene.mesh.area(*t);
        let mut left_out = Vec::new();
        if triangles.len() > most {
            triangles.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a.cmp(b)));
            left_out = triangles.split_off(most);
            triangles.sort();
        }
        let sum = |of: &[TriangleIndex]| of.iter().map(|t| f64::from(area(t))).sum::<f64>();
        let (shown, lost) = (sum(&triangles), sum(&left_out));
        let left_out_area = if lost > 0.0 { lost / (shown + lost) } else { 0.0 };
        Shown { triangles, left_out: left_out.len(), left_out_area }
    }
}

/// Vertices, triangles and the sizes of their charts.
///
/// # Errors
/// None in practice: the writer is memory.
pub fn blocks(scene: &Scene, charts: &Charts) -> io::Result<(Vec<Block>, Quantised)> {
    let mesh = &scene.mesh;
    // In the order in which triangles name them, so that neighbours have neighbouring numbers.
    const UNUSED: u32 = u32::MAX;
    let (mut number, mut vertices) = (vec![UNUSED; mesh.positions.len()], Vec::new());
    let mut indices = Vec::with_capacity(3 * charts.charts.len());
    for chart in &charts.charts {
        for vertex in mesh.triangles[chart.triangle.0 as usize] {
            let known = &mut number[vertex as usize];
            if *known == UNUSED {
                *known = vertices.len() as u32;
                vertices.push(vertex as usize);
            }
            indices.push(*known);
        }
    }
    let positions = || vertices.iter().map(|&v| mesh.positions[v].as_dvec3());
    let low = positions().reduce(|a, b| a.min(b)).unwrap_or_default();
    let high = positions().reduce(|a, b| a.max(b)).unwrap_or_default();
    let step = (high - low) / STEPS;
    let coordinate = |axis: usize| {
        let code = move |p: glam::DVec3| ((p[axis] - low[axis]) / step[axis].max(f64::MIN_POSITIVE)).round() as u32;
        positions().map(code)
    };
    let positions: Vec<u32> = (0..3).flat_map(coordinate).collect();
    let normals: Vec<[u32; 2]> = vertices.iter().map(|&v| coded(mesh.normals[v])).collect();
    let normals: Vec<u32> = (0..2).flat_map(|axis| normals.iter().map(move |n| n[axis])).collect();
    let sizes = charts.charts.iter().map(|c| c.width).chain(charts.charts.iter().map(|c| c.height));
    let kinds = charts.charts.iter().map(|c| c.axis as u32 | u32::from(c.is_double_sided) << 2);
    let blocks = vec![
        Block::new("positions", 4, true, &positions)?,
        Block::new("normals", 4, true, &normals)?,
        Block::new("indices", 4, true, &indices)?,
        Block::new("sizes", 2, false, &sizes.collect::<Vec<_>>())?,
        Block::new("kinds", 1, false, &kinds.collect::<Vec<_>>())?,
    ];
    Ok((blocks, Quantised { low: low.to_array(), step: step.to_array() }))
}

fn coded(normal: Vec3) -> [u32; 2] {
    if normal == Vec3::ZERO {
        return [NO_NORMAL; 2];
    }
    oct_from_direction(normal).to_array().map(|x| ((x * 0.5 + 0.5) * NORMAL_STEPS).round() as u32)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn of_too_many_triangles_the_smallest_are_left_out() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.glb");
        let scene = crate::scene::load(&path, &Default::default()).unwrap();
        let all = Shown::of(&scene);
        assert_eq!((all.triangles.len(), all.left_out, all.left_out_area), (scene.mesh.triangles.len(), 0, 0.0));
        let some = Shown::at_most(&scene, 12);
        assert_eq!((some.triangles.len(), some.left_out), (12, scene.mesh.triangles.len() - 12));
        assert!(some.triangles.is_sorted());
        let least = some.triangles.iter().map(|t| scene.mesh.area(*t)).fold(f32::INFINITY, f32::min);
        let larger = all.triangles.iter().filter(|t| scene.mesh.area(**t) > least).count();
        assert!(larger < 12 && some.left_out_area > 0.0 && some.left_out_area < 0.5, "{larger} {}", some.left_out_area);
    }
}

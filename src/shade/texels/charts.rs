//! Which texels a triangle has, and where they are.

use glam::{DVec2, Vec2, Vec3};

use crate::probe::Grid;
use crate::scene::{Scene, TriangleIndex};

/// Most texels besides one for every side of a triangle.
pub const MOST: usize = 1 << 20;

/// Texels a spacing at the finest, times a factor that no length of a scene is a multiple of: what lies at a whole number of
/// texels is then no plane of cells or voxels by design.
const FINEST_PER_SPACING: f64 = 64.0 / 1.0137;

/// From one trial of a side to the next.
const COARSER: f64 = 1.15;

/// Most texels along a side of a rectangle.
const MOST_ALONG: f64 = 16_384.0;

/// A centre outside of its triangle stands for the nearest place on it, moved inwards by this share of a texel: at the very edge
/// a wall may begin.
const INWARDS: f64 = 0.1;

/// The texels of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chart {
    pub triangle: TriangleIndex,
    /// Index of the first texel.
    pub first: u32,
    pub width: u32,
    pub height: u32,
    /// Axis that the triangle faces most, 0 to 2.
    pub axis: usize,
    pub is_double_sided: bool,
}

/// The texels of some triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct Charts {
    /// Side of a texel, metres.
    pub side_m: f64,
    pub charts: Vec<Chart>,
    /// Texels of all.
    pub count: usize,
}

/// A texel's place.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Centre in the triangle's plane; may lie outside of the triangle.
    pub centre: Vec3,
    /// Weights of the triangle's second and third vertex at the place on it that is nearest to the centre, and to places around
    /// it, for texels whose centre lies inside of another solid.
    pub barycentrics: [Vec2; 5],
}

/// Places around a texel's centre, in texels.
const AROUND: [DVec2; 5] =
    [DVec2::ZERO, DVec2::new(0.4, 0.4), DVec2::new(-0.4, 0.4), DVec2::new(0.4, -0.4), DVec2::new(-0.4, -0.4)];

impl Charts {
    /// Texels for these triangles, as fine as [`MOST`] allows.
    pub fn new(scene: &Scene, triangles: &[TriangleIndex], grid: &Grid) -> Charts {
        let mesh = &scene.mesh;
        let flat = |&triangle: &TriangleIndex| {
            let corners = mesh.corners(triangle);
            let axis = mesh.geometric_normal(triangle).abs().max_position();
            let [a, b, c] = corners.map(|corner| flattened(corner, axis));
            let extent = a.max(b).max(c) - a.min(b).min(c);
            (axis, extent, scene.material(triangle).double_sided)
        };
        let flat: Vec<(usize, DVec2, bool)> = triangles.iter().map(flat).collect();
        let along = |extent: DVec2, side: f64| (extent / side).ceil().max(DVec2::ONE);
        let sides = |is_double_sided| if is_double_sided { 2.0 } else { 1.0 };
        let least: f64 = flat.iter().map(|f| sides(f.2)).sum();
        let fits = |side: f64| {
            let count: f64 = flat.iter().map(|f| along(f.1, side).element_product() * sides(f.2)).sum();
            count <= least + MOST as f64 && flat.iter().all(|f| along(f.1, side).max_element() <= MOST_ALONG)
        };
        let mut side_m = f64::from(grid.spacing_min()) / FINEST_PER_SPACING;
        while !fits(side_m) {
            side_m *= COARSER;
        }
        let mut first = 0;
        let chart = |(&triangle, &(axis, extent, is_double_sided)): (&TriangleIndex, &(usize, DVec2, bool))| {
            let size = along(extent, side_m).as_uvec2();
            let chart = Chart { triangle, first, width: size.x, height: size.y, axis, is_double_sided };
            first += chart.texels() as u32;
            chart
        };
        let charts = triangles.iter().zip(&flat).map(chart).collect();
        Charts { side_m, charts, count: first as usize }
    }

    /// The places of a chart's texels, row by row.
    pub fn places(&self, scene: &Scene, chart: &Chart) -> impl Iterator<Item = Place> {
        let corners = scene.mesh.corners(chart.triangle);
        let normal = scene.mesh.geometric_normal(chart.triangle).as_dvec3();
        let (axis, width, side) = (chart.axis, chart.width, self.side_m);
        let flat = corners.map(|corner| flattened(corner, axis));
        let low = flat[0].min(flat[1]).min(flat[2]);
        let level = normal.dot(corners[0].as_dvec3());
        let place = move |i: u32| {
            let at = low + (DVec2::new(f64::from(i % width), f64::from(i / width)) + 0.5) * side;
            let mut centre = glam::DVec3::ZERO;
            let [u, v] = others(axis);
            (centre[u], centre[v]) = (at.x, at.y);
            centre[axis] = (level - normal.dot(centre)) / normal[axis];
            let barycentrics = AROUND.map(|way| nearest(flat, at + way * side, INWARDS * side));
            Place { centre: centre.as_vec3(), barycentrics }
        };
        (0..width * chart.height).map(place)
    }
}

impl Chart {
    /// Texels of both sides.
    pub fn texels(&self) -> usize {
        self.width as usize * self.height as usize * if self.is_double_sided { 2 } else { 1 }
    }
}

/// The axes u and v of a chart.
fn others(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

fn flattened(position: Vec3, axis: usize) -> DVec2 {
    let [u, v] = others(axis);
    DVec2::new(position[u].into(), position[v].into())
}

/// Weights of a triangle's second and third corner at the place on it that is nearest to a point; from outside a little farther in.
fn nearest([a, b, c]: [DVec2; 3], at: DVec2, inwards: f64) -> Vec2 {
    let area = (b - a).perp_dot(c - a);
    let weights = |p: DVec2| DVec2::new((p - a).perp_dot(c - a) / area, (b - a).perp_dot(p - a) / area);
    let own = weights(at);
    if own.min_element() >= 0.0 && own.element_sum() <= 1.0 {
        return own.as_vec2();
    }
    let on_edge = |[from, to]: [DVec2; 2]| {
        let way = to - from;
        let share = ((at - from).dot(way) / way.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        from + way * share
    };
    let edges = [[a, b], [b, c], [c, a]].map(on_edge);
    let closer = |p: DVec2, q: DVec2| if q.distance_squared(at) < p.distance_squared(at) { q } else { p };
    let edge = closer(closer(edges[0], edges[1]), edges[2]);
    let middle = (a + b + c) / 3.0;
    let share = (inwards / edge.distance(middle).max(f64::MIN_POSITIVE)).min(0.5);
    weights(edge.lerp(middle, share)).as_vec2()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [DVec2; 3] = [DVec2::ZERO, DVec2::new(4.0, 0.0), DVec2::new(0.0, 2.0)];

    #[test]
    fn a_place_inside_is_itself() {
        assert_eq!(nearest(TRIANGLE, DVec2::new(1.0, 0.5), 0.1), Vec2::new(0.25, 0.25));
    }

    #[test]
    fn a_place_outside_is_the_nearest_inside() {
        // Below the edge from (0,0) to (4,0): (1,0) is nearest, and 0.1 on the way to the middle (4/3, 2/3) comes a little up.
        let found = nearest(TRIANGLE, DVec2::new(1.0, -3.0), 0.1);
        let at = TRIANGLE[1] * f64::from(found.x) + TRIANGLE[2] * f64::from(found.y);
        let middle = (TRIANGLE[0] + TRIANGLE[1] + TRIANGLE[2]) / 3.0;
        let expected = DVec2::new(1.0, 0.0) + (middle - DVec2::new(1.0, 0.0)).normalize() * 0.1;
        assert!(at.distance(expected) < 1e-6, "{at}");
        // Beyond a corner too.
        let found = nearest(TRIANGLE, DVec2::new(-5.0, -5.0), 0.1);
        assert!(found.min_element() > 0.0 && found.element_sum() < 1.0, "{found}");
    }
}

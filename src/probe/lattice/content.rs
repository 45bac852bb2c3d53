//! Where the geometry of a scene is: most scenes fill their box, some are a room on a plane of fields, or a hall under a dome.
//!
//! Spacings and cameras that are chosen automatically follow the content, not the box.

use glam::Vec3;

use crate::scene::Mesh;

/// Slabs that the box is cut into along each axis.
const SLABS: usize = 64;

/// What is thinner than this share of the box's longest side is a sheet, a line or a point. One slab.
const FLAT: f32 = 1.0 / SLABS as f32;

/// Content with a longest side of more than this share of the box's is the whole scene.
const LEAST_SAVED: f32 = 0.5;

/// Share of the triangles on either side that may lie outside: a dome, a backdrop, things far away.
const FAR_SHARE: f32 = 0.01;

/// Such triangles count as far away where the box without them is smaller than this share of the whole.
const FAR_BOX: f32 = 0.25;

/// Fewer triangles have no tails.
const LEAST_TRIANGLES: usize = 1000;

/// Bounds of the content relative to the scene's origin, where they are much smaller than the scene's box.
pub fn content_bounds(mesh: &Mesh) -> Option<(Vec3, Vec3)> {
    let (low, high) = mesh.bounds()?;
    let longest = (high - low).max_element();
    if longest <= 0.0 || !longest.is_finite() {
        return None;
    }
    let (low, high) = without_tails(mesh, low, high).unwrap_or((low, high));
    let (low, high) = without_sheets(mesh, low, high).unwrap_or((low, high));
    ((high - low).max_element() < LEAST_SAVED * longest).then_some((low, high))
}

/// The box without the outermost triangles, where that makes it far smaller.
fn without_tails(mesh: &Mesh, low: Vec3, high: Vec3) -> Option<(Vec3, Vec3)> {
    if mesh.triangles.len() < LEAST_TRIANGLES {
        return None;
    }
    let tail = (mesh.triangles.len() as f32 * FAR_SHARE) as usize;
    let (mut first, mut last) = (Vec3::ZERO, Vec3::ZERO);
    for axis in 0..3 {
        let mut middles: Vec<f32> = mesh
            .triangles
            .iter()
            .map(|corners| corners.iter().map(|&i| mesh.positions[i as usize][axis]).sum::<f32>() / 3.0)
            .collect();
        middles.sort_by(f32::total_cmp);
        (first[axis], last[axis]) = (middles[tail], middles[middles.len() - 1 - tail]);
    }
    let margin = (last - first) * 0.1;
    let (near_low, near_high) = ((first - margin).max(low), (last + margin).min(high));
    ((near_high - near_low).max_element() < FAR_BOX * (high - low).max_element()).then_some((near_low, near_high))
}

/// The box without slabs at its ends that hold nothing but a sheet or a line that runs on along the axis: a ground plane
/// beyond the house on it, a mast above its roof.
fn without_sheets(mesh: &Mesh, low: Vec3, high: Vec3) -> Option<(Vec3, Vec3)> {
    let thin = FLAT * (high - low).max_element();
    let mut ends = (low, high);
    for axis in 0..3 {
        let width = (high[axis] - low[axis]) / SLABS as f32;
        if width <= 0.0 {
            continue;
        }
        let filled = slabs(mesh, (low, high), axis);
        let has_body = |slab: &Option<(Vec3, Vec3)>| {
            let Some((low, high)) = slab else { return false };
            (0..3).all(|other| other == axis || high[other] - low[other] > thin)
        };
        let first = filled.iter().position(has_body)?;
        let last = filled.iter().rposition(has_body)?;
        if first > 0 {
            ends.0[axis] = low[axis] + first as f32 * width;
        }
        if last + 1 < SLABS {
            ends.1[axis] = low[axis] + (last + 1) as f32 * width;
        }
    }
    Some(ends)
}

/// Bounds of what lies within the box in each slab along an axis.
fn slabs(mesh: &Mesh, (low, high): (Vec3, Vec3), axis: usize) -> Vec<Option<(Vec3, Vec3)>> {
    let width = (high[axis] - low[axis]) / SLABS as f32;
    let slab_of = |x: f32| (((x - low[axis]) / width) as usize).min(SLABS - 1);
    let mut found: Vec<Option<(Vec3, Vec3)>> = vec![None; SLABS];
    for corners in &mesh.triangles {
        let corners = corners.map(|i| mesh.positions[i as usize]);
        let least = corners.iter().fold(Vec3::INFINITY, |a, b| a.min(*b));
        let most = corners.iter().fold(Vec3::NEG_INFINITY, |a, b| a.max(*b));
        if least.cmpgt(high).any() || most.cmplt(low).any() {
            continue;
        }
        for (slab, bounds) in found.iter_mut().enumerate().take(slab_of(most[axis]) + 1).skip(slab_of(least[axis])) {
            let from = low[axis] + slab as f32 * width;
            let to = if slab + 1 == SLABS { high[axis] } else { from + width };
            for point in within(corners, axis, from, to) {
                let point = point.clamp(low, high);
                let (a, b) = bounds.get_or_insert((point, point));
                (*a, *b) = (a.min(point), b.max(point));
            }
        }
    }
    found
}

/// Corners of the part of a triangle between two planes.
fn within(corners: [Vec3; 3], axis: usize, from: f32, to: f32) -> impl Iterator<Item = Vec3> {
    let inside = corners.into_iter().filter(move |c| (from..=to).contains(&c[axis]));
    let edges = (0..3).map(move |i| (corners[i], corners[(i + 1) % 3]));
    let cut = edges.flat_map(move |(a, b)| {
        [from, to].into_iter().filter_map(move |plane| {
            let share = (plane - a[axis]) / (b[axis] - a[axis]);
            (share > 0.0 && share < 1.0).then(|| a + (b - a) * share)
        })
    });
    inside.chain(cut)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes from low to high, six sides of two triangles each.
    fn boxes(boxes: &[([f32; 3], [f32; 3])]) -> Mesh {
        let mut mesh = Mesh::default();
        for (low, high) in boxes {
            let start = mesh.positions.len() as u32;
            let ends = [Vec3::from(*low), Vec3::from(*high)];
            mesh.positions.extend((0..8).map(|i| Vec3::new(ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2].z)));
            for [a, b, c, d] in [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]] {
                mesh.triangles.extend([[a, b, c], [a, c, d]].map(|t| t.map(|i| start + i)));
            }
        }
        mesh
    }

    const ROOM: ([f32; 3], [f32; 3]) = ([-2.0, 0.0, -2.0], [2.0, 2.5, 2.0]);

    fn assert_room(found: Option<(Vec3, Vec3)>, tolerance: f32) {
        let (low, high) = found.expect("content that is smaller than the box");
        let off = (low - Vec3::from(ROOM.0)).abs().max((high - Vec3::from(ROOM.1)).abs());
        assert!(off.max_element() <= tolerance, "{low} {high}");
    }

    #[test]
    fn a_room_alone_is_all_of_its_scene() {
        assert_eq!(content_bounds(&boxes(&[ROOM])), None);
        assert_eq!(content_bounds(&boxes(&[ROOM, ([1.0, 0.0, 1.0], [5.0, 2.5, 5.0])])), None);
    }

    #[test]
    fn a_ground_plane_is_not_content() {
        // Ends of slabs: 30 m ÷ 64.
        let ground = ([-15.0, -0.01, -15.0], [15.0, 0.0, 15.0]);
        assert_room(content_bounds(&boxes(&[ROOM, ground])), 0.47);
    }

    #[test]
    fn a_mast_is_not_content() {
        let mast = ([0.0, 2.5, 0.0], [0.05, 40.0, 0.05]);
        assert_room(content_bounds(&boxes(&[ROOM, mast])), 0.63);
    }

    #[test]
    fn a_dome_is_not_content() {
        // 125 rooms of 12 triangles in a cube of 10 m, and a box around them that is 100 times as large.
        let mut all = vec![([-500.0; 3], [500.0; 3])];
        for i in 0..125 {
            let at = [i % 5, i / 5 % 5, i / 25].map(|k| k as f32 * 2.0 - 5.0);
            all.push((at, at.map(|x| x + 2.0)));
        }
        let (low, high) = content_bounds(&boxes(&all)).expect("content");
        assert!(low.min_element() >= -6.0 && high.max_element() <= 6.0, "{low} {high}");
    }

    #[test]
    fn planes_and_points_are_all_there_is() {
        assert_eq!(content_bounds(&boxes(&[([-5.0, 0.0, -5.0], [5.0, 0.0, 5.0])])), None);
        assert_eq!(content_bounds(&boxes(&[([1.0; 3], [1.0; 3])])), None);
        assert_eq!(content_bounds(&Mesh::default()), None);
    }
}

//! Node transforms: the linear part in f64, the translation as an unevaluated sum of two f64 (106 bits).
//!
//! The extra bits make results relative to the scene independent of its position in the world. A root node may move the
//! scene by 10⁶ times its size: in `t_world = t_parent ⊕ A_parent·t_local` only the sum ⊕ contains that distance, and
//! 106 bits hold the sum without rounding.

use glam::{DMat3, DQuat, DVec3};
use gltf::json::Node;
use twofloat::TwoFloat;

/// What a node's transform does to directions, without the sizes of its scale.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn {
    /// The node's rotation: all that a light or a camera on this node takes from its transform.
    pub rotation: DMat3,
    /// The rotation with the signs of the scale: what the node's children inherit. A node that mirrors its children
    /// mirrors the directions of their lights too.
    pub inherited: DMat3,
}

impl Turn {
    pub fn of_node(node: &Node) -> Turn {
        match &node.matrix {
            Some(matrix) => Turn::of_linear(&Local::from_matrix(matrix).linear),
            None => {
                let rotation = Local::from_trs([0.0; 3], node.rotation.unwrap_or_default().0, [1.0; 3]).linear;
                let sign = |scale: f32| if scale < 0.0 { -1.0 } else { 1.0 };
                let signs = DVec3::from_array(node.scale.unwrap_or([1.0; 3]).map(sign));
                Turn { rotation, inherited: rotation * DMat3::from_diagonal(signs) }
            }
        }
    }

    /// From a matrix, whose scale has no signs of its own. A mirroring matrix counts as one with a negative scale along
    /// x, the usual convention of decompositions.
    fn of_linear(linear: &DMat3) -> Turn {
        let mirrored = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        let inherited = nearest_orthogonal(linear);
        let rotation = if is_mirrored(linear) { nearest_orthogonal(&(*linear * mirrored)) } else { inherited };
        Turn { rotation, inherited }
    }
}

/// The orthogonal factor of the polar decomposition `linear = Q·P` with P symmetric and not negative: the orthogonal
/// matrix nearest to it (Fan & Hoffman 1955). For columns that are perpendicular, as glTF requires of a node's matrix,
/// these are the columns at unit length; a sheared matrix turns by as much as its axes do on average.
fn nearest_orthogonal(linear: &DMat3) -> DMat3 {
    /// Cosine between columns from which a matrix counts as sheared: f32 entries round by 6e-8.
    const SHEARED: f64 = 1e-6;
    let a = of_unit_size(linear);
    let unit = [a.x_axis, a.y_axis, a.z_axis].map(DVec3::normalize_or_zero);
    let [x, y, z] = unit;
    let lengths_are_one = unit.iter().all(|axis| *axis != DVec3::ZERO);
    if lengths_are_one && [x.dot(y), y.dot(z), z.dot(x)].iter().all(|cosine| cosine.abs() < SHEARED) {
        return DMat3::from_cols(x, y, z);
    }
    let svd = nalgebra::Matrix3::from_column_slice(&a.to_cols_array()).svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => DMat3::from_cols_slice((u * v_t).as_slice()),
        _ => DMat3::IDENTITY,
    }
}

/// A local transform: `x ↦ linear·x + translation`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Local {
    pub linear: DMat3,
    pub translation: DVec3,
}

/// A point of the world. It may lie so far from the origin that one f64 per coordinate is too coarse.
pub(super) type WorldPoint = [TwoFloat; 3];

/// World transform of a node or instance: `world_from_local`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    pub linear: DMat3,
    pub translation: WorldPoint,
}

/// A placement relative to a nearby point, for which f64 suffices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    pub linear: DMat3,
    pub offset: DVec3,
}

impl Local {
    /// From translation, rotation (x, y, z, w; normalised here) and scale. A rotation of length zero is ignored.
    pub fn from_trs(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> Local {
        let [x, y, z, w] = rotation.map(f64::from);
        let length = (x * x + y * y + z * z + w * w).sqrt();
        let rotation = match length > 0.0 {
            true => DMat3::from_quat(DQuat::from_xyzw(x / length, y / length, z / length, w / length)),
            false => DMat3::IDENTITY,
        };
        let scale = DVec3::from_array(scale.map(f64::from));
        Local {
            linear: rotation * DMat3::from_diagonal(scale),
            translation: DVec3::from_array(translation.map(f64::from)),
        }
    }

    /// From a column-major 4×4 matrix. Its last row is ignored, because glTF requires it to be 0 0 0 1.
    pub fn from_matrix(matrix: &[f32; 16]) -> Local {
        let column = |i: usize| DVec3::new(f64::from(matrix[i]), f64::from(matrix[i + 1]), f64::from(matrix[i + 2]));
        Local { linear: DMat3::from_cols(column(0), column(4), column(8)), translation: column(12) }
    }

    /// The transform of a node, from its matrix or its translation, rotation and scale.
    pub fn of_node(node: &Node) -> Local {
        match &node.matrix {
            Some(matrix) => Local::from_matrix(matrix),
            None => Local::from_trs(
                node.translation.unwrap_or([0.0; 3]),
                node.rotation.unwrap_or_default().0,
                node.scale.unwrap_or([1.0; 3]),
            ),
        }
    }
}

impl Placement {
    pub const IDENTITY: Placement = Placement { linear: DMat3::IDENTITY, translation: [TwoFloat::from_f64(0.0); 3] };

    /// `world_from_child` of a child with this local transform.
    pub fn child(&self, local: &Local) -> Placement {
        let step = self.linear * local.translation;
        let mut translation = self.translation;
        for (sum, step) in translation.iter_mut().zip(step.to_array()) {
            *sum += step;
        }
        Placement { linear: self.linear * local.linear, translation }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.linear.is_finite() && self.translation.iter().all(|t| t.hi().is_finite() && t.lo().is_finite())
    }

    /// This placement relative to `origin`.
    pub fn relative_to(&self, origin: &WorldPoint) -> Pose {
        let axis = |i: usize| {
            let difference = self.translation[i] - origin[i];
            // + 0.0 turns −0 into +0, because the sign of a zero difference would depend on the scene's position.
            difference.hi() + difference.lo() + 0.0
        };
        Pose { linear: self.linear, offset: DVec3::new(axis(0), axis(1), axis(2)) }
    }
}

impl Pose {
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.linear * point + self.offset
    }
}

/// `point + offset`, rounded to f64 per axis.
pub(super) fn world_point(point: &WorldPoint, offset: DVec3) -> DVec3 {
    let axis = |i: usize| {
        let sum = point[i] + offset[i];
        sum.hi() + sum.lo()
    };
    DVec3::new(axis(0), axis(1), axis(2))
}

/// The matrix that transforms normals, up to a positive factor: the cofactor matrix times the sign of the determinant.
/// It equals the inverse transpose up to that factor but needs no division, so it exists for all transforms. Outward
/// normals stay outward under mirroring. A transform that flattens onto a plane gives the plane's normal.
pub(super) fn normal_matrix(linear: &DMat3) -> DMat3 {
    let a = of_unit_size(linear);
    let cofactor = DMat3::from_cols(a.y_axis.cross(a.z_axis), a.z_axis.cross(a.x_axis), a.x_axis.cross(a.y_axis));
    if is_mirrored(linear) { cofactor * -1.0 } else { cofactor }
}

/// Whether the transform mirrors, that is, has a negative determinant.
pub(super) fn is_mirrored(linear: &DMat3) -> bool {
    of_unit_size(linear).determinant() < 0.0
}

/// The matrix scaled so that its largest entry is ±1. Otherwise products of three entries of 1e-200 would become zero.
fn of_unit_size(linear: &DMat3) -> DMat3 {
    let size = linear.to_cols_array().into_iter().fold(0.0f64, |size, x| size.max(x.abs()));
    if size > 0.0 && size.is_finite() { *linear * size.recip() } else { DMat3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distant_root_changes_no_bit() {
        let steps = [DVec3::new(0.1, -0.7, 3.3), DVec3::new(1e-9, 0.3, -2.0), DVec3::new(0.0, 5.5, 0.123456789)];
        let chain = |root: Placement| {
            let linear = DMat3::from_quat(DQuat::from_rotation_y(0.7)) * 0.3;
            let mut all = vec![root.child(&Local { linear, translation: steps[0] })];
            for &translation in &steps[1..] {
                let last = all[all.len() - 1];
                all.push(last.child(&Local { linear, translation }));
            }
            let origin = all[0].translation;
            all.iter().map(|p| p.relative_to(&origin).offset).collect::<Vec<_>>()
        };
        let here = chain(Placement::IDENTITY);
        for distance in [1e5, 1e6, 3e7] {
            let far = Local { linear: DMat3::IDENTITY, translation: DVec3::new(distance, -distance, 0.1 * distance) };
            assert_eq!(chain(Placement::IDENTITY.child(&far)), here);
        }
    }

    #[test]
    fn the_nearest_orthogonal_matrix_is_that_of_the_polar_decomposition() {
        let turn = DMat3::from_quat(DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-1.1));
        // Q·P with P symmetric and positive: the decomposition is unique.
        let stretch =
            DMat3::from_cols(DVec3::new(2.0, 0.3, 0.1), DVec3::new(0.3, 1.0, -0.2), DVec3::new(0.1, -0.2, 0.7));
        for (q, p) in
            [(turn, stretch), (turn * -1.0, stretch), (turn, DMat3::from_diagonal(DVec3::new(1e-9, 3.0, 5.0)))]
        {
            assert!(nearest_orthogonal(&(q * p)).abs_diff_eq(q, 1e-12), "{q}");
        }
        // Where no decomposition is unique it is still orthogonal.
        for singular in [DMat3::ZERO, DMat3::from_cols(DVec3::X, DVec3::X, DVec3::ZERO)] {
            let q = nearest_orthogonal(&singular);
            assert!((q * q.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12), "{q}");
        }
    }

    #[test]
    fn normals_are_those_of_transformed_surfaces() {
        let linear =
            DMat3::from_cols(DVec3::new(2.0, 0.1, 0.0), DVec3::new(0.0, 1e-3, 0.4), DVec3::new(0.5, 0.0, -1.0));
        let (u, v) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 0.2));
        for linear in [linear, linear * -1.0, linear * -1e-120] {
            let n = (normal_matrix(&linear) * u.cross(v)).normalize();
            assert!(n.dot((linear * u).normalize()).abs() < 1e-12);
            assert!(n.dot((linear * v).normalize()).abs() < 1e-12);
            // Outward stays outward: a point in front of the surface stays in front.
            assert!(n.dot(linear * u.cross(v)) > 0.0);
        }
        assert_eq!(normal_matrix(&DMat3::ZERO), DMat3::ZERO);
    }
}

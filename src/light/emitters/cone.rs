//! Cones of directions, which bound where lights shine.

use std::f32::consts::PI;

use glam::{Quat, Vec3};

/// Directions within `angle` of `axis`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Unit.
    pub axis: Vec3,
    /// Radians, 0 to π.
    pub angle: f32,
}

impl Cone {
    pub const SPHERE: Cone = Cone { axis: Vec3::Z, angle: PI };

    /// A cone that holds both, the smallest one around an axis between theirs.
    pub fn union(self, other: Cone) -> Cone {
        let (wide, narrow) = if self.angle >= other.angle { (self, other) } else { (other, self) };
        let between = wide.axis.angle_between(narrow.axis);
        if (between + narrow.angle).min(PI) <= wide.angle {
            return wide;
        }
        let angle = 0.5 * (wide.angle + between + narrow.angle);
        let pivot = wide.axis.cross(narrow.axis);
        if angle >= PI || pivot.length_squared() < f32::EPSILON {
            return Cone::SPHERE;
        }
        let axis = Quat::from_axis_angle(pivot.normalize(), angle - wide.angle) * wide.axis;
        Cone { axis: axis.normalize(), angle }
    }

    /// Measure of the directions that lights with these normals reach, if each shines up to π/2 from its normal: the
    /// solid angle of the normals, and that of the rim weighted by the cosine (Conty Estévez & Kulla 2018, M_Ω).
    pub fn measure(self) -> f32 {
        let angle = self.angle;
        let rim = (angle + PI / 2.0).min(PI);
        let (sin, cos) = angle.sin_cos();
        2.0 * PI * (1.0 - cos) + PI / 2.0 * (2.0 * rim * sin - (angle - 2.0 * rim).cos() - 2.0 * angle * sin + cos)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn unit() -> impl Strategy<Value = Vec3> {
        let any = -1.0f32..1.0;
        (any.clone(), any.clone(), any)
            .prop_map(|(x, y, z)| Vec3::new(x, y, z))
            .prop_filter("has a direction", |v| v.length() > 0.1)
            .prop_map(Vec3::normalize)
    }

    proptest! {
        #[test]
        fn a_union_holds_both(a in unit(), b in unit(), wide in 0.0f32..PI, narrow in 0.0f32..PI, turn in 0.0f32..std::f32::consts::TAU) {
            let (one, other) = (Cone { axis: a, angle: wide }, Cone { axis: b, angle: narrow });
            let union = one.union(other);
            prop_assert!(union.axis.is_normalized() && union.angle <= PI);
            for cone in [one, other] {
                // A direction on the rim of the part.
                let (tangent, bitangent) = cone.axis.any_orthonormal_pair();
                let rim = cone.axis * cone.angle.cos() + (tangent * turn.cos() + bitangent * turn.sin()) * cone.angle.sin();
                // Angles near 0 and π are known to about √ε.
                prop_assert!(union.axis.angle_between(rim) <= union.angle + 2e-3, "{union:?} for {cone:?}");
            }
        }
    }

    #[test]
    fn measure_of_one_normal_and_of_all() {
        // ∫ cos θ dω over a half sphere is π; all normals reach all directions fully, 4π.
        assert!((Cone { axis: Vec3::Z, angle: 0.0 }.measure() - PI).abs() < 1e-5);
        assert!((Cone::SPHERE.measure() - 4.0 * PI).abs() < 1e-4);
    }
}

//! Transforms of the vertices of a draw, relative to a point near the scene.

use glam::{DMat3, DVec3};

use super::draws::Draws;
use super::places::Place;
use super::primitive::Primitive;
use super::transform::{Pose, WorldPoint};

/// The transforms of a draw's vertices: one pose for all, or joints that each vertex weights.
pub(super) enum Poses {
    Rigid(Pose),
    Skinned(Vec<Pose>),
}

impl Poses {
    pub fn of(draws: &Draws, place: &Place, origin: &WorldPoint) -> Poses {
        match place {
            Place::Rigid(placement) => Poses::Rigid(placement.relative_to(origin)),
            Place::Skinned(skeleton) => {
                Poses::Skinned(draws.skeletons[*skeleton].iter().map(|joint| joint.relative_to(origin)).collect())
            }
        }
    }

    pub fn at(&self, primitive: &Primitive, vertex: usize) -> Pose {
        let joints = match self {
            Poses::Rigid(pose) => return *pose,
            Poses::Skinned(joints) => joints,
        };
        let mut sum = Pose { linear: DMat3::ZERO, offset: DVec3::ZERO };
        let mut total = 0.0;
        for &(joint, weight) in &primitive.influences[vertex] {
            if weight != 0.0 {
                let (pose, weight) = (&joints[joint as usize], f64::from(weight));
                sum.linear += pose.linear * weight;
                sum.offset += pose.offset * weight;
                total += weight;
            }
        }
        // The sum of weights should be 1 and is divided out, because files round it. A vertex without weights follows
        // the first joint.
        if total == 0.0 {
            return joints[0];
        }
        Pose { linear: sum.linear * (1.0 / total), offset: sum.offset / total }
    }
}

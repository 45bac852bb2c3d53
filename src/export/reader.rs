//! What a probe file knows, as values that an engine stores.

use glam::{Vec3, Vec3A};

use super::projection::Projection;
use crate::math::{fibonacci, harmonics};
use crate::probe::ProbeIndex;
use crate::probe::query::{Query, QueryPoint, Visibility};
use crate::probe::store::surface::Facing;

/// In which form an engine stores irradiance.
pub enum Form {
    /// Coefficients times Y₀.
    Harmonics,
    /// Irradiance along these directions.
    Along(Vec<Vec3>),
}

/// A volume, read in a form.
pub struct Reader<'v> {
    query: Query<'v>,
    form: Form,
    /// Where look-ups are made.
    directions: Vec<Vec3>,
    of_look_ups: Projection,
    of_axes: Projection,
}

/// Directions of look-ups from which coefficients are made: five times as many as coefficients.
const DIRECTIONS: usize = 48;

/// The axes in the order of an ambient cube's faces.
pub const AXES: [Vec3; 6] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];

impl<'v> Reader<'v> {
    pub fn new(query: Query<'v>, form: Form) -> Reader<'v> {
        let evenly: Vec<(Vec3, f32)> = (0..DIRECTIONS).map(|i| (fibonacci::direction(i, DIRECTIONS), 1.0)).collect();
        let directions = match &form {
            Form::Harmonics => evenly.iter().map(|(direction, _)| *direction).collect(),
            Form::Along(directions) => directions.clone(),
        };
        let of_axes = Projection::of(&query.volume.irradiance.axes());
        Reader { query, form, directions, of_look_ups: Projection::of(&evenly), of_axes }
    }

    /// The method's own look-up.
    pub fn look_up(&self) -> &Query<'v> {
        &self.query
    }

    /// Values of a probe.
    pub fn unknowns(&self) -> usize {
        match &self.form {
            Form::Harmonics => harmonics::COUNT,
            Form::Along(directions) => directions.len(),
        }
    }

    /// What an active probe holds.
    pub fn of_probe(&self, probe: usize) -> Vec<Vec3A> {
        let irradiance = &self.query.volume.irradiance;
        match &self.form {
            Form::Along(directions) => directions.iter().map(|d| irradiance.of(probe, *d).into()).collect(),
            Form::Harmonics => match irradiance.harmonics() {
                Some(sh) => sh.probe(probe).collect(),
                None => self.of_axes.coefficients(irradiance.probe(probe).map(Vec3A::from)),
            },
        }
    }

    /// The mean of what the method's own look-up gives at some places, each with a weight and with what is known there of
    /// visibility; `None` where none of them finds a probe.
    pub fn of_places(&self, places: &[(Vec3, f32, Visibility)]) -> Option<Vec<Vec3A>> {
        let mut found = true;
        let along: Vec<Vec3A> = self
            .directions
            .iter()
            .map(|&normal| {
                let (mut sum, mut total) = (Vec3A::ZERO, 0.0);
                for &(position, weight, visibility) in places {
                    let facing = Facing::of(normal);
                    let point = QueryPoint { position, normal, geometric: normal, facing, view: normal };
                    if weight > 0.0 && self.query.weights(&point, visibility).total() > 0.0 {
                        sum += Vec3A::from(self.query.irradiance(&point, visibility)) * weight;
                        total += weight;
                    }
                }
                found &= total > 0.0;
                sum / total.max(f32::MIN_POSITIVE)
            })
            .collect();
        found.then(|| match &self.form {
            Form::Harmonics => self.of_look_ups.coefficients(along.into_iter()),
            Form::Along(_) => along,
        })
    }

    /// The volume's probe at a point of its lattice, where it is active, and how far it has moved from there, metres.
    pub fn at(&self, coordinate: glam::UVec3) -> Option<(usize, Vec3)> {
        let volume = self.query.volume;
        let uniform = volume.grid.uniform();
        let divisions = uniform.divisions();
        let point = coordinate.x + divisions.x * (coordinate.y + divisions.y * coordinate.z);
        let probe = volume.grid.tree().map_or(point, |tree| tree.probe(coordinate));
        let moved = match volume.grid.width(ProbeIndex(probe)) {
            1 => volume.positions[probe as usize] - uniform.grid_point(ProbeIndex(point)),
            // The probe of a larger cell stands for many points.
            _ => Vec3::ZERO,
        };
        volume.is_active(ProbeIndex(probe)).then_some((probe as usize, moved))
    }
}

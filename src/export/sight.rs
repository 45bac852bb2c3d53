//! Which probes a place sees, by rays.

use glam::Vec3;

use crate::light::World;
use crate::light::contact::Contacts;
use crate::probe::query::{Answers, Query, QueryPoint, Visibility};
use crate::probe::store::surface::Facing;
use crate::probe::{ProbeIndex, Volume};
use crate::trace::Ray;

pub struct Sight<'a, 's> {
    pub world: &'a World<'s>,
    volume: &'a Volume,
    contacts: Contacts,
}

impl<'a, 's> Sight<'a, 's> {
    pub fn new(world: &'a World<'s>, volume: &'a Volume) -> Sight<'a, 's> {
        Sight { world, volume, contacts: Contacts::of_points(world.scene, &volume.positions) }
    }

    /// Where rays from a probe start: beside the surfaces that it touches.
    pub fn viewpoint(&self, probe: usize) -> Vec3 {
        self.contacts.viewpoint(probe, self.volume.positions[probe])
    }

    /// Whether nothing stands between two probes.
    pub fn is_free(&self, a: usize, b: usize) -> bool {
        !self.world.tracer.occluded(Ray::segment(self.viewpoint(a), self.viewpoint(b), 0))
    }

    /// The probes around a place that it sees, as a look-up wants to know it.
    pub fn around(&self, look_up: &Query, position: Vec3) -> Visibility {
        let normal = Vec3::Y;
        let point = QueryPoint { position, normal, geometric: normal, facing: Facing::of(normal), view: normal };
        let sees = |(i, probe): (usize, ProbeIndex)| {
            let contact = self.contacts.of(probe.0 as usize);
            let target = contact.map_or(self.volume.position(probe), |contact| contact.target(position));
            self.volume.is_active(probe) && !self.world.tracer.occluded(Ray::segment(position, target, i as u32))
        };
        let corners = Answers::corners(look_up, &point).into_iter().enumerate();
        Visibility::Exact(corners.fold(0, |mask, (i, probe)| mask | u8::from(sees((i, probe))) << i))
    }
}

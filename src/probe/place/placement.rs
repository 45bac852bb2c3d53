//! What placement is asked for, and what it gives.

use glam::Vec3;

use super::settings::PlacementSettings;
use crate::light::contact::Contacts;
use crate::probe::lattice::{Grid, ProbeState};
use crate::probe::store::OcclusionStore;
use crate::probe::store::regions::Regions;
use crate::probe::store::surface::SurfaceVisibility;
use crate::scene::Scene;

/// The probes before they are captured.
#[derive(Debug, Clone)]
pub struct Placement {
    pub states: Vec<ProbeState>,
    /// Relative to the scene's origin, metres.
    pub positions: Vec<Vec3>,
    /// The probes that lie in a surface.
    pub contacts: Contacts,
    /// Whether any surface lies in the probe's cells.
    pub sampled: Vec<bool>,
    /// Whether any surface can ask the probe: the others are baked for whom wants them, and must change nothing.
    pub asked: Vec<bool>,
    /// Probes moved from their grid points.
    pub relocated: usize,
    /// What surfaces see of their probes; `None` where the method does not ask.
    pub survey: Option<SurfaceVisibility>,
    /// The same as look-ups ask it; `None` where they do not.
    pub regions: Option<Regions>,
    pub rays: u64,
}

/// What placement looks at besides the scene.
pub struct PlacementTask<'a> {
    pub grid: &'a Grid,
    pub settings: &'a PlacementSettings,
    pub occlusion: &'a OcclusionStore,
    /// How far from a surface, in spacings, it may look probes up.
    pub reach: f32,
}

impl Placement {
    /// Puts probes elsewhere.
    pub fn move_to(&mut self, scene: &Scene, places: impl IntoIterator<Item = (usize, Vec3)>) {
        for (probe, position) in places {
            self.positions[probe] = position;
        }
        self.contacts = Contacts::of_points(scene, &self.positions);
    }

    pub fn count(&self, state: ProbeState) -> usize {
        self.states.iter().filter(|&&s| s == state).count()
    }
}

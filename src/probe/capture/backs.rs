//! Rays that meet the backs of surfaces.

use serde::{Deserialize, Serialize};

/// What becomes of rays that meet the back of a surface that has none. Such hits suggest that the probe lies inside
/// something.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Backs {
    pub radiance: BackRadiance,
    /// Distances to backs count as so much of themselves: light from there is then rarely let through.
    pub distance_factor: f32,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BackRadiance {
    /// They reflect as fronts do.
    Reflect,
    /// The ray counts for nothing; where this share of a probe's rays or more meet backs, it learns no light from them.
    LeaveOut { most: f32 },
}

impl Default for Backs {
    fn default() -> Self {
        Backs { radiance: BackRadiance::Reflect, distance_factor: 1.0 }
    }
}

impl Backs {
    /// Whether rays that meet backs are left out.
    pub fn are_left_out(&self) -> bool {
        self.radiance != BackRadiance::Reflect
    }

    /// Whether a probe of whose `rays` so many met backs learns light from the others.
    pub fn allow(&self, backs: usize, rays: usize) -> bool {
        match self.radiance {
            BackRadiance::Reflect => true,
            BackRadiance::LeaveOut { most } => (backs as f32) < most * rays as f32 || backs == 0,
        }
    }

    /// Calls `rule(key, value, holds, rule)` for every number in it.
    pub fn check(&self, rule: &mut dyn FnMut(&'static str, String, bool, &'static str)) {
        let mut unit = |key: &'static str, x: f32| {
            rule(key, x.to_string(), (0.0..=1.0).contains(&x), "use a number from 0 to 1");
        };
        unit("capture.backs.distance_factor", self.distance_factor);
        if let BackRadiance::LeaveOut { most } = self.radiance {
            unit("capture.backs.radiance.leave_out.most", most);
        }
    }
}

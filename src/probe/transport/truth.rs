//! The truth at the probes: the irradiance of a volume's probes by full paths, in a few independent runs whose spread
//! tells how well it is known.
//!
//! It holds no leaks and no interpolated bounces. Against it a bake's own bias shows, apart from what interpolation
//! between probes adds in a picture.

use glam::Vec3A;
use rayon::prelude::*;

use crate::light::World;
use crate::light::contact::Contacts;
use crate::math::random::Purpose;
use crate::probe::Volume;
use crate::probe::capture::{Capture, CaptureSettings, HitLight};
use crate::probe::lattice::ProbeState;
use crate::system::progress::Progress;

/// Independent runs. Standard errors from eight are known to a quarter (1/√14).
pub const RUNS: u64 = 8;

/// Keeps the runs' random numbers apart from the bake's own, and from each other.
const SEED_STEP: u64 = 0x5851_F42D_4C95_7F2D;

/// A volume's probes lit by full paths.
pub struct Truth {
    /// Of every run, of every probe: its unknowns, W·m⁻²; empty for probes that are not active.
    pub runs: Vec<Vec<Vec<Vec3A>>>,
    /// The mean of the runs, with all else of the volume that it is the truth of.
    pub volume: Volume,
}

impl Truth {
    /// Traces `paths` paths in every run from each of the capture's hits; rays and emitters are those of `settings`.
    pub fn trace(
        world: &World,
        settings: &CaptureSettings,
        volume: &Volume,
        paths: u32,
        seed: u64,
        progress: Progress,
    ) -> Truth {
        let resampling = settings.rays.resampling();
        let kernel = volume.irradiance.kernel(&settings.rays.directions());
        let lobes = volume.irradiance.lobes();
        let contacts = Contacts::of_points(world.scene, &volume.positions);
        let expected = world.expect_around(&volume.active().map(|p| volume.positions[p]).collect::<Vec<_>>());
        let bar = progress.stage("path-traced probes", RUNS as usize * volume.active_count());
        let run = |run: u64| -> Vec<Vec<Vec3A>> {
            let capture = Capture {
                world,
                settings,
                distance_clamp_m: None,
                hit_light: HitLight::Paths(paths),
                expected: Some(&expected),
                voxels: None,
                keeps_geometric: false,
                sees: false,
                shows: false,
                resampling: resampling.as_ref(),
                guide: None,
                counts: None,
                purpose: Purpose::Capture,
                seed: seed.wrapping_add((run + 1).wrapping_mul(SEED_STEP)),
            };
            let probe = |p: usize| -> Vec<Vec3A> {
                if volume.states[p] != ProbeState::Active {
                    return Vec::new();
                }
                let traced = capture.probe(p, contacts.viewpoint(p, volume.positions[p]), |_| true);
                bar.inc(1);
                let mut radiance = traced.emitted_radiance();
                traced.surfels.iter().for_each(|s| radiance[s.texel as usize] += Vec3A::from(s.direct_radiance));
                let mut irradiance = vec![Vec3A::ZERO; kernel.rows()];
                kernel.irradiance(&radiance, &mut irradiance);
                let sampled = lobes.of_samples(&traced.emitter_samples);
                irradiance.iter_mut().zip(sampled).for_each(|(value, sampled)| *value += sampled);
                irradiance
            };
            (0..volume.states.len()).into_par_iter().map(probe).collect()
        };
        let runs: Vec<Vec<Vec<Vec3A>>> = (0..RUNS).map(run).collect();
        bar.finish_and_clear();
        let mut volume = volume.clone();
        volume.irradiance.set_each(|p, _| {
            let unknowns = runs[0][p].len();
            let mean = |o: usize| runs.iter().map(|run| run[p][o]).sum::<Vec3A>() / RUNS as f32;
            (unknowns > 0).then(|| ((0..unknowns).map(mean).collect(), ()))
        });
        Truth { runs, volume }
    }
}

//! Russian roulette: how likely a path is followed further.

use glam::Vec3;

use super::expected::Light;
use crate::math::color::luminance;

/// Russian roulette starts at this bounce; where nothing is known of the light, at [`BLIND_ROULETTE_FROM`]. Earlier bounces
/// carry most of the light, so ending paths there does not pay.
const ROULETTE_FROM: u32 = 2;
const BLIND_ROULETTE_FROM: u32 = 3;

/// A path survives for certain if it is expected to bring this share of what its start receives.
///
/// Rays × variance of `reference`, measured with a power of 0.35 for [`most_survival`], against roulette by throughput alone (in brackets with
/// [`most_survival`] 1 and 0.25 here; with its square root): office 0.62 (0.76, 0.66), rooms apart 0.72 (0.81, 0.89),
/// veach_ajar 0.88 (0.81, 0.90), bathroom 0.89 (0.89, 0.91), two_rooms_open 0.90 (1.04, 0.93), courtyard 0.96 (1.05, 0.94).
const CERTAIN: f32 = 0.15;

/// What is expected everywhere besides what places know, as a share of what the start receives: they know it roughly.
const UNEXPECTED: f32 = 0.2;

/// Share of a place's direct light that counts as expected: rays towards emitters find most of it.
const DIRECT_BY_PATH: f32 = 0.25;

/// Largest probability with which a path of this throughput survives: its power of 3/8.
fn most_survival(throughput: f32) -> f32 {
    let root = throughput.sqrt().sqrt();
    root * root.sqrt()
}

/// Least probability with which a path survives, unless its throughput is smaller still.
const LEAST_SURVIVAL: f32 = 0.3;

/// Probability with which a path of this throughput goes on from a vertex: by the light that it is expected to bring, `here`
/// being what the vertex's place expects, against the light that its start is expected to receive (Vorba & Křivánek,
/// *Adjoint-driven Russian roulette and splitting*, 2016). Where that is unknown, by throughput alone: throughputs stay
/// similar then, even if albedos are close to 1.
#[inline]
pub fn survival(here: Option<Light>, start: Option<Light>, throughput: Vec3, bounce: u32) -> f32 {
    let most = throughput.max_element();
    match (here, start) {
        _ if bounce < ROULETTE_FROM => 1.0,
        (Some(here), Some(start)) if start.sum() > 0.0 => {
            let share = (here.indirect + DIRECT_BY_PATH * here.direct) / start.sum() + UNEXPECTED;
            let brings = luminance(throughput) * share;
            (brings / CERTAIN).min(most_survival(most)).max(most.min(LEAST_SURVIVAL)).min(1.0)
        }
        _ if bounce >= BLIND_ROULETTE_FROM => most.min(1.0),
        _ => 1.0,
    }
}

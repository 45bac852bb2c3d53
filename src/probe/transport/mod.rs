//! Light on its way between the captured surfaces and the probes.

pub mod anderson;
pub mod checkpoint;
mod frames;
mod in_order;
pub mod operator;
pub mod rows;
mod settings;
pub mod solver;
mod steps;
#[cfg(test)]
mod tests;
mod tracing;
pub mod truth;

use self::operator::{Captures, Operator};
pub use self::settings::{
    Acceleration, BounceSettings, FrameSettings, InOrderSettings, TracingFilter, TracingSettings, Transport,
};
use self::solver::{Progress, Solution};
use super::Volume;

/// Fills the volume's irradiance with the light that `transport` brings. The volume's positions, states and occlusion must
/// stand already; after an interruption its irradiance too, as it was when `progress` was reported.
pub fn run<C: Captures>(
    transport: &Transport,
    operator: &Operator<C>,
    volume: &mut Volume,
    progress: Progress,
    on_iteration: impl FnMut(&Progress, &Volume),
) -> Solution {
    match transport {
        Transport::Bounces(settings) => solver::solve(operator, settings, volume, progress, on_iteration),
        Transport::InOrder(settings) => in_order::solve(operator, settings, volume, progress, on_iteration),
        Transport::Paths { .. } => {
            let solution = solver::solve(operator, &transport.iteration(), volume, progress, on_iteration);
            Solution { converged: true, ..solution }
        }
        Transport::Frames(settings) => frames::solve(operator, settings, volume, progress, on_iteration),
        Transport::Tracing(settings) => tracing::solve(operator, settings, volume, progress, on_iteration),
    }
}

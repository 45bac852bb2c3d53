//! Light on its way between the captured surfaces and the probes.

pub mod anderson;
pub mod checkpoint;
mod in_order;
pub mod operator;
mod settings;
pub mod solver;
#[cfg(test)]
mod tests;
pub mod truth;

use self::operator::{Captures, Operator};
pub use self::settings::{Acceleration, BounceSettings, InOrderSettings, Transport};
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
    let solution = match transport {
        Transport::InOrder(settings) => in_order::solve(operator, settings, volume, progress, on_iteration),
        _ => solver::solve(operator, &transport.iteration(), volume, progress, on_iteration),
    };
    Solution { converged: solution.converged || transport.is_complete(), ..solution }
}

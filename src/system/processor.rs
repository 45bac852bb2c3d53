//! Time of the processor: unlike that of the clock, other programs do not lengthen it.

use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeValLike;

/// Seconds that all threads of this process have run, together. 0 where the system does not tell.
pub fn processor_seconds() -> f64 {
    let microseconds = getrusage(UsageWho::RUSAGE_SELF)
        .map_or(0, |usage| usage.user_time().num_microseconds() + usage.system_time().num_microseconds());
    microseconds as f64 * 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_takes_time() {
        let before = processor_seconds();
        let mut x = 1u64;
        while processor_seconds() - before < 0.01 {
            x = std::hint::black_box(x.wrapping_mul(3));
        }
        assert!(x != 0 && before >= 0.0);
    }
}

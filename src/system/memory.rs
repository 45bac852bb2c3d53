//! How much memory is available. A run that needs more is refused at its start; otherwise the system would kill it
//! later.

use std::fs;
use std::path::Path;

use super::format;

/// A run needs more memory than is available.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {what} would need about {} of memory, and {} are available; {remedy}", format::bytes(*needed), format::bytes(*available))]
pub struct TooLittleMemory {
    /// The flag or configuration key that causes most of the need.
    pub key: String,
    /// What needs the memory, for example "the pictures".
    pub what: &'static str,
    /// Bytes.
    pub needed: u64,
    /// Bytes.
    pub available: u64,
    pub remedy: &'static str,
}

/// Bytes that this process can still allocate. Three limits count, and the smallest decides: free memory of the
/// machine, the limits of the process's control groups, and its limit of address space. `None` if the system reports
/// none of them.
pub fn available_bytes() -> Option<u64> {
    [machine(), control_groups(), address_space()].into_iter().flatten().min()
}

/// Refuses a run that needs more memory than is available. `refusal` makes the error from the available bytes.
///
/// # Errors
/// [`TooLittleMemory`] if the system reports the available bytes and they are fewer than `needed`.
pub fn check_available(needed: u64, refusal: impl FnOnce(u64) -> TooLittleMemory) -> Result<(), TooLittleMemory> {
    match available_bytes() {
        Some(available) if needed > available => Err(refusal(available)),
        _ => Ok(()),
    }
}

/// Resident memory of this process now, bytes.
pub fn resident_bytes() -> u64 {
    field("/proc/self/status", "VmRSS:").unwrap_or(0)
}

/// Largest resident memory of this process so far, bytes. Not the figure of `getrusage`: that begins with the memory of
/// the program that started this one.
pub fn peak_memory_bytes() -> u64 {
    field("/proc/self/status", "VmHWM:").unwrap_or(0)
}

fn machine() -> Option<u64> {
    field("/proc/meminfo", "MemAvailable:")
}

/// Bytes left below the soft limit of address space.
fn address_space() -> Option<u64> {
    let (soft, _) = nix::sys::resource::getrlimit(nix::sys::resource::Resource::RLIMIT_AS).ok()?;
    (soft != nix::libc::RLIM_INFINITY).then(|| soft.saturating_sub(field("/proc/self/status", "VmSize:").unwrap_or(0)))
}

/// Bytes of a line such as `MemAvailable:   1024 kB`.
fn field(path: &str, name: &str) -> Option<u64> {
    let text = fs::read_to_string(path).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// Bytes left below the limits of the process's control groups, of versions 1 and 2.
fn control_groups() -> Option<u64> {
    let text = fs::read_to_string("/proc/self/cgroup").ok()?;
    let lines = text.lines().filter_map(|line| {
        let mut fields = line.splitn(3, ':');
        let (_, controllers, group) = (fields.next()?, fields.next()?, fields.next()?);
        let group = group.trim_start_matches('/');
        match controllers {
            "" => group_limit("/sys/fs/cgroup", group, ["memory.max", "memory.current"]),
            _ if controllers.split(',').any(|c| c == "memory") => {
                group_limit("/sys/fs/cgroup/memory", group, ["memory.limit_in_bytes", "memory.usage_in_bytes"])
            }
            _ => None,
        }
    });
    lines.min()
}

/// The smallest number of bytes that a group and its ancestors leave. The limit "max" means unlimited.
fn group_limit(root: &str, group: &str, [limit, usage]: [&str; 2]) -> Option<u64> {
    let number = |path: &Path| -> Option<u64> { fs::read_to_string(path).ok()?.trim().parse().ok() };
    let left = |group: &Path| {
        let folder = Path::new(root).join(group);
        let limit = number(&folder.join(limit))?;
        // The group counts cached files as used, but the kernel drops them when memory is needed.
        let text = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
        let cached = text.lines().find_map(|line| {
            line.strip_prefix("inactive_file ")
                .or(line.strip_prefix("total_inactive_file "))
                .and_then(|n| n.parse().ok())
        });
        let used = number(&folder.join(usage)).unwrap_or(0).saturating_sub(cached.unwrap_or(0));
        Some(limit.saturating_sub(used))
    };
    Path::new(group).ancestors().filter_map(left).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machine_says_what_it_has() {
        // Any machine that runs these tests has more than a megabyte left, and less than an exabyte.
        assert!(available_bytes().is_none_or(|bytes| (1 << 20..1 << 60).contains(&bytes)));
        assert!((1 << 20..1 << 50).contains(&resident_bytes()));
    }
}

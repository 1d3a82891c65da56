//! How much memory there is: systems promise more than they have, and end the program that believes
//! them.

use crate::error::{Error, Result};

/// Bytes that are always taken without a question.
const SMALL: u64 = 16 << 20;

/// Checks that `bytes` can be had before they are asked for. `what` names them, `advice` says what
/// to do where there are fewer.
///
/// # Errors
/// When the system tells that it has less.
pub(crate) fn check(bytes: u64, what: &str, advice: &str) -> Result<()> {
    if bytes < SMALL {
        return Ok(());
    }
    match available() {
        Some(free) if bytes > free => Err(too_much(bytes, Some(free), what, advice)),
        _ => Ok(()),
    }
}

/// The error of memory that there is not.
pub(crate) fn too_much(bytes: u64, free: Option<u64>, what: &str, advice: &str) -> Error {
    let mebibytes = |bytes: u64| bytes.div_ceil(1 << 20);
    let free = free.map(|free| format!(", and {} MiB are free", mebibytes(free)));
    Error::numeric(format!(
        "there is no memory for {} MiB of {what}{}; {advice}",
        mebibytes(bytes),
        free.unwrap_or_default()
    ))
}

/// Bytes that this program can still get, where the system tells.
#[cfg(target_os = "linux")]
pub(crate) fn available() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let machine = free_of_machine(&read("/proc/meminfo")?)?;
    // Of a container; a machine has no limit here.
    let number = |path: &str| read(path)?.trim().parse::<u64>().ok();
    let group = number("/sys/fs/cgroup/memory.max")
        .zip(number("/sys/fs/cgroup/memory.current"))
        .map(|(most, taken)| most.saturating_sub(taken));
    Some(group.map_or(machine, |group| group.min(machine)))
}

/// What can still be added to this instance's memory.
#[cfg(target_arch = "wasm32")]
pub(crate) fn available() -> Option<u64> {
    const PAGE: u64 = 1 << 16;
    const PAGES: u64 = 1 << 16;
    Some((PAGES - core::arch::wasm32::memory_size(0) as u64) * PAGE)
}

#[cfg(not(any(target_os = "linux", target_arch = "wasm32")))]
pub(crate) fn available() -> Option<u64> {
    None
}

/// What Linux could free, and what it could move out of memory.
#[cfg(target_os = "linux")]
fn free_of_machine(meminfo: &str) -> Option<u64> {
    let field = |name: &str| {
        let line = meminfo.lines().find_map(|line| line.strip_prefix(name))?;
        let kibibytes: u64 = line
            .trim_start_matches(':')
            .split_whitespace()
            .next()?
            .parse()
            .ok()?;
        Some(kibibytes << 10)
    };
    Some(field("MemAvailable")? + field("SwapFree").unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_refused() {
        let error = check(u64::MAX, "weights", "use fewer");
        if available().is_some() {
            let error = error.expect_err("no memory").to_string();
            assert!(
                error.starts_with("there is no memory for 17592186044416 MiB of weights, and ")
            );
            assert!(error.ends_with(" MiB are free; use fewer"), "{error}");
        }
        assert!(check(SMALL - 1, "weights", "use fewer").is_ok());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn free_memory_is_what_linux_could_free() {
        let meminfo = "MemTotal: 16000000 kB\nMemFree: 1000 kB\nMemAvailable:    3000 kB\nSwapFree:  500 kB\n";
        assert_eq!(free_of_machine(meminfo), Some(3500 << 10));
        assert_eq!(free_of_machine("MemTotal: 16000000 kB\n"), None);
    }
}

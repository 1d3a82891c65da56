//! How much memory there is: systems promise more than they have, and end the program that believes
//! them.

#[cfg(any(feature = "cli", all(feature = "web-part", target_arch = "wasm32")))]
use std::alloc::{GlobalAlloc, Layout, System};
#[cfg(any(feature = "cli", feature = "engine", feature = "web-part"))]
use std::sync::atomic::{AtomicUsize, Ordering};

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

/// Threads that ask for memory and know what to do without.
#[cfg(any(feature = "cli", feature = "engine", feature = "web-part"))]
static TRYING: AtomicUsize = AtomicUsize::new(0);

/// Calls what asks for memory and knows what to do without, such as `try_reserve`.
#[cfg(feature = "engine")]
pub(crate) fn trying<T>(ask: impl FnOnce() -> T) -> T {
    TRYING.fetch_add(1, Ordering::Relaxed);
    let answer = ask();
    TRYING.fetch_sub(1, Ordering::Relaxed);
    answer
}

/// The system's memory, whose end is told in words like any other error: by the terminal, which
/// exits, and by the page as an exception. What can be large is checked before it is asked for; this
/// is for all the rest.
#[cfg(any(feature = "cli", all(feature = "web-part", target_arch = "wasm32")))]
#[derive(Debug)]
pub struct Memory;

#[cfg(any(feature = "cli", all(feature = "web-part", target_arch = "wasm32")))]
fn had(pointer: *mut u8) -> *mut u8 {
    if pointer.is_null() && TRYING.load(Ordering::Relaxed) == 0 {
        end("there is no memory for more; close other programs, or use a smaller input");
    }
    pointer
}

/// Ends the program without asking for memory.
#[cfg(all(feature = "cli", not(target_arch = "wasm32")))]
fn end(why: &str) -> ! {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr(), "tracklens: {why}");
    // As `cli::main` does for numbers that allow no answer.
    std::process::exit(5)
}

#[cfg(all(feature = "web-part", target_arch = "wasm32"))]
fn end(why: &str) -> ! {
    wasm_bindgen::throw_str(why)
}

// SAFETY: every call goes to the system's allocator as it is.
#[cfg(any(feature = "cli", all(feature = "web-part", target_arch = "wasm32")))]
unsafe impl GlobalAlloc for Memory {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are those of the system's allocator.
        had(unsafe { System.alloc(layout) })
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        had(unsafe { System.alloc_zeroed(layout) })
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above.
        had(unsafe { System.realloc(pointer, layout, size) })
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
    // Of this program, as `ulimit -v` sets it.
    let own = read("/proc/self/limits")
        .zip(read("/proc/self/status"))
        .and_then(|(limits, status)| free_of_limit(&limits, &status));
    let machine = own.map_or(machine, |own| own.min(machine));
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

/// What the limit on the address space leaves, where there is one.
#[cfg(target_os = "linux")]
fn free_of_limit(limits: &str, status: &str) -> Option<u64> {
    let limit = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max address space"))?;
    // `unlimited` is no number.
    let limit: u64 = limit.split_whitespace().next()?.parse().ok()?;
    Some(limit.saturating_sub(kibibytes(status, "VmSize")? << 10))
}

/// The number in a line `name: number kB`.
#[cfg(target_os = "linux")]
fn kibibytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let number = line.trim_start_matches(':').split_whitespace().next()?;
    number.parse().ok()
}

/// What Linux could free, and what it could move out of memory.
#[cfg(target_os = "linux")]
fn free_of_machine(meminfo: &str) -> Option<u64> {
    let field = |name: &str| Some(kibibytes(meminfo, name)? << 10);
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
    fn a_limit_on_the_program_counts() {
        let limits = "Limit  Soft Limit  Hard Limit  Units\nMax address space         1048576              unlimited            bytes\n";
        assert_eq!(
            free_of_limit(limits, "VmPeak: 900 kB\nVmSize: 24 kB\n"),
            Some(1000 << 10)
        );
        let none = "Max address space         unlimited            unlimited            bytes\n";
        assert_eq!(free_of_limit(none, "VmSize: 24 kB\n"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn free_memory_is_what_linux_could_free() {
        let meminfo = "MemTotal: 16000000 kB\nMemFree: 1000 kB\nMemAvailable:    3000 kB\nSwapFree:  500 kB\n";
        assert_eq!(free_of_machine(meminfo), Some(3500 << 10));
        assert_eq!(free_of_machine("MemTotal: 16000000 kB\n"), None);
    }
}

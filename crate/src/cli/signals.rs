//! Signals that ask a process to end: Ctrl-C, SIGTERM and SIGHUP.

use std::process::Child;

use crate::error::{Error, ErrorKind, Result};

/// Calls `then` at each of them, instead of ending at once. A SIGHUP that is ignored, as under
/// `nohup`, stays so.
pub(super) fn on_end(then: impl FnMut() + Send + 'static) -> Result<()> {
    let failed = |e: &dyn std::fmt::Display| {
        Error::new(
            ErrorKind::Io,
            format!("Ctrl-C and signals cannot be handled: {e}"),
        )
    };
    #[cfg(unix)]
    let hangup = ignore_hangup().map_err(|e| failed(&e))?;
    ctrlc::set_handler(then).map_err(|e| failed(&e))?;
    #[cfg(unix)]
    if let nix::sys::signal::SigHandler::SigIgn = hangup {
        ignore_hangup().map_err(|e| failed(&e))?;
    }
    Ok(())
}

/// Ignores SIGHUP and returns how it was handled before.
#[cfg(unix)]
fn ignore_hangup() -> nix::Result<nix::sys::signal::SigHandler> {
    use nix::sys::signal::{SigHandler, Signal, signal};
    // SAFETY: to ignore a signal installs no code that could run in its handler.
    unsafe { signal(Signal::SIGHUP, SigHandler::SigIgn) }
}

/// Asks a process that this one started to end, as SIGTERM does. One that has ended already is
/// left alone.
#[cfg(unix)]
pub(super) fn end(process: &Child) {
    use nix::sys::signal::{Signal, kill};
    if let Ok(id) = i32::try_from(process.id()) {
        // A child keeps its number until it is waited for, so nobody else is hit.
        let _ = kill(nix::unistd::Pid::from_raw(id), Signal::SIGTERM);
    }
}

/// The console sends Ctrl-C to every process.
#[cfg(not(unix))]
pub(super) fn end(_: &Child) {}

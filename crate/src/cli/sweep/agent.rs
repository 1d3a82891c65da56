//! Agents of a sweep: the program that trains them is another one, in Python (`tools/rl`).

use std::io::{BufRead as _, BufReader};
use std::num::NonZeroUsize;
use std::process::{ChildStderr, Command, Stdio};
use std::time::Duration;

use crate::cli::extract::cancel_on_interrupt;
use crate::cli::signals;
use crate::error::{Error, ErrorKind, Result};
use crate::sweep::{AgentOptions, AgentProgram, PlannedRun};
use crate::train::RunLock;

/// How often a training is looked at.
const LOOK: Duration = Duration::from_millis(100);
/// Its exit code when it was asked to end.
const CANCELLED: i32 = 130;

/// Asks the program what it can do.
pub(super) fn options(program: &AgentProgram) -> Result<AgentOptions> {
    let AgentProgram { python, script } = program;
    if !script.is_file() {
        return Err(
            Error::new(ErrorKind::Io, "is not there; expected train_rl.py").at(script.display()),
        );
    }
    let mut asked = Command::new(python);
    asked.arg(script).arg("--options").stdin(Stdio::null());
    let done = asked.output().map_err(|e| cannot_start(python, &e))?;
    let told = |what: &str| Error::input(format!("{} {what}", script.display()));
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        let said = said.trim().lines().last().unwrap_or_default();
        return Err(told(&format!("cannot be asked for its options: {said}")));
    }
    serde_json::from_slice(&done.stdout).map_err(|e| {
        told(&format!(
            "does not say its options ({e}); expected train_rl.py"
        ))
    })
}

/// Steps that an agent is to have.
pub(super) fn steps(run: &PlannedRun) -> Result<u64> {
    let given = run
        .arguments
        .iter()
        .find_map(|a| a.strip_prefix("--steps="));
    let steps = given.and_then(|steps| steps.replace('_', "").parse().ok());
    steps.ok_or_else(|| {
        Error::input(
            "its arguments have no `--steps=N`; write the plan anew with `tracklens sweep plan`",
        )
        .at(&run.run)
    })
}

/// Trains an agent, or goes on with it, in the folder of the lock. The training holds the lock as
/// well, so that nobody else begins while it lives.
pub(super) fn train(run: &PlannedRun, lock: &RunLock, threads: Option<NonZeroUsize>) -> Result<()> {
    let cancel = cancel_on_interrupt()?;
    let [python, script] = &run.program[..] else {
        return Err(Error::input(
            "its program is not an interpreter and a script; write the plan anew",
        ));
    };
    let mut command = Command::new(python);
    command
        .arg(script)
        .args(&run.arguments)
        .arg("--out")
        .arg(lock.folder())
        .args(["--resume", "--lock-held"])
        .args(threads.map(|threads| format!("--threads={threads}")))
        .stdin(lock.share()?)
        .stderr(Stdio::piped());
    // Ctrl-C goes to all processes of a group; the training is told once, by this one.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let mut process = command.spawn().map_err(|e| cannot_start(python, &e))?;
    let said = process.stderr.take();
    let said = std::thread::spawn(move || said.map(last_error).unwrap_or_default());
    let mut is_told = false;
    let status = loop {
        let ended = process.try_wait().map_err(|e| Error::io(python, &e))?;
        if let Some(status) = ended {
            break status;
        }
        if cancel.is_cancelled() && !is_told {
            signals::end(&process);
            is_told = true;
        }
        std::thread::sleep(LOOK);
    };
    let said = said.join().unwrap_or_default();
    if status.success() {
        return Ok(());
    }
    if status.code() == Some(CANCELLED) || is_told {
        return Err(Error::cancelled());
    }
    Err(Error::new(
        ErrorKind::Numeric,
        said.unwrap_or_else(|| format!("{script} ended with {status}")),
    ))
}

fn cannot_start(python: &str, e: &std::io::Error) -> Error {
    Error::new(
        ErrorKind::Io,
        format!(
            "the interpreter {python} cannot be started ({e}); name another one by `python` in \
             `[rl]`"
        ),
    )
}

/// Passes on what a program says and returns its last error.
fn last_error(stderr: ChildStderr) -> Option<String> {
    let mut last = None;
    for line in BufReader::new(stderr)
        .split(b'\n')
        .map_while(std::io::Result::ok)
    {
        let line = String::from_utf8_lossy(&line).into_owned();
        eprintln!("{line}");
        if let Some(error) = line.strip_prefix("error: ") {
            last = Some(error.to_owned());
        } else if last.is_none() && line.contains("Error: ") {
            last = Some(line);
        }
    }
    last
}

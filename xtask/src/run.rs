//! Running other programs, never without showing them first.

use std::env;
use std::ffi::{OsStr, OsString};
use std::process::{Command, ExitStatus, Stdio};

use anyhow::{Context, Result, bail};

/// A command without the variables by which `cargo run` describes xtask itself: build scripts
/// further down would take them for a change of their input and build again.
pub fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    for (name, _) in env::vars_os() {
        let described = name.to_string_lossy();
        if described.starts_with("CARGO_PKG_") || described.starts_with("CARGO_MANIFEST_") {
            command.env_remove(name);
        }
    }
    command
}

/// The cargo that runs xtask.
pub fn cargo() -> Command {
    command(cargo_program())
}

fn cargo_program() -> OsString {
    env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

/// Runs a command with the terminal as its input and output.
///
/// # Errors
/// The program cannot be started, or ends with anything but success.
pub fn run(command: &mut Command) -> Result<()> {
    announce(command);
    let status = command.status().with_context(|| cannot_start(command))?;
    succeeded(command, status)
}

/// Runs a command and returns what it prints on standard output; its errors go to the terminal.
///
/// # Errors
/// As [`run`], or the output is not UTF-8.
pub fn output(command: &mut Command) -> Result<String> {
    announce(command);
    let output = command
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| cannot_start(command))?;
    succeeded(command, output.status)?;
    String::from_utf8(output.stdout)
        .with_context(|| format!("{} printed something that is not UTF-8", name(command)))
}

/// Whether a command that only asks something could be run and ended with success; what it prints
/// is dropped.
pub fn succeeds(command: &mut Command) -> bool {
    announce(command);
    let silenced = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    silenced.status().is_ok_and(|status| status.success())
}

fn announce(command: &Command) {
    eprintln!("$ {}", shown(command));
}

fn cannot_start(command: &Command) -> String {
    format!("cannot start {}", name(command))
}

fn succeeded(command: &Command, status: ExitStatus) -> Result<()> {
    if !status.success() {
        bail!("{} failed: {status}", name(command));
    }
    Ok(())
}

fn name(command: &Command) -> String {
    if command.get_program() == cargo_program() {
        return "cargo".to_owned();
    }
    command.get_program().to_string_lossy().into_owned()
}

/// The command as one would type it into a shell: folder, variables, program, arguments.
fn shown(command: &Command) -> String {
    let mut words = Vec::new();
    let here = env::current_dir().ok();
    if let Some(folder) = command.get_current_dir()
        && here.as_deref() != Some(folder)
    {
        words.extend(["cd".to_owned(), quoted(folder.as_os_str()), "&&".to_owned()]);
    }
    for (variable, value) in command.get_envs() {
        if let Some(value) = value {
            words.push(format!("{}={}", variable.to_string_lossy(), quoted(value)));
        }
    }
    words.push(quoted(OsStr::new(&name(command))));
    words.extend(command.get_args().map(quoted));
    words.join(" ")
}

fn quoted(word: &OsStr) -> String {
    let word = word.to_string_lossy();
    let plain = |c: char| c.is_alphanumeric() || "-_./=:,+@%\\".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.into_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_shown_as_one_would_type_it() {
        let mut command = Command::new("node");
        command
            .args(["--test", "a b", "it's"])
            .env("KEY", "-D warnings")
            .current_dir("pkg");
        assert_eq!(
            shown(&command),
            r"cd pkg && KEY='-D warnings' node --test 'a b' 'it'\''s'"
        );
    }

    #[test]
    fn a_failing_command_is_named_in_the_error() {
        let missing = run(&mut Command::new("tracklens-no-such-program"));
        let message = missing.map_err(|error| error.to_string());
        assert_eq!(
            message,
            Err("cannot start tracklens-no-such-program".to_owned())
        );
    }
}

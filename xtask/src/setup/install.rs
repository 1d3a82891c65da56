//! Installing with the system's package manager, or saying how to.

use std::env::consts::OS;
use std::path::PathBuf;
use std::process::Command;
use std::sync::Once;

use anyhow::{Context, Result, anyhow, bail};

use crate::run;

/// Something that comes from outside cargo.
pub struct Package {
    /// What it is called in a message.
    pub what: &'static str,
    /// Its packages in Debian.
    pub apt: &'static [&'static str],
    /// The commands that install it elsewhere, each with the program that has to be there for it.
    pub elsewhere: &'static [(&'static str, &'static str)],
    /// What else there is to say, such as where to download it.
    pub otherwise: &'static str,
}

impl Package {
    /// The path of one of its programs, after an installation if it is missing.
    ///
    /// # Errors
    /// As [`Package::install`], or the packages do not have the program.
    pub fn program(&self, name: &str) -> Result<PathBuf> {
        if let Ok(path) = which::which(name) {
            return Ok(path);
        }
        self.install()?;
        which::which(name)
            .with_context(|| format!("{} is installed, but {name} is not on the path", self.what))
    }

    /// Installs the Debian packages if this process may.
    ///
    /// # Errors
    /// It may not, or this is another system: the error says what to type. Or apt-get fails.
    pub fn install(&self) -> Result<()> {
        apt_install(self.apt).map_err(|reason| {
            anyhow!(
                "{} not found and not installed ({reason:#}); {}",
                self.what,
                self.advice()
            )
        })
    }

    fn advice(&self) -> String {
        let command = if found("apt-get") {
            Some(format!("sudo apt-get install {}", self.apt.join(" ")))
        } else {
            let known = self.elsewhere.iter().find(|(program, _)| found(program));
            known.map(|(_, command)| (*command).to_owned())
        };
        match command {
            Some(command) => format!("install it with `{command}` ({})", self.otherwise),
            None => self.otherwise.to_owned(),
        }
    }
}

/// Whether a program is on the path.
pub fn found(program: &str) -> bool {
    which::which(program).is_ok()
}

/// Installs or upgrades Debian packages, after the package lists were brought up to date: old lists
/// name old versions.
///
/// # Errors
/// There is no apt-get, this process is not root's and `sudo` wants a password, or apt-get fails.
pub fn apt_install(packages: &[&str]) -> Result<()> {
    static UPDATE: Once = Once::new();

    let root = Root::obtain()?;
    UPDATE.call_once(|| {
        if let Err(error) = run::run(&mut root.apt_get(&["update"])) {
            eprintln!("warning: going on with the package lists as they are: {error:#}");
        }
    });
    run::run(
        root.apt_get(&["install", "-y", "--no-install-recommends"])
            .args(packages),
    )
}

/// How apt-get gets the rights it needs.
enum Root {
    Process,
    Sudo,
}

impl Root {
    fn obtain() -> Result<Self> {
        if OS != "linux" || !found("apt-get") {
            bail!("this system has no apt-get");
        }
        if run::output(run::command("id").arg("-u"))?.trim() == "0" {
            return Ok(Self::Process);
        }
        if found("sudo") && run::succeeds(run::command("sudo").args(["-n", "true"])) {
            return Ok(Self::Sudo);
        }
        bail!("installing packages needs root, and sudo is missing or asks for a password");
    }

    fn apt_get(&self, arguments: &[&str]) -> Command {
        let mut command = match self {
            Self::Process => run::command("env"),
            Self::Sudo => {
                let mut command = run::command("sudo");
                command.args(["-n", "env"]);
                command
            }
        };
        command
            .args(["DEBIAN_FRONTEND=noninteractive", "apt-get"])
            .args(arguments);
        command
    }
}

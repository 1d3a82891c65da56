//! Python for tests that compare with Python packages.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::run;
use crate::workspace::Workspace;

/// The interpreter of a virtual environment with exactly the packages that the file `requirements` pins. It is kept in
/// cargo's target directory and made anew when the file changes.
///
/// # Errors
/// There is no Python 3 with `venv`, or pip cannot install the packages.
pub fn venv(workspace: &Workspace, requirements: &Path) -> Result<PathBuf> {
    let wanted = fs::read_to_string(requirements)
        .with_context(|| format!("cannot read {}", requirements.display()))?;
    let name = requirements
        .parent()
        .and_then(Path::file_name)
        .context("requirements lie in no folder")?;
    let folder = workspace.tools().join("python").join(name);
    let python = folder.join(if cfg!(windows) {
        "Scripts/python.exe"
    } else {
        "bin/python"
    });
    // Written last, so that it tells of a complete environment.
    let stamp = folder.join("requirements.txt");
    if python.exists() && fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    let mut make = run::command(interpreter()?);
    run::run(make.args(["-m", "venv", "--clear"]).arg(&folder))?;
    let mut install = run::command(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    run::run(install.arg("--requirement").arg(requirements))?;
    fs::write(&stamp, wanted).with_context(|| format!("cannot write {}", stamp.display()))?;
    Ok(python)
}

fn interpreter() -> Result<&'static str> {
    match ["python3", "python"].into_iter().find(|name| {
        run::succeeds(run::command(name).args(["-c", "import sys, venv; assert sys.version_info >= (3, 11)"]))
    }) {
        Some(name) => Ok(name),
        None => bail!(
            "there is no Python 3.11 or later with `venv`; install it (Debian: `apt-get install python3-venv`)"
        ),
    }
}

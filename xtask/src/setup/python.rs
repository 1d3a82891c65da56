//! Python, and virtual environments with pinned packages.

use std::env::consts::OS;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use super::install::{Package, found};
use crate::run;
use crate::workspace::Workspace;

const PYTHON: Package = Package {
    what: "Python 3.11 or later with its venv module",
    apt: &["python3", "python3-venv"],
    elsewhere: &[
        ("brew", "brew install python@3.11"),
        ("winget", "winget install Python.Python.3.11"),
        ("dnf", "sudo dnf install python3.11"),
        ("pacman", "sudo pacman -S python"),
        ("zypper", "sudo zypper install python311"),
    ],
    otherwise: "Python is at https://www.python.org",
};

/// The programs to try. The first one comes first, as PyBullet has ready wheels for it and is
/// compiled by the others.
const NAMES: [&str; 3] = ["python3.11", "python3", "python"];

/// Ends with success where a virtual environment can be made.
const USABLE: &str = "import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))";

/// The Python of a virtual environment with the pinned packages, made if it is not there or has
/// others.
///
/// # Errors
/// Python is missing and cannot be installed, or pip cannot install the packages; says what to do.
pub fn python(workspace: &Workspace, name: &str, requirements: &Path) -> Result<PathBuf> {
    let pinned = fs::read_to_string(requirements)
        .with_context(|| format!("cannot read {}", requirements.display()))?;
    let folder = folder(workspace, name);
    let python = interpreter(&folder);
    let installed = folder.join("installed.txt");
    if fs::read_to_string(&installed).is_ok_and(|last| last == pinned)
        && run::succeeds(run::command(&python).arg("--version"))
    {
        return Ok(python);
    }
    fresh_python(workspace, name)?;
    pip_install(&python, [Path::new("--requirement"), requirements]).with_context(|| {
        format!(
            "the packages of {} are not installed; pip needs its package index",
            requirements.display()
        )
    })?;
    fs::write(&installed, pinned)
        .with_context(|| format!("cannot write {}", installed.display()))?;
    Ok(python)
}

/// The Python of a virtual environment that was just made, with nothing in it.
///
/// # Errors
/// Python is missing and cannot be installed.
pub fn fresh_python(workspace: &Workspace, name: &str) -> Result<PathBuf> {
    let folder = folder(workspace, name);
    run::run(
        run::command(system()?)
            .args(["-m", "venv", "--clear"])
            .arg(&folder),
    )
    .context("no virtual environment")?;
    Ok(interpreter(&folder))
}

/// Has pip install into an environment.
///
/// # Errors
/// As pip.
pub fn pip_install<A: AsRef<OsStr>>(
    python: &Path,
    arguments: impl IntoIterator<Item = A>,
) -> Result<()> {
    let mut pip = run::command(python);
    pip.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
    ]);
    run::run(pip.args(arguments))
}

/// maturin, which builds the wheel of the Python package.
///
/// # Errors
/// As [`python`].
pub fn maturin(workspace: &Workspace) -> Result<PathBuf> {
    let requirements = workspace.python().join("requirements.txt");
    let python = python(workspace, "maturin", &requirements)?;
    Ok(python.with_file_name(format!("maturin{}", std::env::consts::EXE_SUFFIX)))
}

fn folder(workspace: &Workspace, name: &str) -> PathBuf {
    workspace.tools().join("venv").join(name)
}

fn interpreter(folder: &Path) -> PathBuf {
    folder.join(match OS {
        "windows" => "Scripts/python.exe",
        _ => "bin/python",
    })
}

/// A Python that can make virtual environments.
fn system() -> Result<&'static str> {
    if let Some(name) = usable() {
        return Ok(name);
    }
    PYTHON.install()?;
    usable().with_context(|| format!("{} is installed, but not on the path", PYTHON.what))
}

fn usable() -> Option<&'static str> {
    let works = |name: &&str| found(name) && run::succeeds(run::command(name).args(["-c", USABLE]));
    NAMES.into_iter().find(works)
}

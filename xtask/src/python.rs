//! `cargo xtask python`: the wheel of the Python package, and the tests of an installed one.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::workspace::Workspace;
use crate::{run, setup};

/// Builds the wheel and returns its path.
///
/// # Errors
/// Python or maturin is missing and cannot be installed, or the package does not build.
pub fn wheel(workspace: &Workspace) -> Result<PathBuf> {
    let maturin = setup::maturin(workspace)?;
    let folder = workspace.target().join("wheels");
    for old in wheels(&folder)? {
        fs::remove_file(&old).with_context(|| format!("cannot remove {}", old.display()))?;
    }
    let mut build = run::command(maturin);
    build
        .args(["build", "--release", "--locked", "--manifest-path"])
        .arg(workspace.python().join("Cargo.toml"))
        .arg("--out")
        .arg(&folder);
    run::run(build.current_dir(workspace.root()))?;
    let Some(wheel) = wheels(&folder)?.pop() else {
        bail!("maturin wrote no wheel into {}", folder.display());
    };
    let bytes = fs::metadata(&wheel)?.len();
    eprintln!("{}: {:.1} MB", wheel.display(), bytes as f64 / 1e6);
    Ok(wheel)
}

fn wheels(folder: &Path) -> Result<Vec<PathBuf>> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Ok(Vec::new());
    };
    let paths = entries.map(|entry| Ok(entry?.path()));
    let paths = paths.collect::<Result<Vec<PathBuf>>>()?;
    let is_wheel = |path: &PathBuf| path.extension() == Some(OsStr::new("whl"));
    Ok(paths.into_iter().filter(is_wheel).collect())
}

/// Tests a wheel by itself: in an environment with nothing but what it asks for.
///
/// # Errors
/// It cannot be installed, or a test fails.
pub fn clean_tests(workspace: &Workspace, wheel: &Path) -> Result<()> {
    let python = setup::fresh_python(workspace, "python-clean")?;
    setup::pip_install(&python, [wheel])?;
    let script = workspace.python().join("tests/clean_environment.py");
    run::run(
        run::command(python)
            .arg(script)
            .current_dir(workspace.root()),
    )
}

/// Tests a wheel beside the command, gymnasium and Stable-Baselines3, and checks its types.
/// `binary` is the command.
///
/// # Errors
/// The packages cannot be installed, or a test fails.
pub fn tests(workspace: &Workspace, wheel: &Path, binary: &Path) -> Result<()> {
    let folder = workspace.python();
    let requirements = folder.join("tests/requirements.txt");
    let python = setup::python(workspace, "python", &requirements)?;
    let anew = ["--no-deps", "--force-reinstall"].map(Path::new);
    setup::pip_install(&python, anew.into_iter().chain([wheel]))?;
    let module = |arguments: &[&str]| {
        let mut command = run::command(&python);
        command.arg("-m").args(arguments).current_dir(&folder);
        command
    };
    run::run(module(&["pytest"]).env("TRACKLENS_BIN", binary))?;
    run::run(&mut module(&["mypy"]))?;
    run::run(&mut module(&["mypy.stubtest", "tracklens._tracklens"]))
}

/// Tests `tools/rl` with a wheel: agents in the scene of PandaPush, and the notebook of docs/rl.md.
///
/// # Errors
/// The packages cannot be installed, or a test fails.
pub fn rl_tests(workspace: &Workspace, wheel: &Path) -> Result<()> {
    let folder = workspace.root().join("tools/rl");
    let python = setup::python(workspace, "rl", &folder.join("requirements.txt"))?;
    let anew = ["--no-deps", "--force-reinstall"].map(Path::new);
    setup::pip_install(&python, anew.into_iter().chain([wheel]))?;
    let mut pytest = run::command(&python);
    // A test is many short runs: threads of PyTorch would wait for each other.
    pytest
        .args(["-m", "pytest", "-q", "tests"])
        .env("OMP_NUM_THREADS", "1");
    run::run(pytest.current_dir(&folder))
}

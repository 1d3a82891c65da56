//! `cargo xtask setup`: finds what the build and the tests need, and installs what is missing.

mod browser;
mod cluster;
mod gpu;
mod install;
mod node;
mod python;
mod wasm;

use anyhow::Result;

use crate::steps::Steps;
use crate::workspace::Workspace;

pub use browser::{browsers, chromium};
pub use cluster::cluster;
pub use gpu::lavapipe;
pub use node::{
    Minifier, NPM_LOCK, PAGE_PEERS, WasmOpt, axe, minifier, node, npm_packages, page_files,
    page_libraries, wasm_opt,
};
pub use python::{fresh_python, maturin, pip_install, python};
pub use wasm::{WasmToolchain, wasm_toolchain};

pub fn run(workspace: &Workspace, with_browsers: bool) -> Result<()> {
    let mut steps = Steps::new();
    steps.run("Rust for wasm32-unknown-unknown", || {
        wasm_toolchain(workspace).map(drop)
    });
    steps.run("wasm-opt", || wasm_opt(workspace).map(drop));
    if with_browsers {
        steps.run("Chromium, Firefox and their drivers", || {
            browsers(workspace).map(drop)
        });
    }
    steps.run("maturin", || maturin(workspace).map(drop));
    steps.run("lavapipe", || lavapipe().map(drop));
    steps.finish()
}

//! Checks the module graph: imports between the Rust files of a crate point down the layers that
//! ARCHITECTURE.md lists, and neither they nor the scripts of the page import in a circle.
//!
//! `cargo xtask check --only graph` runs it.

mod graph;
mod javascript;
mod layers;
mod rust;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{env, fs};

use anyhow::{Context, Result, bail};

use layers::Layers;

const USAGE: &str = "usage: tracklens-module-graph CHECKOUT";

fn main() -> ExitCode {
    let checked = match env::args_os().nth(1) {
        Some(checkout) => check(&PathBuf::from(checkout)),
        None => Err(anyhow::anyhow!(USAGE)),
    };
    match checked {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Prints every upward import and every circle.
///
/// # Errors
/// There is one, or a file cannot be read or parsed.
fn check(checkout: &Path) -> Result<()> {
    let document = checkout.join("ARCHITECTURE.md");
    let document = fs::read_to_string(&document)
        .with_context(|| format!("cannot read {}", document.display()))?;
    let layers = Layers::parse(&document).context("ARCHITECTURE.md")?;
    let crate_sources = checkout.join("crate/src");
    let rust = rust::graph(&crate_sources)?;
    let scripts = javascript::graph(&checkout.join("web"))?;

    let mut problems = layers.violations(&rust);
    problems.extend(rust.circles());
    problems.extend(scripts.circles());
    for problem in &problems {
        println!("{problem}\n");
    }
    println!(
        "{} imports between {} Rust files, {} between {} scripts",
        rust.imports.len(),
        rust.files.len(),
        scripts.imports.len(),
        scripts.files.len()
    );
    match problems.len() {
        0 => Ok(()),
        1 => bail!("1 problem in the module graph"),
        count => bail!("{count} problems in the module graph"),
    }
}

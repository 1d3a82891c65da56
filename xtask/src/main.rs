//! `cargo xtask`: set-up, build of the wasm package and of the site, serve, checks and tests.
//!
//! Every command prints what it runs, installs what is missing where it may, and otherwise says how
//! to get it. Any stable Rust from the workspace's `rust-version` on will do, so no toolchain file
//! pins one.

mod bench;
mod check;
mod clean;
mod fuzz;
mod package;
mod python;
mod run;
mod serve;
mod setup;
mod site;
mod steps;
mod test;
mod workspace;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::{Parser, Subcommand};

use workspace::Workspace;

/// Set-up, build, site, serve and test of tracklens.
#[derive(Parser)]
#[command(bin_name = "cargo xtask", disable_help_subcommand = true)]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Install what the build and the tests need and is missing: the wasm target, node, wasm-opt,
    /// maturin, Mesa's lavapipe.
    Setup {
        /// Also what the tests of the page need: Chromium, Firefox and their drivers. Firefox's is
        /// built, which takes minutes.
        #[arg(long)]
        browsers: bool,
    },
    /// Build the wasm package into pkg/.
    Build {
        /// Also the part that extracts on WebGPU; with it burn is compiled for wasm, which takes
        /// minutes.
        #[arg(long)]
        gpu: bool,
    },
    /// Build, then put together a folder that any static host serves.
    Site {
        /// The folder to write; `site` in cargo's target directory if not given.
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// With extraction on WebGPU; see `build --gpu`.
        #[arg(long)]
        gpu: bool,
    },
    /// Build the site, quickly and not as small as `site` does, and serve it on 127.0.0.1.
    Serve {
        /// The port to listen on, 0 for any; the first free one from 8080 on if not given.
        #[arg(long)]
        port: Option<u16>,
        /// Open the page in the default browser.
        #[arg(long)]
        open: bool,
        /// With extraction on WebGPU; see `build --gpu`.
        #[arg(long)]
        gpu: bool,
    },
    /// Build the wheel of the Python package into `wheels` in cargo's target directory.
    Python,
    /// Run the tests of the crates, of the command line and of the npm package; on request others,
    /// which install more or take longer.
    Test {
        /// Everything: also the page in headless Chromium and Firefox, ONNX Runtime, the recorder
        /// of PandaPush, the Python package, agents, sweeps on Slurm and GNU parallel, the GPU on
        /// Mesa's lavapipe.
        #[arg(long)]
        all: bool,
        /// Also this part; may be given several times.
        #[arg(long, value_name = "PART")]
        with: Vec<test::Part>,
    },
    /// Check formatting, the module graph, dependencies, lints (native and wasm, every feature) and
    /// docs; warnings are errors.
    Check {
        /// Only this part of the checks.
        #[arg(long, value_name = "PART")]
        only: Option<check::Part>,
    },
    /// Fuzz every function that takes bytes, with libFuzzer and AddressSanitizer. New inputs are kept
    /// in cargo's target directory for the next time.
    Fuzz {
        /// How long, all fuzzers together, a core each at a time.
        #[arg(long, value_name = "N", default_value_t = 10)]
        minutes: u64,
        /// Only the fuzzers of these names.
        #[arg(value_name = "NAME")]
        names: Vec<String>,
        /// Also sweep files, which builds burn once more, with its checks.
        #[arg(long)]
        sweep_files: bool,
    },
    /// Time a part of tracklens against its peer.
    Bench {
        subject: bench::Subject,
        /// Fewer rounds of `extract` and `page`, to see whether they run.
        #[arg(long)]
        quick: bool,
    },
    /// Remove what was built into pkg/ and the site.
    Clean {
        /// Also everything else in cargo's target directory, the installed tools among it.
        #[arg(long)]
        all: bool,
    },
}

fn main() -> ExitCode {
    match perform(Cli::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn perform(task: Task) -> Result<()> {
    let workspace = Workspace::locate()?;
    match task {
        Task::Setup { browsers } => setup::run(&workspace, browsers),
        Task::Build { gpu } => package::build(&workspace, package::Build::Full, gpu),
        Task::Site { out, gpu } => {
            package::build(&workspace, package::Build::Full, gpu)?;
            let out = out.unwrap_or_else(|| workspace.site());
            site::write(&workspace, &out, package::Build::Full, gpu)
        }
        Task::Serve { port, open, gpu } => {
            package::build(&workspace, package::Build::Quick, gpu)?;
            site::write(&workspace, &workspace.site(), package::Build::Quick, gpu)?;
            serve::serve(&workspace.site(), port, open)
        }
        Task::Python => python::wheel(&workspace).map(drop),
        Task::Test { all, mut with } => {
            if all {
                with.extend(test::Part::ALL);
            }
            test::run(&workspace, &with)
        }
        Task::Check { only } => check::run(&workspace, only),
        Task::Fuzz {
            minutes,
            names,
            sweep_files,
        } => fuzz::run(&workspace, minutes, &names, sweep_files),
        Task::Bench { subject, quick } => bench::run(&workspace, subject, quick),
        Task::Clean { all } => clean::run(&workspace, all),
    }
}

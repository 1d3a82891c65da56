//! A Rust that builds for `wasm32-unknown-unknown`: the running toolchain with that target, or
//! Debian's packages.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use super::install::{self, apt_install};
use crate::run;
use crate::workspace::Workspace;

const TARGET: &str = "wasm32-unknown-unknown";

/// Forces one of the two ways, `rustup` or `debian`.
const CHOICE: &str = "TRACKLENS_WASM_TOOLCHAIN";

/// Debian's Rust for browsers: it has the sources of the standard library, but no compiled one for
/// wasm.
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "rust-web-clippy"];

/// How to build for wasm.
pub enum WasmToolchain {
    /// The toolchain that runs xtask has the target.
    Running,
    /// Debian's, which compiles the standard library too, into a target directory of its own.
    Debian {
        /// LLD, of the same LLVM as the compiler.
        linker: String,
        target: PathBuf,
    },
}

/// Finds a toolchain or installs one.
///
/// # Errors
/// There is none and none can be installed; says what to do.
pub fn wasm_toolchain(workspace: &Workspace) -> Result<WasmToolchain> {
    let choice = env::var(CHOICE).unwrap_or_default();
    let toolchain = match choice.as_str() {
        "" => any(workspace),
        "rustup" => with_rustup(),
        "debian" => with_debian(workspace),
        other => bail!("{CHOICE} is {other:?}; expected `rustup`, `debian` or nothing"),
    }?;
    match &toolchain {
        WasmToolchain::Running => eprintln!("Rust for {TARGET}: the running toolchain"),
        WasmToolchain::Debian { linker, .. } => {
            eprintln!("Rust for {TARGET}: Debian's /usr/bin/cargo with {linker}")
        }
    }
    Ok(toolchain)
}

fn any(workspace: &Workspace) -> Result<WasmToolchain> {
    if running_has_target()? {
        return Ok(WasmToolchain::Running);
    }
    // Where these packages are, rustup has usually been tried in vain.
    if let Ok(debian) = find_debian(workspace) {
        return Ok(debian);
    }
    let rustup = match with_rustup() {
        Ok(toolchain) => return Ok(toolchain),
        Err(error) => error,
    };
    eprintln!("{rustup:#}; trying Debian's packages");
    with_debian(workspace).map_err(|debian| {
        anyhow::anyhow!(
            "Rust cannot build for {TARGET} here.\n  \
               with rustup: {rustup:#}\n  \
               with Debian's packages: {debian:#}\n\
             Run `rustup target add {TARGET}` where rustup (https://rustup.rs) has a network, or on Debian, \
             as root, `apt-get install {} lld-N` with N the LLVM version that `/usr/bin/rustc -vV` names",
            DEBIAN_PACKAGES.join(" ")
        )
    })
}

fn with_rustup() -> Result<WasmToolchain> {
    if running_has_target()? {
        return Ok(WasmToolchain::Running);
    }
    if !install::found("rustup") {
        bail!("rustup is not installed");
    }
    run::run(run::command("rustup").args(["target", "add", TARGET]))?;
    if !running_has_target()? {
        bail!("rustup added {TARGET} to another toolchain than the one that runs xtask");
    }
    Ok(WasmToolchain::Running)
}

fn running_has_target() -> Result<bool> {
    let rustc = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let folder =
        run::output(run::command(rustc).args(["--print=target-libdir", "--target", TARGET]))?;
    let Ok(entries) = fs::read_dir(folder.trim()) else {
        return Ok(false);
    };
    let has_core = |name: &str| name.starts_with("libcore-") && name.ends_with(".rlib");
    Ok(entries
        .flatten()
        .any(|entry| has_core(&entry.file_name().to_string_lossy())))
}

fn with_debian(workspace: &Workspace) -> Result<WasmToolchain> {
    let lack = match find_debian(workspace) {
        Ok(toolchain) => return Ok(toolchain),
        Err(lack) => lack,
    };
    apt_install(&DEBIAN_PACKAGES).context(lack)?;
    // The compiler says which LLD goes with it.
    apt_install(&[&format!("lld-{}", DebianRust::installed()?.llvm)])?;
    find_debian(workspace)
}

/// # Errors
/// A part of it is missing or too old; says which.
fn find_debian(workspace: &Workspace) -> Result<WasmToolchain> {
    let parts = [
        "/usr/bin/rustc",
        "/usr/bin/cargo",
        "/usr/bin/cargo-clippy",
        "/usr/lib/rustlib/src/rust/library/std/Cargo.toml",
    ];
    if let Some(missing) = parts.iter().find(|part| !Path::new(part).exists()) {
        bail!("{missing} is missing");
    }
    let rust = DebianRust::installed()?;
    let oldest = env!("CARGO_PKG_RUST_VERSION");
    if Some(rust.release) < release(oldest) {
        let (major, minor) = rust.release;
        bail!("/usr/bin/rustc is Rust {major}.{minor}, older than {oldest}");
    }
    let linker = format!("wasm-ld-{}", rust.llvm);
    if !install::found(&linker) {
        bail!("{linker} is not on the path");
    }
    Ok(WasmToolchain::Debian {
        linker,
        target: workspace.target().join("wasm-debian"),
    })
}

/// What Debian's compiler says of itself.
#[derive(Debug, PartialEq)]
struct DebianRust {
    release: (u32, u32),
    llvm: u32,
}

impl DebianRust {
    fn installed() -> Result<Self> {
        let version = run::output(debian_command("/usr/bin/rustc").arg("-vV"))?;
        Self::parsed(&version).with_context(|| {
            format!("/usr/bin/rustc -vV names no release and LLVM version:\n{version}")
        })
    }

    fn parsed(version: &str) -> Option<Self> {
        let line = |key| version.lines().find_map(|line| line.strip_prefix(key));
        Some(Self {
            release: release(line("release: ")?)?,
            llvm: line("LLVM version: ")?.split('.').next()?.parse().ok()?,
        })
    }
}

/// The first two numbers of a version.
fn release(version: &str) -> Option<(u32, u32)> {
    let mut numbers = version.split('.').map(|number| number.parse().ok());
    Some((numbers.next()??, numbers.next()??))
}

/// A command that finds nothing of the toolchain that runs xtask.
fn debian_command(program: &str) -> Command {
    let mut command = run::command(program);
    command
        .env_remove("RUSTUP_TOOLCHAIN")
        .env_remove("LD_LIBRARY_PATH")
        .env("CARGO", "/usr/bin/cargo")
        .env("RUSTC", "/usr/bin/rustc")
        .env("RUSTDOC", "/usr/bin/rustdoc");
    command
}

impl WasmToolchain {
    /// A cargo subcommand for wasm, to be completed with the package and its features.
    pub fn cargo(&self, subcommand: &str) -> Command {
        let mut command = match self {
            Self::Running => {
                let mut command = run::cargo();
                command.arg(subcommand);
                command
            }
            Self::Debian { linker, target } => {
                let mut command = debian_command(match subcommand {
                    // By its path: cargo would take the first one on the path, which may be
                    // rustup's.
                    "clippy" => "/usr/bin/cargo-clippy",
                    _ => "/usr/bin/cargo",
                });
                command
                    .args([subcommand, "-Zbuild-std=std,panic_abort"])
                    .env("RUSTC_BOOTSTRAP", "1")
                    .env("CARGO_TARGET_DIR", target)
                    .env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", linker);
                command
            }
        };
        // Those flags are meant for the native target; the ones for wasm are in
        // `.cargo/config.toml`.
        for native in [
            "RUSTFLAGS",
            "CARGO_ENCODED_RUSTFLAGS",
            "CARGO_BUILD_RUSTFLAGS",
        ] {
            command.env_remove(native);
        }
        command.args(["--target", TARGET]);
        command
    }

    /// Where cargo puts what it builds, a folder a profile.
    pub fn folder(&self, workspace: &Workspace) -> PathBuf {
        let target = match self {
            Self::Running => workspace.target(),
            Self::Debian { target, .. } => target,
        };
        target.join(TARGET)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_compiler_names_its_release_and_the_llvm_whose_linker_it_needs() {
        let version = "rustc 1.96.0\nrelease: 1.96.0\nLLVM version: 22.1.8\n";
        let expected = DebianRust {
            release: (1, 96),
            llvm: 22,
        };
        assert_eq!(DebianRust::parsed(version), Some(expected));
        assert_eq!(DebianRust::parsed("rustc 1.96.0\n"), None);
    }

    #[test]
    fn releases_are_compared_by_number() {
        assert!(release("1.100.0") > release("1.95"));
        assert!(release("1.85.0") < release("1.95"));
    }
}

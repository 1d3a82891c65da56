//! node, npm, and the one tool that comes from npm: wasm-opt.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use super::install::Package;
use crate::run;
use crate::workspace::Workspace;

/// The tools from npm, pinned.
const MANIFEST: &str = include_str!("../../npm/package.json");
pub const NPM_LOCK: &str = include_str!("../../npm/package-lock.json");

/// The oldest node that runs wasm-opt and the tests of the npm package.
const OLDEST_NODE: u32 = 18;

const NODE: Package = Package {
    what: "node",
    apt: &["nodejs"],
    elsewhere: &[
        ("brew", "brew install node"),
        ("winget", "winget install OpenJS.NodeJS.LTS"),
        ("dnf", "sudo dnf install nodejs"),
        ("pacman", "sudo pacman -S nodejs"),
        ("zypper", "sudo zypper install nodejs"),
    ],
    otherwise: "node is at https://nodejs.org",
};

/// Apart from node, as some packages of node bring npm along and conflict with this one.
const NPM: Package = Package {
    what: "npm",
    apt: &["npm"],
    elsewhere: &[
        ("dnf", "sudo dnf install npm"),
        ("pacman", "sudo pacman -S npm"),
        ("zypper", "sudo zypper install npm"),
    ],
    otherwise: "npm comes with node from https://nodejs.org",
};

/// node and npm.
pub struct Node {
    node: PathBuf,
    npm: PathBuf,
}

impl Node {
    /// A command run by node.
    pub fn command(&self) -> Command {
        run::command(&self.node)
    }
}

/// Finds node and npm or installs them.
///
/// # Errors
/// They are missing and cannot be installed, or node is too old; says what to do.
pub fn node() -> Result<Node> {
    let node = Node {
        node: NODE.program("node")?,
        npm: NPM.program("npm")?,
    };
    let version = run::output(node.command().arg("--version"))?;
    let version = version.trim();
    match major(version) {
        Some(major) if major >= OLDEST_NODE => Ok(node),
        _ => bail!(
            "node {OLDEST_NODE} or later is needed, {} is {version}; get one from https://nodejs.org",
            node.node.display()
        ),
    }
}

fn major(version: &str) -> Option<u32> {
    version.trim_start_matches('v').split('.').next()?.parse().ok()
}

/// Binaryen's optimiser of wasm files.
pub struct WasmOpt {
    node: Node,
    script: PathBuf,
}

impl WasmOpt {
    /// wasm-opt, to be completed with its arguments.
    pub fn command(&self) -> Command {
        let mut command = self.node.command();
        command.arg(&self.script);
        command
    }
}

/// Finds the pinned wasm-opt or installs it into the target directory.
///
/// # Errors
/// node is missing, or npm cannot fetch the package.
pub fn wasm_opt(workspace: &Workspace) -> Result<WasmOpt> {
    let node = node()?;
    let folder = workspace.tools().join("npm");
    let script = folder.join("node_modules/binaryen/bin/wasm-opt");
    if !script.exists() || !is_installed(&folder) {
        npm_ci(&node, &folder)?;
    }
    Ok(WasmOpt { node, script })
}

/// The copy of the lock file is written once everything else is there.
fn is_installed(folder: &Path) -> bool {
    fs::read_to_string(folder.join("installed.json")).is_ok_and(|lock| lock == NPM_LOCK)
}

fn npm_ci(node: &Node, folder: &Path) -> Result<()> {
    let write = |name: &str, content: &str| {
        let file = folder.join(name);
        fs::write(&file, content).with_context(|| format!("cannot write {}", file.display()))
    };
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    write("package.json", MANIFEST)?;
    write("package-lock.json", NPM_LOCK)?;
    let mut npm = run::command(&node.npm);
    npm.args(["ci", "--ignore-scripts", "--no-audit", "--no-fund"])
        .current_dir(folder);
    run::run(&mut npm)?;
    write("installed.json", NPM_LOCK)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_of_node_is_read_with_or_without_a_v() {
        assert_eq!(major("v20.20.2"), Some(20));
        assert_eq!(major("18.0.0"), Some(18));
        assert_eq!(major("nightly"), None);
    }

    #[test]
    fn the_lock_file_names_no_registry() {
        assert!(!NPM_LOCK.contains("resolved"));
        assert!(!NPM_LOCK.contains("://"));
    }
}

//! node, npm, and what comes from npm: wasm-opt, libraries of the page, and the peers of
//! benchmarks.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use super::install::Package;
use crate::run;
use crate::workspace::Workspace;

/// Pinned packages from npm.
pub struct Packages {
    /// The folder they are installed into, in that of tools.
    name: &'static str,
    manifest: &'static str,
    lock: &'static str,
}

const TOOLS: Packages = Packages {
    name: "npm",
    manifest: include_str!("../../npm/package.json"),
    lock: NPM_LOCK,
};
pub const NPM_LOCK: &str = include_str!("../../npm/package-lock.json");

/// What the page is measured against.
pub const PAGE_PEERS: Packages = Packages {
    name: "npm-peers",
    manifest: include_str!("../../npm/peers/package.json"),
    lock: include_str!("../../npm/peers/package-lock.json"),
};

/// What the page loads in addition to its own files.
const PAGE_LIBRARIES: Packages = Packages {
    name: "npm-page",
    manifest: include_str!("../../npm/page/package.json"),
    lock: include_str!("../../npm/page/package-lock.json"),
};

/// The files that the page loads from its libraries: their paths in the site, and in
/// `node_modules`.
const PAGE_FILES: [(&str, &str); 2] = [
    (
        "vendor/mediabunny.js",
        "mediabunny/dist/bundles/mediabunny.min.mjs",
    ),
    ("vendor/mediabunny.LICENSE.txt", "mediabunny/LICENSE"),
];

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
    version
        .trim_start_matches('v')
        .split('.')
        .next()?
        .parse()
        .ok()
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
    let script = npm_packages(workspace, &node, &TOOLS)?.join("binaryen/bin/wasm-opt");
    Ok(WasmOpt { node, script })
}

/// esbuild, here for single scripts: nothing is bundled.
pub struct Minifier {
    node: Node,
    script: PathBuf,
}

impl Minifier {
    /// Takes comments and needless whitespace out of `scripts` in the folder `from`, and writes them
    /// under the same names into `to`.
    ///
    /// # Errors
    /// A script is not JavaScript, or cannot be written.
    pub fn run(&self, from: &Path, to: &Path, scripts: &[PathBuf]) -> Result<()> {
        let mut command = self.node.command();
        command
            .arg(&self.script)
            .args(["--minify-whitespace", "--minify-syntax"])
            .args([
                "--legal-comments=none",
                "--charset=utf8",
                "--log-level=warning",
            ])
            .arg(format!("--outbase={}", from.display()))
            .arg(format!("--outdir={}", to.display()))
            .args(scripts);
        // Its line would name every script.
        let done = command.output().context("esbuild cannot be started")?;
        if !done.status.success() {
            bail!("esbuild failed: {}", String::from_utf8_lossy(&done.stderr));
        }
        Ok(())
    }
}

/// Finds the pinned esbuild or installs it into the target directory.
///
/// # Errors
/// As [`wasm_opt`].
pub fn minifier(workspace: &Workspace) -> Result<Minifier> {
    let node = node()?;
    let script = npm_packages(workspace, &node, &TOOLS)?.join("esbuild/bin/esbuild");
    Ok(Minifier { node, script })
}

/// Finds the pinned axe-core, which tests of the page look for barriers with, or installs it into
/// the target directory.
///
/// # Errors
/// As [`wasm_opt`].
pub fn axe(workspace: &Workspace) -> Result<PathBuf> {
    Ok(npm_packages(workspace, &node()?, &TOOLS)?.join("axe-core/axe.min.js"))
}

/// Finds pinned packages or installs them, and returns the folder they are in.
///
/// # Errors
/// npm cannot fetch them.
pub fn npm_packages(workspace: &Workspace, node: &Node, packages: &Packages) -> Result<PathBuf> {
    let folder = workspace.tools().join(packages.name);
    // The copy of the lock file is written once everything else is there.
    let installed = fs::read_to_string(folder.join("installed.json"));
    if installed.is_ok_and(|lock| lock == packages.lock) {
        return Ok(folder.join("node_modules"));
    }
    npm_ci(node, &folder, packages)?;
    Ok(folder.join("node_modules"))
}

/// Installs the libraries that the page loads.
///
/// # Errors
/// node is missing, or npm cannot fetch the packages.
pub fn page_libraries(workspace: &Workspace) -> Result<()> {
    npm_packages(workspace, &node()?, &PAGE_LIBRARIES).map(drop)
}

/// The files of these libraries, as far as they are installed, by their path in the site.
pub fn page_files(workspace: &Workspace) -> Vec<(&'static str, PathBuf)> {
    let folder = workspace
        .tools()
        .join(PAGE_LIBRARIES.name)
        .join("node_modules");
    let files = PAGE_FILES.map(|(place, file)| (place, folder.join(file)));
    files
        .into_iter()
        .filter(|(_, file)| file.is_file())
        .collect()
}

fn npm_ci(node: &Node, folder: &Path, packages: &Packages) -> Result<()> {
    let write = |name: &str, content: &str| {
        let file = folder.join(name);
        fs::write(&file, content).with_context(|| format!("cannot write {}", file.display()))
    };
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    write("package.json", packages.manifest)?;
    write("package-lock.json", packages.lock)?;
    let mut npm = run::command(&node.npm);
    npm.args(["ci", "--ignore-scripts", "--no-audit", "--no-fund"])
        .current_dir(folder);
    run::run(&mut npm)?;
    write("installed.json", packages.lock)
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
    fn the_lock_files_name_no_registry() {
        for Packages { lock, .. } in [TOOLS, PAGE_PEERS] {
            assert!(!lock.contains("resolved"));
            assert!(!lock.contains("://"));
        }
    }
}

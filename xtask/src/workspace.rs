//! Where things are.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

use crate::run;

/// The package that checks the module graph.
pub const GRAPH: &str = "tracklens-module-graph";

/// The package that tests the page in browsers. It waits for them, so that it need not be fast.
pub const PAGE_TESTS: &str = "tracklens-page-tests";

/// The folders of the checkout and cargo's target directory.
pub struct Workspace {
    root: PathBuf,
    target: PathBuf,
}

impl Workspace {
    /// Asks cargo, so that `CARGO_TARGET_DIR` and cargo's configuration count.
    pub fn locate() -> Result<Self> {
        let json = run::output(run::cargo().args(["metadata", "--no-deps", "--format-version=1"]))?;
        let metadata: Value =
            serde_json::from_str(&json).context("the output of cargo metadata is not JSON")?;
        let folder = |key: &str| {
            let path = metadata[key].as_str().map(PathBuf::from);
            path.with_context(|| format!("cargo metadata reports no {key}"))
        };
        Ok(Self {
            root: folder("workspace_root")?,
            target: folder("target_directory")?,
        })
    }

    /// A checkout in `folder`, with its target directory inside.
    #[cfg(test)]
    pub fn at(folder: &Path) -> Self {
        Self {
            root: folder.to_owned(),
            target: folder.join("target"),
        }
    }

    /// The root of the checkout.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Cargo's target directory.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// The npm package, tracked and built files side by side.
    pub fn package(&self) -> PathBuf {
        self.root.join("pkg")
    }

    /// The Python package.
    pub fn python(&self) -> PathBuf {
        self.root.join("python")
    }

    /// The sources of the page.
    pub fn web(&self) -> PathBuf {
        self.root.join("web")
    }

    /// Where the site is put by default.
    pub fn site(&self) -> PathBuf {
        self.target.join("site")
    }

    /// Installed tools and stamps of finished work.
    pub fn tools(&self) -> PathBuf {
        self.target.join("xtask")
    }

    /// A native executable of the release profile.
    pub fn binary(&self, name: &str) -> PathBuf {
        let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
        self.target.join("release").join(file)
    }
}

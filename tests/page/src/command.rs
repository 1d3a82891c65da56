//! The command line, whose results the page's are compared with.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, bail};
use serde_json::Value;

/// The `tracklens` binary.
pub struct Cli(PathBuf);

impl Cli {
    /// The binary that was built for the tests.
    ///
    /// # Errors
    /// It is not said where it is.
    pub fn new() -> Result<Self> {
        Ok(Self(crate::given("TRACKLENS_BIN")?))
    }

    /// Runs a command that prints an evaluation as JSON.
    ///
    /// # Errors
    /// The command fails or prints something else.
    pub fn evaluate<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Result<Value> {
        let output = Command::new(&self.0)
            .args(arguments)
            .arg("--json")
            .output()
            .with_context(|| format!("cannot run {}", self.0.display()))?;
        if !output.status.success() {
            bail!("tracklens failed: {}", String::from_utf8_lossy(&output.stderr));
        }
        serde_json::from_slice(&output.stdout).context("tracklens did not print JSON")
    }
}

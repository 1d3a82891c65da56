//! What the tests of the page share: the site over HTTP, a browser, the page as a user sees it, data sets, and the
//! command line to compare with.
//!
//! `cargo xtask test` builds the site and the binary and says by `TRACKLENS_SITE` and `TRACKLENS_BIN` where they are.

mod browser;
mod command;
mod data;
mod page;
mod server;

pub use browser::with_page;
pub use command::Cli;
pub use data::{Dataset, change};
pub use page::{Card, Page, Score};

use std::path::PathBuf;

use anyhow::{Context, Result};

/// A path that `cargo xtask test` gives by an environment variable.
///
/// # Errors
/// The variable is not set.
fn given(variable: &str) -> Result<PathBuf> {
    std::env::var_os(variable)
        .map(PathBuf::from)
        .with_context(|| format!("{variable} is not set; run these tests by `cargo xtask test`"))
}

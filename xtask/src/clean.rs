//! `cargo xtask clean`.

use std::fs;
use std::io;
use std::path::Path;

use anyhow::{Context, Result};

use crate::workspace::Workspace;
use crate::{package, run};

pub fn run(workspace: &Workspace, all: bool) -> Result<()> {
    for file in package::generated() {
        removed(&workspace.package().join(file), |path| {
            fs::remove_file(path)
        })?;
    }
    removed(&workspace.site(), |path| fs::remove_dir_all(path))?;
    if all {
        run::run(run::cargo().arg("clean"))?;
    }
    Ok(())
}

fn removed(path: &Path, remove: impl Fn(&Path) -> io::Result<()>) -> Result<()> {
    match remove(path) {
        Ok(()) => eprintln!("removed {}", path.display()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {}
        Err(error) => {
            return Err(error).with_context(|| format!("cannot remove {}", path.display()));
        }
    }
    Ok(())
}

//! Tells the crate which commit it is built from, for the record of a training run.

use std::env;
use std::process::Command;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // Nothing else asks for the commit, and so only trainings are compiled anew after one.
    if env::var_os("CARGO_FEATURE_TRAIN").is_none() {
        return;
    }
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    // A crate outside a repository is built all the same.
    if let (Some(hash), Some(log)) = (
        git(&["rev-parse", "HEAD"]),
        git(&["rev-parse", "--git-path", "logs/HEAD"]),
    ) {
        println!("cargo:rerun-if-changed={log}");
        println!("cargo:rustc-env=TRACKLENS_GIT_HASH={hash}");
    }
}

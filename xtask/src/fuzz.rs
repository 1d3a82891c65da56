//! `cargo xtask fuzz`: libFuzzer on every function that takes bytes.
//!
//! The fuzzers in `fuzz/` are built with a stable compiler: `RUSTC_BOOTSTRAP` lets it take the
//! sanitizer's flag.

use std::collections::VecDeque;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::thread;

use anyhow::{Context, Result, bail};
use serde_json::{Map, Value};

use crate::run;
use crate::workspace::Workspace;

/// The coverage that libFuzzer steers by, and AddressSanitizer.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
                     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
                     -Cllvm-args=-sanitizer-coverage-pc-table \
                     -Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing -Zsanitizer=address";

/// The longest input, in bytes.
const LONGEST: u64 = 64 << 10;
/// What an input may allocate at once: 64 MiB, and 32 bytes for each of its own.
const ALLOCATION: &str = "-malloc_limit_mb=66";
/// Of images, whose size is checked by its name: the largest one with four channels of 16 bits.
const ALLOCATION_OF_IMAGES: &str = "-malloc_limit_mb=514";
const IMAGES: &str = "images";

/// Needs burn.
const SWEEP_FILE: &str = "sweep_file";

/// Runs the fuzzers for `minutes` in all, as many at a time as there are cores.
///
/// # Errors
/// A fuzzer does not build, or finds an input that crashes, takes more than a minute or too much
/// memory.
pub fn run(workspace: &Workspace, minutes: u64, only: &[String], sweep_files: bool) -> Result<()> {
    let table = seed_table(workspace)?;
    if let Some(unknown) = only.iter().find(|name| !table.contains_key(*name)) {
        let known: Vec<_> = table.keys().map(String::as_str).collect();
        bail!("no fuzzer `{unknown}`; there are {}", known.join(", "));
    }
    let sweep_files = sweep_files || only.iter().any(|name| name == SWEEP_FILE);
    let names: Vec<&str> = table
        .keys()
        .map(String::as_str)
        .filter(|name| only.is_empty() || only.iter().any(|o| o == name))
        .filter(|name| sweep_files || *name != SWEEP_FILE)
        .collect();
    let binaries = build(workspace, sweep_files)?;
    let cores = thread::available_parallelism().map_or(1, |n| n.get());
    let at_a_time = cores.min(names.len());
    let seconds = (minutes * 60 * at_a_time as u64 / names.len() as u64).max(1);
    let waiting = Mutex::new(names.into_iter().collect::<VecDeque<_>>());
    let failed = Mutex::new(Vec::new());
    thread::scope(|scope| {
        for _ in 0..at_a_time {
            scope.spawn(|| {
                loop {
                    let Some(name) = next(&waiting) else {
                        return;
                    };
                    if let Err(error) = fuzz(workspace, &binaries, &table, name, seconds) {
                        eprintln!("{error:#}");
                        failed.lock().expect("no thread panics").push(name);
                    }
                }
            });
        }
    });
    let failed = failed.into_inner().expect("no thread panics");
    if !failed.is_empty() {
        bail!("something was found by: {}", failed.join(", "));
    }
    Ok(())
}

fn next<'a>(waiting: &Mutex<VecDeque<&'a str>>) -> Option<&'a str> {
    waiting.lock().expect("no thread panics").pop_front()
}

/// `fuzz/seeds.json`: for every fuzzer the folders that hold its seeds, with their extensions.
fn seed_table(workspace: &Workspace) -> Result<Map<String, Value>> {
    let path = workspace.root().join("fuzz/seeds.json");
    let json = fs::read(&path).with_context(|| path.display().to_string())?;
    serde_json::from_slice(&json).with_context(|| path.display().to_string())
}

/// Builds all fuzzers and returns the folder that they are in.
fn build(workspace: &Workspace, sweep_files: bool) -> Result<PathBuf> {
    let about = run::output(run::command("rustc").arg("-vV"))?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.context("rustc names no host")?;
    let target = folder(workspace).join("target");
    let mut cargo = run::cargo();
    cargo
        .args(["build", "--release", "--bins", "--target", host])
        .arg("--manifest-path")
        .arg(workspace.root().join("fuzz/Cargo.toml"))
        .env("CARGO_TARGET_DIR", &target)
        .env("RUSTC_BOOTSTRAP", "1")
        .env("RUSTFLAGS", FLAGS);
    if sweep_files {
        cargo.arg("--features=train");
    }
    run::run(&mut cargo)?;
    Ok(target.join(host).join("release"))
}

/// Runs one fuzzer for `seconds`.
fn fuzz(
    workspace: &Workspace,
    binaries: &Path,
    table: &Map<String, Value>,
    name: &str,
    seconds: u64,
) -> Result<()> {
    let folder = folder(workspace);
    let made = |part: &str| -> Result<PathBuf> {
        let path = folder.join(part).join(name);
        fs::create_dir_all(&path).with_context(|| path.display().to_string())?;
        Ok(path)
    };
    let (corpus, seeds, found) = (made("corpus")?, made("seeds")?, made("found")?);
    copy_seeds(workspace.root(), &table[name], &seeds)?;
    let log = folder.join(format!("{name}.log"));
    let file = File::create(&log).with_context(|| log.display().to_string())?;
    let allocation = match name {
        IMAGES => ALLOCATION_OF_IMAGES,
        _ => ALLOCATION,
    };
    let mut command = run::command(binaries.join(name));
    command
        .args([&corpus, &seeds])
        .arg(format!("-artifact_prefix={}/", found.display()))
        .arg(format!("-max_total_time={seconds}"))
        .arg(format!("-max_len={LONGEST}"))
        .args([allocation, "-rss_limit_mb=2048", "-timeout=60"])
        .arg("-print_final_stats=1")
        .stderr(file);
    let done = run::run(&mut command);
    let text = fs::read(&log).with_context(|| log.display().to_string())?;
    let text = String::from_utf8_lossy(&text);
    let executed = text
        .lines()
        .find_map(|line| line.strip_prefix("stat::number_of_executed_units:"));
    eprintln!("{name}: {} inputs", executed.unwrap_or(" unknown").trim());
    done.with_context(|| format!("{name}: see {} and {}", log.display(), found.display()))
}

/// Copies the seeds of a fuzzer into `to`, where nothing else lies.
fn copy_seeds(root: &Path, folders: &Value, to: &Path) -> Result<()> {
    for (folder, extensions) in folders.as_object().into_iter().flatten() {
        for file in fs::read_dir(root.join(folder)).with_context(|| folder.clone())? {
            let path = file?.path();
            let extension = path.extension().unwrap_or_default().to_string_lossy();
            let mut wanted = extensions.as_array().into_iter().flatten();
            if let Some(name) = path.file_name()
                && path.is_file()
                && wanted.any(|e| *e == *extension)
            {
                fs::copy(&path, to.join(name)).with_context(|| path.display().to_string())?;
            }
        }
    }
    Ok(())
}

/// What is kept from one time to the next.
fn folder(workspace: &Workspace) -> PathBuf {
    workspace.target().join("fuzz")
}

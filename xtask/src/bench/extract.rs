//! Extraction on the CPU, natively: the engine against ONNX Runtime, PyTorch eager and rten, by
//! turns.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;
use tempfile::TempDir;

use super::{median, programs};
use crate::workspace::Workspace;
use crate::{run, setup};

/// What is timed, in this order.
const ENCODERS: [&str; 3] = ["basic", "keynet", "dsae"];
const SIDES: [u32; 2] = [128, 256];
pub const THREADS: [usize; 2] = [1, 2];
const PROGRAMS: [&str; 4] = ["tracklens", "ONNX Runtime", "PyTorch eager", "rten"];

/// What one run of a program prints: a line for every encoder and size, and the peak of a core.
#[derive(Debug, Default, PartialEq)]
struct Run {
    /// Milliseconds a frame by encoder and size.
    times: BTreeMap<String, f64>,
    /// Millions of additions and multiplications of a frame, by the definition of the convolutions.
    mflop: BTreeMap<String, f64>,
    /// GFLOP/s.
    peak: Option<f64>,
}

impl Run {
    fn parse(output: &str) -> Self {
        let mut run = Self::default();
        for line in output.lines() {
            let Ok(value) = serde_json::from_str::<Value>(line) else {
                continue;
            };
            let Some(name) = value["name"].as_str() else {
                continue;
            };
            run.peak = value["gflops"].as_f64().or(run.peak);
            let numbers = [("median_ms", &mut run.times), ("mflop", &mut run.mflop)];
            for (key, numbers) in numbers {
                if let Some(number) = value[key].as_f64() {
                    numbers.insert(name.to_owned(), number);
                }
            }
        }
        run
    }
}

/// `rounds` runs of every program with every number of threads.
pub fn run(workspace: &Workspace, rounds: usize) -> Result<()> {
    let peers = workspace.root().join("crate/benches/peers");
    let onnx = setup::python(
        workspace,
        "onnxruntime",
        &peers.join("requirements-onnx.txt"),
    )?;
    let torch = setup::python(workspace, "torch", &peers.join("requirements-torch.txt"))?;
    let made = encoders(workspace)?;
    let rten = rten(workspace, &peers)?;
    for threads in THREADS {
        let count = threads.to_string();
        let mut runs: [Vec<Run>; PROGRAMS.len()] = Default::default();
        for _ in 0..rounds {
            let mut python = run::command(&onnx);
            python
                .arg(peers.join("extract_onnxruntime.py"))
                .arg(made.path());
            let mut eager = run::command(&torch);
            eager.arg(peers.join("extract_torch.py"));
            let mut rust = run::command(&rten);
            rust.arg(made.path());
            let mut ours = bench(workspace);
            ours.arg("--json");
            for (command, runs) in [ours, python, eager, rust].iter_mut().zip(&mut runs) {
                runs.push(timed(command.args(["--threads", &count]))?);
            }
        }
        println!("{}", table(threads, &runs)?);
    }
    Ok(())
}

fn bench(workspace: &Workspace) -> Command {
    let mut cargo = run::cargo();
    cargo.args([
        "bench",
        "--package=tracklens",
        "--no-default-features",
        "--features=cli",
    ]);
    cargo
        .args(["--bench=extract", "--"])
        .current_dir(workspace.root());
    cargo
}

/// A folder with the encoders, as checkpoints and as ONNX models.
///
/// # Errors
/// They cannot be built or written.
pub fn encoders(workspace: &Workspace) -> Result<TempDir> {
    let made = TempDir::new().context("no folder for the encoders")?;
    let [tracklens, _] = programs(workspace)?;
    run::run(bench(workspace).arg("--checkpoints").arg(made.path()))?;
    for encoder in ENCODERS {
        let file = made.path().join(encoder);
        let mut export = run::command(&tracklens);
        export
            .args(["export", "--checkpoint"])
            .arg(file.with_extension("safetensors"));
        run::run(export.arg("--onnx").arg(file.with_extension("onnx")))?;
    }
    Ok(made)
}

/// The peer that is written in Rust, built with the rest.
fn rten(workspace: &Workspace, peers: &Path) -> Result<PathBuf> {
    let folder = workspace.target().join("peers");
    let mut build = run::cargo();
    build
        .args(["build", "--release", "--locked", "--manifest-path"])
        .arg(peers.join("extract_rten/Cargo.toml"))
        .env("CARGO_TARGET_DIR", &folder);
    run::run(&mut build)?;
    let program = format!("extract_rten{}", std::env::consts::EXE_SUFFIX);
    Ok(folder.join("release").join(program))
}

fn timed(command: &mut Command) -> Result<Run> {
    Ok(Run::parse(&run::output(command)?))
}

/// A table in Markdown: medians over the runs, and the medians of the ratios of runs that followed
/// each other.
fn table(threads: usize, runs: &[Vec<Run>; PROGRAMS.len()]) -> Result<String> {
    let [ours, peers @ ..] = runs;
    let peak = median(ours.iter().filter_map(|run| run.peak).collect())?;
    let mut table = format!(
        "Threads: {threads}. tracklens runs a frame a thread, the others a frame on all of them. Milliseconds a frame, GFLOP/s by \
         the definition of the convolutions; the peak of a core is {peak:.0} GFLOP/s.\n\n| | {} | GFLOP/s | of peak |",
        PROGRAMS[0]
    );
    for peer in &PROGRAMS[1..] {
        write!(table, " {peer} | ratio |")?;
    }
    write!(table, "\n|---|{}", "---|".repeat(3 + 2 * peers.len()))?;
    for encoder in ENCODERS {
        for side in SIDES {
            let name = format!("{encoder} {side}");
            let times = |runs: &[Run]| -> Result<Vec<f64>> {
                let time = |run: &Run| run.times.get(&name).copied();
                let times: Option<_> = runs.iter().map(time).collect();
                times.with_context(|| format!("{name} was not timed"))
            };
            let own = times(ours)?;
            let time = median(own.clone())?;
            let mflop = ours.first().and_then(|run| run.mflop.get(&name)).copied();
            let gflops =
                mflop.with_context(|| format!("{name} has no number of operations"))? / time;
            let share = 100.0 * gflops / (peak * threads as f64);
            write!(
                table,
                "\n| {name} | {time:.2} | {gflops:.0} | {share:.0} % |"
            )?;
            for peer in peers {
                let theirs = times(peer)?;
                let ratios = own.iter().zip(&theirs).map(|(ours, theirs)| theirs / ours);
                let ratio = median(ratios.collect())?;
                write!(table, " {:.2} | {ratio:.2} |", median(theirs.clone())?)?;
            }
        }
    }
    table.push('\n');
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_has_times_operations_and_the_peak() {
        let run = Run::parse(
            "warming up\n{\"name\":\"peak\",\"gflops\":90.5}\n{\"name\":\"basic 128\",\"median_ms\":8.5,\"mflop\":1260.0}\n",
        );
        assert_eq!(run.peak, Some(90.5));
        assert_eq!(run.times.get("basic 128"), Some(&8.5));
        assert_eq!(run.mflop.get("basic 128"), Some(&1260.0));
    }

    #[test]
    fn ratios_are_those_of_pairs() -> Result<()> {
        let runs = |times: [f64; 3]| {
            let run = |time: f64| Run {
                times: ENCODERS
                    .iter()
                    .flat_map(|encoder| SIDES.map(|side| (format!("{encoder} {side}"), time)))
                    .collect(),
                mflop: ENCODERS
                    .iter()
                    .flat_map(|encoder| SIDES.map(|side| (format!("{encoder} {side}"), 100.0)))
                    .collect(),
                peak: Some(50.0),
            };
            times.map(run).into()
        };
        // The machine was busy in the second round: 2, 2 and 3 times as fast.
        let table = table(
            1,
            &[
                runs([1.0, 10.0, 1.0]),
                runs([2.0, 20.0, 3.0]),
                runs([1.0; 3]),
                runs([4.0; 3]),
            ],
        )?;
        let row = table.lines().find(|line| line.starts_with("| basic 128"));
        let expected =
            "| basic 128 | 1.00 | 100 | 200 % | 3.00 | 2.00 | 1.00 | 1.00 | 4.00 | 4.00 |";
        assert_eq!(row.context("a row")?, expected);
        let columns = |line: &str| line.matches('|').count();
        assert!(
            table
                .lines()
                .skip(2)
                .all(|line| columns(line) == columns(expected))
        );
        Ok(())
    }

    #[test]
    fn an_encoder_that_was_not_timed_is_an_error() {
        let run = || Run {
            peak: Some(50.0),
            ..Run::default()
        };
        assert!(table(1, &[(); PROGRAMS.len()].map(|()| vec![run()])).is_err());
    }
}

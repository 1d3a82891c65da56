//! `cargo xtask bench`: a benchmark and its peer by turns, so that both see the same state of the
//! machine.

mod extract;
mod page;
mod report;

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use serde_json::Value;

use crate::workspace::{PAGE_TESTS, Workspace};
use crate::{package, python, run, setup, site};

/// How often each of the two is run, also when it is to be quick.
const ROUNDS: usize = 5;
const QUICK_ROUNDS: usize = 2;

/// The architectures whose training step is timed.
const TRAINED: [&str; 3] = ["basic", "basic-vel-std-bg", "keynet-vel-std-bg"];

#[derive(Clone, Copy, ValueEnum)]
pub enum Subject {
    /// The metric on one thread, against centred moments in numpy.
    Metric,
    /// Extraction on the CPU with one and two threads, against ONNX Runtime, PyTorch eager and
    /// rten; then `page`.
    Extract,
    /// The Python package's keypoints of a step of ten environments, beside PyTorch eager and ONNX
    /// Runtime.
    Step,
    /// A training step on all threads, against PyTorch eager.
    Train,
    /// The page in headless Chromium: extraction against onnxruntime-web, what is downloaded, the
    /// time to the first TC.
    Page,
    /// `tracklens report` on synthetic logs of 6 x 24 runs of 500 epochs: time and peak memory.
    Report,
    /// The page with 10,000 frames of 256 px: time, size of the tab, scrubbing.
    Size,
}

/// One line that a benchmark prints with `--json`.
#[derive(Debug, PartialEq)]
struct Timing {
    name: String,
    median_ms: f64,
}

/// `quick` is for a look at whether it runs: fewer rounds of `extract` and `page`.
pub fn run(workspace: &Workspace, subject: Subject, quick: bool) -> Result<()> {
    let rounds = if quick { QUICK_ROUNDS } else { ROUNDS };
    match subject {
        Subject::Metric => metric(workspace),
        Subject::Extract => {
            extract::run(workspace, rounds)?;
            page::run(workspace, rounds)
        }
        Subject::Step => step(workspace, rounds),
        Subject::Train => train(workspace),
        Subject::Page => page::run(workspace, rounds),
        Subject::Report => report::run(workspace),
        Subject::Size => size(workspace),
    }
}

fn metric(workspace: &Workspace) -> Result<()> {
    let peers = workspace.root().join("crate/benches/peers");
    let python = setup::python(workspace, "peers", &peers.join("requirements.txt"))?;
    let mut ours = Vec::new();
    let mut theirs = Vec::new();
    for _ in 0..ROUNDS {
        let mut numpy = run::command(&python);
        numpy.arg(peers.join("metric_numpy.py")).arg("--json");
        // By default, numpy's linear algebra takes all cores.
        for threads in ["OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"] {
            numpy.env(threads, "1");
        }
        theirs.push(timing(&mut numpy)?);
        let mut bench = run::cargo();
        bench
            .args([
                "bench",
                "--package=tracklens",
                "--no-default-features",
                "--bench=metric",
                "--",
                "--json",
            ])
            .current_dir(workspace.root());
        ours.push(timing(&mut bench)?);
    }
    println!("{}", comparison(&ours, &theirs)?);
    Ok(())
}

fn train(workspace: &Workspace) -> Result<()> {
    let peers = workspace.root().join("crate/benches/peers");
    let python = setup::python(workspace, "torch", &peers.join("requirements-torch.txt"))?;
    let threads = std::thread::available_parallelism()?.to_string();
    for architecture in TRAINED {
        let arguments = ["--json", architecture, "--threads", &threads];
        let mut ours = Vec::new();
        let mut theirs = Vec::new();
        for _ in 0..ROUNDS {
            let mut torch = run::command(&python);
            torch.arg(peers.join("train_step_torch.py")).args(arguments);
            theirs.push(timing(&mut torch)?);
            let mut bench = run::cargo();
            bench
                .args(["bench", "--package=tracklens", "--bench=train_step", "--"])
                .args(arguments)
                .current_dir(workspace.root());
            ours.push(timing(&mut bench)?);
        }
        println!("{}", comparison(&ours, &theirs)?);
    }
    Ok(())
}

/// In one process, in which the three take turns.
fn step(workspace: &Workspace, rounds: usize) -> Result<()> {
    let folder = workspace.python().join("bench");
    let python = setup::python(workspace, "python-bench", &folder.join("requirements.txt"))?;
    let wheel = python::wheel(workspace)?;
    let anew = ["--no-deps", "--force-reinstall"].map(Path::new);
    setup::pip_install(&python, anew.into_iter().chain([&*wheel]))?;
    let made = extract::encoders(workspace)?;
    for threads in extract::THREADS {
        let mut bench = run::command(&python);
        bench
            .arg(folder.join("encoder_step.py"))
            .arg(made.path())
            .args(["--threads", &threads.to_string()])
            .args(["--rounds", &rounds.to_string()]);
        run::run(&mut bench)?;
    }
    Ok(())
}

fn size(workspace: &Workspace) -> Result<()> {
    setup::chromium()?;
    package::build(workspace, package::Build::Full, false)?;
    site::write(workspace, &workspace.site(), package::Build::Full, false)?;
    let mut cargo = run::cargo();
    cargo
        .args(["bench", "--package", PAGE_TESTS, "--bench=size"])
        .env("TRACKLENS_SITE", workspace.site());
    run::run(cargo.current_dir(workspace.root()))
}

/// Builds the program, and the example that makes checkpoints, in one go: apart, cargo would
/// compile what both depend on twice, since only one of them looks at what tests need.
fn programs(workspace: &Workspace) -> Result<[PathBuf; 2]> {
    let mut cargo = run::cargo();
    cargo.args([
        "build",
        "--release",
        "--package=tracklens",
        "--no-default-features",
    ]);
    cargo.args([
        "--features=cli",
        "--bin=tracklens",
        "--example=random_checkpoint",
    ]);
    run::run(cargo.current_dir(workspace.root()))?;
    Ok([
        workspace.binary("tracklens"),
        workspace.binary("examples/random_checkpoint"),
    ])
}

fn timing(command: &mut Command) -> Result<Timing> {
    let output = run::output(command)?;
    parsed(&output).with_context(|| {
        format!("expected a line {{\"name\": .., \"median_ms\": ..}}, got:\n{output}")
    })
}

fn parsed(output: &str) -> Option<Timing> {
    output.lines().rev().find_map(|line| {
        let value: Value = serde_json::from_str(line).ok()?;
        Some(Timing {
            name: value["name"].as_str()?.to_owned(),
            median_ms: value["median_ms"].as_f64().filter(|time| *time > 0.0)?,
        })
    })
}

fn comparison(ours: &[Timing], theirs: &[Timing]) -> Result<String> {
    let (Some(first), Some(peer)) = (ours.first(), theirs.first()) else {
        bail!("nothing was timed");
    };
    if first.name != peer.name {
        bail!(
            "the benchmark timed {:?}, its peer {:?}",
            first.name,
            peer.name
        );
    }
    let times = |timings: &[Timing]| timings.iter().map(|timing| timing.median_ms).collect();
    let (ours, theirs) = (median(times(ours))?, median(times(theirs))?);
    let ratio = theirs / ours;
    Ok(format!(
        "{}: tracklens {ours:.3} ms, peer {theirs:.3} ms, ratio {ratio:.1}",
        first.name
    ))
}

fn median(mut values: Vec<f64>) -> Result<f64> {
    if values.is_empty() {
        bail!("nothing was timed");
    }
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    Ok(match values.len() % 2 {
        1 => values[middle],
        _ => (values[middle - 1] + values[middle]) / 2.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timings(times: &[f64]) -> Vec<Timing> {
        let timing = |time: &f64| Timing {
            name: "metric".to_owned(),
            median_ms: *time,
        };
        times.iter().map(timing).collect()
    }

    #[test]
    fn the_timing_is_found_among_other_lines() {
        let output = "warming up\n{\"name\":\"metric_t2500_n32_k3\",\"median_ms\":0.25}\n";
        let expected = Timing {
            name: "metric_t2500_n32_k3".to_owned(),
            median_ms: 0.25,
        };
        assert_eq!(parsed(output), Some(expected));
        assert_eq!(parsed("{\"name\":\"metric\"}"), None);
    }

    #[test]
    fn medians_are_compared() -> Result<()> {
        let line = comparison(&timings(&[1.0, 9.0, 2.0]), &timings(&[8.0, 12.0]))?;
        assert_eq!(
            line,
            "metric: tracklens 2.000 ms, peer 10.000 ms, ratio 5.0"
        );
        Ok(())
    }

    #[test]
    fn timings_of_different_cases_are_not_compared() {
        let mut other = timings(&[1.0]);
        other[0].name = "other".to_owned();
        assert!(comparison(&timings(&[1.0]), &other).is_err());
    }
}

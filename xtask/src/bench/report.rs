//! `tracklens report` on synthetic logs of the size of the paper's evaluation.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::run;
use crate::workspace::Workspace;

/// As the paper evaluates: architectures, runs of each, epochs of a run.
const ARCHITECTURES: [&str; 6] = [
    "basic",
    "basic-kp32",
    "dsae",
    "keynet",
    "basic-vel-std-bg",
    "keynet-vel-std-bg",
];
const RUNS: u64 = 24;
const EPOCHS: u32 = 500;

/// How often it is timed.
const ROUNDS: usize = 3;

/// How often the memory is looked at.
const LOOK: Duration = Duration::from_millis(2);

pub fn run(workspace: &Workspace) -> Result<()> {
    let mut build = run::cargo();
    build.args([
        "build",
        "--release",
        "--package=tracklens",
        "--no-default-features",
        "--features=cli",
    ]);
    run::run(build.current_dir(workspace.root()))?;
    let folder = TempDir::new().context("no folder for the runs")?;
    let runs = folder.path().join("runs");
    let size = write_runs(&runs)?;
    let mut times = Vec::new();
    let mut peak = None;
    for _ in 0..ROUNDS {
        let mut command = run::command(workspace.binary("tracklens"));
        command
            .arg("report")
            .arg(&runs)
            .arg("--out")
            .arg(folder.path().join("report"));
        let (time, memory) = timed(&mut command)?;
        times.push(time);
        peak = peak.max(memory);
    }
    times.sort();
    let memory = peak.map_or_else(
        || "not known on this system".to_owned(),
        |bytes| format!("{} MiB", bytes >> 20),
    );
    println!(
        "tracklens report on synthetic logs ({} architectures x {RUNS} runs x {EPOCHS} epochs, {} MiB): median {:.1} s of \
         {ROUNDS}, peak memory {memory}",
        ARCHITECTURES.len(),
        size >> 20,
        times[ROUNDS / 2].as_secs_f64()
    );
    Ok(())
}

/// Writes folders of runs, whose errors are made up, and returns their size in bytes.
fn write_runs(folder: &Path) -> Result<u64> {
    let mut size = 0;
    for (a, architecture) in ARCHITECTURES.iter().enumerate() {
        for seed in 0..RUNS {
            let folder = folder.join(architecture).join(format!("seed-{seed:02}"));
            fs::create_dir_all(&folder)
                .with_context(|| format!("cannot make {}", folder.display()))?;
            let summary = json!({
                "version": env!("CARGO_PKG_VERSION"), "interrupted": false, "epochs": EPOCHS, "best_epoch": EPOCHS,
                "seconds": 1.0, "last": null, "evaluation": null
            });
            for (name, content) in [
                ("config.json", config(architecture, seed).to_string()),
                ("log.jsonl", log(a, seed)),
                ("summary.json", summary.to_string()),
            ] {
                size += content.len() as u64;
                let file = folder.join(name);
                fs::write(&file, content)
                    .with_context(|| format!("cannot write {}", file.display()))?;
            }
        }
    }
    Ok(size)
}

fn config(architecture: &str, seed: u64) -> Value {
    let plain = architecture.replace("-kp32", "");
    let keypoints = match architecture {
        "basic-kp32" => 32,
        name if name.starts_with("keynet") => 30,
        _ => 16,
    };
    let names =
        |range: std::ops::Range<u32>| range.map(|i| format!("seq_{i:04}")).collect::<Vec<_>>();
    json!({
        "version": env!("CARGO_PKG_VERSION"), "git_hash": null, "burn": "0.22.1", "target": "synthetic", "threads": 1,
        "sae": {
            "architecture": plain, "keypoints": keypoints, "encoder_channels": [32, 64, 128], "decoder_channels": [64, 32, 16],
            "input_size": null, "target_size": [64, 64], "sigma": 0.1
        },
        "epochs": EPOCHS, "seed": seed, "batch": 32, "learning_rate": 0.001, "noise": 0.001, "split": { "reference": { "seed": 0 } },
        "velocity_weight": 0.0, "drop_last": true, "validation_frames": "first", "target_filter": "bilinear",
        "input_size": [256, 256], "objects": ["cube", "target", "eef"],
        "training_sequences": names(0..500), "validation_sequences": names(500..750)
    })
}

/// Errors that drop at some epoch or never, with noise.
fn log(architecture: usize, seed: u64) -> String {
    let mut state = 1 + seed + 1000 * architecture as u64;
    let mut random = move || {
        // Knuth's multiplier; the upper bits are good enough for noise.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1_u32 << 24)
    };
    let drops: Vec<f64> = (0..3)
        .map(|k| {
            f64::from(EPOCHS) * (0.1 + random()) * (1.5 + f64::from(k))
                / (1.0 + architecture as f64)
        })
        .collect();
    let mut log = String::new();
    for epoch in 1..=EPOCHS {
        let error = |k: usize, start: f64, end: f64, noise: f64| {
            let share = 1.0 / (1.0 + ((f64::from(epoch) - drops[k]) / 8.0).exp());
            (end + (start - end) * share) * (1.0 + 0.2 * (noise - 0.5))
        };
        let errors = json!({
            "cube": error(0, 0.058, 0.004, random()),
            "target": error(1, 0.052, 0.003, random()),
            "eef": error(2, 0.32, 0.05, random())
        });
        let loss = 0.002 + 0.08 * (-f64::from(epoch) / 20.0).exp() + 1e-4 * random();
        let losses = json!({ "total": loss, "reconstruction": loss, "velocity": 0.0 });
        let line = json!({
            "epoch": epoch, "seconds": 60.0, "training": losses, "validation": losses, "tc": 0.0,
            "errors": { "affine": errors, "identity": errors, "scale-translate": errors }
        });
        // Writing to a String cannot fail.
        let _ = writeln!(log, "{line}");
    }
    log
}

/// The wall time of a command and, where the system reports it, its peak memory.
fn timed(command: &mut Command) -> Result<(Duration, Option<u64>)> {
    let start = Instant::now();
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .context("tracklens cannot be started")?;
    let status = format!("/proc/{}/status", child.id());
    let mut peak = None;
    loop {
        // The kernel keeps the highest value itself.
        if let Some(bytes) = fs::read_to_string(&status)
            .ok()
            .as_deref()
            .and_then(high_water_mark)
        {
            peak = Some(bytes);
        }
        if let Some(status) = child.try_wait().context("tracklens cannot be waited for")? {
            if !status.success() {
                bail!("tracklens report failed: {status}");
            }
            return Ok((start.elapsed(), peak));
        }
        std::thread::sleep(LOOK);
    }
}

/// Bytes of `VmHWM` in a process's status.
fn high_water_mark(status: &str) -> Option<u64> {
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix(" kB")?.trim().parse().ok()?;
    Some(kibibytes << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_of_memory_is_read() {
        assert_eq!(
            high_water_mark("Name:\ta\nVmHWM:\t    2048 kB\nVmRSS:\t 1 kB\n"),
            Some(2 << 20)
        );
        assert_eq!(high_water_mark("Name:\ta\n"), None);
    }

    #[test]
    fn a_log_has_a_line_an_epoch() {
        let log = log(0, 3);
        assert_eq!(log.lines().count(), EPOCHS as usize);
        let last: Value =
            serde_json::from_str(log.lines().last().unwrap_or_default()).unwrap_or_default();
        assert_eq!(last["epoch"], EPOCHS);
    }
}

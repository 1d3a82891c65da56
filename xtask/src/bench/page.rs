//! The page in headless Chromium.

mod server;

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use serde_json::Value;
use server::{Sent, Server};
use tempfile::TempDir;

use super::{median, programs};
use crate::workspace::Workspace;
use crate::{package, run, setup, site};

/// The encoders whose extraction is timed, and the sides of their inputs.
const ENCODERS: [&str; 2] = ["basic", "keynet"];
const SIDES: [u32; 2] = [128, 256];

/// Joint frames, keypoints and objects of the tables that are dropped.
const TABLES: [usize; 3] = [2500, 32, 3];

/// Longer than any benchmark takes.
const PATIENCE: Duration = Duration::from_secs(1800);

/// The page is opened `rounds` times, each time with an empty cache, and as often frames are
/// extracted with both.
pub fn run(workspace: &Workspace, rounds: usize) -> Result<()> {
    let browser = setup::chromium()?;
    let node = setup::node()?;
    let peers = setup::npm_packages(workspace, &node, &setup::PAGE_PEERS)?;
    package::build(workspace, package::Build::Full, false)?;
    site::write(workspace, &workspace.site(), package::Build::Full, false)?;
    let made = TempDir::new().context("no folder for what is measured")?;
    make_encoders(workspace, made.path())?;
    make_tables(made.path())?;

    let bench = workspace.root().join("xtask/bench");
    let folders = |peers: Option<PathBuf>| {
        let mut folders = HashMap::from([
            ("", workspace.site()),
            ("bench", bench.clone()),
            ("made", made.path().to_owned()),
        ]);
        folders.extend(peers.map(|peers| ("peers", peers)));
        folders
    };

    let first_tc = Server::start(folders(None), "bench/first-tc.js", false)?;
    println!(
        "| | first paint, ms | interactive, ms | KiB | first TC, ms | KiB | KiB of example | longest task, ms | frames move after, ms |\n\
         |---|---|---|---|---|---|---|---|---|"
    );
    for (what, query) in [("the example", ""), ("two dropped tables", "?tables")] {
        let mut visits = Vec::new();
        let mut weight = None;
        for _ in 0..rounds {
            visits.push(visit(&browser, &first_tc, &format!("/{query}"))?);
            weight = Some(first_tc.take_sent());
        }
        let (sent, before) = weight.context("no visit")?;
        println!("{}", first_tc_line(what, &visits, &sent, before)?);
    }
    println!(
        "\nMedians of {rounds} visits with an empty cache; what was sent, gzipped. The longest task is that of the page's own thread until \
         the first TC; below 50 ms browsers tell of none (0). Frames with keypoints move so long after the click or the drop.\n"
    );

    let isolated = Server::start(folders(Some(peers)), "", true)?;
    let result = visit(
        &browser,
        &isolated,
        &format!("/bench/extract.html?rounds={rounds}"),
    )?;
    println!("{}", extraction_lines(&result)?);
    println!("\n{}", checkpoint_lines(&result)?);
    Ok(())
}

/// Checkpoints that nobody trained, as `.safetensors`, `.onnx` and PyTorch's `.pth`.
fn make_encoders(workspace: &Workspace, folder: &Path) -> Result<()> {
    let [tracklens, example] = programs(workspace)?;
    for encoder in ENCODERS {
        for side in SIDES {
            let file = folder.join(format!("{encoder}-{side}"));
            let weights = file.with_extension("safetensors");
            run::run(
                run::command(&example)
                    .args([encoder, &side.to_string()])
                    .arg(&weights),
            )?;
            let mut export = run::command(&tracklens);
            export.args(["export", "--checkpoint"]).arg(&weights);
            run::run(export.arg("--onnx").arg(file.with_extension("onnx")))?;
            let mut convert = run::command(&tracklens);
            convert.arg("convert").arg(&weights);
            run::run(convert.arg(file.with_extension("pth")))?;
        }
    }
    Ok(())
}

/// A ground truth and keypoints whose points go round at paces of their own.
fn make_tables(folder: &Path) -> Result<()> {
    let [frames, keypoints, objects] = TABLES;
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut points = String::from("sequence,frame,keypoint,x,y\n");
    for t in 0..frames {
        let (sequence, frame) = (t / 25, t % 25);
        let at = |pace: usize| (t as f64 * (0.1 + pace as f64 * 0.013)).sin_cos();
        for k in 0..objects {
            let (y, x) = at(k);
            writeln!(
                truth,
                "{sequence},{frame},object_{k},{:.6},{:.6}",
                0.5 * x,
                0.5 * y
            )?;
        }
        for n in 0..keypoints {
            let ((s, c), (y, x)) = (at(n), at(n + 1));
            writeln!(
                points,
                "{sequence},{frame},{n},{:.6},{:.6}",
                0.4 * s + 0.1 * x,
                0.4 * c + 0.1 * y
            )?;
        }
    }
    for (name, table) in [("ground_truth.csv", truth), ("keypoints.csv", points)] {
        fs::write(folder.join(name), table).with_context(|| format!("cannot write {name}"))?;
    }
    Ok(())
}

/// Ends the browser when it goes.
struct Browser(Child);

impl Drop for Browser {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Opens a page in a browser that has never been used, and returns what the page finds out.
fn visit(browser: &Path, server: &Server, path: &str) -> Result<Value> {
    let profile = TempDir::new().context("no folder for the browser")?;
    let mut command = Command::new(browser);
    command.args([
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--window-size=1280,1000",
    ]);
    command
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("{}{path}", server.address()))
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let _browser = Browser(
        command
            .spawn()
            .with_context(|| format!("cannot start {}", browser.display()))?,
    );
    let result = server.results().recv_timeout(PATIENCE).with_context(|| {
        format!(
            "{path} found out nothing in {} minutes",
            PATIENCE.as_secs() / 60
        )
    })?;
    let result: Value = serde_json::from_str(&result).context("the page sent no JSON")?;
    if let Some(error) = result["error"].as_str() {
        bail!("{path}: {error}");
    }
    Ok(result)
}

/// A row: medians of the times, and what was sent until then.
fn first_tc_line(what: &str, visits: &[Value], sent: &Sent, before: usize) -> Result<String> {
    let times = |field: &str| {
        median(
            visits
                .iter()
                .filter_map(|visit| visit[field].as_f64())
                .collect(),
        )
    };
    let ours =
        |(path, _): &&(String, usize)| !path.starts_with("bench/") && !path.starts_with("made/");
    let weight = |sent: &[(String, usize)], example: bool| {
        let files = sent
            .iter()
            .filter(ours)
            .filter(|(path, _)| path.starts_with("example/") == example);
        files.map(|(_, bytes)| bytes).sum::<usize>() as f64 / 1024.0
    };
    Ok(format!(
        "| {what} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} |",
        times("paint")?,
        times("interactive")?,
        weight(&sent[..before], false),
        times("milliseconds")?,
        weight(sent, false),
        weight(sent, true),
        times("longest")?,
        times("moving")?,
    ))
}

/// A row a case: medians, and the median of the ratios of pairs.
fn extraction_lines(result: &Value) -> Result<String> {
    let mut lines = format!(
        "In Chromium on {} cores, milliseconds a frame.\n\n| | tracklens, from encoded images | onnxruntime-web, from pixels | \
         ratio | keypoints differ by |\n|---|---|---|---|---|",
        result["cores"]
    );
    for case in result["cases"].as_array().context("no cases")? {
        let times = case["times"].as_array().context("no times")?;
        let pairs: Vec<[f64; 2]> = times
            .iter()
            .filter_map(|pair| Some([pair[0].as_f64()?, pair[1].as_f64()?]))
            .collect();
        let column = |i: usize| median(pairs.iter().map(|pair| pair[i]).collect());
        write!(
            lines,
            "\n| {} | {:.1} | {:.1} | {:.2} | {:.1e} |",
            case["name"].as_str().unwrap_or_default(),
            column(0)?,
            column(1)?,
            median(pairs.iter().map(|pair| pair[1] / pair[0]).collect())?,
            case["difference"].as_f64().unwrap_or(f64::NAN),
        )?;
    }
    Ok(lines)
}

/// The table of what opening a checkpoint takes.
fn checkpoint_lines(result: &Value) -> Result<String> {
    let mut lines = String::from("| checkpoint | MiB | ms until it can extract |\n|---|---|---|");
    for opened in result["checkpoints"].as_array().context("no checkpoints")? {
        let times = opened["times"].as_array().context("no times")?;
        write!(
            lines,
            "\n| {} | {:.1} | {:.0} |",
            opened["file"].as_str().unwrap_or_default(),
            opened["mebibytes"].as_f64().unwrap_or(f64::NAN),
            median(times.iter().filter_map(Value::as_f64).collect())?,
        )?;
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    use serde_json::json;

    #[test]
    fn medians_and_ratios_of_pairs_are_told() -> Result<()> {
        let times = json!([[1.0, 4.0], [2.0, 6.0], [4.0, 8.0]]);
        let result = json!({ "cores": 2, "cases": [{ "name": "basic 128", "difference": 2e-6, "times": times }] });
        let lines = extraction_lines(&result)?;
        assert!(
            lines.ends_with("\n| basic 128 | 2.0 | 6.0 | 3.00 | 2.0e-6 |"),
            "{lines}"
        );
        assert!(extraction_lines(&json!({ "cores": 2, "cases": [{ "times": [] }] })).is_err());
        Ok(())
    }

    #[test]
    fn the_time_to_open_a_checkpoint_is_told() -> Result<()> {
        let opened =
            json!({ "file": "keynet-256.pth", "mebibytes": 12.34, "times": [30.0, 10.0, 20.0] });
        let lines = checkpoint_lines(&json!({ "checkpoints": [opened] }))?;
        assert!(
            lines.ends_with("\n| keynet-256.pth | 12.3 | 20 |"),
            "{lines}"
        );
        assert!(checkpoint_lines(&json!({})).is_err());
        Ok(())
    }

    #[test]
    fn the_weight_of_the_page_is_told_without_what_the_benchmark_adds() -> Result<()> {
        let sent = [
            ("index.html", 1024),
            ("bench/first-tc.js", 9999),
            ("pkg/a.wasm", 2048),
            ("example/w", 4096),
        ];
        let sent: Sent = sent.map(|(path, bytes)| (path.to_owned(), bytes)).to_vec();
        let visit = json!({
            "paint": 30.0, "interactive": 50.0, "milliseconds": 200.0, "longest": 60.0, "moving": 240.0
        });
        let line = first_tc_line("the example", &[visit], &sent, 2)?;
        assert_eq!(
            line,
            "| the example | 30 | 50 | 1 | 200 | 3 | 4 | 60 | 240 |"
        );
        Ok(())
    }
}

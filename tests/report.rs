//! `tracklens report` by the real binary on run folders that the tests write.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};
use tracklens::metric::stats::{Sample, trimmed_mean};

const OBJECTS: [&str; 2] = ["cube", "eef"];

fn report(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tracklens"))
        .arg("report")
        .args(arguments)
        .output()
        .expect("the binary runs")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// The error of an object in a run at its end.
fn error(architecture: &str, seed: u64, object: usize) -> f64 {
    let base = if architecture == "basic" { 0.04 } else { 0.004 };
    base * (1.0 + ((seed * 7 + object as u64 * 3) % 5) as f64 / 4.0) * (1.0 + 9.0 * object as f64)
}

fn config(architecture: &str, seed: u64, epochs: u32) -> Value {
    json!({
        "version": "0.1.0", "git_hash": null, "burn": "0.22.1", "target": "x86_64-linux", "threads": 1,
        "sae": {
            "architecture": architecture, "keypoints": 16, "encoder_channels": [32, 64, 128],
            "encoder_kernels": [3, 3, 3], "decoder_channels": [64, 32, 16], "decoder_kernels": [3, 3, 3],
            "input_size": null, "target_size": [64, 64], "temperature": 1.0, "trained_temperature": false, "sigma": 0.1,
            "sigma_per_keypoint": false, "sigma_limit": null
        },
        "epochs": epochs, "seed": seed, "batch": 8, "learning_rate": 0.001, "noise": 0.001,
        "split": { "training": 0.5, "validation": 0.25 }, "velocity_weight": 0.0, "drop_last": true,
        "validation_frames": "first", "target_filter": "bilinear", "input_size": [64, 64], "objects": OBJECTS,
        "training_sequences": ["a", "b"], "validation_sequences": ["c"]
    })
}

fn write_run(folder: &Path, architecture: &str, seed: u64, epochs: u32) {
    fs::create_dir_all(folder).expect("a folder");
    let mut log = String::new();
    for epoch in 1..=epochs {
        let factor = 1.0 + f64::from(epochs - epoch) / 3.0;
        let errors: Value = OBJECTS
            .iter()
            .enumerate()
            .map(|(k, name)| ((*name).to_owned(), json!(error(architecture, seed, k) * factor)))
            .collect::<serde_json::Map<_, _>>()
            .into();
        let losses = json!({ "total": 0.01 * factor, "reconstruction": 0.01 * factor, "velocity": 0.0 });
        let line = json!({
            "epoch": epoch, "seconds": 1.5, "training": losses, "validation": losses, "tc": 0.5,
            "errors": { "affine": errors, "identity": errors, "scale-translate": errors }
        });
        log += &format!("{line}\n");
    }
    let summary = json!({
        "version": "0.1.0", "interrupted": false, "epochs": epochs, "best_epoch": epochs, "seconds": 9.0,
        "last": null, "evaluation": null
    });
    fs::write(
        folder.join("config.json"),
        config(architecture, seed, epochs).to_string(),
    )
    .expect("written");
    fs::write(folder.join("log.jsonl"), log).expect("written");
    fs::write(folder.join("summary.json"), summary.to_string()).expect("written");
}

/// Two architectures of five runs, as a sweep leaves them.
fn sweep(folder: &Path) {
    for architecture in ["basic", "keynet-vel-std-bg"] {
        for seed in 0..5 {
            write_run(
                &folder.join(format!("{architecture}/seed-{seed:02}")),
                architecture,
                seed,
                4,
            );
        }
    }
}

fn read(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("report.json")).expect("a report")).expect("JSON")
}

#[test]
fn the_numbers_are_the_statistics_of_the_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    sweep(&runs);
    let done = report(&[&text(&runs), "--out", &text(&out), "--resamples", "300"]);
    assert!(done.status.success(), "{}", stderr(&done));
    let found = read(&out);
    assert_eq!(found["schema"], "tracklens/report/1");
    for (group, name) in found["groups"]
        .as_array()
        .expect("groups")
        .iter()
        .zip(["basic", "keynet-vel-std-bg"])
    {
        assert!(
            group["name"]
                .as_str()
                .expect("a name")
                .starts_with(name.split('-').next().expect("a family"))
        );
        assert_eq!((&group["complete"], &group["epochs"]), (&json!(5), &json!(4)));
        for (k, threshold) in [0.015, 0.1].into_iter().enumerate() {
            let errors: Vec<f64> = (0..5).map(|seed| error(name, seed, k)).collect();
            let sample = Sample::of(&errors).expect("a sample");
            let object = &group["objects"][k];
            let tracked = errors.iter().filter(|e| **e <= threshold).count() as f64 / 5.0;
            assert_eq!(object["tc"], tracked);
            // The log holds the errors as JSON, digit by digit.
            assert_eq!(object["mean"], sample.mean);
            assert_eq!(object["quartiles"][2], sample.median());
            assert_eq!(object["iqm_trimmed"], trimmed_mean(&errors).expect("a mean"));
            let interval = [0, 1].map(|end| object["iqm_interval"][end].as_f64().expect("a number"));
            assert!(interval[0] <= sample.median() && sample.median() <= interval[1]);
        }
    }
    let improvement = found["improvement"].as_array().expect("pairs");
    assert_eq!(improvement.len(), 4);
    assert_eq!(
        (&improvement[0]["object"], &improvement[0]["probability"]),
        (&json!("cube"), &json!(0.0))
    );

    let rows = fs::read_to_string(out.join("runs.csv")).expect("a table");
    assert_eq!(rows.lines().count(), 11);
    assert!(rows.starts_with("group,run,seed,tc,reconstruction,error_cube,error_eef\n"));
    assert_eq!(
        fs::read_to_string(out.join("errors.csv"))
            .expect("a table")
            .lines()
            .count(),
        5
    );
    let page = fs::read_to_string(out.join("report.html")).expect("a page");
    assert!(page.contains("keynet") && page.matches("<svg").count() == 6);
    // Self-contained: namespaces are names, not addresses that anything is fetched from.
    let addresses = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!addresses.contains("http") && !page.contains("<script") && !page.contains(" src="));
    for name in [
        "tracking-capability",
        "boxplots",
        "performance-profiles",
        "reconstruction-loss",
        "errors-basic",
    ] {
        let svg = fs::read_to_string(out.join(format!("{name}.svg"))).expect("a figure");
        assert!(svg.starts_with("<svg") && svg.contains("</text>"), "{name}");
        let png = image(&out.join(format!("{name}.png")));
        // There is ink in the row of the legend (five letters have some 80 dark pixels): its text does not hang on the fonts
        // of the machine.
        assert!(png > 50, "{name}: {png} dark pixels in the legend");
    }

    // Given thresholds count.
    let strict = report(&[&text(&runs), "--out", &text(&out), "--threshold", "cube=1e-9"]);
    assert!(strict.status.success(), "{}", stderr(&strict));
    assert_eq!(read(&out)["groups"][1]["objects"][0]["tc"], 0.0);
}

/// Dark pixels in the upper 60 rows right of the first swatch.
fn image(path: &Path) -> usize {
    let frame = tracklens::data::Frame::decode(&fs::read(path).expect("a figure")).expect("a PNG");
    let tracklens::data::Pixels::Bytes(bytes) = frame.pixels() else {
        panic!("bytes")
    };
    let width = frame.width() as usize;
    let is_dark = |at: &usize| bytes[3 * at..3 * at + 3].iter().all(|v| *v < 90);
    (0..60 * width)
        .filter(|at| at % width > 70)
        .filter(is_dark)
        .count()
}

#[test]
fn what_does_not_count_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    sweep(&runs);
    // A log that a crash cut, a run that was stopped, one that has not started, another input size.
    let cut = runs.join("basic/seed-00/log.jsonl");
    let log = fs::read(&cut).expect("a log");
    fs::write(&cut, &log[..log.len() - 20]).expect("written");
    let partial = runs.join("basic/seed-05.partial");
    write_run(&partial, "basic", 5, 4);
    fs::remove_file(partial.join("summary.json")).expect("removed");
    fs::write(partial.join("log.jsonl"), "").expect("written");
    write_run(&runs.join("basic-long/seed-00"), "basic", 0, 6);
    let done = report(&[&text(&runs), "--out", &text(&out)]);
    assert!(done.status.success(), "{}", stderr(&done));
    assert!(
        stderr(&done).contains("basic/seed-00: its log breaks off (line 4: "),
        "{}",
        stderr(&done)
    );
    assert!(
        stderr(&done).contains("seed-05.partial: it stopped after epoch 0 of 4"),
        "{}",
        stderr(&done)
    );
    let found = read(&out);
    let groups = found["groups"].as_array().expect("groups");
    let names: Vec<&str> = groups
        .iter()
        .map(|g| g["name"].as_str().expect("a name"))
        .collect();
    assert_eq!(names[..2], ["basic (epochs 4)", "basic (epochs 6)"]);
    assert_eq!(
        (
            &groups[0]["complete"],
            groups[0]["incomplete"].as_array().map(Vec::len)
        ),
        (&json!(4), Some(2))
    );
    let page = fs::read_to_string(out.join("report.html")).expect("a page");
    assert!(page.contains("Runs that do not count") && page.contains("its log breaks off"));
}

#[test]
fn what_cannot_be_reported_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out, empty] = ["runs", "out", "empty"].map(|name| folder.path().join(name));
    fs::create_dir(&empty).expect("a folder");
    let none = report(&[&text(&empty), "--out", &text(&out)]);
    assert_eq!(none.status.code(), Some(5));
    assert!(stderr(&none).contains("there is no run"), "{}", stderr(&none));

    write_run(&runs.join("a"), "basic", 0, 4);
    fs::remove_file(runs.join("a/summary.json")).expect("removed");
    let unfinished = report(&[&text(&runs), "--out", &text(&out)]);
    assert!(
        stderr(&unfinished).contains("none of the 1 runs is complete"),
        "{}",
        stderr(&unfinished)
    );

    write_run(&runs.join("b"), "basic", 1, 4);
    let mut other = config("basic", 2, 4);
    other["objects"] = json!(["ball"]);
    write_run(&runs.join("c"), "basic", 2, 4);
    fs::write(runs.join("c/config.json"), other.to_string()).expect("written");
    let mixed = report(&[&text(&runs), "--out", &text(&out)]);
    assert_eq!(mixed.status.code(), Some(4));
    assert!(
        stderr(&mixed).contains("different data sets") && stderr(&mixed).contains("ball"),
        "{}",
        stderr(&mixed)
    );

    fs::write(runs.join("c/config.json"), "{").expect("written");
    let damaged = report(&[&text(&runs), "--out", &text(&out)]);
    assert!(
        stderr(&damaged).contains("c/config.json: "),
        "{}",
        stderr(&damaged)
    );
    fs::remove_dir_all(runs.join("c")).expect("removed");
    let unknown = report(&[&text(&runs), "--out", &text(&out), "--threshold", "ball=1"]);
    assert!(
        stderr(&unknown).contains("the runs have the objects cube, eef"),
        "{}",
        stderr(&unknown)
    );
    let file = folder.path().join("file");
    fs::write(&file, "").expect("written");
    let no_folder = report(&[&text(&runs), "--out", &text(&file)]);
    assert_eq!(no_folder.status.code(), Some(1));
    assert!(!out.exists(), "nothing was written");
}

//! `tracklens report` by the real binary on run folders that the tests write.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::runs::{config, error, sweep, write_run};

use serde_json::{Value, json};
use tracklens::metric::stats::{Sample, trimmed_mean};

use crate::binary::stderr;

fn report(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tracklens"))
        .arg("report")
        .args(arguments)
        .output()
        .expect("the binary runs")
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
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
        assert_eq!(
            (&group["complete"], &group["epochs"]),
            (&json!(5), &json!(4))
        );
        for (k, threshold) in [0.015, 0.1].into_iter().enumerate() {
            let errors: Vec<f64> = (0..5).map(|seed| error(name, seed, k)).collect();
            let sample = Sample::of(&errors).expect("a sample");
            let object = &group["objects"][k];
            let tracked = errors.iter().filter(|e| **e <= threshold).count() as f64 / 5.0;
            assert_eq!(object["tc"], tracked);
            // The log holds the errors as JSON, digit by digit.
            assert_eq!(object["mean"], sample.mean);
            assert_eq!(object["quartiles"][2], sample.median());
            assert_eq!(
                object["iqm_trimmed"],
                trimmed_mean(&errors).expect("a mean")
            );
            let interval =
                [0, 1].map(|end| object["iqm_interval"][end].as_f64().expect("a number"));
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
    assert!(rows.starts_with(
        "group,run,architecture,seed,epochs,complete,tc,reconstruction,error_cube,error_eef,reason\n"
    ));
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
        // There is ink in the row of the legend (five letters have some 80 dark pixels): its text
        // does not hang on the fonts of the machine.
        assert!(png > 50, "{name}: {png} dark pixels in the legend");
    }

    // Every statistic of the errors is in every table.
    let markdown = fs::read_to_string(out.join("report.md")).expect("a report");
    let sample = Sample::of(
        &(0..5)
            .map(|seed| error("basic", seed, 0))
            .collect::<Vec<_>>(),
    )
    .expect("a sample");
    let [_, q1, median, q3, _] = sample.quartiles;
    let row = format!(
        "| basic | cube | {:.4} | {:.2e} | {median:.4} | {q1:.4}–{q3:.4} |",
        sample.mean, sample.variance
    );
    assert!(markdown.contains(&row), "{row} in {markdown}");
    for column in ["mean", "variance", "median", "quartiles"] {
        assert!(page.contains(&format!("<th>{column}</th>")), "{column}");
    }

    // Given thresholds count.
    let strict = report(&[
        &text(&runs),
        "--out",
        &text(&out),
        "--threshold",
        "cube=1e-9",
    ]);
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
fn groups_of_one_run_have_errors_and_no_statistics() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    for architecture in ["basic", "keynet-vel-std-bg"] {
        write_run(&runs.join(architecture), architecture, 0, 4);
    }
    let done = report(&[&text(&runs), "--out", &text(&out)]);
    assert!(done.status.success(), "{}", stderr(&done));
    let page = fs::read_to_string(out.join("report.html")).expect("a page");
    let markdown = fs::read_to_string(out.join("report.md")).expect("a report");
    for name in ["variance", "IQM", "quartiles", "Probability of improvement"] {
        assert!(
            !page.contains(&format!("<th>{name}")) && !markdown.contains(&format!("| {name}")),
            "{name}"
        );
    }
    // The keynet's cube is up to its threshold, the basic one's is not.
    let [basic, keynet] =
        ["basic", "keynet-vel-std-bg"].map(|name| format!("{:.4}", error(name, 0, 0)));
    assert!(markdown.contains(&format!("| {basic} |")), "{markdown}");
    assert!(markdown.contains(&format!("| {keynet} ✓ |")), "{markdown}");
    assert!(
        page.contains(&format!("<td class=\"good\">{keynet} ✓</td>")),
        "{page}"
    );
    assert!(!out.join("tracking-capability.svg").exists() && out.join("boxplots.svg").exists());
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
    assert!(
        stderr(&none).contains("there is no run"),
        "{}",
        stderr(&none)
    );

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
    let no_setting = report(&[&text(&runs), "--out", &text(&out), "--group-by", "epoch"]);
    assert!(
        stderr(&no_setting)
            .contains("has no setting `epoch` to group by; expected one of architecture, version,"),
        "{}",
        stderr(&no_setting)
    );
    assert!(!out.exists(), "nothing was written");
}

#[test]
fn failed_and_unreadable_runs_are_counted_and_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    sweep(&runs);
    // One failed in the middle, one before it had a configuration, one has a configuration that
    // nobody can read.
    let failed = runs.join("basic/seed-05.partial");
    write_run(&failed, "basic", 5, 4);
    fs::remove_file(failed.join("summary.json")).expect("removed");
    fs::write(
        failed.join("error.txt"),
        "the loss is not a number in epoch 5\n",
    )
    .expect("written");
    let early = runs.join("dsae/seed-00.partial");
    fs::create_dir_all(&early).expect("a folder");
    fs::write(early.join("error.txt"), "data: there is no frame\n").expect("written");
    let damaged = runs.join("keynet-vel-std-bg/seed-06");
    write_run(&damaged, "keynet-vel-std-bg", 6, 4);
    fs::write(damaged.join("config.json"), "{").expect("written");

    let done = report(&[&text(&runs), "--out", &text(&out)]);
    assert!(done.status.success(), "{}", stderr(&done));
    assert!(
        stderr(&done).contains("10 complete runs in 2 groups, 3 more that do not count"),
        "{}",
        stderr(&done)
    );
    let page = fs::read_to_string(out.join("report.html")).expect("a page");
    let rows = fs::read_to_string(out.join("runs.csv")).expect("a table");
    for reason in [
        "it failed: the loss is not a number in epoch 5, after epoch 4 of 4",
        "it failed: data: there is no frame",
        "config.json cannot be read: EOF while parsing an object",
    ] {
        assert!(stderr(&done).contains(reason), "{}", stderr(&done));
        assert!(page.contains(reason) && rows.contains(reason), "{reason}");
    }
    assert!(page.contains("3 more that <a href=\"#not-counted\">do not count</a>"));
    assert_eq!(read(&out)["unread"].as_array().map(Vec::len), Some(2));

    // Nothing but such folders.
    let none = report(&[
        &text(&runs.join("dsae")),
        "--out",
        &text(&folder.path().join("none")),
    ]);
    assert_eq!(none.status.code(), Some(5));
    assert!(
        stderr(&none).contains("none of the 1 runs can be read"),
        "{}",
        stderr(&none)
    );
}

#[test]
fn a_run_without_its_configuration_or_with_a_damaged_file_is_listed() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    for seed in 0..4 {
        write_run(&runs.join(format!("r{seed}")), "basic", seed, 4);
    }
    fs::remove_file(runs.join("r0/config.json")).expect("removed");
    fs::remove_file(runs.join("r1/summary.json")).expect("removed");
    fs::create_dir(runs.join("r1/summary.json")).expect("a folder");
    fs::write(runs.join("r2/summary.json"), "{").expect("written");
    let done = report(&[&text(&runs), "--out", &text(&out)]);
    assert!(done.status.success(), "{}", stderr(&done));
    for part in [
        "1 complete runs in 1 groups, 3 more that do not count",
        "r0: config.json is missing",
        "r1: it stopped after epoch 4 of 4",
        "r2: summary.json cannot be read",
    ] {
        assert!(stderr(&done).contains(part), "{}", stderr(&done));
    }
}

#[test]
fn tables_are_written_as_latex() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    sweep(&runs);
    let done = report(&[&text(&runs), "--out", &text(&out)]);
    assert!(done.status.success(), "{}", stderr(&done));
    let latex = fs::read_to_string(out.join("tables.tex")).expect("tables");
    for name in ["capability", "errors", "improvement", "runs"] {
        assert!(latex.contains(&format!("\\label{{tab:{name}}}")), "{name}");
    }
    let mean = read(&out)["groups"][0]["objects"][0]["mean"].as_f64();
    let mean = format!("& {:.4} &", mean.expect("a mean"));
    assert!(latex.contains(&mean), "{mean}: {latex}");
    assert_eq!(latex.matches("\\toprule").count(), 4);
    assert_eq!(latex.matches("\\bottomrule").count(), 4);
}

#[test]
fn runs_of_other_data_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    let with_sequences = |name: &str, architecture: &str, seed: u64, sequences: [&str; 3]| {
        write_run(&runs.join(name), architecture, seed, 4);
        let mut config = config(architecture, seed, 4);
        config["training_sequences"] = json!(sequences[..2]);
        config["validation_sequences"] = json!(sequences[2..]);
        fs::write(runs.join(name).join("config.json"), config.to_string()).expect("written");
    };
    with_sequences("a", "basic", 0, ["a", "b", "c"]);
    // Another seed divides the same sequences in another way.
    with_sequences("b", "basic", 1, ["d", "b", "a"]);
    assert!(
        report(&[&text(&runs), "--out", &text(&out)])
            .status
            .success()
    );
    for (architecture, seed, sequences, reason) in [
        (
            "dsae",
            0,
            ["a", "c", "b"],
            "a and c: with one seed and split they are of different sequences",
        ),
        (
            "basic",
            2,
            ["x", "y", "z"],
            "a and c: they have no sequence in common",
        ),
    ] {
        with_sequences("c", architecture, seed, sequences);
        let refused = report(&[&text(&runs), "--out", &text(&out)]);
        assert_eq!(refused.status.code(), Some(4));
        let told = stderr(&refused).replace(&format!("{}/", text(&runs)), "");
        assert!(
            told.contains("2 different data sets") && told.contains(reason),
            "{told}"
        );
    }
}

#[test]
fn groups_follow_settings_names_or_one_setting() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    for seed in 0..2 {
        write_run(&runs.join(format!("short/seed-{seed}")), "basic", seed, 4);
        write_run(&runs.join(format!("long/seed-{seed}")), "basic", seed, 6);
        write_run(
            &runs.join(format!("best/seed-{seed}")),
            "keynet-vel-std-bg",
            seed,
            6,
        );
    }
    for (by, expected) in [
        (
            "settings",
            vec![
                "basic (epochs 4)",
                "basic (epochs 6)",
                "keynet-kp16-vel-std-bg",
            ],
        ),
        ("architecture", vec!["basic", "keynet-kp16-vel-std-bg"]),
        ("name", vec!["best", "long", "short"]),
        ("epochs", vec!["epochs 4", "epochs 6"]),
    ] {
        let done = report(&[&text(&runs), "--out", &text(&out), "--group-by", by]);
        assert!(done.status.success(), "{}", stderr(&done));
        let found = read(&out);
        let names: Vec<&Value> = found["groups"]
            .as_array()
            .expect("groups")
            .iter()
            .map(|g| &g["name"])
            .collect();
        assert_eq!(names, expected, "{by}");
    }
    // What a wider group hides is said.
    let done = report(&[
        &text(&runs),
        "--out",
        &text(&out),
        "--group-by",
        "architecture",
    ]);
    let note = "basic has runs of different numbers of epochs: 4, 6";
    assert!(stderr(&done).contains(note), "{}", stderr(&done));
}

#[test]
fn curves_are_smoothed_as_the_paper_smooths_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    write_run(&runs, "basic", 0, 41);
    let log = fs::read_to_string(runs.join("log.jsonl")).expect("a log");
    let lines = log.lines().enumerate().map(|(i, line)| {
        let mut line: Value = serde_json::from_str(line).expect("JSON");
        line["errors"]["affine"]["cube"] = json!(if i == 20 { 1.0 } else { 0.02 });
        format!("{line}\n")
    });
    fs::write(runs.join("log.jsonl"), lines.collect::<String>()).expect("written");
    let done = report(&[&text(&runs), "--out", &text(&out)]);
    assert!(done.status.success(), "{}", stderr(&done));
    // A Gaussian of 2.5 epochs leaves 0.16 of the peak: the axis ends at 1. Along the logarithm it
    // would be 0.037, and 0.1.
    let svg = fs::read_to_string(out.join("errors-basic.svg")).expect("a figure");
    let cube = svg
        .split(">\ncube\n<")
        .nth(1)
        .and_then(|rest| rest.split(">\neef\n<").next());
    let cube = cube.expect("the panel of the cube");
    assert!(
        cube.contains(">\n1\n<") && cube.contains(">\n0.1\n<"),
        "{cube}"
    );
}

#[test]
fn a_full_disk_is_said_and_leaves_the_last_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    sweep(&runs);
    assert!(
        report(&[&text(&runs), "--out", &text(&out)])
            .status
            .success()
    );
    let before = fs::read(out.join("report.html")).expect("a page");
    // A limit on the size of files stands for it: writing fails in the middle of a file in the same
    // way.
    let script = "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\"";
    let full = Command::new("sh")
        .args(["-c", script, env!("CARGO_BIN_EXE_tracklens"), "report"])
        .args([&text(&runs), "--out", &text(&out)])
        .output()
        .expect("a shell");
    assert_eq!(full.status.code(), Some(1), "{}", stderr(&full));
    assert!(
        stderr(&full).contains("File too large"),
        "{}",
        stderr(&full)
    );
    assert_eq!(fs::read(out.join("report.html")).expect("a page"), before);
    let names = fs::read_dir(&out)
        .expect("a folder")
        .map(|e| e.expect("a file").file_name());
    assert!(
        names
            .into_iter()
            .all(|name| !name.to_string_lossy().starts_with(".tmp"))
    );
}

/// The frames of the tests, and a run whose checkpoint is that of the page's example.
fn run_with_checkpoint(folder: &Path) -> (String, String) {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/panda_push");
    let checkpoint =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../web/example/checkpoint.safetensors");
    let evaluated = Command::new(env!("CARGO_BIN_EXE_tracklens"))
        .args([
            "eval",
            "--json",
            "--quiet",
            "--frames",
            &text(&tests),
            "--checkpoint",
            &text(&checkpoint),
        ])
        .output()
        .expect("the binary runs");
    assert!(evaluated.status.success(), "{}", stderr(&evaluated));
    let evaluation: Value = serde_json::from_slice(&evaluated.stdout).expect("JSON");
    let run = folder.join("run");
    write_run(&run, "basic", 0, 4);
    let objects = json!(["cube", "target", "eef"]);
    let mut config = config("basic", 0, 4);
    config["objects"] = objects.clone();
    config["training_sequences"] = json!(["seq_0000"]);
    config["validation_sequences"] = json!(["seq_0001", "seq_0012"]);
    fs::write(run.join("config.json"), config.to_string()).expect("written");
    let log = fs::read_to_string(run.join("log.jsonl"))
        .expect("a log")
        .replace("\"cube\":", "\"target\":0.01,\"cube\":");
    fs::write(run.join("log.jsonl"), log).expect("written");
    let mut summary: Value =
        serde_json::from_slice(&fs::read(run.join("summary.json")).expect("a summary"))
            .expect("JSON");
    summary["evaluation"] = evaluation;
    fs::write(run.join("summary.json"), summary.to_string()).expect("written");
    fs::copy(checkpoint, run.join("checkpoint_final.safetensors")).expect("copied");
    (text(&run), text(&tests))
}

#[test]
fn trajectories_are_drawn_on_their_frames() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let (run, frames) = run_with_checkpoint(folder.path());
    let done = report(&[&run, "--out", &text(&out), "--frames", &frames]);
    assert!(done.status.success(), "{}", stderr(&done));
    let svg = fs::read_to_string(out.join("trajectories-basic.svg")).expect("a figure");
    // Two validation sequences, three objects; three lines each, every one with its edge.
    assert_eq!(svg.matches("<image ").count(), 2);
    assert_eq!(svg.matches("<use ").count(), 6);
    assert_eq!(svg.matches("<polyline").count(), 36);
    for word in [
        "seq_0001",
        "seq_0012",
        "cube",
        "target",
        "eef",
        "tracked",
        "ground truth",
    ] {
        assert!(svg.contains(word), "{word}");
    }
    assert!(!svg.contains("seq_0000"));
    let page = fs::read_to_string(out.join("report.html")).expect("a page");
    assert!(page.contains("id=\"trajectories-basic\"") && page.contains("data:image/png;base64,"));

    // The frames are in the PNG: many colours, where the lines alone have four.
    let png = tracklens::data::Frame::decode(
        &fs::read(out.join("trajectories-basic.png")).expect("a figure"),
    );
    let png = png.expect("a PNG");
    let colours: std::collections::HashSet<&[u8]> = match png.pixels() {
        tracklens::data::Pixels::Bytes(bytes) => bytes.chunks(3).collect(),
        tracklens::data::Pixels::Floats(_) => panic!("bytes"),
    };
    assert!(colours.len() > 1000, "{} colours", colours.len());

    // Chosen ones, also of the training, which is said.
    let chosen = report(&[
        &run,
        "--out",
        &text(&out),
        "--frames",
        &frames,
        "--sequences",
        "seq_0000",
    ]);
    assert!(chosen.status.success(), "{}", stderr(&chosen));
    let svg = fs::read_to_string(out.join("trajectories-basic.svg")).expect("a figure");
    assert!(svg.contains("seq_0000 (trained on)") && !svg.contains("seq_0001"));
}

#[test]
fn what_trajectories_lack_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let (run, frames) = run_with_checkpoint(folder.path());
    let unknown = report(&[
        &run,
        "--out",
        &text(&out),
        "--frames",
        &frames,
        "--sequences",
        "seq_9",
    ]);
    assert_eq!(unknown.status.code(), Some(4));
    assert!(
        stderr(&unknown).contains("no sequence `seq_9` among the frames"),
        "{}",
        stderr(&unknown)
    );
    let needs = report(&[&run, "--out", &text(&out), "--sequences", "seq_0001"]);
    assert_eq!(needs.status.code(), Some(2));
    // The tables and the other figures are made all the same.
    fs::remove_file(Path::new(&run).join("checkpoint_final.safetensors")).expect("removed");
    let without = report(&[&run, "--out", &text(&out), "--frames", &frames]);
    assert!(without.status.success(), "{}", stderr(&without));
    let told = stderr(&without);
    assert!(
        told.contains("warning: no trajectories of basic: ")
            && told.contains("checkpoint_final.safetensors"),
        "{told}"
    );
    assert!(out.join("report.html").exists());
}

#[test]
fn published_numbers_stand_beside_ours() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out, file] = ["runs", "out", "published.toml"].map(|name| folder.path().join(name));
    sweep(&runs);
    let published = r#"
name = "paper"
citation = "A paper (2024)"
setting = "24 runs"
[architectures.basic]
tc = 0.181
[architectures.keynet-kp16-vel-std-bg]
tc = 0.986
objects = { eef = 0.958 }
[[claims]]
text = "The modifications help"
place = "section 5.1"
statistic = "mean-error"
objects = ["cube", "eef"]
first = "keynet-kp16-vel-std-bg"
than = ["basic", "dsae"]
[[claims]]
text = "Basic is best"
place = "nowhere"
statistic = "tc"
first = "basic"
than = ["keynet-kp16-vel-std-bg"]
"#;
    fs::write(&file, published).expect("written");
    let arguments = [
        &text(&runs),
        "--out",
        &text(&out),
        "--reference",
        &text(&file),
    ]
    .map(str::to_owned);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = report(&arguments);
    assert!(done.status.success(), "{}", stderr(&done));
    let found = &read(&out)["reference"];
    assert_eq!(
        found["own_setting"],
        "5 runs an architecture, 4 epochs, inputs of 64 x 64 px"
    );
    let best = &found["rows"][1];
    assert_eq!(
        (&best["tc"]["published"], &best["objects"][1]["published"]),
        (&json!(0.986), &json!(0.958))
    );
    assert_eq!(best["tc"]["own"], read(&out)["groups"][1]["tc"]);
    assert_eq!(best["objects"][0]["published"], Value::Null);
    let held: Vec<bool> = found["claims"][0]["comparisons"]
        .as_array()
        .expect("comparisons")
        .iter()
        .map(|c| c["holds"].as_bool().expect("a verdict"))
        .collect();
    assert_eq!(held, [true, true]);
    let markdown = fs::read_to_string(out.join("report.md")).expect("a report");
    assert!(
        markdown.contains(
            "| The modifications help | section 5.1 | mean error | holds; no runs of dsae |"
        ),
        "{markdown}"
    );
    assert!(
        markdown.contains("| Basic is best | nowhere | mean TC | does not hold |"),
        "{markdown}"
    );
    assert!(
        markdown.contains("| 0.986 / 1.000 [") && markdown.contains("| – / 1.000"),
        "{markdown}"
    );

    fs::write(&file, published.replace("place", "plaice")).expect("written");
    let wrong = report(&arguments);
    assert_eq!(wrong.status.code(), Some(3));
    assert!(
        stderr(&wrong).contains("line 12") && stderr(&wrong).contains("unknown field `plaice`"),
        "{}",
        stderr(&wrong)
    );
}

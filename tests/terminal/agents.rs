//! `tracklens report` on run folders of agents, against rliable and SciPy
//! (`tests/golden/make_agents.py`).

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::agent_runs::{fixture, write_agent, write_agents};
use crate::binary::{stderr, tracklens};
use crate::runs::{error, write_run};

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// Reports on `runs` and reads `report.json`.
fn report(runs: &Path, out: &Path, more: &[&str]) -> Value {
    let [runs, out_text] = [runs, out].map(text);
    let arguments = ["report", &runs, "--out", &out_text];
    let done = tracklens(&[&arguments, more].concat());
    assert!(done.status.success(), "{}", stderr(&done));
    serde_json::from_slice(&fs::read(out.join("report.json")).expect("a report")).expect("JSON")
}

fn numbers(value: &Value) -> Vec<f64> {
    let values = value.as_array().expect("numbers").iter();
    values.map(|v| v.as_f64().expect("a number")).collect()
}

fn named<'a>(list: &'a Value, name: &str) -> &'a Value {
    let mut all = list.as_array().expect("a list").iter();
    let found = all.find(|one| one["name"] == name);
    found.unwrap_or_else(|| panic!("{name} in {list}"))
}

#[test]
fn success_over_steps_is_that_of_rliable() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    write_agents(&runs);
    let found = report(&runs, &out, &["--resamples", "20000"]);
    for (name, expected) in fixture()["groups"].as_object().expect("groups") {
        let group = named(&found["agents"]["groups"], name);
        assert_eq!(
            (&group["complete"], &group["steps"]),
            (&json!(5), &json!(12000))
        );
        let curve = group["curve"].as_array().expect("a curve");
        let intervals = expected["interval"].as_array().expect("intervals");
        for ((point, iqm), interval) in curve.iter().zip(numbers(&expected["iqm"])).zip(intervals) {
            // Both are sums of some dozen products in f64, in different orders.
            let own = point["iqm"].as_f64().expect("a number");
            assert!((own - iqm).abs() < 1e-12, "{name}: {own} {iqm}");
            // An end is a quantile of 20 000 replicates of five runs, of which there are few
            // different ones: between two of them it moves by a twentieth of the interval at most.
            let (own, theirs) = (numbers(&point["interval"]), numbers(interval));
            let width = theirs[1] - theirs[0];
            for (own, theirs) in own.iter().zip(&theirs) {
                assert!(
                    (own - theirs).abs() <= 0.05 * width + 1e-12,
                    "{name}: {own} {theirs}"
                );
            }
        }
        assert_eq!(group["success"], curve[11]["iqm"]);
    }
    let order: Vec<&str> = found["agents"]["groups"]
        .as_array()
        .expect("groups")
        .iter()
        .map(|group| group["name"].as_str().expect("a name"))
        .collect();
    assert_eq!(order[0], "points+robot");
    assert_eq!(order[5], "blind, keypoints+robot");
}

#[test]
fn tracking_stands_beside_success_in_every_output() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    write_agents(&runs);
    let found = &report(&runs, &out, &[])["agents"];
    let tcs: Vec<f64> = found["encoders"]
        .as_array()
        .expect("encoders")
        .iter()
        .map(|encoder| encoder["tc"].as_f64().expect("a TC"))
        .collect();
    assert_eq!(tcs, [1.0, 2.0 / 3.0, 1.0 / 3.0, 0.0]);
    let rho = &fixture()["rho"];
    for report in found["correlations"].as_array().expect("correlations") {
        let of = report["object"].as_str().unwrap_or("TC");
        let (own, theirs) = (report["rho"].as_f64(), rho[of].as_f64());
        assert!(
            (own.expect("one") - theirs.expect("one")).abs() < 1e-12,
            "{of}"
        );
        assert_eq!(
            (&report["encoders"], &report["pairs"]),
            (&json!(4), &json!(6))
        );
        let in_order = if of == "target" { 4 } else { 6 };
        assert_eq!(report["in_order"], in_order, "{of}");
        assert_eq!(numbers(&report["interval"]).len(), 2);
    }
    // No training is there, and so none of its files and tables.
    assert!(!out.join("runs.csv").exists() && !out.join("boxplots.svg").exists());
    let page = fs::read_to_string(out.join("report.html")).expect("a page");
    let markdown = fs::read_to_string(out.join("report.md")).expect("a report");
    let latex = fs::read_to_string(out.join("tables.tex")).expect("tables");
    for what in [
        "Success of agents",
        "Tracking and success",
        "Encoders of the agents",
    ] {
        assert!(
            page.contains(what) && markdown.contains(what) && latex.contains(what),
            "{what}"
        );
    }
    assert!(page.contains("Agents of points+robot solve the most at the end: 100 %"));
    assert!(
        markdown.contains("| keypoints+robot | TC | 4 | 1.00 ["),
        "{markdown}"
    );
    assert!(
        markdown.contains("| 6 of 6 |") && !markdown.contains("seed-00"),
        "{markdown}"
    );
    for figure in [
        "success-over-steps",
        "success-at-the-end",
        "tracking-and-success",
    ] {
        let svg = fs::read_to_string(out.join(format!("{figure}.svg"))).expect("a figure");
        assert!(svg.contains("success") && !svg.contains("NaN"), "{figure}");
        assert!(out.join(format!("{figure}.png")).exists(), "{figure}");
    }
    let lines = |name: &str| {
        fs::read_to_string(out.join(name))
            .expect("a table")
            .lines()
            .count()
    };
    assert_eq!((lines("agents.csv"), lines("success.csv")), (31, 73));
    // A stricter threshold changes what is tracked.
    let strict = report(&runs, &out, &["--threshold", "cube=0.001"]);
    assert_eq!(
        named(&strict["agents"]["groups"], "sharp, keypoints+robot")["tc"],
        2.0 / 3.0
    );
}

#[test]
fn an_encoder_is_known_by_its_training_or_by_an_evaluation() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    let mut crc32s = Vec::new();
    for (architecture, seed) in [("basic", 0), ("keynet-vel-std-bg", 1)] {
        let run = runs.join(format!("encoders/{architecture}/seed-{seed}"));
        write_run(&run, architecture, seed, 4);
        let weights = format!("weights of {architecture}");
        fs::write(run.join("checkpoint_final.safetensors"), &weights).expect("written");
        crc32s.push(crc32fast::hash(weights.as_bytes()));
    }
    let other = folder.path().join("other.pth");
    fs::write(&other, "other weights").expect("written");
    crc32s.push(crc32fast::hash(b"other weights"));
    for (i, crc32) in crc32s.iter().enumerate() {
        for seed in 0..2 {
            let run = &fixture()["runs"][format!("{}/seed-00", ["dim", "sharp", "fair"][i])];
            let mut config = run["config"].clone();
            // As the first version of tools/rl left it.
            config.as_object_mut().expect("settings").remove("encoder");
            config["seed"] = json!(seed);
            config["checkpoint"] = json!({ "crc32": crc32 });
            config["checkpoint_file"] = json!("other.pth");
            let log = run["log"].as_array().expect("a log");
            write_agent(&runs.join(format!("agents/{i}-{seed}")), &config, log);
        }
    }
    let found = report(&runs, &out, &[]);
    assert_eq!(found["groups"].as_array().map(Vec::len), Some(2));
    let agents = &found["agents"];
    let basic = named(&agents["groups"], "basic, keypoints+robot");
    assert_eq!(
        (&basic["architecture"], &basic["complete"]),
        (&json!("basic"), &json!(2))
    );
    assert_eq!(basic["tc"], found["groups"][0]["tc"]);
    let other_group = named(&agents["groups"], "other, keypoints+robot");
    assert_eq!(other_group["tc"], Value::Null);
    let notes = found["notes"].to_string();
    assert!(
        notes.contains("how well other.pth tracks is not known"),
        "{notes}"
    );
    let of_keynet = error("keynet-vel-std-bg", 1, 0);
    let encoders = agents["encoders"].as_array().expect("encoders");
    assert!(
        encoders
            .iter()
            .any(|encoder| encoder["errors"][0] == of_keynet),
        "{encoders:?}"
    );

    let evaluation = folder.path().join("evaluation.json");
    let [truth, keypoints] =
        ["ground_truth.csv", "keypoints.csv"].map(|name| folder.path().join(name));
    let rows = |header: &str, name: &str| {
        let row = |i: u64| format!("a,{i},{name},0.{},0.{}\n", i * 7 % 10, i * 3 % 10);
        format!("{header}\n{}", (0..40).map(row).collect::<String>())
    };
    fs::write(&truth, rows("sequence,frame,object,x,y", "cube")).expect("written");
    fs::write(&keypoints, rows("sequence,frame,keypoint,x,y", "0")).expect("written");
    let scored = tracklens(&[
        "score",
        "--keypoints",
        &text(&keypoints),
        "--truth",
        &text(&truth),
        "--json",
    ]);
    assert!(scored.status.success(), "{}", stderr(&scored));
    fs::write(&evaluation, &scored.stdout).expect("written");
    let given = format!("{}={}", text(&other), text(&evaluation));
    let found = report(&runs, &out, &["--evaluation", &given]);
    assert_eq!(found["notes"], json!([]));
    assert_eq!(
        named(&found["agents"]["groups"], "other, keypoints+robot")["tc"],
        1.0
    );

    // The paper's groups are of one architecture.
    let found = report(&runs, &out, &["--group-by", "architecture"]);
    named(
        &found["agents"]["groups"],
        "keynet-kp16-vel-std-bg, keypoints+robot",
    );
    // A setting of agents groups agents alone.
    let found = report(&runs, &out, &["--group-by", "evaluate_every"]);
    named(&found["agents"]["groups"], "evaluate_every 1000");
    assert_eq!(found["groups"].as_array().map(Vec::len), Some(2));
}

#[test]
fn the_claims_about_success_are_checked() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out, file] = ["runs", "out", "claims.toml"].map(|name| folder.path().join(name));
    write_agents(&runs);
    let head =
        "name = \"paper\"\ncitation = \"A paper\"\nsetting = \"10 agents\"\n[architectures]\n";
    let claims = r#"
[[claims]]
text = "The gradations follow TC"
place = "section 5.2"
statistic = "success"
state = "keypoints+robot"
[[claims]]
text = "The full state is best"
place = "section 5.2"
statistic = "success"
state = "keypoints+robot"
first = "full"
than = ["keynet-vel-std-bg", "dsae", "basic-kp32"]
"#;
    fs::write(&file, format!("{head}{claims}")).expect("written");
    let given = ["--group-by", "architecture", "--reference", &text(&file)];
    let found = report(&runs, &out, &given);
    let claims_of = |found: &Value, i: usize| found["reference"]["claims"][i].clone();
    let order = claims_of(&found, 0);
    assert_eq!(order["comparisons"].as_array().map(Vec::len), Some(6));
    assert_eq!(
        order["comparisons"][0]["first"],
        "keynet-vel-std-bg, keypoints+robot (TC 1.000)"
    );
    assert_eq!(claims_of(&found, 1)["missing"], json!(["basic-kp32"]));
    assert_eq!(
        found["reference"]["own_setting"],
        "5 agents a group, 12000 steps of reach"
    );
    let markdown = fs::read_to_string(out.join("report.md")).expect("a report");
    for row in [
        "| The gradations follow TC | section 5.2 | success | holds |",
        "| The full state is best | section 5.2 | success | holds in 1 of 2 comparisons; no runs of basic-kp32 |",
    ] {
        assert!(markdown.contains(row), "{row} in {markdown}");
    }
    for (from, to, told) in [
        ("state = \"keypoints+robot\"\n", "", "has no `state`"),
        ("first = \"full\"\n", "", "has `than` and no `first`"),
        (
            "statistic = \"success\"",
            "statistic = \"tc\"",
            "has no `first` and `than`",
        ),
    ] {
        fs::write(&file, format!("{head}{}", claims.replace(from, to))).expect("written");
        let [runs, out, file] = [&runs, &out, &file].map(|path| text(path));
        let refused = tracklens(&["report", &runs, "--out", &out, "--reference", &file]);
        assert_eq!(refused.status.code(), Some(3));
        assert!(stderr(&refused).contains(told), "{}", stderr(&refused));
    }
}

#[test]
fn agents_that_do_not_count_are_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    write_agents(&runs);
    let stopped = runs.join("full/seed-00");
    fs::remove_file(stopped.join("summary.json")).expect("removed");
    let cut = runs.join("full/seed-01/log.jsonl");
    let log = fs::read(&cut).expect("a log");
    fs::write(&cut, &log[..log.len() - 20]).expect("written");
    let log = runs.join("full/seed-02/log.jsonl");
    let text = fs::read_to_string(&log).expect("a log");
    let impossible = text.replacen("\"success\":0.", "\"success\":7.", 1);
    fs::write(&log, impossible).expect("written");
    let more = runs.join("full/seed-03/config.json");
    let config = fs::read_to_string(&more).expect("settings");
    fs::write(&more, config.replace("\"steps\":12000", "\"steps\":20000")).expect("written");
    let found = report(&runs, &out, &[]);
    let markdown = fs::read_to_string(out.join("report.md")).expect("a report");
    for told in [
        "full/seed-00: it stopped after step 12000 of 12000",
        "full/seed-01: its log breaks off (line 12: ",
        "full/seed-02: log.jsonl, line 1: the success is 7",
        "full/seed-03: it stopped after step 12000 of 20000",
    ] {
        assert!(markdown.contains(told), "{told} in {markdown}");
    }
    let full = named(&found["agents"]["groups"], "full (steps 12000)");
    assert_eq!(
        (&full["complete"], &full["curve"][0]["interval"]),
        (&json!(1), &Value::Null)
    );
}

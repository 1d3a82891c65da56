//! The real binary on real files: results, messages and exit codes.

mod shared;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../tests")
        .join(name)
}

fn tracklens<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tracklens"))
        .args(arguments)
        .output()
        .expect("the binary runs")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", stderr(output));
    serde_json::from_slice(&output.stdout).expect("JSON on the standard output")
}

/// A folder with a ground truth that moves and keypoints that follow it, but for the third.
struct Tables {
    folder: TempDir,
}

impl Tables {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let (mut truth, mut keypoints) = (
            String::from("sequence,frame,object,x,y\n"),
            String::from("sequence,frame,keypoint,x,y\n"),
        );
        for t in 0..40 {
            let (s, c) = (f64::from(t) * 0.37).sin_cos();
            let d = f64::from((t * 7919) % 40) / 40.0 - 0.5;
            truth += &format!("a,{t},cube,{s},{c}\na,{t},eef,{},{}\n", 2.0 * d, 0.5 * d - s);
            keypoints += &format!("a,{t},0,{},{}\na,{t},1,{},{}\n", 0.5 * c + 0.1, -s, d, d * d);
        }
        let tables = Self { folder };
        tables.write("gt.csv", &truth);
        tables.write("kp.csv", &keypoints);
        tables
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_string_lossy().into_owned()
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.folder.path().join(name), text).expect("written");
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).expect("read")
    }

    fn score(&self, more: &[&str]) -> Output {
        let (truth, keypoints) = (self.path("gt.csv"), self.path("kp.csv"));
        tracklens(&[&["score", "--truth", &truth, "--keypoints", &keypoints], more].concat())
    }
}

#[test]
fn score_prints_the_documented_json() {
    let tables = Tables::new();
    let result = json(&tables.score(&["--image-size", "200x100"]));
    assert_eq!(result["schema"], "tracklens/evaluation/1");
    assert_eq!(
        (&result["transform"], &result["rank"]),
        (&"affine".into(), &"reference".into())
    );
    assert_eq!(result["frames"], 40);
    assert_eq!(result["tc"], 0.5);
    let cube = &result["objects"][0];
    assert_eq!(
        (&cube["name"], &cube["tracked"], &cube["best_keypoint"]),
        (&"cube".into(), &true.into(), &0.into())
    );
    assert_eq!(cube["threshold"], 0.015);
    assert!(cube["error"].as_f64().expect("a number") < 1e-12);
    // cube = (sin, cos), keypoint 0 = (cos / 2 + 0.1, -sin): cube = (-y, 2 x - 0.2).
    let map = &cube["map"];
    for (found, expected) in [
        (&map["a"][0][0], 0.0),
        (&map["a"][0][1], -1.0),
        (&map["a"][1][0], 2.0),
        (&map["a"][1][1], 0.0),
        (&map["b"][0], 0.0),
        (&map["b"][1], -0.2),
    ] {
        assert!(
            (found.as_f64().expect("a number") - expected).abs() < 1e-9,
            "{map}"
        );
    }
    assert_eq!(result["errors"][1].as_array().map(Vec::len), Some(2));
    assert_eq!(result["errors"][0][0], cube["error"]);
    assert!(cube["rmse_px"].is_number());
}

#[test]
fn thresholds_transforms_and_ranks_are_taken() {
    let tables = Tables::new();
    let result = json(&tables.score(&[
        "--threshold",
        "eef=9",
        "--transform",
        "scale-translate",
        "--rank",
        "centred",
    ]));
    assert_eq!(result["objects"][1]["threshold"], 9.0);
    assert_eq!(result["objects"][1]["tracked"], true);
    assert_eq!(
        (&result["transform"], &result["rank"]),
        (&"scale-translate".into(), &"centred".into())
    );

    let unknown = tables.score(&["--threshold", "ball=1"]);
    assert_eq!(unknown.status.code(), Some(4));
    assert!(
        stderr(&unknown).contains("`ball`; the ground truth has the objects cube, eef"),
        "{}",
        stderr(&unknown)
    );
    for (more, expected) in [
        (["--threshold", "cube"], "expected NAME=VALUE"),
        (["--threshold", "cube=-1"], "expected NAME=VALUE"),
        (
            ["--transform", "projective"],
            "expected one of identity, scale-translate, affine",
        ),
        (["--rank", "full"], "expected one of reference, centred"),
        (["--image-size", "256"], "expected WIDTHxHEIGHT"),
    ] {
        let wrong = tables.score(&more);
        assert_eq!(wrong.status.code(), Some(2));
        assert!(stderr(&wrong).contains(expected), "{}", stderr(&wrong));
    }
}

#[test]
fn csv_has_one_line_an_object() {
    let output = Tables::new().score(&["--csv"]);
    let text = String::from_utf8(output.stdout).expect("text");
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 3);
    assert!(lines[0].starts_with("object,tracked,error,threshold") && lines[1].starts_with("cube,true,"));
}

#[test]
fn frames_without_partner_are_counted_and_shown() {
    let tables = Tables::new();
    tables.write(
        "gt.csv",
        &format!(
            "{}b,0,cube,0,0\n",
            tables.read("gt.csv").replace("a,39,", "a,99,")
        ),
    );
    let result = json(&tables.score(&[]));
    assert_eq!(result["frames"], 39);
    let warnings = result["warnings"].to_string();
    assert!(warnings.contains("1 frame(s) without a row of ground truth do not count: sequence a, frame 39"));
    assert!(
        warnings.contains("2 frame(s) of the ground truth without keypoints do not count"),
        "{warnings}"
    );
    let csv = tables.score(&["--csv"]);
    assert!(
        stderr(&csv).contains("warning: 1 frame(s) without a row"),
        "{}",
        stderr(&csv)
    );
}

#[test]
fn one_sequence_is_named_by_its_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("kp.csv").to_string_lossy().into_owned();
    let one = data("data/panda_push/seq_0012").to_string_lossy().into_owned();
    let extracted = extract(&one, &out);
    assert!(extracted.status.success(), "{}", stderr(&extracted));
    let table = std::fs::read_to_string(&out).expect("a table");
    assert!(
        table
            .lines()
            .nth(1)
            .is_some_and(|line| line.starts_with("seq_0012,0,0,")),
        "{table}"
    );
}

#[test]
fn bad_tables_name_file_line_and_remedy() {
    let tables = Tables::new();
    let good = tables.read("gt.csv");
    for (text, code, expected) in [
        (
            good.replace("object", "thing"),
            3,
            "column `object` missing; expected `sequence,frame,object,x,y`",
        ),
        (
            good.replacen("eef,", "eef,abc", 1),
            3,
            "gt.csv: line 3, column `x`: `abc",
        ),
        (
            format!("{good}a,0,cube,0,0\n"),
            3,
            "gt.csv: line 82: sequence a, frame 0, object cube stands already in line 2",
        ),
        (
            "sequence,frame,object,x,y\r\n".to_owned(),
            3,
            "the table has a header and no rows",
        ),
        (
            good.replace("a,", "z1,").replacen("z1,", "z2,", 1),
            4,
            "no frame has a row of ground truth",
        ),
    ] {
        tables.write("gt.csv", &text);
        let output = tables.score(&[]);
        assert_eq!(output.status.code(), Some(code), "{}", stderr(&output));
        assert!(
            stderr(&output).contains(expected),
            "{}\nexpected: {expected}",
            stderr(&output)
        );
        assert!(output.stdout.is_empty());
    }
    std::fs::remove_file(tables.folder.path().join("gt.csv")).expect("removed");
    let missing = tables.score(&[]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(stderr(&missing).contains("gt.csv: "), "{}", stderr(&missing));
}

#[test]
fn keypoints_that_are_not_finite_are_refused_or_counted() {
    let tables = Tables::new();
    let text = tables.read("kp.csv");
    let line = text.lines().nth(5).expect("a row").to_owned();
    tables.write("kp.csv", &text.replace(&line, "a,2,0,nan,0"));
    let refused = tables.score(&[]);
    assert_eq!(refused.status.code(), Some(3));
    assert!(
        stderr(&refused).contains("sequence a, frame 2: keypoint 0 is (NaN, 0): missing or not finite"),
        "{}",
        stderr(&refused)
    );
    let counted = json(&tables.score(&["--non-finite", "exclude-frame"]));
    assert_eq!(
        (&counted["frames"], &counted["excluded"]),
        (&39.into(), &1.into())
    );
}

fn checkpoint() -> String {
    data("golden/basic-vel-std-bg-tiny.safetensors")
        .to_string_lossy()
        .into_owned()
}

fn frames() -> String {
    data("data/panda_push").to_string_lossy().into_owned()
}

fn truth() -> String {
    data("data/panda_push/ground_truth.csv")
        .to_string_lossy()
        .into_owned()
}

/// `tracklens extract` with the tiny checkpoint.
fn extract(frames: &str, out: &str) -> Output {
    tracklens(&[
        "extract",
        "--checkpoint",
        &checkpoint(),
        "--frames",
        frames,
        "--out",
        out,
    ])
}

/// `tracklens eval` on the real frames.
fn eval(checkpoint: &str, more: &[&str]) -> Output {
    let fixed = [
        "eval",
        "--checkpoint",
        checkpoint,
        "--frames",
        &frames(),
        "--truth",
        &truth(),
    ];
    tracklens(&[&fixed, more].concat())
}

#[test]
fn eval_equals_extract_and_then_score() {
    let folder = tempfile::tempdir().expect("a folder");
    let keypoints = folder.path().join("kp.csv").to_string_lossy().into_owned();
    let truth = truth();
    let extracted = extract(&frames(), &keypoints);
    assert!(extracted.status.success(), "{}", stderr(&extracted));
    assert!(
        stderr(&extracted).contains("4 keypoints of 15 frames written to"),
        "{}",
        stderr(&extracted)
    );
    let scored = json(&tracklens(&[
        "score",
        "--truth",
        &truth,
        "--keypoints",
        &keypoints,
        "--image-size",
        "256x256",
    ]));
    for threads in ["1", "2"] {
        let evaluated = eval(&checkpoint(), &["--threads", threads]);
        assert_eq!(json(&evaluated), scored, "{threads} threads");
        assert!(
            stderr(&evaluated).contains("matched by the number in their name"),
            "{}",
            stderr(&evaluated)
        );
    }
    assert_eq!(scored["frames"], 15);
    assert!(scored["objects"][2]["rmse_px"].is_number());
}

#[test]
fn bad_frames_are_named_or_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let sequence = folder.path().join("seq_0");
    std::fs::create_dir(&sequence).expect("a folder");
    let good = std::fs::read(data("data/panda_push/seq_0000/frame_000.png")).expect("a frame");
    std::fs::write(sequence.join("frame_0.png"), &good).expect("written");
    std::fs::write(sequence.join("frame_1.png"), &good[..good.len() / 2]).expect("written");
    let out = folder.path().join("kp.csv");
    let extract = |more: &[&str]| {
        let (frames, out) = (folder.path().to_string_lossy(), out.to_string_lossy());
        tracklens(
            &[
                &[
                    "extract",
                    "--checkpoint",
                    &checkpoint(),
                    "--frames",
                    &frames,
                    "--out",
                    &out,
                ],
                more,
            ]
            .concat(),
        )
    };
    let refused = extract(&[]);
    assert_eq!(refused.status.code(), Some(3));
    let told = stderr(&refused);
    assert!(
        told.contains("frame_1.png: the image cannot be decoded") && !out.exists(),
        "{told}"
    );
    let skipped = extract(&["--skip-unreadable"]);
    assert!(
        skipped.status.success() && stderr(&skipped).contains("1 of 2 frames are left out"),
        "{}",
        stderr(&skipped)
    );
    assert_eq!(
        std::fs::read_to_string(&out).expect("keypoints").lines().count(),
        1 + 4
    );
}

#[test]
fn bad_sources_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("kp.csv").to_string_lossy().into_owned();
    let run = |checkpoint: &Path, frames: &Path| {
        tracklens(&[
            "extract".as_ref(),
            "--checkpoint".as_ref(),
            checkpoint.as_os_str(),
            "--frames".as_ref(),
            frames.as_os_str(),
            "--out".as_ref(),
            out.as_ref(),
        ])
    };
    let good = PathBuf::from(checkpoint());
    let empty = run(&good, folder.path());
    assert_eq!(empty.status.code(), Some(3));
    assert!(
        stderr(&empty).contains("no images among 0 files; expected .png"),
        "{}",
        stderr(&empty)
    );
    let absent = run(&good, &folder.path().join("nowhere"));
    assert_eq!(absent.status.code(), Some(1));
    let cut = folder.path().join("cut.safetensors");
    std::fs::write(&cut, &std::fs::read(&good).expect("a checkpoint")[..1000]).expect("written");
    let cut = run(&cut, Path::new(&frames()));
    assert_eq!(cut.status.code(), Some(3));
    assert!(
        stderr(&cut).contains("cut.safetensors: not a complete .safetensors file (1000 bytes"),
        "{}",
        stderr(&cut)
    );
    let table = run(&data("data/panda_push/ground_truth.csv"), Path::new(&frames()));
    assert!(
        stderr(&table).contains("not a checkpoint ("),
        "{}",
        stderr(&table)
    );
}

#[test]
fn an_output_that_cannot_be_written_is_told() {
    let output = extract(&frames(), "/nowhere/at/all/kp.csv");
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("/nowhere/at/all/kp.csv: "),
        "{}",
        stderr(&output)
    );
}

#[test]
fn help_names_every_command_and_the_exit_codes() {
    let help = String::from_utf8(tracklens(&["--help"]).stdout).expect("text");
    for word in ["score", "extract", "eval", "Exit codes", "130 cancelled"] {
        assert!(help.contains(word), "{help}");
    }
}

#[cfg(all(feature = "train", unix))]
mod train {
    use std::time::{Duration, Instant};

    use super::*;

    fn arguments(out: &Path, more: &[&str]) -> Vec<String> {
        let (data, out) = (frames(), out.to_string_lossy().into_owned());
        let fixed = [
            "train",
            "--data",
            &data,
            "--out",
            &out,
            "--arch",
            "basic-vel-std-bg",
            "--keypoints",
            "4",
            "--encoder-channels",
            "4,6,8",
            "--decoder-channels",
            "8,6,4",
            "--input-size",
            "32",
            "--target-size",
            "16",
            "--batch",
            "2",
            "--split",
            "0.67,0.33",
        ];
        fixed.iter().chain(more).map(|a| (*a).to_owned()).collect()
    }

    #[test]
    fn a_trained_checkpoint_can_be_evaluated() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("run");
        let trained = tracklens(&arguments(&out, &["--epochs", "2"]));
        assert!(trained.status.success(), "{}", stderr(&trained));
        assert!(stderr(&trained).contains("epoch 2: TC "), "{}", stderr(&trained));
        let checkpoint = out
            .join("checkpoint_best.safetensors")
            .to_string_lossy()
            .into_owned();
        let evaluated = eval(&checkpoint, &[]);
        assert_eq!(json(&evaluated)["frames"], 15);

        let again = tracklens(&arguments(&out, &["--epochs", "2"]));
        assert_eq!(again.status.code(), Some(3));
        assert!(
            stderr(&again).contains("holds a run already"),
            "{}",
            stderr(&again)
        );
        let unknown = tracklens(&[
            "train",
            "--data",
            &frames(),
            "--out",
            "x",
            "--arch",
            "basic-bg-vel",
        ]);
        assert_eq!(unknown.status.code(), Some(2));
        assert!(
            stderr(&unknown).contains("unknown architecture `basic-bg-vel`"),
            "{}",
            stderr(&unknown)
        );
    }

    #[test]
    fn ctrl_c_saves_and_ends_cleanly() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("run");
        let mut running = Command::new(env!("CARGO_BIN_EXE_tracklens"))
            .args(arguments(&out, &["--epochs", "100000", "--quiet"]))
            .spawn()
            .expect("the binary runs");
        let start = Instant::now();
        let lines = || std::fs::read_to_string(out.join("log.jsonl")).map_or(0, |log| log.lines().count());
        while lines() < 2 {
            assert!(start.elapsed() < Duration::from_secs(60), "no epoch in a minute");
            std::thread::sleep(Duration::from_millis(20));
        }
        let pid = running.id().to_string();
        assert!(
            Command::new("kill")
                .args(["-INT", &pid])
                .status()
                .expect("kill runs")
                .success()
        );
        assert_eq!(running.wait().expect("it ends").code(), Some(130));
        let summary = std::fs::read(out.join("summary.json")).expect("a summary");
        let summary: Value = serde_json::from_slice(&summary).expect("JSON");
        assert_eq!(summary["interrupted"], true);
        assert_eq!(summary["epochs"].as_u64(), Some(lines() as u64));
        assert!(out.join("checkpoint_final.safetensors").exists());
    }
}

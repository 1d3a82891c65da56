//! The real binary on real files: results, messages and exit codes.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

#[cfg(feature = "train")]
use serde_json::Value;
use tempfile::TempDir;

use crate::binary::{data, json, stderr, tracklens};

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
            truth += &format!(
                "a,{t},cube,{s},{c}\na,{t},eef,{},{}\n",
                2.0 * d,
                0.5 * d - s
            );
            keypoints += &format!(
                "a,{t},0,{},{}\na,{t},1,{},{}\n",
                0.5 * c + 0.1,
                -s,
                d,
                d * d
            );
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
        tracklens(
            &[
                &["score", "--truth", &truth, "--keypoints", &keypoints],
                more,
            ]
            .concat(),
        )
    }
}

#[test]
fn score_prints_the_documented_json() {
    let tables = Tables::new();
    let result = json(&tables.score(&["--image-size", "200x100"]));
    assert_eq!(result["schema"], "tracklens/evaluation/3");
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
    let twice = tables.score(&["--threshold", "cube=1", "--threshold", "cube=2"]);
    assert_eq!(twice.status.code(), Some(3));
    assert!(
        stderr(&twice).contains("two thresholds are given for `cube`"),
        "{}",
        stderr(&twice)
    );
    for (more, expected) in [
        (["--threshold", "cube"], "expected NAME=VALUE"),
        (["--threshold", "cube=-1"], "expected NAME=VALUE"),
        (["--threshold", "cube=-1"], "the threshold of `cube` is -1"),
        (["--threshold", "cube=0"], "with a number above 0"),
        (
            ["--threshold", "cube=small"],
            "`small`, which is not a number",
        ),
        (
            ["--threshold", "cube=1,eef=2"],
            "`cube=1,eef=2` gives more than one threshold",
        ),
        (
            ["--report", "report.pdf"],
            "expected a name that ends in .html or .htm",
        ),
        (["--tresholds", "cube=1"], "'--threshold'"),
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
fn other_sequences_are_asked_for() {
    let tables = Tables::new();
    // The recording has one sequence; three need rows of their own.
    let cut = |name: &str| {
        let text = std::fs::read_to_string(tables.path(name)).expect("a table");
        let rows = text.lines().enumerate().map(|(i, row)| match i {
            0 => format!("{row}\n"),
            _ => {
                let frame: usize = row
                    .split(',')
                    .nth(1)
                    .and_then(|f| f.parse().ok())
                    .expect("a frame");
                format!("{}{}\n", frame / 14, &row[1..])
            }
        });
        rows.collect::<String>()
    };
    let (truth, keypoints) = (cut("gt.csv"), cut("kp.csv"));
    tables.write("gt.csv", &truth);
    tables.write("kp.csv", &keypoints);
    let result = json(&tables.score(&[
        "--folds",
        "3",
        "--bootstrap",
        "50",
        "--resampling-seed",
        "4",
    ]));
    assert_eq!(result["held_out"]["folds"], 3);
    assert_eq!(
        result["held_out"]["objects"][0]["keypoints"]
            .as_array()
            .expect("one a fold")
            .len(),
        3
    );
    assert!(
        result["held_out"]["objects"][0]["error"]
            .as_f64()
            .expect("an error")
            < 1e-9
    );
    assert_eq!(result["intervals"]["resamples"], 50);
    assert_eq!(result["intervals"]["tc"][1], 1.0);
    let plain = json(&tables.score(&["--folds", "0"]));
    assert!(plain.get("held_out").is_none() && plain.get("intervals").is_none());
    // By default one fold a sequence, up to five.
    let default = json(&tables.score(&[]));
    assert_eq!(default["held_out"]["folds"], 3);
    assert_eq!(plain["objects"], result["objects"]);
    let too_many = tables.score(&["--folds", "4"]);
    assert!(
        stderr(&too_many).contains("4 folds of 3 sequences"),
        "{}",
        stderr(&too_many)
    );
}

#[test]
fn csv_has_one_line_an_object() {
    let output = Tables::new().score(&["--csv"]);
    let text = String::from_utf8(output.stdout).expect("text");
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 3);
    assert!(
        lines[0].starts_with("object,tracked,error,threshold")
            && lines[1].starts_with("cube,true,")
    );
    assert!(lines[0].ends_with(",held_out_error,enough_data"));
    // One sequence alone has no held-out error.
    assert!(lines[1].ends_with(",,true"), "{}", lines[1]);
}

#[test]
fn the_default_threshold_of_the_end_effector_holds_for_either_case() {
    let tables = Tables::new();
    let upper = tables.read("gt.csv").replace(",eef,", ",EEF,");
    tables.write("gt.csv", &upper);
    let result = json(&tables.score(&[]));
    let objects = result["objects"].as_array().expect("objects");
    let end_effector = objects.iter().find(|object| object["name"] == "EEF");
    assert_eq!(end_effector.expect("EEF")["threshold"], 0.1);
}

#[test]
fn columns_of_other_names_are_told_with_the_option_that_names_them() {
    let tables = Tables::new();
    let renamed = tables.read("gt.csv").replace("object", "label");
    tables.write("gt.csv", &renamed);
    let refused = tables.score(&[]);
    assert_eq!(refused.status.code(), Some(3), "{}", stderr(&refused));
    assert!(
        stderr(&refused).contains("--columns"),
        "{}",
        stderr(&refused)
    );
    let read = json(&tables.score(&["--columns", "object=label"]));
    assert_eq!(read["frames"], 40);
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
    assert!(
        warnings.contains(
            "1 frame(s) without a row of ground truth do not count: sequence a, frame 39"
        )
    );
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
    let one = data("data/panda_push/seq_0012")
        .to_string_lossy()
        .into_owned();
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
            "gt.csv: line 82: sequence a, frame 0, object cube is already in line 2",
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
    assert!(
        stderr(&missing).contains("gt.csv: "),
        "{}",
        stderr(&missing)
    );
}

#[test]
fn keypoints_that_are_not_finite_are_refused_or_counted() {
    let tables = Tables::new();
    let text = tables.read("kp.csv");
    let line = text.lines().nth(5).expect("a row").to_owned();
    tables.write("kp.csv", &text.replace(&line, "a,2,0,nan,0"));
    let refused = tables.score(&["--non-finite", "error"]);
    assert_eq!(refused.status.code(), Some(3));
    assert!(
        stderr(&refused)
            .contains("sequence a, frame 2: keypoint 0 is (NaN, 0): missing or not finite"),
        "{}",
        stderr(&refused)
    );
    let counted = json(&tables.score(&["--non-finite", "exclude-frame"]));
    assert_eq!(
        (&counted["frames"], &counted["excluded"]),
        (&39.into(), &1.into())
    );
    // By default the frame does not count for that keypoint alone.
    let default = json(&tables.score(&[]));
    assert_eq!(
        (
            &default["frames"],
            &default["excluded"],
            &default["missing"][0],
            &default["missing"][1]
        ),
        (&40.into(), &0.into(), &1.into(), &0.into())
    );
    let warnings = default["warnings"].to_string();
    assert!(
        warnings.contains("1 keypoint(s) are missing in some of 40 frames")
            && warnings.contains("0 (1)"),
        "{warnings}"
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
        let [mut evaluation, mut expected] = [json(&evaluated), scored.clone()];
        for one in [&mut evaluation, &mut expected] {
            one["command"].take();
        }
        assert_eq!(evaluation, expected, "{threads} threads");
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
fn keypoints_can_go_to_the_standard_output() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("kp.csv").to_string_lossy().into_owned();
    assert!(extract(&frames(), &file).status.success());
    let piped = extract(&frames(), "-");
    assert!(piped.status.success(), "{}", stderr(&piped));
    assert_eq!(piped.stdout, std::fs::read(&file).expect("a table"));
    assert!(
        stderr(&piped).contains("written to the standard output"),
        "{}",
        stderr(&piped)
    );
    // Where there are the results of `eval` already.
    let mixed = eval(&checkpoint(), &["--keypoints-out", "-"]);
    assert_eq!(mixed.status.code(), Some(2));
    assert!(
        stderr(&mixed).contains("keypoints would mix with the results"),
        "{}",
        stderr(&mixed)
    );
    assert!(!Path::new("-").exists());
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
        std::fs::read_to_string(&out)
            .expect("keypoints")
            .lines()
            .count(),
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
    let table = run(
        &data("data/panda_push/ground_truth.csv"),
        Path::new(&frames()),
    );
    assert!(
        stderr(&table).contains("not a checkpoint ("),
        "{}",
        stderr(&table)
    );
}

#[test]
#[cfg(not(feature = "gpu"))]
fn a_gpu_needs_a_build_that_knows_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("kp.csv");
    let told = tracklens(&[
        "extract",
        "--device",
        "gpu",
        "--checkpoint",
        &checkpoint(),
        "--frames",
        &frames(),
        "--out",
        &out.to_string_lossy(),
    ]);
    assert_eq!(told.status.code(), Some(3));
    assert!(
        stderr(&told).contains("built without GPU support; build it with the feature `gpu`"),
        "{}",
        stderr(&told)
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
fn a_reader_that_has_had_enough_is_no_error_and_a_full_disk_is_one() {
    let inspect = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tracklens"));
        command
            .args(["inspect", &checkpoint()])
            .stderr(Stdio::piped());
        command
    };
    let mut child = inspect()
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary runs");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(
        (output.status.code(), stderr(&output).as_str()),
        (Some(0), "")
    );

    if cfg!(target_os = "linux") {
        let full = File::options()
            .write(true)
            .open("/dev/full")
            .expect("a full device");
        let output = inspect().stdout(full).output().expect("the binary runs");
        assert_eq!(output.status.code(), Some(1));
        assert!(
            stderr(&output).contains("standard output: No space left on device"),
            "{}",
            stderr(&output)
        );
    }
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
        assert!(
            stderr(&trained).contains("epoch 2: TC "),
            "{}",
            stderr(&trained)
        );
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
        assert!(
            stderr(&unknown).contains("did you mean `basic-"),
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
        let lines =
            || std::fs::read_to_string(out.join("log.jsonl")).map_or(0, |log| log.lines().count());
        while lines() < 2 {
            assert!(
                start.elapsed() < Duration::from_secs(60),
                "no epoch in a minute"
            );
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

    fn text(path: &Path) -> String {
        path.to_string_lossy().into_owned()
    }

    fn weights(out: &Path) -> Vec<u8> {
        std::fs::read(out.join("checkpoint_final.safetensors")).expect("a checkpoint")
    }

    /// The final checkpoints of two runs are the same file.
    #[track_caller]
    fn assert_same_weights(a: &Path, b: &Path) {
        assert_same(&weights(a), &weights(b));
    }

    #[track_caller]
    fn assert_same(a: &[u8], b: &[u8]) {
        let differ = a.iter().zip(b).position(|(a, b)| a != b);
        assert_eq!(
            (a.len(), differ),
            (b.len(), None),
            "lengths, and the first byte that differs"
        );
    }

    #[test]
    fn a_killed_training_goes_on_to_the_same_weights() {
        let folder = tempfile::tempdir().expect("a folder");
        let [out, straight] = ["run", "straight"].map(|name| folder.path().join(name));
        let epochs = ["--epochs", "40", "--threads", "1", "--quiet"];
        let whole = tracklens(&arguments(&straight, &epochs));
        assert!(whole.status.success(), "{}", stderr(&whole));

        let resumed = arguments(&out, &[&epochs[..], &["--resume"]].concat());
        let log = || std::fs::read(out.join("log.jsonl")).map_or(0, |log| log.len());
        let mut kills = 0;
        for delay in [0u64, 3, 7, 12, 18, 25, 33] {
            let mut running = Command::new(env!("CARGO_BIN_EXE_tracklens"))
                .args(&resumed)
                .stderr(Stdio::null())
                .spawn()
                .expect("the binary runs");
            // Some epochs further, then at one moment or another of the next.
            let (start, before) = (Instant::now(), log());
            while log() < before + 2500 && running.try_wait().expect("a state").is_none() {
                assert!(
                    start.elapsed() < Duration::from_secs(60),
                    "no epoch in a minute"
                );
                std::thread::sleep(Duration::from_millis(1));
            }
            std::thread::sleep(Duration::from_millis(delay));
            running.kill().expect("it is ours");
            kills += usize::from(running.wait().expect("it ends").code().is_none());
        }
        assert!(kills >= 3, "only {kills} of 7 kills hit a running training");
        let last = tracklens(&resumed);
        assert!(last.status.success(), "{}", stderr(&last));
        assert_same_weights(&out, &straight);
        let epochs_in = |folder: &Path| -> Vec<(Value, Value)> {
            let log = std::fs::read_to_string(folder.join("log.jsonl")).expect("a log");
            let line = |l: &str| serde_json::from_str::<Value>(l).expect("JSON");
            log.lines()
                .map(|l| (line(l)["epoch"].clone(), line(l)["errors"].clone()))
                .collect()
        };
        assert_eq!(epochs_in(&out), epochs_in(&straight));
    }

    /// What TensorBoard's `event.proto` and `summary.proto` define, as far as scalars need it.
    #[derive(Clone, PartialEq, prost::Message)]
    struct EventRecord {
        #[prost(int64, tag = "2")]
        step: i64,
        #[prost(string, tag = "3")]
        file_version: String,
        #[prost(message, optional, tag = "5")]
        summary: Option<Summary>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    struct Summary {
        #[prost(message, repeated, tag = "1")]
        values: Vec<Scalar>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    struct Scalar {
        #[prost(string, tag = "1")]
        tag: String,
        #[prost(float, tag = "2")]
        value: f32,
    }

    /// The records of a TFRecord file: length (u64), its checksum, the bytes, their checksum.
    fn records(file: &[u8]) -> Vec<EventRecord> {
        let mut records = Vec::new();
        let mut rest = file;
        while let Some((length, after)) = rest.split_first_chunk() {
            let length = u64::from_le_bytes(*length) as usize;
            let bytes = &after[4..4 + length];
            records.push(prost::Message::decode(bytes).expect("an event"));
            rest = &after[4 + length + 4..];
        }
        records
    }

    #[test]
    fn tensorboard_gets_what_the_log_has() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("run");
        // The second part of the run has to bring the epochs of the first along.
        for epochs in ["1", "3"] {
            let done = tracklens(&arguments(
                &out,
                &["--epochs", epochs, "--resume", "--tensorboard"],
            ));
            assert!(done.status.success(), "{}", stderr(&done));
        }
        let files: Vec<_> = std::fs::read_dir(&out)
            .expect("a folder")
            .map(|entry| entry.expect("an entry"))
            .filter(|entry| entry.file_name().to_string_lossy().contains("tfevents"))
            .collect();
        assert_eq!(files.len(), 1, "{files:?}");
        let written = records(&std::fs::read(files[0].path()).expect("an event file"));
        assert_eq!(written[0].file_version, "brain.Event:2");
        let scalar = |step: i64, tag: &str| {
            let mut values = written
                .iter()
                .filter(|record| record.step == step)
                .flat_map(|record| record.summary.iter().flat_map(|summary| &summary.values))
                .filter(|scalar| scalar.tag == tag);
            let value = values
                .next()
                .unwrap_or_else(|| panic!("no `{tag}` in epoch {step}"))
                .value;
            assert!(values.next().is_none(), "`{tag}` twice in epoch {step}");
            value
        };
        let log = std::fs::read_to_string(out.join("log.jsonl")).expect("a log");
        assert_eq!(log.lines().count(), 3);
        for line in log.lines() {
            let entry: Value = serde_json::from_str(line).expect("JSON");
            let epoch = entry["epoch"].as_i64().expect("an epoch");
            let number = |value: &Value| value.as_f64().expect("a number") as f32;
            assert_eq!(scalar(epoch, "tc"), number(&entry["tc"]));
            assert_eq!(
                scalar(epoch, "training/total"),
                number(&entry["training"]["total"])
            );
            assert_eq!(
                scalar(epoch, "validation/velocity"),
                number(&entry["validation"]["velocity"])
            );
            for (map, errors) in entry["errors"].as_object().expect("errors") {
                for (object, error) in errors.as_object().expect("objects") {
                    assert_eq!(
                        scalar(epoch, &format!("error/{map}/{object}")),
                        number(error)
                    );
                }
            }
        }
    }

    #[test]
    fn a_preset_is_the_values_it_stands_for_unless_others_are_given() {
        let folder = tempfile::tempdir().expect("a folder");
        let train = |name: &str, more: &[&str]| {
            let out = folder.path().join(name);
            let given = [
                "train",
                "--quiet",
                "--data",
                &frames(),
                "--out",
                &text(&out),
            ]
            .map(str::to_owned)
            .to_vec();
            let more = more.iter().map(|a| (*a).to_owned());
            let done = tracklens(&given.into_iter().chain(more).collect::<Vec<_>>());
            let config = std::fs::read(out.join("config.json")).ok();
            let config = config.map(|json| serde_json::from_slice::<Value>(&json).expect("JSON"));
            (done, config)
        };
        // The frames of the tests have no episodes.
        let small = [
            "--preset",
            "small-cpu",
            "--epochs",
            "1",
            "--batch",
            "2",
            "--split-by",
            "sequence",
            "--split",
            "0.67,0.33",
            "--decoder-channels",
            "4,4,4",
        ];
        let (done, config) = train("preset", &small);
        assert!(done.status.success(), "{}", stderr(&done));
        let config = config.expect("a configuration");
        let sae = &config["sae"];
        assert_eq!(sae["architecture"], "keynet-vel-std-bg");
        assert_eq!(sae["encoder_strides"], serde_json::json!([1, 2, 1, 1]));
        assert_eq!(sae["decoder_channels"], serde_json::json!([4, 4, 4]));
        assert_eq!(sae["input_size"], serde_json::json!([64, 64]));
        assert_eq!(config["encoder_start"], "pointwise");
        assert_eq!(config["color_error"], "whitened");
        assert_eq!(config["background"], "mean");
        assert_eq!(config["batch"], 2);
        assert_eq!(config["epochs"], 1);
        assert!(config.get("split_by").is_none(), "{config}");
        assert!(config.get("preset").is_none(), "{config}");

        // The weights of a checkpoint take the place of what the preset starts from.
        let file = text(&folder.path().join("preset/checkpoint_final.safetensors"));
        let on = [&small[..], &["--weights", &file]].concat();
        let (done, config) = train("on", &on);
        assert!(done.status.success(), "{}", stderr(&done));
        let config = config.expect("a configuration");
        assert!(config.get("encoder_start").is_none(), "{config}");

        let basic = [&small[..], &["--arch", "basic"]].concat();
        let (done, _) = train("basic", &basic);
        assert_eq!(done.status.code(), Some(3), "{}", stderr(&done));
        assert!(
            stderr(&done).contains("no sizes for basic; expected a KeyNet"),
            "{}",
            stderr(&done)
        );
        let (done, _) = train("unknown", &["--preset", "small"]);
        assert_eq!(done.status.code(), Some(2));
        assert!(
            stderr(&done).contains("expected `small-cpu`"),
            "{}",
            stderr(&done)
        );
    }

    #[test]
    fn an_encoder_starts_pointwise() {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("run");
        let pointwise = ["--encoder-start", "pointwise"];
        let done = tracklens(&arguments(
            &out,
            &[&["--epochs", "1"], &pointwise[..]].concat(),
        ));
        assert!(done.status.success(), "{}", stderr(&done));
        let config = std::fs::read(out.join("config.json")).expect("a configuration");
        let config: Value = serde_json::from_slice(&config).expect("JSON");
        assert_eq!(config["encoder_start"], "pointwise");

        let without = tracklens(&arguments(&out, &["--epochs", "2", "--resume"]));
        assert_eq!(without.status.code(), Some(4));
        assert!(
            stderr(&without).contains("encoder_start"),
            "{}",
            stderr(&without)
        );
        let on = [&["--epochs", "2", "--resume"], &pointwise[..]].concat();
        let with = tracklens(&arguments(&out, &on));
        assert!(with.status.success(), "{}", stderr(&with));

        let file = text(&out.join("checkpoint_final.safetensors"));
        let new = folder.path().join("new");
        for other in ["--weights", "--first-layer"] {
            let both = [&[other, &file], &pointwise[..]].concat();
            let both = tracklens(&arguments(&new, &both));
            assert_eq!(both.status.code(), Some(2), "{other}");
        }
        let unknown = tracklens(&arguments(&new, &["--encoder-start", "pointed"]));
        assert_eq!(unknown.status.code(), Some(2));
        assert!(
            stderr(&unknown).contains("expected `drawn` or `pointwise`"),
            "{}",
            stderr(&unknown)
        );
    }

    #[test]
    fn the_first_layer_comes_from_another_network() {
        let folder = tempfile::tempdir().expect("a folder");
        let [other, out] = ["other", "run"].map(|name| folder.path().join(name));
        let done = tracklens(&arguments(&other, &["--epochs", "1"]));
        assert!(done.status.success(), "{}", stderr(&done));
        let file = text(&other.join("checkpoint_final.safetensors"));
        let from_file = ["--first-layer", &file, "--seed", "1", "--resume"];
        let done = tracklens(&arguments(
            &out,
            &[&["--epochs", "1"], &from_file[..]].concat(),
        ));
        assert!(done.status.success(), "{}", stderr(&done));
        assert!(
            stderr(&done).contains("the first layer starts from `encoder.block1.conv1.weight`"),
            "{}",
            stderr(&done)
        );
        let config = std::fs::read(out.join("config.json")).expect("a configuration");
        let config: Value = serde_json::from_slice(&config).expect("JSON");
        assert_eq!(
            config["first_layer"]["tensor"],
            "encoder.block1.conv1.weight"
        );

        let without = tracklens(&arguments(
            &out,
            &["--epochs", "2", "--seed", "1", "--resume"],
        ));
        assert_eq!(without.status.code(), Some(4));
        assert!(
            stderr(&without).contains("first_layer"),
            "{}",
            stderr(&without)
        );
        let with = tracklens(&arguments(
            &out,
            &[&["--epochs", "2"], &from_file[..]].concat(),
        ));
        assert!(with.status.success(), "{}", stderr(&with));

        let golden = format!(
            "{}/../tests/golden/dsae-tiny.safetensors",
            env!("CARGO_MANIFEST_DIR")
        );
        let new = folder.path().join("new");
        let unfit = tracklens(&arguments(
            &new,
            &["--epochs", "1", "--first-layer", &golden],
        ));
        assert_eq!(unfit.status.code(), Some(4));
        assert!(
            stderr(&unfit).contains(&golden)
                && stderr(&unfit).contains("have the shape [4, 3, 3, 3]")
                || stderr(&unfit).contains("tensors has the shape [4, 3, 3, 3]"),
            "{}",
            stderr(&unfit)
        );
        assert!(!new.join("config.json").exists());
    }

    #[test]
    fn a_training_starts_from_the_weights_of_another() {
        let folder = tempfile::tempdir().expect("a folder");
        let [first, second, third] =
            ["first", "second", "third"].map(|name| folder.path().join(name));
        let done = tracklens(&arguments(&first, &["--epochs", "2"]));
        assert!(done.status.success(), "{}", stderr(&done));
        let file = text(&first.join("checkpoint_final.safetensors"));

        // At this learning rate Adam changes no weight by more than 1e-9 a step; batch norm's
        // running statistics move on.
        let still = ["--weights", &file, "--learning-rate", "1e-9", "--seed", "1"];
        let done = tracklens(&arguments(
            &second,
            &[&["--epochs", "1"], &still[..]].concat(),
        ));
        assert!(done.status.success(), "{}", stderr(&done));
        assert!(
            stderr(&done).contains(&format!("the weights start from those of {file}")),
            "{}",
            stderr(&done)
        );
        let [before, after] = [&first, &second].map(|out| {
            tracklens::checkpoint::Checkpoint::from_safetensors(&weights(out))
                .expect("a checkpoint")
        });
        for (name, tensor) in &before.tensors {
            let pairs = tensor.data.iter().zip(&after.tensors[name].data);
            let difference = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            match name.contains("running") {
                true => assert!(difference > 1e-6, "{name} differs by {difference}"),
                false => assert!(difference < 1e-7, "{name} differs by {difference}"),
            }
        }
        let config = std::fs::read(second.join("config.json")).expect("a configuration");
        let config: Value = serde_json::from_slice(&config).expect("JSON");
        let bytes = std::fs::read(&file).expect("a checkpoint");
        assert_eq!(config["weights"]["crc32"], crc32fast::hash(&bytes));

        // Without the option it is another run.
        let without = ["--learning-rate", "1e-9", "--seed", "1", "--resume"];
        let without = tracklens(&arguments(
            &second,
            &[&["--epochs", "2"], &without[..]].concat(),
        ));
        assert_eq!(without.status.code(), Some(4));
        assert!(stderr(&without).contains("weights"), "{}", stderr(&without));
        let with = [&["--epochs", "2", "--resume"], &still[..]].concat();
        let with = tracklens(&arguments(&second, &with));
        assert!(with.status.success(), "{}", stderr(&with));

        let refused = |more: &[&str], code: i32, expected: &str| {
            let done = tracklens(&arguments(
                &third,
                &[&["--epochs", "1", "--weights"], more].concat(),
            ));
            assert_eq!(done.status.code(), Some(code), "{}", stderr(&done));
            assert!(stderr(&done).contains(expected), "{}", stderr(&done));
            assert!(!third.join("config.json").exists());
        };
        let example = format!(
            "{}/../web/example/checkpoint.safetensors",
            env!("CARGO_MANIFEST_DIR")
        );
        refused(&[&example], 4, "is a keynet-kp64-vel-std-bg with");
        refused(&[&file, "--background", "mean"], 2, "--background");
        let mut encoder = before;
        encoder
            .tensors
            .retain(|name, _| name.starts_with("encoder."));
        let alone = text(&folder.path().join("encoder.safetensors"));
        std::fs::write(&alone, encoder.to_safetensors().expect("a file")).expect("written");
        refused(&[&alone], 4, "an encoder alone");
    }

    #[test]
    fn a_full_disk_keeps_the_last_good_state() {
        let folder = tempfile::tempdir().expect("a folder");
        let [out, straight] = ["run", "straight"].map(|name| folder.path().join(name));
        let two = tracklens(&arguments(&out, &["--epochs", "2"]));
        assert!(two.status.success(), "{}", stderr(&two));
        let before = weights(&out);

        // Files may not grow beyond 8 blocks: what a full disk does to every write, at a chosen
        // moment.
        let limited = Command::new("sh")
            .args(["-c", "trap '' XFSZ; ulimit -f 8; exec \"$@\"", "sh"])
            .arg(env!("CARGO_BIN_EXE_tracklens"))
            .args(arguments(&out, &["--epochs", "4", "--resume"]))
            .output()
            .expect("sh runs");
        assert_eq!(limited.status.code(), Some(1), "{}", stderr(&limited));
        let told = stderr(&limited);
        assert!(
            told.contains(&text(&out)) && told.contains("File too large"),
            "{told}"
        );
        assert_same(&weights(&out), &before);
        let left = std::fs::read_dir(&out).expect("a folder").count();
        assert_eq!(left, 6, "no temporary file is left behind");

        let on = tracklens(&arguments(&out, &["--epochs", "4", "--resume"]));
        assert!(on.status.success(), "{}", stderr(&on));
        let whole = tracklens(&arguments(&straight, &["--epochs", "4"]));
        assert!(whole.status.success(), "{}", stderr(&whole));
        assert_same_weights(&out, &straight);

        let file = folder.path().join("file");
        std::fs::write(&file, "x").expect("a file");
        let unwritable = tracklens(&arguments(&file.join("run"), &["--epochs", "1"]));
        assert_eq!(unwritable.status.code(), Some(1));
        assert!(
            stderr(&unwritable).contains("Not a directory"),
            "{}",
            stderr(&unwritable)
        );
    }
}

fn format(name: &str) -> String {
    data("data/formats")
        .join(name)
        .to_string_lossy()
        .into_owned()
}

/// `tracklens data …`, which must succeed; what it says on the way.
fn convert(arguments: &[&str]) -> String {
    let done = tracklens(&[&["data", "convert", "--quiet"], arguments].concat());
    assert!(done.status.success(), "{}", stderr(&done));
    stderr(&done)
}

#[test]
fn inspect_says_what_is_there_and_what_does_not_fit() {
    let found = json(&tracklens(&[
        "data",
        "inspect",
        "--quiet",
        &format("record.hdf5"),
    ]));
    assert_eq!(found["schema"], "tracklens/data/2");
    assert_eq!(
        (found["frames"].as_u64(), found["sequences"].as_u64()),
        (Some(15), Some(3))
    );
    assert_eq!(found["sizes"]["16x16"], 15);
    assert_eq!(found["pixels"][0], "float");
    let truth = &found["ground_truth"];
    assert_eq!(truth["objects"][0]["name"], "cube");
    assert_eq!(truth["objects"][4]["name"], "eef");
    assert_eq!(truth["objects"][4]["visible"], 15);
    assert_eq!(truth["join"]["matched"], 15);

    // A folder with a frame that is broken and one without rows.
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("set");
    let out = out.to_str().expect("a path");
    convert(&[&format("frames.npz"), out]);
    let frame = Path::new(out).join("seq_0001");
    std::fs::write(frame.join("frame_002.png"), b"no image").expect("written");
    std::fs::copy(frame.join("frame_000.png"), frame.join("frame_009.png")).expect("copied");
    let found = json(&tracklens(&["data", "inspect", "--quiet", out]));
    assert_eq!(found["sequence_lengths"], serde_json::json!([5, 6]));
    assert_eq!(found["pixels"], serde_json::json!(["8-bit"]));
    let unreadable = found["unreadable"].as_array().expect("a list");
    assert_eq!(unreadable.len(), 1);
    assert!(
        unreadable[0]
            .as_str()
            .expect("text")
            .contains("frame_002.png")
    );
    assert_eq!(
        found["ground_truth"]["join"]["unmatched_frames"]["count"],
        1
    );
}

#[test]
fn a_recording_becomes_a_folder_and_an_array() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let said = convert(&[
        &format("record.hdf5"),
        &path("set"),
        "--objects",
        "cube,target,eef",
    ]);
    assert!(said.contains("1/510"), "{said}");
    let truth = std::fs::read_to_string(path("set/ground_truth.csv")).expect("a table");
    assert_eq!(truth.lines().count(), 1 + 15 * 3);
    assert!(!truth.contains("link_4"));
    assert!(folder.path().join("set/seq_0002/frame_004.png").is_file());

    // Floats stay floats in an array, and the way through it changes nothing.
    let said = convert(&[&format("record.hdf5"), &path("a.npz")]);
    assert!(!said.contains("1/510"), "{said}");
    convert(&[&path("a.npz"), &path("b.npz")]);
    let bytes = |name: &str| std::fs::read(path(name)).expect("a file");
    assert_eq!(bytes("a.npz"), bytes("b.npz"));
    convert(&[
        &path("a.npz"),
        &path("again"),
        "--objects",
        "cube,target,eef",
    ]);
    for file in ["ground_truth.csv", "seq_0000/frame_003.png"] {
        assert_eq!(
            bytes(&format!("again/{file}")),
            bytes(&format!("set/{file}"))
        );
    }

    let again = tracklens(&["data", "convert", &path("a.npz"), &path("set")]);
    assert_eq!(again.status.code(), Some(1));
    assert!(
        stderr(&again).contains("is there already"),
        "{}",
        stderr(&again)
    );
    // Sequences of different lengths lie one after the other.
    let frame = path("set/seq_0001/frame_004.png");
    std::fs::remove_file(&frame).expect("removed");
    let said = convert(&[&path("set"), &path("c.npz")]);
    assert!(said.contains("episode_0, episode_1"), "{said}");
    let found = json(&tracklens(&["data", "inspect", &path("c.npz")]));
    assert_eq!(found["sequence_lengths"], serde_json::json!([4, 5]));
    // Frames of different sizes are no array; nothing is left behind.
    std::fs::copy(data("data/panda_push/seq_0000/frame_000.png"), &frame).expect("copied");
    let sizes = tracklens(&["data", "convert", "--quiet", &path("set"), &path("d.npz")]);
    assert_eq!(sizes.status.code(), Some(4));
    assert!(
        stderr(&sizes).contains("an array needs frames of one size"),
        "{}",
        stderr(&sizes)
    );
    let mut left: Vec<_> = std::fs::read_dir(folder.path())
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name())
        .collect();
    left.sort();
    assert_eq!(left, ["a.npz", "again", "b.npz", "c.npz", "set"]);
}

#[test]
fn frames_are_extracted_from_any_source_alike() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    convert(&[&format("options.hdf5"), &path("set")]);
    convert(&[&path("set"), &path("set.npz")]);
    let checkpoint = checkpoint();
    let keypoints = |frames: &str| {
        let out = path("kp.csv");
        let done = tracklens(&[
            "extract",
            "--quiet",
            "--checkpoint",
            &checkpoint,
            "--frames",
            frames,
            "--out",
            &out,
        ]);
        assert!(done.status.success(), "{}", stderr(&done));
        std::fs::read_to_string(out).expect("keypoints")
    };
    let from_folder = keypoints(&path("set"));
    assert_eq!(keypoints(&path("set.npz")), from_folder);
    assert_eq!(keypoints(&format("options.hdf5")), from_folder);

    // The ground truth lies with the frames.
    let eval = |frames: &str| {
        json(&tracklens(&[
            "eval",
            "--quiet",
            "--json",
            "--checkpoint",
            &checkpoint,
            "--frames",
            frames,
        ]))
    };
    let (a, b) = (eval(&path("set")), eval(&format("options.hdf5")));
    assert_eq!(a["objects"], b["objects"]);
    assert_eq!(a["objects"].as_array().map(Vec::len), Some(5));
    let none = tracklens(&[
        "eval",
        "--checkpoint",
        &checkpoint,
        "--frames",
        &format("lzf.hdf5"),
    ]);
    assert!(
        stderr(&none).contains("no ground truth lies with the frames"),
        "{}",
        stderr(&none)
    );
    let wrong = tracklens(&[
        "extract",
        "--checkpoint",
        &checkpoint,
        "--frames",
        &format("frames.f32"),
        "--out",
        &path("x"),
    ]);
    assert_eq!(wrong.status.code(), Some(3));
    assert!(
        stderr(&wrong).contains("neither a folder nor a recording"),
        "{}",
        stderr(&wrong)
    );
}

#[test]
fn recordings_are_scored() {
    let scored = json(&tracklens(&[
        "score",
        "--truth",
        &format("points.npz"),
        "--keypoints",
        &format("points.npz"),
        "--objects",
        "cube,eef",
    ]));
    let objects = scored["objects"].as_array().expect("objects");
    assert_eq!(objects.len(), 2);
    // The points are their own keypoints: `eef` is also a scaled `link_5`, so only the error is
    // certain.
    for object in objects {
        assert!(
            object["error"].as_f64().expect("an error") < 1e-9,
            "{object}"
        );
    }
    let truth = json(&tracklens(&[
        "score",
        "--truth",
        &format("record.hdf5"),
        "--keypoints",
        &format("points.npz"),
    ]));
    assert_eq!(truth["frames"], 15);
}

#[test]
fn an_error_comes_with_the_option_that_helps() {
    let tables = Tables::new();
    let of_unknown_size = tables.score(&["--space", "px"]);
    assert_eq!(of_unknown_size.status.code(), Some(3));
    let text = stderr(&of_unknown_size);
    assert!(
        text.contains("the size of the images is not known") && text.contains("--image-size"),
        "{text}"
    );
}

/// A folder with one sequence of two frames.
#[cfg(unix)]
fn two_frames(folder: &Path) {
    let frame = data("data/panda_push/seq_0000/frame_000.png");
    std::fs::create_dir(folder.join("a")).expect("a folder");
    for name in ["frame_0.png", "frame_1.png"] {
        std::fs::copy(&frame, folder.join("a").join(name)).expect("copied");
    }
}

#[cfg(unix)]
#[test]
fn links_and_pipes_in_a_data_set_are_left_out_and_named() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().expect("a folder");
    let set = folder.path();
    two_frames(set);
    // A loop, a second way to a sequence, a link to nothing, a device and a pipe.
    symlink(set, set.join("a/loop")).expect("a link");
    symlink(set.join("a"), set.join("again")).expect("a link");
    symlink("nowhere", set.join("a/.#frame_0.png")).expect("a link");
    symlink("/dev/zero", set.join("a/frame_2.png")).expect("a link");
    // Two more names of a frame.
    std::fs::hard_link(set.join("a/frame_1.png"), set.join("a/frame_4.png")).expect("a link");
    symlink(set.join("a/frame_1.png"), set.join("a/frame_5.png")).expect("a link");
    let pipe = Command::new("mkfifo")
        .arg(set.join("a/frame_3.png"))
        .status();
    assert!(pipe.expect("mkfifo runs").success());
    let mut deep = set.to_path_buf();
    for name in 0..10 {
        deep.push(format!("d{name}"));
    }
    std::fs::create_dir_all(&deep).expect("folders");

    let inspected = tracklens(&["data", "inspect", "--quiet", set.to_str().expect("a path")]);
    let found = json(&inspected);
    assert_eq!(
        (found["frames"].as_u64(), found["sequences"].as_u64()),
        (Some(2), Some(1))
    );
    let notes = stderr(&inspected);
    for (name, why) in [
        ("a/loop", "a folder that is in the data set already"),
        ("again", "a folder that is in the data set already"),
        ("a/.#frame_0.png", "a link to nothing"),
        ("a/frame_2.png", "not a regular file"),
        ("a/frame_3.png", "not a regular file"),
        ("a/frame_4.png", "a file that is in the data set already"),
        ("a/frame_5.png", "a file that is in the data set already"),
        ("d7/d8", "more than 8 folders deep"),
    ] {
        assert!(notes.contains(&format!("{name}: {why}")), "{name}: {notes}");
    }
}

#[cfg(unix)]
#[test]
fn a_data_set_of_which_nothing_can_be_read_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("frame_0.png"), b"not an image").expect("written");
    let path = folder.path().to_str().expect("a path");
    let inspected = tracklens(&["data", "inspect", "--quiet", path]);
    assert_eq!(inspected.status.code(), Some(3));
    assert!(stderr(&inspected).contains("no frame can be read"));
}

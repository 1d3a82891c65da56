//! The look at the data before they are scored, by the real binary: a fault is told with the option
//! that remedies it, and with that option the evaluation is that of the clean data.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};
use tempfile::TempDir;

const SEQUENCES: usize = 12;
const FRAMES: usize = 20;

type Point = [f64; 2];

/// How a table is written wrongly.
#[derive(Clone, Copy)]
struct Fault {
    truth: fn(Point) -> Point,
    keypoints: fn(Point) -> Point,
    /// Added to the numbers of the frames, the sequences and the keypoints.
    truth_frames: u64,
    truth_sequences: usize,
    keypoint_numbers: usize,
    keypoint_frames: u64,
}

const CLEAN: Fault = Fault {
    truth: |p| p,
    keypoints: |p| p,
    truth_frames: 0,
    truth_sequences: 0,
    keypoint_numbers: 0,
    keypoint_frames: 0,
};

/// Twelve sequences of two objects, which two of the four keypoints follow. Coordinates are
/// multiples of 2^-20, so that changes of unit are exact.
fn write(folder: &Path, fault: Fault) {
    let exact = |v: f64| (v * f64::from(1 << 20)).round() / f64::from(1 << 20);
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for s in 0..SEQUENCES {
        for t in 0..FRAMES {
            let i = t as f64 + 37.0 * s as f64;
            let wave = |a: f64, b: f64| [(i * a).sin(), (i * b + 1.0).cos()].map(|v| 0.85 * v);
            let (cube, eef) = (wave(0.37, 0.71), wave(0.53, 0.29));
            let (sequence, frame) = (s + fault.truth_sequences, t as u64 + fault.truth_frames);
            for (name, p) in [("cube", cube), ("eef", eef)] {
                let [x, y] = (fault.truth)(p.map(exact));
                let _ = writeln!(truth, "{sequence},{frame},{name},{x},{y}");
            }
            let near = |p: Point, noise: f64| {
                [0, 1].map(|axis| 0.9 * p[axis] + 0.02 * (i * noise + axis as f64).sin())
            };
            let points = [
                near(cube, 2.3),
                wave(0.11, 0.17),
                near(eef, 3.1),
                wave(0.9, 0.4),
            ];
            for (n, p) in points.into_iter().enumerate() {
                let [x, y] = (fault.keypoints)(p.map(exact));
                let (n, t) = (n + fault.keypoint_numbers, t as u64 + fault.keypoint_frames);
                let _ = writeln!(keypoints, "{s},{t},{n},{x},{y}");
            }
        }
    }
    for (name, text) in [("gt.csv", truth), ("kp.csv", keypoints)] {
        std::fs::write(folder.join(name), text).expect("written");
    }
}

fn folder(fault: Fault) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), fault);
    folder
}

fn score(folder: &Path, options: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tracklens"))
        .current_dir(folder)
        .args(["score", "--truth", "gt.csv", "--keypoints", "kp.csv"])
        .args(options)
        .output()
        .expect("the binary runs")
}

fn json(output: &Output) -> Value {
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// What of an evaluation does not depend on how the tables were written.
fn numbers(evaluation: &Value) -> Value {
    json!([
        evaluation["tc"],
        evaluation["frames"],
        evaluation["objects"],
        evaluation["errors"],
        evaluation["held_out"],
    ])
}

/// The fault is found with `problem`, told on the terminal with `options`, and the evaluation with
/// these is that of the clean data.
fn check(fault: Fault, before: &[&str], problem: &str, options: &[&str]) {
    let clean = json(&score(folder(CLEAN).path(), &[]));
    assert!(clean.get("findings").is_none(), "{}", clean["findings"]);
    let folder = folder(fault);
    let found = json(&score(folder.path(), before));
    let findings = found["findings"].as_array().expect("findings");
    let problems: Vec<&str> = findings
        .iter()
        .filter_map(|f| f["problem"].as_str())
        .collect();
    assert_eq!(problems, [problem], "{findings:?}");

    let told = score(folder.path(), &[before, &["--csv"]].concat());
    let told = String::from_utf8(told.stderr).expect("UTF-8");
    let lines: Vec<&str> = told
        .lines()
        .filter(|line| line.starts_with("check: "))
        .collect();
    assert_eq!(lines.len(), 1, "{told}");
    assert!(lines[0].contains(&options.join(" ")), "{told}");

    let fixed = json(&score(folder.path(), &[before, options].concat()));
    assert!(fixed.get("findings").is_none(), "{}", fixed["findings"]);
    assert_eq!(numbers(&fixed), numbers(&clean), "{problem}");
}

#[test]
fn shares_of_the_image_are_told_and_can_be_read() {
    let truth = |p: Point| p.map(|v| (v + 1.0) / 2.0);
    let fault = Fault { truth, ..CLEAN };
    check(fault, &[], "unit", &["--space", "fraction"]);
    let fault = Fault {
        keypoints: truth,
        ..CLEAN
    };
    check(fault, &[], "unit", &["--keypoints-space", "fraction"]);
}

#[test]
fn pixels_are_told_and_can_be_read() {
    let truth = |p: Point| p.map(|v| ((v + 1.0) * 256.0 - 1.0) / 2.0);
    let fault = Fault { truth, ..CLEAN };
    let size = ["--image-size", "256x256"];
    let clean = json(&score(folder(CLEAN).path(), &size));
    let folder = folder(fault);
    let found = json(&score(folder.path(), &size));
    assert_eq!(found["findings"][0]["problem"], "unit");
    assert_eq!(
        found["findings"][0]["remedies"],
        json!([{ "type": "unit", "side": "truth", "space": "px" }])
    );
    let text = found["findings"][0]["text"].as_str().expect("text");
    assert!(text.contains("look like pixels of 256 x 256"), "{text}");
    let fixed = json(&score(
        folder.path(),
        &[&size[..], &["--space", "px"]].concat(),
    ));
    assert!(fixed.get("findings").is_none(), "{}", fixed["findings"]);
    assert_eq!(numbers(&fixed), numbers(&clean));
}

#[test]
fn counting_from_one_is_told_and_can_be_read() {
    let fault = Fault {
        truth_frames: 1,
        ..CLEAN
    };
    check(fault, &[], "counting", &["--index-base", "1"]);
    check(
        fault,
        &["--index-base", "0"],
        "lag",
        &["--shift-frames", "-1"],
    );
    let fault = Fault {
        keypoint_frames: 1,
        ..CLEAN
    };
    let options = ["--keypoints-index-base", "1", "--first-keypoint", "0"];
    check(fault, &[], "counting", &options);
    let fault = Fault {
        truth_sequences: 1,
        ..CLEAN
    };
    check(fault, &[], "counting", &["--shift-sequences", "-1"]);
}

#[test]
fn a_lag_is_told_and_can_be_taken_out() {
    let folder = folder(CLEAN);
    let text = std::fs::read_to_string(folder.path().join("gt.csv")).expect("read");
    // Two frames late, with the rows before them.
    let mut late = String::new();
    for (i, line) in text.lines().enumerate() {
        let fields: Vec<&str> = line.split(',').collect();
        let frame = fields[1].parse::<u64>();
        match frame {
            Ok(frame) if i > 0 && frame + 2 < FRAMES as u64 => {
                let _ = writeln!(
                    late,
                    "{},{},{}",
                    fields[0],
                    frame + 2,
                    fields[2..].join(",")
                );
            }
            Ok(_) => {}
            Err(_) => late += "sequence,frame,object,x,y\n",
        }
    }
    let text: String = text
        .lines()
        .filter(|line| !["18", "19"].contains(&line.split(',').nth(1).unwrap_or_default()))
        .map(|line| format!("{line}\n"))
        .collect();
    std::fs::write(folder.path().join("gt.csv"), text).expect("written");
    let clean = json(&score(folder.path(), &[]));
    assert!(clean.get("findings").is_none(), "{}", clean["findings"]);
    std::fs::write(folder.path().join("gt.csv"), late).expect("written");
    let found = json(&score(folder.path(), &[]));
    let finding = found["findings"]
        .as_array()
        .and_then(|all| all.iter().find(|f| f["problem"] == "lag"))
        .unwrap_or_else(|| panic!("{}", found["findings"]));
    assert_eq!(
        finding["remedies"],
        json!([{ "type": "shift-frames", "by": -2 }])
    );
    let [before, after] = ["before", "after"].map(|name| finding["evidence"][name].as_f64());
    assert!(before > after.map(|after| 2.0 * after), "{finding}");
    let fixed = json(&score(folder.path(), &["--shift-frames", "-2"]));
    assert!(fixed.get("findings").is_none(), "{}", fixed["findings"]);
    assert_eq!(numbers(&fixed), numbers(&clean));
}

#[test]
fn turned_axes_are_told_and_can_be_read() {
    let swapped = Fault {
        keypoints: |[x, y]| [y, x],
        ..CLEAN
    };
    check(
        swapped,
        &[],
        "axes",
        &["--keypoints-axis-order", "yx", "--keypoints-flip", "none"],
    );
    let up = Fault {
        keypoints: |[x, y]| [x, -y],
        ..CLEAN
    };
    check(
        up,
        &[],
        "axes",
        &["--keypoints-axis-order", "xy", "--keypoints-flip", "y"],
    );
    // What is said of both sides together leaves them swapped relative to each other.
    let folder = folder(swapped);
    let found = json(&score(folder.path(), &["--axis-order", "yx"]));
    let finding = found["findings"]
        .as_array()
        .and_then(|all| all.iter().find(|f| f["problem"] == "axes"))
        .unwrap_or_else(|| panic!("{}", found["findings"]));
    assert_eq!(
        finding["remedies"],
        json!([{ "type": "axes", "side": "keypoints", "order": "xy", "flip": "none" }])
    );
}

#[test]
fn keypoints_counted_from_one_are_told_and_can_be_read() {
    let fault = Fault {
        keypoint_numbers: 1,
        ..CLEAN
    };
    let folder = folder(fault);
    let refused = score(folder.path(), &[]);
    let told = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(3), "{told}");
    assert!(
        told.contains("keypoints run 1 to 4") && told.contains("--first-keypoint 1"),
        "{told}"
    );
    let clean = json(&score(self::folder(CLEAN).path(), &[]));
    let fixed = json(&score(folder.path(), &["--first-keypoint", "1"]));
    assert_eq!(numbers(&fixed), numbers(&clean));
}

/// DeepLabCut's CSV after filtering, as in many exports: lost points are written as (0, 0).
#[test]
fn lost_points_at_zero_are_told_and_can_be_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let header = |points: &[&str]| {
        let row = |name: &str, of: &dyn Fn(&str) -> [String; 3]| {
            let fields: Vec<String> = points.iter().flat_map(|point| of(point)).collect();
            format!("{name},{}\n", fields.join(","))
        };
        row("scorer", &|_| [(); 3].map(|()| "net".to_owned()))
            + &row("bodyparts", &|point| [(); 3].map(|()| point.to_owned()))
            + &row("coords", &|_| ["x", "y", "likelihood"].map(str::to_owned))
    };
    let table = |lost: &dyn Fn(usize) -> bool, mark: f64| {
        let mut text = header(&["nose", "tail"]);
        for t in 0..60 {
            let i = t as f64;
            let nose = [50.0 + 30.0 * (i * 0.7).sin(), 50.0 + 30.0 * (i * 0.4).cos()];
            let tail = [40.0 + 30.0 * (i * 0.2).cos(), 50.0 + 20.0 * (i * 1.1).sin()];
            let [x, y] = if lost(t) { [mark; 2] } else { nose };
            let _ = writeln!(text, "{t},{x},{y},0.9,{},{},0.9", tail[0], tail[1]);
        }
        text
    };
    std::fs::write(folder.path().join("gt.csv"), table(&|_| false, 0.0)).expect("written");
    let lost = |mark| table(&|t| t % 6 == 2, mark);
    std::fs::write(folder.path().join("kp.csv"), lost(0.0)).expect("written");
    let size = ["--image-size", "100x100"];
    let found = json(&score(folder.path(), &size));
    assert_eq!(
        found["findings"][0]["problem"], "zeros",
        "{}",
        found["findings"]
    );
    assert_eq!(found["findings"][0]["evidence"]["count"], 10);
    let error = |evaluation: &Value| {
        evaluation["objects"][0]["error"]
            .as_f64()
            .expect("an error")
    };
    assert!(error(&found) > 1e-3, "{}", error(&found));
    let options = [&size[..], &["--keypoints-zero-is-missing"]].concat();
    let fixed = json(&score(folder.path(), &options));
    assert!(fixed.get("findings").is_none(), "{}", fixed["findings"]);
    // The keypoint is the object where it was found. Errors are differences of sums of squares,
    // whose rounding is about 1e-12 of the variance.
    assert!(error(&fixed) < 1e-12, "{}", error(&fixed));
    assert_eq!(fixed["missing"], json!([10, 0]));

    // As other programs write it, for which there is no option.
    std::fs::write(folder.path().join("kp.csv"), lost(-1.0)).expect("written");
    let found = json(&score(folder.path(), &size));
    let finding = &found["findings"][0];
    assert_eq!(finding["problem"], "zeros", "{}", found["findings"]);
    assert_eq!(
        (&finding["evidence"]["count"], &finding["remedies"]),
        (&json!(10), &json!([]))
    );
    let text = finding["text"].to_string();
    assert!(
        text.contains("(-1, -1)") && text.contains("leave such cells empty"),
        "{text}"
    );
}

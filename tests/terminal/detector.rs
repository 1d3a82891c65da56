//! `--checkpoint model.onnx` of the real binary.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use serde_json::Value;

use crate::binary::{data, stderr, tracklens};

/// Runs `extract` with a model of `folder` and more options.
fn extract(folder: &Path, model: &str, options: &[&str]) -> Output {
    let path = |path: PathBuf| path.to_str().expect("UTF-8").to_owned();
    let model = path(folder.join(model));
    let (frames, out) = (path(data("data/panda_push")), path(folder.join("kp.csv")));
    let command = [
        "extract",
        "--checkpoint",
        &model,
        "--frames",
        &frames,
        "--out",
        &out,
    ];
    tracklens(&[&command, options].concat())
}

/// The points and confidences of the table that [`extract`] wrote are those that onnxruntime found.
fn assert_as_onnxruntime(folder: &Path, model: &str) {
    let table = fs::read_to_string(folder.join("kp.csv")).expect("a table");
    let found = table.lines().skip(1).flat_map(|line| {
        let fields: Vec<&str> = line.split(',').collect();
        [3, 4, 5].map(|at| fields[at].parse::<f64>().expect("a number"))
    });
    let found: Vec<f64> = found.collect();
    let json = fs::read(data("data/onnx/expected.json")).expect("expected keypoints");
    let json: Value = serde_json::from_slice(&json).expect("JSON");
    let frames = json[model]["frames"].as_object().expect("frames").values();
    let number = |value: &Value| value.as_f64().expect("a number");
    let wanted: Vec<f64> = frames
        .flat_map(|frame| {
            let points = frame["points"].as_array().expect("points").iter();
            let confidences = frame["confidences"].as_array().expect("numbers");
            points
                .zip(confidences)
                .flat_map(|(point, confidence)| [&point[0], &point[1], confidence].map(number))
        })
        .collect();
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(&wanted) {
        // As in the library's tests.
        let difference = (found - wanted).abs() / wanted.abs().max(1.0);
        assert!(difference < 1e-4, "{model}: {found}, {wanted}");
    }
}

fn with_models() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["heatmaps", "any-size", "simcc", "points"] {
        let file = format!("{name}.onnx");
        fs::copy(data("data/onnx").join(&file), folder.path().join(&file)).expect("a copy");
    }
    folder
}

#[test]
fn models_say_the_rest_by_options_or_by_metadata() {
    let folder = with_models();
    for (name, options) in [
        ("heatmaps", &["--normalize", "imagenet"][..]),
        (
            "any-size",
            &[
                "--input-size",
                "frame",
                "--normalize",
                "symmetric",
                "--temperature",
                "0.05",
            ],
        ),
        ("simcc", &[]),
        (
            "points",
            &[
                "--normalize",
                "bytes",
                "--unit",
                "fraction",
                "--columns",
                "yxc",
                "--threads",
                "1",
            ],
        ),
    ] {
        let output = extract(folder.path(), &format!("{name}.onnx"), options);
        assert!(output.status.success(), "{}", stderr(&output));
        assert_as_onnxruntime(folder.path(), name);
    }
}

#[test]
fn what_is_missing_is_asked_for_once() {
    let folder = with_models();
    let output = extract(folder.path(), "points.onnx", &[]);
    assert_eq!(output.status.code(), Some(3));
    let said = stderr(&output);
    assert!(
        said.contains(
            "the model does not say how pixels are scaled (mean, std), what the numbers of a point are (columns), the \
             unit of its points (unit)"
        ),
        "{said}"
    );
    for option in [
        "--normalize imagenet",
        "--columns xy",
        "--unit px",
        "--remember",
    ] {
        assert!(said.contains(option), "{said}");
    }
    assert!(!folder.path().join("points.onnx.json").exists());

    let options = [
        "--normalize",
        "bytes",
        "--unit",
        "fraction",
        "--columns",
        "yxc",
        "--remember",
    ];
    let output = extract(folder.path(), "points.onnx", &options);
    assert!(output.status.success(), "{}", stderr(&output));
    let settings = fs::read_to_string(folder.path().join("points.onnx.json")).expect("settings");
    let settings: Value = serde_json::from_str(&settings).expect("JSON");
    assert_eq!(settings["unit"], "fraction");
    assert_eq!(settings["columns"], "yxc");

    let output = extract(folder.path(), "points.onnx", &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_as_onnxruntime(folder.path(), "points");

    fs::write(folder.path().join("points.onnx.json"), "{\"unit\": \"mm\"}").expect("a file");
    let output = extract(folder.path(), "points.onnx", &[]);
    assert_eq!(output.status.code(), Some(3));
    let said = stderr(&output);
    assert!(
        said.contains("points.onnx.json: these are no settings of a detector"),
        "{said}"
    );
}

#[test]
fn a_detector_is_scored_in_one_go() {
    let folder = with_models();
    let path = |path: PathBuf| path.to_str().expect("UTF-8").to_owned();
    let (model, frames) = (
        path(folder.path().join("simcc.onnx")),
        path(data("data/panda_push")),
    );
    let output = tracklens(&[
        "eval",
        "--checkpoint",
        &model,
        "--frames",
        &frames,
        "--json",
    ]);
    assert!(output.status.success(), "{}", stderr(&output));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(report.is_object(), "{report}");
    assert!(stderr(&output).contains("SimCC `simcc_x` and `simcc_y`, argmax"));
}

#[test]
fn options_of_models_mean_nothing_to_a_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    let checkpoint = data("golden/dsae-tiny.safetensors");
    fs::copy(checkpoint, folder.path().join("w.safetensors")).expect("a copy");
    let output = extract(folder.path(), "w.safetensors", &["--unit", "px"]);
    assert_eq!(output.status.code(), Some(4));
    assert!(stderr(&output).contains("the options for ONNX models say nothing of a checkpoint"));
}

#[test]
fn an_exported_encoder_is_extracted_as_its_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |path: PathBuf| path.to_str().expect("UTF-8").to_owned();
    let checkpoint = path(data("golden/keynet-vel-std-bg-tiny.safetensors"));
    let model = path(folder.path().join("encoder.onnx"));
    let output = tracklens(&["export", "--checkpoint", &checkpoint, "--onnx", &model]);
    assert!(output.status.success(), "{}", stderr(&output));
    let table = || {
        let table = fs::read_to_string(folder.path().join("kp.csv")).expect("a table");
        let rows = table.lines().skip(1).map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            let point = [3, 4].map(|at| fields[at].parse::<f64>().expect("a number"));
            (fields[..3].join(","), point)
        });
        rows.collect::<Vec<_>>()
    };
    let output = extract(folder.path(), "encoder.onnx", &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    let found = table();
    fs::copy(&checkpoint, folder.path().join("w.safetensors")).expect("a copy");
    let output = extract(folder.path(), "w.safetensors", &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    for ((key, found), (wanted_key, wanted)) in found.iter().zip(table()) {
        assert_eq!(*key, wanted_key);
        for axis in 0..2 {
            // As in the library's tests.
            assert!(
                (found[axis] - wanted[axis]).abs() < 1e-4,
                "{key}: {found:?}, {wanted:?}"
            );
        }
    }
}

#[test]
fn inspect_says_what_a_model_is_and_what_it_leaves_open() {
    let folder = with_models();
    let inspect = |name: &str, options: &[&str]| {
        let path = folder.path().join(name);
        tracklens(&[&["inspect", path.to_str().expect("UTF-8")], options].concat())
    };
    let found = |output: Output| -> Value {
        assert!(output.status.success(), "{}", stderr(&output));
        serde_json::from_slice(&output.stdout).expect("JSON")
    };
    // The scale of the pixels is in no graph.
    let open = found(inspect("heatmaps.onnx", &[]));
    assert_eq!(open["format"], "onnx");
    assert_eq!(open["input"]["element"], "float");
    assert!(
        open["operators"]
            .as_array()
            .expect("names")
            .contains(&"Conv".into())
    );
    assert!(open.get("runs").is_none());
    let text = open["open"].as_str().expect("a text");
    assert!(text.contains("how pixels are scaled"), "{text}");
    // What lies beside the model says the rest.
    let beside = folder.path().join("heatmaps.onnx.json");
    fs::write(beside, r#"{"mean": [0.5], "std": [0.5]}"#).expect("written");
    let said = found(inspect("heatmaps.onnx", &[]));
    assert!(said.get("open").is_none());
    let text = said["runs"].as_str().expect("a text");
    assert!(
        text.contains("mean [0.5], std [0.5]") && text.contains("argmax"),
        "{text}"
    );

    let refused = inspect("simcc.onnx", &["--plan", "64x64"]);
    assert_eq!(refused.status.code(), Some(4));
    assert!(stderr(&refused).contains("this is an ONNX model"));
}

//! ONNX models of detectors: keypoints against onnxruntime's, and models that are refused.
//! `tests/onnx/make_models.py` made both.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use serde_json::Value;
use tracklens::checkpoint::Checkpoint;
use tracklens::data::Frame;
use tracklens::detector::{Graph, OnnxExtractor, Plan, Settings};
use tracklens::extract::{CpuExtractor, Extractor as _};
use tracklens::{Error, Reason};

/// Two runtimes add the same products in another order, and a parabola through a flat peak magnifies
/// it. 1e-4 is 1/80 of a pixel at 256 px.
const TOLERANCE: f64 = 1e-4;

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../tests/data")
        .join(name)
}

fn model(name: &str) -> Vec<u8> {
    fs::read(data("onnx").join(format!("{name}.onnx"))).expect("a model")
}

fn frame(name: &str) -> Frame {
    let image = fs::read(data("panda_push").join(name)).expect("a frame");
    Frame::decode(&image).expect("an image")
}

/// Settings, and points and confidences by the path of a frame.
struct Expected {
    settings: Settings,
    frames: BTreeMap<String, (Vec<[f64; 2]>, Vec<f64>)>,
}

fn expected() -> BTreeMap<String, Expected> {
    let json = fs::read(data("onnx/expected.json")).expect("expected keypoints");
    let json: BTreeMap<String, Value> = serde_json::from_slice(&json).expect("JSON");
    let numbers = |value: &Value| -> Vec<f64> {
        let values = value.as_array().expect("an array").iter();
        values.map(|v| v.as_f64().expect("a number")).collect()
    };
    let model = |(name, model): (String, Value)| {
        let frame = |(path, found): (&String, &Value)| {
            let points = found["points"].as_array().expect("points").iter();
            let points = points.map(|p| numbers(p).try_into().expect("x and y"));
            (
                path.clone(),
                (points.collect(), numbers(&found["confidences"])),
            )
        };
        let frames = model["frames"].as_object().expect("frames");
        let expected = Expected {
            settings: settings(&model["settings"]),
            frames: frames.iter().map(frame).collect(),
        };
        (name, expected)
    };
    json.into_iter().map(model).collect()
}

fn settings(json: &Value) -> Settings {
    Settings::from_json(json.to_string().as_bytes()).expect("settings")
}

fn refusal(result: tracklens::Result<OnnxExtractor>) -> Error {
    match result {
        Ok(_) => panic!("it opens"),
        Err(error) => error,
    }
}

#[test]
fn foreign_models_find_what_onnxruntime_finds() {
    for (name, expected) in expected() {
        let extractor = OnnxExtractor::new(model(&name), &expected.settings)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        let mut largest = 0.0f64;
        for (path, (points, confidences)) in &expected.frames {
            let found = extractor.extract_frame(&frame(path)).expect("keypoints");
            assert_eq!(found.points.len(), points.len(), "{name}");
            assert_eq!(extractor.keypoints(), points.len(), "{name}");
            for (n, (point, wanted)) in found.points.iter().zip(points).enumerate() {
                for axis in 0..2 {
                    let difference = (f64::from(point[axis]) - wanted[axis]).abs();
                    assert!(
                        difference < TOLERANCE,
                        "{name} {path} {n}: {point:?}, {wanted:?}"
                    );
                    largest = largest.max(difference);
                }
            }
            let sure = found.confidences.expect("confidences");
            assert_eq!(sure.len(), confidences.len(), "{name}");
            for (confidence, wanted) in sure.iter().zip(confidences) {
                let difference = (f64::from(*confidence) - wanted).abs();
                assert!(
                    difference < TOLERANCE * wanted.abs().max(1.0),
                    "{name} {path}"
                );
            }
        }
        println!("{name}: largest difference {largest:.1e}");
    }
}

#[cfg(feature = "cli")]
#[test]
fn exported_encoders_find_what_the_engine_finds() {
    for name in [
        "basic-vel-std-bg-tiny.pth",
        "dsae-tiny.safetensors",
        "keynet-vel-std-bg-tiny.safetensors",
    ] {
        let bytes = fs::read(data("../golden").join(name)).expect("a checkpoint");
        let checkpoint = Checkpoint::from_bytes(&bytes).expect("a checkpoint");
        let engine = CpuExtractor::new(&checkpoint).expect("an encoder");
        let exported = checkpoint.to_onnx().expect("a model");
        let onnx = OnnxExtractor::new(exported, &Settings::default()).expect("a detector");
        assert_eq!(onnx.keypoints(), engine.keypoints());
        assert_eq!(onnx.input_size(), engine.input_size());
        assert_eq!(onnx.grid([256, 256]), engine.grid([256, 256]));
        for path in ["seq_0000/frame_000.png", "seq_0012/frame_004.png"] {
            let frame = frame(path);
            let [a, b] = [engine.extract_frame(&frame), onnx.extract_frame(&frame)]
                .map(|found| found.expect("keypoints").points);
            for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
                assert!(
                    f64::from((a - b).abs()) < TOLERANCE,
                    "{name} {path}: {a}, {b}"
                );
            }
        }
    }
}

#[test]
fn what_a_model_leaves_open_is_named() {
    let missing = |name: &str, json: &str| {
        let settings = Settings::from_json(json.as_bytes()).expect("settings");
        let error = refusal(OnnxExtractor::new(model(name), &settings));
        match error.reason() {
            Some(Reason::DetectorSettings { missing }) => missing.join(" "),
            _ => panic!("{error}"),
        }
    };
    assert_eq!(missing("heatmaps", "{}"), "normalization");
    assert_eq!(missing("any-size", "{}"), "inputSize normalization");
    assert_eq!(missing("points", "{}"), "normalization columns unit");
    assert_eq!(missing("simcc", r#"{"output": "heatmaps"}"#), "outputNames");
    let said = Settings::from_json(br#"{"std": [1]}"#).expect("settings");
    let graph = Graph::read(&model("heatmaps")).expect("a graph");
    let plan = Plan::new(&graph, &said).expect("a plan");
    assert_eq!(
        plan.to_string(),
        "128 x 96, rgb, nchw, mean [0.0], std [1.0]; heat maps `heatmaps`, argmax"
    );
}

#[test]
fn settings_that_contradict_the_model_are_refused() {
    let error = |name: &str, json: &str| {
        let settings = Settings::from_json(json.as_bytes()).expect("settings");
        refusal(OnnxExtractor::new(model(name), &settings)).to_string()
    };
    assert_eq!(
        error("heatmaps", r#"{"mean": [0], "input_size": [64, 64]}"#),
        "the input size is said to be 64 x 64, and the model takes `image` [?, 3, 96, 128]"
    );
    assert_eq!(
        error("heatmaps", r#"{"mean": [0], "input_size": "frame"}"#),
        "the input size is said to be that of the frames, and the model takes `image` [?, 3, 96, 128]"
    );
    assert_eq!(
        error("heatmaps", r#"{"mean": [0], "channels": "gray"}"#),
        "the channels are said to be gray, and the input `image` [?, 3, 96, 128] of the model has 3"
    );
    assert_eq!(
        error("heatmaps", r#"{"mean": [0], "output_names": ["maps"]}"#),
        "the model has no output `maps`; its outputs are `heatmaps` [?, 5, 24, 32]"
    );
    // What comes out is looked at, too: a map is no list of points.
    let settings = settings(&serde_json::json!({
        "mean": [0], "output": "points", "unit": "px", "columns": "xy"
    }));
    let error = OnnxExtractor::new(model("heatmaps"), &settings)
        .and_then(|extractor| extractor.extract_frame(&frame("seq_0000/frame_000.png")))
        .expect_err("no points");
    assert!(
        error
            .to_string()
            .contains("came out as [1, 5, 24, 32]; expected points of 2 numbers"),
        "{error}"
    );
    for (json, wanted) in [
        (r#"{"std": [0]}"#, "a std of 0 would divide"),
        (r#"{"mean": [1, 2]}"#, "expected one number, or three"),
        (r#"{"temperature": -1}"#, "expected a number above 0"),
        (
            r#"{"input_size": [0, 3]}"#,
            "expected [width, height] in pixels, or \"frame\"",
        ),
        (r#"{"sizes": 3}"#, "unknown field `sizes`"),
        (r#"{"unit": "mm"}"#, "unknown variant `mm`"),
    ] {
        let error = Settings::from_json(json.as_bytes()).expect_err("no settings");
        assert!(error.to_string().contains(wanted), "{error}");
    }
}

#[test]
fn models_that_cannot_run_say_why() {
    let error = |name: &str| {
        let bytes = fs::read(data("onnx/bad").join(format!("{name}.onnx"))).expect("a model");
        let settings = Settings::from_json(br#"{"mean": [0]}"#).expect("settings");
        OnnxExtractor::new(bytes, &settings)
            .and_then(|extractor| extractor.extract_frame(&frame("seq_0000/frame_000.png")))
            .expect_err(name)
            .to_string()
    };
    for (name, wanted) in [
        ("operator", "operators that do not run here: Det;"),
        (
            "domain",
            "operators that do not run here: com.microsoft.FusedConv;",
        ),
        ("opset", "operator set 99; expected 1 to 26"),
        ("external", "lie in another file (weights.bin)"),
        (
            "two-inputs",
            "2 inputs: `image` [1, 3, 16, 16], `scale` [1]",
        ),
        ("vector", "takes `vector` [1, 128]; expected an image"),
        (
            "channels",
            "`image` [1, 7, 16, 16] of the model has 7 channels",
        ),
        ("batch", "takes 8 images at a time"),
        (
            "integers",
            "values that are neither floats, unsigned bytes nor 32-bit integers",
        ),
        ("shapes", "the model does not run: "),
        ("missing", "the model does not "),
    ] {
        let error = error(name);
        assert!(error.contains(wanted), "{name}: {error}");
    }
    for bytes in [&b""[..], b"not a model", b"\x08\x08"] {
        let error = Graph::read(bytes).expect_err("no model").to_string();
        assert!(error.starts_with("not an ONNX model"), "{error}");
        assert!(!Graph::is_onnx(bytes));
    }
    let whole = model("heatmaps");
    for length in (0..whole.len()).step_by(997) {
        let cut = whole[..length].to_vec();
        assert!(OnnxExtractor::new(cut, &settings(&serde_json::json!({"mean": [0]}))).is_err());
    }
}

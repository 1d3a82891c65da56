//! `convert`, `inspect` and `export` of the real binary, and every command on every format.

use std::path::Path;
use std::process::Output;

use serde_json::Value;
use tracklens::checkpoint::Checkpoint;

use crate::binary::{data, stderr, tracklens};

fn convert(from: &Path, to: &Path) -> Output {
    tracklens(&["convert".as_ref(), from.as_os_str(), to.as_os_str()])
}

fn inspect(file: &Path) -> Value {
    let output = tracklens(&["inspect".as_ref(), file.as_os_str()]);
    assert!(output.status.success(), "{}", stderr(&output));
    serde_json::from_slice(&output.stdout).expect("JSON on the standard output")
}

#[test]
fn a_checkpoint_goes_through_every_format_and_extracts_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let original = data("golden/basic-vel-std-bg-tiny.pth");
    let read = |path: &Path| {
        Checkpoint::from_bytes(&std::fs::read(path).expect("a file")).expect("a checkpoint")
    };
    let extract = |checkpoint: &Path| {
        let table = folder.path().join("kp.csv");
        let frames = data("data/panda_push");
        let mut arguments = vec![
            "extract".as_ref(),
            "--quiet".as_ref(),
            "--checkpoint".as_ref(),
        ];
        arguments.extend([
            checkpoint.as_os_str(),
            "--frames".as_ref(),
            frames.as_os_str(),
        ]);
        arguments.extend(["--out".as_ref(), table.as_os_str()]);
        let output = tracklens(&arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        std::fs::read_to_string(table).expect("a table")
    };
    let expected = extract(&original);
    let mut last = original.clone();
    for ending in ["bpk", "pt", "SAFETENSORS", "pth", "safetensors"] {
        let next = folder.path().join(format!("weights.{ending}"));
        let output = convert(&last, &next);
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(stderr(&output).starts_with("basic-kp4-vel-std-bg written to "));
        assert_eq!(read(&next), read(&original), "{ending}");
        assert_eq!(extract(&next), expected, "{ending}");
        last = next;
    }
}

#[test]
fn inspect_says_what_a_checkpoint_is() {
    let found = inspect(&data("golden/basic-vel-std-bg-tiny.pth"));
    assert_eq!(found["schema"], "tracklens/checkpoint/1");
    assert_eq!(found["format"], "pytorch");
    assert_eq!(found["name"], "basic-kp4-vel-std-bg");
    assert_eq!(found["config"]["target_size"], serde_json::json!([16, 16]));
    assert_eq!(found["epoch"], 499);
    let training = &found["training"];
    assert_eq!(
        (&training["epochs"], &training["batch"]),
        (&500.into(), &32.into())
    );
    assert_eq!(
        (&training["learning_rate"], &training["velocity_weight"]),
        (&0.001.into(), &0.1.into())
    );
    assert_eq!(found["other_tensors"], serde_json::json!([]));

    // The weights that `tracklens train` wrote for the example of the page.
    let found = inspect(&data("../web/example/checkpoint.safetensors"));
    assert_eq!(found["format"], "safetensors");
    assert_eq!(found["parameters"]["encoder"], 42_096);
    assert!(found["epoch"].is_u64() && found["training"]["learning_rate"].is_f64());
}

#[test]
fn inspect_plans_the_layers_for_a_size() {
    let file = data("golden/dsae-tiny.safetensors");
    let plan = |size: &str| {
        tracklens(&[
            "inspect".as_ref(),
            "--plan".as_ref(),
            size.as_ref(),
            file.as_os_str(),
        ])
    };
    let output = plan("100x76");
    assert!(output.status.success(), "{}", stderr(&output));
    let found: Value = serde_json::from_slice(&output.stdout).expect("JSON on the standard output");
    let first = &found["plan"][0];
    assert_eq!(first["name"], "encoder.conv1");
    assert_eq!(first["kernel"], "direct 7x7, stride 2 + ReLU");
    assert_eq!(first["size"], serde_json::json!([47, 35]));
    assert_eq!(first["defined"], 47 * 35 * 6 * 3 * 49);
    let output = plan("16x16");
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("too small for this encoder: `encoder.conv3`"));
}

#[test]
fn export_writes_a_model_and_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("encoder.onnx");
    for name in [
        "basic-vel-std-bg-tiny.pth",
        "dsae-tiny.safetensors",
        "keynet-vel-std-bg-tiny.safetensors",
    ] {
        let checkpoint = data("golden").join(name);
        let output = tracklens(&[
            "export".as_ref(),
            "--checkpoint".as_ref(),
            checkpoint.as_os_str(),
            "--onnx".as_ref(),
            model.as_os_str(),
        ]);
        assert!(output.status.success(), "{}", stderr(&output));
        // What the model computes is compared by tests/onnx/check_onnx.py.
        let bytes = std::fs::read(&model).expect("a model");
        for part in [
            "tracklens.config",
            "keypoints_ndc",
            "encoder.aggregate_conv.weight",
            "Softmax",
        ] {
            let found = bytes
                .windows(part.len())
                .any(|window| window == part.as_bytes());
            assert!(
                found || (part.contains("aggregate") && name.starts_with("dsae")),
                "{name}: {part}"
            );
        }
    }
}

#[test]
fn what_cannot_be_converted_or_inspected_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let original = data("golden/dsae-tiny.safetensors");
    let expect = |output: &Output, code: i32, part: &str| {
        assert_eq!(output.status.code(), Some(code));
        assert!(stderr(output).contains(part), "{}", stderr(output));
    };
    let to = |name: &str| convert(&original, &folder.path().join(name));
    expect(
        &to("w.onnx"),
        3,
        "unknown checkpoint format `.onnx`; expected .safetensors, .pth or .bpk",
    );
    expect(&to("weights"), 3, "unknown checkpoint format `.`");
    let export = |name: &str| {
        let model = folder.path().join(name);
        tracklens(&[
            "export".as_ref(),
            "--checkpoint".as_ref(),
            original.as_os_str(),
            "--onnx".as_ref(),
            model.as_os_str(),
        ])
    };
    expect(&export("w.pt"), 2, "ends in .pt");
    expect(&export("w"), 2, "has no ending");
    expect(&to("none/w.pth"), 1, "lies in no folder that exists");
    assert_eq!(
        std::fs::read_dir(folder.path()).expect("a folder").count(),
        0,
        "nothing is left behind"
    );

    let cut = folder.path().join("cut.pth");
    let bytes = std::fs::read(data("golden/basic-vel-std-bg-tiny.pth")).expect("a checkpoint");
    std::fs::write(&cut, &bytes[..bytes.len() - 500]).expect("written");
    let output = tracklens(&["inspect".as_ref(), cut.as_os_str()]);
    expect(&output, 3, "cut.pth: not a complete .pth file (46389 bytes");
    expect(
        &convert(&cut, &folder.path().join("w.bpk")),
        3,
        "cut.pth: not a complete .pth file",
    );
    expect(
        &tracklens(&["inspect", "/nowhere.pth"]),
        1,
        "/nowhere.pth: ",
    );
}

#[test]
fn a_checkpoint_is_not_converted_over_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let own = folder.path().join("w.safetensors");
    std::fs::copy(data("golden/dsae-tiny.safetensors"), &own).expect("copied");
    let before = std::fs::read(&own).expect("a checkpoint");
    let other_name = folder.path().join("./w.safetensors");
    let output = convert(&own, &other_name);
    assert_eq!(output.status.code(), Some(3));
    assert!(
        stderr(&output).contains("the output is the input file; give another path"),
        "{}",
        stderr(&output)
    );
    assert_eq!(std::fs::read(&own).expect("a checkpoint"), before);
}

/// Systems promise more memory than they have, so the program would be killed with no message.
#[cfg(target_os = "linux")]
#[test]
fn a_checkpoint_larger_than_memory_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let huge = folder.path().join("huge.safetensors");
    // Without content it takes no room on the disk.
    let file = std::fs::File::create(&huge).expect("a file");
    file.set_len(4 << 40).expect("a sparse file");
    let output = tracklens(&["inspect".as_ref(), huge.as_os_str()]);
    assert!(!output.status.success());
    let message = stderr(&output);
    assert!(
        message.contains("huge.safetensors: there is no memory for 4194304 MiB of file, and "),
        "{message}"
    );
}

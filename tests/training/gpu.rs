//! The GPU against the CPU and the authors' modules. `cargo xtask test` runs this on Mesa's
//! lavapipe, a GPU in software, so that no card is needed; by itself it runs on the first GPU there
//! is.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::reference::{
    TINY, Tolerances, equals_the_reference, largest, tiny_training_equals_the_reference,
};
use crate::shared::golden;
use burn::prelude::Device;
use serde_json::Value;
use tracklens::checkpoint::{self, Checkpoint};
use tracklens::device::DeviceKind;
use tracklens::model::open;

fn gpu() -> Device {
    let opened = open(DeviceKind::Gpu).expect("a GPU, or Mesa's lavapipe");
    println!("{}", opened.adapter.expect("a description"));
    opened.device
}

#[test]
fn tiny_saes_equal_the_reference() {
    for name in TINY {
        println!("{name}");
        equals_the_reference(&golden(&format!("{name}.safetensors")), &["64"], &gpu());
    }
}

#[test]
fn three_steps_of_training_equal_the_reference() {
    // Rounding decides about a ReLU here and there (1e-3 of the gradients, 5e-3 of one, measured in
    // the KeyNet), and about the sign of gradients near 0, of which Adam's first steps make whole
    // ones: with the weights at the start changed by one rounding, the CPU's own losses move by
    // 7e-3 in the third step, as they do on the GPU.
    let tolerances = Tolerances {
        losses: [1e-4, 2e-2],
        gradients: [5e-3, 2e-2],
        weights: None,
        update: 5e-2,
    };
    tiny_training_equals_the_reference(&tolerances, &gpu());
}

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../tests")
        .join(name)
}

fn tracklens(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tracklens"));
    command.args(arguments).arg("--quiet");
    command
}

fn succeeded(output: &Output) -> String {
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{stderr}");
    stderr
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

fn train(out: &Path, more: &[&str]) -> Command {
    let (data, out) = (path("data/panda_push"), text(out));
    let mut arguments = vec!["train", "--data", text(&data), "--out", out];
    arguments.extend("--arch basic-vel-std-bg --keypoints 4 --encoder-channels 4,6,8".split(' '));
    arguments.extend("--decoder-channels 8,6,4 --input-size 32 --target-size 16".split(' '));
    arguments.extend("--batch 2 --split 0.67,0.33".split(' '));
    arguments.extend(more);
    tracklens(&arguments)
}

fn run(command: &mut Command) -> String {
    succeeded(&command.output().expect("tracklens starts"))
}

fn weights(run: &Path) -> BTreeMap<String, checkpoint::Tensor> {
    let bytes = fs::read(run.join("checkpoint_final.safetensors")).expect("a checkpoint");
    Checkpoint::from_safetensors(&bytes).expect("valid").tensors
}

/// The largest difference of a weight.
fn difference(a: &Path, b: &Path) -> f32 {
    let (a, b) = (weights(a), weights(b));
    assert_eq!(a.len(), b.len());
    a.iter()
        .map(|(name, tensor)| largest(&tensor.data, &b[name].data))
        .fold(0.0, f32::max)
}

#[test]
fn a_training_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().expect("a folder");
    let [parts, whole, cpu] = ["parts", "whole", "cpu"].map(|name| folder.path().join(name));
    let gpu = ["--device", "gpu"];
    let told = run(train(&parts, &gpu).args(["--epochs", "1"]));
    assert!(told.contains("device: "), "{told}");
    let config: Value =
        serde_json::from_slice(&fs::read(parts.join("config.json")).expect("a config"))
            .expect("JSON");
    assert_eq!(config["device"], "gpu");
    let name = config["adapter"]["name"].as_str().expect("a name");
    assert!(told.contains(name), "{told}");
    let is_software = config["adapter"]["software"] == true;
    assert_eq!(
        told.contains("slower than --device cpu"),
        is_software,
        "{told}"
    );

    run(train(&parts, &gpu).args(["--epochs", "2", "--resume"]));
    run(train(&whole, &gpu).args(["--epochs", "2"]));
    run(train(&cpu, &[]).args(["--epochs", "2"]));
    let resumed = difference(&parts, &whole);
    let devices = difference(&cpu, &whole);
    println!("resumed: {resumed:.1e}; from the CPU: {devices:.1e}");
    // A lost state of the optimizer would show as whole steps of Adam, 1e-3 each.
    assert!(resumed < 1e-4);

    let other = train(&parts, &["--epochs", "3", "--resume"])
        .output()
        .expect("started");
    let stderr = String::from_utf8_lossy(&other.stderr);
    assert_eq!(other.status.code(), Some(4), "{stderr}");
    assert!(
        stderr.contains("`device` is \"gpu\" there and null here"),
        "{stderr}"
    );
}

#[test]
fn extracted_keypoints_are_those_of_the_cpu() {
    let folder = tempfile::tempdir().expect("a folder");
    let [on_gpu, on_cpu] = ["gpu.csv", "cpu.csv"].map(|name| folder.path().join(name));
    for name in TINY {
        let checkpoint = path("golden").join(format!("{name}.safetensors"));
        let frames = path("data/panda_push");
        for (device, out) in [("gpu", &on_gpu), ("cpu", &on_cpu)] {
            run(&mut tracklens(&[
                "extract",
                "--checkpoint",
                text(&checkpoint),
                "--frames",
                text(&frames),
                "--out",
                text(out),
                "--device",
                device,
            ]));
        }
        let [a, b] = [&on_gpu, &on_cpu].map(|path| fs::read_to_string(path).expect("a table"));
        assert_eq!(a.lines().count(), b.lines().count());
        let mut values = [Vec::new(), Vec::new()];
        for (a, b) in a.lines().zip(b.lines()).skip(1) {
            let [a, b] = [a, b].map(|line| line.split(',').collect::<Vec<_>>());
            assert_eq!(a[..3], b[..3]);
            for (values, cells) in values.iter_mut().zip([a, b]) {
                values.extend(
                    cells[3..]
                        .iter()
                        .map(|v| v.parse::<f32>().expect("a number")),
                );
            }
        }
        let difference = largest(&values[0], &values[1]);
        println!("{name}: {} coordinates, {difference:.1e}", values[0].len());
        assert!(!values[0].is_empty() && difference < crate::reference::KEYPOINTS);
    }
}

/// Hides every driver from a command.
#[cfg(target_os = "linux")]
fn without_gpu(mut command: Command, folder: &Path) -> Command {
    for variable in [
        "VK_DRIVER_FILES",
        "VK_ICD_FILENAMES",
        "__EGL_VENDOR_LIBRARY_FILENAMES",
    ] {
        command.env(variable, folder.join("no driver"));
    }
    command
}

#[test]
#[cfg(target_os = "linux")]
fn a_missing_gpu_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let output = without_gpu(train(&out, &["--device", "gpu"]), folder.path())
        .output()
        .expect("tracklens starts");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{stderr}");
    assert!(
        stderr.contains(
            "no GPU found; looked for one with a driver for Vulkan, Direct3D 12 or OpenGL"
        ),
        "{stderr}"
    );
    assert!(!out.exists());

    let [checkpoint, frames] = ["golden/dsae-tiny.safetensors", "data/panda_push"].map(path);
    let (checkpoint, frames, out) = (text(&checkpoint), text(&frames), text(&out));
    let extract = [
        "extract",
        "--checkpoint",
        checkpoint,
        "--frames",
        frames,
        "--out",
        out,
        "--device",
        "gpu",
    ];
    let output = without_gpu(tracklens(&extract), folder.path())
        .output()
        .expect("tracklens starts");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{stderr}");
    assert!(stderr.contains("tracklens: no GPU found"), "{stderr}");
}

#[test]
#[cfg(target_os = "linux")]
fn the_cpu_needs_no_gpu() {
    let folder = tempfile::tempdir().expect("a folder");
    let [parts, whole] = ["parts", "whole"].map(|name| folder.path().join(name));
    for (out, more) in [
        (&parts, &["--epochs", "1"][..]),
        (&parts, &["--epochs", "2", "--resume"]),
        (&whole, &["--epochs", "2"]),
    ] {
        run(&mut without_gpu(train(out, more), folder.path()));
    }
    assert_eq!(weights(&parts), weights(&whole));
}

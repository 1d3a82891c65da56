//! Folders of runs as `tracklens train` leaves them, with errors that are known.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

const OBJECTS: [&str; 2] = ["cube", "eef"];

/// The error of an object in a run at its end.
pub fn error(architecture: &str, seed: u64, object: usize) -> f64 {
    let base = if architecture == "basic" { 0.04 } else { 0.004 };
    base * (1.0 + ((seed * 7 + object as u64 * 3) % 5) as f64 / 4.0) * (1.0 + 9.0 * object as f64)
}

/// What `config.json` of a run holds.
pub fn config(architecture: &str, seed: u64, epochs: u32) -> Value {
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

/// Writes the folder of a complete run.
pub fn write_run(folder: &Path, architecture: &str, seed: u64, epochs: u32) {
    fs::create_dir_all(folder).expect("a folder");
    let mut log = String::new();
    for epoch in 1..=epochs {
        let factor = 1.0 + f64::from(epochs - epoch) / 3.0;
        let errors: Value = OBJECTS
            .iter()
            .enumerate()
            .map(|(k, name)| {
                (
                    (*name).to_owned(),
                    json!(error(architecture, seed, k) * factor),
                )
            })
            .collect::<serde_json::Map<_, _>>()
            .into();
        let losses =
            json!({ "total": 0.01 * factor, "reconstruction": 0.01 * factor, "velocity": 0.0 });
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
pub fn sweep(folder: &Path) {
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

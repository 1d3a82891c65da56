//! What `tools/panda_push/record.py` writes is read by the real binary.
//!
//! The environment variable `TRACKLENS_RECORDED` names the folder of a recording; `cargo xtask
//! test` makes one of two sequences. Without it these tests say that they are skipped.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tracklens::data::Frame;

const SEQUENCES: usize = 2;
const FRAMES: usize = 10;
const OBJECTS: [&str; 3] = ["cube", "target", "eef"];

fn recorded() -> Option<PathBuf> {
    let folder = std::env::var_os("TRACKLENS_RECORDED").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: TRACKLENS_RECORDED names no recording; `cargo xtask test` makes one");
    }
    folder
}

fn json(file: &Path) -> Value {
    let text = fs::read(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    serde_json::from_slice(&text).expect("JSON")
}

#[test]
fn every_recorded_frame_is_scored_for_every_object() {
    let Some(recorded) = recorded() else { return };
    let example =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../web/example/checkpoint.safetensors");
    let output = Command::new(env!("CARGO_BIN_EXE_tracklens"))
        .args(["eval", "--json", "--checkpoint"])
        .arg(example)
        .arg("--frames")
        .arg(&recorded)
        .arg("--truth")
        .arg(recorded.join("ground_truth.csv"))
        .output()
        .expect("the binary runs");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    let result: Value =
        serde_json::from_slice(&output.stdout).expect("JSON on the standard output");
    assert_eq!(result["frames"], SEQUENCES * FRAMES);
    assert_eq!(result["excluded"], 0);
    let objects = result["objects"].as_array().expect("objects");
    let names: Vec<_> = objects.iter().map(|object| &object["name"]).collect();
    assert_eq!(names, OBJECTS);
    for object in objects {
        assert_eq!(object["frames"], SEQUENCES * FRAMES);
        assert!(object["error"].is_f64(), "{object}");
    }
    assert!(
        !told.contains("do not count") && !result["warnings"].to_string().contains("do not count"),
        "{told}{}",
        result["warnings"]
    );
}

#[test]
fn a_recording_has_whole_sequences_and_says_what_was_dropped() {
    let Some(recorded) = recorded() else { return };
    let meta = json(&recorded.join("meta.json"));
    assert_eq!(meta["sequences"], SEQUENCES);
    assert_eq!(meta["frames"], FRAMES);
    let count = |name: &str| meta["statistics"][name].as_u64().expect("a count");
    assert_eq!(
        count("rendered"),
        (SEQUENCES * FRAMES) as u64 + count("dropped")
    );
    // The first episode of the recorded seed is solved at once.
    assert_eq!((count("successes"), count("dropped")), (1, 1));
}

#[test]
fn pushes_move_arm_and_cube_in_every_sequence() {
    let Some(pushes) = std::env::var_os("TRACKLENS_PUSHES").map(PathBuf::from) else {
        println!("skipped: TRACKLENS_PUSHES names no recording; `cargo xtask test` makes one");
        return;
    };
    assert_eq!(json(&pushes.join("meta.json"))["policy"], "push");
    let table = fs::read_to_string(pushes.join("ground_truth.csv")).expect("a table");
    for sequence in 0..3 {
        for object in ["cube", "eef"] {
            let positions: Vec<[f64; 2]> = table
                .lines()
                .map(|line| line.split(',').collect::<Vec<_>>())
                .filter(|row| row[0] == sequence.to_string() && row[2] == object)
                .map(|row| [3, 4].map(|axis| row[axis].parse().expect("a number")))
                .collect();
            assert_eq!(positions.len(), 30);
            let moved = positions.iter().map(|[x, y]| {
                let [x0, y0] = positions[0];
                (x - x0).hypot(y - y0)
            });
            let farthest = moved.fold(0.0, f64::max);
            // The cube is about 0.1 wide.
            assert!(
                farthest > 0.03,
                "{object} of sequence {sequence}: {farthest}"
            );
        }
    }
}

/// The camera and the scene: the first frame against one of the recording that the example and the
/// fixtures come from. Robot, cube and target are elsewhere; the rest, more than nine pixels of
/// ten, is the same but for rounding.
#[test]
fn table_and_floor_are_where_they_are_in_the_example() {
    let Some(recorded) = recorded() else { return };
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/panda_push");
    let [ours, theirs] = [recorded, fixture].map(|folder| {
        let file = folder.join("seq_0000/frame_000.png");
        let bytes = fs::read(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        Frame::decode(&bytes).expect("an image")
    });
    assert_eq!(
        (ours.width(), ours.height()),
        (theirs.width(), theirs.height())
    );
    let (ours, theirs) = (ours.rgb(), theirs.rgb());
    let pixels = ours.chunks_exact(3).zip(theirs.chunks_exact(3));
    let same = |(a, b): &(&[u8], &[u8])| a.iter().zip(*b).all(|(a, b)| a.abs_diff(*b) <= 8);
    let share = pixels.clone().filter(same).count() as f64 / pixels.count() as f64;
    assert!(share > 0.9, "only {share} of the pixels are the same");
}

//! Recordings of episodes of unequal length by the real binary: HDF5 of robomimic, NPZ, and Zarr as
//! an archive and as a folder.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::binary::{data, json, stderr, tracklens};

const BOARD: [&str; 4] = ["--space", "px", "--image-size", "100x80"];

fn public(name: &str) -> String {
    let path = data(&format!("public/files/{name}"));
    path.to_string_lossy().into_owned()
}

fn place(folder: &TempDir, name: &str) -> String {
    folder.path().join(name).to_string_lossy().into_owned()
}

fn inspect(path: &str, more: &[&str]) -> Value {
    json(&tracklens(
        &[&["data", "inspect", "--quiet", path], more].concat(),
    ))
}

#[track_caller]
fn assert_episodes(path: &str, more: &[&str]) {
    let found = inspect(path, more);
    assert_eq!(found["frames"], 40, "{path}");
    assert_eq!(found["sequences"], 3, "{path}");
    assert_eq!(
        found["sequence_lengths"],
        serde_json::json!([8, 20]),
        "{path}"
    );
    assert_eq!(found["sizes"]["16x16"], 40, "{path}");
    assert_eq!(found["unreadable"], serde_json::json!([]), "{path}");
    let truth = &found["ground_truth"];
    assert_eq!(truth["objects"][0]["visible"], 40, "{path}");
    assert_eq!(truth["join"]["unmatched_frames"]["count"], 0, "{path}");
}

/// The files of a ZIP archive in a folder.
fn unpack(archive: &str, into: &Path) {
    let file = fs::File::open(archive).expect("an archive");
    let mut archive = zip::ZipArchive::new(file).expect("an archive");
    archive.extract(into).expect("unpacked");
}

#[test]
fn episodes_are_inspected_and_converted() {
    let folder = tempfile::tempdir().expect("a folder");
    unpack(&public("replay.zarr.zip"), folder.path());
    let unpacked = place(&folder, "replay.zarr");
    for (number, (file, more)) in [
        (public("robomimic.hdf5"), &[][..]),
        (public("episodes.npz"), &[]),
        (public("replay.zarr.zip"), &BOARD),
        (public("replay-v3.zarr.zip"), &BOARD),
        (unpacked, &BOARD),
    ]
    .into_iter()
    .enumerate()
    {
        assert_episodes(&file, more);
        for out in [format!("{number}.npz"), format!("{number}")] {
            let out = place(&folder, &out);
            let convert = ["data", "convert", "--quiet", &file, &out];
            let done = tracklens(&[&convert[..], more].concat());
            assert!(done.status.success(), "{}", stderr(&done));
            assert_episodes(&out, &[]);
        }
    }
}

#[test]
fn a_camera_is_chosen_by_its_name() {
    let file = public("robomimic-two-cameras.hdf5");
    let refused = tracklens(&["data", "inspect", &file]);
    assert_eq!(refused.status.code(), Some(3));
    let said = stderr(&refused);
    assert!(
        said.contains("choose one with --array agentview_image"),
        "{said}"
    );
    assert_episodes(&file, &["--array", "robot0_eye_in_hand_image"]);
}

#[test]
fn positions_under_other_names_are_named_with_the_frames() {
    let file = public("robomimic.hdf5");
    let checkpoint = data("golden/basic-vel-std-bg-tiny.safetensors");
    let eval = [
        "eval",
        "--quiet",
        "--json",
        "--folds",
        "0",
        "--checkpoint",
        &checkpoint.to_string_lossy(),
        "--frames",
        &file,
        "--truth-columns",
    ];
    let named = "gripper=obs/robot0_eef_pos,cube=obs/object[0:3]";
    let found = json(&tracklens(&[&eval[..], &[named]].concat()));
    let objects = found["objects"].as_array().expect("objects").iter();
    let names: Vec<&str> = objects
        .filter_map(|object| object["name"].as_str())
        .collect();
    assert_eq!(names, ["gripper", "cube"]);
    assert_eq!(found["frames"], 40);
    for (columns, part) in [
        ("cube=obs/object", "holds no positions of one object"),
        ("cube=obs/cube", "there is no array `obs/cube`"),
        ("cube=obs/object[0:2]", "in which unit"),
        ("cube=obs/object[5:9]", "holds no positions of one object"),
        ("cube=obs/object[a:9]", "does not say which numbers"),
    ] {
        let refused = tracklens(&[&eval[..], &[columns]].concat());
        assert_eq!(refused.status.code(), Some(3), "{columns}");
        let said = stderr(&refused);
        assert!(said.contains(part), "{columns}: {said}");
    }
}

#[test]
fn points_that_are_not_there_are_told_with_what_is() {
    let file = public("robomimic-low-dim.hdf5");
    let score = [
        "score",
        "--truth",
        &file,
        "--keypoints",
        &public("keypoints-episodes.csv"),
    ];
    let refused = tracklens(&score);
    assert_eq!(refused.status.code(), Some(3));
    let said = stderr(&refused);
    for part in ["`obs/object`, `obs/robot0_eef_pos`", "--columns"] {
        assert!(said.contains(part), "{said}");
    }
}

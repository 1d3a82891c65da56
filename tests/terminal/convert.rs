//! `tracklens data convert` of points: into every form and back, by the real binary.

use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use crate::binary::{json, stderr, tracklens};

fn public(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/public/files");
    folder.join(name).to_string_lossy().into_owned()
}

fn place(folder: &TempDir, name: &str) -> String {
    let path: PathBuf = folder.path().join(name);
    path.to_string_lossy().into_owned()
}

/// Converts, which must succeed; what it says.
#[track_caller]
fn convert(arguments: &[&str]) -> String {
    let done = tracklens(&[&["data", "convert"], arguments].concat());
    assert!(done.status.success(), "{}", stderr(&done));
    stderr(&done)
}

/// The errors of a ground truth with the plain keypoints, and the names of its objects.
#[track_caller]
fn errors(truth: &str, more: &[&str]) -> (Vec<String>, Vec<f64>) {
    let keypoints = public("keypoints.csv");
    let plain = [
        "score",
        "--json",
        "--folds",
        "0",
        "--truth",
        truth,
        "--keypoints",
        &keypoints,
    ];
    let found: Value = json(&tracklens(&[&plain, more].concat()));
    let objects = found["objects"].as_array().expect("objects").iter();
    let names = objects.map(|object| object["name"].as_str().expect("a name").to_owned());
    let rows = found["errors"].as_array().expect("rows").iter();
    let errors = rows.flat_map(|row| row.as_array().expect("a row"));
    (
        names.collect(),
        errors.map(|e| e.as_f64().expect("an error")).collect(),
    )
}

#[test]
fn points_of_any_file_come_to_the_same_errors_in_every_form() {
    let folder = tempfile::tempdir().expect("a folder");
    let size = ["--image-size", "100x80"];
    for file in [
        "dlc-labels.csv",
        "dlc-individuals-table.h5",
        "sleap.slp",
        "tap-vid-4.pkl",
    ] {
        let (names, expected) = errors(&public(file), &size);
        for (name, to) in [
            ("tidy.csv", None),
            ("points.npz", None),
            ("coco.json", None),
            ("dlc.csv", Some("deeplabcut")),
        ] {
            let out = place(&folder, &format!("{file}-{name}"));
            let to: Vec<&str> = to.map_or(vec![], |to| vec!["--to", to]);
            let input = public(file);
            convert(&[&[input.as_str(), out.as_str()][..], &size, &to].concat());
            // What is in pixels takes the size again; COCO has it.
            let size = if to.is_empty() { &[][..] } else { &size[..] };
            let (found_names, found) = errors(&out, size);
            assert_eq!(found_names, names, "{file} as {name}");
            // Pixels and back are off by the rounding of coordinates near 1.
            let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-12;
            assert!(
                found.iter().zip(&expected).all(near),
                "{file} as {name}: {found:?}"
            );
        }
    }
}

#[test]
fn keypoints_keep_their_numbers_and_their_confidence() {
    let folder = tempfile::tempdir().expect("a folder");
    let (tidy, npz) = (place(&folder, "kp.csv"), place(&folder, "kp.npz"));
    let input = public("keypoints-sleap.slp");
    for out in [&tidy, &npz] {
        convert(&[&input, out, "--keypoints", "--image-size", "100x80"]);
    }
    let table = std::fs::read_to_string(&tidy).expect("a table");
    assert!(
        table.starts_with("sequence,frame,keypoint,x,y,confidence\nvid,0,0,"),
        "{table}"
    );
    // An array has no names of sequences, and every digit.
    let again = place(&folder, "again.csv");
    convert(&[&npz, &again, "--keypoints"]);
    let read = std::fs::read_to_string(&again).expect("a table");
    assert_eq!(read, table.replace("vid,", "seq_0000,"));
}

#[test]
fn what_cannot_be_converted_is_refused_with_what_to_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = place(&folder, "out.json");
    let refused = |arguments: &[&str], code: i32, message: &str| {
        let done = tracklens(&[&["data", "convert"], arguments].concat());
        let said = stderr(&done);
        assert_eq!(done.status.code(), Some(code), "{said}");
        assert!(said.contains(message), "expected `{message}` in: {said}");
    };
    refused(
        &[&public("tidy.csv"), &out],
        3,
        "give the size with --image-size",
    );
    refused(
        &[&public("tidy.csv"), &place(&folder, "set")],
        3,
        "has no frames to be written",
    );
    refused(
        &[
            &public("tidy.csv"),
            &place(&folder, "x.csv"),
            "--columns",
            "x=u",
        ],
        3,
        "there is no column `u` for `x`; the table has `sequence`, `frame`, `object`, `x`, `y`",
    );
    refused(
        &[
            &public("tidy.csv"),
            &place(&folder, "x.csv"),
            "--columns",
            "x",
        ],
        2,
        "does not say which column is what",
    );
    assert!(!Path::new(&out).exists());
}

#[test]
fn a_table_with_other_columns_is_converted_once_they_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = place(&folder, "tidy.csv");
    let columns = "x=px,y=py,frame=t,object=label";
    convert(&[&public("other-columns.csv"), &out, "--columns", columns]);
    let (converted, plain) = (errors(&out, &[]), errors(&public("tidy.csv"), &[]));
    assert_eq!(converted, plain);
}

#[test]
fn measures_over_time_stand_in_the_json_and_the_report_and_change_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = place(&folder, "report.html");
    let (truth, keypoints) = (public("tidy-hidden.csv"), public("keypoints.csv"));
    let scored = |more: &[&str]| -> Value {
        let plain = [
            "score",
            "--json",
            "--truth",
            &truth,
            "--keypoints",
            &keypoints,
        ];
        let mut found: Value = json(&tracklens(&[&plain, more].concat()));
        let fields = found.as_object_mut().expect("an object");
        fields.remove("command");
        found
    };
    let plain = scored(&[]);
    let mut found = scored(&["--temporal", "--report", &report]);
    let fields = found.as_object_mut().expect("an object");
    let measures = fields.remove("temporal").expect("measures");
    fields.remove("sequences");
    assert_eq!(found, plain);
    let rows = measures["measures"].as_array().expect("measures");
    // Of the first object, the nose.
    let of = |name: &str| {
        let row = rows.iter().find(|row| row["measure"] == name);
        row.map(|row| row["objects"][0].clone()).expect(name)
    };
    assert_eq!(of("lag"), 0.0);
    // Two of its 40 frames hide it, where the keypoint is there all the same.
    assert_eq!(of("visibility_accuracy"), 38.0 / 40.0);
    // One sequence: nothing can be held out.
    assert_eq!(measures["folds"], 0);
    assert!(of("held_out_affine").is_null());
    let page = std::fs::read_to_string(&report).expect("a report");
    for part in ["Temporal quality", "average Jaccard", "PCK within 4.7 %"] {
        assert!(page.contains(part), "{part}");
    }
}

//! What the `tracklens` command finds in the same files.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use crate::page::example;

/// What the command prints.
pub fn tracklens(arguments: &[&str]) -> Vec<u8> {
    let binary = from_environment("TRACKLENS_BIN");
    let output = Command::new(&binary)
        .args(arguments)
        .output()
        .expect("the binary runs");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    output.stdout
}

pub(crate) fn from_environment(name: &str) -> PathBuf {
    let Some(path) = std::env::var_os(name) else {
        panic!(
            "{name} is not set; run `cargo xtask test`, which builds the site and the binary first"
        );
    };
    PathBuf::from(path)
}

/// A path as an argument.
pub fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// Copies a folder with all that is in it.
pub fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder");
    for entry in fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let (path, to) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy_folder(&path, &to);
        } else {
            fs::copy(path, to).expect("copied");
        }
    }
}

/// Packs files and folders of `folder` into a ZIP archive.
pub fn pack(folder: &Path, names: &[&str], archive: &Path) {
    let mut zip = ZipWriter::new(fs::File::create(archive).expect("an archive"));
    let mut waiting: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    while let Some(path) = waiting.pop() {
        if path.is_dir() {
            let entries = fs::read_dir(&path).expect("a folder");
            waiting.extend(entries.map(|entry| entry.expect("an entry").path()));
            continue;
        }
        let name = path.strip_prefix(folder).expect("a file in it");
        zip.start_file(name.to_string_lossy(), SimpleFileOptions::default())
            .expect("an entry");
        zip.write_all(&fs::read(&path).expect("a file"))
            .expect("written");
    }
    zip.finish().expect("an archive");
}

/// Unpacks a ZIP archive into `folder`.
pub fn unpack(archive: &Path, folder: &Path) {
    let archive = fs::File::open(archive).expect("an archive");
    let mut archive = ZipArchive::new(archive).expect("an archive");
    archive.extract(folder).expect("unpacked");
}

/// Checkpoint, frames and ground truth of the example.
pub fn example_inputs() -> [PathBuf; 3] {
    ["checkpoint.safetensors", "frames", "ground_truth.csv"].map(example)
}

/// The JSON of `tracklens eval` on a checkpoint, frames and a ground truth, with more options.
pub fn eval(inputs: [&Path; 3], more: &[&str]) -> Vec<u8> {
    let [checkpoint, frames, truth] = inputs.map(text);
    let command = [
        "eval",
        "--json",
        "--checkpoint",
        &checkpoint,
        "--frames",
        &frames,
        "--truth",
        &truth,
    ];
    tracklens(&[&command, more].concat())
}

/// The JSON of `tracklens eval` on the example, with more options.
pub fn eval_example(more: &[&str]) -> Vec<u8> {
    eval(example_inputs().each_ref().map(PathBuf::as_path), more)
}

/// JSON that a command has printed.
pub fn parsed(printed: &[u8]) -> Value {
    serde_json::from_slice(printed).expect("JSON")
}

/// What the command prints as JSON.
pub fn tracklens_json(arguments: &[&str]) -> Value {
    parsed(&tracklens(&[arguments, &["--json"]].concat()))
}

/// Writes the keypoints that `tracklens extract` finds in frames with the example's checkpoint, and
/// returns the table.
pub fn extract_keypoints(frames: &Path, out: &Path) -> String {
    let [checkpoint, ..] = example_inputs();
    let [checkpoint, frames, file] = [&checkpoint, frames, out].map(text);
    tracklens(&[
        "extract",
        "--quiet",
        "--checkpoint",
        &checkpoint,
        "--frames",
        &frames,
        "--out",
        &file,
    ]);
    fs::read_to_string(out).expect("a table")
}

/// Two keypoint tables have the same rows, with points that differ by `tolerance` at most.
pub fn same_keypoints(ours: &str, theirs: &str, tolerance: f64) {
    let (ours, theirs) = (points(ours), points(theirs));
    assert_eq!(ours.len(), theirs.len());
    let mut largest: f64 = 0.0;
    for ((key, z), (expected, x)) in ours.iter().zip(&theirs) {
        assert_eq!(key, expected);
        largest = largest.max((z[0] - x[0]).abs()).max((z[1] - x[1]).abs());
    }
    println!(
        "keypoints of {} rows: largest difference {largest:.1e}",
        ours.len()
    );
    assert!(largest <= tolerance, "{largest:e}");
}

/// The rows of a keypoint table: what identifies the point, and the point.
fn points(table: &str) -> Vec<(String, [f64; 2])> {
    let row = |line: &str| {
        let mut fields = line.rsplitn(3, ',');
        let mut number = || {
            fields
                .next()
                .and_then(|f| f.parse().ok())
                .expect("a number")
        };
        let (y, x) = (number(), number());
        (fields.next().expect("a key").to_owned(), [x, y])
    };
    table.lines().skip(1).map(row).collect()
}

//! Every function that takes bytes from outside, under one name each: for the fuzzers in `fuzz/` and
//! for `tests/terminal/mutations.rs`. Whatever the bytes are, it returns, with a result or an error,
//! within the time and the memory that inputs of their size may take.
#![allow(dead_code, reason = "a fuzzer runs one entry, the test all of them")]

use std::hint::black_box;
use std::io::Cursor;

use tracklens::checkpoint::Checkpoint;
use tracklens::data::{
    ArchiveIndex, Frame, FrameSource as _, Hdf5Points, NpyArray, Recording, TableOptions,
    export_parquet, export_pickle, ground_truth_of_arrays, keypoints_of_arrays, parse_ground_truth,
    parse_keypoints, parse_npz_ground_truth, parse_npz_keypoints,
};
use tracklens::detector::{Graph, Plan, Settings};
use tracklens::evaluation::EvaluationReport;
use tracklens::report::evaluation::{evaluation_csv, evaluation_page};
use tracklens::report::runs::Run;
use tracklens::run::RunFiles;

/// A function that takes bytes.
pub struct Entry {
    /// Its name, which is that of its fuzzer and of its folder in `fuzz/seeds`.
    pub name: &'static str,
    /// Takes bytes and drops what it makes of them.
    pub run: fn(&[u8]),
}

/// All of them.
pub const ENTRIES: &[Entry] = &[
    entry("tables", tables),
    entry("archive", archive),
    entry("npy", npy),
    entry("npz", npz),
    entry("hdf5", hdf5),
    entry("hdf5_points", hdf5_points),
    entry("pickled_points", pickled_points),
    entry("parquet", parquet),
    entry("safetensors", checkpoint),
    entry("pickle", checkpoint),
    entry("burnpack", checkpoint),
    entry("onnx", onnx),
    entry("images", images),
    entry("run_folder", run_folder),
    entry("evaluation", evaluation),
    #[cfg(feature = "train")]
    entry("sweep_file", sweep_file),
];

const fn entry(name: &'static str, run: fn(&[u8])) -> Entry {
    Entry { name, run }
}

/// Runs the entry of a name.
pub fn run(name: &str, bytes: &[u8]) {
    let entry = ENTRIES.iter().find(|entry| entry.name == name);
    (entry.expect("an entry of this name").run)(bytes);
}

/// Positions in pixels need a size.
fn with_size() -> TableOptions {
    TableOptions {
        image_size: Some([64, 48]),
        ..TableOptions::default()
    }
}

/// CSV, TSV and JSON of points, in all layouts.
fn tables(bytes: &[u8]) {
    for options in [TableOptions::default(), with_size()] {
        let _ = black_box(parse_ground_truth(bytes, "table.csv", &options));
        let _ = black_box(parse_keypoints(bytes, "table.csv", &options));
    }
}

fn archive(bytes: &[u8]) {
    let _ = black_box(ArchiveIndex::read(bytes, bytes.len() as u64));
}

fn npy(bytes: &[u8]) {
    for name in ["keypoints", "images"] {
        let array = || NpyArray {
            name: name.to_owned(),
            bytes: bytes.to_vec(),
            size: bytes.len() as u64,
        };
        let _ = black_box(ground_truth_of_arrays(vec![array()], &with_size()));
        let _ = black_box(keypoints_of_arrays(vec![array()], &with_size()));
        let _ = black_box(Recording::from_arrays(vec![array()], &with_size()));
    }
}

fn npz(bytes: &[u8]) {
    let _ = black_box(parse_npz_ground_truth(bytes, "points.npz", &with_size()));
    let _ = black_box(parse_npz_keypoints(bytes, "points.npz", &with_size()));
    recording(Recording::from_npz(
        Cursor::new(bytes.to_vec()),
        None,
        &with_size(),
    ));
}

fn hdf5(bytes: &[u8]) {
    recording(Recording::from_hdf5_bytes(
        bytes.to_vec(),
        None,
        &with_size(),
    ));
}

/// Tables of pandas and SLEAP, and arrays of points.
fn hdf5_points(bytes: &[u8]) {
    match Hdf5Points::of_bytes(bytes.to_vec()) {
        Ok(Hdf5Points::Table(table)) => {
            let _ = black_box(table.ground_truth("points.h5", &with_size()));
        }
        Ok(Hdf5Points::Arrays { arrays, .. }) => {
            let _ = black_box(ground_truth_of_arrays(arrays, &with_size()));
        }
        Err(_) => {}
    }
}

/// Tracks of points in a pickle.
fn pickled_points(bytes: &[u8]) {
    if let Ok(table) = export_pickle(bytes) {
        let _ = black_box(table.keypoints("points.pkl", &with_size()));
    }
}

/// Tables in Parquet files.
fn parquet(bytes: &[u8]) {
    if let Ok(table) = export_parquet(bytes.to_vec()) {
        let _ = black_box(table.ground_truth("table.parquet", &with_size()));
    }
}

fn recording(recording: tracklens::Result<Recording>) {
    if let Ok(recording) = recording {
        for i in 0..recording.index().keys().len().min(2) {
            let _ = black_box(recording.read(i));
        }
    }
}

fn checkpoint(bytes: &[u8]) {
    let _ = black_box(Checkpoint::from_bytes(bytes));
}

/// What is read of a model before it is given to its runtime.
fn onnx(bytes: &[u8]) {
    if let Ok(graph) = Graph::read(bytes) {
        let _ = black_box(Plan::new(&graph, &Settings::default()));
        black_box(
            graph
                .outputs
                .iter()
                .map(ToString::to_string)
                .collect::<String>(),
        );
    }
    let _ = black_box(Settings::from_json(bytes));
}

fn images(bytes: &[u8]) {
    let _ = black_box(Frame::decode(bytes));
}

/// The files of a run, with a zero byte between them.
fn run_folder(bytes: &[u8]) {
    let mut parts = bytes
        .splitn(4, |b| *b == 0)
        .map(|part| Some(part).filter(|p| !p.is_empty()));
    let mut part = || parts.next().flatten();
    let files = RunFiles {
        config: part(),
        log: part(),
        summary: part(),
        error: part(),
    };
    let _ = black_box(Run::parse("run", &files));
}

fn evaluation(bytes: &[u8]) {
    if let Ok(report) = EvaluationReport::parse(bytes, "evaluation.json") {
        let _ = black_box(evaluation_csv(&report));
        let _ = black_box(evaluation_page(&report, None));
    }
}

#[cfg(feature = "train")]
fn sweep_file(bytes: &[u8]) {
    use tracklens::sweep::{Plan, Setting, SettingKind, SweepFile};
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    let setting = |name: &str, kind| Setting {
        name: name.to_owned(),
        kind,
    };
    let settings = [
        setting("epochs", SettingKind::Value),
        setting("batch", SettingKind::Value),
        setting("split", SettingKind::Value),
        setting("keypoints", SettingKind::Value),
        setting("encoder-channels", SettingKind::Value),
        setting("keep-last", SettingKind::Switch),
        setting("weights", SettingKind::Path),
    ];
    if let Ok(file) = SweepFile::parse(text, std::path::Path::new("/data"), &settings) {
        black_box(file.plan());
    }
    let _ = black_box(Plan::parse(text));
}

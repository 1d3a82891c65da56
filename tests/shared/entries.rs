//! Every function that takes bytes from outside, under one name each: for the fuzzers in `fuzz/` and
//! for `tests/terminal/mutations.rs`. Whatever the bytes are, it returns, with a result or an error,
//! within the time and the memory that inputs of their size may take.
#![allow(dead_code, reason = "a fuzzer runs one entry, the test all of them")]

use std::hint::black_box;
use std::io::Cursor;

use tracklens::checkpoint::Checkpoint;
use tracklens::data::{
    ArchiveIndex, Frame, FrameSource as _, NpyArray, PointFile, Recording, Space, StoredPoints,
    TableOptions, ZIP_MAGIC, ZarrStore, ZipStore, export_parquet, export_pickle,
    ground_truth_of_arrays, keypoints_of_arrays, parse_ground_truth, parse_keypoints,
    parse_npz_ground_truth, parse_npz_keypoints, read_video_episodes, read_zarr_ground_truth,
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
    entry("zarr", zarr),
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
    match PointFile::from_hdf5_bytes(bytes.to_vec()).and_then(|file| file.stored()) {
        Ok(StoredPoints::Table(table)) => {
            let _ = black_box(table.ground_truth("points.h5", &with_size()));
        }
        Ok(StoredPoints::Arrays { arrays, .. }) => {
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

/// Tables in Parquet files, and the episodes of LeRobot's videos.
fn parquet(bytes: &[u8]) {
    let _ = black_box(read_video_episodes(bytes.to_vec()));
    if let Ok(table) = export_parquet(bytes.to_vec()) {
        let _ = black_box(table.ground_truth("table.parquet", &with_size()));
    }
}

/// A Zarr archive; or the description of an array, a zero byte, and its first chunk.
fn zarr(bytes: &[u8]) {
    let options = TableOptions {
        space: Some(Space::Pixels),
        ..with_size()
    };
    let stores = || -> Option<[Box<dyn ZarrStore>; 2]> {
        if bytes.starts_with(ZIP_MAGIC) {
            let open = || ZipStore::open(Cursor::new(bytes.to_vec())).ok().flatten();
            return Some([Box::new(open()?), Box::new(open()?)]);
        }
        let at = bytes.iter().position(|b| *b == 0)?;
        let store = |array: &str| -> Box<dyn ZarrStore> {
            let chunk = bytes[at + 1..].to_vec();
            let description = bytes[..at].to_vec();
            Box::new(OneChunk {
                size: bytes.len() as u64,
                files: [
                    ".zarray",
                    "zarr.json",
                    "0.0.0",
                    "c/0/0/0",
                    "0.0.0.0",
                    "c/0/0/0/0",
                ]
                .into_iter()
                .zip([&description, &description, &chunk, &chunk, &chunk, &chunk])
                .map(|(name, bytes)| (format!("{array}/{name}"), bytes.clone()))
                .collect(),
            })
        };
        Some([store("keypoints"), store("images")])
    };
    let Some([points, frames]) = stores() else {
        return;
    };
    let _ = black_box(read_zarr_ground_truth(points, None, &options));
    recording(Recording::from_zarr(frames, None, &options));
}

/// A Zarr array of one chunk, where it may lie.
struct OneChunk {
    files: Vec<(String, Vec<u8>)>,
    size: u64,
}

impl ZarrStore for OneChunk {
    fn keys(&self) -> Vec<String> {
        self.files.iter().map(|(key, _)| key.clone()).collect()
    }

    fn has(&self, key: &str) -> bool {
        self.files.iter().any(|(own, _)| own == key)
    }

    fn read(&self, key: &str) -> tracklens::Result<Vec<u8>> {
        let file = self.files.iter().find(|(own, _)| own == key);
        Ok(file.map(|(_, bytes)| bytes.clone()).unwrap_or_default())
    }

    fn size(&self) -> u64 {
        self.size
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

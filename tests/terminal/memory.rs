//! What small files that mean large things take: at most 64 MiB and 32 bytes a byte of input beyond
//! what the program takes anyway, unless a check names what there is no memory for. By the real
//! binary under `ulimit -v`.

#![cfg(target_os = "linux")]

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::binary::data;

const MIB: u64 = 1 << 20;

/// Runs the command with at most `bytes` of address space.
fn limited(folder: &Path, arguments: &[&str], bytes: u64) -> Output {
    let command = format!("ulimit -v {}; exec \"$0\" \"$@\"", bytes / 1024);
    Command::new("sh")
        .args(["-c", &command, env!("CARGO_BIN_EXE_tracklens")])
        .args(arguments)
        .current_dir(folder)
        // A thread that allocates reserves an arena of 64 MiB of addresses.
        .env("MALLOC_ARENA_MAX", "1")
        .output()
        .expect("a shell")
}

/// Two frames, scored; the same command as the bombs.
const SCORE: [&str; 5] = ["score", "--truth", "gt.csv", "--keypoints", "kp.csv"];

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).expect("written");
    }
    folder
}

/// The address space that the program needs for hardly any input: code, threads, stacks.
fn idle() -> u64 {
    static IDLE: OnceLock<u64> = OnceLock::new();
    *IDLE.get_or_init(|| {
        let folder = folder(&[
            (
                "gt.csv",
                b"sequence,frame,object,x,y\na,0,c,0,0\na,1,c,1,1\n",
            ),
            (
                "kp.csv",
                b"sequence,frame,keypoint,x,y\na,0,0,0,0\na,1,0,1,1\n",
            ),
        ]);
        let runs = |bytes| limited(folder.path(), &SCORE, bytes).status.success();
        let (mut low, mut high) = (0, 4096 * MIB);
        assert!(runs(high), "two frames take more than 4 GiB");
        while high - low > MIB {
            let middle = (low + high) / 2;
            match runs(middle) {
                true => high = middle,
                false => low = middle,
            }
        }
        high
    })
}

/// What a file is allowed, run on by the command; the exit code and what was said.
#[track_caller]
fn contained(files: &[(&str, &[u8])], arguments: &[&str], code: i32, message: &str) {
    let input: u64 = files.iter().map(|(_, bytes)| bytes.len() as u64).sum();
    let folder = folder(files);
    let output = limited(folder.path(), arguments, idle() + 64 * MIB + 32 * input);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
    assert!(said.contains(message), "expected `{message}` in: {said}");
}

fn archive(entries: &[(&str, &[u8])], method: CompressionMethod) -> Vec<u8> {
    let mut zip = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, bytes) in entries {
        zip.start_file(*name, options).expect("an entry");
        zip.write_all(bytes).expect("written");
    }
    zip.finish().expect("an archive").into_inner()
}

/// An array in numpy's format.
fn npy(dtype: &str, shape: &str, bytes: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}");
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(bytes);
    out
}

/// A PyTorch file with a pickle of one's own.
fn pth(pickle: &[u8]) -> Vec<u8> {
    let entries = [("a/data.pkl", pickle), ("a/version", b"3\n".as_slice())];
    archive(&entries, CompressionMethod::Stored)
}

fn text(value: &str) -> Vec<u8> {
    let mut out = vec![b'X'];
    out.extend((value.len() as u32).to_le_bytes());
    out.extend(value.as_bytes());
    out
}

/// A value that is in the memo.
fn again(number: u32) -> Vec<u8> {
    let mut out = vec![b'j'];
    out.extend(number.to_le_bytes());
    out
}

/// Puts the value on top into the memo.
fn keep(number: u32) -> Vec<u8> {
    let mut out = vec![b'r'];
    out.extend(number.to_le_bytes());
    out
}

const KEYPOINTS: &[u8] = b"sequence,frame,keypoint,x,y\na,0,0,0,0\na,1,0,1,1\n";

#[test]
fn a_failed_allocation_is_an_exit_code_with_a_sentence() {
    // Enough to start, too little for the table.
    let mut rows = String::from("sequence,frame,object,x,y\n");
    for t in 0..400_000 {
        let _ = writeln!(rows, "a,{t},c,0.5,0.5");
    }
    let folder = folder(&[("gt.csv", rows.as_bytes()), ("kp.csv", KEYPOINTS)]);
    let output = limited(folder.path(), &SCORE, idle() + 12 * MIB);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(5), "{said}");
    assert!(said.contains("there is no memory for"), "{said}");
}

#[test]
fn a_sparse_table_is_contained() {
    let mut rows = String::from("sequence,frame,object,x,y\n");
    for t in 0..40_000 {
        let _ = writeln!(rows, "a,{t},o{t},0.5,0.5");
    }
    let files: [(&str, &[u8]); 2] = [("gt.csv", rows.as_bytes()), ("kp.csv", KEYPOINTS)];
    contained(
        &files,
        &SCORE,
        3,
        "40000 rows name 40000 points in 40000 frames",
    );
}

#[test]
fn a_wide_table_of_empty_fields_is_contained() {
    let points = 500;
    let mut table = String::from("frame");
    for p in 0..points {
        let _ = write!(table, ",p{p}_x,p{p}_y");
    }
    table.push('\n');
    for t in 0..4000 {
        let _ = writeln!(table, "{t},0,0{}", ",,".repeat(points - 1));
    }
    let files: [(&str, &[u8]); 2] = [("gt.csv", table.as_bytes()), ("kp.csv", KEYPOINTS)];
    contained(&files, &SCORE, 0, "positions are missing");
}

#[test]
fn a_recording_that_declares_many_frames_is_contained() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/formats/plain.hdf5");
    let whole = fs::read(path).expect("a recording");
    // The sizes of every array, largest first: sequences, frames, ...
    let frames = 5_u64.to_le_bytes();
    let mut bomb = whole.clone();
    for at in 0..whole.len() - 8 {
        if whole[at..at + 8] == frames {
            bomb[at..at + 8].copy_from_slice(&(1_u64 << 30).to_le_bytes());
        }
    }
    assert_ne!(bomb, whole, "the recording has sequences of 5 frames");
    contained(&[("r.h5", &bomb)], &["data", "inspect", "r.h5"], 3, "");
}

#[test]
fn text_that_a_pickle_shares_is_contained() {
    // Three entries, each of which is a list of one text of 100 kB, 19,000 times.
    let mut pickle = b"\x80\x02}(".to_vec();
    for (i, key) in ["a", "b", "c"].into_iter().enumerate() {
        pickle.extend(text(key));
        pickle.extend(b"](");
        for item in 0..19_000 {
            match (i, item) {
                (0, 0) => {
                    pickle.extend(text(&"x".repeat(100_000)));
                    pickle.extend(keep(0));
                }
                _ => pickle.extend(again(0)),
            }
        }
        pickle.extend(b"e");
    }
    pickle.extend(b"u.");
    contained(
        &[("b.pth", &pth(&pickle))],
        &["inspect", "b.pth"],
        3,
        "b.pth",
    );
}

#[test]
fn long_names_of_classes_are_contained() {
    // An object of a class with a name of 20 kB, made 200,000 times.
    let mut pickle = b"\x80\x02](".to_vec();
    pickle.extend(format!("c{}\nx\n", "m".repeat(20_000)).as_bytes());
    pickle.extend(keep(0));
    pickle.extend(b")R");
    for _ in 0..200_000 {
        pickle.extend(b"j\0\0\0\0)R");
    }
    pickle.extend(b"e.");
    contained(
        &[("b.pth", &pth(&pickle))],
        &["inspect", "b.pth"],
        3,
        "b.pth",
    );
}

#[test]
fn values_that_share_their_parts_are_contained() {
    // 40,000 keys with one list of 19,000 values.
    let mut pickle = b"\x80\x02}(".to_vec();
    for key in 0..40_000_u32 {
        pickle.extend(text(&key.to_string()));
        match key {
            0 => {
                pickle.extend(b"](");
                pickle.extend(b"N".repeat(19_000));
                pickle.extend(b"e");
                pickle.extend(keep(0));
            }
            _ => pickle.extend(again(0)),
        }
    }
    pickle.extend(b"u.");
    contained(
        &[("b.pth", &pth(&pickle))],
        &["inspect", "b.pth"],
        3,
        "b.pth",
    );
}

#[test]
fn arrays_that_nobody_asked_for_are_contained() {
    let zeros = vec![0; 512 * MIB as usize];
    let junk = npy("|u1", &format!("({},)", zeros.len()), &zeros);
    drop(zeros);
    let points: Vec<u8> = [0.0, 0.0, 0.5, 0.5_f64]
        .into_iter()
        .flat_map(f64::to_le_bytes)
        .collect();
    let points = npy("<f8", "(2, 1, 2)", &points);
    let unused = [("junk.npy", &junk[..]), ("keypoints.npy", &points)];
    let bomb = archive(&unused, CompressionMethod::Deflated);
    let score = ["score", "--truth", "gt.npz", "--keypoints", "kp.csv"];
    let files: [(&str, &[u8]); 2] = [("gt.npz", &bomb), ("kp.csv", KEYPOINTS)];
    contained(&files, &score, 0, "");
    // One that is asked for, whose header says that it is small.
    let lie = [("keypoints.npy", [&points[..], &junk].concat())];
    let lie = lie.each_ref().map(|(name, bytes)| (*name, &bytes[..]));
    let bomb = archive(&lie, CompressionMethod::Deflated);
    let files: [(&str, &[u8]); 2] = [("gt.npz", &bomb), ("kp.csv", KEYPOINTS)];
    contained(&files, &score, 3, "keypoints");
}

#[test]
fn many_entries_of_an_archive_are_contained() {
    let names: Vec<String> = (0..50_000).map(|i| format!("{i}.npy")).collect();
    let entries: Vec<(&str, &[u8])> = names.iter().map(|name| (name.as_str(), &b""[..])).collect();
    let bomb = archive(&entries, CompressionMethod::Stored);
    let score = ["score", "--truth", "gt.npz", "--keypoints", "kp.csv"];
    let files: [(&str, &[u8]); 2] = [("gt.npz", &bomb), ("kp.csv", KEYPOINTS)];
    contained(&files, &score, 3, "gt.npz");
}

/// 1000 objects and 4096 keypoints in so many frames.
fn many_pairs(frames: u32) -> [String; 2] {
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for t in 0..frames {
        for k in 0..1000 {
            let _ = writeln!(truth, "a,{t},{k},0.{k},0.{t}");
        }
        for n in 0..4096 {
            let _ = writeln!(keypoints, "a,{t},{n},0.{n},0.{t}");
        }
    }
    [truth, keypoints]
}

#[test]
fn many_keypoints_and_objects_are_contained() {
    let [truth, keypoints] = many_pairs(2);
    let files: [(&str, &[u8]); 2] = [
        ("gt.csv", truth.as_bytes()),
        ("kp.csv", keypoints.as_bytes()),
    ];
    let message = "of errors of 4096 keypoints for 1000 objects";
    contained(&files, &SCORE, 5, message);
    contained(&files, &[&SCORE[..], &["--context"]].concat(), 5, message);
}

#[test]
fn other_metrics_of_many_keypoints_are_refused() {
    let [_, keypoints] = many_pairs(2);
    let truth = b"sequence,frame,object,x,y\na,0,c,0,0\na,1,c,1,1\n";
    let files: [(&str, &[u8]); 2] = [("gt.csv", truth), ("kp.csv", keypoints.as_bytes())];
    let context = [&SCORE[..], &["--context"]].concat();
    contained(
        &files,
        &context,
        5,
        "a linear regression from 4096 keypoints together takes hours",
    );
}

#[test]
fn an_image_that_declares_a_large_size_is_contained() {
    // The head of a lossy WebP image of the largest size, and nothing of its pixels.
    let mut image = b"RIFF\x2a\0\0\0WEBPVP8 \x1e\0\0\0\x90\x22\0\x9d\x01\x2a".to_vec();
    image.extend([0x00, 0x20, 0x00, 0x20]);
    image.resize(50, 0);
    let checkpoint = data("golden/basic-vel-std-bg-tiny.safetensors");
    let checkpoint = checkpoint.to_str().expect("UTF-8");
    let arguments = [
        ["extract", "--checkpoint"],
        [checkpoint, "--frames"],
        [".", "--out"],
    ];
    let arguments = [&arguments.concat()[..], &["keypoints.csv"]].concat();
    contained(
        &[("0.webp", &image)],
        &arguments,
        5,
        "of pixels of an image of 8192 x 8192",
    );
}

#[test]
fn tracks_that_a_pickle_shares_are_contained() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/public/files/tap-vid-4.pkl");
    let whole = fs::read(path).expect("a fixture");
    // Its tracks, a dictionary between a key and the end, over and over in a list. What stands
    // before counts as two in the memo, as the list and nothing do here.
    let key = whole.windows(4).position(|part| part == b"vid\x94");
    let tracks = &whole[key.expect("a key") + 4..whole.len() - 2];
    let mut pickle = b"\x80\x04]\x94N\x940(".to_vec();
    pickle.extend(tracks);
    pickle.extend(keep(9999));
    for _ in 0..200_000 {
        pickle.extend(again(9999));
    }
    pickle.extend(b"e.");
    contained(
        &[("b.pkl", &pickle)],
        &["data", "convert", "b.pkl", "out.csv"],
        3,
        "the videos hold more than the file",
    );
}

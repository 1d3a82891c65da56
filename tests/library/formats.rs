//! Recordings as arrays (NPZ, HDF5), and the authors' split: against files that numpy and h5py
//! wrote.

use std::io::Cursor;
use std::path::PathBuf;

use ndarray::{Array3, Array4, ArrayView};
use serde_json::Value;
use tracklens::data::{
    ArchiveEntry, ArchiveIndex, AxisOrder, Frame, FrameSource, Ground, Notice, NpyArray, NpzWriter,
    Pixels, Recording, Space, Split, TableOptions, ground_truth_csv, ground_truth_of_arrays,
    keypoints_of_arrays, numpy_permutation, parse_episodes, parse_ground_truth,
    parse_npz_ground_truth, parse_npz_keypoints,
};
use tracklens::error::Reason;
use tracklens::track::FrameKey;

const NAMES: [&str; 5] = ["cube", "target", "link_4", "link_5", "eef"];

fn fixture(name: &str) -> Vec<u8> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../tests")
        .join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn the_reference_split_is_numpys() {
    let cases: Value = serde_json::from_slice(&fixture("golden/numpy_split.json")).expect("JSON");
    let cases = cases.as_array().expect("cases");
    assert_eq!(cases.len(), 21);
    for case in cases {
        let number = |name: &str| case[name].as_u64().expect("a number") as u32;
        let expected: Vec<usize> = serde_json::from_value(case["order"].clone()).expect("an order");
        let (count, seed) = (number("count"), number("seed"));
        assert_eq!(
            numpy_permutation(count, seed),
            expected,
            "{count}, seed {seed}"
        );
        let parts = Split::Reference { seed }
            .divide(expected.len(), |_| panic!("nothing is drawn"))
            .expect("a split");
        let all = [&parts.training[..], &parts.validation, &parts.testing].concat();
        assert_eq!(all, expected, "{count}, seed {seed}");
    }
    let parts = Split::Reference { seed: 0 }
        .divide(1000, |_| ())
        .expect("a split");
    let sizes = [&parts.training, &parts.validation, &parts.testing].map(Vec::len);
    assert_eq!(sizes, [500, 250, 250]);
}

#[test]
fn splits_are_read_from_text_and_json() {
    let parse = |text: &str| text.parse::<Split>();
    let shares = Split::Shares {
        training: 0.5,
        validation: 0.25,
    };
    assert_eq!(parse("0.5, 0.25").expect("shares"), shares);
    assert_eq!(
        parse("reference").expect("a split"),
        Split::Reference { seed: 0 }
    );
    assert_eq!(
        parse("reference:7").expect("a split"),
        Split::Reference { seed: 7 }
    );
    for wrong in ["", "0.5", "reference:x", "reference:-1", "a,b", "ref:1"] {
        let error = parse(wrong).expect_err(wrong).to_string();
        assert!(error.contains("expected two shares"), "{error}");
    }
    for (split, json) in [
        (shares, r#"{"training":0.5,"validation":0.25}"#),
        (Split::Reference { seed: 3 }, r#"{"reference":{"seed":3}}"#),
    ] {
        assert_eq!(serde_json::to_string(&split).expect("JSON"), json);
        assert_eq!(serde_json::from_str::<Split>(json).expect("a split"), split);
    }
    assert!(serde_json::from_str::<Split>(r#"{"training":0.5}"#).is_err());
    assert!(serde_json::from_str::<Split>(r#"{"training":0.5,"validation":0.2,"x":1}"#).is_err());
}

#[test]
fn episodes_are_read_by_the_names_of_their_columns() {
    let rows = parse_episodes(b"episode,note,sequence\n7,x,seq_0\n7,,seq_1\n").expect("rows");
    let row = |sequence: &str| (sequence.to_owned(), "7".to_owned());
    assert_eq!(rows, [row("seq_0"), row("seq_1")]);
    for (table, part) in [
        ("sequence\n0\n", "there is no column `episode`"),
        ("sequence,episode\n0,1\n0,2\n", "sequence `0` has two rows"),
        ("sequence,episode\n0\n", "not a readable CSV file"),
    ] {
        let error = parse_episodes(table.as_bytes())
            .expect_err(part)
            .to_string();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn every_share_has_a_sequence() {
    for (training, validation) in [(0.001, 0.001), (0.999, 0.001), (0.5, 0.5)] {
        let split = Split::Shares {
            training,
            validation,
        };
        for sequences in 2..9 {
            let parts = split
                .divide(sequences, |order| order.reverse())
                .expect("a split");
            assert!(!parts.training.is_empty() && !parts.validation.is_empty());
            let total = parts.training.len() + parts.validation.len() + parts.testing.len();
            assert_eq!(total, sequences);
        }
        assert!(split.divide(1, |_| ()).is_err());
    }
}

fn floats(name: &str) -> Vec<f32> {
    let bytes = fixture(&format!("data/formats/{name}"));
    bytes
        .as_chunks()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect()
}

/// What the fixtures hold: 3 sequences of 5 frames of 16 x 16 px, and 5 points.
struct Expected {
    frames: Vec<f32>,
    points: Array3<f64>,
}

fn expected() -> Expected {
    let points = floats("sites.f32").into_iter().map(f64::from).collect();
    Expected {
        frames: floats("frames.f32"),
        points: Array3::from_shape_vec((15, 5, 2), points).expect("points"),
    }
}

fn texts(notices: &[Notice]) -> String {
    let texts: Vec<String> = notices.iter().map(ToString::to_string).collect();
    texts.join("\n")
}

fn read_as(axes: Option<AxisOrder>) -> TableOptions {
    TableOptions {
        axes,
        ..TableOptions::default()
    }
}

fn npz(name: &str, axes: Option<AxisOrder>) -> Recording {
    let bytes = fixture(&format!("data/formats/{name}"));
    Recording::from_npz(Cursor::new(bytes), None, &read_as(axes))
        .unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn hdf5(name: &str, axes: Option<AxisOrder>) -> Recording {
    let bytes = fixture(&format!("data/formats/{name}"));
    Recording::from_hdf5_bytes(bytes, None, &read_as(axes))
        .unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Every frame of `recording` holds `value` of the expected floats, bit for bit.
fn assert_frames(recording: &Recording, count: usize, value: impl Fn(&[f32]) -> Pixels) {
    let expected = expected().frames;
    assert_eq!(recording.index().keys().len(), count);
    assert_eq!(recording.image_size(), [16, 16]);
    // Backwards: frames do not depend on the order they are read in.
    for i in (0..count).rev() {
        let frame = recording.read(i).expect("a frame");
        assert_eq!(
            *frame.pixels(),
            value(&expected[i * 768..(i + 1) * 768]),
            "frame {i}"
        );
        let key = FrameKey {
            sequence: format!("seq_{:04}", i / 5),
            frame: (i % 5) as u64,
        };
        assert_eq!(recording.index().keys()[i], key);
    }
}

fn same(values: &[f32]) -> Pixels {
    Pixels::Floats(values.to_vec())
}

/// As `record.py` makes integers.
fn integers(values: &[f32]) -> Pixels {
    Pixels::Bytes(values.iter().map(|v| (v * 255.0) as u8).collect())
}

#[test]
fn the_authors_recording_is_read_with_every_bit() {
    let recording = hdf5("record.hdf5", None);
    assert!(recording.has_floats());
    assert_frames(&recording, 15, same);
    let truth = recording.truth().expect("a ground truth");
    assert_eq!(truth.names(), NAMES);
    assert_eq!(*truth.points_ndc(), expected().points);
    assert_eq!(truth.keys(), recording.index().keys());
    let notices = texts(recording.notices());
    assert!(notices.contains("(x, y): as the file says"), "{notices}");
    let paper = truth
        .select(&["cube", "target", "eef"].map(str::to_owned))
        .expect("objects");
    assert_eq!(paper.points_ndc().dim(), (15, 3, 2));
    assert_eq!(paper.frame(7).row(2), truth.frame(7).row(4));
    let error = truth
        .select(&["cup".to_owned()])
        .expect_err("no cup")
        .to_string();
    assert!(
        error.contains("`cup`") && error.contains("cube, target"),
        "{error}"
    );
}

#[test]
fn the_authors_options_are_understood() {
    // 8 bits, channels first, y first, and the newest form of HDF5 file.
    let recording = hdf5("options.hdf5", None);
    assert!(!recording.has_floats());
    assert_frames(&recording, 15, integers);
    let truth = recording.truth().expect("a ground truth");
    assert_eq!(*truth.points_ndc(), expected().points);
    let notices = texts(recording.notices());
    assert!(notices.contains("(y, x): as the file says"), "{notices}");
    // Who says otherwise is believed.
    let swapped = hdf5("options.hdf5", Some(AxisOrder::Xy));
    let swapped = swapped.truth().expect("a ground truth");
    assert_eq!(swapped.frame(3)[[1, 0]], truth.frame(3)[[1, 1]]);
}

#[test]
fn a_plain_hdf5_file_of_one_sequence_is_read() {
    // Not packed, big-endian, points in f64, names as an array.
    let recording = hdf5("plain.hdf5", None);
    assert_frames(&recording, 5, same);
    let truth = recording.truth().expect("a ground truth");
    assert_eq!(truth.names(), ["a", "b", "c", "d", "é"]);
    assert_eq!(
        *truth.points_ndc(),
        expected().points.slice(ndarray::s![..5, .., ..])
    );
    let notices = texts(recording.notices());
    assert!(
        notices.contains("assumed, as the authors record"),
        "{notices}"
    );
}

#[test]
fn npz_recordings_are_read() {
    let stored = npz("frames.npz", None);
    assert_frames(&stored, 15, integers);
    let truth = stored.truth().expect("a ground truth");
    assert_eq!(*truth.points_ndc(), expected().points);
    assert_eq!(
        truth.names(),
        ["point_0", "point_1", "point_2", "point_3", "point_4"]
    );

    // Packed, f64, channels first, one sequence, big-endian points, names.
    let packed = npz("packed.npz", None);
    assert!(packed.has_floats());
    assert_frames(&packed, 5, same);
    assert_eq!(
        packed.truth().expect("a ground truth").names(),
        ["a", "b", "c", "d", "é"]
    );
}

#[test]
fn points_alone_are_a_ground_truth_or_keypoints() {
    let bytes = fixture("data/formats/points.npz");
    let table =
        parse_npz_ground_truth(&bytes, "points.npz", &read_as(None)).expect("a ground truth");
    assert_eq!(table.content.names(), NAMES);
    assert_eq!(*table.content.points_ndc(), expected().points);
    let track = parse_npz_keypoints(&bytes, "points.npz", &read_as(Some(AxisOrder::Yx)))
        .expect("keypoints");
    assert_eq!(track.content.keypoints(), 5);
    assert_eq!(
        track.content.frame(2)[[1, 0]],
        table.content.frame(2)[[1, 1]]
    );
    let error = Recording::from_npz(Cursor::new(bytes), None, &read_as(None))
        .err()
        .expect("no frames");
    assert!(
        error.to_string().contains("no array of frames") && error.to_string().contains("`sites`"),
        "{error}"
    );
}

#[test]
fn a_ground_truth_survives_csv() {
    let mut truth = npz("packed.npz", None)
        .truth()
        .expect("a ground truth")
        .clone();
    let mut points = truth.points_ndc().clone();
    points[[2, 1, 0]] = f64::NAN;
    points[[2, 1, 1]] = f64::NAN;
    truth =
        tracklens::track::GroundTruth::new(truth.keys().to_vec(), truth.names().to_vec(), points)
            .expect("a ground truth");
    let again = parse_ground_truth(
        ground_truth_csv(&truth).as_bytes(),
        "gt.csv",
        &TableOptions::default(),
    )
    .expect("a table");
    assert_eq!(again.content.keys(), truth.keys());
    assert_eq!(again.content.names(), truth.names());
    for (a, b) in again.content.points_ndc().iter().zip(truth.points_ndc()) {
        assert!(a == b || (a.is_nan() && b.is_nan()), "{a} is not {b}");
    }
}

/// An NPZ file in memory, written by what `data convert` writes with.
fn written(fill: impl FnOnce(&mut NpzWriter<Cursor<Vec<u8>>>)) -> Vec<u8> {
    let mut writer = NpzWriter::new(Cursor::new(Vec::new()));
    fill(&mut writer);
    writer.finish().expect("a file").into_inner()
}

fn npz_error(bytes: Vec<u8>) -> String {
    let recording = Recording::from_npz(Cursor::new(bytes), None, &read_as(None));
    recording
        .and_then(|r| r.read(0).map(|_| ()))
        .expect_err("a bad file")
        .to_string()
}

#[test]
fn what_is_written_is_read_again() {
    let values: Vec<f32> = (0..2 * 3 * 16 * 20 * 3)
        .map(|i| (i % 1009) as f32 / 1008.0)
        .collect();
    let points = Array4::from_shape_fn((2, 3, 1, 2), |(s, t, _, a)| {
        s as f64 - 0.25 * t as f64 + 0.1 * a as f64
    });
    let bytes = written(|npz| {
        npz.array("images", "<f4", &[2, 3, 16, 20, 3])
            .expect("an array");
        for value in &values {
            npz.write(&value.to_le_bytes()).expect("written");
        }
        npz.floats("keypoints", &[2, 3, 1, 2], points.iter().copied())
            .expect("written");
        npz.strings("names", &["ein Würfel".to_owned()])
            .expect("written");
    });
    let recording =
        Recording::from_npz(Cursor::new(bytes), None, &read_as(None)).expect("a recording");
    assert_eq!(recording.image_size(), [20, 16]);
    for i in 0..6 {
        let frame = recording.read(i).expect("a frame");
        assert_eq!(*frame.pixels(), same(&values[i * 960..(i + 1) * 960]));
    }
    let truth = recording.truth().expect("a ground truth");
    assert_eq!(truth.names(), ["ein Würfel"]);
    assert_eq!(
        truth.points_ndc().view(),
        ArrayView::from_shape((6, 1, 2), points.as_slice().expect("contiguous")).expect("points")
    );
}

#[test]
fn bad_npz_files_are_told_apart() {
    let whole = fixture("data/formats/frames.npz");
    for length in [4, 100, 5000, whole.len() - 1] {
        let error = npz_error(whole[..length].to_vec());
        assert!(error.contains("cut short"), "{length}: {error}");
    }
    let array = |name: &'static str, dtype: &'static str, shape: &'static [usize], bytes: usize| {
        written(move |npz| {
            npz.array(name, dtype, shape).expect("an array");
            npz.write(&vec![0; bytes]).expect("written");
        })
    };
    let cases: [(Vec<u8>, &[&str]); 8] = [
        (
            array("frames", "<i4", &[1, 2, 16, 16, 3], 6144),
            &["`frames` (<i4, shape [1, 2, 16, 16, 3])", "expected uint8"],
        ),
        (
            array("pictures", "|u1", &[2, 16, 16, 3], 1536),
            &["found `pictures`"],
        ),
        (
            array("images", "|u1", &[2, 16, 16], 512),
            &["[2, 16, 16]", "expected [S, T, H, W, 3]"],
        ),
        (
            array("images", "|u1", &[2, 8, 16, 3], 768),
            &["16 x 8 pixels", "16 to 8192"],
        ),
        (
            array("images", "|u1", &[0, 2, 16, 16, 3], 0),
            &["at least one sequence"],
        ),
        (
            array("images", "|u1", &[2, 16, 16, 3], 1000),
            &["`images` has 1000 bytes", "needs 1536"],
        ),
        (
            written(|npz| {
                for name in ["images", "frames"] {
                    npz.array(name, "|u1", &[1, 16, 16, 3]).expect("an array");
                    npz.write(&[0; 768]).expect("written");
                }
            }),
            &["both `images` and `frames`"],
        ),
        (
            written(|npz| {
                npz.array("images", "<f4", &[1, 16, 16, 3])
                    .expect("an array");
                npz.write(&2.0f32.to_le_bytes().repeat(768))
                    .expect("written");
            }),
            &[
                "`images`, sequence seq_0000, frame 0",
                "the value 2 of pixel (0, 0)",
            ],
        ),
    ];
    for (bytes, expected) in cases {
        let error = npz_error(bytes);
        assert!(expected.iter().all(|text| error.contains(text)), "{error}");
    }
}

#[test]
fn bad_points_are_told_apart() {
    let with_points = |shape: &[usize], values: Vec<f64>, names: &[&str]| {
        npz_error(written(|npz| {
            npz.array("images", "|u1", &[2, 3, 16, 16, 3])
                .expect("an array");
            npz.write(&[0; 6 * 768]).expect("written");
            npz.floats("keypoints", shape, values.into_iter())
                .expect("written");
            if !names.is_empty() {
                let names: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
                npz.strings("names", &names).expect("written");
            }
        }))
    };
    let error = with_points(&[2, 4, 1, 2], vec![0.0; 16], &[]);
    assert!(
        error.contains("`keypoints` has shape [2, 4, 1, 2]")
            && error.contains("2 sequences of 3 frames"),
        "{error}"
    );
    let error = with_points(&[2, 3, 4], vec![0.0; 24], &[]);
    assert!(error.contains("expected [S, T, K, 2]"), "{error}");
    let error = with_points(&[2, 3, 1, 2], vec![0.0; 12], &["a", "b"]);
    assert!(error.contains("names 2 points (a, b)"), "{error}");
    let mut values = vec![0.0; 12];
    values[9] = f64::INFINITY;
    let error = with_points(&[2, 3, 1, 2], values, &[]);
    assert!(error.contains("is inf in sequence 1, frame 1"), "{error}");

    let mut values = vec![0.0; 12];
    values[9] = f64::NAN;
    let bytes = written(|npz| {
        npz.floats("sites", &[2, 3, 1, 2], values.into_iter())
            .expect("written")
    });
    let table = parse_npz_ground_truth(&bytes, "gt.npz", &read_as(None)).expect("a ground truth");
    assert!(texts(&table.notices).contains("1 of 6 positions are missing"));
}

#[test]
fn bad_hdf5_files_are_errors() {
    let whole = fixture("data/formats/record.hdf5");
    let read = |bytes: Vec<u8>| {
        let recording = Recording::from_hdf5_bytes(bytes, None, &read_as(None))?;
        (0..recording.index().keys().len()).try_for_each(|i| recording.read(i).map(|_| ()))
    };
    for length in [0, 8, 100, 1000, whole.len() / 2, whole.len() - 1] {
        let error = read(whole[..length].to_vec())
            .expect_err("a cut file")
            .to_string();
        assert!(
            error.contains("complete?") || error.contains("cut short"),
            "{length}: {error}"
        );
    }
    // No byte that is wrong may crash the reader. Every 97th: all of them take a minute.
    for at in (0..whole.len()).step_by(97) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0xff;
        let _ = read(bytes);
    }
    let error = read(fixture("data/formats/lzf.hdf5"))
        .expect_err("a filter")
        .to_string();
    assert!(
        error.contains("`images`") && error.contains("gzip"),
        "{error}"
    );
}

#[test]
fn floats_become_bytes_only_when_asked() {
    let floats: Vec<f32> = (0..768).map(|i| i as f32 / 767.0).collect();
    let frame = Frame::from_pixels(16, 16, Pixels::Floats(floats.clone())).expect("a frame");
    let again = Frame::decode(&frame.to_png().expect("a PNG")).expect("a frame");
    let Pixels::Bytes(bytes) = again.pixels() else {
        panic!("a PNG has bytes");
    };
    for (byte, float) in bytes.iter().zip(&floats) {
        // The documented bound, and the rounding of f32.
        assert!((f32::from(*byte) / 255.0 - float).abs() <= 1.0 / 510.0 + 1e-6);
    }
    let planar = frame.to_planar(None, tracklens::data::Filter::Bilinear);
    assert_eq!(
        (planar[1], planar[256], planar[512]),
        (floats[3], floats[1], floats[2])
    );
    for wrong in [f32::NAN, 1.1, -0.1, f32::INFINITY] {
        let mut floats = floats.clone();
        floats[50] = wrong;
        let error = Frame::from_pixels(16, 16, Pixels::Floats(floats)).expect_err("a wrong value");
        assert!(error.to_string().contains("pixel (0, 1)"), "{error}");
    }
}

/// The arrays of an NPZ file that `NpzWriter` made: stored, so that they lie in the file as they
/// are.
fn arrays(bytes: &[u8], whole: bool) -> Vec<NpyArray> {
    let ArchiveIndex::Entries(entries) =
        ArchiveIndex::read(bytes, bytes.len() as u64).expect("a directory")
    else {
        panic!("all of it was given");
    };
    let array = |entry: &ArchiveEntry| {
        let header = &bytes[entry.offset as usize..];
        let length = |at: usize| usize::from(u16::from_le_bytes([header[at], header[at + 1]]));
        let start = entry.offset as usize + 30 + length(26) + length(28);
        let name = entry.path.trim_end_matches(".npy").to_owned();
        let kept = match whole || NpyArray::is_needed_whole(&name) {
            true => entry.size,
            false => entry.size.min(200),
        };
        NpyArray {
            bytes: bytes[start..start + kept as usize].to_vec(),
            size: entry.size,
            name,
        }
    };
    entries.iter().map(array).collect()
}

#[test]
fn frames_of_a_file_that_is_not_in_memory_are_where_it_says() {
    let bytes = fixture("data/formats/frames.npz");
    let whole = npz("frames.npz", None);
    let all = arrays(&bytes, true);
    let partly =
        Recording::from_arrays(arrays(&bytes, false), &read_as(None)).expect("a recording");
    assert_eq!(partly.index(), whole.index());
    assert_eq!(partly.truth(), whole.truth());
    let array = all
        .iter()
        .find(|a| a.name == partly.frames_name())
        .expect("the array of frames");
    for i in 0..15 {
        let (start, length) = partly.frame_place(i).expect("a place");
        let mut npy = partly.frame_header();
        npy.extend(&array.bytes[start as usize..(start + length) as usize]);
        assert_eq!(
            Frame::decode(&npy).expect("a frame"),
            whole.read(i).expect("a frame")
        );
    }
    // What is not in memory is said to be so.
    let error = partly.read(0).expect_err("no frame").to_string();
    assert!(error.contains("not in memory"), "{error}");

    // Points alone.
    let points = fixture("data/formats/points.npz");
    let table =
        ground_truth_of_arrays(arrays(&points, false), &read_as(None)).expect("a ground truth");
    assert_eq!(table.content.names(), NAMES);
    assert_eq!(table.reading.axes.by, Ground::Guess);
    let track = keypoints_of_arrays(arrays(&points, false), &read_as(None)).expect("keypoints");
    assert_eq!(track.content.keypoints(), 5);
}

#[test]
fn frames_as_numpy_arrays_keep_floats_and_the_order_of_channels() {
    let npy = |dtype: &str, shape: &str, elements: &[u8]| {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        let text = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}\n");
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes.extend(elements);
        bytes
    };
    let floats: Vec<f32> = (0..3 * 16 * 20).map(|i| i as f32 / 1000.0).collect();
    let bytes: Vec<u8> = floats.iter().flat_map(|v| v.to_be_bytes()).collect();
    let frame = Frame::decode(&npy(">f4", "(3, 16, 20)", &bytes)).expect("a frame");
    assert_eq!((frame.width(), frame.height()), (20, 16));
    let Pixels::Floats(pixels) = frame.pixels() else {
        panic!("floats stay floats");
    };
    assert_eq!(pixels[1], floats[16 * 20]);
    let cut = Frame::decode(&npy("|u1", "(16, 20, 3)", &[0; 10]))
        .expect_err("cut short")
        .to_string();
    assert!(cut.contains("has 10 bytes"), "{cut}");
    let flat = Frame::decode(&npy("|u1", "(16, 20)", &[0; 320]))
        .expect_err("grey")
        .to_string();
    assert!(flat.contains("no array of RGB frames"), "{flat}");
}

#[test]
fn points_in_pixels_take_the_size_of_the_frames_beside_them() {
    let mut options = read_as(None);
    options.space = Some(Space::Pixels);
    let bytes = fixture("data/formats/frames.npz");
    let recording = Recording::from_npz(Cursor::new(bytes), None, &options).expect("a recording");
    let px = expected().points[[0, 0, 0]];
    let ndc = recording.truth().expect("a ground truth").points_ndc()[[0, 0, 0]];
    assert_eq!(ndc, (2.0 * px + 1.0) / 16.0 - 1.0);
    let alone = fixture("data/formats/points.npz");
    let error = parse_npz_ground_truth(&alone, "p.npz", &options).expect_err("of unknown size");
    assert!(
        error
            .to_string()
            .contains("the size of the images is not known"),
        "{error}"
    );
    assert_eq!(error.reason(), Some(&Reason::MissingImageSize));
}

/// Points in a file of their own, and an array that is of no use here.
fn stored_points() -> Vec<u8> {
    written(|npz| {
        let values = (0..12).map(f64::from);
        npz.floats("keypoints", &[3, 2, 2], values.map(|v| v / 16.0))
            .expect("written");
        npz.floats("other", &[1], [0.75].into_iter())
            .expect("written");
    })
}

/// Flips a bit of the first place where the bytes of `value` stand.
fn flip(bytes: &mut [u8], value: f64) {
    let at = bytes.windows(8).position(|w| w == value.to_le_bytes());
    bytes[at.expect("the value") + 6] ^= 1;
}

#[test]
fn a_flipped_bit_in_a_stored_array_is_an_error() {
    let whole = stored_points();
    let read = |bytes: &[u8]| parse_npz_ground_truth(bytes, "p.npz", &read_as(None));
    assert!(read(&whole).is_ok());
    let mut damaged = whole.clone();
    flip(&mut damaged, 11.0 / 16.0);
    let error = read(&damaged).expect_err("a wrong checksum").to_string();
    assert!(
        error.contains("`keypoints`") && error.to_lowercase().contains("checksum"),
        "{error}"
    );
    // What is not used is not read, so it costs nothing and harms nothing.
    let mut unused = whole;
    flip(&mut unused, 0.75);
    assert!(read(&unused).is_ok());
}

#[test]
fn frames_that_are_stored_are_verified_on_request() {
    let mut bytes = fixture("data/formats/frames.npz");
    let verify = |bytes: &[u8]| {
        let recording = Recording::from_npz(Cursor::new(bytes.to_vec()), None, &read_as(None));
        recording.expect("a recording").verify()
    };
    assert!(verify(&bytes).is_ok());
    // In the middle of the frames, which take nearly all of the file.
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let error = verify(&bytes).expect_err("a wrong checksum").to_string();
    assert!(error.to_lowercase().contains("checksum"), "{error}");
}

#[test]
fn an_hdf5_file_cannot_declare_more_frames_than_a_recording_has() {
    let mut bytes = fixture("data/formats/record.hdf5");
    let shape = [3u64, 5].map(u64::to_le_bytes).concat();
    let huge = [1u64 << 15; 2].map(u64::to_le_bytes).concat();
    let places: Vec<usize> = (0..bytes.len() - 16)
        .filter(|at| bytes[*at..at + 16] == shape)
        .collect();
    assert!(!places.is_empty());
    for at in places {
        bytes[at..at + 16].copy_from_slice(&huge);
    }
    let error = Recording::from_hdf5_bytes(bytes, None, &read_as(None))
        .err()
        .expect("too many frames")
        .to_string();
    assert!(
        error.contains("expected at most 16777216 frames"),
        "{error}"
    );
}

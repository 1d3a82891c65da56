//! Tables, images, sequences, joins and checkpoints: what is read right, and what is said of bad
//! input.

use std::path::PathBuf;

use crate::shared::{golden, tensor};
use safetensors::SafeTensors;
use tracklens::checkpoint::{Checkpoint, SaeConfig};
use tracklens::data::{
    Filter, Frame, FrameIndex, TableOptions, join, keypoints_csv, parse_ground_truth,
    parse_keypoints, resize_planar,
};
use tracklens::error::Reason;
use tracklens::intake::{Role, classify};
use tracklens::track::FrameKey;

fn key(sequence: &str, frame: u64) -> FrameKey {
    FrameKey {
        sequence: sequence.to_owned(),
        frame,
    }
}

fn truth_error(text: &str) -> String {
    truth_error_of(text.as_bytes())
}

fn truth_error_of(bytes: &[u8]) -> String {
    parse_ground_truth(bytes, "gt.csv", &TableOptions::default())
        .expect_err("bad input")
        .to_string()
}

fn keypoint_error(text: &str) -> String {
    parse_keypoints(text.as_bytes(), "kp.csv", &TableOptions::default())
        .expect_err("bad input")
        .to_string()
}

#[test]
fn a_table_is_read_in_natural_order_whatever_its_own() {
    let text = "frame,x,y,object,sequence\n1,0.5,0.25,cube,s10\n0,1,2,cube,s10\n0,-1,-2,cube,s9\n";
    let table =
        parse_ground_truth(text.as_bytes(), "gt.csv", &TableOptions::default()).expect("a table");
    assert!(table.notices.is_empty());
    let truth = table.content;
    assert_eq!(truth.keys(), [key("s9", 0), key("s10", 0), key("s10", 1)]);
    assert_eq!(truth.points_ndc()[[2, 0, 0]], 0.5);
    assert_eq!(truth.points_ndc()[[0, 0, 1]], -2.0);
}

#[test]
fn byte_order_mark_crlf_semicolons_and_tabs_are_read() {
    let plain = "sequence,frame,object,x,y\n0,0,cube,0.1,0.2\n0,1,cube,0.3,0.4\n";
    let expected = parse_ground_truth(plain.as_bytes(), "gt.csv", &TableOptions::default())
        .expect("a table")
        .content;
    let windows = format!("\u{feff}{}", plain.replace('\n', "\r\n"));
    assert_eq!(
        parse_ground_truth(windows.as_bytes(), "gt.csv", &TableOptions::default())
            .expect("a table")
            .content,
        expected
    );
    for (separator, word) in [(";", "semicolon"), ("\t", "tab")] {
        let table = parse_ground_truth(
            plain.replace(',', separator).as_bytes(),
            "gt.csv",
            &TableOptions::default(),
        )
        .expect("a table");
        assert_eq!(table.content, expected);
        assert!(table.notices[0].text.contains(word));
    }
}

#[test]
fn what_is_missing_is_not_visible_and_counted() {
    let text = "sequence,frame,object,x,y\n0,0,cube,0.1,0.2\n0,0,eef,,\n0,1,cube,nan,nan\n0,1,eef,0,0\n0,2,eef,1,1\n";
    let table =
        parse_ground_truth(text.as_bytes(), "gt.csv", &TableOptions::default()).expect("a table");
    assert!(table.content.frame(0)[[1, 0]].is_nan());
    assert!(table.content.frame(2)[[0, 0]].is_nan());
    assert!(
        table.notices[0]
            .text
            .contains("3 of 6 positions are missing"),
        "{:?}",
        table.notices
    );
}

#[test]
fn another_unit_is_asked_about() {
    let notices = |scale: f64, shift: f64| {
        let row = |t: i32| {
            let s = (f64::from(t) * 0.7).sin();
            format!("0,{t},cube,{},{}\n", shift + scale * s, shift - scale * s)
        };
        let text = format!(
            "sequence,frame,object,x,y\n{}",
            (0..20).map(row).collect::<String>()
        );
        parse_ground_truth(text.as_bytes(), "gt.csv", &TableOptions::default())
            .expect("a table")
            .notices
    };
    let table = |scale: f64, shift: f64| {
        let notices = notices(scale, shift);
        let texts: Vec<String> = notices.iter().map(ToString::to_string).collect();
        (texts.join("; "), notices.into_iter().find_map(|n| n.reason))
    };
    assert_eq!(table(1.0, 0.0), (String::new(), None));
    let (fractions, reason) = table(0.5, 0.5);
    assert!(fractions.contains("no coordinate is negative: is this another unit"));
    assert_eq!(reason, Some(Reason::LooksLikeFractions));
    let (pixels, reason) = table(128.0, 128.0);
    assert!(pixels.contains("beyond ±16: are these pixels?"), "{pixels}");
    assert!(
        matches!(reason, Some(Reason::LooksLikePixels { coordinates }) if coordinates > 0),
        "{reason:?}"
    );
    let (corner, reason) = table(0.005, -0.99);
    assert!(corner.contains("are they ndc already, and read as pixels?"));
    assert_eq!(reason, Some(Reason::LooksLikeNdc));
}

#[test]
fn utf_16_is_read_as_utf_8_is() {
    let text = "sequence,frame,object,x,y\n0,0,w\u{fc}rfel,0.1,0.2\n";
    let read = |bytes: &[u8]| {
        parse_ground_truth(bytes, "gt.csv", &TableOptions::default())
            .expect("a table")
            .content
    };
    let marked = format!("\u{feff}{text}");
    let little: Vec<u8> = marked.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let big: Vec<u8> = marked.encode_utf16().flat_map(u16::to_be_bytes).collect();
    assert_eq!(read(&little), read(text.as_bytes()));
    assert_eq!(read(&big), read(text.as_bytes()));
    let cut = truth_error_of(&[0xff, 0xfe, b's', 0]);
    assert!(cut.contains("columns `sequence`"), "{cut}");
}

#[test]
fn bad_tables_are_told_with_line_and_column() {
    let header = "sequence,frame,object,x,y\n";
    for (text, expected) in [
        (
            String::new(),
            "the table has no header; expected `sequence,frame,object,x,y`",
        ),
        (
            header.to_owned(),
            "gt.csv: the table has a header and no rows",
        ),
        (
            "sequence,frame,object,x\n0,0,cube,1\n".to_owned(),
            "line 1: column `y` missing; expected",
        ),
        (
            format!("{header}0,0,cube,0.1,0.2\n0,1,cube,abc,0\n"),
            "gt.csv: line 3, column `x`: `abc` is not a number",
        ),
        (
            format!("{header}0,one,cube,0.1,0.2\n"),
            "line 2, column `frame`: `one` is not a frame",
        ),
        (
            format!("{header}0,-1,cube,0.1,0.2\n"),
            "`-1` is not a frame; expected a whole number from 0",
        ),
        (
            format!("{header}0,0,,0.1,0.2\n"),
            "line 2, column `object`: empty",
        ),
        (
            format!("{header},0,cube,0.1,0.2\n"),
            "line 2, column `sequence`: empty",
        ),
        (
            format!("{header}0,0,cube,0.1,0.2\n0,1,cube,0,0\n0,0,cube,0.1,0.2\n"),
            "gt.csv: line 4: sequence 0, frame 0, object cube is already in line 2",
        ),
        (
            format!("{header}0,0,cube,0.1,0.2\n0,1,cube,0.3\n"),
            "line 3: 4 fields; expected 5",
        ),
        (
            format!("{header}0,0,cube,inf,0\n"),
            "line 2: the position (inf, 0) is infinite",
        ),
        (
            format!("{header}0,0,cube,\"0,1\",\"0,2\"\n"),
            "`0,1` is not a number; expected a number with a decimal point",
        ),
        (
            "sequence,frame,object,x,x,y\n0,0,c,1,1,1\n".to_owned(),
            "column `x` stands twice",
        ),
    ] {
        let message = truth_error(&text);
        assert!(
            message.contains(expected),
            "{message}\nexpected: {expected}"
        );
    }
    let latin = parse_ground_truth(
        b"sequence,frame,object,x,y\n0,0,w\xfcrfel,0,0\n",
        "gt.csv",
        &TableOptions::default(),
    );
    assert!(
        latin
            .expect_err("Latin-1")
            .to_string()
            .contains("gt.csv: line 2: not valid UTF-8")
    );
    let binary = parse_ground_truth(b"\x89PNG\0\0", "gt.csv", &TableOptions::default())
        .expect_err("binary")
        .to_string();
    assert!(binary.contains("not a text file"), "{binary}");
}

#[test]
fn keypoints_are_numbered_from_zero_without_gaps() {
    let header = "sequence,frame,keypoint,x,y\n";
    let message = keypoint_error(&format!("{header}0,0,nose,0,0\n"));
    assert!(
        message.contains("line 2, column `keypoint`: `nose` is not a keypoint"),
        "{message}"
    );
    let message = keypoint_error(&format!("{header}0,0,1,0,0\n0,0,2,0,0\n"));
    assert!(
        message.contains("keypoint 0 has no row, although keypoint 2 has"),
        "{message}"
    );
    let message = keypoint_error(&format!("{header}0,0,4000000000,0,0\n"));
    assert!(
        message.contains("expected its number, 0 to 4095"),
        "{message}"
    );
    let message = keypoint_error("sequence,frame,object,x,y\n0,0,cube,0,0\n");
    assert!(message.contains("column `keypoint` missing"), "{message}");
    assert!(
        message.contains("a table of ground truth: are the two tables swapped?"),
        "{message}"
    );
}

#[test]
fn keypoints_written_as_csv_are_read_back_digit_by_digit() {
    let text =
        "sequence,frame,keypoint,x,y\n\"a,b\",3,0,0.1,-0.30000001192092896\n\"a,b\",3,1,1e-17,1\n";
    let track = parse_keypoints(text.as_bytes(), "kp.csv", &TableOptions::default())
        .expect("a table")
        .content;
    let again = parse_keypoints(
        keypoints_csv(&track).as_bytes(),
        "kp.csv",
        &TableOptions::default(),
    )
    .expect("a table")
    .content;
    assert_eq!(track, again);
}

#[test]
fn frames_are_ordered_naturally_and_numbered_by_their_names() {
    let paths = [
        "d/s2/f_10.png",
        "d/s2/f_9.PNG",
        "d/s10/a.jpg",
        "d/s10/b.webp",
        "d/notes.txt",
        "d/s2/.DS_Store",
    ];
    let index = FrameIndex::new(&paths).expect("frames");
    assert_eq!(
        index.keys(),
        [key("s2", 9), key("s2", 10), key("s10", 0), key("s10", 1)]
    );
    assert_eq!(index.order(), [1, 0, 2, 3]);
    assert_eq!(index.ignored(), [4, 5]);
    assert_eq!(index.sequences()[1].start, 2);
    let same_names = FrameIndex::new(&["a/left/0.png", "b/left/0.png"]).expect("frames");
    assert_eq!(same_names.keys()[1].sequence, "b/left");
    let none = FrameIndex::new(&["a/readme.md"])
        .expect_err("no images")
        .to_string();
    assert!(
        none.contains("no images among 1 file; expected .png"),
        "{none}"
    );
    // A number that is the same for all does not tell frames apart; the one before it does.
    let cameras = FrameIndex::new(&["s/f1_cam0.png", "s/f0_cam0.png"]).expect("frames");
    assert_eq!(cameras.keys(), [key("s", 0), key("s", 1)]);
    for (extra, expected) in [
        (
            "s/cover.png",
            "s: `cover.png` has no number, other images of its folder have",
        ),
        (
            "s/f_2 (copy).png",
            "are both frame 2; expected one image a frame",
        ),
        (
            "s/f_2 (1).png",
            "`f_2 (1).png` and `f_2.png` are both frame 2",
        ),
        ("s/f_2 (12).png", "are both frame 2"),
        ("s/f_2.jpg", "are both frame 2"),
    ] {
        let error = FrameIndex::new(&["s/f_0.png", "s/f_1.png", "s/f_2.png", extra])
            .expect_err("ambiguous");
        assert!(error.to_string().contains(expected), "{error}");
    }
    // A copy whose original is gone is that frame; where all are named like copies, they are
    // numbered so.
    let alone = FrameIndex::new(&["s/f_0.png", "s/f_5 (1).png"]).expect("frames");
    assert_eq!(alone.keys(), [key("s", 0), key("s", 5)]);
    let renamed = FrameIndex::new(&["s/run 7 (2).png", "s/run 7 (1).png"]).expect("frames");
    assert_eq!(renamed.keys(), [key("s", 1), key("s", 2)]);
    let selected = index.select(&[0, 3]).expect("two frames");
    assert_eq!(
        (selected.keys(), selected.order()),
        (&[key("s2", 9), key("s10", 1)][..], &[1, 3][..])
    );
    assert!(index.select(&[4]).is_err() && index.select(&[2, 1]).is_err());
}

#[test]
fn frames_find_their_rows_by_name_number_or_being_the_only_ones() {
    let rows = [key("0", 0), key("0", 1), key("12", 0)];
    let by_number = join(
        &[key("seq_0012", 0), key("seq_0000", 1), key("seq_0000", 7)],
        &rows,
    )
    .expect("a join");
    assert_eq!(by_number.pairs, [(0, 2), (1, 1)]);
    assert_eq!(
        (by_number.unmatched_left, by_number.unmatched_right),
        (vec![2], vec![0])
    );
    assert!(by_number.rules[0].contains("by the number in their name"));
    let by_name = join(&[key("12", 0)], &rows).expect("a join");
    assert_eq!(by_name.pairs, [(0, 2)]);
    let only = join(&[key("push", 1)], &[key("run", 0), key("run", 1)]).expect("a join");
    assert_eq!(only.pairs, [(0, 1)]);
    // A stray image beside the folders changes nothing for the others.
    let stray = join(&[key("images", 0), key("seq_0012", 0)], &rows).expect("a join");
    assert_eq!((stray.pairs, stray.unmatched_left), (vec![(1, 2)], vec![0]));
    let both = join(&[key("0", 0), key("seq_0012", 0)], &rows).expect("a join");
    assert_eq!(both.pairs, [(0, 0), (1, 2)]);
    // Two sequences with one number: neither is guessed.
    let shared = join(
        &[key("run_12", 0), key("seq_0012", 0), key("seq_0000", 1)],
        &rows,
    )
    .expect("a join");
    assert_eq!(shared.pairs, [(2, 1)]);
    assert!(
        shared
            .rules
            .iter()
            .any(|r| r.contains("`run_12` and `seq_0012` both have the number 12"))
    );
    let none = join(&[key("a", 0), key("b", 0)], &rows)
        .expect_err("nothing matches")
        .to_string();
    assert!(
        none.contains("no frame has a row of ground truth") && none.contains("`a` frame 0"),
        "{none}"
    );
}

#[test]
fn what_makes_frames_match_that_do_not_is_said() {
    let keys = |sequence: u64, first: u64| -> Vec<FrameKey> {
        let frames = (0..3).flat_map(|s| (0..5).map(move |i| (s, i)));
        frames
            .map(|(s, i)| key(&format!("run_{:03}", sequence + s), first + i))
            .collect()
    };
    let reason = |rows: &[FrameKey]| {
        let error = join(&keys(0, 0), rows).expect_err("nothing matches");
        error.reason().cloned()
    };
    let numbers = |frames, sequences| Some(Reason::OtherNumbers { frames, sequences });
    assert_eq!(reason(&keys(0, 1000)), numbers(-1000, 0));
    assert_eq!(reason(&keys(100, 0)), numbers(0, -100));
    // Neither alone is enough.
    assert_eq!(reason(&keys(100, 1000)), None);
    assert_eq!(reason(&[key("a", 7)]), None);
}

#[test]
fn frames_that_count_from_one_are_pointed_out_and_not_shifted() {
    let frames: Vec<FrameKey> = (1..=5).map(|i| key("s", i)).collect();
    let rows: Vec<FrameKey> = (0..5).map(|i| key("s", i)).collect();
    let joined = join(&frames, &rows).expect("a join");
    assert_eq!(joined.pairs.len(), 4);
    assert!(
        joined
            .rules
            .iter()
            .any(|r| r.contains("the frames count from 1 and the rows from 0")),
        "{:?}",
        joined.rules
    );
}

fn frame_file(name: &str) -> Vec<u8> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data/panda_push");
    std::fs::read(folder.join(name)).expect("a frame")
}

#[test]
fn bad_images_are_told_with_what_was_expected() {
    let png = frame_file("seq_0000/frame_000.png");
    assert_eq!(Frame::decode(&png).expect("a frame").width(), 256);
    let message = |bytes: &[u8]| Frame::decode(bytes).expect_err("a bad image").to_string();
    let cut = message(&png[..png.len() / 2]);
    assert!(
        cut.contains("cannot be decoded") && cut.contains("is the file complete"),
        "{cut}"
    );
    assert!(message(b"").contains("not a PNG, JPEG or WebP image (0 bytes)"));
    assert!(message(b"sequence,frame\n").contains("not a PNG, JPEG or WebP image"));
    assert!(
        message(&blank_png(1, 1)).contains("the image is 1 x 1 pixels; expected 16 to 8192 a side")
    );
    // Refused by its header: the pixels of 20,000 x 20,000 are never allocated.
    assert!(message(&blank_png(20_000, 20_000)).contains("the image is 20000 x 20000 pixels"));
}

/// Both decoders of WebP are bit-exact and spread halved colours alike. JPEG's inverse transform
/// may be off by 1, and the conversion of colours makes 3 of it (4:4:4); of 4:2:0 the halved
/// colours are spread by filters that round once more. Few numbers are off at all.
#[test]
fn photos_are_decoded_as_by_pillow() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data/photos");
    let frame = |name: &str| {
        let bytes = std::fs::read(folder.join(name)).expect("a file");
        Frame::decode(&bytes).expect("an image")
    };
    for (i, (ending, mean, largest)) in [
        ("jpg", 0.1, 5),
        ("jpg", 0.1, 3),
        ("webp", 0.0, 0),
        ("webp", 0.0, 0),
        ("png", 0.0, 0),
    ]
    .into_iter()
    .enumerate()
    {
        let ours = frame(&format!("seq_0000/frame_{i:03}.{ending}"));
        let theirs = frame(&format!("decoded/frame_{i:03}.png"));
        let differences: Vec<u8> = ours
            .rgb()
            .iter()
            .zip(theirs.rgb().iter())
            .map(|(a, b)| a.abs_diff(*b))
            .collect();
        let sum: f64 = differences.iter().map(|d| f64::from(*d)).sum();
        let found = (
            sum / differences.len() as f64,
            differences.iter().max().copied().unwrap_or(0),
        );
        println!(
            "frame {i}, {ending}: mean {:.3}, largest {}",
            found.0, found.1
        );
        assert!(
            found.0 <= mean && found.1 <= largest,
            "frame {i}: {found:?}"
        );
        // Cut short anywhere.
        let whole =
            std::fs::read(folder.join(format!("seq_0000/frame_{i:03}.{ending}"))).expect("a file");
        for percent in [30, 50, 90, 99] {
            let part = &whole[..whole.len() * percent / 100];
            let Err(error) = Frame::decode(part) else {
                panic!("frame {i} is whole with {percent} % of its bytes");
            };
            assert!(
                error.to_string().contains("is the file complete"),
                "frame {i}: {error}"
            );
        }
        // An array of the same pixels.
        assert_eq!(
            Frame::decode(&ours.to_npy()).expect("an array").rgb(),
            ours.rgb()
        );
    }
}

/// The header of a PNG of `width` x `height` and no pixels.
fn blank_png(width: u32, height: u32) -> Vec<u8> {
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8], data: &[u8]| {
        png.extend((data.len() as u32).to_be_bytes());
        let body: Vec<u8> = kind.iter().chain(data).copied().collect();
        let crc = body.iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |c, _| {
                if c & 1 == 1 {
                    (c >> 1) ^ 0xedb8_8320
                } else {
                    c >> 1
                }
            })
        });
        png.extend(&body);
        png.extend((!crc).to_be_bytes());
    };
    let sides: Vec<u8> = width
        .to_be_bytes()
        .into_iter()
        .chain(height.to_be_bytes())
        .collect();
    chunk(b"IHDR", &[&sides[..], &[8, 2, 0, 0, 0]].concat());
    chunk(b"IDAT", &[]);
    chunk(b"IEND", &[]);
    png
}

#[test]
fn resizing_equals_torchvision() {
    let bytes = golden("resize-crop.safetensors");
    let file = SafeTensors::deserialize(&bytes).expect("safetensors");
    let (_, input) = tensor(&file, "crop100x76");
    for (name, filter) in [
        ("crop_to_64x48_no_antialias", Filter::Bilinear),
        ("crop_to_64x48_antialias", Filter::BilinearAntialias),
    ] {
        let (_, expected) = tensor(&file, name);
        // 100 rows of 76 columns to 64 rows of 48.
        let ours = resize_planar(&input, [76, 100], [48, 64], filter);
        let largest = ours
            .iter()
            .zip(&expected)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        println!("{name}: largest difference {largest:.1e}");
        // Values up to 1 in float32, a handful of products each: a few units in the last place.
        assert!(largest < 1e-6, "{name}: {largest:e}");
    }
}

#[test]
fn checkpoints_are_read_and_written_whole() {
    let bytes = golden("basic-vel-std-bg-tiny.safetensors");
    let checkpoint = Checkpoint::from_safetensors(&bytes).expect("a checkpoint");
    assert_eq!(checkpoint.config.architecture.to_string(), "basic-std-bg");
    assert_eq!(checkpoint.config.target_size, [16, 16]);
    assert_eq!(checkpoint.config.encoder_channels, [4, 6, 8]);
    let again = Checkpoint::from_safetensors(&checkpoint.to_safetensors().expect("bytes"))
        .expect("a checkpoint");
    assert_eq!(again, checkpoint);
    let architecture = "basic-vel-std-bg".parse().expect("an architecture");
    assert_eq!(
        SaeConfig::new(architecture).architecture.velocity_weight(),
        0.1
    );
}

#[test]
fn bad_checkpoints_are_told() {
    let bytes = golden("basic-vel-std-bg-tiny.safetensors");
    let message = |bytes: &[u8]| {
        Checkpoint::from_safetensors(bytes)
            .expect_err("a bad checkpoint")
            .to_string()
    };
    for end in [0, 4, 100, bytes.len() / 2, bytes.len() - 1] {
        let cut = message(&bytes[..end]);
        assert!(
            cut.contains("not a complete .safetensors file"),
            "cut at {end}: {cut}"
        );
    }
    // A checkpoint of something else: its encoder has other names.
    let mut other = Checkpoint::from_safetensors(&bytes).expect("valid").tensors;
    let weight = other
        .remove("encoder.block1.conv1.weight")
        .expect("a weight");
    other.insert("encoder.stem.weight".to_owned(), weight);
    let other = safetensors::serialize(
        other.iter().map(|(name, t)| {
            let data: Vec<u8> = t.data.iter().flat_map(|v| v.to_le_bytes()).collect();
            (name.clone(), OwnedView(t.shape.clone(), data))
        }),
        None,
    )
    .expect("bytes");
    let message_other = message(&other);
    assert!(message_other.contains(
        "not a checkpoint of a Basic, DSAE or KeyNet SAE: tensor `encoder.block1.conv1.weight` is missing"
    ));

    let mut wrong = Checkpoint::from_safetensors(&bytes).expect("valid");
    wrong
        .tensors
        .get_mut("encoder.block2.conv1.weight")
        .expect("a weight")
        .data[5] = f32::NAN;
    let error = wrong.to_safetensors().expect_err("not finite").to_string();
    assert!(
        error.contains("`encoder.block2.conv1.weight` holds NaN at position 5"),
        "{error}"
    );
    wrong.tensors.remove("encoder.block2.conv1.weight");
    let error = wrong.to_safetensors().expect_err("missing").to_string();
    assert!(
        error.contains(
            "tensor `encoder.block2.conv1.weight` is missing; expected shape [6, 4, 3, 3]"
        ),
        "{error}"
    );
    assert!(
        "vgg"
            .parse::<tracklens::checkpoint::Architecture>()
            .is_err()
    );
}

struct OwnedView(Vec<usize>, Vec<u8>);

impl safetensors::View for OwnedView {
    fn dtype(&self) -> safetensors::Dtype {
        safetensors::Dtype::F32
    }

    fn shape(&self) -> &[usize] {
        &self.0
    }

    fn data(&self) -> std::borrow::Cow<'_, [u8]> {
        (&self.1).into()
    }

    fn data_len(&self) -> usize {
        self.1.len()
    }
}

#[test]
fn files_are_recognised_by_name_and_header() {
    let role = |path: &str, head: &str| classify(path, head.as_bytes()).role;
    assert_eq!(role("a/frame_0.PNG", ""), Role::Image);
    assert_eq!(
        role("gt.csv", "\u{feff}sequence;frame;Object;x;y\r\n"),
        Role::GroundTruth
    );
    assert_eq!(
        role("kp.csv", "sequence,frame,keypoint,x,y\n"),
        Role::Keypoints
    );
    assert_eq!(role("w.safetensors", ""), Role::Checkpoint);
    assert_eq!(role("checkpoint_final.PTH", ""), Role::Checkpoint);
    let by_content = |path: &str, name: &str| classify(path, &golden(name)[..4096]);
    for name in ["basic-vel-std-bg-tiny.pth", "dsae-tiny.safetensors"] {
        for path in ["weights", "run/weights.bin"] {
            assert_eq!(
                by_content(path, name).role,
                Role::Checkpoint,
                "{path} {name}"
            );
        }
    }
    assert_eq!(
        by_content("w", "basic-vel-std-bg-tiny.pth").reason,
        "a PyTorch checkpoint, by its content"
    );
    assert_eq!(
        role("frames.zip", "PK\u{3}\u{4} something else"),
        Role::Archive
    );
    assert_eq!(
        by_content("w.zip", "basic-vel-std-bg-tiny.pth").role,
        Role::Checkpoint
    );
    assert_eq!(role("push.npz", "PK\u{3}\u{4}"), Role::Recording);
    assert_eq!(role("push.MP4", ""), Role::Video);
    assert_eq!(
        role("r.json", "{ \"schema\": \"tracklens/evaluation/1\""),
        Role::Result
    );
    for name in [
        "push.hdf5",
        "df.h5",
        "labels.slp",
        "davis.pkl",
        "points.npy",
    ] {
        assert_eq!(role(name, ""), Role::Recording, "{name}");
    }
    // Two columns a point say nothing of what the points are.
    assert!(
        classify("t.csv", b"frame,a_x,a_y\n").guess && !classify("gt.csv", b"object,x,y\n").guess
    );
    assert_eq!(role("notes.pdf", ""), Role::Unknown);
    assert_eq!(role("__MACOSX/frame_0.png", ""), Role::Unknown);
    assert!(
        classify("t.csv", b"a,b,c\n")
            .reason
            .contains("expected `sequence,frame,object,x,y`")
    );
}

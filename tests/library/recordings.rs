//! Recordings of episodes of unequal length, as robots are recorded: robomimic's groups, and arrays
//! with the ends of episodes. `tests/public/make.py` made the files.

use std::fs;
use std::path::PathBuf;

use tracklens::data::{FrameSource, Pixels, Recording, TableOptions};
use tracklens::error::{Error, Reason};

/// The number of frames of every episode.
const LENGTHS: [usize; 3] = [12, 20, 8];

fn public(name: &str) -> Vec<u8> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/public/files");
    fs::read(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn robomimic(name: &str, array: Option<&str>) -> Result<Recording, Error> {
    Recording::from_hdf5_bytes(public(name), array, &TableOptions::default())
}

/// What `make.py` draws: red tells the camera, green the frame among all.
fn pixels(frame: usize, camera: usize) -> Vec<u8> {
    let pixel = |at: usize| {
        let blue = 3 * camera + at / 16 * 8 + at % 16;
        [40 + camera as u8, frame as u8 * 5, blue as u8]
    };
    (0..256).flat_map(pixel).collect()
}

#[track_caller]
fn assert_episodes(recording: &Recording, prefix: &str, camera: usize) {
    let sequences = recording.index().sequences();
    let found: Vec<_> = sequences
        .iter()
        .map(|s| (s.name.as_str(), s.length))
        .collect();
    let names = [0, 1, 2].map(|n| format!("{prefix}_{n}"));
    let expected: Vec<_> = names.iter().map(String::as_str).zip(LENGTHS).collect();
    assert_eq!(found, expected);
    assert_eq!(recording.image_size(), [16, 16]);
    for (i, key) in recording.index().keys().iter().enumerate() {
        let own = sequences
            .iter()
            .find(|s| s.name == key.sequence)
            .expect("a sequence");
        assert_eq!(key.frame as usize, i - own.start);
        let frame = recording.read(i).expect("a frame");
        assert_eq!(*frame.pixels(), Pixels::Bytes(pixels(i, camera)), "{key}");
    }
    recording.verify().expect("checksums");
}

#[test]
fn episodes_in_groups_are_sequences_of_their_own_length() {
    let recording = robomimic("robomimic.hdf5", None).expect("a recording");
    assert_episodes(&recording, "demo", 0);
    assert_eq!(recording.frames_name(), "data/demo_0/obs/agentview_image");
    let truth = recording.truth().expect("points");
    assert_eq!(truth.keys(), recording.index().keys());
    assert_eq!(truth.names(), ["point_0", "point_1"]);
}

#[test]
fn one_of_several_cameras_has_to_be_chosen() {
    let open = |array| robomimic("robomimic-two-cameras.hdf5", array);
    let error = open(None).err().expect("two cameras");
    let message = error.to_string();
    for part in [
        "`data/demo_0`",
        "`agentview_image`, `robot0_eye_in_hand_image`",
    ] {
        assert!(message.contains(part), "{message}");
    }
    let first = "agentview_image".to_owned();
    assert_eq!(error.reason(), Some(&Reason::SeveralCameras { first }));
    for (camera, name) in ["agentview_image", "robot0_eye_in_hand_image"]
        .into_iter()
        .enumerate()
    {
        assert_episodes(&open(Some(name)).expect("a recording"), "demo", camera);
    }
    let error = open(Some("frontview_image")).err().expect("no such camera");
    assert!(
        error
            .to_string()
            .contains("there is no array `frontview_image`"),
        "{error}"
    );
}

#[test]
fn episodes_without_a_camera_are_told_apart_from_damage() {
    let error = robomimic("robomimic-low-dim.hdf5", None)
        .err()
        .expect("no frames");
    assert_eq!(error.reason(), Some(&Reason::NoFrames));
    assert!(
        error.to_string().contains("`object`, `robot0_eef_pos`"),
        "{error}"
    );
}

#[test]
fn one_array_is_divided_where_its_episodes_end() {
    let bytes = std::io::Cursor::new(public("episodes.npz"));
    let recording = Recording::from_npz(bytes, None, &TableOptions::default());
    let recording = recording.expect("a recording");
    assert_episodes(&recording, "episode", 0);
    let truth = recording.truth().expect("points");
    assert_eq!(truth.keys(), recording.index().keys());
}

#[cfg(feature = "parquet")]
mod parquet {
    use tracklens::data::export_parquet;

    use super::public;

    fn table(name: &str) -> String {
        let export = export_parquet(public(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        String::from_utf8(export.table).expect("text")
    }

    #[test]
    fn numbers_of_32_bits_keep_their_values() {
        let table = table("wide-f4.parquet");
        let mut lines = table.lines();
        let header = "frame,nose_x,nose_y,tail_x,tail_y";
        assert_eq!(lines.next(), Some(header));
        let mut count = 0;
        for line in lines {
            for cell in line.split(',').skip(1) {
                let value: f64 = cell.parse().expect("a number");
                assert_eq!(f64::from(value as f32).to_bits(), value.to_bits(), "{cell}");
                count += 1;
            }
        }
        assert_eq!(count, 160);
    }

    #[test]
    fn lists_become_columns_and_episodes_sequences() {
        let lists = table("lists.parquet");
        let mut lines = lists.lines();
        assert_eq!(lines.next(), Some("frame,cube_0,cube_1,cube_2"));
        let rows: Vec<&str> = lines.collect();
        // Row 3 has no list, row 9 an empty one, every second one a value that is missing.
        assert_eq!(rows[3], "3,,,");
        assert_eq!(rows[9], "9,,,");
        assert!(
            rows[5].ends_with(',') && !rows[5].ends_with(",,"),
            "{}",
            rows[5]
        );
        let robot = table("lerobot.parquet");
        let header = robot.lines().next().expect("a header");
        assert!(
            header.starts_with("observation.state_0,observation.state_1,"),
            "{header}"
        );
        assert!(
            header.ends_with(",action_0,action_1,sequence,frame,next.done"),
            "{header}"
        );
        let last = robot.lines().last().expect("a row");
        assert!(last.ends_with(",episode_000002,7,True"), "{last}");
    }

    #[test]
    fn a_file_that_is_cut_is_refused() {
        for name in ["tidy-none.parquet", "tidy-zstd.parquet"] {
            let whole = public(name);
            for length in 0..whole.len() {
                let cut = export_parquet(whole[..length].to_vec());
                let error = cut.expect_err("a part of a file").to_string();
                assert!(
                    error.contains("not a whole Parquet file"),
                    "{length}: {error}"
                );
            }
        }
    }

    #[test]
    fn every_flipped_bit_is_an_error_or_another_table() {
        // Plain pages, a dictionary, deltas and split bytes; then pages of version 2.
        for name in [
            "tidy-none.parquet",
            "tidy-delta.parquet",
            "tidy-pages-2.parquet",
        ] {
            let whole = public(name);
            for bit in (0..whole.len() * 8).step_by(17) {
                let mut flipped = whole.clone();
                flipped[bit / 8] ^= 1 << (bit % 8);
                let _ = export_parquet(flipped);
            }
        }
    }
}

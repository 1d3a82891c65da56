//! Recordings of episodes of unequal length, as robots are recorded: robomimic's groups, and arrays
//! with the ends of episodes. `tests/public/make.py` made the files.

use std::fs;
use std::path::PathBuf;

use tracklens::data::{FrameSource, Pixels, Recording, Space, TableOptions};
#[cfg(feature = "zarr")]
use tracklens::data::{ZarrStore, ZipStore, read_zarr_ground_truth};
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
    let names = ["agentview_image", "robot0_eye_in_hand_image"].map(str::to_owned);
    let names = names.to_vec();
    assert_eq!(error.reason(), Some(&Reason::SeveralCameras { names }));
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

/// The files of a Zarr hierarchy, to be changed.
#[cfg(feature = "zarr")]
#[derive(Clone)]
struct Files(std::collections::BTreeMap<String, Vec<u8>>);

#[cfg(feature = "zarr")]
impl Files {
    fn of(name: &str) -> Self {
        let store = ZipStore::open(std::io::Cursor::new(public(name)));
        let store = store.expect("an archive").expect("a hierarchy");
        let keys = store.keys().into_iter();
        Self(
            keys.map(|key| (key.clone(), store.read(&key).expect("a file")))
                .collect(),
        )
    }

    /// With `to` for `from` in the description of an array.
    fn with(mut self, key: &str, from: &str, to: &str) -> Self {
        let text = String::from_utf8(self.0[key].clone()).expect("JSON");
        let text = text.split_whitespace().collect::<String>();
        assert!(text.contains(from), "{text}");
        self.0
            .insert(key.to_owned(), text.replacen(from, to, 1).into_bytes());
        self
    }

    fn recording(self) -> Result<Recording, Error> {
        Recording::from_zarr(Box::new(self), None, &TableOptions::default())
    }

    fn points(self) -> Result<tracklens::track::GroundTruth, Error> {
        let read = read_zarr_ground_truth(Box::new(self), None, &TableOptions::default());
        read.map(|table| table.content)
    }
}

#[cfg(feature = "zarr")]
impl ZarrStore for Files {
    fn keys(&self) -> Vec<String> {
        self.0.keys().cloned().collect()
    }

    fn has(&self, key: &str) -> bool {
        self.0.contains_key(key)
    }

    fn read(&self, key: &str) -> Result<Vec<u8>, Error> {
        Ok(self.0[key].clone())
    }

    fn size(&self) -> u64 {
        self.0.values().map(|bytes| bytes.len() as u64).sum()
    }
}

#[cfg(feature = "zarr")]
#[test]
fn replay_buffers_of_diffusion_policy_are_episodes() {
    let whole = Files::of("replay.zarr.zip");
    let recording = whole.clone().recording().expect("a recording");
    assert_episodes(&recording, "episode", 0);
    // Nobody said on which board the points are.
    assert!(recording.truth().is_none());
    let told = recording.notices()[0].to_string();
    assert!(
        told.contains("the points are left out: the unit of `keypoint`"),
        "{told}"
    );

    let options = TableOptions {
        space: Some(Space::Pixels),
        image_size: Some([100, 80]),
        ..TableOptions::default()
    };
    let recording = Recording::from_zarr(Box::new(whole.clone()), None, &options);
    let recording = recording.expect("a recording");
    let truth = recording.truth().expect("points");
    assert_eq!(truth.keys(), recording.index().keys());
    // The board is not the frames, whose size does not stand for it.
    let options = TableOptions {
        image_size: None,
        ..options
    };
    let error = Recording::from_zarr(Box::new(whole), None, &options).err();
    assert_eq!(
        error.expect("no size").reason(),
        Some(&Reason::MissingImageSize)
    );
}

#[cfg(feature = "zarr")]
#[test]
fn floats_of_a_replay_buffer_go_to_255() {
    let recording = Files::of("replay-v3.zarr.zip")
        .recording()
        .expect("a recording");
    assert!(recording.has_floats());
    for i in [0, 13, 39] {
        let frame = recording.read(i).expect("a frame");
        assert_eq!(frame.rgb(), pixels(i, 0), "frame {i}");
    }
}

#[cfg(feature = "zarr")]
#[test]
fn zarr_that_declares_more_than_its_files_is_refused() {
    let files = || Files::of("points-v2-zstd.zarr.zip");
    let key = "keypoints/.zarray";
    for (from, to, part) in [
        (
            "[40,2,2]",
            "[1073741824,2,2]",
            "expected at most 16777216 frames",
        ),
        (
            "[40,2,2]",
            "[4000000,2,2]",
            "shape [4000000, 2, 2] is more than",
        ),
        (
            "[16,2,2]",
            "[16777216,2,2]",
            "its chunks have shape [16777216,2,2]",
        ),
        ("[16,2,2]", "[15,2,2]", "the size of a decoded chunk is 512"),
        (
            "[40,2,2]",
            "[40,2,2,2,2,2,2,2,2]",
            "not a description of an array",
        ),
        ("[40,2,2]", "[40,-2,2]", "not a description of an array"),
        (
            "\"zstd\"",
            "\"lzma\"",
            "packed with blosc, gzip, zlib, zstd or not at all",
        ),
        ("\"<f8\"", "\"<c16\"", "is of type no number"),
        ("\"<f8\"", "1", "is of type no number"),
        ("{", "[", "not a description of an array"),
    ] {
        let error = files()
            .with(key, from, to)
            .points()
            .expect_err(part)
            .to_string();
        assert!(error.contains(part), "{to}: {error}");
    }
    let mut cut = files();
    cut.0.retain(|key, _| !key.ends_with(".zarray"));
    let error = cut.points().expect_err("no array").to_string();
    assert!(error.contains("there is no Zarr array"), "{error}");
}

#[cfg(feature = "zarr")]
#[test]
fn every_packing_of_zarr_notices_a_chunk_that_is_cut() {
    for packing in [
        "v2-blosc",
        "v2-zstd",
        "v2-gzip",
        "v2-zlib",
        "v2-plain",
        "v3-zstd",
        "v3-blosc",
        "v3-gzip",
        "v3-plain",
        "v3-shards",
    ] {
        let whole = Files::of(&format!("points-{packing}.zarr.zip"));
        let is_chunk = |key: &&String| key.ends_with('0') && !key.ends_with(".zgroup");
        let key = whole.0.keys().find(is_chunk).expect("a chunk").clone();
        for length in 0..whole.0[&key].len() {
            let mut cut = whole.clone();
            cut.0.get_mut(&key).expect("a chunk").truncate(length);
            assert!(cut.points().is_err(), "{packing}, {length} bytes of {key}");
        }
        whole.points().unwrap_or_else(|e| panic!("{packing}: {e}"));
    }
}

#[cfg(feature = "parquet")]
mod parquet {
    use tracklens::data::{export_parquet, read_video_episodes};

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
    fn episodes_are_found_in_the_videos_of_every_camera() {
        let bytes = public("../lerobot/meta/episodes/chunk-000/file-000.parquet");
        let episodes = read_video_episodes(bytes).expect("episodes");
        let found: Vec<_> = episodes
            .iter()
            .map(|e| (e.sequence.as_str(), e.camera.as_str(), e.start, e.frames))
            .collect();
        let [top, wrist] = ["observation.images.top", "observation.images.wrist"];
        let expected = [
            ("episode_000000", top, 0.0, 12),
            ("episode_000000", wrist, 0.0, 12),
            ("episode_000001", top, 1.2, 20),
            ("episode_000001", wrist, 1.2, 20),
            ("episode_000002", top, 3.2, 8),
            ("episode_000002", wrist, 3.2, 8),
        ];
        assert_eq!(found, expected);
        assert!(episodes.iter().all(|e| e.video == "chunk-000/file-000"));

        // The data of such a recording are another table.
        let error = read_video_episodes(public("lerobot.parquet")).expect_err("no episodes");
        assert!(error.to_string().contains("no column `length`"), "{error}");
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

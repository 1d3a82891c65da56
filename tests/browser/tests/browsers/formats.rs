//! Files of other programs on the page, against the `tracklens` command on the same files.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use thirtyfour::{By, Key};
use tracklens_page_tests::{
    Browser, Page, copy_folder, in_every_browser, pack, text, tracklens_json, unpack,
};

in_every_browser! {
    tables_of_other_programs_are_scored_as_in_the_terminal
    frames_of_an_hdf5_file_are_read_by_slices
    one_of_several_cameras_of_a_file_is_chosen
    a_zarr_hierarchy_is_read_as_a_folder_and_as_an_archive
    arrays_of_a_recording_are_said_to_be_objects
    a_checkpoint_in_several_files_is_one
    episodes_in_a_video_of_lerobot_are_sequences
}

/// Frames of the episodes in `tests/public/lerobot`.
const EPISODES: [usize; 3] = [12, 20, 8];

/// Relative: the same arithmetic in WebAssembly.
const TABLES: f64 = 1e-12;
/// Relative: f32 convolutions differ in the last digits between native and WebAssembly kernels. A
/// keypoint that is off by d changes a mean squared distance e by 2 d / sqrt(e) of it; d is up to
/// 3e-7 here, and e down to 0.0045.
const EXTRACTED: f64 = 1e-5;

/// A file of the tests; Chromium takes no `..` in its path.
fn tests(path: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    path.canonicalize().expect("a file of the tests")
}

/// Waits for a score, whose errors are those of an evaluation of the command.
async fn shows(page: &Page, expected: &Value, tolerance: f64) {
    page.until_scored().await;
    let saved = page.saved("#save-evaluation").await;
    let saved: Value = serde_json::from_slice(&saved).expect("an evaluation");
    let errors = |evaluation: &Value| -> Vec<Option<f64>> {
        let rows = evaluation["errors"].as_array().expect("rows").iter();
        rows.flat_map(|row| row.as_array().expect("a row"))
            .map(Value::as_f64)
            .collect()
    };
    let [found, expected] = [&saved, expected].map(errors);
    assert_eq!(found.len(), expected.len());
    for pair in found.into_iter().zip(expected) {
        match pair {
            (Some(found), Some(error)) => {
                assert!(
                    (found - error).abs() <= tolerance * error,
                    "{found}, {error}"
                );
            }
            (found, error) => assert_eq!(found, error),
        }
    }
}

async fn tables_of_other_programs_are_scored_as_in_the_terminal(browser: Browser) {
    let page = Page::open_in(browser).await;
    let keypoints = tests("public/files/keypoints.csv");
    for (file, is_in_pixels) in [
        ("tidy.parquet", false),
        ("tidy-gzip.parquet", false),
        ("pandas-wide-table.h5", false),
        ("tap-vid-4.pkl", false),
        ("dlc-fixed.h5", true),
        ("sleap.slp", true),
    ] {
        let truth = tests("public/files").join(file);
        page.pick(&[&truth, &keypoints]).await;
        let [truth, keypoints] = [&truth, &keypoints].map(|path| text(path));
        let mut command = vec!["score", "--truth", &truth, "--keypoints", &keypoints];
        if is_in_pixels {
            enter_size(&page, ["100", "80"]).await;
            command.extend(["--image-size", "100x80"]);
        }
        shows(&page, &tracklens_json(&command), TABLES).await;
        page.start_over().await;
    }
    page.close().await;
}

/// Says how large the images are that a table in pixels belongs to.
async fn enter_size(page: &Page, size: [&str; 2]) {
    page.until("document.querySelectorAll('.image-size input').length === 2")
        .await;
    for (side, pixels) in ["width", "height"].into_iter().zip(size) {
        page.value(&format!(
            "(() => {{ const field = document.querySelector('.image-size input[name=image-{side}]'); \
             field.value = '{pixels}'; field.dispatchEvent(new Event('change')); }})()"
        ))
        .await;
    }
}

async fn frames_of_an_hdf5_file_are_read_by_slices(browser: Browser) {
    let page = Page::open_in(browser).await;
    let frames = tests("data/formats/options.hdf5");
    let checkpoint = tests("golden/basic-vel-std-bg-tiny.safetensors");
    page.pick(&[&frames, &checkpoint]).await;
    let [file, weights] = [&frames, &checkpoint].map(|path| text(path));
    let expected = tracklens_json(&["eval", "--checkpoint", &weights, "--frames", &file]);
    shows(&page, &expected, EXTRACTED).await;
    page.until_text("15 frames and points").await;
    page.until("document.querySelector('#stage').dataset.picture.startsWith('options.hdf5/seq_')")
        .await;
    assert_eq!(
        page.value("document.querySelector('#problems').textContent")
            .await,
        json!("")
    );
    // Nothing of it is left once it is removed.
    page.click("#files [data-role=recording] .icon-button")
        .await;
    page.until("document.querySelector('#files [data-role=image]') === null")
        .await;
    page.close().await;
}

/// Shows the frames of another camera of a recording.
async fn choose_camera(page: &Page, name: &str) {
    page.value(&format!(
        "(() => {{ const field = document.querySelector('select[name=camera]'); field.value = '{name}'; \
         field.dispatchEvent(new Event('change')); }})()"
    ))
    .await;
}

async fn one_of_several_cameras_of_a_file_is_chosen(browser: Browser) {
    let page = Page::open_in(browser).await;
    let frames = tests("public/files/robomimic-two-cameras.hdf5");
    let checkpoint = tests("golden/basic-vel-std-bg-tiny.safetensors");
    page.pick(&[&frames, &checkpoint]).await;
    let [file, weights] = [&frames, &checkpoint].map(|path| text(path));
    for camera in ["agentview_image", "robot0_eye_in_hand_image"] {
        if camera != "agentview_image" {
            choose_camera(&page, camera).await;
        }
        let expected = tracklens_json(&[
            "eval",
            "--checkpoint",
            &weights,
            "--frames",
            &file,
            "--array",
            camera,
        ]);
        page.until_errors(&expected, EXTRACTED).await;
        let shown = "document.querySelector('select[name=camera]').value";
        assert_eq!(page.value(shown).await, camera);
    }
    page.close().await;
}

/// Gives a field of the list of files a value.
async fn fill_in(page: &Page, selector: &str, value: &str) {
    page.until(&format!("document.querySelector('{selector}') !== null"))
        .await;
    page.value(&format!(
        "(() => {{ const field = document.querySelector('{selector}'); field.value = '{value}'; \
         for (const type of ['input', 'change']) field.dispatchEvent(new Event(type)); }})()"
    ))
    .await;
}

/// Picks a folder; Firefox takes none from WebDriver, and so an archive of it.
async fn pick_folder(page: &Page, browser: Browser, folder: &Path) {
    if browser == Browser::Chromium {
        return page.pick_folder(folder).await;
    }
    let (around, name) = (folder.parent(), folder.file_name());
    let around = around.expect("a folder around it");
    let archive = around.join("packed.zip");
    pack(
        around,
        &[&name.expect("a name").to_string_lossy()],
        &archive,
    );
    page.pick(&[&archive]).await;
}

/// Says how large the board of a simulator is.
async fn enter_board(page: &Page) {
    page.until_text("Size of the simulator's board").await;
    fill_in(page, "input[name=image-width]", "100").await;
    fill_in(page, "input[name=image-height]", "80").await;
}

async fn a_zarr_hierarchy_is_read_as_a_folder_and_as_an_archive(browser: Browser) {
    let page = Page::open_in(browser).await;
    let archive = tests("public/files/replay.zarr.zip");
    let checkpoint = tests("golden/basic-vel-std-bg-tiny.safetensors");
    let unpacked = tempfile::tempdir().expect("a folder");
    unpack(&archive, unpacked.path());
    let folder = unpacked.path().join("replay.zarr");
    let [file, weights] = [&archive, &checkpoint].map(|path| text(path));
    let size = ["--space", "px", "--image-size", "100x80"];
    let command = [
        &["eval", "--checkpoint", &weights, "--frames", &file][..],
        &size,
    ];
    let expected = tracklens_json(&command.concat());
    for is_folder in [false, true] {
        match is_folder {
            true => pick_folder(&page, browser, &folder).await,
            false => page.pick(&[&archive]).await,
        }
        page.pick(&[&checkpoint]).await;
        page.until_text("40 frames and points").await;
        // The board of the simulator has a size of its own, whatever that of the frames.
        page.until_text("the unit of keypoint is that of its simulator")
            .await;
        enter_board(&page).await;
        shows(&page, &expected, EXTRACTED).await;
        page.until("document.querySelector('#stage').dataset.picture.includes('/episode_')")
            .await;
        page.start_over().await;
    }

    // A chunk that is damaged costs its frames, and is told.
    fs::write(folder.join("data/img/1.0.0.0"), b"cut").expect("written");
    pick_folder(&page, browser, &folder).await;
    page.pick(&[&checkpoint]).await;
    enter_board(&page).await;
    page.until_text("a chunk does not unpack to its size").await;
    page.close().await;
}

async fn arrays_of_a_recording_are_said_to_be_objects(browser: Browser) {
    let page = Page::open_in(browser).await;
    let keypoints = tests("public/files/keypoints-episodes.csv");
    let robots = tests("public/files/robomimic-low-dim.hdf5");
    let unpacked = tempfile::tempdir().expect("a folder");
    unpack(&tests("public/files/replay.zarr.zip"), unpacked.path());
    let replay = unpacked.path().join("replay.zarr");
    fs::remove_dir_all(replay.join("data/keypoint")).expect("removed");
    let [points, robot, state] = [&keypoints, &robots, &replay].map(|path| text(path));
    let opens = "document.querySelector('[data-key^=\"objects\"] summary')?.click() ?? null";

    page.pick(&[&robots, &keypoints]).await;
    page.until_text("Say which arrays are objects").await;
    page.value(opens).await;
    fill_in(&page, "[name=object-name]", "gripper").await;
    fill_in(&page, "[name=object-array]", "obs/robot0_eef_pos").await;
    page.click("[name=add-object]").await;
    let second = |name: &str| format!(".mapper-row:nth-child(2) [name={name}]");
    fill_in(&page, &second("object-name"), "cube").await;
    fill_in(&page, &second("object-array"), "obs/object").await;
    fill_in(&page, &second("object-numbers"), "0:3").await;
    page.click("[name=apply-objects]").await;
    let columns = "gripper=obs/robot0_eef_pos,cube=obs/object[0:3]";
    let command = [
        "score",
        "--truth",
        &robot,
        "--columns",
        columns,
        "--keypoints",
        &points,
    ];
    shows(&page, &tracklens_json(&command), TABLES).await;
    page.start_over().await;

    // Two numbers have a unit, which nobody but the user knows.
    pick_folder(&page, browser, &replay).await;
    page.pick(&[&keypoints]).await;
    page.until_text("Say which arrays are objects").await;
    page.value(opens).await;
    fill_in(&page, "[name=object-name]", "agent").await;
    fill_in(&page, "[name=object-array]", "state").await;
    fill_in(&page, "[name=object-numbers]", "2:4").await;
    page.click("[name=apply-objects]").await;
    page.until_text("Choose the unit of the positions.").await;
    fill_in(&page, "[name=unit]", "px").await;
    fill_in(&page, "[name=board-width]", "100").await;
    fill_in(&page, "[name=board-height]", "80").await;
    page.click("[name=apply-objects]").await;
    let command = [
        "score",
        "--truth",
        &state,
        "--columns",
        "agent=state[2:4]",
        "--space",
        "px",
        "--image-size",
        "100x80",
        "--keypoints",
        &points,
    ];
    shows(&page, &tracklens_json(&command), TABLES).await;
    page.close().await;
}

/// Writes the tensors of a `.safetensors` file as two files and their index, as large models come.
fn split(checkpoint: &Path, folder: &Path) {
    let bytes = fs::read(checkpoint).expect("a checkpoint");
    let (length, rest) = bytes.split_at(8);
    let length = u64::from_le_bytes(length.try_into().expect("eight bytes"));
    let (header, data) = rest.split_at(length as usize);
    let mut header: Map<String, Value> = serde_json::from_slice(header).expect("a header");
    let metadata = header.remove("__metadata__");
    let mut map = Map::new();
    for part in 0..2 {
        let file = format!("model-{}-of-2.safetensors", part + 1);
        let (mut own, mut held) = (Map::new(), Vec::new());
        own.extend(metadata.clone().map(|all| ("__metadata__".to_owned(), all)));
        for (name, tensor) in header.iter().skip(part).step_by(2) {
            let at = |i: usize| tensor["data_offsets"][i].as_u64().expect("a number") as usize;
            let start = held.len();
            held.extend(&data[at(0)..at(1)]);
            let mut tensor = tensor.clone();
            tensor["data_offsets"] = json!([start, held.len()]);
            own.insert(name.clone(), tensor);
            map.insert(name.clone(), json!(file));
        }
        let own = serde_json::to_vec(&own).expect("JSON");
        let length = (own.len() as u64).to_le_bytes();
        fs::write(folder.join(file), [&length[..], &own, &held].concat()).expect("written");
    }
    let index = json!({ "weight_map": map }).to_string();
    fs::write(folder.join("model.safetensors.index.json"), index).expect("written");
}

async fn a_checkpoint_in_several_files_is_one(browser: Browser) {
    let page = Page::open_in(browser).await;
    let folder = tempfile::tempdir().expect("a folder");
    split(
        &tests("golden/basic-vel-std-bg-tiny.safetensors"),
        folder.path(),
    );
    let frames = tests("data/formats/options.hdf5");
    let [index, first, second] = [
        "model.safetensors.index.json",
        "model-1-of-2.safetensors",
        "model-2-of-2.safetensors",
    ]
    .map(|name| folder.path().join(name));
    page.pick(&[&frames, &index, &first]).await;
    page.until_text("names model-2-of-2.safetensors, which did not come with it")
        .await;
    page.pick(&[&index, &first, &second]).await;
    page.until_text("a checkpoint in 2 files, by its index")
        .await;
    let [file, weights] = [&frames, &index].map(|path| text(path));
    let expected = tracklens_json(&["eval", "--checkpoint", &weights, "--frames", &file]);
    shows(&page, &expected, EXTRACTED).await;
    page.close().await;
}

/// A video of as many frames as the data have, each grey by its number, as numbers of its bytes.
const VIDEO: &str = "(async () => { \
  const { BufferTarget, CanvasSource, Mp4OutputFormat, Output } = await import('./vendor/mediabunny.js'); \
  const target = new BufferTarget(); \
  const output = new Output({ format: new Mp4OutputFormat(), target }); \
  const canvas = new OffscreenCanvas(64, 64); \
  const context = canvas.getContext('2d'); \
  const source = new CanvasSource(canvas, { codec: 'vp9', bitrate: 1e6 }); \
  output.addVideoTrack(source, { frameRate: 10 }); \
  await output.start(); \
  for (let i = 0; i < 40; i++) { \
    context.fillStyle = `rgb(${5 * i}, ${5 * i}, ${5 * i})`; \
    context.fillRect(0, 0, 64, 64); \
    await source.add(i / 10, 0.1); \
  } \
  await output.finalize(); \
  return new Uint8Array(target.buffer).join(' '); })()";

/// Two cameras and three episodes in one video each, as LeRobot keeps them.
async fn episodes_in_a_video_of_lerobot_are_sequences(browser: Browser) {
    let maker = Page::open().await;
    let bytes = maker.value(VIDEO).await;
    let bytes = bytes.as_str().expect("a video").split(' ');
    let video: Vec<u8> = bytes.map(|byte| byte.parse().expect("a byte")).collect();
    maker.close().await;

    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("pushes");
    copy_folder(&tests("public/lerobot"), &data);
    let mut videos = Vec::new();
    for camera in ["observation.images.top", "observation.images.wrist"] {
        let place = data.join("videos").join(camera).join("chunk-000");
        fs::create_dir_all(&place).expect("a folder");
        videos.push(place.join("file-000.mp4"));
        fs::write(place.join("file-000.mp4"), &video).expect("written");
    }
    fs::write(
        data.join("meta/info.json"),
        "{\"codebase_version\": \"v3.0\"}",
    )
    .expect("written");
    let mut truth = String::from("sequence,frame,object,x,y\n");
    for (episode, length) in EPISODES.into_iter().enumerate() {
        for frame in 0..length {
            let (x, y) = (0.7 * (episode * 13 + frame) as f64).sin_cos();
            writeln!(truth, "episode_{episode:06},{frame},cube,{x},{y}").expect("a string");
        }
    }
    fs::write(folder.path().join("truth.csv"), truth).expect("written");

    let page = Page::open_in(browser).await;
    let archive = folder.path().join("pushes.zip");
    let pick = async || {
        pack(folder.path(), &["pushes"], &archive);
        page.pick(&[&archive]).await;
    };
    pick().await;
    page.pick(&[
        &folder.path().join("truth.csv"),
        &tests("golden/basic-vel-std-bg-tiny.safetensors"),
    ])
    .await;
    page.until_scored().await;
    let total: usize = EPISODES.iter().sum();
    let matched = "document.querySelector('#join').dataset.matched";
    assert_eq!(page.number(matched).await, total as f64);
    page.until_text("3 episodes, 40 frames of observation.images.top, vp9")
        .await;
    // Frame after frame the video is lighter, by about 5: none is skipped between episodes. How light,
    // browsers do not agree on.
    page.hold().await;
    let stage = page.driver.find(By::Css("#stage")).await.expect("a stage");
    let grey = "document.querySelector('#stage').getContext('2d').getImageData(2, 2, 1, 1).data[0]";
    let mut before = None;
    for (episode, length) in EPISODES.into_iter().enumerate() {
        let mut shown = Vec::new();
        for (frame, key) in [(0, Key::End), (length - 1, Key::PageDown)] {
            let path = format!("episode_{episode:06}/frame_{frame:06}");
            page.until(&format!(
                "document.querySelector('#stage').dataset.picture?.endsWith('{path}')"
            ))
            .await;
            shown.push(page.number(grey).await);
            stage.send_keys("" + key).await.expect("a key");
        }
        if let Some(before) = before.replace(shown[1]) {
            let step = shown[0] - before;
            assert!((2.0..9.0).contains(&step), "{episode}: {before}, {shown:?}");
        }
        let steps = (length - 1) as f64;
        let mean = (shown[1] - shown[0]) / steps;
        assert!((4.0..7.0).contains(&mean), "{episode}: {shown:?}");
    }

    choose_camera(&page, "observation.images.wrist").await;
    page.until_text("3 episodes, 40 frames of observation.images.wrist, vp9")
        .await;
    page.until_scored().await;

    // One video less: the other camera is shown, and there is nothing to choose.
    page.start_over().await;
    fs::remove_file(&videos[0]).expect("removed");
    pick().await;
    page.until_text("3 episodes, 40 frames of observation.images.wrist")
        .await;
    assert_eq!(
        page.value("document.querySelector('select[name=camera]')")
            .await,
        Value::Null
    );
    page.start_over().await;
    fs::remove_file(&videos[1]).expect("removed");
    fs::write(data.join("videos/notes.txt"), "gone").expect("written");
    pick().await;
    page.until_text("none of the videos that the episodes lie in is in pushes.zip/pushes/videos")
        .await;
    page.close().await;
}

//! The page, through its own controls, against the `tracklens` command on the same files.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tracklens_page_tests::{
    Browser, EXAMPLE_FRAMES, EXAMPLE_KEYPOINTS, EXAMPLE_LENGTH, Page, Server, copy_folder, eval,
    eval_example, example, example_inputs, extract_keypoints, in_every_browser, parsed,
    same_keypoints, site, text, tracklens_json,
};

/// f32 convolutions differ in the last digits between native and WebAssembly kernels (with and
/// without fused multiply-add): keypoints agree to 1e-4, and their errors, means over all frames,
/// to far less.
const KEYPOINTS: f64 = 1e-4;

/// Relative, of the errors.
const ERRORS: f64 = 1e-6;

/// TC and the errors of all objects as the page shows them are those of an evaluation of the
/// command.
async fn shows(page: &Page, expected: &Value, tolerance: f64) {
    // `null` where it is unknown.
    let tc = page
        .value("JSON.parse(document.querySelector('#results').dataset.tc)")
        .await;
    assert_eq!(tc.as_f64(), expected["tc"].as_f64());
    let objects = expected["objects"].as_array().expect("objects");
    assert_eq!(
        page.number("document.querySelectorAll('.card').length")
            .await,
        objects.len() as f64
    );
    for object in objects {
        let card = format!(
            "document.querySelector('.card[data-object={}]').dataset",
            object["name"]
        );
        let error = object["error"].as_f64().expect("a number");
        let shown = page.number(&format!("{card}.error")).await;
        let difference = (shown - error).abs() / error;
        println!(
            "{}: {shown} in the page, {error} in the terminal, relative difference {difference:.1e}",
            object["name"]
        );
        assert!(
            difference <= tolerance,
            "{}: {shown} and {error}",
            object["name"]
        );
        for field in ["threshold", "frames", "outside"] {
            assert_eq!(
                Some(page.number(&format!("{card}.{field}")).await),
                object[field].as_f64(),
                "{field}"
            );
        }
        assert_eq!(
            Some(page.number(&format!("{card}.keypoint")).await),
            object["best_keypoint"].as_f64()
        );
        assert_eq!(
            page.value(&format!("{card}.tracked")).await,
            object["tracked"].to_string()
        );
    }
}

/// What the command makes of the example's frames with an encoder.
fn evaluation(checkpoint: &Path) -> Value {
    let [_, frames, truth] = example_inputs();
    parsed(&eval([checkpoint, &frames, &truth], &[]))
}

fn evaluation_of_the_example() -> Value {
    parsed(&eval_example(&[]))
}

in_every_browser! {
    the_example_is_one_click_away_and_thresholds_act_at_once
    keypoints_take_the_place_of_frames_and_checkpoint
    bad_tables_and_checkpoints_are_told_and_replaced
    own_files_take_the_place_of_the_example
    what_is_wrong_stands_over_the_results_and_goes_with_its_cause
    the_frames_done_can_be_scored_after_cancelling
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dropped_folder_scores_as_in_the_terminal() {
    let page = Page::open().await;
    page.pick_folder(&example("frames")).await;
    page.until("document.querySelector('#files [data-role=image]')")
        .await;
    // In any order, in several goes.
    page.pick(&[&example("checkpoint.safetensors")]).await;
    page.until("document.querySelector('#files [data-role=checkpoint][data-state=used]')")
        .await;
    page.pick(&[&example("ground_truth.csv")]).await;
    page.until_scored().await;
    shows(&page, &evaluation_of_the_example(), ERRORS).await;

    let frames = page
        .number("document.querySelector('#files [data-role=image]').dataset.frames")
        .await;
    assert_eq!(
        page.number("document.querySelector('#join').dataset.matched")
            .await,
        frames
    );
    assert_eq!(
        page.number("document.querySelector('#join').dataset.unmatchedRows")
            .await,
        0.0
    );

    // The keypoints themselves: extracted in the worker, saved by the page, against the command's.
    let folder = tempfile::tempdir().expect("a folder");
    let expected = extract_keypoints(&example("frames"), &folder.path().join("kp.csv"));
    same_keypoints(&page.saved_keypoints().await, &expected, KEYPOINTS);
    page.close().await;
}

async fn the_example_is_one_click_away_and_thresholds_act_at_once(browser: Browser) {
    let page = Page::open_in(browser).await;
    page.click("#try-example").await;
    page.until_scored().await;
    let expected = evaluation_of_the_example();
    shows(&page, &expected, ERRORS).await;

    let set = |object: &str, value: &str| {
        format!(
            "(() => {{ const field = document.querySelector('#threshold-{object}'); field.value = '{value}'; \
             field.dispatchEvent(new Event('input', {{ bubbles: true }})); \
             return document.querySelector('#results').dataset.tc; }})()"
        )
    };
    // Random keypoints would stay below such thresholds, too.
    assert_eq!(page.value(&set("eef", "5")).await, "null");
    for (object, threshold) in [("cube", "0.01"), ("target", "0.0145"), ("eef", "0.09")] {
        page.value(&set(object, threshold)).await;
    }
    assert_eq!(
        page.number("document.querySelector('#results').dataset.tc")
            .await,
        1.0
    );
    assert_eq!(
        page.value(&set("eef", "0.000001")).await,
        (2.0 / 3.0).to_string()
    );
    // What cannot be a threshold changes nothing.
    assert_eq!(page.value(&set("eef", "-3")).await, (2.0 / 3.0).to_string());
    page.until("document.querySelector('#threshold-eef-hint').textContent === 'Expected a number above 0; 0.000001 still holds.'")
        .await;
    assert_eq!(page.value("document.querySelector('#threshold-eef').ariaInvalid ?? document.querySelector('#threshold-eef').getAttribute('aria-invalid')").await, "true");

    // The transform acts at once, too, and equals the command's.
    page.value("document.querySelector('input[name=transform][value=identity]').click()")
        .await;
    page.until("document.querySelector('#results').textContent.includes('without a fitted map')")
        .await;

    // The viewer: the picture is there, keys move it, the plots are drawn.
    page.until("document.querySelector('#stage').dataset.picture?.endsWith('.png')")
        .await;
    page.hold().await;
    let before = page
        .number("document.querySelector('#stage').dataset.frame")
        .await;
    let stage = page
        .driver
        .find(thirtyfour::By::Css("#stage"))
        .await
        .expect("a stage");
    stage.focus().await.expect("focus");
    stage
        .send_keys("" + thirtyfour::Key::Right)
        .await
        .expect("a key");
    page.until(&format!(
        "Number(document.querySelector('#stage').dataset.frame) === {}",
        before + 1.0
    ))
    .await;
    // The frame and three plots; what the decoder makes of the frame is shown when asked for.
    let drawn = "(([stage, ...plots]) => plots.length === 3 && [stage, ...plots].every((c) => c.width > 100 && \
                 c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((v, i, d) => v !== d[i % 4])))\
                 ([...document.querySelectorAll('#stage, #viewer canvas.plot')])";
    page.until(drawn).await;
    page.close().await;
}

/// Takes photos, their ground truth and the example's checkpoint, and gives the folder of the
/// photos.
async fn pick_photos(page: &Page) -> PathBuf {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data");
    let data = data.canonicalize().expect("the data of the tests");
    let photos = data.join("photos/seq_0000");
    page.pick(&[
        &example("checkpoint.safetensors"),
        &data.join("panda_push/ground_truth.csv"),
    ])
    .await;
    page.pick_folder(&photos).await;
    photos
}

/// JPEG and WebP are decoded by a part of the package of their own.
#[tokio::test(flavor = "multi_thread")]
async fn photos_are_extracted_as_in_the_terminal() {
    let page = Page::open().await;
    let photos = pick_photos(&page).await;
    page.until_scored().await;
    let folder = tempfile::tempdir().expect("a folder");
    let expected = extract_keypoints(&photos, &folder.path().join("kp.csv"));
    assert_eq!(expected.lines().count(), 1 + 5 * EXAMPLE_KEYPOINTS);
    same_keypoints(&page.saved_keypoints().await, &expected, KEYPOINTS);
    page.close().await;
}

/// That the part cannot be fetched is no fault of the images.
#[tokio::test(flavor = "multi_thread")]
async fn a_part_that_is_not_there_is_told_and_asked_for_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let part = "pkg/tracklens_images_bg.wasm";
    copy_folder(&site(), folder.path());
    fs::remove_file(folder.path().join(part)).expect("the part");
    let server = Server::start(folder.path().to_owned(), &[]).await;
    let page = Page::open_prepared(&[], server, "/", "").await;
    pick_photos(&page).await;
    page.until_text("JPEG and WebP images need a part of the page that is not there")
        .await;
    fs::copy(site().join(part), folder.path().join(part)).expect("the part");
    page.click("#extract").await;
    page.until_scored().await;
    assert_eq!(
        page.saved_keypoints().await.lines().count(),
        1 + 5 * EXAMPLE_KEYPOINTS,
        "no image is taken for a bad one"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn an_extraction_can_be_cancelled_and_goes_on() {
    let page = Page::open().await;
    // An encoder that takes the frames at their full size, so that there is something to cancel.
    let slow = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../golden/basic-vel-std-bg-tiny.safetensors");
    let slow = slow.canonicalize().expect("the golden file");
    page.pick(&[&slow, &example("ground_truth.csv")]).await;
    page.until("document.querySelector('#files [data-role=checkpoint][data-state=used]')")
        .await;
    page.value(
        "(() => { const place = document.querySelector('#extraction'); new MutationObserver(() => { \
         if (place.dataset.status === 'running' && Number(place.dataset.done) >= 2 && !globalThis.__cancelled) { \
         const { done } = place.dataset; document.querySelector('#cancel').click(); \
         globalThis.__cancelled = [Number(done), place.dataset.status]; } }) \
         .observe(place, { attributes: true, childList: true, subtree: true }); })()",
    )
    .await;
    page.pick_folder(&example("frames")).await;
    page.until("globalThis.__cancelled").await;
    page.until("document.querySelector('#extraction').dataset.status === 'cancelled'")
        .await;
    let done = page
        .number("document.querySelector('#extraction').dataset.done")
        .await;
    let total = page
        .number("document.querySelector('#extraction').dataset.total")
        .await;
    assert!(done >= 2.0 && done < total, "{done} of {total}");
    // It does not wait for the frames that are under way.
    assert_eq!(
        page.value("globalThis.__cancelled").await,
        json!([done as u64, "cancelled"])
    );

    page.click("#extract").await;
    page.until_scored().await;
    let expected = evaluation(&slow);
    // Activations of random weights at full size: 1e-5 where the trained ones agree to 1e-6.
    shows(&page, &expected, 1e-5).await;
    page.close().await;
}

async fn the_frames_done_can_be_scored_after_cancelling(browser: Browser) {
    let page = Page::open_in(browser).await;
    page.value(
        "(() => { const place = document.querySelector('#extraction'); new MutationObserver(() => { \
         if (place.dataset.status === 'running' && Number(place.dataset.done) >= 60 && !globalThis.__cancelled) { \
         globalThis.__cancelled = true; document.querySelector('#cancel').click(); } }) \
         .observe(place, { attributes: true, childList: true, subtree: true }); })()",
    )
    .await;
    page.click("#try-example").await;
    page.until("document.querySelector('#score-partial')").await;
    let done = page
        .number("document.querySelector('#extraction').dataset.done")
        .await;
    page.click("#score-partial").await;
    page.until_scored().await;
    let frames = "document.querySelector('.card').dataset.frames";
    assert_eq!(page.number(frames).await, done);
    page.until_text(&format!(
        "The score is of {done} of {EXAMPLE_FRAMES} frames"
    ))
    .await;
    page.click("#extract").await;
    page.until(&format!("{frames} === '{EXAMPLE_FRAMES}'"))
        .await;
    page.until("document.querySelector('#extraction').hidden")
        .await;
    page.close().await;
}

/// A folder with a ground truth and keypoints of 40 frames.
fn tables() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for t in 0..40 {
        let (s, c) = (f64::from(t) * 0.37).sin_cos();
        truth += &format!("a,{t},cube,{},{}\n", 0.5 * s, 0.5 * c);
        truth += &format!("a,{t},eef,{},{}\n", 0.4 * s * c, 0.3 * s * s);
        keypoints += &format!(
            "a,{t},0,{},{}\na,{t},1,{},{}\n",
            0.3 * c + 0.1,
            -s,
            s * s * s,
            0.2 * c * s
        );
    }
    fs::write(folder.path().join("gt.csv"), truth).expect("written");
    fs::write(folder.path().join("kp.csv"), keypoints).expect("written");
    folder
}

async fn keypoints_take_the_place_of_frames_and_checkpoint(browser: Browser) {
    let page = Page::open_in(browser).await;
    let folder = tables();
    let [truth, keypoints] = ["gt.csv", "kp.csv"].map(|name| folder.path().join(name));
    page.pick(&[&keypoints, &truth]).await;
    page.until_scored().await;
    let expected = tracklens_json(&[
        "score",
        "--truth",
        &text(&truth),
        "--keypoints",
        &text(&keypoints),
    ]);
    shows(&page, &expected, 1e-12).await;
    page.close().await;
}

async fn bad_tables_and_checkpoints_are_told_and_replaced(browser: Browser) {
    let page = Page::open_in(browser).await;
    let folder = tables();
    let at = |name: &str| folder.path().join(name);
    let good = fs::read_to_string(at("gt.csv")).expect("a table");
    let duplicate = format!("{good}a,0,cube,0,0\n");
    for (name, content, expected) in [
        (
            "column.csv",
            good.replacen(",y\n", ",z\n", 1),
            "column `y` missing; expected `sequence,frame,object,x,y`",
        ),
        (
            "text.csv",
            good.replacen("cube,", "cube,abc", 1),
            "line 2, column `x`: `abc",
        ),
        ("twice.csv", duplicate, "is already in line 2"),
        (
            "empty.csv",
            "sequence,frame,object,x,y\n".to_owned(),
            "the table has a header and no rows",
        ),
    ] {
        fs::write(at(name), content).expect("written");
        page.pick(&[&at(name)]).await;
        page.until_text(&expected.replace('`', "")).await;
    }
    let weights = fs::read(example("checkpoint.safetensors")).expect("a checkpoint");
    fs::write(at("cut.safetensors"), &weights[..weights.len() / 2]).expect("written");
    page.pick(&[&at("cut.safetensors")]).await;
    page.until_text("not a complete .safetensors file").await;
    // CRLF, a byte order mark and semicolons are no problem.
    let windows = format!("\u{feff}{}", good.replace('\n', "\r\n").replace(',', ";"));
    fs::write(at("windows.csv"), windows).expect("written");
    page.pick(&[&at("windows.csv"), &at("kp.csv")]).await;
    page.until_scored().await;
    let [truth, keypoints] = ["gt.csv", "kp.csv"].map(|name| text(&at(name)));
    shows(
        &page,
        &tracklens_json(&["score", "--truth", &truth, "--keypoints", &keypoints]),
        1e-12,
    )
    .await;

    // A second ground truth is not taken silently.
    page.pick(&[&at("gt.csv")]).await;
    page.until("document.querySelector('#files [data-role=ground-truth][data-state=spare]')")
        .await;
    page.until("document.querySelector('#problems').textContent.includes('gt.csv')")
        .await;
    // And the page goes on.
    page.click("#try-example").await;
    page.until("document.querySelectorAll('.card').length === 3")
        .await;
    shows(&page, &evaluation_of_the_example(), ERRORS).await;
    page.close().await;
}

async fn own_files_take_the_place_of_the_example(browser: Browser) {
    let page = Page::open_in(browser).await;
    let folder = tables();
    let [truth, keypoints, notes] =
        ["gt.csv", "kp.csv", "notes.pdf"].map(|name| folder.path().join(name));
    fs::write(&notes, "no table").expect("written");
    page.click("#try-example").await;
    page.until_scored().await;
    // What is of no use replaces nothing.
    page.pick(&[&notes]).await;
    page.until("document.querySelector('#problems [data-problem=nothing]')")
        .await;
    assert_eq!(
        page.number("document.querySelectorAll('.card').length")
            .await,
        3.0
    );

    page.pick(&[&truth]).await;
    page.until("document.querySelector('#problems [data-problem=example]')")
        .await;
    assert_eq!(
        page.value(
            "[...document.querySelectorAll('#files > li')].map((item) => item.dataset.path)"
        )
        .await,
        serde_json::json!(["gt.csv"])
    );
    assert_eq!(
        page.value("document.querySelector('#results').hidden")
            .await,
        true
    );
    // The next files join the first ones.
    page.pick(&[&keypoints]).await;
    page.until_scored().await;
    let [own_truth, own_keypoints] = [&truth, &keypoints].map(|path| text(path));
    let expected = tracklens_json(&[
        "score",
        "--truth",
        &own_truth,
        "--keypoints",
        &own_keypoints,
    ]);
    shows(&page, &expected, 1e-12).await;
    assert_eq!(
        page.value("document.querySelector('#problems [data-problem=example]')")
            .await,
        Value::Null
    );

    // And back.
    page.click("#try-example").await;
    page.until("document.querySelectorAll('.card').length === 3")
        .await;
    page.pick(&[&truth]).await;
    page.click("#problems [data-problem=example] button.link")
        .await;
    page.until("document.querySelectorAll('.card').length === 3")
        .await;
    page.close().await;
}

async fn what_is_wrong_stands_over_the_results_and_goes_with_its_cause(browser: Browser) {
    let page = Page::open_in(browser).await;
    let folder = tables();
    let [truth, keypoints] = ["gt.csv", "kp.csv"].map(|name| folder.path().join(name));
    let good = fs::read_to_string(&truth).expect("a table");
    let problem = "document.querySelector('#problems [data-problem=\"broken gt.csv\"]')";
    let write_broken =
        || fs::write(&truth, good.replacen("cube,", "cube,abc", 1)).expect("written");

    write_broken();
    page.pick(&[&truth, &keypoints]).await;
    page.until(&format!("{problem}?.textContent.includes('line 2')"))
        .await;
    page.until("document.querySelector('#missing').textContent.includes('gt.csv cannot be used')")
        .await;
    page.value(&format!("{problem}.querySelector('button.link').click()"))
        .await;
    assert_eq!(
        page.value("document.activeElement.dataset.path").await,
        "gt.csv"
    );

    fs::write(&truth, &good).expect("written");
    page.pick(&[&truth]).await;
    page.until_scored().await;
    page.until(&format!("!{problem}")).await;
    page.until("document.querySelector('#status').textContent.startsWith('Tracking capability')")
        .await;

    // A score that is gone leaves nothing behind that says it is there.
    write_broken();
    page.pick(&[&truth]).await;
    page.until(&format!("{problem}?.getAttribute('role') === 'alert'"))
        .await;
    page.until(
        "document.querySelector('#results').hidden && document.querySelector('#results').dataset.tc === undefined && \
         !document.querySelector('#status').textContent.startsWith('Tracking capability')",
    )
    .await;
    page.value(&format!(
        "{problem}.querySelector('[aria-label=Dismiss]').click()"
    ))
    .await;
    page.until(&format!("!{problem}")).await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_frames_and_unmatched_ones_are_counted() {
    let page = Page::open().await;
    let folder = tempfile::tempdir().expect("a folder");
    let recording = folder.path().join("recording");
    let source = fs::read_dir(example("frames"))
        .expect("frames")
        .next()
        .expect("one")
        .expect("a folder")
        .path();
    let sequence = recording.join(source.file_name().expect("a name"));
    fs::create_dir_all(&sequence).expect("a folder");
    for frame in fs::read_dir(&source).expect("frames") {
        let frame = frame.expect("a frame").path();
        fs::copy(&frame, sequence.join(frame.file_name().expect("a name"))).expect("copied");
    }
    let broken = sequence.join("frame_003.png");
    let bytes = fs::read(&broken).expect("a frame");
    fs::write(&broken, &bytes[..bytes.len() / 2]).expect("written");
    fs::write(sequence.join("frame_099.png"), &bytes).expect("written");
    // The size stands in bytes 16 to 24, its checksum in bytes 29 to 33.
    for (name, side, checksum) in [
        ("frame_004.png", 1u32, [0x28, 0xcb, 0x34, 0xbb]),
        ("frame_005.png", 20_000, [0xd4, 0xae, 0xb6, 0x0b]),
    ] {
        let mut header = bytes.clone();
        header[16..20].copy_from_slice(&side.to_be_bytes());
        header[20..24].copy_from_slice(&side.to_be_bytes());
        header[29..33].copy_from_slice(&checksum);
        fs::write(sequence.join(name), header).expect("written");
    }
    fs::write(recording.join("notes.pdf"), "no image").expect("written");

    page.pick_folder(&recording).await;
    page.pick(&[
        &example("checkpoint.safetensors"),
        &example("ground_truth.csv"),
    ])
    .await;
    page.until_scored().await;
    // 24 frames and one too many; one is cut short, two are of impossible sizes, one has no row.
    assert_eq!(
        page.number("document.querySelector('#extraction').dataset.failed")
            .await,
        3.0
    );
    page.until_text("the image is 1 x 1 pixels; expected 16 to 8192 a side")
        .await;
    page.until_text("the image is 20000 x 20000 pixels").await;
    page.until_text("frame_003.png").await;
    page.until_text("cannot be decoded").await;
    assert_eq!(
        page.number("document.querySelector('.card').dataset.frames")
            .await,
        (EXAMPLE_LENGTH - 3) as f64
    );
    assert_eq!(
        page.number("document.querySelector('#join').dataset.unmatchedFrames")
            .await,
        1.0
    );
    assert!(
        page.number("document.querySelector('#join').dataset.unmatchedRows")
            .await
            >= 150.0
    );
    page.until_text("notes.pdf").await;

    // Nothing that can be used at all.
    let page_two = Page::open().await;
    fs::remove_dir_all(&sequence).expect("removed");
    page_two.pick_folder(&recording).await;
    page_two
        .until_text("not an image, a table, a checkpoint or a result")
        .await;
    // A copy beside its original: nobody knows which rows the frames after it belong to.
    let doubled = folder.path().join("doubled").join("seq_0002");
    fs::create_dir_all(&doubled).expect("a folder");
    for name in ["frame_001.png", "frame_001 (copy).png"] {
        fs::write(doubled.join(name), &bytes).expect("written");
    }
    page_two.pick_folder(&folder.path().join("doubled")).await;
    page_two
        .until_text("are both frame 1; expected one image a frame")
        .await;
    page_two.click("#problems button.link").await;
    page_two
        .until("!document.querySelector('#problems').textContent.includes('both frame')")
        .await;
    page_two.click("#try-example").await;
    page_two.until_scored().await;
    page_two.close().await;
    page.close().await;
}

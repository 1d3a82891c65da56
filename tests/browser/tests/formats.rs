//! Files of other programs on the page, against the `tracklens` command on the same files.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tracklens_page_tests::{Browser, Page, in_every_browser, text, tracklens_json};

in_every_browser! {
    tables_of_other_programs_are_scored_as_in_the_terminal
    frames_of_an_hdf5_file_are_read_by_slices
}

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
        page.click("#start-over").await;
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

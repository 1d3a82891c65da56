//! The questions about the data that come before a score, against the `tracklens` command on the
//! same files.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tracklens_page_tests::{Browser, Page, in_every_browser, tracklens_json};

in_every_browser! {
    a_unit_is_asked_about_before_a_number_is_shown
    counting_from_one_is_asked_about
    a_lag_and_turned_axes_are_asked_about_and_can_be_left
    what_is_found_is_what_the_terminal_finds
    rows_of_other_numbers_are_one_click_away
}

type Point = [f64; 2];

/// How the tables are written, and what is added to the frame numbers of the ground truth.
#[derive(Clone, Copy)]
struct Fault {
    truth: fn(Point) -> Point,
    keypoints: fn(Point) -> Point,
    first: u64,
    lag: usize,
}

const CLEAN: Fault = Fault {
    truth: |p| p,
    keypoints: |p| p,
    first: 0,
    lag: 0,
};

const TURNED: Fault = Fault {
    keypoints: |[x, y]| [y, -x],
    ..CLEAN
};

/// Fourteen sequences of an object that a keypoint follows, beside one that follows nothing.
fn write(folder: &Path, fault: Fault) -> [PathBuf; 2] {
    const FRAMES: usize = 20;
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for s in 0..14 {
        let at = |t: usize, a: f64, b: f64| {
            let i = t as f64 + 37.0 * s as f64;
            [(i * a).sin(), (i * b + 1.0).cos()].map(|v| 0.85 * v)
        };
        for t in 0..FRAMES {
            let [x, y] = (fault.truth)(at(t, 0.37, 0.71));
            let _ = writeln!(truth, "{s},{},cube,{x},{y}", t as u64 + fault.first);
            let Some(shown) = t.checked_sub(fault.lag) else {
                continue;
            };
            let near = at(shown, 0.37, 0.71).map(|v| 0.9 * v + 0.01 * (90.0 * v).sin());
            for (n, p) in [near, at(t, 0.11, 0.17)].into_iter().enumerate() {
                let [x, y] = (fault.keypoints)(p);
                let _ = writeln!(keypoints, "{s},{t},{n},{x},{y}");
            }
        }
    }
    [("gt.csv", truth), ("kp.csv", keypoints)].map(|(name, text)| {
        let path = folder.join(name);
        fs::write(&path, text).expect("written");
        path
    })
}

/// Drops tables with a fault on the page and waits for the question of this kind.
async fn asked(browser: Browser, fault: Fault, problem: &str) -> (Page, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a folder");
    let [truth, keypoints] = write(folder.path(), fault);
    let page = Page::open_in(browser).await;
    page.pick(&[&truth, &keypoints]).await;
    page.until(&format!(
        "document.querySelector('#doctor .question[data-problem={problem}]')"
    ))
    .await;
    let shown = page
        .value("document.querySelector('#results').dataset.tc ?? null")
        .await;
    assert_eq!(shown, Value::Null, "a number before the answer");
    (page, folder)
}

fn evaluation(folder: &Path, options: &[&str]) -> Value {
    let path = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let (truth, keypoints) = (path("gt.csv"), path("kp.csv"));
    let files = ["score", "--truth", &truth, "--keypoints", &keypoints];
    tracklens_json(&[&files[..], options].concat())
}

/// The error on the page is that of the command with these options, and the page gives the options
/// in its command.
async fn shows(page: &Page, folder: &Path, options: &[&str]) {
    page.until_scored().await;
    let expected = evaluation(folder, options);
    let error = expected["objects"][0]["error"].as_f64().expect("an error");
    // The same code; WebAssembly has no fused multiply and add, and rounds once more.
    page.until(&format!(
        "Math.abs(Number(document.querySelector('.card[data-object=cube]')?.dataset.error) - {error}) \
         <= 1e-12 * {error}"
    ))
    .await;
    let text = page
        .value("document.querySelector('#command').textContent")
        .await;
    let text = text.as_str().expect("text");
    assert!(text.contains(options.join(" ").as_str()), "{text}");
}

async fn click(page: &Page, problem: &str, answer: &str) {
    page.click(&format!(
        "#doctor .question[data-problem={problem}] button[data-remedy='{answer}']"
    ))
    .await;
}

async fn a_unit_is_asked_about_before_a_number_is_shown(browser: Browser) {
    let fault = Fault {
        truth: |p| p.map(|v| (v + 1.0) / 2.0),
        ..CLEAN
    };
    let (page, folder) = asked(browser, fault, "unit").await;
    click(&page, "unit", "").await;
    shows(&page, folder.path(), &["--space", "fraction"]).await;
    page.close().await;
}

async fn counting_from_one_is_asked_about(browser: Browser) {
    let fault = Fault { first: 1, ..CLEAN };
    let (page, folder) = asked(browser, fault, "counting").await;
    page.until_text("The rows run 1 to 20, the frames 0 to 19")
        .await;
    click(&page, "counting", "").await;
    shows(&page, folder.path(), &["--index-base", "1"]).await;
    page.close().await;
}

async fn a_lag_and_turned_axes_are_asked_about_and_can_be_left(browser: Browser) {
    let fault = Fault { lag: 2, ..CLEAN };
    let (page, folder) = asked(browser, fault, "lag").await;
    click(&page, "lag", "").await;
    shows(&page, folder.path(), &["--shift-frames", "2"]).await;
    page.close().await;

    let (page, folder) = asked(browser, TURNED, "axes").await;
    click(&page, "axes", "none").await;
    shows(&page, folder.path(), &[]).await;
    page.start_over().await;
    let [truth, keypoints] = ["gt.csv", "kp.csv"].map(|name| folder.path().join(name));
    page.pick(&[&truth, &keypoints]).await;
    click(&page, "axes", "").await;
    let options = ["--keypoints-axis-order", "yx", "--keypoints-flip", "x"];
    shows(&page, folder.path(), &options).await;
    page.close().await;
}

async fn what_is_found_is_what_the_terminal_finds(browser: Browser) {
    let (page, folder) = asked(browser, TURNED, "axes").await;
    let expected = evaluation(folder.path(), &[]);
    let findings = expected["findings"].as_array().expect("findings");
    let asked = page
        .value("[...document.querySelectorAll('#doctor .question')].map((q) => q.querySelector('p').textContent)")
        .await;
    let sentences: Vec<String> = findings
        .iter()
        .map(|finding| {
            let text = finding["text"].as_str().expect("text");
            format!("{}{}.", text[..1].to_uppercase(), &text[1..])
        })
        .collect();
    assert_eq!(asked, Value::from(sentences));
    page.close().await;
}

async fn rows_of_other_numbers_are_one_click_away(browser: Browser) {
    let folder = tempfile::tempdir().expect("a folder");
    let fault = Fault {
        first: 1000,
        ..CLEAN
    };
    let [truth, keypoints] = write(folder.path(), fault);
    let page = Page::open_in(browser).await;
    page.pick(&[&truth, &keypoints]).await;
    page.until_text("no frame has a row of ground truth").await;
    page.value(
        "[...document.querySelectorAll('button')].find((b) => b.textContent.includes('−1000')).click()",
    )
    .await;
    shows(&page, folder.path(), &["--shift-frames", "-1000"]).await;
    page.close().await;
}

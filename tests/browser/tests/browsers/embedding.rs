//! The examples of docs/embedding.md, and who a page in a frame talks with.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use thirtyfour::prelude::*;
use tracklens_page_tests::{
    Browser, Page, Server, eval_example, example, in_every_browser, parsed, site, tracklens_json,
};

in_every_browser! {
    a_page_in_a_frame_takes_files_and_gives_results
}

fn documents() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/embedding")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_of_somebody_else_scores_a_folder_with_the_package() {
    let documented = fs::read_to_string(documents().join("../embedding.md")).expect("the docs");
    let score = fs::read_to_string(documents().join("score.html")).expect("the example");
    let (_, body) = score.split_once("</title>\n").expect("a body");
    assert!(
        documented.contains(body.trim()),
        "docs/embedding.md shows another example"
    );

    let server = Server::start(documents(), &[("tracklens", site().join("pkg"))]).await;
    let page = Page::open_at(Browser::Chromium, server, "/score.html").await;
    page.until("document.querySelector('input').onchange").await;
    page.input("input", &example("").to_string_lossy()).await;
    page.until("document.querySelector('output').value").await;
    let shown = page.value("document.querySelector('output').value").await;
    let expected = parsed(&eval_example(&[]));
    let tc = expected["tc"].as_f64().expect("a number");
    assert!(
        shown
            .as_str()
            .is_some_and(|text| text.starts_with(&format!("TC {tc}; cube 0.00"))),
        "{shown}"
    );
    page.close().await;
}

async fn a_page_in_a_frame_takes_files_and_gives_results(browser: Browser) {
    // A site of somebody else, on an origin of its own.
    let folder = tempfile::tempdir().expect("a folder");
    fs::copy(
        documents().join("frame.html"),
        folder.path().join("frame.html"),
    )
    .expect("copied");
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for t in 0..40 {
        let (s, c) = (f64::from(t) * 0.37).sin_cos();
        writeln!(truth, "a,{t},cube,{},{}", 0.5 * s, 0.5 * c).expect("a string");
        writeln!(keypoints, "a,{t},0,{},{}", 0.45 * s, 0.5 * c + 0.2 * s * c).expect("a string");
    }
    let [gt, kp] = ["ground_truth.csv", "keypoints.csv"].map(|name| folder.path().join(name));
    fs::write(&gt, truth).expect("written");
    fs::write(&kp, keypoints).expect("written");
    let ours = Server::start(site(), &[]).await;
    let theirs = Server::start(folder.path().to_owned(), &[]).await;
    let path = format!("/frame.html?page={}/", ours.origin());
    let page = Page::open_at(browser, theirs, &path).await;

    page.until("document.querySelector('output').value").await;
    let [gt, kp] = [gt, kp].map(|file| file.to_string_lossy().into_owned());
    let expected = tracklens_json(&[
        "score",
        "--truth",
        &gt,
        "--keypoints",
        &kp,
        "--threshold",
        "cube=0.02",
    ]);
    let tc = expected["tc"].as_f64().expect("a number");
    assert_eq!(
        page.value("document.querySelector('output').value").await,
        format!("TC {tc}")
    );

    // What is not understood is said, in words.
    let frame = "document.querySelector('iframe')";
    let send = |frame: &str, message: Value| {
        format!(
            "{frame}.contentWindow.postMessage({message}, '{}')",
            ours.origin()
        )
    };
    page.value(&send(
        frame,
        json!({ "tracklens": 1, "type": "open", "files": [{ "path": 3 }] }),
    ))
    .await;
    page.until("document.querySelector('output').value.includes('files[0]: expected')")
        .await;

    // Options that cannot be scored are said, too, and put back by a click.
    let files: Vec<Value> = [("ground_truth.csv", &gt), ("keypoints.csv", &kp)]
        .map(|(path, file)| json!({ "path": path, "data": fs::read_to_string(file).expect("a table") }))
        .into();
    let open = json!({ "tracklens": 1, "type": "open", "files": files, "options": { "thresholds": { "cube": -1 } } });
    page.value(&send(frame, open)).await;
    page.until("document.querySelector('output').value.includes('expected a positive number')")
        .await;
    let inside = page.driver.find(By::Css("iframe")).await.expect("a frame");
    inside.enter_frame().await.expect("the frame");
    assert_eq!(
        page.value("document.querySelector('#results').dataset.tc ?? null")
            .await,
        Value::Null
    );
    page.click("#problems [data-problem=evaluation] button.link")
        .await;
    page.until_scored().await;
    page.until("!document.querySelector('#problems [data-problem=evaluation]')")
        .await;
    page.driver.enter_default_frame().await.expect("the page");
    page.value(&send(
        frame,
        json!({ "tracklens": 1, "type": "open", "files": [{ "path": "a.txt", "data": "none" }] }),
    ))
    .await;
    page.until("document.querySelector('output').value.includes('needed for a score')")
        .await;

    // A frame for somebody else neither listens nor talks.
    page.value(&format!(
        "(() => {{ window.__heard = []; const other = document.createElement('iframe'); other.id = 'other'; \
         addEventListener('message', ({{ source }}) => {{ if (source === other.contentWindow) window.__heard.push(1); }}); \
         other.src = '{}/?embed=https://somebody.example'; document.body.append(other); }})()",
        ours.origin()
    ))
    .await;
    let other = page.driver.find(By::Css("#other")).await.expect("a frame");
    other.clone().enter_frame().await.expect("the frame");
    page.until("document.querySelector('#try-example')?.disabled === false")
        .await;
    page.driver.enter_default_frame().await.expect("the page");

    // An origin that messages cannot be sent to leaves a page that works.
    page.value(&format!(
        "(() => {{ const odd = document.createElement('iframe'); odd.id = 'odd'; \
         odd.src = '{}/?embed=data:x'; document.body.append(odd); }})()",
        ours.origin()
    ))
    .await;
    let odd = page.driver.find(By::Css("#odd")).await.expect("a frame");
    odd.enter_frame().await.expect("the frame");
    page.until("document.querySelector('#try-example')?.disabled === false")
        .await;
    page.driver.enter_default_frame().await.expect("the page");
    let files = json!([{ "path": "ground_truth.csv", "data": "sequence,frame,object,x,y\na,0,cube,0,0\n" }]);
    let open = json!({ "tracklens": 1, "type": "open", "files": files });
    page.value(&send("document.querySelector('#other')", open))
        .await;

    // The one that does listen has an answer to a later message by the time the other would have
    // had one to its own.
    page.value(&send(frame, json!({ "tracklens": 1, "type": "nonsense" })))
        .await;
    page.until("document.querySelector('output').value.includes('nonsense')")
        .await;
    assert_eq!(page.value("window.__heard").await, json!([]));
    other.clone().enter_frame().await.expect("the frame");
    assert_eq!(
        page.value("document.querySelector('main').dataset.state")
            .await,
        "empty"
    );
    page.driver.enter_default_frame().await.expect("the page");

    // The frame itself: without masthead, and with a word on who gets the results.
    let own = page.driver.find(By::Css("iframe")).await.expect("a frame");
    own.enter_frame().await.expect("the frame");
    assert_eq!(
        page.value("getComputedStyle(document.querySelector('.masthead')).display")
            .await,
        "none"
    );
    page.until_text("which gets the results").await;
}

//! What the page makes of a score, in headless Chromium: figures that react, held-out folds and
//! intervals, files.

use std::fs;

use serde_json::Value;
use thirtyfour::{By, Key};
use tracklens_page_tests::{Page, eval_example, example, parsed, text, tracklens_json};

/// What the command makes of the example, as JSON.
fn expected(more: &[&str]) -> Value {
    parsed(&eval_example(more))
}

async fn scored() -> Page {
    let page = Page::open().await;
    page.click("#try-example").await;
    page.until_scored().await;
    page
}

/// From here on keeps the content of every file that the page saves, by its name.
async fn catch_files(page: &Page) {
    page.value(
        "(() => { globalThis.__files = {}; const blobs = new Map(); const make = URL.createObjectURL; \
         URL.createObjectURL = (blob) => { const url = make(blob); blobs.set(url, blob); return url; }; \
         HTMLAnchorElement.prototype.click = function () { const blob = blobs.get(this.href); const name = this.download; \
         blob.arrayBuffer().then((bytes) => { globalThis.__files[name] = { type: blob.type, size: bytes.byteLength, \
         head: new TextDecoder('latin1').decode(bytes.slice(0, 16)), text: new TextDecoder().decode(bytes) }; }); }; })()",
    )
    .await;
}

async fn saved(page: &Page, button: &str, name: &str) -> Value {
    page.click(button).await;
    let file = format!("globalThis.__files[{}]", Value::from(name));
    page.until(&file).await;
    page.value(&file).await
}

fn close(a: &Value, b: &Value, tolerance: f64, what: &str) {
    let [a, b] = [a, b].map(|v| v.as_f64().unwrap_or_else(|| panic!("{what}: {v}")));
    assert!((a - b).abs() <= tolerance * b.abs(), "{what}: {a} and {b}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cell_of_the_matrix_shows_its_keypoint_and_a_button_goes_back() {
    let page = scored().await;
    let result = expected(&[]);
    let errors = result["errors"][0].as_array().expect("errors");
    let cells = "document.querySelectorAll('#errors [role=gridcell]')";
    assert_eq!(
        page.number(&format!("{cells}.length")).await as usize,
        3 * errors.len()
    );
    let best = result["objects"][0]["best_keypoint"]
        .as_u64()
        .expect("a keypoint");
    let other = u64::from(best == 0);
    let cell = |n: u64| format!("#errors [data-object='0'][data-keypoint='{n}']");
    assert_eq!(
        page.value(&format!(
            "document.querySelector(\"{}\").getAttribute('aria-selected')",
            cell(best)
        ))
        .await,
        "true"
    );
    // The cells lie on their colours: the middle of one is in the plot of the drawing.
    let inside = format!(
        "(() => {{ const c = document.querySelector(\"{}\").getBoundingClientRect(); \
         const s = document.querySelector('#errors svg').getBoundingClientRect(); \
         return c.left > s.left && c.right <= s.right + 1 && c.top > s.top && c.bottom < s.bottom; }})()",
        cell(other)
    );
    assert_eq!(page.value(&inside).await, true);

    let element = page
        .driver
        .find(By::Css(cell(other)))
        .await
        .expect("a cell");
    element.scroll_into_view().await.expect("in view");
    element.click().await.expect("a click");
    page.until(&format!(
        "document.querySelector('#viewer .legend').textContent.includes('keypoint {other}')"
    ))
    .await;
    page.until(&format!(
        "document.querySelector(\"{}\").getAttribute('aria-selected') === 'true'",
        cell(other)
    ))
    .await;
    // The score stays that of the best keypoints.
    close(
        &page
            .value("document.querySelector('.card').dataset.error * 1")
            .await,
        &result["objects"][0]["error"],
        1e-6,
        "error",
    );
    page.click("#choose-best").await;
    page.until(&format!(
        "document.querySelector('#viewer .legend').textContent.includes('keypoint {best}')"
    ))
    .await;
    assert_eq!(
        page.value("document.querySelector('#choose-best').hidden")
            .await,
        true
    );

    // With keys: one cell is in the order of tabs, arrows move, enter chooses.
    let focusable = page
        .driver
        .find(By::Css("#errors [role=gridcell][tabindex='0']"))
        .await
        .expect("one cell");
    focusable.focus().await.expect("focus");
    focusable.send_keys("" + Key::Home).await.expect("a key");
    let active = page.driver.active_element().await.expect("a cell");
    active.send_keys("" + Key::Down).await.expect("a key");
    page.until(
        "document.activeElement.dataset.object === '1' && document.activeElement.dataset.keypoint === '0'",
    )
    .await;
    page.until("!document.querySelector('#errors .figure-tip').hidden")
        .await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_worst_sequences_and_frames_are_those_of_the_command_and_one_click_away() {
    let page = scored().await;
    let result = expected(&["--sequences"]);
    let worst = &result["sequences"][0]["errors"][0];
    page.until("document.querySelector('#worst-sequences button')")
        .await;
    assert_eq!(
        page.value("document.querySelector('#worst-sequences button').textContent")
            .await,
        worst["sequence"]
    );
    page.click("#worst-sequences button").await;
    page.until(&format!(
        "document.querySelector('#stage').dataset.picture?.includes('{}/frame_{:03}')",
        worst["sequence"].as_str().expect("a name"),
        worst["worst_frame"].as_u64().expect("a frame")
    ))
    .await;
    // Another object has others.
    page.value(
        "(() => { const s = document.querySelector('#sequences-object'); s.selectedIndex = 2; \
         s.dispatchEvent(new Event('change')); })()",
    )
    .await;
    let worst = &result["sequences"][2]["errors"][0]["sequence"];
    page.until(&format!(
        "document.querySelector('#worst-sequences button').textContent === {worst}"
    ))
    .await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn held_out_folds_and_intervals_equal_the_commands() {
    let page = scored().await;
    page.value(
        "(() => { const s = document.querySelector('#protocol'); s.value = '5'; s.dispatchEvent(new Event('change')); })()",
    )
    .await;
    page.click("#intervals").await;
    page.until("document.querySelector('#tc-interval').textContent.includes('–')")
        .await;
    let result = expected(&[
        "--folds",
        "5",
        "--bootstrap",
        "1000",
        "--sequences",
        "--context",
    ]);
    close(
        &page
            .value("document.querySelector('.card').dataset.heldOut * 1")
            .await,
        &result["held_out"]["objects"][0]["error"],
        1e-5,
        "held out",
    );
    close(
        &page
            .value("document.querySelector('.tc-value').dataset.tc * 1")
            .await,
        &result["held_out"]["tc"],
        0.0,
        "TC",
    );

    // The intervals are of the errors on the frames fitted on, and stand beside those alone.
    assert_eq!(
        page.value("document.querySelector('.card .error-interval').hidden")
            .await,
        true
    );
    let facts = page
        .value("[...document.querySelectorAll('.card dl div')].slice(0, 2).map((fact) => fact.textContent)")
        .await;
    assert!(
        facts[0]
            .as_str()
            .expect("text")
            .starts_with("Fitted on the same frames")
            && facts[1]
                .as_str()
                .expect("text")
                .starts_with("95 % interval there"),
        "{facts}"
    );
    let beside = page
        .value("document.querySelector('#tc-interval').textContent")
        .await;
    let fitted = result["tc"].as_f64().expect("a number");
    let beside = beside.as_str().expect("text");
    assert!(
        beside.starts_with(&format!(
            "Fitted on the same frames: {fitted:.2}, 95 % interval"
        )),
        "{beside}"
    );

    catch_files(&page).await;
    let file = saved(&page, "#save-evaluation", "evaluation.json").await;
    let ours: Value = serde_json::from_str(file["text"].as_str().expect("text")).expect("JSON");
    assert_eq!(ours["schema"], "tracklens/evaluation/3");
    // f32 keypoints differ in the last digits between native and WebAssembly kernels.
    for (ours, theirs) in [
        (&ours["intervals"]["tc"], &result["intervals"]["tc"]),
        (
            &ours["intervals"]["objects"][0]["error"],
            &result["intervals"]["objects"][0]["error"],
        ),
    ] {
        for end in 0..2 {
            close(&ours[end], &theirs[end], 1e-5, "interval");
        }
    }
    // The regression on 128 coordinates that are nearly collinear magnifies those digits, so that it
    // is compared on the page's own keypoints.
    let folder = tempfile::tempdir().expect("a folder");
    let keypoints = folder.path().join("kp.csv");
    fs::write(&keypoints, page.saved_keypoints().await).expect("written");
    let of_page = tracklens_json(&[
        "score",
        "--keypoints",
        &text(&keypoints),
        "--truth",
        &text(&example("ground_truth.csv")),
        "--context",
    ]);
    for row in 0..of_page["context"]["regression"]
        .as_array()
        .expect("rows")
        .len()
    {
        close(
            &ours["context"]["regression"][row]["error"],
            &of_page["context"]["regression"][row]["error"],
            1e-6,
            "regression on held-out frames",
        );
    }
    assert_eq!(
        ours["sequences"][1]["errors"][0]["sequence"],
        result["sequences"][1]["errors"][0]["sequence"]
    );
    assert_eq!(ours["join"], result["join"]);
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_can_be_taken_away() {
    let page = scored().await;
    catch_files(&page).await;
    let csv = saved(&page, "#save-table", "evaluation.csv").await;
    assert_eq!(csv["text"].as_str().expect("text").lines().count(), 4);
    for figure in ["errors", "capability", "sequences"] {
        let svg = saved(
            &page,
            &format!("#save-{figure}-svg"),
            &format!("{figure}.svg"),
        )
        .await;
        assert!(svg["head"].as_str().expect("text").starts_with("<svg"));
        let png = saved(
            &page,
            &format!("#save-{figure}-png"),
            &format!("{figure}.png"),
        )
        .await;
        assert!(png["head"].as_str().expect("text").contains("PNG"), "{png}");
        assert!(png["size"].as_u64().expect("bytes") > 5000);
    }

    // The command that is shown gives what is shown: it is run where the files are.
    page.value(
        "(() => { const field = document.querySelector('#threshold-cube'); field.value = '0.004'; \
         field.dispatchEvent(new Event('input', { bubbles: true })); })()",
    )
    .await;
    page.until("document.querySelector('#command').textContent.includes('cube=0.004')")
        .await;
    let command = page
        .value("document.querySelector('#command').textContent")
        .await;
    let words: Vec<String> = command
        .as_str()
        .expect("a command")
        .split(' ')
        .skip(1)
        .map(|word| word.trim_matches('\'').to_owned())
        .map(|word| {
            let file = word.strip_prefix("example/").unwrap_or(&word);
            let found = example(file);
            if found.exists() {
                text(&found)
            } else {
                word.clone()
            }
        })
        .collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let result = tracklens_json(&words);
    assert_eq!(result["objects"][0]["threshold"], 0.004);
    close(
        &page
            .value("document.querySelector('.card').dataset.error * 1")
            .await,
        &result["objects"][0]["error"],
        1e-6,
        "error",
    );

    // The report stands alone: opened from a file, it has its figures and asks for nothing.
    let report = saved(&page, "#save-report", "report.html").await;
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("report.html");
    fs::write(&file, report["text"].as_str().expect("text")).expect("written");
    let complaints = page.value("globalThis.__complaints").await;
    assert_eq!(complaints, serde_json::json!([]));
    page.driver
        .goto(format!("file://{}", file.display()))
        .await
        .expect("the report");
    assert_eq!(
        page.number("document.querySelectorAll('figure svg').length")
            .await,
        5.0
    );
    assert_eq!(
        page.number("performance.getEntriesByType('resource').length")
            .await,
        0.0
    );
    assert_eq!(
        page.value("document.documentElement.scrollWidth <= innerWidth")
            .await,
        true
    );
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn other_measures_are_there_when_they_are_looked_at() {
    let page = scored().await;
    assert_eq!(
        page.number("document.querySelectorAll('#context table').length")
            .await,
        0.0
    );
    page.value("document.querySelector('#context summary').click()")
        .await;
    page.until("document.querySelectorAll('#context table').length === 2")
        .await;
    let result = expected(&["--context"]);
    let shown = page
        .value("document.querySelector('#context tbody tr td:nth-child(4)').textContent")
        .await;
    let pck = 100.0
        * result["context"]["regression"][0]["pck"][0]
            .as_f64()
            .expect("a share");
    let shown: f64 = shown
        .as_str()
        .and_then(|text| text.trim_end_matches(" %").parse().ok())
        .expect("a share");
    assert!((shown - pck).abs() < 0.7, "{shown} {pck}");

    // The slider reads TC off at another factor.
    page.value(
        "(() => { const s = document.querySelector('#factor'); s.value = s.max; s.dispatchEvent(new Event('input')); })()",
    )
    .await;
    page.until("document.querySelector('.factor-readout').textContent.includes('TC 1.00')")
        .await;
    page.close().await;
}

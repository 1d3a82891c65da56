//! The pool of extraction workers in headless Chromium, which a script before the page gives four
//! cores and a hand on its workers.

use std::collections::HashMap;

use serde_json::{Value, json};
use tracklens_page_tests::{EXAMPLE_FRAMES, Page, example, extract_keypoints};

/// Single precision with other kernels, and fused multiply-add only natively.
const KEYPOINTS: f64 = 1e-4;

/// Four cores, and every worker in `__workers`, with the number of frames it was given and has not
/// answered. `__answers` counts the answers of all of them.
const WATCHED: &str = r#"
  Object.defineProperty(Navigator.prototype, "hardwareConcurrency", { get: () => 4, configurable: true });
  globalThis.__workers = [];
  globalThis.__answers = 0;
  globalThis.__deal = () => {};
  const Real = globalThis.Worker;
  globalThis.Worker = class extends Real {
    dealt = 0;
    constructor(url, options) {
      super(globalThis.__broken ? "missing.js" : url, options);
      globalThis.__workers.push(this);
      this.addEventListener("message", ({ data }) => {
        if (data.type !== "extracted" && data.type !== "failed") return;
        this.dealt--;
        globalThis.__answers++;
      });
    }
    postMessage(message, ...rest) {
      super.postMessage(message, ...rest);
      if (message.type !== "extract") return;
      this.dealt++;
      globalThis.__deal(this, message.source.path);
    }
  };
"#;

/// `__run(onReport)` extracts the example's frames with the page's own pool and returns what was
/// reported, in order.
const RUN: &str = r#"
  const { WorkerPool } = await import(new URL("extraction/pool.js", location.href));
  const { fetchExample } = await import(new URL("files/example.js", location.href));
  const { manifest, sources } = await fetchExample(() => {});
  const frames = sources.filter(({ path }) => path.endsWith(".png"));
  const encoder = await new WorkerPool().open(sources.find(({ path }) => path === manifest.checkpoint));
  globalThis.__frames = frames;
  globalThis.__encoder = encoder;
  globalThis.__run = async (onReport = () => {}, some = frames) => {
    const abort = new AbortController();
    const reports = [];
    const report = (path, extracted, message) => {
      reports.push({ path, points: extracted && [...extracted.points], message });
      onReport(reports.length, abort);
    };
    const result = { reports, error: null };
    try {
      await encoder.extract({
        frames: some,
        signal: abort.signal,
        onFrame: (path, extracted) => report(path, extracted),
        onFailure: (path, message) => report(path, null, message),
      });
    } catch (error) {
      result.error = String(error);
    }
    return result;
  };
"#;

/// The value of the body of an asynchronous function in the page.
async fn eventually(page: &Page, body: &str) -> Value {
    page.value(&format!(
        "void (async () => {{ {body} }})().then((value) => {{ globalThis.__value = {{ value }}; }}, \
         (error) => {{ globalThis.__value = {{ error: String(error) }}; }})"
    ))
    .await;
    page.until("globalThis.__value").await;
    let found = page
        .value("(() => { const found = globalThis.__value; delete globalThis.__value; return found; })()")
        .await;
    assert_eq!(found["error"], Value::Null, "{body}");
    found["value"].clone()
}

async fn pool() -> Page {
    let page = Page::open_with(WATCHED).await;
    eventually(&page, RUN).await;
    page
}

fn paths(reports: &Value) -> Vec<&str> {
    let reports = reports.as_array().expect("reports");
    reports
        .iter()
        .map(|report| report["path"].as_str().expect("a path"))
        .collect()
}

async fn frames(page: &Page) -> Value {
    page.value("__frames.map(({ path }) => ({ path }))").await
}

/// What the command extracts from the example's frames, by path.
fn expected() -> HashMap<String, Vec<f64>> {
    let folder = tempfile::tempdir().expect("a folder");
    let table = extract_keypoints(&example("frames"), &folder.path().join("kp.csv"));
    let mut points: HashMap<String, Vec<f64>> = HashMap::new();
    for line in table.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let frame: u32 = fields[1].parse().expect("a frame");
        let numbers = fields[3..]
            .iter()
            .map(|field| field.parse::<f64>().expect("a number"));
        points
            .entry(format!("frames/{}/frame_{frame:03}.png", fields[0]))
            .or_default()
            .extend(numbers);
    }
    points
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_are_dealt_to_workers_and_reported_in_order_with_the_keypoints_of_the_terminal() {
    let page = pool().await;
    let found = eventually(
        &page,
        "let most = 0; globalThis.__deal = (worker) => { most = Math.max(most, worker.dealt); }; \
         const result = await __run(); return { ...result, most, workers: __workers.length };",
    )
    .await;
    assert_eq!(found["error"], Value::Null);
    assert_eq!(paths(&found["reports"]), paths(&frames(&page).await));
    assert_eq!(found["workers"], json!(4));
    // One computed, one read.
    assert_eq!(found["most"], json!(2));
    let expected = expected();
    let mut largest: f64 = 0.0;
    for report in found["reports"].as_array().expect("reports") {
        let path = report["path"].as_str().expect("a path");
        let ours = report["points"]
            .as_array()
            .unwrap_or_else(|| panic!("{path}: {report}"));
        let theirs = &expected[path];
        assert_eq!(ours.len(), theirs.len());
        for (z, x) in ours.iter().zip(theirs) {
            largest = largest.max((z.as_f64().expect("a number") - x).abs());
        }
    }
    println!("keypoints: largest difference {largest:.1e}");
    assert!(largest <= KEYPOINTS, "{largest:e}");

    // Another run of the same encoder finds its workers warm.
    let again = eventually(
        &page,
        "const result = await __run(); return { ...result, workers: __workers.length };",
    )
    .await;
    assert_eq!(again["workers"], json!(4));
    assert_eq!(again["reports"], found["reports"]);
    // Given back, nothing of it is left.
    let held = "(await navigator.locks.query()).held.length";
    eventually(
        &page,
        &format!("__encoder.free(); while ({held} > 0) await new Promise((next) => setTimeout(next, 10));"),
    )
    .await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancelled_run_ends_at_once_reports_nothing_more_and_can_be_gone_on_with() {
    let page = pool().await;
    let found = eventually(
        &page,
        "let before = 0; \
         const result = await __run((count, abort) => { \
           if (count === 20) { before = __answers; abort.abort(new Error('enough')); } }); \
         const awaited = __answers - before; \
         const { length } = result.reports; \
         await new Promise((next) => setTimeout(next, 500)); \
         const rest = await __run(undefined, __frames.slice(length)); \
         return { awaited, length, after: result.reports.length, error: result.error, rest };",
    )
    .await;
    assert_eq!(found["error"], json!("Error: enough"));
    assert_eq!(
        [&found["length"], &found["after"]],
        [&json!(20), &json!(20)]
    );
    // It does not wait for what the workers are at.
    assert_eq!(found["awaited"], json!(0));
    assert_eq!(found["rest"]["error"], Value::Null);
    assert_eq!(
        paths(&found["rest"]["reports"]),
        paths(&frames(&page).await)[20..]
    );
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_frames_of_a_worker_that_ends_without_a_word_go_to_others() {
    let page = pool().await;
    let found = eventually(
        &page,
        "let killed = 0; \
         const result = await __run((count) => { \
           const busy = __workers.find((worker) => worker.dealt > 0); \
           if (count % 40 === 10 && busy) { killed++; busy.dealt = 0; busy.terminate(); } }); \
         return { ...result, killed };",
    )
    .await;
    assert!(found["killed"].as_u64().expect("a count") >= 2, "{found}");
    assert_eq!(found["error"], Value::Null);
    assert_eq!(paths(&found["reports"]), paths(&frames(&page).await));
    let failed = found["reports"].as_array().expect("reports");
    assert!(failed.iter().all(|report| report["points"].is_array()));
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frame_that_brings_workers_down_is_reported_and_the_others_are_extracted() {
    let page = pool().await;
    let bad = paths(&frames(&page).await)[7].to_owned();
    let found = eventually(
        &page,
        &format!(
            "globalThis.__deal = (worker, path) => {{ if (path === '{bad}') worker.terminate(); }}; return __run();"
        ),
    )
    .await;
    assert_eq!(found["error"], Value::Null);
    assert_eq!(paths(&found["reports"]), paths(&frames(&page).await));
    for report in found["reports"].as_array().expect("reports") {
        if report["path"] == *bad {
            let message = report["message"].as_str().expect("a message");
            assert!(message.contains("the worker broke down"), "{message}");
        } else {
            assert!(report["points"].is_array(), "{report}");
        }
    }
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_memory_for_more_there_is_one_worker() {
    let page = Page::open_with(&format!(
        "{WATCHED} Object.defineProperty(Navigator.prototype, 'deviceMemory', {{ get: () => 2 ** -6 }});"
    ))
    .await;
    eventually(&page, RUN).await;
    let found = eventually(
        &page,
        "return { ...(await __run()), workers: __workers.length };",
    )
    .await;
    assert_eq!(found["workers"], json!(1));
    assert_eq!(paths(&found["reports"]), paths(&frames(&page).await));
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn with_no_worker_left_the_page_says_so_keeps_what_is_done_and_goes_on_when_there_are_some() {
    let page = Page::open_with(WATCHED).await;
    // While none is starting: one that ends then is given up after a minute, with another reason.
    page.value(
        "void (globalThis.__kill = new MutationObserver(() => { \
           if (!(Number(document.querySelector('#extraction').dataset.done) >= 10)) return; \
           if (__workers.some((worker) => worker.dealt === 0)) return; \
           globalThis.__kill.disconnect(); globalThis.__broken = true; \
           for (const worker of __workers) worker.terminate(); })) \
         .observe(document.querySelector('#extraction'), { attributes: true })",
    )
    .await;
    page.click("#try-example").await;
    page.until("document.querySelector('#extraction').dataset.status === 'failed'")
        .await;
    page.until_text("no worker of the extraction is left").await;
    page.until_text("its script could not be loaded").await;
    let done = page
        .number("document.querySelector('#extraction').dataset.done")
        .await;
    assert!((10.0..EXAMPLE_FRAMES as f64).contains(&done), "{done}");
    page.value("void (globalThis.__broken = false)").await;
    page.click("#extract").await;
    page.until_scored().await;
    assert_eq!(
        page.number("document.querySelector('.card').dataset.frames")
            .await,
        EXAMPLE_FRAMES as f64
    );

    // None from the start: the checkpoint cannot be opened, the rest of the page works.
    page.value("void (globalThis.__broken = true)").await;
    page.start_over().await;
    page.pick(&[
        &example("checkpoint.safetensors"),
        &example("ground_truth.csv"),
    ])
    .await;
    page.until_text("checkpoint.safetensors could not be opened: the worker broke down")
        .await;
    page.until("document.querySelector('#files [data-role=ground-truth][data-state=used]')")
        .await;
    // The browser complains of the missing script itself.
    page.driver.clone().quit().await.expect("the browser ends");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_hidden_page_goes_on_and_a_page_that_is_left_leaves_nothing_behind() {
    let page = Page::open_with(WATCHED).await;
    page.click("#try-example").await;
    let cdp = page.driver.cdp();
    let window = cdp
        .send_raw("Browser.getWindowForTarget", json!({}))
        .await
        .expect("a window");
    let state =
        |state: &str| json!({ "windowId": window["windowId"], "bounds": { "windowState": state } });
    cdp.send_raw("Browser.setWindowBounds", state("minimized"))
        .await
        .expect("hidden");
    page.until("document.visibilityState === 'hidden'").await;
    page.until_scored().await;
    cdp.send_raw("Browser.setWindowBounds", state("normal"))
        .await
        .expect("shown");

    eventually(&page, RUN).await;
    page.value("void __run()").await;
    page.until("__workers.some((worker) => worker.dealt > 0)")
        .await;
    page.driver.refresh().await.expect("the page once more");
    page.until("globalThis.__workers && !document.querySelector('#try-example').disabled")
        .await;
    eventually(
        &page,
        "while ((await navigator.locks.query()).held.length > 0) await new Promise((next) => setTimeout(next, 10));",
    )
    .await;
    assert_eq!(page.value("__workers.length").await, json!(0));
    page.close().await;
}

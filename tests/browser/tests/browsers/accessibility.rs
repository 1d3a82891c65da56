//! Everyone can use the page: axe-core finds no barrier, it fits a phone, text can be enlarged.

use std::fs;
use std::path::{Path, PathBuf};

use crate::runs;
use serde_json::{Value, json};
use tracklens_page_tests::{Browser, Page, eval_example, example, in_every_browser, pack};

in_every_browser! {
    no_state_of_the_page_has_a_barrier
}

/// What axe-core calls serious or critical, each with the elements concerned.
async fn barriers(page: &Page) -> Vec<String> {
    let axe = std::env::var_os("TRACKLENS_AXE").map(PathBuf::from);
    let axe = axe.expect("TRACKLENS_AXE is the path of axe.min.js; `cargo xtask test` sets it");
    let axe = fs::read_to_string(axe).expect("axe");
    page.driver
        .execute(axe, vec![])
        .await
        .expect("axe is there");
    let run = "const done = arguments[arguments.length - 1]; \
               axe.run(document, { resultTypes: ['violations'] }).then((r) => done(r.violations), (e) => done(String(e)));";
    let found = page
        .driver
        .execute_async(run, vec![])
        .await
        .expect("axe runs");
    let violations = found
        .json()
        .as_array()
        .cloned()
        .unwrap_or_else(|| panic!("{:?}", found.json()));
    violations
        .iter()
        .filter(|violation| {
            ["serious", "critical"].contains(&violation["impact"].as_str().unwrap_or_default())
        })
        .map(|violation| {
            let nodes = violation["nodes"].as_array().into_iter().flatten();
            let places: Vec<String> = nodes
                .map(|node| {
                    format!(
                        "{} ({})",
                        node["target"],
                        node["failureSummary"].as_str().unwrap_or_default()
                    )
                })
                .collect();
            format!(
                "{}: {}: {}",
                violation["id"],
                violation["help"],
                places.join("; ")
            )
        })
        .collect()
}

async fn has_no_barrier(page: &Page, state: &str) {
    let found = barriers(page).await;
    assert!(found.is_empty(), "{state}:\n{}", found.join("\n"));
}

/// Writes an evaluation of the example with everything there is.
fn save(file: &Path) {
    let printed = eval_example(&[
        "--sequences",
        "--context",
        "--folds",
        "4",
        "--bootstrap",
        "50",
    ]);
    fs::write(file, printed).expect("written");
}

/// The tabs that are there; one without a name where there are none.
async fn tabs(page: &Page) -> Vec<String> {
    let found = page
        .value(
            "(([...tabs]) => tabs.length > 0 ? tabs : [''])([...document.querySelectorAll('#tabs [role=tab]')] \
             .filter((tab) => tab.checkVisibility()).map((tab) => tab.id))",
        )
        .await;
    let tabs = found.as_array().expect("tabs").iter();
    tabs.map(|tab| tab.as_str().expect("a name").to_owned())
        .collect()
}

/// Opens a tab and all details.
fn open(tab: &str) -> String {
    format!(
        "(document.getElementById('{tab}')?.click(), \
         document.querySelectorAll('details').forEach((d) => {{ d.open = true; }}))"
    )
}

async fn in_scheme(page: &Page, scheme: &str) {
    // Without motion, or axe sees colours on their way from one scheme to the other.
    let features = json!({ "features": [
        { "name": "prefers-color-scheme", "value": scheme },
        { "name": "prefers-reduced-motion", "value": "reduce" },
    ] });
    page.cdp("Emulation.setEmulatedMedia", features).await;
}

async fn no_state_of_the_page_has_a_barrier(browser: Browser) {
    let page = Page::open_in(browser).await;
    // Firefox has no command for the scheme; the style sheet is the same one.
    let schemes: &[&str] = match browser {
        Browser::Chromium => &["light", "dark"],
        Browser::Firefox => &["light"],
    };
    let check = async |state: &str| {
        for scheme in schemes {
            if browser == Browser::Chromium {
                in_scheme(&page, scheme).await;
            }
            for tab in tabs(&page).await {
                page.value(&open(&tab)).await;
                has_no_barrier(&page, &format!("{state}, {tab}, {scheme}")).await;
            }
        }
    };
    page.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        .await;
    check("empty").await;
    page.click("#try-example").await;
    page.until_scored().await;
    page.until("document.querySelector('#stage').dataset.picture?.endsWith('.png')")
        .await;
    page.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        .await;
    check("results").await;

    page.start_over().await;
    let folder = tempfile::tempdir().expect("a folder");
    let broken = folder.path().join("gt.csv");
    fs::write(&broken, "sequence,frame,object,x,z\na,0,cube,0,0\n").expect("written");
    let unknown = folder.path().join("notes.pdf");
    fs::write(&unknown, "no table").expect("written");
    page.pick(&[&broken, &unknown, &example("checkpoint.safetensors")])
        .await;
    page.until_text("column y missing").await;
    check("errors").await;

    page.start_over().await;
    let frames = folder.path().join("frames.zip");
    pack(&example(""), &["frames"], &frames);
    page.pick(&[&frames]).await;
    page.click("#missing .mark-objects").await;
    page.until("document.querySelector('#marking-stage').dataset.picture")
        .await;
    page.click("#marking-add").await;
    page.click("#marking-hidden").await;
    check("marking").await;

    page.start_over().await;
    page.pick(&[&example("checkpoint.safetensors")]).await;
    page.click("#missing .open-live").await;
    page.until("!document.querySelector('#live').hidden").await;
    check("live, before a camera is chosen").await;
    page.click("#live-camera").await;
    // Chromium finds no camera here, Firefox one that is not real.
    page.until(
        "document.querySelector('#live [role=alert]') || document.querySelector('#live-stage').dataset.frames",
    )
    .await;
    check("live").await;

    page.start_over().await;
    let saved = ["ours.json", "theirs.json"].map(|name| folder.path().join(name));
    saved.iter().for_each(|file| save(file));
    page.pick(&[&saved[0], &saved[1]]).await;
    page.until_scored().await;
    page.until("document.querySelector('#comparison').dataset.complete === '2'")
        .await;
    page.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        .await;
    check("saved evaluations").await;

    page.start_over().await;
    // Firefox's driver takes no folders.
    let archive = folder.path().join("runs.zip");
    runs::sweep(&folder.path().join("runs"));
    pack(folder.path(), &["runs"], &archive);
    page.pick(&[&archive]).await;
    page.until("document.querySelector('#comparison').dataset.complete === '10'")
        .await;
    check("runs").await;
    page.close().await;
}

/// Widths of a small phone, and of a window at which all text is twice as large.
#[tokio::test(flavor = "multi_thread")]
async fn nothing_has_to_be_scrolled_sideways_on_a_phone_or_with_large_text() {
    let page = Page::open().await;
    let overflow = "document.documentElement.scrollWidth - document.documentElement.clientWidth";
    let wide = "[...document.querySelectorAll('body *')].filter((e) => e.getBoundingClientRect().right > \
                document.documentElement.clientWidth + 1 && !e.closest('pre, .tabs, .sequence-list, .visually-hidden, svg, .failures ul'))\
                .map((e) => e.tagName + '.' + e.className).slice(0, 5)";
    let fits = async |state: &str| {
        for tab in tabs(&page).await {
            page.value(&open(&tab)).await;
            let by = page.number(overflow).await;
            let elements = page.value(wide).await;
            assert!(by <= 0.0, "{state}, {tab}: {by} px too wide: {elements}");
        }
    };
    let phone = json!({ "width": 320, "height": 640, "deviceScaleFactor": 2, "mobile": true });
    page.cdp("Emulation.setDeviceMetricsOverride", phone).await;
    page.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        .await;
    fits("empty on a phone").await;
    let kept = tempfile::tempdir().expect("a folder");
    let saved = kept.path().join("evaluation.json");
    save(&saved);
    page.pick(&[&saved]).await;
    page.until_scored().await;
    page.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        .await;
    fits("a saved evaluation on a phone").await;
    page.start_over().await;
    page.click("#try-example").await;
    page.until_scored().await;
    page.until("document.querySelector('#stage').dataset.picture?.endsWith('.png')")
        .await;
    page.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        .await;
    fits("results on a phone").await;
    let folder = tempfile::tempdir().expect("a folder");
    runs::sweep(folder.path());
    page.pick_folder(folder.path()).await;
    page.until("document.querySelector('#comparison').dataset.complete === '10'")
        .await;
    fits("runs on a phone").await;
    page.start_over().await;
    page.pick_folder(&example("frames")).await;
    page.click("#missing .mark-objects").await;
    page.until("document.querySelector('#marking-stage').dataset.picture")
        .await;
    fits("marking on a phone").await;
    page.start_over().await;
    page.pick(&[&example("checkpoint.safetensors")]).await;
    page.click("#missing .open-live").await;
    page.until("!document.querySelector('#live').hidden").await;
    fits("live on a phone").await;
    let window = json!({ "width": 1280, "height": 900, "deviceScaleFactor": 1, "mobile": false });
    page.cdp("Emulation.setDeviceMetricsOverride", window).await;
    page.value("document.documentElement.style.fontSize = '200%'")
        .await;
    fits("text of twice the size").await;
    let window = json!({ "width": 640, "height": 900, "deviceScaleFactor": 1, "mobile": false });
    page.cdp("Emulation.setDeviceMetricsOverride", window).await;
    fits("text of twice the size in half a window").await;
    page.close().await;
}

/// What is wider than a phone says so, and is scrolled by keys.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_wider_than_a_phone_shows_that_it_goes_on() {
    let page = Page::open().await;
    let phone = json!({ "width": 320, "height": 640, "deviceScaleFactor": 1, "mobile": true });
    page.cdp("Emulation.setDeviceMetricsOverride", phone).await;
    page.click("#try-example").await;
    page.until_scored().await;
    page.reveal("#errors").await;
    let matrix = "document.querySelector('#errors .scroll-region')";
    page.until(&format!(
        "{matrix}.dataset.more === 'end' && {matrix}.tabIndex === 0"
    ))
    .await;
    assert_ne!(
        page.value(&format!("getComputedStyle({matrix}).maskImage"))
            .await,
        "none"
    );
    page.value(&format!("{matrix}.focus()")).await;
    let element = page.driver.active_element().await.expect("the matrix");
    element
        .send_keys("" + thirtyfour::Key::Right)
        .await
        .expect("a key");
    page.until(&format!(
        "{matrix}.scrollLeft > 0 && {matrix}.dataset.more !== 'end'"
    ))
    .await;
    let window = json!({ "width": 1280, "height": 900, "deviceScaleFactor": 1, "mobile": false });
    page.cdp("Emulation.setDeviceMetricsOverride", window).await;
    page.until(&format!(
        "{matrix}.dataset.more === 'none' && !{matrix}.hasAttribute('tabindex')"
    ))
    .await;

    // The saved report has no scripts: its tables scroll by themselves, and nothing is cut.
    let folder = tempfile::tempdir().expect("a folder");
    let report = folder.path().join("report.html");
    let shown = [
        "--sequences",
        "--context",
        "--folds",
        "4",
        "--bootstrap",
        "50",
        "--report",
    ];
    eval_example(&[&shown[..], &[&report.to_string_lossy()]].concat());
    page.cdp(
        "Emulation.setDeviceMetricsOverride",
        json!({ "width": 320, "height": 640, "deviceScaleFactor": 1, "mobile": true }),
    )
    .await;
    page.driver
        .goto(format!("file://{}", report.display()))
        .await
        .expect("the report");
    let cut = "[...document.querySelectorAll('table, svg')].filter((e) => { const place = e.closest('.table, .plate'); \
               return !place || (place.scrollWidth > place.clientWidth && (getComputedStyle(place).overflowX !== 'auto' || \
               place.tabIndex !== 0)); }).length";
    assert_eq!(page.number(cut).await, 0.0);
    assert!(
        page.number(
            "[...document.querySelectorAll('.table')].filter((e) => e.scrollWidth > e.clientWidth).length"
        )
        .await
            > 0.0
    );
    assert_eq!(
        page.value("document.documentElement.scrollWidth <= innerWidth")
            .await,
        true
    );
    page.close().await;
}

/// Nothing moves for those who asked for that.
#[tokio::test(flavor = "multi_thread")]
async fn reduced_motion_is_respected() {
    let page = Page::open().await;
    let features = json!({ "features": [{ "name": "prefers-reduced-motion", "value": "reduce" }] });
    page.cdp("Emulation.setEmulatedMedia", features).await;
    let moving = "[...document.querySelectorAll('*')].filter((e) => { const s = getComputedStyle(e); \
                  return parseFloat(s.transitionDuration) > 0 && s.transitionProperty !== 'none' || s.animationName !== 'none'; }).length";
    assert_eq!(page.value(moving).await, Value::from(0));
    page.close().await;
}

//! The viewer: frames, plots and sequences follow each other, by pointer and by keyboard.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;

use serde_json::Value;
use thirtyfour::prelude::*;
use tracklens_page_tests::{Browser, EXAMPLE_LENGTH, Page, in_every_browser};

in_every_browser! {
    the_example_plays_where_most_moves_until_somebody_steps
    keys_move_through_frames_and_sequences
    moving_decodes_ahead_and_changes_nothing_but_the_frame
    plots_seek_and_follow
    the_image_zooms_and_pans
    another_keypoint_can_be_looked_at
    the_heat_map_of_a_keypoint_lies_over_the_frame
    what_is_shown_is_remembered
}

/// The example, scored, with the first picture on display.
async fn example(browser: Browser) -> Page {
    let page = Page::open_in(browser).await;
    page.click("#try-example").await;
    page.until_scored().await;
    page.until("document.querySelector('#stage').dataset.picture?.endsWith('.png')")
        .await;
    page.hold().await;
    page
}

async fn until_frame(page: &Page, frame: usize) {
    page.until(&format!(
        "document.querySelector('#stage').dataset.frame === '{frame}'"
    ))
    .await;
}

async fn press(page: &Page, selector: &str, keys: impl Into<TypingData>) {
    let element = page
        .driver
        .find(By::Css(selector))
        .await
        .expect("an element");
    element.focus().await.expect("focus");
    element.send_keys(keys).await.expect("keys");
}

async fn the_example_plays_where_most_moves_until_somebody_steps(browser: Browser) {
    let page = Page::open_moving(browser).await;
    page.value(
        "(() => { const stage = () => document.querySelector('#stage')?.dataset.frame; let first; \
         document.querySelector('#try-example').addEventListener('click', () => { \
         const start = performance.now(); const look = () => { first ??= stage(); \
         if (first !== undefined && stage() !== first) document.body.dataset.moving = performance.now() - start; \
         else window.requestAnimationFrame(look); }; look(); }); })()",
    )
    .await;
    page.click("#try-example").await;
    page.until("document.body.dataset.moving").await;
    println!(
        "{browser:?}: {:.0} ms from the click to a moving frame",
        page.number("document.body.dataset.moving").await
    );
    page.until_scored().await;
    // The paths of all objects together are the longest here.
    let table = fs::read_to_string(tracklens_page_tests::example("ground_truth.csv"));
    let shown = "document.querySelector('.sequence[aria-selected=true]').dataset.name";
    assert_eq!(page.value(shown).await, liveliest(&table.expect("a table")));
    let label = "document.querySelector('#play').getAttribute('aria-label')";
    assert_eq!(page.value(label).await, "Pause");
    press(&page, "#stage", Key::Left + "").await;
    page.until(&format!("{label} === 'Play'")).await;
    // Another sequence is played on; a frame that is asked for stays.
    press(&page, "#stage", " ").await;
    press(&page, "#stage", Key::PageUp + "").await;
    assert_eq!(page.value(label).await, "Pause");
    page.click("#worst-frames button").await;
    page.until(&format!("{label} === 'Play'")).await;
    page.close().await;
}

/// The sequence of a tidy table in which the objects cover the longest paths.
fn liveliest(table: &str) -> String {
    let mut last: HashMap<(String, String), [f64; 2]> = HashMap::new();
    let mut paths: HashMap<String, f64> = HashMap::new();
    for line in table.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let [x, y] = [fields[3], fields[4]].map(str::parse);
        let (Ok(x), Ok(y)) = (x, y) else { continue };
        let key = (fields[0].to_owned(), fields[2].to_owned());
        if let Some([a, b]) = last.insert(key, [x, y]) {
            *paths.entry(fields[0].to_owned()).or_default() += f64::hypot(x - a, y - b);
        }
    }
    let longest = paths.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let (name, _) = longest.expect("a sequence");
    // The table may have the number alone.
    match name.parse::<usize>() {
        Ok(number) => format!("seq_{number:04}"),
        Err(_) => name,
    }
}

async fn keys_move_through_frames_and_sequences(browser: Browser) {
    let page = example(browser).await;
    let last = EXAMPLE_LENGTH - 1;
    press(&page, "#stage", Key::Right + "").await;
    until_frame(&page, 1).await;
    press(&page, "#stage", Key::End + "").await;
    until_frame(&page, last).await;
    press(&page, "#stage", Key::Left + "").await;
    until_frame(&page, last - 1).await;
    press(&page, "#stage", Key::Shift + Key::Left).await;
    until_frame(&page, last - 11).await;
    press(&page, "#stage", Key::Shift + Key::Left).await;
    until_frame(&page, last - 21).await;
    press(&page, "#stage", Key::Shift + Key::Left).await;
    until_frame(&page, 0).await;
    press(&page, "#scrubber", Key::Shift + Key::Right).await;
    until_frame(&page, 10).await;
    press(&page, "#stage", Key::Home + "").await;
    until_frame(&page, 0).await;
    press(&page, "#stage", Key::PageDown + "").await;
    until_frame(&page, EXAMPLE_LENGTH).await;
    press(&page, "#stage", Key::PageUp + "").await;
    until_frame(&page, 0).await;

    // It plays at the speed asked for, around and around, until it is stopped.
    page.value(
        "(() => { const speed = document.querySelector('#speed'); speed.value = '60'; \
         speed.dispatchEvent(new Event('input')); })()",
    )
    .await;
    press(&page, "#stage", " ").await;
    page.until("document.querySelector('#play').getAttribute('aria-label') === 'Pause'")
        .await;
    page.until("Number(document.querySelector('#stage').dataset.frame) > 5")
        .await;
    page.until("Number(document.querySelector('#stage').dataset.frame) < 5")
        .await;
    press(&page, "#stage", " ").await;
    page.until("document.querySelector('#play').getAttribute('aria-label') === 'Play'")
        .await;
    page.close().await;
}

/// How many changes of the results an event makes, as an expression.
///
/// The results are updated at once, so what changes while the event is handled is its work; figures
/// that are drawn again for another width of the page come later.
fn changes_by(selector: &str, event: &str) -> String {
    format!(
        "(() => {{ const seen = new MutationObserver(() => {{}}); \
         seen.observe(document.querySelector('#results'), {{ attributes: true, childList: true, \
         characterData: true, subtree: true }}); \
         document.querySelector('{selector}').dispatchEvent({event}); \
         const changes = seen.takeRecords().length; seen.disconnect(); return changes; }})()"
    )
}

async fn moving_decodes_ahead_and_changes_nothing_but_the_frame(browser: Browser) {
    let page = example(browser).await;
    page.reveal("#sequences").await;
    page.until("document.querySelector('#sequences svg')").await;
    page.value(
        "(() => { const counts = document.body.dataset; counts.decoded = 0; \
         const decode = createImageBitmap; \
         globalThis.createImageBitmap = (...given) => { counts.decoded++; return decode(...given); }; })()",
    )
    .await;
    let changed = page
        .number(&format!(
            "(document.querySelector('#scrubber').value = '2', {})",
            changes_by("#scrubber", "new Event('input', { bubbles: true })")
        ))
        .await;
    assert_eq!(changed, 0.0);
    until_frame(&page, 2).await;
    // The frame, and those at steps of two after it: 4, 6, 8, 10. Firefox keeps what its driver changes
    // from the page.
    if browser == Browser::Chromium {
        page.until("document.body.dataset.decoded === '5'").await;
    }
    let changed = page
        .number(&changes_by(
            "#stage",
            "new KeyboardEvent('keydown', { key: 'PageDown', bubbles: true })",
        ))
        .await;
    assert!(changed > 0.0);
    until_frame(&page, EXAMPLE_LENGTH).await;
    page.close().await;
}

async fn plots_seek_and_follow(browser: Browser) {
    let page = example(browser).await;
    let error = "document.querySelector('canvas[data-quantity=error]')";
    page.until(&format!("{error}.dataset.points === '{EXAMPLE_LENGTH}'"))
        .await;
    let before = page.number(&format!("{error}.dataset.cursor")).await;
    let plot = page
        .driver
        .find(By::Css("canvas[data-quantity=error]"))
        .await
        .expect("a plot");
    plot.scroll_into_view().await.expect("in view");
    page.driver
        .action_chain()
        .move_to_element_center(&plot)
        .click()
        .perform()
        .await
        .expect("a click");
    page.until("['11', '12'].includes(document.querySelector('#stage').dataset.frame)")
        .await;
    assert!(page.number(&format!("{error}.dataset.cursor")).await > before + 50.0);
    // What is under the pointer stands in the tooltip, what is on display beside the title.
    let tooltip = "document.querySelector('.plot-tooltip:not([hidden])').textContent";
    page.until(&format!("/frame 1[12].*error [0-9.e−-]+/.test({tooltip})"))
        .await;
    page.until("/truth −?[0-9.]+/.test(document.querySelector('.plot-readout').textContent)")
        .await;

    // A figure is saved as drawn for print.
    page.value(
        "(() => { window.__saved = {}; const make = URL.createObjectURL; URL.createObjectURL = (blob) => { \
         window.__saved[blob.type] = blob; return make(blob); }; })()",
    )
    .await;
    page.click("#save-plot-error-svg").await;
    page.click("#save-plot-x-png").await;
    page.until(
        "window.__saved['image/png']?.size > 5000 && window.__saved['image/svg+xml']?.size > 2000",
    )
    .await;
    page.close().await;
}

async fn the_image_zooms_and_pans(browser: Browser) {
    let page = example(browser).await;
    let zoom = "document.querySelector('#stage').dataset.zoom";
    press(&page, "#stage", "+").await;
    page.until(&format!("{zoom} === '1.5'")).await;
    let pixels = "document.querySelector('#stage').toDataURL()";
    let before = page.value(pixels).await;
    press(&page, "#stage", "d").await;
    page.until(&format!("{pixels} !== {before}")).await;
    press(&page, "#stage", "0").await;
    page.until(&format!("{zoom} === '1'")).await;
    // The wheel belongs to the page, unless it is a pinch or the image was clicked.
    let wheel = |control: bool| {
        format!(
            "document.querySelector('#stage').dispatchEvent(new WheelEvent('wheel', {{ deltaY: -100, ctrlKey: {control}, \
             cancelable: true, clientX: 200, clientY: 200 }}))"
        )
    };
    page.value("document.querySelector('#stage').blur()").await;
    assert_eq!(page.value(&wheel(false)).await, Value::Bool(true));
    assert_eq!(page.value(zoom).await, "1");
    assert_eq!(page.value(&wheel(true)).await, Value::Bool(false));
    page.until(&format!("Number({zoom}) > 1")).await;
    page.close().await;
}

async fn another_keypoint_can_be_looked_at(browser: Browser) {
    let page = example(browser).await;
    let best = page
        .number("document.querySelector('.card').dataset.keypoint")
        .await;
    let other = if best == 0.0 { 1 } else { 0 };
    let rows = "[...document.querySelectorAll('.sequence')].map((row) => row.dataset.error).join()";
    let before = page.value(rows).await;
    page.value(&format!(
        "(() => {{ const list = document.querySelector('#viewer-keypoint'); list.value = '{other}'; \
         list.dispatchEvent(new Event('change')); }})()"
    ))
    .await;
    page.until(&format!(
        "document.querySelector('.layer[data-mark=keypoint]').textContent === 'keypoint {other}'"
    ))
    .await;
    page.until(&format!(
        "document.querySelector('canvas[data-quantity=x]').getAttribute('aria-label').includes('keypoint {other},')"
    ))
    .await;
    // The errors of the sequences are those of this keypoint now.
    page.until(&format!("{rows} !== {before}")).await;
    page.close().await;
}

async fn the_heat_map_of_a_keypoint_lies_over_the_frame(browser: Browser) {
    let page = example(browser).await;
    let pixels = "document.querySelector('#stage').toDataURL()";
    let before = page.value(pixels).await;
    page.click(".layer[data-mark=heat]").await;
    page.until("document.querySelector('#stage').dataset.heat === 'true'")
        .await;
    assert_ne!(page.value(pixels).await, before);
    press(&page, "#stage", Key::Right + "").await;
    until_frame(&page, 1).await;
    page.until("document.querySelector('#stage').dataset.heat === 'true'")
        .await;
    // The example's checkpoint has its decoder: what it makes of the keypoints is beside the frame.
    page.click(".layer[data-mark=image]").await;
    let decoded = "document.querySelector('#reconstruction')";
    page.until(&format!(
        "{decoded}.dataset.frame === '1' && {decoded}.width === 64"
    ))
    .await;
    let colours = format!(
        "new Set({decoded}.getContext('2d').getImageData(0, 0, 64, 64).data.filter((v, i) => i % 4 !== 3)).size"
    );
    assert!(page.number(&colours).await > 50.0);
    page.close().await;
}

async fn what_is_shown_is_remembered(browser: Browser) {
    let page = example(browser).await;
    page.click(".layer[data-mark=keypoints]").await;
    let set = |id: &str, value: &str, event: &str| {
        format!(
            "(() => {{ const field = document.querySelector('{id}'); field.value = '{value}'; \
             field.dispatchEvent(new Event('{event}', {{ bubbles: true }})); }})()"
        )
    };
    page.value(&set("#speed", "12.5", "input")).await;
    page.value(&set("#threshold-cube", "0.001", "input")).await;
    page.goto("/").await;
    page.click("#try-example").await;
    page.until_scored().await;
    assert_eq!(
        page.value(
            "document.querySelector('.layer[data-mark=keypoints]').ariaPressed ?? \
                    document.querySelector('.layer[data-mark=keypoints]').getAttribute('aria-pressed')"
        )
        .await,
        "false"
    );
    assert_eq!(
        page.value("document.querySelector('#speed').value").await,
        "12.5"
    );
    assert_eq!(
        page.value("document.querySelector('.card[data-object=cube]').dataset.threshold")
            .await,
        "0.001"
    );
    // A result that comes from settings of an earlier visit says so, and has a way back.
    page.until_text("Kept from your last visit: threshold 0.001 for cube.")
        .await;
    page.click("[data-problem=remembered] button.link").await;
    page.until("document.querySelector('.card[data-object=cube]').dataset.threshold === '0.015'")
        .await;
    page.until("!document.querySelector('[data-problem=remembered]')")
        .await;

    // What cannot be understood is as good as nothing.
    page.value("localStorage.setItem('tracklens/settings/1/viewer', '{\"layers\": 7, \"trail\": \"x\", \"speed\": -1}')")
        .await;
    page.value(
        "localStorage.setItem('tracklens/settings/1/score', '{\"thresholds\": {\"cube\": \"no\"}')",
    )
    .await;
    page.goto("/").await;
    page.click("#try-example").await;
    page.until_scored().await;
    assert_eq!(
        page.value("document.querySelector('#speed').value").await,
        "5"
    );
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn of_many_sequences_only_those_in_sight_are_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for s in 0..800 {
        for t in 0..4 {
            let (x, y) = (f64::from(s * 4 + t) * 0.37).sin_cos();
            let off = f64::from(s) * 1e-4;
            writeln!(truth, "seq_{s:04},{t},cube,{},{}", 0.5 * x, 0.5 * y).expect("a string");
            writeln!(
                keypoints,
                "seq_{s:04},{t},0,{},{}",
                0.5 * x + off * y,
                0.5 * y
            )
            .expect("a string");
        }
    }
    let [gt, kp] = ["gt.csv", "kp.csv"].map(|name| folder.path().join(name));
    fs::write(&gt, truth).expect("written");
    fs::write(&kp, keypoints).expect("written");
    let page = Page::open().await;
    page.pick(&[&gt, &kp]).await;
    page.until_scored().await;
    page.until("document.querySelectorAll('.sequence').length > 5")
        .await;
    assert!(
        page.number("document.querySelectorAll('.sequence').length")
            .await
            < 40.0
    );
    // The worst one first, and the keyboard moves through that order.
    page.click("#worst-first").await;
    let errors = "[...document.querySelectorAll('.sequence')].sort((a, b) => a.ariaPosInSet - b.ariaPosInSet)\
                  .map((row) => Number(row.dataset.error))";
    page.until(&format!(
        "((e) => e.every((error, i) => i === 0 || error <= e[i - 1]))({errors}.slice(1))"
    ))
    .await;
    press(&page, "#sequence-list", Key::Home + "").await;
    page.until("document.querySelector('.sequence[aria-selected=true]').ariaPosInSet === '1'")
        .await;
    press(&page, "#sequence-list", Key::Down + "").await;
    page.until("document.querySelector('.sequence[aria-selected=true]').ariaPosInSet === '2'")
        .await;
    let active = "document.getElementById(document.querySelector('#sequence-list').getAttribute('aria-activedescendant'))";
    page.until(&format!(
        "{active} === document.querySelector('.sequence[aria-selected=true]')"
    ))
    .await;
    page.close().await;
}

//! The page as a workspace: what is in sight, what plays, what is asked and said before a number is
//! believed.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use thirtyfour::prelude::*;
use tracklens_page_tests::{
    Browser, Page, eval_example, example, in_every_browser, pack, parsed, text, tracklens_json,
};

in_every_browser! {
    everything_important_is_in_one_window
    a_click_in_the_heat_map_keeps_the_frame_in_sight
    fitted_and_held_out_stand_side_by_side
    too_few_frames_give_no_verdict
    buttons_can_be_read_under_the_pointer
    files_are_counted_from_the_drop_on
    tables_are_compared_one_by_one
    many_objects_and_keypoints_stay_usable
    time_can_be_zoomed
    frames_and_truth_play_while_something_is_missing
    an_extraction_shows_what_it_has_so_far
    the_guide_is_shown_once
    a_link_carries_the_settings
    a_score_is_copied_for_a_paper
    tabs_are_moved_through_by_keys
    a_table_with_other_columns_is_mapped
    detectors_are_rows_and_play_in_step
    temporal_quality_is_that_of_the_terminal
    a_sequence_is_saved_as_a_video
    a_report_plays_the_sequence
}

async fn scored(browser: Browser) -> Page {
    with_example(Page::open_in(browser).await).await
}

async fn with_example(page: Page) -> Page {
    page.click("#try-example").await;
    page.until_scored().await;
    page
}

/// Makes the page 1280 x 900; Firefox's is nearly that large from the start.
async fn resize(page: &Page, browser: Browser) {
    if browser == Browser::Chromium {
        let size = json!({ "width": 1280, "height": 900, "deviceScaleFactor": 1, "mobile": false });
        page.cdp("Emulation.setDeviceMetricsOverride", size).await;
    }
}

/// The tops and bottoms of the main parts in the page.
async fn parts(page: &Page) -> Value {
    page.value(
        "Object.fromEntries(['.viewer-stage', '.score', '.objects', '.viewer-plots', '.tabs'].map((part) => { \
         const { top, bottom } = document.querySelector(part).getBoundingClientRect(); \
         return [part, [Math.round(top + scrollY), Math.round(bottom + scrollY)]]; }))",
    )
    .await
}

async fn everything_important_is_in_one_window(browser: Browser) {
    let page = Page::open_in(browser).await;
    resize(&page, browser).await;
    page.click("#try-example").await;
    page.until_scored().await;
    for guided in [true, false] {
        let parts = parts(&page).await;
        let height = page.number("innerHeight").await as i64;
        println!("{browser:?}, 1280 x {height}, guided: {guided}: {parts}");
        for (part, sides) in parts.as_object().expect("parts") {
            assert!(sides[1].as_i64() <= Some(height), "{part} {sides}");
        }
        if guided {
            page.click("#guide-skip").await;
        }
    }
    assert_eq!(
        page.value("scrollY === 0 && document.documentElement.scrollWidth <= innerWidth")
            .await,
        true
    );
    // Firefox's window cannot be as narrow as a phone.
    if browser == Browser::Chromium {
        let phone = json!({ "width": 375, "height": 812, "deviceScaleFactor": 1, "mobile": true });
        page.cdp("Emulation.setDeviceMetricsOverride", phone).await;
        let parts = parts(&page).await;
        println!("375 x 812: {parts}");
        let order = [".score", ".viewer-stage", ".objects", ".tabs"];
        let tops: Vec<i64> = order
            .iter()
            .map(|part| parts[part][0].as_i64().expect("a number"))
            .collect();
        assert!(tops.is_sorted(), "{parts}");
        // The number and the frame are in the first window.
        assert!(tops[1] < 812, "{parts}");
    }
    page.close().await;
}

async fn a_click_in_the_heat_map_keeps_the_frame_in_sight(browser: Browser) {
    let page = scored(browser).await;
    resize(&page, browser).await;
    page.until("document.querySelector('#errors [role=gridcell]')")
        .await;
    page.value("document.querySelector('.footer').scrollIntoView()")
        .await;
    let cell = By::Css("#errors [data-object='2'][data-keypoint='0']");
    let cell = page.driver.find(cell).await.expect("a cell");
    cell.scroll_into_view().await.expect("in view");
    cell.click().await.expect("a click");
    page.until(
        "(({ top, bottom }) => top >= -1 && bottom <= innerHeight + 1) \
         (document.querySelector('#stage').getBoundingClientRect())",
    )
    .await;
    page.until("document.querySelector('#viewer .legend').textContent.includes('keypoint 0')")
        .await;
    page.close().await;
}

async fn fitted_and_held_out_stand_side_by_side(browser: Browser) {
    let page = scored(browser).await;
    let expected = parsed(&eval_example(&[]));
    let text = |selector: &str| format!("document.querySelector('{selector}').textContent");
    let shown = |value: &Value| format!("{:.2}", value.as_f64().expect("a number"));
    assert_eq!(page.value(&text(".tc-value")).await, shown(&expected["tc"]));
    assert_eq!(
        page.value(&text(".tc-beside")).await,
        shown(&expected["held_out"]["tc"])
    );
    let errors = "[...document.querySelectorAll('.card')].map((card) => [card.dataset.object, \
                  Number(card.querySelector('.error-beside').textContent)])";
    let errors = page.value(errors).await;
    for (shown, object) in errors
        .as_array()
        .expect("cards")
        .iter()
        .zip(expected["held_out"]["objects"].as_array().expect("objects"))
    {
        let [error, shown] = [&object["error"], &shown[1]].map(|v| v.as_f64().expect("a number"));
        // Three digits are shown.
        assert!(
            (error - shown).abs() <= 0.006 * error,
            "{shown} of {object}"
        );
    }
    page.close().await;
}

/// Tables of objects with a keypoint each that follows it.
struct Tables(tempfile::TempDir);

impl Tables {
    fn new(sequences: usize, frames: usize, objects: usize, keypoints: usize) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let mut truth = String::from("sequence,frame,object,x,y\n");
        let mut table = String::from("sequence,frame,keypoint,x,y\n");
        for (s, t) in (0..sequences).flat_map(|s| (0..frames).map(move |t| (s, t))) {
            let at = |k: usize| {
                let (sin, cos) = ((7 * s + t) as f64 * (0.37 + 0.05 * k as f64)).sin_cos();
                [0.6 * sin, 0.5 * cos * sin + 0.2 * cos]
            };
            for k in 0..objects {
                let [x, y] = at(k);
                writeln!(truth, "s{s},{t},object{k},{x},{y}").expect("a string");
            }
            for n in 0..keypoints {
                let [x, y] = at(n % objects);
                let off = 0.01 * (n / objects) as f64 * (t as f64 * 1.7).sin();
                writeln!(table, "s{s},{t},{n},{},{}", x + off, y - off).expect("a string");
            }
        }
        fs::write(folder.path().join("truth.csv"), truth).expect("written");
        fs::write(folder.path().join("keypoints.csv"), table).expect("written");
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    async fn open(&self, browser: Browser) -> Page {
        let page = Page::open_in(browser).await;
        page.pick(&[&self.path("truth.csv"), &self.path("keypoints.csv")])
            .await;
        page.until_scored().await;
        page
    }
}

async fn too_few_frames_give_no_verdict(browser: Browser) {
    let page = Tables::new(1, 10, 1, 2).open(browser).await;
    let text = "document.querySelector('.tc-value').textContent";
    assert_eq!(page.value(text).await, "unknown");
    assert_eq!(
        page.value("document.querySelector('.verdict').textContent")
            .await,
        "Too few frames"
    );
    assert_eq!(
        page.number("document.querySelectorAll('.verdict[data-tracked=true]').length")
            .await,
        0.0
    );
    page.until("/\\d+ frames/.test(document.querySelector('.warnings').textContent)")
        .await;
    page.close().await;
}

async fn buttons_can_be_read_under_the_pointer(browser: Browser) {
    let page = scored(browser).await;
    let button = page.driver.find(By::Css("#try-example")).await;
    let button = button.expect("a button");
    let chain = page.driver.action_chain();
    let moved = chain.move_to_element_center(&button).perform().await;
    moved.expect("the pointer moves");
    // Of two colours of the page, in shares of 255.
    let contrast = "(() => { const { color, backgroundColor } = getComputedStyle(document.querySelector('#try-example:hover')); \
        const canvas = document.createElement('canvas').getContext('2d'); \
        const light = (style) => { canvas.fillStyle = style; canvas.fillRect(0, 0, 1, 1); \
        const [r, g, b] = [...canvas.getImageData(0, 0, 1, 1).data].map((v) => v / 255) \
        .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)); \
        return 0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05; }; \
        const [a, b] = [light(color), light(backgroundColor)]; return Math.max(a, b) / Math.min(a, b); })()";
    page.until(&format!("{contrast} >= 4.5")).await;
    page.close().await;
}

async fn files_are_counted_from_the_drop_on(browser: Browser) {
    let page = Page::open_in(browser).await;
    let seen = page
        .value(
            "(() => { const input = document.querySelector('#input-files'); const transfer = new DataTransfer(); \
             for (let i = 0; i < 3000; i++) transfer.items.add(new File(['x'], `frame_${i}.png`, { type: 'image/png' })); \
             input.files = transfer.files; input.dispatchEvent(new Event('change')); \
             return [document.querySelector('main').dataset.state, document.querySelector('#reading').hidden, \
             document.querySelector('#reading').textContent]; })()",
        )
        .await;
    assert_eq!(seen[0], "reading");
    assert_eq!(seen[1], false);
    assert!(
        seen[2].as_str().is_some_and(|text| text.contains("files")),
        "{seen}"
    );
    page.until("document.querySelector('#files [data-role=image]')?.dataset.frames === '3000'")
        .await;
    page.close().await;
}

/// From here on keeps the text of what the page saves, by its name.
const CATCH: &str = "(() => { globalThis.__files = {}; const blobs = new Map(); const make = URL.createObjectURL; \
    URL.createObjectURL = (blob) => { const url = make(blob); blobs.set(url, blob); return url; }; \
    HTMLAnchorElement.prototype.click = function () { const name = this.download; \
    blobs.get(this.href).text().then((text) => { globalThis.__files[name] = text; }); }; })()";

/// Firefox keeps what its driver changes from the page, so that its files cannot be caught.
#[tokio::test(flavor = "multi_thread")]
async fn a_saved_command_repeats_everything_that_was_saved() {
    let page = Tables::new(3, 40, 2, 4).open(Browser::Chromium).await;
    page.value(CATCH).await;
    page.click("#save-evaluation").await;
    let file = "globalThis.__files['evaluation.json']";
    page.until(file).await;
    let saved: Value =
        serde_json::from_str(page.value(file).await.as_str().expect("text")).expect("JSON");
    let command = saved["command"].as_str().expect("a command");
    assert!(
        saved["sequences"].is_array() && saved["context"].is_object(),
        "{saved}"
    );
    for option in ["--sequences", "--context"] {
        assert!(command.contains(option), "{command}");
    }
    page.close().await;
}

async fn tables_are_compared_one_by_one(browser: Browser) {
    let tables = Tables::new(3, 40, 2, 4);
    let page = tables.open(browser).await;
    let other = tables.path("other.csv");
    fs::copy(tables.path("keypoints.csv"), &other).expect("copied");
    page.pick(&[&other]).await;
    page.until("document.querySelector('#comparison').dataset.complete === '2'")
        .await;
    let names =
        "[...document.querySelectorAll('#run-table tbody th')].map((cell) => cell.textContent)";
    assert_eq!(
        page.value(names).await,
        json!(["keypoints.csv", "other.csv"])
    );
    assert_eq!(
        page.value("document.querySelector('#comparison').dataset.groups")
            .await,
        "2"
    );
    page.close().await;
}

async fn many_objects_and_keypoints_stay_usable(browser: Browser) {
    let page = Tables::new(3, 12, 60, 600).open(browser).await;
    // A table of which the rows in sight are there, and the card of the object on display.
    assert_eq!(
        page.number("document.querySelectorAll('.card').length")
            .await,
        1.0
    );
    let rows = "document.querySelectorAll('#object-table .object-rows > [role=row]')";
    let few = page.number(&format!("{rows}.length")).await;
    assert!((6.0..40.0).contains(&few), "{few} rows");
    page.value("document.querySelector('#object-table').scrollTo(0, 1e6)")
        .await;
    page.until(&format!(
        "[...{rows}].some((row) => row.ariaRowIndex === '61' || row.getAttribute('aria-rowindex') === '61')"
    ))
    .await;
    page.value(&format!(
        "[...{rows}].at(-1).querySelector('button').click()"
    ))
    .await;
    page.until(&format!(
        "document.querySelector('.card').dataset.object === [...{rows}].find((row) => row.querySelector('[aria-pressed=true]'))?.dataset.object"
    ))
    .await;

    // A heat map without an element a cell: keys and clicks choose keypoints.
    page.until("document.querySelector('.large-canvas').width > 300")
        .await;
    let elements = page.number("document.querySelectorAll('*').length").await;
    assert!(elements < 3000.0, "{elements} elements");
    let matrix = page.driver.find(By::Css("#large-matrix")).await;
    let matrix = matrix.expect("a matrix");
    matrix.focus().await.expect("focus");
    matrix.send_keys("" + Key::End).await.expect("a key");
    page.until("document.querySelector('#large-cell').textContent.includes('keypoint 599')")
        .await;
    page.until("document.querySelector('#large-matrix').scrollLeft > 1000")
        .await;
    matrix.send_keys("" + Key::Enter).await.expect("a key");
    page.until("document.querySelector('#viewer-object').value === 'object0'")
        .await;
    page.until("document.querySelector('#viewer-keypoint').value === '599'")
        .await;
    page.close().await;
}

async fn time_can_be_zoomed(browser: Browser) {
    let page = Tables::new(2, 200, 1, 2).open(browser).await;
    page.hold().await;
    let points = |n: &str| {
        format!("document.querySelector('canvas[data-quantity=x]').dataset.points === '{n}'")
    };
    page.until(&points("200")).await;
    page.click("#zoom-time [aria-label^='Zoom in']").await;
    page.until("Number(document.querySelector('canvas[data-quantity=x]').dataset.points) < 150")
        .await;
    // All three follow, and the part that is shown follows the frame.
    let same = "new Set([...document.querySelectorAll('canvas.plot')].map((plot) => plot.dataset.points)).size === 1";
    page.until(same).await;
    let stage = page.driver.find(By::Css("#stage")).await.expect("a stage");
    stage.focus().await.expect("focus");
    stage.send_keys("" + Key::End).await.expect("a key");
    page.until("document.querySelector('#stage').dataset.frame === '199'")
        .await;
    page.until("!document.querySelector('.plot-cursor').hidden")
        .await;
    page.value(
        "document.querySelector('canvas[data-quantity=x]').dispatchEvent(new WheelEvent('wheel', \
         { deltaY: -100, ctrlKey: true, cancelable: true, bubbles: true, clientX: 700, clientY: 500 }))",
    )
    .await;
    page.until("Number(document.querySelector('canvas[data-quantity=x]').dataset.points) < 100")
        .await;
    page.click("#zoom-time [aria-label^='All']").await;
    page.until(&points("200")).await;
    page.close().await;
}

async fn frames_and_truth_play_while_something_is_missing(browser: Browser) {
    let page = Page::open_moving(browser).await;
    let mut files: Vec<PathBuf> = vec![example("ground_truth.csv")];
    let sequence = fs::read_dir(example("frames"))
        .expect("frames")
        .next()
        .expect("one")
        .expect("a folder");
    files.extend(
        fs::read_dir(sequence.path())
            .expect("frames")
            .map(|frame| frame.expect("a frame").path()),
    );
    files.sort();
    // Loose images: their sequence is named as the table has it.
    let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    page.pick(&paths[..paths.len() - 1]).await;
    page.until("!document.querySelector('#viewer').hidden")
        .await;
    page.until("document.querySelector('#missing').textContent.includes('checkpoint')")
        .await;
    let frame = "document.querySelector('#stage').dataset.frame";
    page.until(&format!("{frame} !== undefined")).await;
    let first = page.value(frame).await;
    page.until(&format!(
        "{frame} !== '{}'",
        first.as_str().unwrap_or_default()
    ))
    .await;
    page.until("document.querySelector('#stage').dataset.picture?.endsWith('.png')")
        .await;
    assert_eq!(
        page.value("document.querySelector('#results').dataset.tc ?? null")
            .await,
        Value::Null
    );
    page.close().await;
}

async fn an_extraction_shows_what_it_has_so_far(browser: Browser) {
    let page = Page::open_in(browser).await;
    page.value(
        "(new MutationObserver(() => { const said = document.querySelector('#provisional')?.textContent; \
         const state = document.querySelector('main').dataset.state; \
         const { dataset } = document.body; \
         if (state === 'extracting' && !document.querySelector('#viewer').hidden && !dataset.seen) dataset.seen = true; \
         if (said?.includes('TC') && !dataset.said) { dataset.said = said; document.querySelector('#cancel')?.click(); } }) \
         .observe(document.body, { childList: true, subtree: true, characterData: true, attributes: true }), true)",
    )
    .await;
    // An encoder that takes the frames at their full size, so that there is time to look.
    let slow =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../golden/basic-vel-std-bg-tiny.safetensors");
    page.pick(&[&slow.canonicalize().expect("the golden file")])
        .await;
    // As an archive: Firefox's driver takes no folders.
    let folder = tempfile::tempdir().expect("a folder");
    let archive = folder.path().join("recording.zip");
    pack(&example(""), &["frames", "ground_truth.csv"], &archive);
    page.pick(&[&archive]).await;
    page.until("document.body.dataset.said && document.body.dataset.seen")
        .await;
    // What is done is kept, and scored when asked for.
    page.click("#score-partial").await;
    page.until_scored().await;
    let scored = page
        .number("document.querySelector('.card').dataset.frames")
        .await;
    assert!(scored > 0.0);
    page.close().await;
}

async fn the_guide_is_shown_once(browser: Browser) {
    let page = scored(browser).await;
    let guide = "document.querySelector('#guide')";
    for step in ["1 of 3", "2 of 3", "3 of 3"] {
        page.until(&format!("{guide}.textContent.startsWith('{step}')"))
            .await;
        assert_eq!(
            page.number("document.querySelectorAll('[data-guided]').length")
                .await,
            1.0
        );
        page.click("#guide-next").await;
    }
    page.until(&format!(
        "{guide}.hidden && !document.querySelector('[data-guided]')"
    ))
    .await;
    page.goto("/").await;
    page.click("#try-example").await;
    page.until_scored().await;
    assert_eq!(page.value(&format!("{guide}.hidden")).await, true);
    page.close().await;
}

async fn a_link_carries_the_settings(browser: Browser) {
    let tables = Tables::new(3, 40, 2, 4);
    let page = tables.open(browser).await;
    page.value("document.querySelector('input[name=transform][value=scale-translate]').click()")
        .await;
    page.value(
        "(() => { const field = document.querySelector('#threshold-object1'); field.value = '0.5'; \
         field.dispatchEvent(new Event('input', { bubbles: true })); })()",
    )
    .await;
    page.until(
        "location.hash.includes('map=scale-translate') && location.hash.includes('object1')",
    )
    .await;
    page.click("#copy-link").await;
    page.until("document.querySelector('#link').textContent === location.href")
        .await;
    let link = page.value("location.hash").await;
    // Somebody else opens it: nothing is remembered there.
    page.value("localStorage.clear()").await;
    page.goto("/favicon-nothing").await;
    page.goto(&format!("/{}", link.as_str().expect("a link")))
        .await;
    page.until("!document.querySelector('#try-example').disabled")
        .await;
    page.pick(&[&tables.path("truth.csv"), &tables.path("keypoints.csv")])
        .await;
    page.until_scored().await;
    assert_eq!(
        page.value("document.querySelector('.card[data-object=object1]').dataset.threshold")
            .await,
        "0.5"
    );
    assert_eq!(
        page.value("document.querySelector('input[name=transform]:checked').value")
            .await,
        "scale-translate"
    );
}

async fn a_score_is_copied_for_a_paper(browser: Browser) {
    let page = Tables::new(3, 40, 2, 4).open(browser).await;
    page.click("#copy-text").await;
    let paper = "document.querySelector('#paper').textContent";
    page.until(&format!(
        "{paper}.trim().split('\\n').length === 3 && {paper}.startsWith('Tracking capability')"
    ))
    .await;
    page.click("#copy-tex").await;
    page.until(&format!(
        "{paper}.includes('\\\\toprule') && {paper}.includes('object1')"
    ))
    .await;
    page.close().await;
}

async fn tabs_are_moved_through_by_keys(browser: Browser) {
    let page = Tables::new(3, 40, 2, 4).open(browser).await;
    let tab = page.driver.find(By::Css("#tab-matrix")).await;
    let tab = tab.expect("a tab");
    tab.focus().await.expect("focus");
    let shown = |id: &str| {
        format!(
            "document.activeElement.id === 'tab-{id}' && !document.querySelector('#view-{id}').hidden && \
             document.querySelectorAll('[role=tabpanel]:not([hidden])').length === 1 && \
             document.querySelectorAll('[role=tab][tabindex=\"0\"]').length === 1"
        )
    };
    tab.send_keys("" + Key::Right).await.expect("a key");
    page.until(&shown("trajectories")).await;
    page.until("document.querySelectorAll('.trajectory').length === 2")
        .await;
    let press = async |key: Key| {
        let active = page.driver.active_element().await.expect("a tab");
        active.send_keys("" + key).await.expect("a key");
    };
    press(Key::End).await;
    page.until(&shown("export")).await;
    press(Key::Home).await;
    page.until(&shown("matrix")).await;
    press(Key::Left).await;
    page.until(&shown("export")).await;
    page.close().await;
}

async fn a_table_with_other_columns_is_mapped(browser: Browser) {
    let tables = Tables::new(3, 40, 1, 2);
    let truth = fs::read_to_string(tables.path("truth.csv")).expect("a table");
    let odd = tables.path("odd.csv");
    let renamed = truth
        .replacen("sequence,frame,object,x,y", "clip;t;thing;px;py", 1)
        .replace(',', ";");
    fs::write(&odd, renamed).expect("written");
    let page = Page::open_in(browser).await;
    page.pick(&[&tables.path("keypoints.csv"), &odd]).await;
    page.until("document.querySelector('#files [data-path=\"odd.csv\"]')")
        .await;
    page.value("document.querySelector('[data-key=\"columns odd.csv\"] summary').click()")
        .await;
    page.until("document.querySelector('[name=column-x]')?.value === 'px'")
        .await;
    page.value(
        "(() => { const object = document.querySelector('[name=column-object]'); object.value = 'thing'; })()",
    )
    .await;
    page.click("[name=apply-columns]").await;
    page.until_scored().await;
    assert_eq!(
        page.value("document.querySelector('.card').dataset.object")
            .await,
        "object0"
    );
    // No command reads such a table.
    assert_eq!(
        page.value("document.querySelector('#command').textContent")
            .await,
        ""
    );
    page.close().await;
}

/// Settings, keypoints, ground truth and images go into one file and come back from it.
#[tokio::test(flavor = "multi_thread")]
async fn a_score_is_saved_as_one_file_that_drops_back_in() {
    let page = scored(Browser::Chromium).await;
    page.value("document.querySelector('input[name=transform][value=scale-translate]').click()")
        .await;
    let shown = "JSON.stringify([...document.querySelectorAll('.card')].map((card) => \
                 [card.dataset.error, card.dataset.keypoint, card.dataset.rmse, card.querySelector('.error-keypoint + *').textContent]))";
    let before = page.value(shown).await;
    page.value(
        "(() => { const make = URL.createObjectURL; URL.createObjectURL = (blob) => { \
         if (blob.type === 'application/zip') globalThis.__zip = blob; return make(blob); }; \
         HTMLAnchorElement.prototype.click = () => {}; })()",
    )
    .await;
    page.click("#save-replay").await;
    page.until("globalThis.__zip").await;
    // It is dropped on a fresh page, without settings of its own.
    page.value(
        "(async () => { const zip = globalThis.__zip; document.querySelector('#start-over').click(); \
         localStorage.clear(); history.replaceState(null, '', '/'); const transfer = new DataTransfer(); \
         transfer.items.add(new File([zip], 'tracklens.zip')); const input = document.querySelector('#input-files'); \
         input.files = transfer.files; input.dispatchEvent(new Event('change')); })(), true",
    )
    .await;
    page.until_scored().await;
    assert_eq!(page.value(shown).await, before);
    page.until("document.querySelector('#stage').dataset.picture?.endsWith('.jpg')")
        .await;
    assert_eq!(
        page.value("document.querySelector('input[name=transform]:checked').value")
            .await,
        "scale-translate"
    );
    page.close().await;
}

/// The measures over time, computed when they are opened, and what is saved then.
async fn temporal_quality_is_that_of_the_terminal(browser: Browser) {
    let tables = Tables::new(3, 40, 2, 4);
    let page = tables.open(browser).await;
    page.reveal("#temporal").await;
    page.value("document.querySelector('#temporal > summary').click()")
        .await;
    page.until("document.querySelectorAll('#temporal-table tbody tr').length === 14")
        .await;
    let saved = parsed(&page.saved("#save-evaluation").await);
    let [truth, keypoints] = ["truth.csv", "keypoints.csv"].map(|name| tables.path(name));
    let expected = tracklens_json(&[
        "score",
        "--temporal",
        "--truth",
        &text(&truth),
        "--keypoints",
        &text(&keypoints),
    ]);
    let command = saved["command"].as_str().expect("a command");
    assert!(command.contains("--temporal"), "{command}");
    let numbers = |evaluation: &Value| -> Vec<(String, Option<f64>)> {
        let measures = evaluation["temporal"]["measures"]
            .as_array()
            .expect("measures");
        let of = |row: &Value| {
            let name = row["measure"].as_str().unwrap_or_default().to_owned();
            let values = row["objects"].as_array().expect("objects").clone();
            let values = values.into_iter().chain([row["all"].clone()]);
            values
                .map(|value| (name.clone(), value.as_f64()))
                .collect::<Vec<_>>()
        };
        measures.iter().flat_map(of).collect()
    };
    let (shown, expected) = (numbers(&saved), numbers(&expected));
    assert_eq!(shown.len(), expected.len());
    for ((name, shown), (_, expected)) in shown.iter().zip(&expected) {
        // The same code, whose sines and roots another compiler rounds.
        let differ = match (shown, expected) {
            (Some(a), Some(b)) => (a - b).abs() > 1e-12 * b.abs().max(1.0),
            (a, b) => a != b,
        };
        assert!(!differ, "{name}: {shown:?} for {expected:?}");
    }
    page.close().await;
}

/// The sequence on display is saved as a video, which the page itself reads again.
async fn a_sequence_is_saved_as_a_video(browser: Browser) {
    let page = scored(browser).await;
    page.hold().await;
    let before = page.number("globalThis.__made").await;
    page.click("#save-video").await;
    page.until(&format!("globalThis.__made > {before}")).await;
    let kind = page.value("globalThis.__last.type").await;
    let kind = kind.as_str().unwrap_or_default();
    assert!(["video/mp4", "video/webm"].contains(&kind), "{kind}");
    let frames = page.number("document.querySelector('#scrubber').max").await;
    page.value(
        "(() => { const video = globalThis.__last; document.querySelector('#start-over').click(); \
         const transfer = new DataTransfer(); transfer.items.add(new File([video], 'saved.mp4')); \
         const input = document.querySelector('#input-files'); input.files = transfer.files; \
         input.dispatchEvent(new Event('change')); })(), true",
    )
    .await;
    let count = "document.querySelector('#files [data-role=image]')?.dataset.frames";
    page.until(&format!("{count} === '{}'", frames + 1.0)).await;
    page.until("document.querySelector('#stage').dataset.picture?.startsWith('saved/')")
        .await;
    page.close().await;
}

/// A report plays the sequence on display, without a script.
async fn a_report_plays_the_sequence(browser: Browser) {
    let page = with_example(Page::open_moving(browser).await).await;
    page.hold().await;
    let frames = page.number("document.querySelector('#scrubber').max").await + 1.0;
    let report = page.saved("#save-report").await;
    let report = String::from_utf8(report).expect("text");
    assert!(!report.contains("<script"));
    assert_eq!(
        report.matches("data:image/jpeg;base64,").count() as f64,
        frames
    );
    // One image is visible at any time, and others later.
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("report.html");
    fs::write(&file, report).expect("written");
    let address = format!("file://{}", file.display());
    page.driver.goto(&address).await.expect("the report");
    let visible = "[...document.querySelectorAll('.film-frame:has(image)')].map((part, i) => \
                   getComputedStyle(part).visibility === 'visible' ? i : -1).filter((i) => i >= 0)";
    page.until(&format!("{visible}.length > 0")).await;
    let first = page.value(&format!("{visible}.join()")).await;
    page.until(&format!(
        "{visible}.join() !== '{}'",
        first.as_str().unwrap_or_default()
    ))
    .await;
    page.goto("/").await;
    page.close().await;
}

/// Two detectors are rows with fitted and held-out errors, and play in step.
async fn detectors_are_rows_and_play_in_step(browser: Browser) {
    let tables = Tables::new(3, 40, 2, 4);
    let page = tables.open(browser).await;
    let other = tables.path("other.csv");
    fs::copy(tables.path("keypoints.csv"), &other).expect("copied");
    page.pick(&[&other]).await;
    page.until("document.querySelectorAll('#detector-table tbody tr').length === 2")
        .await;
    page.until("[...document.querySelectorAll('#detector-table tbody small')].every((cell) => /\\d/.test(cell.textContent))")
        .await;
    page.hold().await;
    page.reveal("#in-step").await;
    page.value("document.querySelector('#in-step > summary').click()")
        .await;
    let frames = "[...document.querySelectorAll('#in-step canvas')].map((canvas) => canvas.dataset.frame).join()";
    page.until(&format!("{frames} === '0,0'")).await;
    let stage = page.driver.find(By::Css("#stage")).await.expect("a stage");
    stage.focus().await.expect("focus");
    stage.send_keys("" + Key::Right).await.expect("a key");
    page.until(&format!("{frames} === '1,1'")).await;
    page.close().await;
}

//! A ground truth that is marked by hand on the page.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::PathBuf;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde_json::{Value, json};
use thirtyfour::prelude::*;
use tracklens_page_tests::{
    Browser, Page, example, in_every_browser, text, tracklens, tracklens_json,
};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

in_every_browser! {
    marked_frames_are_scored_as_the_terminal_scores_their_table
    a_click_marks_the_centre_of_the_pixel_under_it
    marks_can_be_undone_and_outlast_the_page
    objects_are_named_added_and_removed
    an_extraction_begins_with_the_first_frame
}

/// Width and height of the frames.
const SIZE: [usize; 2] = [64, 48];
const SEQUENCES: usize = 3;

/// Frames with a green pixel that moves, and keypoints that follow it.
struct Spots {
    folder: tempfile::TempDir,
    /// Frames a sequence.
    frames: usize,
}

impl Spots {
    fn new(frames: usize) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let archive = fs::File::create(folder.path().join("frames.zip")).expect("an archive");
        let mut zip = ZipWriter::new(archive);
        let mut table = String::from("sequence,frame,keypoint,x,y\n");
        for (s, t) in (0..SEQUENCES).flat_map(|s| (0..frames).map(move |t| (s, t))) {
            let at = spot(s, t);
            let name = format!("seq_{s}/frame_{t:03}.png");
            zip.start_file(name, SimpleFileOptions::default())
                .expect("an entry");
            zip.write_all(&png(at)).expect("written");
            let [x, y] = ndc(at);
            let off = 0.02 * (t as f64 * 1.7).sin();
            writeln!(table, "seq_{s},{t},0,{},{}", 0.5 * x + off, 0.7 * y - off).expect("a string");
            writeln!(table, "seq_{s},{t},1,{},{}", -x + 4.0 * off, y).expect("a string");
        }
        zip.finish().expect("an archive");
        fs::write(folder.path().join("keypoints.csv"), table).expect("written");
        Self { folder, frames }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The page with the frames, and with the marking of objects.
    async fn open(&self, browser: Browser) -> Page {
        let page = Page::open_in(browser).await;
        page.pick(&[&self.path("frames.zip")]).await;
        open_marking(&page).await;
        page
    }
}

/// The pixel of a frame that is green.
fn spot(sequence: usize, frame: usize) -> [usize; 2] {
    let (sin, cos) = ((7 * sequence + frame) as f64 * 0.41).sin_cos();
    [
        (32.0 + 24.0 * sin) as usize,
        (24.0 + 17.0 * cos * sin) as usize,
    ]
}

/// The centre of a pixel.
fn ndc(at: [usize; 2]) -> [f64; 2] {
    [0, 1].map(|axis| (2 * at[axis] + 1) as f64 / SIZE[axis] as f64 - 1.0)
}

/// A grey image with a green pixel.
fn png(at: [usize; 2]) -> Vec<u8> {
    let [width, height] = SIZE;
    let mut rows = ZlibEncoder::new(Vec::new(), Compression::default());
    for y in 0..height {
        rows.write_all(&[0]).expect("a filter");
        for x in 0..width {
            let pixel = if [x, y] == at { [0, 255, 0] } else { [90; 3] };
            rows.write_all(&pixel).expect("a pixel");
        }
    }
    let mut header = [width as u32, height as u32].map(u32::to_be_bytes).concat();
    header.extend([8, 2, 0, 0, 0]);
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    for (name, content) in [
        (b"IHDR", header),
        (b"IDAT", rows.finish().expect("packed")),
        (b"IEND", Vec::new()),
    ] {
        let chunk = [&name[..], &content].concat();
        let mut sum = flate2::Crc::new();
        sum.update(&chunk);
        file.extend((content.len() as u32).to_be_bytes());
        file.extend(chunk);
        file.extend(sum.sum().to_be_bytes());
    }
    file
}

async fn open_marking(page: &Page) {
    page.click("#missing .mark-objects").await;
    page.until("document.querySelector('#marking-stage')?.dataset.picture")
        .await;
}

/// Where the green pixel is in the window, once the frame is drawn; `null` before.
const SEEN: &str = "(() => { const canvas = document.querySelector('#marking-stage'); \
    const { width, height } = canvas; const { left, top, width: wide } = canvas.getBoundingClientRect(); \
    const { data } = canvas.getContext('2d').getImageData(0, 0, width, height); \
    let [x, y, n] = [0, 0, 0]; for (let i = 0; i < width * height; i++) \
    if (data[4 * i] < 30 && data[4 * i + 1] > 220 && data[4 * i + 2] < 30) \
    { x += (i % width) + 0.5; y += Math.floor(i / width) + 0.5; n++; } \
    return n > 0 ? [left + (x / n) * wide / width, top + (y / n) * wide / width] : null; })()";

/// Clicks the green pixel.
async fn click_spot(page: &Page) {
    page.until(&format!("{SEEN} !== null")).await;
    let at = page.value(SEEN).await;
    let [x, y] = [0, 1].map(|axis| at[axis].as_f64().expect("a number").round() as i64);
    let chain = page.driver.action_chain();
    let clicked = chain.move_to(x, y).click().perform().await;
    clicked.expect("a click");
}

async fn press(page: &Page, keys: impl Into<TypingData>) {
    let stage = page.driver.find(By::Css("#marking-stage")).await;
    stage
        .expect("the stage")
        .send_keys(keys)
        .await
        .expect("a key");
}

async fn done(page: &Page) -> f64 {
    page.number("document.querySelector('#marking').dataset.done")
        .await
}

/// The table of the marks, as the page hands it on.
async fn table(page: &Page) -> String {
    String::from_utf8(page.saved("#marking-save").await).expect("a table")
}

/// The rows of a table of marks: sequence, frame, object and position.
fn rows(table: &str) -> Vec<(String, usize, String, Option<[f64; 2]>)> {
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        let at = [3, 4].map(|i| fields[i].parse().ok());
        let at = at[0].zip(at[1]).map(|(x, y)| [x, y]);
        let frame = fields[1].parse().expect("a frame");
        (fields[0].to_owned(), frame, fields[2].to_owned(), at)
    };
    table.lines().skip(1).map(row).collect()
}

/// The frame on display.
const PICTURE: &str = "document.querySelector('#marking-stage').dataset.picture";

/// Marks the green pixel in the next frames that are proposed.
async fn mark(page: &Page, frames: usize) {
    for _ in 0..frames {
        let before = page.value(PICTURE).await;
        let marked = done(page).await + 1.0;
        click_spot(page).await;
        page.until(&format!(
            "document.querySelector('#marking').dataset.done === '{marked}'"
        ))
        .await;
        if marked < 90.0 {
            until_next_frame(page, &before).await;
        }
    }
}

/// Waits for the frame that comes by itself once the one on display is marked.
async fn until_next_frame(page: &Page, before: &Value) {
    page.until(&format!("{PICTURE} !== {before}")).await;
}

async fn marked_frames_are_scored_as_the_terminal_scores_their_table(browser: Browser) {
    let spots = Spots::new(30);
    let page = spots.open(browser).await;
    page.pick(&[&spots.path("keypoints.csv")]).await;
    mark(&page, 29).await;
    page.until("document.querySelector('#marking-count').textContent === '29 of at least 30 frames marked'")
        .await;
    page.until("document.querySelector('#missing').textContent.includes('29 of at least 30')")
        .await;
    assert_eq!(
        page.value("document.querySelector('#results').dataset.tc ?? null")
            .await,
        Value::Null
    );
    mark(&page, 1).await;
    page.until_scored().await;

    let saved = table(&page).await;
    let marks = rows(&saved);
    assert_eq!(marks.len(), 30, "{saved}");
    for (sequence, frame, object, at) in &marks {
        let expected = ndc(spot(sequence[4..].parse().expect("a number"), *frame));
        let at = at.expect("a position");
        assert_eq!(object, "object 1");
        // A pixel of the screen is a quarter of the half pixel that another convention would shift.
        let off = [0, 1].map(|axis| (at[axis] - expected[axis]).abs() * SIZE[axis] as f64 / 2.0);
        assert!(
            off[0].max(off[1]) < 0.25,
            "{sequence} {frame}: {at:?} for {expected:?}"
        );
    }
    // They are spread: ten in each sequence, early and late ones.
    for s in 0..SEQUENCES {
        let frames: Vec<usize> = marks
            .iter()
            .filter(|mark| mark.0 == format!("seq_{s}"))
            .map(|mark| mark.1)
            .collect();
        assert_eq!(frames.len(), 10, "{saved}");
        assert!(frames[0] < spots.frames / 4 && frames[9] >= 3 * spots.frames / 4);
    }

    let file = spots.path("marked.csv");
    fs::write(&file, &saved).expect("written");
    let [truth, keypoints] = [&file, &spots.path("keypoints.csv")].map(|path| text(path));
    let expected = tracklens_json(&["score", "--truth", &truth, "--keypoints", &keypoints]);
    assert_eq!(
        page.number("document.querySelector('#results').dataset.tc")
            .await,
        expected["tc"].as_f64().expect("a number")
    );
    // The table gives the same page the same score, to the last digit that it shows.
    let shown = "document.querySelector('.card').textContent";
    page.click("#marking-done").await;
    let marked = page.value(shown).await;
    page.start_over().await;
    let files = ["frames.zip", "keypoints.csv", "marked.csv"].map(|name| spots.path(name));
    page.pick(&files.each_ref().map(PathBuf::as_path)).await;
    page.until_scored().await;
    assert_eq!(page.value(shown).await, marked);
    page.close().await;
}

async fn a_click_marks_the_centre_of_the_pixel_under_it(browser: Browser) {
    let spots = Spots::new(2);
    let page = spots.open(browser).await;
    press(&page, "++").await;
    let zoom = page
        .number("document.querySelector('#marking-stage').dataset.zoom")
        .await;
    assert!(zoom > 2.0);
    // What is zoomed is moved until the spot is there.
    for key in ["", "d", "d", "d", "a", "a", "a", "a", "a", "a"] {
        press(&page, key).await;
        if page.value(&format!("{SEEN} !== null")).await == true {
            break;
        }
    }
    let first = page.value(PICTURE).await;
    click_spot(&page).await;
    page.until("document.querySelector('#marking').dataset.done === '1'")
        .await;
    let saved = table(&page).await;
    let (sequence, frame, _, at) = rows(&saved).remove(0);
    let expected = ndc(spot(sequence[4..].parse().expect("a number"), frame));
    let at = at.expect("a position");
    let off = [0, 1].map(|axis| (at[axis] - expected[axis]).abs() * SIZE[axis] as f64 / 2.0);
    // Less than without the zoom, where it is a quarter.
    assert!(off[0].max(off[1]) < 0.12, "{at:?} for {expected:?}");

    // The middle of all of the image lies between its pixels, and is (0, 0).
    until_next_frame(&page, &first).await;
    let second = page.value(PICTURE).await;
    press(&page, "0m").await;
    page.until("document.querySelector('#marking').dataset.done === '2'")
        .await;
    let saved = table(&page).await;
    assert!(
        rows(&saved).iter().any(|row| row.3 == Some([0.0, 0.0])),
        "{saved}"
    );

    if browser == Browser::Chromium {
        until_next_frame(&page, &second).await;
        let touch = json!({ "enabled": true });
        page.cdp("Emulation.setTouchEmulationEnabled", touch).await;
        page.until(&format!("{SEEN} !== null")).await;
        let at = page.value(SEEN).await;
        let point = json!({ "x": at[0], "y": at[1] });
        for (kind, points) in [("touchStart", json!([point])), ("touchEnd", json!([]))] {
            let event = json!({ "type": kind, "touchPoints": points });
            page.cdp("Input.dispatchTouchEvent", event).await;
        }
        page.until("document.querySelector('#marking').dataset.done === '3'")
            .await;
    }
    page.close().await;
}

async fn marks_can_be_undone_and_outlast_the_page(browser: Browser) {
    let spots = Spots::new(20);
    let page = spots.open(browser).await;
    mark(&page, 2).await;
    press(&page, "x").await;
    page.until("document.querySelector('#marking').dataset.done === '3'")
        .await;
    let saved = table(&page).await;
    assert_eq!(
        saved.lines().filter(|line| line.ends_with(",,")).count(),
        1,
        "{saved}"
    );
    for (key, expected) in [("u", 2.0), ("u", 1.0), ("r", 2.0), ("r", 3.0)] {
        press(&page, key).await;
        assert_eq!(done(&page).await, expected);
    }
    let chord = Key::Control + "z";
    press(&page, chord).await;
    assert_eq!(done(&page).await, 2.0);
    press(&page, Key::Control + "y").await;
    assert_eq!(done(&page).await, 3.0);

    page.goto("/").await;
    page.until("!document.querySelector('#try-example').disabled")
        .await;
    page.pick(&[&spots.path("frames.zip")]).await;
    page.until_text("Go on marking objects").await;
    open_marking(&page).await;
    assert_eq!(done(&page).await, 3.0);
    assert_eq!(table(&page).await, saved);
    // Other images have no marks.
    page.start_over().await;
    let others = Spots::new(3);
    page.pick(&[&others.path("frames.zip")]).await;
    page.until_text("No table? Mark objects by hand").await;
    open_marking(&page).await;
    assert_eq!(done(&page).await, 0.0);
    page.until("document.querySelector('#marking').textContent.includes('these are only 9: add more images')")
        .await;
    // More images leave the marks as they are.
    mark(&page, 1).await;
    page.pick(&[&example("frames/seq_0002/frame_000.png")])
        .await;
    page.until("document.querySelector('#marking').textContent.includes('these are only 10: add more images')")
        .await;
    assert_eq!(done(&page).await, 1.0);
    // A frame that is still read takes no mark: the one before it is seen.
    let before = page.value(PICTURE).await;
    let press = "document.querySelector('#marking-stage').dispatchEvent(new KeyboardEvent(\
        'keydown', { bubbles: true, ...init }))";
    page.value(&format!(
        "[{{ key: 'ArrowRight', shiftKey: true }}, {{ key: 'm' }}].map((init) => {press}).length"
    ))
    .await;
    until_next_frame(&page, &before).await;
    assert_eq!(done(&page).await, 1.0);
    page.value(&format!("[{{ key: 'm' }}].map((init) => {press}).length"))
        .await;
    assert_eq!(done(&page).await, 2.0);
    page.close().await;
}

async fn objects_are_named_added_and_removed(browser: Browser) {
    let spots = Spots::new(20);
    let page = spots.open(browser).await;
    let name = async |object: usize, name: &str| {
        let fields = page
            .driver
            .find_all(By::Css(".marking-objects input"))
            .await;
        let field = fields.expect("fields").remove(object);
        field.clear().await.expect("empty");
        field.send_keys(name).await.expect("a name");
        field.send_keys("" + Key::Enter).await.expect("a key");
    };
    name(0, "cube, \"red\"").await;
    page.click("#marking-add").await;
    name(1, "gripper").await;
    page.until("document.querySelector('#marking .legend').textContent.includes('gripper')")
        .await;
    // The same name again is refused.
    name(1, "cube, \"red\"").await;
    page.until(
        "document.querySelector('.marking-objects').textContent.includes('There is an object')",
    )
    .await;
    name(1, "gripper").await;
    // The next object is at hand after each click, the next frame after the last object.
    let at_hand = "document.querySelector('#marking .layer[aria-pressed=true]').dataset.object";
    press(&page, "1").await;
    click_spot(&page).await;
    page.until(&format!("{at_hand} === '1'")).await;
    assert_eq!(done(&page).await, 0.0);
    press(&page, "x").await;
    page.until("document.querySelector('#marking').dataset.done === '1'")
        .await;
    let saved = table(&page).await;
    let lines: Vec<&str> = saved.lines().skip(1).collect();
    assert_eq!(lines.len(), 2, "{saved}");
    assert!(lines[0].contains(",\"cube, \"\"red\"\"\","), "{saved}");
    assert!(lines[1].ends_with(",gripper,,"), "{saved}");
    // The terminal reads the name as it was typed.
    let file = spots.path("marked.csv");
    fs::write(&file, &saved).expect("written");
    let converted = spots.path("converted.csv");
    tracklens(&["data", "convert", &text(&file), &text(&converted)]);
    let converted = fs::read_to_string(converted).expect("a table");
    assert!(converted.contains("\"cube, \"\"red\"\"\""), "{converted}");

    page.click(".marking-objects li:nth-child(2) .icon-button")
        .await;
    page.until("document.querySelectorAll('.marking-objects li').length === 1")
        .await;
    page.click("#marking-undo").await;
    page.until("document.querySelectorAll('.marking-objects li').length === 2")
        .await;
    assert_eq!(done(&page).await, 1.0);
    page.click("#marking-clear").await;
    page.until("document.querySelector('#marking').dataset.done === '0'")
        .await;
    page.close().await;
}

async fn an_extraction_begins_with_the_first_frame(browser: Browser) {
    let spots = Spots::new(20);
    let page = spots.open(browser).await;
    page.pick(&[&example("checkpoint.safetensors")]).await;
    page.until("document.querySelector('#files [data-role=checkpoint][data-state=used]')")
        .await;
    mark(&page, 1).await;
    page.until("document.querySelector('#extraction').dataset.done === '60'")
        .await;
    assert_eq!(
        page.value("document.querySelector('#results').dataset.tc ?? null")
            .await,
        Value::Null
    );
    assert_eq!(
        page.value("document.querySelector('#provisional')?.textContent ?? ''")
            .await,
        ""
    );
    // What is marked is among the files, and can be gone on with from there.
    page.click("#marking-done").await;
    page.until("document.querySelector('#files [data-path=\"marked.csv\"]').textContent.includes('1 of at least 30')")
        .await;
    page.click("#files .mark-objects").await;
    page.until("!document.querySelector('#marking').hidden")
        .await;
    page.close().await;
}

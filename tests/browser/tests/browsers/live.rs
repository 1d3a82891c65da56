//! Keypoints of frames as they come, of a camera or of a video that plays.

use std::fs;
use std::io::Cursor;

use serde_json::json;
use tracklens_page_tests::{
    Browser, Page, Server, example, extract_keypoints, in_every_browser, same_keypoints, site,
};
use zip::ZipArchive;

in_every_browser! {
    a_camera_is_tracked_and_recorded
    a_video_that_plays_is_tracked
}

/// Opens the live view with the example's checkpoint.
async fn open_live(page: &Page) {
    page.pick(&[&example("checkpoint.safetensors")]).await;
    page.click("#missing .open-live").await;
    page.until("!document.querySelector('#live').hidden").await;
}

/// What the live view says of itself.
fn told(name: &str) -> String {
    format!("Number(document.querySelector('#live').dataset.{name})")
}

const DRAWN: &str = "Number(document.querySelector('#live-stage').dataset.frames ?? 0)";

async fn a_camera_is_tracked_and_recorded(browser: Browser) {
    let page = Page::open_with_camera(browser).await;
    open_live(&page).await;
    page.click("#live-camera").await;
    page.until(&format!("{} > 0 && {DRAWN} > 3", told("rate")))
        .await;
    page.until("/frames\\/s/.test(document.querySelector('#live-rate').textContent)")
        .await;

    page.click("#live-pause").await;
    page.until("document.querySelector('#live-rate').textContent === 'Paused'")
        .await;
    page.click("#live-pause").await;
    let before = page.number(DRAWN).await;
    page.until(&format!("{DRAWN} > {before} + 1")).await;

    page.click("#live-record").await;
    page.until(&format!("{} >= 4", told("recorded"))).await;
    page.click("#live-record").await;
    page.until("document.querySelector('#files [data-role=image]')?.dataset.frames >= 4")
        .await;
    page.until_text("as the sequence live_1").await;
    let archive = page.saved("#live-save").await;
    let folder = tempfile::tempdir().expect("a folder");
    ZipArchive::new(Cursor::new(archive))
        .and_then(|mut zip| zip.extract(folder.path()))
        .expect("an archive");
    let frames = fs::read_dir(folder.path().join("live_1")).expect("frames");
    assert_eq!(
        page.number("document.querySelector('#files [data-role=image]').dataset.frames")
            .await,
        frames.count() as f64
    );

    // Its keypoints are those that were drawn, which the terminal finds in the same images; the
    // page's kernels differ from the terminal's by 1e-4.
    let found = String::from_utf8(page.saved("#save-keypoints-only").await).expect("a table");
    let expected = extract_keypoints(folder.path(), &folder.path().join("keypoints.csv"));
    same_keypoints(&found, &expected, 1e-4);

    page.click("#live-mark").await;
    page.until("document.querySelector('#marking-stage')?.dataset.picture?.startsWith('live_1/')")
        .await;
    assert_eq!(
        page.value("document.querySelector('#live').hidden").await,
        true
    );
    page.close().await;
}

/// Makes a video of the page's own and gives it to the live view.
const PLAY: &str = "(async () => { const canvas = document.createElement('canvas'); \
    Object.assign(canvas, { width: 128, height: 96 }); const context = canvas.getContext('2d'); \
    let t = 0; const paint = setInterval(() => { context.fillStyle = '#557'; context.fillRect(0, 0, 128, 96); \
    context.fillStyle = '#fb3'; context.fillRect(20 + 4 * (t++ % 20), 30, 12, 12); }, 40); \
    const parts = []; const recorder = new MediaRecorder(canvas.captureStream(25)); \
    recorder.ondataavailable = ({ data }) => parts.push(data); \
    await new Promise((done) => { recorder.onstop = done; recorder.start(); setTimeout(() => recorder.stop(), 1500); }); \
    clearInterval(paint); const transfer = new DataTransfer(); \
    transfer.items.add(new File(parts, 'moving.webm', { type: 'video/webm' })); \
    const input = document.querySelector('#live-file'); input.files = transfer.files; \
    input.dispatchEvent(new Event('change')); })()";

async fn a_video_that_plays_is_tracked(browser: Browser) {
    let page = Page::open_in(browser).await;
    open_live(&page).await;
    page.value(PLAY).await;
    page.until(&format!("{DRAWN} > 1")).await;
    page.until_text("The video is at its end.").await;
    let before = page.number(DRAWN).await;
    page.click("#live-pause").await;
    page.until(&format!("{DRAWN} > {before}")).await;
    page.click("#live-stop").await;
    page.until("document.querySelector('#live').dataset.status === 'choosing'")
        .await;

    let folder = tempfile::tempdir().expect("a folder");
    let broken = folder.path().join("broken.mp4");
    fs::write(&broken, [7; 4000]).expect("written");
    page.input("#live-file", &broken.to_string_lossy()).await;
    page.until_text("broken.mp4 cannot be played by this browser")
        .await;
    page.click("#live-close").await;
    page.until("document.querySelector('#live').hidden").await;
    page.close().await;
}

/// What a browser says of a camera, and what the page makes of it.
#[tokio::test(flavor = "multi_thread")]
async fn what_keeps_a_camera_from_being_used_is_said_with_a_way_out() {
    let page = Page::open_with(
        "navigator.mediaDevices.getUserMedia = () => Promise.reject(new DOMException('', globalThis.__camera));",
    )
    .await;
    open_live(&page).await;
    for (name, words) in [
        ("NotFoundError", "No camera was found"),
        ("NotAllowedError", "The camera may not be used"),
        ("NotReadableError", "another program may be using it"),
        ("UnknownError", "The camera cannot be used"),
    ] {
        page.value(&format!("globalThis.__camera = '{name}'")).await;
        page.click("#live-camera").await;
        page.until_text(words).await;
        page.until("document.querySelector('#live [role=alert]').textContent.includes('play a video file')")
            .await;
    }
    page.close().await;
}

/// A user who says no.
#[tokio::test(flavor = "multi_thread")]
async fn a_camera_that_was_denied_is_told_from_a_missing_one() {
    let server = Server::start(site(), &[]).await;
    let device = ["--use-fake-device-for-media-stream"];
    let page = Page::open_prepared(&device, server, "/", "").await;
    let denied = json!({ "permission": { "name": "camera" }, "setting": "denied" });
    page.cdp("Browser.setPermission", denied).await;
    open_live(&page).await;
    page.click("#live-camera").await;
    page.until_text("The camera may not be used").await;
    page.close().await;
}

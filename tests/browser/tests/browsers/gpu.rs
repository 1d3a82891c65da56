//! Extraction on WebGPU in headless Chromium, on SwiftShader (Vulkan on the CPU), against the
//! `tracklens` command.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tracklens_page_tests::{Page, Server, example, extract_keypoints, same_keypoints, site};

/// WebGPU on SwiftShader.
const SOFTWARE: [&str; 3] = [
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
];

/// The page takes a program that acts as a GPU for one.
const ALLOWED: &str = "/?gpu=software";

/// Other kernels add up in another order: the page uses a GPU that agrees with the CPU to 1e-3, and
/// this one is far closer.
const KEYPOINTS: f64 = 1e-4;

/// Whether the site can extract on a GPU. Without it a test says that it is skipped.
fn skipped() -> bool {
    let built = site().join("pkg/tracklens_gpu_bg.wasm").exists();
    if !built {
        eprintln!("skipped: the site is built without --gpu");
    }
    !built
}

/// A folder with some of the example's frames, copies of each sequence `times` over.
fn frames(sequences: usize, times: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut names: Vec<PathBuf> = fs::read_dir(example("frames"))
        .expect("frames")
        .map(|entry| entry.expect("a folder").path())
        .collect();
    names.sort();
    for sequence in names.iter().take(sequences) {
        for copy in 0..times {
            let name = sequence
                .file_name()
                .expect("a name")
                .to_string_lossy()
                .into_owned();
            let to = folder.path().join(match copy {
                0 => name,
                _ => format!("copy_{copy}_of_{name}"),
            });
            fs::create_dir(&to).expect("a folder");
            for frame in fs::read_dir(sequence).expect("frames") {
                let frame = frame.expect("a frame").path();
                fs::copy(&frame, to.join(frame.file_name().expect("a name"))).expect("copied");
            }
        }
    }
    folder
}

/// The page, and under `/hooks/` what tests put in the place of a script.
async fn open(path: &str, arguments: &[&str], script: &str) -> Page {
    let hooks = Path::new(env!("CARGO_MANIFEST_DIR")).join("hooks");
    let server = Server::start(site(), &[("hooks", hooks)]).await;
    Page::open_prepared(arguments, server, path, script).await
}

/// Takes the files and extracts on the device chosen.
async fn extract(page: &Page, device: &str, folder: &Path) {
    page.pick(&[
        &example("checkpoint.safetensors"),
        &example("ground_truth.csv"),
    ])
    .await;
    page.until("document.querySelector('#files [data-role=checkpoint][data-state=used]')")
        .await;
    page.value(&format!(
        "(() => {{ const choice = document.querySelector('#device-choice'); choice.value = '{device}'; \
         choice.dispatchEvent(new Event('change')); }})()"
    ))
    .await;
    page.pick_folder(folder).await;
}

/// Puts a script of this folder's `hooks` in the place of the GPU worker's.
fn hook(script: &str) -> String {
    format!(
        "const Plain = Worker; globalThis.Worker = class extends Plain {{ constructor(url, options) {{ \
         super(String(url).endsWith('/gpu-worker.js') ? new URL('hooks/{script}', location.href) : url, options); }} }};"
    )
}

async fn device(page: &Page, field: &str) -> String {
    let value = page
        .value(&format!(
            "document.querySelector('#devices').dataset.{field}"
        ))
        .await;
    value.as_str().unwrap_or_default().to_owned()
}

/// The keypoints that the page saves are those of the command, for every frame.
async fn agrees(page: &Page, folder: &Path) {
    let place = tempfile::tempdir().expect("a folder");
    let expected = extract_keypoints(folder, &place.path().join("kp.csv"));
    same_keypoints(&page.saved_keypoints().await, &expected, KEYPOINTS);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_gpu_finds_the_keypoints_of_the_cpu() {
    if skipped() {
        return;
    }
    let page = open(ALLOWED, &SOFTWARE, "").await;
    // A batch and a part of one, and a frame that the GPU leaves to the CPU, which says what is
    // wrong with it.
    let folder = frames(2, 1);
    let broken = folder.path().join("seq_0004").join("frame_003.png");
    let bytes = fs::read(&broken).expect("a frame");
    fs::write(&broken, &bytes[..bytes.len() / 2]).expect("written");
    extract(&page, "gpu", folder.path()).await;
    page.until_scored().await;
    println!("{}", device(&page, "reason").await);
    assert_eq!(device(&page, "device").await, "gpu");
    assert_eq!(
        page.number("document.querySelector('#extraction').dataset.failed")
            .await,
        1.0
    );
    page.until_text("frame_003.png").await;
    fs::remove_file(&broken).expect("removed");
    agrees(&page, folder.path()).await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gpu_that_is_lost_is_followed_by_the_cpu_without_a_gap() {
    if skipped() {
        return;
    }
    let page = open(ALLOWED, &SOFTWARE, &hook("gpu-lost.js")).await;
    page.value(
        "(() => { const place = document.querySelector('#extraction'); new MutationObserver(() => { \
         if (document.querySelector('#devices').dataset.device === 'gpu' && Number(place.dataset.done) > 1) { \
         globalThis.__lostAt ??= Number(place.dataset.done); new BroadcastChannel('gpu').postMessage('lose'); } }) \
         .observe(place, { attributes: true }); })()",
    )
    .await;
    let folder = frames(6, 1);
    extract(&page, "gpu", folder.path()).await;
    page.until_scored().await;
    let total = page
        .number("document.querySelector('#extraction').dataset.total")
        .await;
    let at = page.number("globalThis.__lostAt").await;
    assert!(at < total, "{at} of {total}");
    assert_eq!(device(&page, "device").await, "cpu");
    assert!(device(&page, "reason").await.contains("the GPU was lost"));
    page.until_text("nothing is missing").await;
    assert_eq!(
        page.number("document.querySelectorAll('#devices .notice').length")
            .await,
        1.0
    );
    agrees(&page, folder.path()).await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gpu_that_computes_wrongly_is_not_used() {
    if skipped() {
        return;
    }
    let page = open(ALLOWED, &SOFTWARE, &hook("gpu-wrong.js")).await;
    let folder = frames(1, 1);
    extract(&page, "gpu", folder.path()).await;
    page.until_scored().await;
    let reason = device(&page, "reason").await;
    assert_eq!(device(&page, "device").await, "cpu", "{reason}");
    assert!(
        reason.contains("finds other keypoints on the same frame"),
        "{reason}"
    );
    agrees(&page, folder.path()).await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_faster_device_is_chosen_by_their_times_and_both_are_told() {
    if skipped() {
        return;
    }
    let page = open(ALLOWED, &SOFTWARE, "").await;
    // Many seconds of work, of which the test sees the beginning.
    let folder = frames(usize::MAX, 40);
    extract(&page, "automatic", folder.path()).await;
    // Several sequences have a number, so nothing is joined, and the extraction waits to be asked
    // for.
    page.click("#extract").await;
    page.until(
        "document.querySelector('#devices').dataset.reason.includes('ms a frame on the GPU')",
    )
    .await;
    let reason = device(&page, "reason").await;
    println!("{reason}");
    let times: Vec<f64> = reason
        .split(" ms ")
        .filter_map(|part| part.rsplit([' ', ',']).next()?.parse().ok())
        .collect();
    let [gpu, cpu] = times[..] else {
        panic!("no two times in {reason}");
    };
    let faster = if gpu < cpu { "gpu" } else { "cpu" };
    assert_eq!(device(&page, "device").await, faster);
    page.click("#cancel").await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_gpu_nothing_of_it_is_fetched() {
    for (arguments, script, why) in [
        (&[][..], "", "WebGPU finds no GPU here"),
        (
            &[][..],
            "delete Navigator.prototype.gpu;",
            "this browser has no WebGPU",
        ),
        (
            &SOFTWARE[..],
            "",
            "the only GPU here is a program on the CPU (google swiftshader)",
        ),
    ] {
        let page = open("/", arguments, script).await;
        let folder = frames(1, 1);
        extract(&page, "gpu", folder.path()).await;
        page.until_scored().await;
        assert_eq!(device(&page, "device").await, "cpu");
        assert_eq!(device(&page, "reason").await, why);
        // The small scripts are among what is kept for use without a network.
        let asked = page.server.take_requests();
        assert!(
            !asked
                .iter()
                .any(|request| request.contains("tracklens_gpu_bg.wasm")),
            "{asked:?}"
        );
        page.close().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_choice_is_kept() {
    let page = Page::open().await;
    let folder = frames(1, 1);
    extract(&page, "cpu", folder.path()).await;
    page.until_scored().await;
    assert_eq!(device(&page, "reason").await, "as chosen");
    page.driver.refresh().await.expect("reloaded");
    page.until("document.querySelector('#device-choice')").await;
    assert_eq!(
        page.value("document.querySelector('#device-choice').value")
            .await,
        Value::from("cpu")
    );
    page.close().await;
}

//! The page with 10,000 frames of 256 px, as a folder and as a ZIP archive: how long it takes to
//! read, join and extract them, how large the tab gets, and how fast frames can be scrubbed. `cargo
//! xtask bench size` builds what this needs.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use tracklens_page_tests::{Browser, Page, example};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

const SEQUENCES: usize = 10;
const FRAMES: usize = 1000;

/// Frames that are scrubbed over, each some further than the one before, so that none was decoded.
const SCRUBBED: usize = 300;
const STRIDE: usize = 3;

/// The largest tab, and the slowest scrubbing, that are good enough.
const MOST_MB: f64 = 600.0;
const LEAST_FPS: f64 = 30.0;

#[tokio::main]
async fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    let frames = folder.path().join("frames");
    make_frames(&frames);
    let archive = folder.path().join("frames.zip");
    make_archive(&frames, &archive);
    let mut good = true;
    for (what, files) in [("folder", &frames), ("archive", &archive)] {
        let page = Page::open_moving(Browser::Chromium).await;
        let start = Instant::now();
        match what {
            "folder" => page.pick_folder(files).await,
            _ => page.pick(&[files]).await,
        }
        page.until("document.querySelector('#join')?.dataset.matched")
            .await;
        let joined = start.elapsed().as_secs_f64();
        let at_rest = megabytes(&page, "VmRSS");
        let start = Instant::now();
        page.pick(&[&example("checkpoint.safetensors")]).await;
        page.until(
            "document.querySelector('#results').dataset.tc !== undefined || \
             document.querySelector('#extraction').dataset.status === 'running'",
        )
        .await;
        while page
            .value("document.querySelector('#results').dataset.tc !== undefined")
            .await
            != true
        {
            tokio::time::sleep(std::time::Duration::from_millis(500)).await;
        }
        let extracted = start.elapsed().as_secs_f64();
        page.until("document.querySelector('#stage')?.dataset.picture")
            .await;
        let fps = scrub(&page).await;
        let peak = megabytes(&page, "VmHWM");
        println!(
            "{what}: {} frames read and joined in {joined:.1} s ({at_rest:.0} MB then), extracted and scored in {extracted:.0} \
             s, scrubbed at {fps:.0} frames/s; largest size of the tab {peak:.0} MB",
            SEQUENCES * FRAMES
        );
        good &= peak <= MOST_MB && fps >= LEAST_FPS;
        page.close().await;
    }
    assert!(
        good,
        "expected at most {MOST_MB} MB and at least {LEAST_FPS} frames/s"
    );
}

/// Copies of the example's frames, and their rows of its ground truth.
fn make_frames(folder: &Path) {
    let mut sources: Vec<(PathBuf, String, usize)> = Vec::new();
    for sequence in sorted(&example("frames")) {
        // The table has the number alone.
        let name = sequence.file_name().expect("a name").to_string_lossy();
        let name: usize = name.trim_start_matches("seq_").parse().expect("a number");
        let name = name.to_string();
        let images = sorted(&sequence);
        sources.extend(
            images
                .into_iter()
                .enumerate()
                .map(|(t, image)| (image, name.clone(), t)),
        );
    }
    let table = fs::read_to_string(example("ground_truth.csv")).expect("a table");
    let mut truth = String::from("sequence,frame,object,x,y\n");
    for s in 0..SEQUENCES {
        let sequence = folder.join(format!("seq_{s:04}"));
        fs::create_dir_all(&sequence).expect("a folder");
        for t in 0..FRAMES {
            let (image, name, frame) = &sources[(s * 37 + t) % sources.len()];
            fs::copy(image, sequence.join(format!("frame_{t:04}.png"))).expect("copied");
            let prefix = format!("{name},{frame},");
            for row in table
                .lines()
                .filter_map(|line| line.strip_prefix(prefix.as_str()))
            {
                truth += &format!("seq_{s:04},{t},{row}\n");
            }
        }
    }
    fs::write(folder.join("ground_truth.csv"), truth).expect("written");
}

fn make_archive(frames: &Path, archive: &Path) {
    let mut zip = ZipWriter::new(fs::File::create(archive).expect("a file"));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for path in sorted(frames) {
        let files = if path.is_dir() {
            sorted(&path)
        } else {
            vec![path]
        };
        for file in files {
            let name = file
                .strip_prefix(frames)
                .expect("inside")
                .to_string_lossy()
                .into_owned();
            zip.start_file(name, options).expect("an entry");
            zip.write_all(&fs::read(&file).expect("a file"))
                .expect("written");
        }
    }
    zip.finish().expect("an archive");
}

fn sorted(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut paths: Vec<PathBuf> = entries.map(|e| e.expect("an entry").path()).collect();
    paths.sort();
    paths
}

/// Moves the scrubber as fast as pictures come, and returns how many came a second.
async fn scrub(page: &Page) -> f64 {
    page.value(&format!(
        "(async () => {{ \
           const [stage, scrubber] = ['#stage', '#scrubber'].map((id) => document.querySelector(id)); \
           const drawn = (name) => new Promise((done) => {{ \
             const look = () => (stage.dataset.picture.endsWith(name) ? done() : requestAnimationFrame(look)); look(); }}); \
           const start = performance.now(); \
           for (let i = 1; i <= {SCRUBBED}; i++) {{ \
             scrubber.value = String(i * {STRIDE}); \
             scrubber.dispatchEvent(new Event('input', {{ bubbles: true }})); \
             await drawn(`frame_${{String(i * {STRIDE}).padStart(4, '0')}}.png`); \
           }} \
           globalThis.__fps = (1000 * {SCRUBBED}) / (performance.now() - start); \
         }})(), null"
    ))
    .await;
    page.until("globalThis.__fps").await;
    page.number("globalThis.__fps").await
}

/// A field of the status of the largest renderer of the page's browser, in MB. The workers live in
/// it, too.
fn megabytes(page: &Page, field: &str) -> f64 {
    let profile = page.profile().to_string_lossy().into_owned();
    let mut largest: f64 = 0.0;
    for entry in fs::read_dir("/proc").expect("Linux's /proc").flatten() {
        let command = fs::read(entry.path().join("cmdline")).unwrap_or_default();
        let command = String::from_utf8_lossy(&command);
        if !command.contains("--type=renderer") || !command.contains(&profile) {
            continue;
        }
        let status = fs::read_to_string(entry.path().join("status")).unwrap_or_default();
        let line = status
            .lines()
            .find_map(|line| line.strip_prefix(field)?.strip_prefix(':'));
        let kilobytes = line.and_then(|l| l.split_whitespace().next()?.parse::<f64>().ok());
        largest = largest.max(kilobytes.unwrap_or_default() / 1024.0);
    }
    assert!(largest > 0.0, "no renderer of this browser was found");
    largest
}

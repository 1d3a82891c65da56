//! Detectors as ONNX models on the page, against the `tracklens` command on the same files.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tracklens_page_tests::{Browser, Page, eval, in_every_browser, parsed};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

in_every_browser! {
    a_model_is_asked_what_it_does_not_say
    what_a_file_beside_a_model_says_is_not_asked
    a_model_that_cannot_run_says_why
}

/// Wasm has no fused multiply and add: products are rounded once more. The command's own tests hold
/// its keypoints to ONNX Runtime's within 1e-4.
const TOLERANCE: f64 = 1e-4;

fn data(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../data")
        .join(name);
    // Chromium's driver takes no path with `..`.
    path.canonicalize().expect("the tests' data")
}

/// Frames and ground truth in an archive, and then a model. Firefox's driver picks no folders.
async fn drop_model(page: &Page, folder: &Path, model: &Path) {
    let archive = folder.join("recording.zip");
    let mut zip = ZipWriter::new(File::create(&archive).expect("an archive"));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let root = data("panda_push");
    let mut paths = vec![root.join("ground_truth.csv")];
    for sequence in ["seq_0000", "seq_0001", "seq_0012"] {
        let frames = fs::read_dir(root.join(sequence)).expect("frames");
        paths.extend(frames.map(|frame| frame.expect("a frame").path()));
    }
    for path in paths {
        let name = path.strip_prefix(&root).expect("inside").to_string_lossy();
        zip.start_file(name, stored).expect("an entry");
        zip.write_all(&fs::read(&path).expect("a file"))
            .expect("written");
    }
    zip.finish().expect("an archive");
    page.pick(&[&archive, model]).await;
}

async fn choose(page: &Page, name: &str, value: &str) {
    let field = format!("document.querySelector('.file[data-role=checkpoint] [name={name}]')");
    page.until(&field).await;
    let change = "element.dispatchEvent(new Event('change'))";
    let chosen = format!("((element) => {{ element.value = '{value}'; {change}; }})({field})");
    page.value(&chosen).await;
}

/// The errors on the page are those of the command.
async fn equals(page: &Page, model: &Path, options: &[&str]) {
    page.until_scored().await;
    let (frames, truth) = (data("panda_push"), data("panda_push/ground_truth.csv"));
    let expected = parsed(&eval([model, &frames, &truth], options));
    let objects = expected["objects"].as_array().expect("objects");
    assert_eq!(objects.len(), 3);
    for object in objects {
        let name = &object["name"];
        let card = format!("document.querySelector('.card[data-object={name}]').dataset");
        let error = object["error"].as_f64().expect("an error");
        let shown = page.number(&format!("{card}.error")).await;
        assert!(
            (shown - error).abs() <= TOLERANCE * error,
            "{name}: {shown} and {error}"
        );
    }
}

async fn a_model_is_asked_what_it_does_not_say(browser: Browser) {
    let folder = tempfile::tempdir().expect("a folder");
    let page = Page::open_in(browser).await;
    let model = data("onnx/points.onnx");
    drop_model(&page, folder.path(), &model).await;
    let legend = "document.querySelector('.model-settings legend')?.textContent ?? ''";
    page.until(&format!("({legend}).includes('does not say')"))
        .await;
    let none = page
        .value("document.querySelector('#results').dataset.tc ?? null")
        .await;
    assert_eq!(none, Value::Null);
    choose(&page, "normalize", "bytes").await;
    choose(&page, "unit", "fraction").await;
    choose(&page, "columns", "yxc").await;
    page.until_scored().await;
    let command = page
        .value("document.querySelector('#command').textContent")
        .await;
    let command = command.as_str().expect("a command").to_owned();
    let said = ["--normalize=bytes", "--unit=fraction", "--columns=yxc"];
    for option in said {
        assert!(command.contains(option), "{command}");
    }
    equals(&page, &model, &said).await;
    page.close().await;
}

async fn what_a_file_beside_a_model_says_is_not_asked(browser: Browser) {
    let folder = tempfile::tempdir().expect("a folder");
    let model = folder.path().join("heatmaps.onnx");
    fs::copy(data("onnx/heatmaps.onnx"), &model).expect("copied");
    let beside = folder.path().join("heatmaps.onnx.json");
    fs::write(&beside, r#"{"normalize": "imagenet"}"#).expect("written");
    let page = Page::open_in(browser).await;
    page.pick(&[&beside]).await;
    drop_model(&page, folder.path(), &model).await;
    equals(&page, &model, &[]).await;
    // Nothing shows how it comes to its points.
    let heat = "document.querySelector('.layer[data-mark=heat]')";
    page.until(&format!("{heat}?.hidden")).await;
    page.close().await;
}

async fn a_model_that_cannot_run_says_why(browser: Browser) {
    let page = Page::open_in(browser).await;
    page.pick(&[&data("onnx/bad/operator.onnx")]).await;
    let notice = "document.querySelector('.file[data-role=checkpoint] .notice')?.textContent ?? ''";
    page.until(&format!("({notice}).includes('operator')"))
        .await;
    page.close().await;
}

//! Detectors as ONNX models on the page, against the `tracklens` command on the same files.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tracklens_page_tests::{Browser, Page, eval, in_every_browser, parsed};

in_every_browser! {
    a_model_is_asked_what_it_does_not_say
    what_a_file_beside_a_model_says_is_not_asked
    a_model_that_cannot_run_says_why
}

/// Wasm has no fused multiply and add: products are rounded once more. The command's own tests hold
/// its keypoints to ONNX Runtime's within 1e-4.
const TOLERANCE: f64 = 1e-4;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../data")
        .join(name)
}

/// Frames and ground truth, and then a model.
async fn drop_model(page: &Page, model: &Path) {
    page.pick_folder(&data("panda_push")).await;
    page.pick(&[model]).await;
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
    let page = Page::open_in(browser).await;
    let model = data("onnx/points.onnx");
    drop_model(&page, &model).await;
    let legend = "document.querySelector('.model-settings legend')?.textContent ?? ''";
    page.until(&format!("({legend}).includes('does not say')"))
        .await;
    let none = page
        .value("document.querySelector('#results').dataset.tc ?? null")
        .await;
    assert_eq!(none, Value::Null);
    choose(&page, "normalize", "symmetric").await;
    choose(&page, "unit", "px").await;
    choose(&page, "columns", "xyc").await;
    page.until_scored().await;
    let command = page
        .value("document.querySelector('#command').textContent")
        .await;
    let command = command.as_str().expect("a command").to_owned();
    let said = ["--normalize=symmetric", "--unit=px", "--columns=xyc"];
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
    drop_model(&page, &model).await;
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

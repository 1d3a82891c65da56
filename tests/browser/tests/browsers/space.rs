//! Points with three coordinates on the page, against the `tracklens` command on the same files.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tracklens_page_tests::{Browser, Page, in_every_browser, text, tracklens_json};

in_every_browser! {
    positions_in_space_are_scored_and_plotted
    a_camera_puts_them_into_the_image
    z_can_be_left_out
}

const SEQUENCES: usize = 3;
const FRAMES: usize = 40;
/// Pixels.
const FOCAL: f64 = 90.0;

/// Relative: the same arithmetic in WebAssembly.
const ERRORS: f64 = 1e-12;

/// A ground truth in metres, keypoints in space and in the image of a camera, and the camera.
struct Scene(tempfile::TempDir);

impl Scene {
    fn new() -> Self {
        let mut truth = String::from("sequence,frame,object,x,y,z\n");
        let mut space = String::from("sequence,frame,keypoint,x,y,z\n");
        let mut pixels = String::from("sequence,frame,keypoint,x,y\n");
        for (s, t) in (0..SEQUENCES).flat_map(|s| (0..FRAMES).map(move |t| (s, t))) {
            for (object, [x, y, z]) in ["cube", "ball"].into_iter().zip(at(s, t)) {
                let _ = writeln!(truth, "seq_{s},{t},{object},{x},{y},{z}");
            }
            for (n, [x, y, z]) in at(s, t).into_iter().enumerate() {
                let off = 0.01 * ((7 * t + n) as f64).sin();
                let _ = writeln!(
                    space,
                    "seq_{s},{t},{n},{},{},{}",
                    2.0 * y + off,
                    x - z,
                    z + 0.5 * x - off
                );
                let [u, v] = [x, y].map(|side| FOCAL * side / (z + 2.0));
                let _ = writeln!(pixels, "seq_{s},{t},{n},{},{}", u + 49.5 + off, v + 39.5);
            }
        }
        let camera = json!({
            "image_size": [100, 80],
            "intrinsics": [[FOCAL, 0, 49.5], [0, FOCAL, 39.5], [0, 0, 1]],
            "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            "translation": [0, 0, 2],
        });
        let folder = tempfile::tempdir().expect("a folder");
        for (name, content) in [
            ("truth.csv", truth),
            ("space.csv", space),
            ("pixels.csv", pixels),
            ("camera.json", camera.to_string()),
        ] {
            fs::write(folder.path().join(name), content).expect("written");
        }
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// What the command makes of the ground truth and these keypoints.
    fn score(&self, keypoints: &str, more: &[&str]) -> Value {
        let [truth, keypoints] = ["truth.csv", keypoints].map(|name| text(&self.path(name)));
        let files = ["score", "--truth", &truth, "--keypoints", &keypoints];
        tracklens_json(&[&files[..], more].concat())
    }

    async fn pick(&self, page: &Page, names: &[&str]) {
        let paths: Vec<PathBuf> = names.iter().map(|name| self.path(name)).collect();
        let paths: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
        page.pick(&paths).await;
    }
}

/// Where the cube and the ball are.
fn at(s: usize, t: usize) -> [[f64; 3]; 2] {
    let i = (s * FRAMES + t) as f64;
    [
        [
            0.5 * (0.9 * i).sin(),
            0.4 * (1.7 * i).cos(),
            0.3 * (0.7 * i).sin(),
        ],
        [
            0.3 * (1.1 * i).cos(),
            0.2 * (0.6 * i).sin(),
            0.4 * (1.9 * i).cos(),
        ],
    ]
}

/// Waits until the page shows the errors of an evaluation of the command.
async fn shows(page: &Page, expected: &Value) {
    page.until_errors(expected, ERRORS).await;
    // An unknown TC is `null` in both.
    assert_eq!(
        page.value("JSON.parse(document.querySelector('#results').dataset.tc)")
            .await
            .as_f64(),
        expected["tc"].as_f64()
    );
}

async fn command(page: &Page) -> Value {
    page.value("document.querySelector('#command').textContent")
        .await
}

/// Whether something on the page takes part in its layout.
fn is_shown(selector: &str) -> String {
    format!("document.querySelector('{selector}')?.checkVisibility() === true")
}

async fn positions_in_space_are_scored_and_plotted(browser: Browser) {
    let scene = Scene::new();
    let page = Page::open_in(browser).await;
    scene.pick(&page, &["truth.csv", "space.csv"]).await;
    let expected = scene.score("space.csv", &[]);
    assert_eq!(expected["tc"], json!(1.0));
    shows(&page, &expected).await;
    page.until_text("in the squared unit of the ground truth")
        .await;
    // A plot a coordinate; nothing is drawn into an image that nobody knows.
    for quantity in ["x", "y", "z", "error"] {
        let plot = format!(".plot-figure[data-quantity={quantity}]");
        page.until(&is_shown(&plot)).await;
        page.until(&format!(
            "document.querySelector('{plot}').dataset.empty === 'false'"
        ))
        .await;
    }
    page.until(&format!("!({})", is_shown("#stage"))).await;
    page.until_text("The ground truth is in space: its coordinates are plotted.")
        .await;
    assert_eq!(
        command(&page).await,
        "tracklens score --truth truth.csv --keypoints space.csv"
    );
    let map = "document.querySelector('.card[data-object=cube] .map').textContent";
    assert_eq!(
        page.value(&format!("/z = .*u.*v.*w/.test({map})")).await,
        json!(true)
    );

    // What is saved is what the command writes, and is shown again.
    let saved: Value =
        serde_json::from_slice(&page.saved("#save-evaluation").await).expect("an evaluation");
    assert_eq!(saved["schema"], "tracklens/evaluation/4");
    assert_eq!(saved["dimensions"], expected["dimensions"]);
    assert_eq!(saved["rank"], expected["rank"]);
    let file = scene.path("evaluation.json");
    fs::write(&file, saved.to_string()).expect("written");
    let report = String::from_utf8(page.saved("#save-report").await).expect("a page");
    assert!(report.contains("in space, in the squared unit of the ground truth"));
    assert!(report.contains("Of each object x, y and z"));
    page.start_over().await;
    page.pick(&[&file]).await;
    shows(&page, &expected).await;

    // Keypoints in the image say what they can of a position in space.
    page.start_over().await;
    scene.pick(&page, &["truth.csv", "pixels.csv"]).await;
    page.until_scored().await;
    let flat = scene.score("pixels.csv", &[]);
    shows(&page, &flat).await;
    page.until_text("the map is the best linear one from the image into space")
        .await;
    page.close().await;
}

async fn a_camera_puts_them_into_the_image(browser: Browser) {
    let scene = Scene::new();
    let page = Page::open_in(browser).await;
    let names = ["truth.csv", "pixels.csv", "camera.json"];
    scene.pick(&page, &names).await;
    page.until("document.querySelector('#files [data-role=camera][data-state=used]')")
        .await;
    // The images are as large as the camera says.
    page.value(
        "(() => { const unit = document.querySelector('#files [data-path=\"pixels.csv\"] select[name=space]'); \
         unit.value = 'px'; unit.dispatchEvent(new Event('change')); })()",
    )
    .await;
    let camera = text(&scene.path("camera.json"));
    let options = ["--camera", &camera, "--keypoints-space", "px"];
    let expected = scene.score("pixels.csv", &options);
    shows(&page, &expected).await;
    page.until(&is_shown("#stage")).await;
    page.until(&format!("!({})", is_shown(".plot-figure[data-quantity=z]")))
        .await;
    assert_eq!(
        command(&page).await,
        "tracklens score --truth truth.csv --keypoints pixels.csv --image-size 100x80 \
         --keypoints-space px --camera camera.json"
    );
    let saved: Value =
        serde_json::from_slice(&page.saved("#save-evaluation").await).expect("an evaluation");
    assert_eq!(saved["camera"], expected["camera"]);
    assert_eq!(saved["camera"]["projected"], json!(2 * SEQUENCES * FRAMES));

    // Everything in one file takes the camera along.
    let archive = scene.path("tracklens.zip");
    fs::write(&archive, page.saved("#save-replay").await).expect("written");
    page.start_over().await;
    page.pick(&[&archive]).await;
    shows(&page, &expected).await;

    // Without the camera the same ground truth is in space.
    page.click("#files [data-role=camera] [title=Remove]").await;
    page.until(&is_shown(".plot-figure[data-quantity=z]")).await;
    page.start_over().await;
    let broken = scene.path("broken.json");
    fs::write(
        &broken,
        r#"{"intrinsics": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}"#,
    )
    .expect("written");
    page.pick(&[&broken]).await;
    page.until_text("not the JSON of a camera").await;
    page.close().await;
}

async fn z_can_be_left_out(browser: Browser) {
    let scene = Scene::new();
    let page = Page::open_in(browser).await;
    scene.pick(&page, &["truth.csv", "space.csv"]).await;
    page.until_scored().await;
    for file in ["truth.csv", "space.csv"] {
        page.value(&format!(
            "(() => {{ const points = document.querySelector('#files [data-path=\"{file}\"] select[name=xyOnly]'); \
             points.value = 'true'; points.dispatchEvent(new Event('change')); }})()"
        ))
        .await;
        page.until(&format!(
            "document.querySelector('#files [data-path=\"{file}\"]').textContent.includes('ignored: z')"
        ))
        .await;
    }
    // Metres in the place of ndc look odd, which is asked about; they are right here.
    page.until(
        "document.querySelector('#results').dataset.tc !== undefined \
         || (document.querySelector('#doctor [data-remedy=none]')?.click(), false)",
    )
    .await;
    let expected = scene.score("space.csv", &["--xy-only"]);
    shows(&page, &expected).await;
    assert_eq!(
        command(&page).await,
        "tracklens score --truth truth.csv --keypoints space.csv --xy-only"
    );
    page.close().await;
}

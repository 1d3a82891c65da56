//! What can be dropped on the page, and what can be corrected then; against the `tracklens` command
//! on the same files.

use std::fs;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};

use serde_json::Value;
use tracklens_page_tests::{
    Browser, Page, eval, eval_example, example, extract_keypoints, in_every_browser, parsed, text,
    tracklens, tracklens_json,
};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

in_every_browser! {
    pixels_without_frames_ask_for_the_size_of_the_images
    pixels_of_frames_of_several_sizes_are_refused
    frames_in_which_a_keypoint_is_missing_are_counted
    a_table_in_another_unit_is_asked_about
    the_true_fault_of_a_file_is_named
    an_object_of_any_name_has_its_threshold
    a_sequence_of_loose_images_can_be_renamed
}

/// Relative, of errors: f32 convolutions differ in the last digits between native and WebAssembly
/// kernels.
const ERRORS: f64 = 1e-6;

/// Frames, ground truth and checkpoint of the example.
fn inputs() -> [String; 3] {
    ["frames", "ground_truth.csv", "checkpoint.safetensors"].map(|name| text(&example(name)))
}

fn evaluation_of_the_example() -> Value {
    parsed(&eval_example(&[]))
}

/// Files for an archive, by path.
type Files = Vec<(String, Vec<u8>)>;

fn files_of(folder: &Path, prefix: &str) -> Files {
    let mut files = Vec::new();
    let mut entries: Vec<PathBuf> = fs::read_dir(folder)
        .expect("a folder")
        .map(|e| e.expect("an entry").path())
        .collect();
    entries.sort();
    for path in entries {
        let name = format!(
            "{prefix}{}",
            path.file_name().expect("a name").to_string_lossy()
        );
        match path.is_dir() {
            true => files.extend(files_of(&path, &format!("{name}/"))),
            false => files.push((name, fs::read(&path).expect("a file"))),
        }
    }
    files
}

fn archive(files: &[(String, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, content) in files {
        zip.start_file(name, options).expect("an entry");
        zip.write_all(content).expect("written");
    }
    zip.finish().expect("an archive").into_inner()
}

/// A folder for the files of a test.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn put(&self, name: &str, content: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(&path, content).expect("written");
        path
    }
}

/// Chooses in the corrections of a file.
async fn correct(page: &Page, role: &str, name: &str, value: &str) {
    page.until(&format!(
        "document.querySelector('#files [data-role={role}] select[name={name}]')"
    ))
    .await;
    page.value(&format!(
        "(() => {{ const select = document.querySelector('#files [data-role={role}] select[name={name}]'); \
         select.value = '{value}'; select.dispatchEvent(new Event('change', {{ bubbles: true }})); }})()"
    ))
    .await;
}

/// The text of the page's list of files.
const FILES: &str = "document.querySelector('#files').textContent";

/// Enters the size of the images at the file that asks for it.
async fn enter_size(page: &Page, sides: [&str; 2]) {
    for (name, value) in ["width", "height"].iter().zip(sides) {
        page.value(&format!(
            "(() => {{ const field = document.querySelector('#files [name=image-{name}]'); field.value = '{value}'; \
             field.dispatchEvent(new Event('change', {{ bubbles: true }})); }})()"
        ))
        .await;
    }
}

async fn pixels_without_frames_ask_for_the_size_of_the_images(browser: Browser) {
    let folder = Folder::new();
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for t in 0..30 {
        let (s, c) = (f64::from(t) * 0.37).sin_cos();
        truth += &format!("a,{t},cube,{},{}\n", 160.0 + 100.0 * s, 100.0 + 60.0 * c);
        keypoints += &format!("a,{t},0,{},{}\n", 0.5 * c + 0.05 * s * s, -0.4 * s);
    }
    let [truth, keypoints] = [("gt.csv", truth), ("kp.csv", keypoints)]
        .map(|(name, table)| folder.put(name, table.as_bytes()));
    let page = Page::open_in(browser).await;
    page.pick(&[&truth, &keypoints]).await;
    page.until("document.querySelector('#doctor .question[data-problem=unit]')")
        .await;
    correct(&page, "ground-truth", "space", "px").await;
    page.until(
        "document.querySelector('#problems').textContent.includes('the size of the images is not known')",
    )
    .await;
    // The way to the field from there.
    page.click("#problems [data-problem='broken gt.csv'] button.link")
        .await;
    assert_eq!(
        page.value("document.activeElement.name").await,
        "image-width"
    );

    enter_size(&page, ["320", "0"]).await;
    page.until(
        "document.querySelector('.image-size .hint').textContent.startsWith('Expected whole numbers')",
    )
    .await;
    enter_size(&page, ["320", "200"]).await;
    page.until_scored().await;
    let [truth, keypoints] = [truth, keypoints].map(|path| path.to_string_lossy().into_owned());
    let arguments = [
        "score",
        "--truth",
        &truth,
        "--keypoints",
        &keypoints,
        "--space",
        "px",
        "--image-size",
        "320x200",
    ];
    let expected = tracklens_json(&arguments);
    page.until_errors(&expected, 1e-12).await;
    assert_eq!(
        page.value("document.querySelector('#problems').textContent")
            .await,
        ""
    );
    let command = page
        .value("document.querySelector('#command').textContent")
        .await;
    assert_eq!(
        command,
        "tracklens score --truth gt.csv --keypoints kp.csv --image-size 320x200 --space px"
    );
    // Another size is another score.
    enter_size(&page, ["320", "240"]).await;
    let other = expected["objects"][0]["error"].as_f64().expect("a number");
    page.until(&format!(
        "Math.abs(Number(document.querySelector('.card').dataset.error) - {other}) > 0.01 * {other}"
    ))
    .await;
    page.close().await;
}

async fn pixels_of_frames_of_several_sizes_are_refused(browser: Browser) {
    let folder = Folder::new();
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let photos = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/photos/seq_0000");
    let mut files = Vec::new();
    for t in 0..12 {
        // 128 x 128 pixels, and those of the example 256 x 256.
        let frame = match t {
            7 => photos.join("frame_004.png"),
            _ => example(&format!("frames/seq_0000/frame_{t:03}.png")),
        };
        let frame = fs::read(frame).expect("a frame");
        files.push(folder.put(&format!("frame_{t:03}.png"), &frame));
        truth += &format!(
            "walk,{t},cube,{},{}\n",
            40 + 10 * (t % 5),
            200 - 15 * (t % 4)
        );
    }
    files.push(folder.put("gt.csv", truth.as_bytes()));
    files.push(example("checkpoint.safetensors"));
    let page = Page::open_in(browser).await;
    let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    page.pick(&files).await;
    correct(&page, "ground-truth", "space", "px").await;
    page.until("document.querySelector('#problems').textContent.includes('several sizes (256 x 256 and 128 x 128 pixels)')")
        .await;
    assert_eq!(
        page.value("document.querySelector('#results').dataset.tc ?? null")
            .await,
        Value::Null
    );
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_archive_of_folders_and_of_archives_scores_as_the_folder() {
    let [_, truth, checkpoint] = inputs().map(PathBuf::from);
    let frames = files_of(&example("frames"), "deep/in/the/frames/");
    // Half of the files lie in an archive in the archive.
    let (first, second) = frames.split_at(frames.len() / 2);
    let inner = archive(first, CompressionMethod::Stored);
    let mut outer = second.to_vec();
    outer.push(("deep/in/the.zip".to_owned(), inner));
    outer.push((
        "tables/ground_truth.csv".to_owned(),
        fs::read(&truth).expect("a table"),
    ));
    outer.push(("__MACOSX/tables/._ground_truth.csv".to_owned(), vec![0; 20]));
    let folder = Folder::new();
    let zip = folder.put("run.zip", &archive(&outer, CompressionMethod::Deflated));
    let page = Page::open().await;
    page.pick(&[&zip, &checkpoint]).await;
    page.until_errors(&evaluation_of_the_example(), ERRORS)
        .await;
    let frames_shown = page
        .number("document.querySelector('#files [data-role=image]').dataset.frames")
        .await;
    assert_eq!(frames_shown, frames.len() as f64);
    page.until("document.querySelector('#stage').dataset.picture?.includes('run.zip/')")
        .await;
    // All that came out of it goes with it.
    page.value("document.querySelector('#files [data-role=archive] .icon-button').click()")
        .await;
    page.until("!document.querySelector('#files [data-role=image]')")
        .await;
    page.until("!document.querySelector('#files [data-role=ground-truth]')")
        .await;
    page.until("document.querySelector('#files [data-role=checkpoint][data-state=used]')")
        .await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn recordings_score_as_in_the_terminal_stored_and_packed() {
    let [frames, _, checkpoint] = inputs();
    let folder = Folder::new();
    let npz = folder.0.path().join("push.npz");
    tracklens(&[
        "data",
        "convert",
        &frames,
        &text(&npz),
        "--truth",
        &inputs()[1],
    ]);
    let expected = tracklens_json(&["eval", "--checkpoint", &checkpoint, "--frames", &text(&npz)]);
    let page = Page::open().await;
    page.pick(&[&npz, Path::new(&checkpoint)]).await;
    page.until_errors(&expected, ERRORS).await;
    page.until("document.querySelector('#stage').dataset.picture?.startsWith('push.npz/seq_')")
        .await;
    page.until(&format!("{FILES}.includes('assumed')")).await;

    // The same arrays packed, as np.savez_compressed does, and in an archive.
    let mut stored = ZipArchive::new(fs::File::open(&npz).expect("a file")).expect("an archive");
    let mut arrays = Files::new();
    for i in 0..stored.len() {
        let mut entry = stored.by_index(i).expect("an array");
        let mut content = Vec::new();
        std::io::copy(&mut entry, &mut content).expect("read");
        arrays.push((entry.name().to_owned(), content));
    }
    let packed = archive(&arrays, CompressionMethod::Deflated);
    let zip = archive(
        &[("in/packed.npz".to_owned(), packed)],
        CompressionMethod::Stored,
    );
    page.value("document.querySelector('#start-over').click()")
        .await;
    page.pick(&[&folder.put("recordings.zip", &zip), Path::new(&checkpoint)])
        .await;
    page.until_errors(&expected, ERRORS).await;

    // Points with their coordinates swapped score as the terminal's do.
    let swapped = tracklens_json(&[
        "eval",
        "--checkpoint",
        &checkpoint,
        "--frames",
        &text(&npz),
        "--axis-order",
        "yx",
    ]);
    correct(&page, "ground-truth", "axisOrder", "yx").await;
    page.until_errors(&swapped, ERRORS).await;

    // Frames that are not understood do not take the points with them.
    let broken: Files = arrays
        .iter()
        .map(|(name, content)| match name.as_str() {
            "images.npy" | "frames.npy" => (name.clone(), content[..content.len() - 10].to_vec()),
            _ => (name.clone(), content.clone()),
        })
        .collect();
    page.value("document.querySelector('#start-over').click()")
        .await;
    page.pick(&[&folder.put("cut.npz", &archive(&broken, CompressionMethod::Stored))])
        .await;
    page.until_text("is the file complete?").await;
    page.until("document.querySelector('#files [data-role=ground-truth][data-state=used]')")
        .await;
    page.close().await;
}

/// Points by frame, in pixels of images of 256 x 256.
struct Points {
    names: Vec<String>,
    /// Sequence, frame, and (x, y) of every name.
    rows: Vec<(String, u64, Vec<[f64; 2]>)>,
}

impl Points {
    /// Of a table in ndc with one row a point, which all frames have in one order.
    fn of(table: &str) -> Self {
        let (mut names, mut rows) = (Vec::new(), Vec::<(String, u64, Vec<[f64; 2]>)>::new());
        for line in table.lines().skip(1) {
            let fields: Vec<&str> = line.split(',').collect();
            let frame = fields[1].parse().expect("a frame");
            if !names.iter().any(|name| name == fields[2]) {
                names.push(fields[2].to_owned());
            }
            let px = |text: &str| (text.parse::<f64>().expect("a number") + 1.0) * 128.0 - 0.5;
            let point = [px(fields[3]), px(fields[4])];
            match rows.last_mut() {
                Some((sequence, last, points)) if *sequence == fields[0] && *last == frame => {
                    points.push(point);
                }
                _ => rows.push((fields[0].to_owned(), frame, vec![point])),
            }
        }
        Self { names, rows }
    }

    fn of_the_example() -> Self {
        Self::of(&fs::read_to_string(example("ground_truth.csv")).expect("a table"))
    }

    fn cells(points: &[[f64; 2]]) -> String {
        let cells: Vec<String> = points.iter().map(|[x, y]| format!("{x},{y}")).collect();
        cells.join(",")
    }

    /// As DeepLabCut's labels; of several animals where `individuals` are given, one for each name.
    fn deeplabcut(&self, individuals: &[&str]) -> String {
        let twice = |texts: &[&str]| {
            texts
                .iter()
                .map(|t| format!(",{t},{t}"))
                .collect::<String>()
        };
        let names: Vec<&str> = self.names.iter().map(String::as_str).collect();
        let scorer = twice(&vec!["me"; names.len()]);
        let axes = ",x,y".repeat(names.len());
        let mut out = format!("scorer{scorer}\n");
        if !individuals.is_empty() {
            out += &format!("individuals{}\n", twice(individuals));
        }
        out += &format!("bodyparts{}\ncoords{axes}\n", twice(&names));
        for (sequence, frame, points) in &self.rows {
            let cells = Self::cells(points);
            out += &format!("labeled-data/{sequence}/img{frame:03}.png,{cells}\n");
        }
        out
    }

    /// As COCO keypoints.
    fn coco(&self) -> String {
        let (mut images, mut annotations) = (Vec::new(), Vec::new());
        for (i, (sequence, frame, points)) in self.rows.iter().enumerate() {
            let name = format!("{sequence}/frame_{frame:03}.png");
            images.push(
                serde_json::json!({ "id": i, "file_name": name, "width": 256, "height": 256 }),
            );
            let keypoints: Vec<f64> = points.iter().flat_map(|[x, y]| [*x, *y, 2.0]).collect();
            annotations.push(serde_json::json!({
                "id": i, "image_id": i, "category_id": 1, "keypoints": keypoints, "num_keypoints": points.len(),
            }));
        }
        let categories = serde_json::json!([{ "id": 1, "name": "scene", "keypoints": self.names, "skeleton": [] }]);
        serde_json::json!({ "images": images, "annotations": annotations, "categories": categories })
            .to_string()
    }
}

/// The ground truth of the example with one row a frame, in pixels of 256 x 256, (y, x), frames
/// from 1.
fn odd_table() -> String {
    let Points { names, rows } = Points::of_the_example();
    let columns: Vec<String> = names.iter().map(|n| format!("{n}_x,{n}_y")).collect();
    let mut out = format!("sequence,frame,{}\n", columns.join(","));
    for (sequence, frame, points) in rows {
        let swapped: Vec<[f64; 2]> = points.iter().map(|[x, y]| [*y, *x]).collect();
        out += &format!("{sequence},{},{}\n", frame + 1, Points::cells(&swapped));
    }
    out
}

/// What the command gives that the page shows, run where the files are; with its words.
async fn repeated(page: &Page, files: &[(&str, &Path)]) -> (Value, String) {
    page.until("document.querySelector('#command')?.textContent")
        .await;
    let shown = page
        .value("document.querySelector('#command').textContent")
        .await;
    let shown = shown.as_str().expect("a command").to_owned();
    let words: Vec<String> = shown
        .split(' ')
        .skip(1)
        .map(|word| match files.iter().find(|(name, _)| *name == word) {
            Some((_, path)) => text(path),
            None => word.to_owned(),
        })
        .collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    (tracklens_json(&words), shown)
}

#[tokio::test(flavor = "multi_thread")]
async fn guesses_are_marked_and_can_be_corrected() {
    let [frames, _, checkpoint] = inputs();
    let folder = Folder::new();
    let odd = odd_table();
    let truth = folder.put("odd.csv", odd.as_bytes());
    let page = Page::open().await;
    // The table comes first, when the size of the images is not known.
    page.pick(&[&truth]).await;
    page.until("document.querySelector('#files [data-role=ground-truth] .guess')")
        .await;
    page.until_text("are these pixels?").await;
    correct(&page, "ground-truth", "space", "px").await;
    page.until_text("the size of the images is not known").await;
    page.pick_folder(Path::new(&frames)).await;
    page.until("document.querySelector('#files [data-role=ground-truth][data-state=used]')")
        .await;
    correct(&page, "ground-truth", "axisOrder", "yx").await;
    page.until("document.querySelector('#join').dataset.unmatchedRows > 0")
        .await;
    correct(&page, "ground-truth", "indexBase", "1").await;
    page.until("document.querySelector('#join').dataset.unmatchedRows === '0'")
        .await;
    let said = "[...document.querySelectorAll('#files [data-role=ground-truth] .choice')].map((c) => c.dataset.by).join()";
    page.until(&format!("{said} === 'guess,said,said,guess,guess,said'"))
        .await;
    page.pick(&[Path::new(&checkpoint)]).await;
    let expected = parsed(&eval(
        [Path::new(&checkpoint), Path::new(&frames), &truth],
        &["--space", "px", "--axis-order", "yx", "--index-base", "1"],
    ));
    page.until_errors(&expected, ERRORS).await;

    // The command that is shown has the corrections.
    let files = [
        ("odd.csv", &*truth),
        ("frames", Path::new(&frames)),
        ("checkpoint.safetensors", Path::new(&checkpoint)),
    ];
    let (again, command) = repeated(&page, &files).await;
    assert!(
        command.contains("--space px --axis-order yx --index-base 1"),
        "{command}"
    );
    assert_eq!(again["objects"], expected["objects"]);
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_repeats_what_was_corrected_in_both_tables() {
    let [frames, ..] = inputs();
    let folder = Folder::new();
    let truth = folder.put("odd.csv", odd_table().as_bytes());
    let keypoints = folder.0.path().join("kp.csv");
    extract_keypoints(Path::new(&frames), &keypoints);
    let page = Page::open().await;
    page.pick_folder(Path::new(&frames)).await;
    page.pick(&[&truth, &keypoints]).await;
    page.until("document.querySelector('#files [data-role=keypoints][data-state=used]')")
        .await;
    for (name, value) in [("space", "px"), ("axisOrder", "yx"), ("indexBase", "1")] {
        correct(&page, "ground-truth", name, value).await;
        page.until(&format!(
            "document.querySelector('#files [data-role=ground-truth] select[name={name}]')?.value === '{value}'"
        ))
        .await;
    }
    // Not every map takes up swapped axes.
    page.value("document.querySelector('#transform input[value=scale-translate]').click()")
        .await;
    let files = [("odd.csv", &*truth), ("kp.csv", &*keypoints)];
    for (axes, said) in [("xy", false), ("yx", true)] {
        if said {
            correct(&page, "keypoints", "axisOrder", axes).await;
        }
        page.until(&format!(
            "document.querySelector('#command')?.textContent.includes('--keypoints-axis-order {axes}')"
        ))
        .await;
        let (again, command) = repeated(&page, &files).await;
        for option in [
            "--space px --axis-order yx --index-base 1",
            "--image-size 256x256",
            "--transform scale-translate",
        ] {
            assert!(command.contains(option), "{option} in {command}");
        }
        page.until_errors(&again, 1e-12).await;
    }
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn deeplabcut_and_coco_score_as_the_tidy_table_and_as_in_the_terminal() {
    let [frames, _, checkpoint] = inputs();
    let folder = Folder::new();
    let points = Points::of_the_example();
    let same = evaluation_of_the_example();
    let page = Page::open().await;
    page.pick_folder(Path::new(&frames)).await;
    page.pick(&[Path::new(&checkpoint)]).await;
    for (name, table) in [
        ("labels.csv", points.deeplabcut(&[])),
        ("animals.csv", points.deeplabcut(&["single"; 3])),
        ("coco.json", points.coco()),
    ] {
        let file = folder.put(name, table.as_bytes());
        page.pick(&[&file]).await;
        page.until(&format!(
            "document.querySelector('#files [data-role=ground-truth]')?.dataset.path === '{name}'"
        ))
        .await;
        // That it is a ground truth is a guess; the unit is the layout's.
        let chosen =
            "document.querySelector('#files [data-role=ground-truth] select[name=space]').value";
        page.until(&format!("{chosen} === 'px'")).await;
        page.until("document.querySelector('#files [data-role=ground-truth] .guess')")
            .await;
        let expected = parsed(&eval(
            [Path::new(&checkpoint), Path::new(&frames), &file],
            &[],
        ));
        page.until_errors(&expected, ERRORS).await;
        for k in 0..3 {
            let [a, b] =
                [&expected, &same].map(|e| e["objects"][k]["error"].as_f64().expect("a number"));
            // Pixels and back cost some digits.
            assert!((a - b).abs() < 1e-9, "{name}: {a} {b}");
        }
        page.click("#files [data-role=ground-truth] .icon-button")
            .await;
        page.until("!document.querySelector('#files [data-role=ground-truth]')")
            .await;
    }
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn keypoints_of_deeplabcut_and_coco_score_as_in_the_terminal() {
    let [frames, truth, _] = inputs();
    let folder = Folder::new();
    let tidy = folder.0.path().join("kp.csv");
    let points = Points::of(&extract_keypoints(Path::new(&frames), &tidy));
    let page = Page::open().await;
    page.pick_folder(Path::new(&frames)).await;
    page.pick(&[Path::new(&truth)]).await;
    page.until("document.querySelector('#files [data-role=ground-truth][data-state=used]')")
        .await;
    for (name, table) in [
        ("detector.csv", points.deeplabcut(&[])),
        ("detector.json", points.coco()),
    ] {
        let file = folder.put(name, table.as_bytes());
        page.pick(&[&file]).await;
        // Taken for another ground truth, until somebody says otherwise.
        page.until("document.querySelector('#files [data-state=spare]')")
            .await;
        page.value(
            "(() => { const select = document.querySelector('#files [data-state=spare] select[name=role]'); \
             select.value = 'keypoints'; select.dispatchEvent(new Event('change', { bubbles: true })); })()",
        )
        .await;
        let expected = tracklens_json(&[
            "score",
            "--truth",
            &truth,
            "--keypoints",
            &text(&file),
            "--image-size",
            "256x256",
        ]);
        page.until_errors(&expected, 1e-12).await;
        page.click("#files [data-role=keypoints] .icon-button")
            .await;
        page.until("!document.querySelector('#files [data-role=keypoints]')")
            .await;
    }
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_table_taken_for_the_wrong_thing_gets_another_role() {
    let folder = Folder::new();
    let (mut truth, mut keypoints) = (
        String::from("frame,cube_x,cube_y\n"),
        String::from("frame,a_x,a_y,b_x,b_y\n"),
    );
    for t in 0..40 {
        let (s, c) = (f64::from(t) * 0.37).sin_cos();
        truth += &format!("{t},{},{}\n", 0.5 * s, 0.5 * c);
        keypoints += &format!(
            "{t},{},{},{},{}\n",
            0.3 * c + 0.1,
            -s,
            s * s * s,
            0.2 * c * s
        );
    }
    let truth = folder.put("truth/push.csv", truth.as_bytes());
    let keypoints = folder.put("detector/push.csv", keypoints.as_bytes());
    let page = Page::open().await;
    page.pick(&[&truth]).await;
    page.until("document.querySelector('#files [data-role=ground-truth][data-state=used]')")
        .await;
    page.pick(&[&folder.put("detector.csv", &fs::read(&keypoints).expect("a table"))])
        .await;
    page.until("document.querySelector('#files [data-state=spare]')")
        .await;
    page.value(
        "(() => { const select = document.querySelector('#files [data-state=spare] select[name=role]'); \
         select.value = 'keypoints'; select.dispatchEvent(new Event('change', { bubbles: true })); })()",
    )
    .await;
    let expected = tracklens_json(&[
        "score",
        "--truth",
        &text(&truth),
        "--keypoints",
        &text(&keypoints),
    ]);
    page.until_errors(&expected, 1e-12).await;

    // Put away, and taken back.
    correct(&page, "keypoints", "role", "unknown").await;
    page.until("document.querySelector('#missing:not([hidden])')")
        .await;
    page.value(
        "(() => { const select = document.querySelector('#files [data-role=unknown] select[name=role]'); \
         select.value = 'keypoints'; select.dispatchEvent(new Event('change', { bubbles: true })); })()",
    )
    .await;
    page.until("document.querySelector('#missing[hidden]')")
        .await;
    page.until_errors(&expected, 1e-12).await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn files_are_replaced_and_removed_without_starting_over() {
    let [_, truth, checkpoint] = inputs();
    let folder = Folder::new();
    for (name, content) in files_of(&example("frames"), "frames/") {
        folder.put(&name, &content);
    }
    let page = Page::open().await;
    page.pick_folder(&folder.0.path().join("frames")).await;
    page.pick(&[Path::new(&truth), Path::new(&checkpoint)])
        .await;
    page.until_errors(&evaluation_of_the_example(), ERRORS)
        .await;

    // A corrected table under the same name takes the place of the first at once.
    let other: String = fs::read_to_string(&truth)
        .expect("a table")
        .lines()
        .filter(|line| !line.contains(",eef,"))
        .map(|line| format!("{line}\n"))
        .collect();
    page.pick(&[&folder.put("ground_truth.csv", other.as_bytes())])
        .await;
    page.until("document.querySelectorAll('.card').length === 2")
        .await;
    page.until_text("replaces the earlier file of the same path")
        .await;

    // A sequence is removed from the list, and the rest scored without extracting anything again.
    let matched = page
        .number("document.querySelector('#join').dataset.matched")
        .await;
    page.value("document.querySelector('[data-key=sequences] summary').click()")
        .await;
    page.until("document.querySelector('[data-key=sequences] .row .icon-button')")
        .await;
    page.value("document.querySelector('[data-key=sequences] .row .icon-button').click()")
        .await;
    page.until(&format!(
        "document.querySelector('#join').dataset.matched < {matched}"
    ))
    .await;
    page.until_scored().await;
    // The rows that lost their frames are listed, all of them.
    page.value("document.querySelector('[data-key=\"unmatched rows\"] summary').click()")
        .await;
    page.until("document.querySelector('[data-key=\"unmatched rows\"] .row .row-detail')?.textContent.startsWith('0–')")
        .await;

    // Other images under the same paths: told, and undone.
    let name = files_of(&example("frames"), "frames/")
        .pop()
        .expect("an image")
        .0;
    let images = files_of(&example("frames"), "frames/");
    folder.put(&name, &images[0].1);
    page.pick_folder(&folder.0.path().join("frames")).await;
    page.until_text("replaced earlier images of the same path")
        .await;
    page.value("document.querySelector('#problems [data-problem=replaced] button.link').click()")
        .await;
    page.until("!document.querySelector('#problems [data-problem=replaced]')")
        .await;
    page.until_scored().await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_archives_are_told_and_what_is_good_in_them_is_kept() {
    let folder = Folder::new();
    let [_, truth, _] = inputs();
    let truth = fs::read(truth).expect("a table");
    let page = Page::open().await;

    // A bomb: 128 MB of nothing. The table beside it is used.
    let files = [
        ("bomb.csv".to_owned(), vec![0; 128 << 20]),
        ("ground_truth.csv".to_owned(), truth.clone()),
    ];
    page.pick(&[&folder.put("bomb.zip", &archive(&files, CompressionMethod::Deflated))])
        .await;
    page.until_text("as a ZIP bomb does; expected at most 400 times")
        .await;
    page.until("document.querySelector('#files [data-role=ground-truth][data-state=used]')")
        .await;

    // Too many archives around it.
    let mut nested = archive(
        &[("ground_truth.csv".to_owned(), truth.clone())],
        CompressionMethod::Stored,
    );
    for _ in 0..3 {
        nested = archive(
            &[("inner.zip".to_owned(), nested)],
            CompressionMethod::Deflated,
        );
    }
    page.pick(&[&folder.put("nested.zip", &nested)]).await;
    page.until_text("nested in 3 other archives; expected at most 2")
        .await;

    // Cut short, and damaged inside.
    let mut whole = archive(
        &[("kp.csv".to_owned(), truth.clone())],
        CompressionMethod::Deflated,
    );
    page.pick(&[&folder.put("cut.zip", &whole[..whole.len() - 30])])
        .await;
    page.until_text("its directory, at the end, is missing")
        .await;
    for byte in &mut whole[60..120] {
        *byte ^= 0x55;
    }
    page.pick(&[&folder.put("damaged.zip", &whole)]).await;
    page.until_text("damaged.zip/kp.csv cannot be unpacked")
        .await;

    // Two entries of the same path.
    let mut twice = archive(
        &[
            ("one/gt.csv".to_owned(), truth.clone()),
            ("two/gt.csv".to_owned(), truth),
        ],
        CompressionMethod::Stored,
    );
    let at: Vec<usize> = twice
        .windows(7)
        .enumerate()
        .filter(|(_, w)| w == b"two/gt.")
        .map(|(i, _)| i)
        .collect();
    for start in at {
        twice[start..start + 3].copy_from_slice(b"one");
    }
    page.pick(&[&folder.put("twice.zip", &twice)]).await;
    page.until_text("had the same path as another file in the drop: twice.zip/one/gt.csv")
        .await;

    // No archive at all, by its content.
    page.pick(&[&folder.put("text.zip", b"sequence,frame")])
        .await;
    page.until_text("text.zip: not a whole ZIP archive").await;
    page.close().await;
}

/// Makes a video of a sequence of the example in the page, and drops it there.
const DROP_VIDEO: &str = "(async () => { \
  const { BufferTarget, CanvasSource, Output, WebMOutputFormat } = await import('./vendor/mediabunny.js'); \
  const target = new BufferTarget(); \
  const output = new Output({ format: new WebMOutputFormat(), target }); \
  const canvas = new OffscreenCanvas(256, 256); \
  const context = canvas.getContext('2d'); \
  const source = new CanvasSource(canvas, { codec: 'vp8', bitrate: 8e6 }); \
  output.addVideoTrack(source, { frameRate: 10 }); \
  await output.start(); \
  const { fetchExample } = await import(new URL('files/example.js', location.href)); \
  const { sources } = await fetchExample(() => {}); \
  const images = sources.filter(({ path }) => path.startsWith('frames/seq_0002/')); \
  for (const [i, { blob }] of images.entries()) { \
    context.drawImage(await createImageBitmap(blob), 0, 0); \
    await source.add(i / 10, 0.1); \
  } \
  await output.finalize(); \
  globalThis.__video = new File([target.buffer], 'seq_0002.webm'); \
})().catch((error) => { globalThis.__complaints.push(String(error)); }), null";

const PICK_VIDEO: &str = "(() => { \
  const transfer = new DataTransfer(); \
  transfer.items.add(globalThis.__video); \
  const input = document.querySelector('#input-files'); \
  input.files = transfer.files; \
  input.dispatchEvent(new Event('change')); })()";

#[tokio::test(flavor = "multi_thread")]
async fn a_video_is_read_by_frame_and_one_that_cannot_be_decoded_is_told() {
    let [_, truth, checkpoint] = inputs();
    let page = Page::open().await;
    page.value(DROP_VIDEO).await;
    page.until("globalThis.__video || globalThis.__complaints.length")
        .await;
    page.value(PICK_VIDEO).await;
    page.until("document.querySelector('#files [data-role=image]')?.dataset.frames === '24'")
        .await;
    page.pick(&[Path::new(&truth), Path::new(&checkpoint)])
        .await;
    page.until_scored().await;
    let card = "document.querySelector('.card').dataset.frames";
    assert_eq!(page.number(card).await, 24.0);
    let matched = page
        .number("document.querySelector('#join').dataset.matched")
        .await;
    assert_eq!(matched, 24.0);
    page.until("document.querySelector('#stage').dataset.picture === 'seq_0002/frame_000000'")
        .await;
    // Its frames are those it was made of, but for what packing them lost.
    let folder = Folder::new();
    for (name, content) in files_of(&example("frames/seq_0002"), "frames/seq_0002/") {
        folder.put(&name, &content);
    }
    let frames = text(&folder.0.path().join("frames"));
    let expected = parsed(&eval(
        [
            Path::new(&checkpoint),
            Path::new(&frames),
            Path::new(&truth),
        ],
        &[],
    ));
    let eef = expected["objects"]
        .as_array()
        .expect("objects")
        .iter()
        .find(|o| o["name"] == "eef");
    let error = eef.and_then(|o| o["error"].as_f64()).expect("an error");
    let shown = page
        .number("document.querySelector('.card[data-object=eef]').dataset.error")
        .await;
    assert!(
        (shown - error).abs() < 0.3 * error + 1e-3,
        "{shown} of the video, {error} of its frames"
    );

    // The same video in a browser that has no decoder for it, and something that is none.
    page.value(
        "(() => { VideoDecoder.isConfigSupported = async (config) => ({ supported: false, config }); })()",
    )
    .await;
    page.value(PICK_VIDEO).await;
    page.until_text("which this browser cannot decode. Convert it")
        .await;
    page.pick(&[&folder.put("none.mp4", &[7; 4000])]).await;
    page.until_text("none.mp4 is not a whole video").await;
    // What was decoded ahead is given back without a complaint.
    page.start_over().await;
    page.until("document.querySelector('main').dataset.state === 'empty'")
        .await;
    page.close().await;
}

/// Ground truth of an object, and two keypoints near it; one of them is missing in a frame.
fn tables_with_a_gap(object: &str) -> [String; 2] {
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for t in 0..40 {
        let (s, c) = (f64::from(t) * 0.37).sin_cos();
        truth += &format!("a,{t},{object},{},{}\n", 0.5 * s, 0.4 * c);
        for k in 0..2 {
            if (t, k) != (3, 1) {
                let off = 0.02 * f64::from(k) * (f64::from(t) * 2.3).sin();
                keypoints += &format!("a,{t},{k},{},{}\n", 0.5 * s + off, 0.4 * c);
            }
        }
    }
    [truth, keypoints]
}

/// Drops the tables.
async fn score_with_a_gap(page: &Page, folder: &Folder, object: &str) {
    let [truth, keypoints] = tables_with_a_gap(object);
    let truth = folder.put("truth.csv", truth.as_bytes());
    let keypoints = folder.put("keypoints.csv", keypoints.as_bytes());
    page.pick(&[&truth, &keypoints]).await;
    page.until_scored().await;
}

async fn frames_in_which_a_keypoint_is_missing_are_counted(browser: Browser) {
    let folder = Folder::new();
    let page = Page::open_in(browser).await;
    score_with_a_gap(&page, &folder, "cube").await;
    page.until_text("missing in some of 40 frames").await;
    page.until("!document.querySelector('#problems').firstChild")
        .await;
    page.close().await;
}

async fn a_table_in_another_unit_is_asked_about(browser: Browser) {
    let folder = Folder::new();
    let mut truth = String::from("sequence,frame,object,x,y\n");
    for t in 0..40 {
        let (s, c) = (f64::from(t) * 0.37).sin_cos();
        truth += &format!("a,{t},cube,{},{}\n", 128.0 + 50.0 * s, 128.0 + 40.0 * c);
    }
    let page = Page::open_in(browser).await;
    page.pick(&[&folder.put("truth.csv", truth.as_bytes())])
        .await;
    page.until_text("truth.csv: its coordinates look like pixels")
        .await;
    page.click("#problems [data-problem='reading truth.csv'] button.link")
        .await;
    page.until("document.querySelector('#files [data-role=ground-truth] [name=image-width]')")
        .await;
    page.close().await;
}

async fn the_true_fault_of_a_file_is_named(browser: Browser) {
    let folder = Folder::new();
    let [truth, _] = tables_with_a_gap("cube");
    let utf16: Vec<u8> = [0xfeff]
        .into_iter()
        .chain(truth.encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    let page = Page::open_in(browser).await;
    for (name, content, fault) in [
        (
            "wide.csv",
            utf16,
            "wide.csv is text in UTF-16; save it as UTF-8",
        ),
        ("nothing.csv", Vec::new(), "nothing.csv is empty"),
    ] {
        page.pick(&[&folder.put(name, &content)]).await;
        page.until_text(fault).await;
        page.start_over().await;
    }
    page.close().await;
}

async fn an_object_of_any_name_has_its_threshold(browser: Browser) {
    let folder = Folder::new();
    let page = Page::open_in(browser).await;
    score_with_a_gap(&page, &folder, "__proto__").await;
    let threshold = "document.querySelector('.card').dataset.threshold";
    let default = page.value(threshold).await;
    let field = "document.querySelector('.card input[type=number]')";
    assert_eq!(page.value(&format!("{field}.value")).await, default);
    page.value(&format!(
        "({field}.value = '0.5', {field}.dispatchEvent(new Event('input')), true)"
    ))
    .await;
    page.until(&format!("{threshold} === '0.5'")).await;
    page.click(".card .threshold .link").await;
    page.until(&format!("{threshold} === {default}")).await;
    page.close().await;
}

async fn a_sequence_of_loose_images_can_be_renamed(browser: Browser) {
    let folder = Folder::new();
    let frames = files_of(&example("frames"), "");
    let images: Vec<PathBuf> = frames[..2]
        .iter()
        .enumerate()
        .map(|(t, (_, content))| folder.put(&format!("frame_{t}.png"), content))
        .collect();
    let page = Page::open_in(browser).await;
    page.pick(&[&images[0], &images[1]]).await;
    page.until("document.querySelector('#files [data-role=image]')")
        .await;
    let summary = "document.querySelector('#files [data-key=sequences] summary')";
    page.value(&format!("{summary}.click()")).await;
    let field = "document.querySelector('#files input.row-name')";
    page.until(field).await;
    page.value(&format!(
        "({field}.value = 'seq_7', {field}.dispatchEvent(new Event('change')), true)"
    ))
    .await;
    page.until(&format!("{field}?.value === 'seq_7'")).await;
    page.until("document.querySelector('#files [data-role=image] .file-name').textContent.startsWith('seq_7/')")
        .await;
    page.close().await;
}

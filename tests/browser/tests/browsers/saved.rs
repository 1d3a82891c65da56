//! Evaluations that were saved and are dropped again: what the page shows of them, against the
//! files themselves.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tracklens_page_tests::{Page, eval_example, example, parsed};

/// Writes what `tracklens eval` makes of the example; `more` options.
fn save(folder: &Path, name: &str, more: &[&str]) -> (PathBuf, Value) {
    let printed = eval_example(more);
    let file = folder.join(name);
    fs::write(&file, &printed).expect("written");
    (file, parsed(&printed))
}

/// The value of an expression for every element that a selector finds.
async fn each(page: &Page, selector: &str, expression: &str) -> Vec<String> {
    let script =
        format!("[...document.querySelectorAll('{selector}')].map((e) => String({expression}))");
    serde_json::from_value(page.value(&script).await).expect("texts")
}

async fn until_compared(page: &Page, complete: usize) {
    page.until(&format!(
        "document.querySelector('#comparison').dataset.complete === '{complete}'"
    ))
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_saved_evaluation_is_shown_with_all_that_it_holds() {
    let folder = tempfile::tempdir().expect("a folder");
    let more = [
        "--sequences",
        "--context",
        "--folds",
        "4",
        "--bootstrap",
        "100",
        "--threshold",
        "cube=0.004",
    ];
    let (file, saved) = save(folder.path(), "evaluation.json", &more);
    let page = Page::open().await;
    page.pick(&[&file]).await;
    page.until_scored().await;
    page.until("document.querySelector('#files [data-role=result]')?.dataset.state === 'used'")
        .await;

    // TC and cards.
    let shown = page
        .number("document.querySelector('.tc-value').dataset.tc")
        .await;
    assert_eq!(json!(shown), saved["tc"]);
    let held_out = saved["held_out"]["tc"].as_f64().expect("a number");
    page.until(&format!(
        "document.querySelector('#tc-interval').textContent.includes('(4 folds): {held_out:.2}')"
    ))
    .await;
    let objects = saved["objects"].as_array().expect("objects");
    for (key, field) in [
        ("error", "error"),
        ("threshold", "threshold"),
        ("rmse", "rmse"),
    ] {
        let found = each(&page, ".card", &format!("e.dataset.{key}")).await;
        for (found, object) in found.iter().zip(objects) {
            assert_eq!(
                json!(found.parse::<f64>().expect("a number")),
                object[field],
                "{key}"
            );
        }
        assert_eq!(found.len(), objects.len());
    }
    page.until("document.querySelector('#tc-interval').textContent.includes('95 %')")
        .await;
    page.until("document.querySelector('.card .error-interval').textContent.includes('95 %')")
        .await;

    // The matrix, the curve, the sequences, what others measure, the command.
    let keypoints = saved["errors"][0].as_array().expect("errors").len();
    page.until(&format!(
        "document.querySelectorAll('#errors [role=gridcell]').length === {}",
        keypoints * objects.len()
    ))
    .await;
    page.until("document.querySelector('#capability svg')")
        .await;
    page.until("document.querySelector('#sequences svg')").await;
    let worst = &saved["sequences"][0]["errors"][0];
    let listed = each(
        &page,
        "#worst-sequences li",
        "e.firstElementChild.textContent",
    )
    .await;
    assert_eq!(json!(listed[0]), worst["sequence"]);
    assert_eq!(
        page.value("document.querySelectorAll('#worst-sequences button').length")
            .await,
        json!(0)
    );
    page.value("document.querySelector('#context summary').click()")
        .await;
    page.until("document.querySelectorAll('#context table').length === 2")
        .await;
    assert_eq!(
        page.value("document.querySelector('#command').textContent")
            .await,
        saved["command"]
    );

    // What is not in the file is not there, and the page says so.
    page.until_text("Frames, trajectories and keypoints are in no such file")
        .await;
    for hidden in ["#viewer", "#missing", "#comparison"] {
        assert_eq!(
            page.value(&format!("document.querySelector('{hidden}').hidden"))
                .await,
            json!(true),
            "{hidden}"
        );
    }
    for none in ["#transform", "#save-keypoints", ".threshold"] {
        assert_eq!(
            page.value(&format!("document.querySelector('{none}')"))
                .await,
            json!(null),
            "{none}"
        );
    }
    // A cell says what it is, and shows nothing else.
    page.value(
        "document.querySelector('#errors [data-object=\"1\"][data-keypoint=\"1\"]').click()",
    )
    .await;
    page.until("document.querySelector('#choose-best').hidden")
        .await;

    // Saved again it is the same.
    page.value(
        "(() => { window.__saved = null; const make = URL.createObjectURL; \
         URL.createObjectURL = (blob) => { blob.text().then((t) => { window.__saved = t; }); return make.call(URL, blob); }; \
         HTMLAnchorElement.prototype.click = () => {}; })()",
    )
    .await;
    page.click("#save-evaluation").await;
    page.until("window.__saved !== null").await;
    let again = page.value("window.__saved").await;
    let again: Value = serde_json::from_str(again.as_str().expect("a text")).expect("JSON");
    // JavaScript writes 1 for 1.0.
    for key in ["tc", "frames"] {
        assert_eq!(again[key].as_f64(), saved[key].as_f64());
    }
    for key in ["errors", "sequences", "command", "join"] {
        assert_eq!(again[key], saved[key], "{key}");
    }

    // Frames, a checkpoint and a ground truth come: their score takes its place, and comes to stand
    // beside it.
    page.pick_folder(&example("frames")).await;
    page.pick(&[
        &example("checkpoint.safetensors"),
        &example("ground_truth.csv"),
    ])
    .await;
    page.until("!document.querySelector('#viewer').hidden")
        .await;
    page.until("document.querySelector('#transform')").await;
    page.until_text("Saved evaluation, not shown").await;
    until_compared(&page, 2).await;
    // Without them it is back.
    page.click("#files [data-role=ground-truth] .icon-button")
        .await;
    page.until("document.querySelector('#viewer').hidden").await;
    page.until_text("Frames, trajectories and keypoints are in no such file")
        .await;
    page.click("#files [data-role=result] .icon-button").await;
    page.until("document.querySelector('#results').hidden")
        .await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn several_saved_evaluations_are_compared() {
    let folder = tempfile::tempdir().expect("a folder");
    let (first, saved) = save(folder.path(), "ours_1.json", &[]);
    // Another detector: twice the errors, and nothing tracked.
    let mut other = saved.clone();
    other["tc"] = json!(0.0);
    for object in other["objects"].as_array_mut().expect("objects") {
        object["error"] = json!(2.0 * object["error"].as_f64().expect("a number"));
        object["tracked"] = json!(false);
    }
    let second = folder.path().join("theirs_1.json");
    fs::write(&second, other.to_string()).expect("written");
    let (third, identity) = save(folder.path(), "plain.json", &["--transform", "identity"]);

    let page = Page::open().await;
    page.pick(&[&first, &second]).await;
    until_compared(&page, 2).await;
    let rows = |table: &str| {
        let script = format!(
            "[...document.querySelectorAll('#{table} tbody tr')].map((r) => [...r.cells].map((c) => c.textContent))"
        );
        let page = &page;
        async move {
            serde_json::from_value::<Vec<Vec<String>>>(page.value(&script).await).expect("a table")
        }
    };
    let runs = rows("run-table").await;
    for (name, evaluation) in [("ours_1.json", &saved), ("theirs_1.json", &other)] {
        let row = runs.iter().find(|row| row[0] == name).expect("a run");
        for (k, object) in evaluation["objects"]
            .as_array()
            .expect("objects")
            .iter()
            .enumerate()
        {
            let error = object["error"].as_f64().expect("a number");
            let found: f64 = row[6 + k].parse().expect("a number");
            // Four decimals are shown.
            assert!(
                (found - error).abs() <= 0.5e-4 + f64::EPSILON,
                "{name}: {found} {error}"
            );
        }
    }
    let groups: Vec<String> = rows("only-errors-table")
        .await
        .iter()
        .map(|row| row[0].clone())
        .collect();
    assert_eq!(groups, ["ours", "theirs"]);

    // One of them is shown above, the other one when it is asked for.
    let tc = |evaluation: &Value| {
        format!(
            "document.querySelector('#results').dataset.tc === '{}'",
            evaluation["tc"].as_f64().expect("a number")
        )
    };
    page.until(&tc(&saved)).await;
    page.click("#files [data-path='theirs_1.json'] button.link")
        .await;
    page.until(&tc(&other)).await;

    // Under another map errors are no longer the same thing.
    page.pick(&[&third]).await;
    page.until_text("one is scored under the map affine, the other under identity")
        .await;
    until_compared(&page, 2).await;
    page.click("#files [data-path='plain.json'] button.link")
        .await;
    page.until(&tc(&identity)).await;
    page.until_text("Keypoints are scored as they are, without a fitted map")
        .await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_result_that_cannot_be_read_says_why_and_leaves_the_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let (good, saved) = save(folder.path(), "good.json", &[]);
    let put = |name: &str, content: String| {
        let file = folder.path().join(name);
        fs::write(&file, content).expect("written");
        file
    };
    let newer = saved
        .to_string()
        .replace("tracklens/evaluation/3", "tracklens/evaluation/9");
    let cut = saved.to_string();
    let files = [
        put("newer.json", newer),
        put("cut.json", cut[..cut.len() / 2].to_owned()),
        put(
            "report.json",
            r#"{ "schema": "tracklens/report/1", "groups": [] }"#.to_owned(),
        ),
    ];
    let page = Page::open().await;
    page.pick(&[&files[0]]).await;
    page.until_text("the evaluation has the schema tracklens/evaluation/9")
        .await;
    page.until_text(
        "reads up to tracklens/evaluation/4. Use the version of tracklens that wrote it",
    )
    .await;
    page.pick(&[&files[1], &files[2], &good]).await;
    page.until_scored().await;
    page.until_text("cut.json: not the JSON of an evaluation")
        .await;
    page.until_text("expected the folders of the runs, or their evaluations")
        .await;
    let state = |name: &str| {
        format!("document.querySelector('#files [data-path=\"{name}\"]').dataset.state")
    };
    for (name, expected) in [
        ("newer.json", "broken"),
        ("cut.json", "broken"),
        ("report.json", "unknown"),
        ("good.json", "used"),
    ] {
        assert_eq!(page.value(&state(name)).await, expected, "{name}");
    }
    page.close().await;
}

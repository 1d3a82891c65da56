//! Runs side by side in the page, against `tracklens report` and `tracklens score` on the same
//! files.

use std::fs;
use std::io::{Cursor, Write};

use crate::agent_runs::{fixture, write_agent, write_agents};
use crate::runs::{config, sweep, write_run};
use serde_json::{Value, json};
use tracklens_page_tests::{
    Browser, EXAMPLE_FRAMES, Page, example, extract_keypoints, in_every_browser, text, tracklens,
    tracklens_json,
};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

in_every_browser! {
    a_checkpoint_on_the_example_is_compared_with_its_own_one_by_one
}

/// Keeps what the page saves.
const KEEP: &str = "
  globalThis.__saved = {};
  const make = URL.createObjectURL;
  URL.createObjectURL = (blob) => { globalThis.__blob = blob; return make.call(URL, blob); };
  HTMLAnchorElement.prototype.click = function () { globalThis.__saved[this.download] = globalThis.__blob; };
";

async fn until_compared(page: &Page, complete: usize) {
    page.until(&format!(
        "document.querySelector('#comparison').dataset.complete === '{complete}'"
    ))
    .await;
}

/// The text of the rows of a table, cell by cell.
async fn rows(page: &Page, table: &str) -> Vec<Vec<String>> {
    let script = format!(
        "[...document.querySelectorAll('#{table} tbody tr')].map((r) => [...r.cells].map((c) => c.textContent))"
    );
    serde_json::from_value(page.value(&script).await).expect("a table")
}

/// What the page saved under a name.
async fn saved(page: &Page, name: &str) -> String {
    page.until(&format!("globalThis.__saved['{name}']")).await;
    let read =
        format!("(globalThis.__saved['{name}'].text().then((t) => globalThis.__text = t), true)");
    page.value(&format!("(globalThis.__text = null, {read})"))
        .await;
    page.until("globalThis.__text !== null").await;
    page.value("globalThis.__text")
        .await
        .as_str()
        .expect("a text")
        .to_owned()
}

/// Numbers without the names of runs, which are paths in the terminal.
fn numbers(mut report: Value) -> Value {
    for group in report["groups"].as_array_mut().expect("groups") {
        for key in ["runs", "incomplete"] {
            for run in group[key].as_array_mut().expect("runs") {
                run["name"] = json!(null);
            }
        }
    }
    fn as_floats(value: &mut Value) {
        match value {
            // JavaScript writes 1 for 1.0.
            Value::Number(number) => *value = json!(number.as_f64()),
            Value::Array(values) => values.iter_mut().for_each(as_floats),
            Value::Object(values) => values.values_mut().for_each(as_floats),
            _ => {}
        }
    }
    as_floats(&mut report);
    report["unread"] = json!(report["unread"].as_array().map(Vec::len));
    report
}

#[tokio::test(flavor = "multi_thread")]
async fn folders_of_runs_compare_as_in_the_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    sweep(&runs);
    // One failed, one whose log breaks off, one that cannot be read.
    let failed = runs.join("basic/seed-05.partial");
    write_run(&failed, "basic", 5, 4);
    fs::remove_file(failed.join("summary.json")).expect("removed");
    fs::write(failed.join("error.txt"), "the loss is not a number\n").expect("written");
    let cut = runs.join("basic/seed-00/log.jsonl");
    let log = fs::read(&cut).expect("a log");
    fs::write(&cut, &log[..log.len() - 20]).expect("written");
    let damaged = runs.join("dsae/seed-00");
    write_run(&damaged, "dsae", 0, 4);
    fs::write(damaged.join("config.json"), "{").expect("written");
    // What else lies in the folder of a run is none of the page's checkpoints.
    fs::write(
        runs.join("basic/seed-01/checkpoint_final.safetensors"),
        "weights",
    )
    .expect("written");
    tracklens(&["report", &text(&runs), "--out", &text(&out)]);
    let report: Value =
        serde_json::from_slice(&fs::read(out.join("report.json")).expect("a report"))
            .expect("JSON");

    let page = Page::open_with(KEEP).await;
    page.pick_folder(&runs).await;
    until_compared(&page, 9).await;
    assert_eq!(
        page.value("document.querySelectorAll('#files > *').length")
            .await,
        json!(0)
    );
    let dropped = page
        .value("document.querySelector('#runs-dropped').textContent")
        .await;
    let dropped = dropped.as_str().expect("a text");
    for said in [
        "3 runs that do not count",
        "runs/basic/seed-05.partial: it failed: the loss is not a number, after epoch 4 of 4",
        "runs/basic/seed-00: its log breaks off (line 4",
        "runs/dsae/seed-00: config.json cannot be read",
    ] {
        assert!(dropped.contains(said), "{said} in {dropped}");
    }
    let shown = rows(&page, "capability-table").await;
    for (row, group) in shown
        .iter()
        .zip(report["groups"].as_array().expect("groups"))
    {
        assert_eq!(row[0], group["name"].as_str().expect("a name"));
        let number = |value: &Value| value.as_f64().expect("a number");
        let [low, high] = [0, 1].map(|end| number(&group["tc_interval"][end]));
        assert_eq!(
            row[3],
            format!("{:.3} {low:.3}–{high:.3}", number(&group["tc"]))
        );
    }
    assert_eq!(shown.len(), 2);

    // All numbers, and the figures as documents: the same code made them.
    page.click("#save-runs-json").await;
    let own: Value = serde_json::from_str(&saved(&page, "report.json").await).expect("JSON");
    assert_eq!(numbers(own), numbers(report));
    for name in [
        "boxplots",
        "tracking-capability",
        "errors-basic",
        "reconstruction-loss",
    ] {
        page.click(&format!("[data-save='{name}.svg']")).await;
        let svg = saved(&page, &format!("{name}.svg")).await;
        assert_eq!(
            svg,
            fs::read_to_string(out.join(format!("{name}.svg"))).expect("a figure"),
            "{name}"
        );
    }
    page.click("[data-save='boxplots.png']").await;
    page.until("globalThis.__saved['boxplots.png']?.type === 'image/png' && globalThis.__saved['boxplots.png'].size > 4000")
        .await;
    page.click("#save-runs-html").await;
    assert!(
        saved(&page, "report.html")
            .await
            .contains("Runs that do not count")
    );

    page.click("#remove-runs").await;
    page.until("document.querySelector('#comparison').hidden")
        .await;
    page.close().await;
}

/// The cells of two tables are the same, numbers to within 1e-12.
fn same_table(ours: &str, theirs: &str) {
    let cells = |table: &str| -> Vec<Vec<String>> {
        let row = |line: &str| line.split(',').map(str::to_owned).collect();
        table.lines().map(row).collect()
    };
    let (ours, theirs) = (cells(ours), cells(theirs));
    assert_eq!(ours.len(), theirs.len());
    for (a, b) in ours.iter().flatten().zip(theirs.iter().flatten()) {
        match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(x), Ok(y)) => assert!((x - y).abs() < 1e-12 * y.abs().max(1.0), "{x} and {y}"),
            _ => assert_eq!(a, b),
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn folders_of_agents_compare_as_in_the_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    let [runs, out] = ["runs", "out"].map(|name| folder.path().join(name));
    write_agents(&runs);
    fs::remove_file(runs.join("full/seed-04/summary.json")).expect("removed");
    tracklens(&["report", &text(&runs), "--out", &text(&out)]);
    let report = |out: &std::path::Path| -> Value {
        let bytes = fs::read(out.join("report.json")).expect("a report");
        serde_json::from_slice(&bytes).expect("JSON")
    };

    let page = Page::open_with(KEEP).await;
    page.pick_folder(&runs).await;
    until_compared(&page, 29).await;
    let dropped = "document.querySelector('#runs-dropped').textContent";
    let dropped = page.value(dropped).await;
    let told = "runs/full/seed-04: it stopped after step 12000 of 12000";
    assert!(
        dropped.as_str().is_some_and(|text| text.contains(told)),
        "{dropped}"
    );
    let shown = rows(&page, "success-table").await;
    assert_eq!((shown.len(), shown[0][0].as_str()), (6, "points+robot"));
    assert_eq!(rows(&page, "correlation-table").await.len(), 4);
    assert_eq!(rows(&page, "agents-table").await.len(), 29);
    // By the seed, and the other way round.
    let seed = "document.querySelectorAll('#agents-table .sort')[2]";
    for (first, sort) in [("0", "ascending"), ("4", "descending")] {
        page.value(&format!("{seed}.click()")).await;
        assert_eq!(rows(&page, "agents-table").await[0][2], first);
        let told = page
            .value(&format!("{seed}.closest('th').getAttribute('aria-sort')"))
            .await;
        assert_eq!(told, sort);
    }
    assert_eq!(
        page.value("document.querySelector('#save-runs-csv')").await,
        Value::Null
    );
    page.click("#save-runs-json").await;
    let own: Value = serde_json::from_str(&saved(&page, "report.json").await).expect("JSON");
    let curves = |report: &Value| {
        let groups = report["agents"]["groups"].as_array().expect("groups");
        groups
            .iter()
            .map(|group| (group["name"].clone(), group["curve"][11]["iqm"].as_f64()))
            .collect::<Vec<_>>()
    };
    let (ours, theirs) = (curves(&own), curves(&report(&out)));
    assert_eq!(ours.len(), theirs.len());
    for ((name, a), (other, b)) in ours.iter().zip(&theirs) {
        assert_eq!(name, other);
        // The exponential function of the smoothing is that of the platform: its last bit differs.
        let apart = a.zip(*b).map(|(a, b)| (a - b).abs());
        assert!(
            apart.is_some_and(|apart| apart < 1e-14),
            "{name}: {a:?}, {b:?}"
        );
    }
    for name in [
        "success-over-steps",
        "success-at-the-end",
        "tracking-and-success",
    ] {
        page.click(&format!("[data-save='{name}.svg']")).await;
        let svg = saved(&page, &format!("{name}.svg")).await;
        let terminal = fs::read_to_string(out.join(format!("{name}.svg"))).expect("a figure");
        assert_eq!(svg, terminal, "{name}");
    }
    page.click("#save-success-csv").await;
    let terminal = fs::read_to_string(out.join("success.csv")).expect("a table");
    same_table(&saved(&page, "success.csv").await, &terminal);

    // An encoder whose tracking no agent records is known by its training.
    // CRC-32 of the weights by zlib.
    let (weights, crc32) = (b"weights of basic", 2_716_245_041_u32);
    let trained = folder.path().join("encoders");
    write_run(&trained.join("basic/seed-00"), "basic", 0, 4);
    fs::write(
        trained.join("basic/seed-00/checkpoint_final.safetensors"),
        weights,
    )
    .expect("written");
    let run = &fixture()["runs"]["dim/seed-00"];
    let mut config = run["config"].clone();
    config.as_object_mut().expect("settings").remove("encoder");
    config["checkpoint"] = json!({ "crc32": crc32 });
    let log = run["log"].as_array().expect("a log");
    write_agent(&trained.join("agent"), &config, log);
    page.click("#remove-runs").await;
    page.until("document.querySelector('#comparison').hidden")
        .await;
    page.pick_folder(&trained).await;
    until_compared(&page, 2).await;
    let shown = rows(&page, "success-table").await;
    assert_eq!(shown[0][0], "basic, keypoints+robot");
    assert_ne!(shown[0][3], "–", "its TC");
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn runs_are_sorted_and_grouped_and_kept_apart_by_data() {
    let folder = tempfile::tempdir().expect("a folder");
    let runs = folder.path().join("runs");
    for seed in 0..2 {
        write_run(&runs.join(format!("short/seed-{seed}")), "basic", seed, 4);
        write_run(&runs.join(format!("long/seed-{seed}")), "basic", seed, 6);
    }
    let page = Page::open().await;
    page.pick_folder(&runs).await;
    until_compared(&page, 4).await;
    let groups = || async {
        let shown = rows(&page, "capability-table").await;
        shown
            .into_iter()
            .map(|row| row[0].clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(groups().await, ["basic (epochs 4)", "basic (epochs 6)"]);
    for (by, expected) in [
        ("name", vec!["long", "short"]),
        ("architecture", vec!["basic"]),
        ("epochs", vec!["epochs 4", "epochs 6"]),
    ] {
        let choose = format!(
            "(() => {{ const s = document.querySelector('#compare-group'); s.value = '{by}'; \
             s.dispatchEvent(new Event('change')); return true; }})()"
        );
        page.value(&choose).await;
        let last = expected.last().expect("a group");
        page.until(&format!(
            "document.querySelector('#capability-table tbody tr:last-child th').textContent === '{last}'"
        ))
        .await;
        assert_eq!(groups().await, expected, "{by}");
    }

    // By the error of the cube, up and down.
    let header = "#run-table thead th:nth-child(7) button";
    let errors = || async {
        let shown = rows(&page, "run-table").await;
        shown
            .iter()
            .map(|row| row[6].parse::<f64>().expect("an error"))
            .collect::<Vec<_>>()
    };
    page.click(header).await;
    let up = errors().await;
    assert!(up.is_sorted(), "{up:?}");
    page.click(header).await;
    let down = errors().await;
    assert!(down.iter().rev().is_sorted() && down != up, "{down:?}");
    assert_eq!(
        page.value("document.querySelector('#run-table thead th:nth-child(7)').ariaSort")
            .await,
        "descending"
    );

    // Runs of other objects are kept apart, and said.
    let other = folder.path().join("other");
    write_run(&other, "basic", 3, 4);
    let mut changed = config("basic", 3, 4);
    changed["objects"] = json!(["ball"]);
    fs::write(other.join("config.json"), changed.to_string()).expect("written");
    page.pick_folder(&other).await;
    page.until("document.querySelector('#compare-set option:nth-child(2)')")
        .await;
    page.until_text("they are of different objects: cube, eef, and ball")
        .await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn runs_in_an_archive_come_and_go_with_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let runs = folder.path().join("runs");
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for seed in 0..3 {
        write_run(&runs, "basic", seed, 4);
        for file in ["config.json", "log.jsonl", "summary.json"] {
            let name = format!("basic/seed-{seed}/{file}");
            zip.start_file(name, SimpleFileOptions::default())
                .expect("an entry");
            zip.write_all(&fs::read(runs.join(file)).expect("a file"))
                .expect("written");
        }
    }
    let archive = folder.path().join("runs.zip");
    fs::write(&archive, zip.finish().expect("an archive").into_inner()).expect("written");
    let page = Page::open().await;
    page.pick(&[&archive]).await;
    until_compared(&page, 3).await;
    let names: Vec<String> = rows(&page, "run-table")
        .await
        .into_iter()
        .map(|row| row[0].clone())
        .collect();
    assert_eq!(
        names,
        [0, 1, 2].map(|seed| format!("runs.zip/basic/seed-{seed}"))
    );
    page.click("#files [data-role=archive] .icon-button").await;
    page.until("document.querySelector('#comparison').hidden")
        .await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn two_keypoint_tables_are_compared_by_their_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = text(&example("ground_truth.csv"));
    let [ours, still] = ["ours.csv", "still.csv"].map(|name| folder.path().join(name));
    let table = extract_keypoints(&example("frames"), &ours);
    let stay = |line: &str| match line.split(',').collect::<Vec<_>>()[..] {
        [sequence, frame, n, ..] if n != "keypoint" => {
            format!("{sequence},{frame},{n},0.1,0.{n}\n")
        }
        _ => format!("{line}\n"),
    };
    fs::write(&still, table.lines().map(stay).collect::<String>()).expect("written");

    let page = Page::open().await;
    page.pick(&[&example("ground_truth.csv"), &ours, &still])
        .await;
    until_compared(&page, 2).await;
    // What is said of the tables is what is done with them.
    page.until(
        "document.querySelector('#problems [data-problem=several-keypoints]').textContent.includes(\
         'The results are those of ours.csv; both are compared under “Runs side by side”.')",
    )
    .await;
    assert_eq!(
        page.value(
            "document.querySelector('#files [data-path=\"still.csv\"] .file-role').textContent"
        )
        .await,
        "Keypoints, compared"
    );

    let shown = rows(&page, "only-errors-table").await;
    for (row, path) in shown.iter().zip([&ours, &still]) {
        let scored = tracklens_json(&["score", "--truth", &truth, "--keypoints", &text(path)]);
        for (cell, object) in row[2..]
            .iter()
            .zip(scored["objects"].as_array().expect("objects"))
        {
            let (number, mark) = cell.split_once(' ').unwrap_or((cell, ""));
            let error = object["error"].as_f64().expect("a number");
            let found: f64 = number.parse().expect("a number");
            assert!(
                (found - error).abs() <= 0.5e-4 + f64::EPSILON,
                "{found} {error}"
            );
            assert_eq!(mark.starts_with('✓'), object["tracked"] == true, "{row:?}");
        }
    }
    assert_eq!(shown.len(), 2);
    for absent in [
        "#capability-table",
        "#error-table",
        "[data-figure=tracking-capability]",
    ] {
        let found = format!("document.querySelector('#comparison {absent}')");
        assert_eq!(page.value(&found).await, json!(null), "{absent}");
    }

    page.click("#problems [data-problem=several-keypoints] button.link")
        .await;
    page.until(
        "document.querySelector('#problems [data-problem=several-keypoints]').textContent.includes(\
         'The results are those of still.csv')",
    )
    .await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn several_keypoint_tables_are_runs_of_one_comparison() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = text(&example("ground_truth.csv"));
    let [first, second, third] =
        ["ours_1.csv", "ours_2.csv", "still.csv"].map(|name| folder.path().join(name));
    // One detector with half of the keypoints, one whose keypoints stay where they are.
    let table = extract_keypoints(&example("frames"), &first);
    let half = |line: &&str| {
        line.split(',')
            .nth(2)
            .is_none_or(|n| n.parse::<u32>().map_or(true, |n| n < 8))
    };
    fs::write(
        &second,
        table
            .lines()
            .filter(half)
            .map(|line| format!("{line}\n"))
            .collect::<String>(),
    )
    .expect("written");
    let still = |line: &str| match line.split(',').collect::<Vec<_>>()[..] {
        [sequence, frame, n, ..] if n != "keypoint" => {
            format!("{sequence},{frame},{n},0.1,0.{n}\n")
        }
        _ => format!("{line}\n"),
    };
    fs::write(&third, table.lines().map(still).collect::<String>()).expect("written");

    let page = Page::open().await;
    page.pick(&[&example("ground_truth.csv"), &first, &second, &third])
        .await;
    until_compared(&page, 3).await;
    let shown = rows(&page, "run-table").await;
    for path in [&first, &second, &third] {
        let scored = tracklens_json(&["score", "--truth", &truth, "--keypoints", &text(path)]);
        let name = path.file_name().expect("a name").to_string_lossy();
        let row = shown.iter().find(|row| row[0] == name).expect("a run");
        assert_eq!(
            row[5],
            format!("{:.2}", scored["tc"].as_f64().expect("a number")),
            "{name}"
        );
        for (k, object) in scored["objects"]
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
    // By what their names begin with.
    let groups: Vec<String> = rows(&page, "capability-table")
        .await
        .into_iter()
        .map(|row| row[0].clone())
        .collect();
    assert_eq!(groups, ["ours", "still"]);
    assert_eq!(
        page.value("document.querySelector('[data-figure=boxplots] svg') !== null")
            .await,
        json!(true)
    );
    assert_eq!(
        page.value("document.querySelector('[data-figure=reconstruction-loss]')")
            .await,
        json!(null)
    );
    page.close().await;
}

async fn a_checkpoint_on_the_example_is_compared_with_its_own_one_by_one(browser: Browser) {
    let folder = tempfile::tempdir().expect("a folder");
    let mine = folder.path().join("mine.safetensors");
    fs::copy(example("checkpoint.safetensors"), &mine).expect("copied");
    let page = Page::open_in(browser).await;
    page.click("#try-example").await;
    page.until_scored().await;
    page.pick(&[&mine]).await;
    until_compared(&page, 2).await;
    let names: Vec<String> = rows(&page, "run-table")
        .await
        .into_iter()
        .map(|row| row[0].clone())
        .collect();
    assert_eq!(names, ["checkpoint.safetensors", "mine.safetensors"]);
    // Nothing says that the two differ in their seeds alone.
    assert_eq!(
        page.value("document.querySelector('#comparison').dataset.groups")
            .await,
        "2"
    );
    // The example is still there.
    page.until("document.querySelectorAll('#files [data-role=checkpoint]').length === 2")
        .await;
    page.until("document.querySelector('.origin')").await;
    page.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn extracting_for_the_comparison_shows_progress_and_can_be_cancelled() {
    let folder = tempfile::tempdir().expect("a folder");
    let mine = folder.path().join("mine.safetensors");
    fs::copy(example("checkpoint.safetensors"), &mine).expect("copied");
    let page = Page::open().await;
    page.pick_folder(&example("frames")).await;
    page.pick(&[
        &example("ground_truth.csv"),
        &example("checkpoint.safetensors"),
    ])
    .await;
    page.until_scored().await;
    page.pick(&[&mine]).await;
    page.until_text("1 checkpoint without keypoints of these frames: mine.safetensors")
        .await;
    let extract = "#comparison .notice button.link";
    // The page cancels as soon as it can, so that there is something left.
    page.value(
        "(new MutationObserver(() => { const cancel = document.querySelector('#compare-cancel'); \
         if (!cancel || globalThis.__total) return; \
         globalThis.__total = document.querySelector('#compare-extracting progress').max; cancel.click(); \
         }).observe(document.querySelector('#comparison'), { childList: true, subtree: true }), true)",
    )
    .await;
    page.click(extract).await;
    page.until(&format!("globalThis.__total === {EXAMPLE_FRAMES}"))
        .await;
    page.until(&format!("document.querySelector('{extract}')"))
        .await;
    page.click(extract).await;
    until_compared(&page, 2).await;
    page.close().await;
}

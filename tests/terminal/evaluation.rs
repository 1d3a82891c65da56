//! What an evaluation brings beside its errors, by the real binary: sequences, context, figures,
//! reports, saved results.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;
use tracklens::evaluation::EvaluationReport;
use tracklens::report::draw::Theme;
use tracklens::report::evaluation::{capability, evaluation_figures, matrix, sequences};

use crate::binary::{json, tracklens_in};

/// Three sequences; keypoint 0 follows the cube but in the last sequence, keypoint 1 nothing;
/// `hidden` is never visible.
fn tables() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for (s, sequence) in ["one", "two", "three"].into_iter().enumerate() {
        for t in 0..20 {
            let i = f64::from(t) + 20.0 * s as f64;
            let (x, y) = (0.8 * (i * 0.37).sin(), 0.8 * (i * 0.71).cos());
            let off = if s == 2 { 0.1 * (i * 2.9).sin() } else { 0.0 };
            truth += &format!("{sequence},{t},cube,{x},{y}\n{sequence},{t},hidden,,\n");
            keypoints += &format!(
                "{sequence},{t},0,{},{}\n",
                0.5 * x + off,
                0.1 - y + off * off
            );
            keypoints += &format!("{sequence},{t},1,{},{}\n", (i * 1.3).cos(), (i * 1.9).sin());
        }
    }
    for (name, text) in [("gt.csv", truth), ("kp.csv", keypoints)] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    folder
}

fn score(folder: &Path, more: &[&str]) -> Output {
    let files = ["score", "--truth", "gt.csv", "--keypoints", "kp.csv"];
    tracklens_in(folder, &[&files[..], more].concat())
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn a_tc_of_too_few_data_is_unknown_and_says_what_is_enough() {
    let folder = tempfile::tempdir().expect("a folder");
    let tables = |sequences: u32| {
        let mut truth = String::from("sequence,frame,object,x,y\n");
        let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
        for s in 0..sequences {
            for t in 0..20 {
                let (still, moving) = (f64::from(s), f64::from(t));
                let at = |i: f64, pace: f64| 0.8 * (i * pace).sin();
                truth += &format!("{s},{t},still,{},{}\n", at(still, 2.1), at(still, 1.3));
                truth += &format!("{s},{t},moving,{},{}\n", at(moving, 2.1), at(moving, 1.3));
                // Has nothing to do with the object, but stands still in every sequence as well.
                let _ = writeln!(keypoints, "{s},{t},0,{},{}", at(still, 0.7), at(still, 2.9));
            }
        }
        for (name, text) in [("gt.csv", truth), ("kp.csv", keypoints)] {
            std::fs::write(folder.path().join(name), text).expect("written");
        }
    };
    let scored = |more: &[&str]| {
        let result = json(&score(folder.path(), more));
        let warnings = result["warnings"].as_array().expect("warnings").clone();
        let unknown = |w: &Value| w.as_str().is_some_and(|w| w.starts_with("TC is unknown:"));
        let about = warnings.into_iter().filter(unknown).collect::<Vec<_>>();
        (result, about)
    };
    tables(3);
    let (result, warnings) = scored(&[]);
    assert_eq!(
        result["objects"][0]["tracked"], true,
        "three positions are fitted exactly"
    );
    assert_eq!(result["tc"], Value::Null);
    let still = &result["sufficiency"][0];
    assert_eq!(
        (&still["known"], &still["chance"]),
        (&false.into(), &1.0.into())
    );
    let text = warnings[0].as_str().expect("text");
    assert!(
        text.contains("object `still` amount to 3.0 independent positions")
            && text.contains("sequences ("),
        "{text}"
    );
    // Held out, nothing is tracked: that is said as well where a TC is known.
    assert_eq!(result["held_out"]["folds"], 3);
    assert_eq!(result["held_out"]["objects"][0]["tracked"], false);
    let strict = score(folder.path(), &["--strict"]);
    assert_eq!(strict.status.code(), Some(5));
    assert!(String::from_utf8_lossy(&strict.stderr).contains("the TC is unknown"));
    let printed: Value = serde_json::from_slice(&strict.stdout).expect("JSON");
    assert_eq!(printed["tc"], Value::Null);

    // What is said to be enough is enough.
    let needed = number(&still["needed"]["sequences"]) as u32;
    tables(needed + 2);
    let (result, warnings) = scored(&["--strict"]);
    assert_eq!(
        (number(&result["tc"]), warnings.len()),
        (0.0, 0),
        "{warnings:?}"
    );

    // A threshold that every constant keeps makes every keypoint track.
    let (result, warnings) = scored(&["--threshold", "still=2"]);
    assert_eq!(result["sufficiency"][0]["needed"], Value::Null);
    assert!(
        warnings[0]
            .as_str()
            .is_some_and(|w| w.contains("hardly moves")),
        "{warnings:?}"
    );
}

#[test]
fn sequences_are_listed_worst_first_and_make_up_the_error() {
    let folder = tables();
    let result = json(&score(folder.path(), &["--sequences", "--json"]));
    let lists = result["sequences"].as_array().expect("lists");
    // The object that is never visible has none.
    assert_eq!(lists.len(), 1);
    assert_eq!(
        (&lists[0]["object"], &lists[0]["keypoint"]),
        (&"cube".into(), &0.into())
    );
    let errors = lists[0]["errors"].as_array().expect("sequences");
    assert_eq!(errors[0]["sequence"], "three");
    let of = |field: &str| -> Vec<f64> { errors.iter().map(|e| number(&e[field])).collect() };
    assert!(of("error").is_sorted_by(|a, b| a >= b));
    let mean = of("error").iter().sum::<f64>() / 3.0;
    // From squared distances here, from moments there.
    assert!((mean - number(&result["objects"][0]["error"])).abs() < 1e-12);
    assert!(
        of("worst_error")
            .iter()
            .zip(of("error"))
            .all(|(worst, mean)| *worst >= mean)
    );
}

#[test]
fn the_second_best_keypoint_and_the_command_are_named() {
    let folder = tables();
    let result = json(&score(
        folder.path(),
        &["--json", "--threshold", "cube=0.02"],
    ));
    let cube = &result["objects"][0];
    assert_eq!(cube["second_best"]["keypoint"], 1);
    assert_eq!(cube["second_best"]["error"], result["errors"][0][1]);
    assert!(result["objects"][1].get("second_best").is_none());
    assert_eq!(
        result["command"],
        "tracklens score --truth gt.csv --keypoints kp.csv --json --threshold 'cube=0.02'"
    );
    assert_eq!(result["join"]["matched"], 60);
}

#[test]
fn context_has_regression_and_assignment_on_demand() {
    let folder = tables();
    let plain = json(&score(folder.path(), &["--json"]));
    assert!(plain.get("context").is_none() && plain.get("sequences").is_none());
    let context = &json(&score(
        folder.path(),
        &["--context", "--folds", "3", "--json"],
    ))["context"];
    let rows = context["regression"].as_array().expect("rows");
    assert_eq!(rows.len(), 4);
    // All keypoints together leave no more than the best one alone on the frames that are fitted.
    assert!(number(&rows[0]["error"]) <= number(&plain["objects"][0]["error"]));
    assert!(number(&rows[2]["error"]) >= number(&rows[0]["error"]));
    assert_eq!(
        (&rows[2]["held_out"], &rows[1]["error"]),
        (&true.into(), &Value::Null)
    );
    assert_eq!(context["assignment"][1]["trajectory"], "sequence");
    assert_eq!(context["assignment"][1]["objects"], 3);
    let table = String::from_utf8(score(folder.path(), &["--csv"]).stdout).expect("text");
    assert!(table.starts_with("object,tracked,error"));
}

#[test]
fn a_report_is_one_file_that_loads_nothing_and_figures_are_svg_and_png() {
    let folder = tables();
    let output = score(
        folder.path(),
        &[
            "--report",
            "out.html",
            "--figures",
            "figures",
            "--folds",
            "3",
            "--bootstrap",
            "20",
            "--context",
        ],
    );
    let result = json(&output);
    let page = std::fs::read_to_string(folder.path().join("out.html")).expect("a report");
    assert!(page.starts_with("<!DOCTYPE html>"));
    for outside in ["<script", "<link", "src=", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
    // The names of SVG's namespaces are no addresses that anything is loaded from.
    let loaded = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!loaded.contains("http://") && !loaded.contains("https://"));
    for expected in [
        "cube",
        "hidden",
        "three",
        "Other metrics",
        "--bootstrap 20",
        "held-out error",
    ] {
        assert!(page.contains(expected), "{expected}");
    }
    assert_eq!(page.matches("<svg").count(), 3);
    for name in ["errors", "capability", "sequences-cube"] {
        let file = |ending: &str| folder.path().join(format!("figures/{name}.{ending}"));
        let png = std::fs::read(file("png")).expect("a PNG");
        assert!(
            png.starts_with(b"\x89PNG") && png.len() > 5000,
            "{name}: {} bytes",
            png.len()
        );
        let svg = std::fs::read_to_string(file("svg")).expect("an SVG");
        assert!(svg.starts_with("<svg"));
    }
    assert_eq!(result["held_out"]["folds"], 3);
    // Told before anything is computed.
    let nowhere = score(folder.path(), &["--report", "nowhere/out.html"]);
    assert_eq!(nowhere.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&nowhere.stderr).contains("nowhere/out.html"));
}

#[test]
fn a_report_of_frames_plays_the_sequence_in_which_most_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../web/example");
    let path = |name: &str| example.join(name).to_string_lossy().into_owned();
    let output = Command::new(env!("CARGO_BIN_EXE_tracklens"))
        .current_dir(folder.path())
        .args(["eval", "--quiet", "--report", "out.html"])
        .args(["--checkpoint", &path("checkpoint.safetensors")])
        .args(["--frames", &path("frames")])
        .args(["--truth", &path("ground_truth.csv")])
        .output()
        .expect("the binary runs");
    assert!(output.status.success());
    let page = std::fs::read_to_string(folder.path().join("out.html")).expect("a report");
    // Of each frame of a sequence an image and its marks.
    let images = page.matches("data:image/jpeg;base64,").count();
    assert!(images > 0);
    assert_eq!(page.matches("class=\"film-frame\"").count(), 2 * images);
    assert!(page.contains(&format!("{images} of {images} frames")));
    for outside in ["<script", "<link", "src=", "@import", "url("] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn figures_of_objects_with_similar_names_do_not_overwrite_each_other() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut truth, mut keypoints) = (
        "sequence,frame,object,x,y\n".to_owned(),
        "sequence,frame,keypoint,x,y\n".to_owned(),
    );
    for t in 0..40 {
        let [x, y] = [
            0.02 * f64::from(t) - 0.4,
            0.3 - 0.01 * f64::from(t * t % 37),
        ];
        for name in ["m1_nose", "m1 nose", "鼻", "口"] {
            let _ = writeln!(truth, "a,{t},{name},{x},{y}");
        }
        let _ = writeln!(keypoints, "a,{t},0,{y},{x}");
    }
    std::fs::write(folder.path().join("gt.csv"), truth).expect("a table");
    std::fs::write(folder.path().join("kp.csv"), keypoints).expect("a table");
    json(&score(folder.path(), &["--figures", "figures"]));
    let names: std::collections::BTreeSet<String> =
        std::fs::read_dir(folder.path().join("figures"))
            .expect("a folder")
            .map(|entry| {
                entry
                    .expect("a file")
                    .file_name()
                    .to_string_lossy()
                    .into_owned()
            })
            .filter(|name| name.ends_with(".svg"))
            .collect();
    let expected = [
        "capability.svg",
        "errors.svg",
        "sequences-_-2.svg",
        "sequences-_.svg",
        "sequences-m1_nose-2.svg",
        "sequences-m1_nose.svg",
    ];
    assert_eq!(names, expected.map(str::to_owned).into());
}

#[test]
fn a_saved_evaluation_is_read_again_and_newer_ones_are_refused() {
    let folder = tables();
    let output = score(
        folder.path(),
        &[
            "--json",
            "--sequences",
            "--context",
            "--folds",
            "2",
            "--bootstrap",
            "9",
        ],
    );
    let value = json(&output);
    let report = EvaluationReport::parse(&output.stdout, "saved.json").expect("an evaluation");
    assert_eq!(serde_json::to_value(&report).expect("JSON"), value);

    let told = |value: &Value| {
        let bytes = serde_json::to_vec(value).expect("JSON");
        EvaluationReport::parse(&bytes, "saved.json")
            .expect_err("refused")
            .to_string()
    };
    let with = |field: &str, new: Value| {
        let mut value = value.clone();
        value[field] = new;
        value
    };
    let newer = told(&with("schema", "tracklens/evaluation/5".into()));
    assert!(
        newer.contains("saved.json")
            && newer.contains("evaluation/5")
            && newer.contains("reads up to"),
        "{newer}"
    );
    assert!(
        told(&with("schema", "tracklens/report/1".into()))
            .contains("expected `tracklens/evaluation/3`")
    );
    assert!(
        told(&with("errors", serde_json::json!([[1.0]]))).contains("expected one row an object")
    );
    assert!(told(&with("objects", Value::Null)).contains("not complete"));
    assert!(told(&Value::from(3)).contains("not the JSON of an evaluation"));

    // The first schema: without what came later.
    let mut first = value;
    for field in ["command", "join", "image_size", "sequences", "context"] {
        first.as_object_mut().expect("an object").remove(field);
    }
    first["schema"] = "tracklens/evaluation/1".into();
    let bytes = serde_json::to_vec(&first).expect("JSON");
    let old = EvaluationReport::parse(&bytes, "old.json").expect("an evaluation");
    assert_eq!((old.tc, old.sequences), (report.tc, None));
}

#[test]
fn figures_say_where_their_plot_lies() {
    let folder = tables();
    let output = score(folder.path(), &["--json", "--sequences"]);
    let report = EvaluationReport::parse(&output.stdout, "e").expect("an evaluation");
    let theme = &Theme::PRINT;
    for width in [320, 880] {
        let drawn = matrix(&report, &[Some(1), None], theme, width).expect("a matrix");
        let [left, top, plot_width, height] = drawn.plot;
        assert!(left > 0.0 && left + plot_width <= f64::from(drawn.width));
        assert!(top > 0.0 && top + height < f64::from(drawn.height));
        assert_eq!((drawn.x, drawn.y), ([0.0, 2.0], [2.0, 0.0]));
        let drawn = capability(&report, Some(3.0), theme, width).expect("a curve");
        let ratio = report.objects[0].error.expect("an error") / report.objects[0].threshold;
        assert!(drawn.x[0] <= ratio && ratio <= drawn.x[1], "{:?}", drawn.x);
        let drawn = sequences(&[0.3, 0.2, 0.0], 0.015, Some(1), theme, width).expect("sequences");
        assert_eq!(drawn.x, [0.0, 3.0]);
        assert!(drawn.y[0] > 0.0 && drawn.y[1] >= 0.3);
    }
    assert_eq!(evaluation_figures(&report).expect("figures").len(), 3);
    assert!(capability(&report, None, theme, 10).is_err());
    // One keypoint, and no error at all.
    let mut odd = report;
    for row in &mut odd.errors {
        row.truncate(1);
        row.fill(Some(0.0));
    }
    for object in &mut odd.objects {
        (object.best_keypoint, object.error, object.second_best) = (Some(0), Some(0.0), None);
    }
    assert!(evaluation_figures(&odd).is_ok());
}

/// Three objects that move, one of which has a keypoint that jumps where it is not sure.
fn unsure_tables() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let (mut plain, mut sure) = (String::new(), String::new());
    for t in 0..400 {
        let i = f64::from(t);
        let (x, y) = (0.8 * (i * 0.9).sin(), 0.8 * (i * 1.7).cos());
        let _ = writeln!(truth, "a,{t},cube,{x},{y}");
        let is_lost = t % 5 == 0;
        let [kx, ky] = if is_lost { [0.9, -0.9] } else { [0.5 * y, x] };
        let confidence = if is_lost {
            0.2
        } else {
            0.6 + 0.3 * (i * 0.37).sin().abs()
        };
        let _ = writeln!(plain, "a,{t},0,{kx},{ky}");
        let _ = writeln!(sure, "a,{t},0,{kx},{ky},{confidence}");
    }
    for (name, text) in [
        ("gt.csv", truth),
        (
            "sure.csv",
            format!("sequence,frame,keypoint,x,y,likelihood\n{sure}"),
        ),
        ("plain.csv", format!("sequence,frame,keypoint,x,y\n{plain}")),
    ] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    folder
}

#[test]
fn points_that_are_not_sure_are_missing_when_asked_for() {
    let folder = unsure_tables();
    let scored = |more: &[&str]| json(&score(folder.path(), more));
    let take = |name: &str| {
        let [from, to] = [name, "kp.csv"].map(|name| folder.path().join(name));
        std::fs::copy(from, to).expect("copied");
    };
    take("plain.csv");
    let mut plain = scored(&[]);
    take("sure.csv");
    let all = scored(&[]);
    // Without being asked, nothing is hidden: the numbers are those of a table without confidences.
    assert_eq!(plain.get("confidence"), None);
    let mut same = all.clone();
    for result in [&mut plain, &mut same] {
        let fields = result.as_object_mut().expect("an object");
        fields.retain(|name, _| name != "command" && name != "confidence");
    }
    assert_eq!(same, plain);

    let confidence = &all["confidence"];
    assert_eq!(
        (
            &confidence["least_keypoints"],
            &confidence["hidden_keypoints"]
        ),
        (&Value::Null, &Value::Null)
    );
    let levels = confidence["levels"].as_array().expect("levels");
    let at = |least: f64| {
        let found = levels.iter().find(|level| number(&level["least"]) == least);
        found.unwrap_or_else(|| panic!("no level {least} in {levels:?}"))
    };
    assert_eq!(number(&at(0.1)["kept"]), 1.0);
    assert_eq!(at(0.1)["errors"][0], all["objects"][0]["error"]);
    assert_eq!((number(&at(0.0)["tc"]), number(&at(0.5)["tc"])), (0.0, 1.0));
    assert_eq!(number(&at(0.5)["kept"]), 0.8);
    // Where fewer than half of the frames have a keypoint, there is no best one.
    assert_eq!(at(0.99)["errors"][0], Value::Null);

    let sure = scored(&["--min-confidence", "0.5"]);
    assert_eq!(number(&sure["tc"]), 1.0);
    assert_eq!(number(&sure["confidence"]["hidden_keypoints"]), 80.0);
    assert_eq!(sure["missing"], serde_json::json!([80]));
    let error = number(&sure["objects"][0]["error"]);
    // The map is exact: what is left is the rounding of the table's digits.
    assert!(error < 1e-28, "{error}");
    assert_eq!(at(0.5)["errors"][0], sure["objects"][0]["error"]);
    let warnings = sure["warnings"].to_string();
    assert!(
        warnings.contains("80 keypoints have a confidence below 0.5 and count as missing"),
        "{warnings}"
    );
    let asked = scored(&["--confidence-levels", "0.3,0.1"]);
    let asked = asked["confidence"]["levels"].as_array().expect("levels");
    assert_eq!(
        asked
            .iter()
            .map(|l| number(&l["least"]))
            .collect::<Vec<_>>(),
        [0.3, 0.1]
    );

    let truth = scored(&["--truth-min-confidence", "2"]);
    assert_eq!(truth["confidence"]["hidden_truth"], Value::Null);
    assert!(truth["warnings"].to_string().contains("have no confidence"));
    let wrong = score(folder.path(), &["--min-confidence", "nan"]);
    assert_eq!(wrong.status.code(), Some(2));

    let figures = folder.path().join("figures");
    let drawn = score(
        folder.path(),
        &[
            "--figures",
            "figures",
            "--report",
            "r.html",
            "--min-confidence",
            "0.5",
        ],
    );
    assert!(drawn.status.success());
    let figure = std::fs::read_to_string(figures.join("confidence.svg")).expect("a figure");
    assert!(figure.contains("smallest confidence that counts"));
    let page = std::fs::read_to_string(folder.path().join("r.html")).expect("a page");
    assert!(page.contains("share of the keypoints that is left"));
}

#[test]
fn positions_that_are_not_sure_are_not_visible_when_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut images, mut annotations) = (Vec::new(), Vec::new());
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for t in 0..60 {
        let i = f64::from(t);
        let [x, y] = [50.0 + 40.0 * (i * 0.9).sin(), 50.0 + 40.0 * (i * 1.7).cos()];
        images.push(serde_json::json!({ "id": t, "file_name": format!("v/{t}.png"), "width": 100, "height": 100 }));
        // Hidden by something in every fourth frame, where its place was guessed wrong.
        let (place, v) = if t % 4 == 0 {
            ([0.0, 0.0], 1)
        } else {
            ([x, y], 2)
        };
        annotations.push(serde_json::json!({ "image_id": t, "category_id": 1, "keypoints": [place[0], place[1], v] }));
        let _ = writeln!(keypoints, "v,{t},0,{x},{y}");
    }
    let categories = [serde_json::json!({ "id": 1, "name": "p", "keypoints": ["cube"] })];
    let truth = serde_json::json!({ "images": images, "annotations": annotations, "categories": categories });
    std::fs::write(folder.path().join("gt.csv"), truth.to_string()).expect("written");
    std::fs::write(folder.path().join("kp.csv"), keypoints).expect("written");
    let output = score(folder.path(), &[]);
    let notes = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        notes.contains("15 points lie at exactly (0, 0)")
            && notes.contains("--truth-min-confidence"),
        "{notes}"
    );
    assert_eq!(json(&output)["objects"][0]["frames"], 60);
    let sure = json(&score(folder.path(), &["--truth-min-confidence", "2"]));
    assert_eq!(sure["objects"][0]["frames"], 45);
    assert_eq!(sure["confidence"]["hidden_truth"], 15);
    assert_eq!(sure["objects"][0]["tracked"], true);
}

#[test]
fn objects_whose_names_look_alike_have_figures_of_their_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut truth = String::from("sequence,frame,object,x,y\n");
    let mut keypoints = String::from("sequence,frame,keypoint,x,y\n");
    for t in 0..30 {
        let (x, y) = ((f64::from(t) * 0.9).sin(), (f64::from(t) * 1.7).cos());
        for name in ["m1 nose", "m1_nose", "M1_nose", "鼻", "耳"] {
            let _ = writeln!(truth, "a,{t},{name},{x},{y}");
        }
        let _ = writeln!(keypoints, "a,{t},0,{y},{x}");
    }
    for (name, text) in [("gt.csv", truth), ("kp.csv", keypoints)] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    let output = score(folder.path(), &["--figures", "figures", "--sequences"]);
    assert!(output.status.success());
    let files = std::fs::read_dir(folder.path().join("figures")).expect("a folder");
    let names = files.map(|file| {
        file.expect("a file")
            .file_name()
            .to_string_lossy()
            .to_lowercase()
    });
    let of_sequences = names.filter(|n| n.starts_with("sequences-") && n.ends_with(".svg"));
    let unique: std::collections::BTreeSet<String> = of_sequences.collect();
    assert_eq!(unique.len(), 5, "{unique:?}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("7 figures written"), "{said}");
}

#[test]
fn pixels_of_frames_of_several_sizes_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut table = "sequence,frame,object,x,y\n".to_owned();
    std::fs::create_dir(folder.path().join("walk")).expect("made");
    for t in 0..24_u32 {
        let size = if t == 17 { [32, 24] } else { [64, 48] };
        let pixels = (0..size[0] * size[1] * 3).map(|i| ((i * 31 + t * 5) % 251) as u8);
        let frame = tracklens::data::Frame::new(size[0], size[1], pixels.collect());
        let png = frame.and_then(|frame| frame.to_png()).expect("an image");
        std::fs::write(folder.path().join(format!("walk/frame_{t:03}.png")), png).expect("written");
        let (x, y) = (10 + t % 7 * 6, 8 + t % 5 * 6);
        writeln!(table, "walk,{t},cube,{x},{y}").expect("text");
    }
    std::fs::write(folder.path().join("gt.csv"), table).expect("written");
    let checkpoint = format!(
        "{}/../web/example/checkpoint.safetensors",
        env!("CARGO_MANIFEST_DIR")
    );
    let eval = |more: &[&str]| {
        let paths = ["--frames", ".", "--truth", "gt.csv"];
        let arguments = [&["eval", "--checkpoint", &checkpoint][..], &paths, more].concat();
        tracklens_in(folder.path(), &arguments)
    };
    let refused = eval(&["--space", "px"]);
    let told = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(4), "{told}");
    assert!(
        told.contains("gt.csv: sequence walk, frame 17: the frame has 32 x 24 pixels, and the first one 64 x 48")
            && told.contains("--space fraction")
            && told.contains("--image-size"),
        "{told}"
    );
    // What says the size itself, or needs none, is scored.
    for more in [&["--space", "px", "--image-size", "64x48"][..], &[]] {
        let scored = eval(&[more, &["--json"]].concat());
        let told = String::from_utf8_lossy(&scored.stderr).into_owned();
        assert!(scored.status.success(), "{told}");
    }
}

#[test]
fn an_object_counts_once() {
    let folder = tables();
    let twice = score(folder.path(), &["--objects", "cube,cube"]);
    let told = String::from_utf8_lossy(&twice.stderr);
    assert_eq!(twice.status.code(), Some(3), "{told}");
    assert!(told.contains("two objects are named `cube`"), "{told}");
}

#[test]
fn a_coco_file_says_the_size_of_its_images() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut annotations, mut images) = (Vec::new(), Vec::new());
    let mut keypoints = "sequence,frame,keypoint,x,y\n".to_owned();
    for t in 0..40_u32 {
        let [x, y] = [t % 7, t % 5].map(|at| f64::from(20 + 30 * at));
        images.push(serde_json::json!({
            "id": t, "file_name": format!("walk/{t:03}.png"), "width": 320, "height": 240,
        }));
        annotations.push(serde_json::json!({
            "id": t, "image_id": t, "category_id": 1, "keypoints": [x, y, 2], "num_keypoints": 1,
        }));
        // Off by 2 pixels of 320 to one side or the other.
        let off = if t % 2 == 0 { 2.0 } else { -2.0 };
        let (x, y) = ((x + off) / 160.0 - 1.0, y / 120.0 - 1.0);
        writeln!(keypoints, "walk,{t},0,{x},{y}").expect("text");
    }
    let coco = serde_json::json!({
        "images": images, "annotations": annotations,
        "categories": [{ "id": 1, "name": "cube", "keypoints": ["cube"] }],
    });
    std::fs::write(folder.path().join("gt.json"), coco.to_string()).expect("written");
    std::fs::write(folder.path().join("kp.csv"), keypoints).expect("written");
    let score = |more: &[&str]| {
        let files = [
            "score",
            "--truth",
            "gt.json",
            "--keypoints",
            "kp.csv",
            "--json",
        ];
        tracklens_in(folder.path(), &[&files[..], more].concat())
    };
    let found = score(&[]);
    let found: Value = serde_json::from_slice(&found.stdout).expect("JSON");
    assert_eq!(found["image_size"], serde_json::json!([320, 240]));
    let pixels = number(&found["objects"][0]["rmse_px"]);
    // The map takes up a part of the two pixels.
    assert!((1.5..=2.0).contains(&pixels), "{found}");
    let refused = score(&["--image-size", "640x480"]);
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success());
    assert!(
        told.contains("gt.json: its images have 320 x 240 pixels, and --image-size says 640x480"),
        "{told}"
    );
}

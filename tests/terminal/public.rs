//! Files as people have them (`tests/public`), read by the real binary: what they hold comes to the
//! errors that numpy computed beside, and what cannot be read is refused with what to do.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/public")
}

fn expected() -> Value {
    let text = fs::read(folder().join("expected.json")).expect("the expected errors");
    serde_json::from_slice(&text).expect("JSON")
}

fn text(value: &Value) -> &str {
    value
        .as_str()
        .unwrap_or_else(|| panic!("{value} is no text"))
}

/// Scores a file beside the plain table of the other role.
fn score(all: &Value, case: &Value) -> Output {
    let role = text(&case["role"]);
    let other = if role == "truth" {
        "keypoints"
    } else {
        "truth"
    };
    let prefix = if role == "truth" {
        "--"
    } else {
        "--keypoints-"
    };
    let mut command = Command::new(env!("CARGO_BIN_EXE_tracklens"));
    command
        .current_dir(folder().join("files"))
        .args(["score", "--json", "--folds", "0"])
        .args([format!("--{role}"), text(&case["file"]).to_owned()])
        .args([
            format!("--{other}"),
            text(case.get("beside").unwrap_or(&all[other])).to_owned(),
        ]);
    let options = case["options"].as_object().expect("options");
    for (name, value) in options {
        let value = match value {
            Value::Array(size) => format!("{}x{}", size[0], size[1]),
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        let name = name.replace('_', "-");
        match name.as_str() {
            // The images are the same for both.
            "image-size" => command.args(["--image-size", &value]),
            _ => command.args([format!("{prefix}{name}"), value]),
        };
    }
    // The order of the axes of the truth holds for keypoints as well unless they have their own.
    if role == "truth" && options.contains_key("axis_order") {
        command.args(["--keypoints-axis-order", "xy"]);
    }
    command.output().expect("the binary runs")
}

#[test]
fn files_as_people_have_them_come_to_the_errors_of_numpy() {
    let all = expected();
    let cases = all["cases"].as_array().expect("cases");
    let mut wrong = Vec::new();
    for case in cases {
        let output = score(&all, case);
        let said = String::from_utf8_lossy(&output.stderr);
        let mut fail = |why: String| wrong.push(format!("{}: {why}\n{said}", case["file"]));
        if let Some(message) = case["refused"].as_str() {
            if output.status.code() != Some(3) || !said.contains(message) {
                fail(format!("expected exit code 3 and `{message}`"));
            }
            continue;
        }
        let Ok(found) = serde_json::from_slice::<Value>(&output.stdout) else {
            fail(format!("exit code {:?}", output.status.code()));
            continue;
        };
        for note in case["notes"].as_array().into_iter().flatten() {
            if !said.contains(text(note)) {
                fail(format!("expected the note {note}"));
            }
        }
        if let Some(names) = case["objects"].as_array() {
            let objects = found["objects"].as_array().expect("objects");
            let same = objects
                .iter()
                .map(|object| &object["name"])
                .eq(names.iter());
            if !same {
                fail(format!("expected the objects {names:?}"));
            }
        }
        let [theirs, ours] = [&case["errors"], &found["errors"]].map(matrix);
        // Both solve least squares in f64, by other algorithms; coordinates are near 1, but for those
        // in space, whose errors are as large as their unit is small.
        let near = |(a, b): (&Option<f64>, &Option<f64>)| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() <= 1e-12 * a.max(1.0),
            (a, b) => a == b,
        };
        if theirs.len() != ours.len() || !theirs.iter().zip(&ours).all(near) {
            fail(format!("expected the errors {theirs:?}, found {ours:?}"));
        }
    }
    assert!(
        wrong.is_empty(),
        "{} of {}:\n{}",
        wrong.len(),
        cases.len(),
        wrong.join("\n")
    );
    assert!(cases.len() >= 80);
}

/// The errors of all pairs.
fn matrix(errors: &Value) -> Vec<Option<f64>> {
    let rows = errors.as_array().expect("rows").iter();
    rows.flat_map(|row| row.as_array().expect("a row"))
        .map(Value::as_f64)
        .collect()
}

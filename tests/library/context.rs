//! What others measure, against scikit-learn and SciPy (`golden/make_context.py`).

use ndarray::Array3;
use serde_json::Value;
use tracklens::metric::context::{CLOSE, assignment, regression};

/// Normal equations here, a singular value decomposition there: both of condition numbers below 1e3
/// in f64.
const RELATIVE: f64 = 1e-9;

struct Case {
    name: String,
    keypoints: Array3<f64>,
    truth: Array3<f64>,
    folds: Vec<usize>,
    length: usize,
    expected: Value,
}

fn cases() -> Vec<Case> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/golden/context.json");
    let text = std::fs::read_to_string(path).expect("the fixture");
    let fixture: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(numbers(&fixture["close"]), CLOSE);
    let cases = fixture["cases"].as_array().expect("cases").iter();
    cases
        .map(|case| {
            let shape: Vec<usize> = numbers(&case["shape"])
                .iter()
                .map(|n| *n as usize)
                .collect();
            let points = |values: &Value, count: usize| {
                Array3::from_shape_vec((shape[0], count, 2), numbers(values)).expect("the shape")
            };
            Case {
                name: case["name"].as_str().expect("a name").to_owned(),
                keypoints: points(&case["keypoints"], shape[1]),
                truth: points(&case["truth"], shape[2]),
                folds: numbers(&case["folds"])
                    .iter()
                    .map(|n| *n as usize)
                    .collect(),
                length: case["length"].as_u64().expect("a length") as usize,
                expected: case.clone(),
            }
        })
        .collect()
}

fn numbers(values: &Value) -> Vec<f64> {
    let values = values.as_array().expect("numbers").iter();
    values
        .map(|value| value.as_f64().unwrap_or(f64::NAN))
        .collect()
}

#[test]
fn regression_and_pck_equal_scikit_learn() {
    for case in cases() {
        for (key, folds) in [("regression", None), ("held_out", Some(&case.folds[..]))] {
            let found =
                regression(case.keypoints.view(), case.truth.view(), folds).expect("a regression");
            let expected = case.expected[key].as_array().expect("objects");
            assert_eq!(found.len(), expected.len());
            for (found, expected) in found.iter().zip(expected) {
                let what = format!("{}, {key}", case.name);
                assert_eq!(Some(found.frames), expected["frames"].as_u64(), "{what}");
                let error = expected["error"].as_f64().expect("an error");
                let ours = found.error.expect("an error");
                assert!(
                    (ours - error).abs() <= RELATIVE * error,
                    "{what}: {ours} {error}"
                );
                assert_eq!(
                    found.close.expect("PCK").to_vec(),
                    numbers(&expected["close"]),
                    "{what}"
                );
            }
        }
    }
}

#[test]
fn assignments_equal_scipy() {
    for case in cases() {
        let frames = case.keypoints.dim().0;
        for (key, length) in [("frames", 1), ("sequences", case.length)] {
            let trajectories = (0..frames).step_by(length).map(|t| t..t + length);
            let found = assignment(case.keypoints.view(), case.truth.view(), trajectories)
                .expect("an assignment");
            let expected = &case.expected[key];
            assert_eq!(Some(found.keypoints), expected["keypoints"].as_u64());
            assert_eq!(Some(found.objects), expected["objects"].as_u64());
            assert_eq!(
                found.precision.to_vec(),
                numbers(&expected["precision"]),
                "{}",
                case.name
            );
            assert_eq!(
                found.recall.to_vec(),
                numbers(&expected["recall"]),
                "{}",
                case.name
            );
        }
    }
}

#[test]
fn what_cannot_be_seen_or_is_not_finite_is_left_out() {
    let mut keypoints =
        Array3::from_shape_fn((12, 1, 2), |(t, _, axis)| ((3 * t + axis) % 7) as f64 / 7.0);
    let mut truth = Array3::from_elem((12, 2, 2), f64::NAN);
    for t in 0..12 {
        for axis in 0..2 {
            truth[[t, 0, axis]] = 0.5 - keypoints[[t, 0, axis]];
        }
    }
    keypoints[[4, 0, 1]] = f64::INFINITY;
    let found = regression(keypoints.view(), truth.view(), None).expect("a regression");
    assert_eq!(found[0].frames, 11);
    // A linear function of the keypoint: what is left is rounding.
    assert!(found[0].error.expect("an error") < 1e-28, "{:?}", found[0]);
    assert_eq!((found[1].frames, found[1].error), (0, None));
    // All frames in one fold: there is nothing to fit on.
    let folds = vec![0; 12];
    let held_out = regression(keypoints.view(), truth.view(), Some(&folds)).expect("a regression");
    assert_eq!(held_out[0].error, None);
    let matched = assignment(
        keypoints.view(),
        truth.view(),
        [0..3, 4..5, std::ops::Range { start: 5, end: 99 }],
    )
    .expect("an assignment");
    assert_eq!((matched.keypoints, matched.objects), (2, 2));
    assert!(regression(keypoints.view(), truth.view(), Some(&folds[1..])).is_err());
    let short = truth.slice(ndarray::s![1.., .., ..]);
    assert!(assignment(keypoints.view(), short, std::iter::once(0..12)).is_err());
}

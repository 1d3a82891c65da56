//! Points in space: maps 3 -> 3, 2 -> 3 and 3 -> 2, against known maps, numpy
//! (`golden/make_space.py`) and the plane; and cameras.

use ndarray::{Array2, Array3, ArrayView3, Axis, s};
use serde_json::Value;
use tracklens::data::Camera;
use tracklens::evaluation::{EvaluationReport, JoinReport, Request, Scoring, Thresholds};
use tracklens::metric::{
    Accumulator, Evaluation, Moments, NonFinite, Object, Rank, Settings, Transform, evaluate,
};
use tracklens::track::{FrameKey, GroundTruth, KeypointTrack};

/// Keypoints and objects of so many coordinates.
const DIMENSIONS: [[usize; 2]; 4] = [[3, 3], [2, 3], [3, 2], [2, 2]];

fn settings(transform: Transform, rank: Rank) -> Settings {
    Settings {
        transform,
        rank,
        ..Settings::default()
    }
}

/// Points that move in every direction, T x count x axes, within -1 to 1.
fn paths(frames: usize, count: usize, axes: usize, seed: f64) -> Array3<f64> {
    Array3::from_shape_fn((frames, count, axes), |(t, n, axis)| {
        let speed = 0.31 + 0.17 * (n * axes + axis) as f64 + 0.05 * seed;
        (speed * t as f64 + seed + axis as f64).sin()
    })
}

/// Objects that are affine images of the keypoints of the same number.
fn images(keypoints: ArrayView3<f64>, axes: usize) -> Array3<f64> {
    let (frames, count, of_keypoint) = keypoints.dim();
    Array3::from_shape_fn((frames, count, axes), |(t, k, row)| {
        let factor = |column: usize| (1.3 * (row * 3 + column + 5 * k) as f64).cos();
        let sum: f64 = (0..of_keypoint)
            .map(|c| factor(c) * keypoints[[t, k, c]])
            .sum();
        sum + 0.3 * (row + k) as f64
    })
}

fn objects(count: usize) -> Vec<Object> {
    (0..count)
        .map(|k| Object::new(k.to_string(), 0.015))
        .collect()
}

fn scored(keypoints: &Array3<f64>, truth: &Array3<f64>, settings: &Settings) -> Evaluation {
    let objects = objects(truth.dim().1);
    let policy = NonFinite::ExcludePoint;
    evaluate(keypoints.view(), truth.view(), &objects, policy, settings).expect("an evaluation")
}

#[test]
fn known_maps_between_plane_and_space_are_found() {
    for [z, x] in DIMENSIONS {
        let keypoints = paths(200, 3, z, 0.5);
        let truth = images(keypoints.view(), x);
        for rank in [Rank::Reference, Rank::Centred] {
            let found = scored(&keypoints, &truth, &settings(Transform::Affine, rank));
            assert_eq!(found.axes, [z, x]);
            for (k, object) in found.objects.iter().enumerate() {
                let best = object.best.expect("a best keypoint");
                assert_eq!(best.keypoint, k);
                assert!(best.fit.error() < 1e-12, "{z} -> {x}: {}", best.fit.error());
                assert_eq!(best.fit.map.a.len(), x);
                for (row, factors) in best.fit.map.a.iter().enumerate() {
                    for (column, factor) in factors.iter().enumerate() {
                        let known = (1.3 * (row * 3 + column + 5 * k) as f64).cos();
                        assert!((factor - known).abs() < 1e-12, "{factor} {known}");
                    }
                }
                let at: Vec<f64> = keypoints.slice(s![7, k, ..]).to_vec();
                let mapped = best.fit.map.apply(&at);
                for (value, expected) in mapped.iter().zip(truth.slice(s![7, k, ..])) {
                    assert!((value - expected).abs() < 1e-12);
                }
            }
        }
    }
}

fn array(nested: &Value) -> Array3<f64> {
    let rows = |value: &Value| value.as_array().expect("an array").clone();
    let all = rows(nested);
    let count = rows(&all[0]).len();
    let axes = rows(&rows(&all[0])[0]).len();
    let values = all.iter().flat_map(rows).flat_map(|point| rows(&point));
    let values: Vec<f64> = values.map(|v| v.as_f64().unwrap_or(f64::NAN)).collect();
    Array3::from_shape_vec((all.len(), count, axes), values).expect("T x n x axes")
}

fn golden() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/golden/space.json");
    serde_json::from_slice(&std::fs::read(path).expect("the golden file")).expect("JSON")
}

/// Joined points of sequences of `length` frames.
fn scoring(keypoints: &Array3<f64>, truth: &Array3<f64>, length: usize) -> Scoring {
    let key = |t: usize| FrameKey {
        sequence: format!("seq_{}", t / length),
        frame: (t % length) as u64,
    };
    let keys: Vec<FrameKey> = (0..truth.dim().0).map(key).collect();
    let names = (0..truth.dim().1).map(|k| format!("object_{k}")).collect();
    let truth = GroundTruth::new(keys.clone(), names, truth.clone()).expect("a ground truth");
    let keypoints = KeypointTrack::new(keys, keypoints.clone()).expect("keypoints");
    Scoring::new(&truth, &keypoints, NonFinite::ExcludePoint).expect("joined")
}

fn report(scoring: &Scoring, keypoints: usize) -> EvaluationReport {
    let join = JoinReport::new(scoring.join(), scoring.keys(), scoring.keys());
    let request = Request {
        settings: settings(Transform::Affine, Rank::of_axes(keypoints)),
        folds: Some(3),
        bootstrap: Some(20),
        sequences: true,
        ..Request::default()
    };
    request.evaluate(scoring, &join).expect("an evaluation")
}

#[test]
fn errors_in_space_are_those_of_numpy() {
    let golden = golden();
    let length = golden["length"].as_u64().expect("a length") as usize;
    for case in golden["cases"].as_array().expect("cases") {
        let (keypoints, truth) = (array(&case["keypoints"]), array(&case["truth"]));
        let scoring = scoring(&keypoints, &truth, length);
        let found = report(&scoring, keypoints.dim().2);
        // Both are least squares in f64; moments lose digits relative to the variance.
        let variance = truth
            .iter()
            .filter(|v| v.is_finite())
            .map(|v| v * v)
            .sum::<f64>()
            / truth.len() as f64;
        let near = |found: f64, expected: &Value| {
            let expected = expected.as_f64().expect("an error");
            assert!(
                (found - expected).abs() < 1e-13 * variance,
                "{found} {expected}"
            );
        };
        for (k, row) in found.errors.iter().enumerate() {
            for (n, error) in row.iter().enumerate() {
                near(error.expect("an error"), &case["errors"][k][n]);
            }
        }
        let held_out = found.held_out.as_ref().expect("held-out errors");
        for (k, object) in held_out.objects.iter().enumerate() {
            near(object.error.expect("an error"), &case["held_out"][k]);
        }
        for of in found.sequences.iter().flatten() {
            let frames: u64 = of.errors.iter().map(|sequence| sequence.frames).sum();
            let sum: f64 = of.errors.iter().map(|s| s.error * s.frames as f64).sum();
            let object = found
                .objects
                .iter()
                .find(|o| o.name == of.object)
                .expect("it");
            let error = object.error.expect("an error");
            assert!((sum / frames as f64 - error).abs() < 1e-12 * variance);
        }
        let interval = found.intervals.expect("intervals").objects[0]
            .error
            .expect("one");
        assert!(interval[0] <= interval[1] && interval[1] > 0.0);
    }
}

#[test]
fn a_plane_in_space_has_the_errors_of_the_plane() {
    let keypoints = paths(150, 4, 2, 0.2);
    let noise = paths(150, 4, 2, 2.6);
    let truth = images(keypoints.view(), 2) + 0.1 * noise;
    let raised = |points: &Array3<f64>| {
        let (frames, count, _) = points.dim();
        let mut all = Array3::from_elem((frames, count, 3), 0.75);
        all.slice_mut(s![.., .., ..2]).assign(points);
        all
    };
    for rank in [Rank::Reference, Rank::Centred] {
        let settings = settings(Transform::Affine, rank);
        let plane = scored(&keypoints, &truth, &settings);
        assert_eq!(plane.directions_dropped, 0);
        for (z, x) in [
            (raised(&keypoints), raised(&truth)),
            (keypoints.clone(), raised(&truth)),
            (raised(&keypoints), truth.clone()),
        ] {
            let space = scored(&z, &x, &settings);
            for (a, b) in plane.errors.iter().zip(&space.errors) {
                assert!((a - b).abs() < 1e-14, "{a} {b}");
            }
            // The third coordinate of a keypoint rests.
            let dropped = if z.dim().2 == 3 {
                space.errors.len()
            } else {
                0
            };
            assert_eq!(space.directions_dropped, dropped);
        }
    }
}

#[test]
fn maps_of_each_coordinate_by_itself_need_as_many_of_both() {
    let keypoints = paths(80, 2, 3, 0.1);
    let mut truth = keypoints.clone();
    for (axis, mut values) in truth.axis_iter_mut(Axis(2)).enumerate() {
        values.mapv_inplace(|v| (axis as f64 + 0.5) * v - 0.2);
    }
    for rank in [Rank::Reference, Rank::Centred] {
        let scaled = scored(
            &keypoints,
            &truth,
            &settings(Transform::ScaleTranslate, rank),
        );
        let fit = scaled.objects[1].best.expect("a best keypoint").fit;
        assert!(fit.error() < 1e-12);
        assert!((fit.map.a[2][2] - 2.5).abs() < 1e-12 && fit.map.a[2][0] == 0.0);
    }
    let as_is = scored(
        &keypoints,
        &truth,
        &settings(Transform::Identity, Rank::Centred),
    );
    let distance = |t: usize| {
        let (x, z) = (truth.slice(s![t, 0, ..]), keypoints.slice(s![t, 0, ..]));
        x.iter().zip(z).map(|(x, z)| (x - z).powi(2)).sum::<f64>()
    };
    let expected = (0..80).map(distance).sum::<f64>() / 80.0;
    assert!((as_is.errors[[0, 0]] - expected).abs() < 1e-12);

    let flat = truth.slice(s![.., .., ..2]).to_owned();
    let error = evaluate(
        keypoints.view(),
        flat.view(),
        &objects(2),
        NonFinite::Error,
        &settings(Transform::Identity, Rank::Centred),
    );
    let error = error.expect_err("three coordinates and two").to_string();
    assert!(
        error.contains("`identity` goes coordinate by coordinate"),
        "{error}"
    );
}

#[test]
fn a_point_without_z_is_missing_and_frames_split_and_merged_are_the_same() {
    let mut keypoints = paths(100, 2, 3, 0.4);
    let noise = paths(100, 2, 3, 1.7);
    let mut truth = images(keypoints.view(), 3) + 0.05 * noise;
    truth[[5, 0, 2]] = f64::NAN;
    keypoints[[9, 1, 2]] = f64::NAN;
    keypoints[[70, 1, 0]] = f64::NAN;
    let settings = settings(Transform::Affine, Rank::Centred);
    let found = scored(&keypoints, &truth, &settings);
    assert_eq!(
        (found.objects[0].frames, found.objects[1].frames),
        (99, 100)
    );
    assert_eq!(found.missing, [0, 2]);
    let moments = |frames: std::ops::Range<usize>| {
        let policy = NonFinite::ExcludePoint;
        let mut accumulator = Accumulator::of_axes(2, 2, [3, 3], policy).expect("in space");
        for t in frames {
            let (z, x) = (
                keypoints.index_axis(Axis(0), t),
                truth.index_axis(Axis(0), t),
            );
            accumulator.push(z, x).expect("a frame");
        }
        accumulator
    };
    let mut first = moments(0..33);
    first.merge(moments(33..100)).expect("alike");
    let merged = first
        .finish()
        .evaluate(&objects(2), &settings)
        .expect("an evaluation");
    let mut parts: Moments = moments(0..60).finish();
    parts.merge(&moments(60..100).finish()).expect("alike");
    let added = parts
        .evaluate(&objects(2), &settings)
        .expect("an evaluation");
    for other in [merged, added] {
        for (a, b) in found.errors.iter().zip(&other.errors) {
            assert!((a - b).abs() < 1e-14, "{a} {b}");
        }
    }
    let plane = Accumulator::new(2, 2, NonFinite::Error);
    assert!(moments(0..2).merge(plane).is_err(), "other coordinates");
    let mut accumulator = moments(0..2);
    let flat = Array2::zeros((2, 2));
    assert!(accumulator.push(flat.view(), flat.view()).is_err());
    truth[[0, 0, 2]] = f64::INFINITY;
    let x = truth.index_axis(Axis(0), 0);
    assert!(
        accumulator
            .push(keypoints.index_axis(Axis(0), 0), x)
            .is_err()
    );
    assert_eq!(
        accumulator.finish().frames(),
        2,
        "what is refused changes nothing"
    );
}

#[test]
fn the_unit_of_space_changes_errors_by_its_square() {
    let keypoints = paths(64, 2, 3, 0.3);
    let truth = images(keypoints.view(), 3) + 0.2 * paths(64, 2, 3, 1.1);
    let settings = settings(Transform::Affine, Rank::Centred);
    let plain = scored(&keypoints, &truth, &settings);
    // Powers of two are exact, also where squares leave the range of f64.
    for power in [7, -9, 450, -450] {
        let factor = 2f64.powi(power);
        let scaled = scored(&(&keypoints * factor), &(&truth * factor), &settings);
        for (a, b) in plain.errors.iter().zip(&scaled.errors) {
            let b = b / factor / factor;
            assert!((a - b).abs() <= 1e-12 * a, "2^{power}: {a} {b}");
        }
    }
}

#[test]
fn default_thresholds_take_the_box_of_the_objects_for_the_image() {
    let truth = 500.0 * paths(120, 2, 3, 0.9);
    let keypoints = paths(120, 3, 2, 0.3);
    let scoring = scoring(&keypoints, &truth, 40);
    let values = |axis: usize| truth.index_axis(Axis(2), axis).to_owned();
    let side = (0..3).map(|axis| {
        let values = values(axis);
        let largest = values.iter().copied().fold(f64::MIN, f64::max);
        largest - values.iter().copied().fold(f64::MAX, f64::min)
    });
    let unit = (side.fold(0.0, f64::max) / 2.0).powi(2);
    assert_eq!(scoring.threshold_unit(), unit);
    let given = ["object_1=7".parse().expect("a threshold")];
    let thresholds = Thresholds::new(given).expect("thresholds");
    let found = scoring
        .evaluate(&thresholds, &Settings::default())
        .expect("an evaluation");
    let thresholds = found.objects.iter().map(|object| object.threshold);
    assert_eq!(thresholds.collect::<Vec<f64>>(), [0.015 * unit, 7.0]);
    let report = report(&scoring, 2);
    let said = |text: &str| report.warnings.iter().any(|warning| warning.contains(text));
    assert!(said(
        "keypoints have two coordinates and the ground truth three"
    ));
    assert!(said(
        "the thresholds of object_0, object_1 are the defaults of an image"
    ));
    let error = scoring.context(None).expect_err("no image").to_string();
    assert!(
        error.contains("compare distances with the size of the image"),
        "{error}"
    );
}

#[test]
fn an_evaluation_in_space_is_read_back_and_older_versions_see_a_newer_schema() {
    let keypoints = paths(90, 2, 3, 0.4);
    let truth = images(keypoints.view(), 3) + 0.01 * paths(90, 2, 3, 2.0);
    let report = report(&scoring(&keypoints, &truth, 30), 3);
    assert_eq!(report.schema, "tracklens/evaluation/4");
    assert_eq!(report.rank, "centred");
    assert!(report.is_in_space());
    let json = serde_json::to_vec(&report).expect("JSON");
    let again = EvaluationReport::parse(&json, "evaluation.json").expect("an evaluation");
    assert_eq!(again, report);
    let value: Value = serde_json::from_slice(&json).expect("JSON");
    assert_eq!(value["dimensions"]["truth"], 3);
    assert_eq!(
        value["objects"][0]["map"]["a"].as_array().map(Vec::len),
        Some(3)
    );

    let flat = |points: &Array3<f64>| points.slice(s![.., .., ..2]).to_owned();
    let plane = scoring(&flat(&keypoints), &flat(&truth), 30);
    let plane = self::report(&plane, 2);
    assert_eq!(plane.schema, "tracklens/evaluation/3");
    assert_eq!((plane.rank.as_str(), plane.dimensions), ("reference", None));
}

#[test]
fn a_camera_projects_as_opencv_writes_it() {
    let golden = &golden()["camera"];
    let bytes = serde_json::to_vec(&golden["file"]).expect("JSON");
    let camera = Camera::parse(&bytes, "camera.json").expect("a camera");
    let numbers = |value: &Value| -> Vec<f64> {
        let values = value.as_array().expect("numbers").iter();
        values.map(|v| v.as_f64().expect("a number")).collect()
    };
    let world = golden["world"].as_array().expect("positions");
    let ndc = golden["ndc"].as_array().expect("positions");
    for (world, expected) in world.iter().zip(ndc) {
        let world: [f64; 3] = numbers(world).try_into().expect("three");
        let found = camera.ndc_from_world(world).expect("in front");
        for (found, expected) in found.iter().zip(numbers(expected)) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
    }
    // Straight behind.
    let behind = [0, 1, 2].map(|axis| -10.0 * camera.rotation[2][axis]);
    assert_eq!(camera.ndc_from_world(behind), None);
}

#[test]
fn a_wrong_camera_says_what_is_wrong_with_it() {
    let good = serde_json::json!({
        "image_size": [64, 48],
        "intrinsics": [[50, 0, 31.5], [0, 50, 23.5], [0, 0, 1]],
        "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "translation": [0, 0, 2],
    });
    let parse = |camera: &Value| Camera::parse(camera.to_string().as_bytes(), "camera.json");
    parse(&good).expect("a camera");
    for (key, value, said) in [
        (
            "image_size",
            serde_json::json!([0, 48]),
            "`image_size` is [0, 48]",
        ),
        (
            "intrinsics",
            serde_json::json!([[50, 0, 1], [0, -50, 1], [0, 0, 1]]),
            "`intrinsics` are",
        ),
        (
            "intrinsics",
            serde_json::json!([50, 50, 1, 1]),
            "not the JSON of a camera",
        ),
        (
            "rotation",
            serde_json::json!([[1, 0, 0], [0, 1, 0], [0, 0, -1]]),
            "not mirrored",
        ),
        (
            "rotation",
            serde_json::json!([[2, 0, 0], [0, 1, 0], [0, 0, 1]]),
            "right angles",
        ),
        (
            "translation",
            serde_json::json!([0, 0]),
            "not the JSON of a camera",
        ),
        (
            "distortion",
            serde_json::json!([0.1]),
            "not the JSON of a camera",
        ),
        (
            "fisheye",
            serde_json::json!(true),
            "unknown field `fisheye`",
        ),
    ] {
        let mut camera = good.clone();
        camera[key] = value;
        let error = parse(&camera).expect_err(key).to_string();
        assert!(
            error.starts_with("camera.json") && error.contains(said),
            "{key}: {error}"
        );
    }
    let mut camera = good;
    camera
        .as_object_mut()
        .expect("an object")
        .remove("rotation");
    let error = parse(&camera).expect_err("no rotation").to_string();
    assert!(error.contains("missing field `rotation`"), "{error}");
}

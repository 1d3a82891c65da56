//! Measures over time, against numpy and SciPy (`golden/make_temporal.py`) and in closed form.

use ndarray::{Array2, Array3};
use serde_json::Value;
use tracklens::evaluation::{Scoring, Temporal, Thresholds};
use tracklens::metric::context::CLOSE;
use tracklens::metric::temporal::{
    Paths, Tracks, acceleration_error, lag, oks, velocity_correlation,
};
use tracklens::metric::{NonFinite, Settings};
use tracklens::track::{FrameKey, GroundTruth, KeypointTrack};

/// Both compute in f64 what are sums over at most 150 frames; maps come from normal equations here
/// and a singular value decomposition there, of condition numbers below 1e3.
const RELATIVE: f64 = 1e-9;
/// Both stop the projective map's fit where it no longer changes: its error is flat there.
const PROJECTIVE: f64 = 1e-6;

fn numbers(values: &Value) -> Vec<f64> {
    let values = values.as_array().expect("numbers").iter();
    values
        .map(|value| value.as_f64().unwrap_or(f64::NAN))
        .collect()
}

fn keys(frames: usize, length: usize) -> Vec<FrameKey> {
    let key = |t: usize| FrameKey {
        sequence: format!("seq_{}", t / length),
        frame: (t % length) as u64,
    };
    (0..frames).map(key).collect()
}

fn measured(
    keypoints: Array3<f64>,
    truth: Array3<f64>,
    length: usize,
    threshold: f64,
    folds: Option<usize>,
) -> Temporal {
    let keys = keys(truth.dim().0, length);
    let names: Vec<String> = (0..truth.dim().1).map(|k| format!("object_{k}")).collect();
    let given = names.iter().map(|name| format!("{name}={threshold}"));
    let given = given.map(|text| text.parse().expect("a threshold"));
    let thresholds = Thresholds::new(given).expect("thresholds");
    let truth = GroundTruth::new(keys.clone(), names, truth).expect("a ground truth");
    let keypoints = KeypointTrack::new(keys, keypoints).expect("keypoints");
    Scoring::new(&truth, &keypoints, NonFinite::ExcludePoint)
        .and_then(|scoring| scoring.temporal(folds, 0, &thresholds, &Settings::default()))
        .expect("measures")
}

#[track_caller]
fn near(found: Option<f64>, expected: &Value, tolerance: f64, what: &str) {
    let (found, expected) = (found.expect(what), expected.as_f64().expect(what));
    let allowed = tolerance * expected.abs().max(1e-3);
    assert!(
        (found - expected).abs() <= allowed,
        "{what}: {found}, expected {expected}"
    );
}

#[test]
fn measures_over_time_equal_numpy_and_scipy() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/golden/temporal.json");
    let text = std::fs::read_to_string(path).expect("the fixture");
    let fixture: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(numbers(&fixture["close"]), CLOSE);
    for case in fixture["cases"].as_array().expect("cases") {
        let name = case["name"].as_str().expect("a name");
        let shape: Vec<usize> = numbers(&case["shape"])
            .iter()
            .map(|n| *n as usize)
            .collect();
        let points = |key: &str, count| {
            Array3::from_shape_vec((shape[0], count, 2), numbers(&case[key])).expect("the shape")
        };
        let length = case["length"].as_u64().expect("a length") as usize;
        let threshold = case["threshold"].as_f64().expect("a threshold");
        let found = measured(
            points("keypoints", shape[1]),
            points("truth", shape[2]),
            length,
            threshold,
            Some(2),
        );
        near(found.oks, &case["oks"], RELATIVE, name);
        for (measure, value) in [
            ("occlusion_accuracy", found.tap_vid.occlusion_accuracy),
            ("position_accuracy", found.tap_vid.position_accuracy),
            ("average_jaccard", found.tap_vid.average_jaccard),
        ] {
            near(value, &case["tap_vid"][measure], RELATIVE, measure);
        }
        let expected = case["objects"].as_array().expect("objects");
        assert_eq!(found.objects.len(), expected.len());
        for (found, expected) in found.objects.iter().zip(expected) {
            let what = |measure: &str| format!("{name}, {}, {measure}", found.name);
            assert_eq!(
                found.keypoint.map(|n| n as u64),
                expected["keypoint"].as_u64()
            );
            assert_eq!(found.lag, expected["lag"].as_i64(), "{}", what("lag"));
            let of_maps = &expected["held_out"];
            for (measure, value, expected, tolerance) in [
                ("jitter", found.jitter, &expected["jitter"], RELATIVE),
                (
                    "velocity",
                    found.velocity_correlation,
                    &expected["velocity_correlation"],
                    RELATIVE,
                ),
                (
                    "handed over",
                    found.handed_over,
                    &expected["handed_over"],
                    RELATIVE,
                ),
                (
                    "affine",
                    found.held_out.affine,
                    &of_maps["affine"],
                    RELATIVE,
                ),
                (
                    "orientation",
                    found.held_out.orientation,
                    &of_maps["orientation"],
                    RELATIVE,
                ),
                (
                    "projective",
                    found.held_out.projective,
                    &of_maps["projective"],
                    PROJECTIVE,
                ),
                (
                    "visibility",
                    found.tap_vid.occlusion_accuracy,
                    &expected["tap_vid"]["occlusion_accuracy"],
                    RELATIVE,
                ),
                (
                    "positions",
                    found.tap_vid.position_accuracy,
                    &expected["tap_vid"]["position_accuracy"],
                    RELATIVE,
                ),
                (
                    "Jaccard",
                    found.tap_vid.average_jaccard,
                    &expected["tap_vid"]["average_jaccard"],
                    RELATIVE,
                ),
                ("OKS", found.oks, &expected["oks"], RELATIVE),
            ] {
                near(value, expected, tolerance, &what(measure));
            }
            let pck = found.pck.expect("an object");
            assert_eq!(pck.to_vec(), numbers(&expected["pck"]), "{}", what("PCK"));
        }
    }
}

/// Points on a path, T x 2.
fn path(frames: usize, at: impl Fn(f64) -> [f64; 2]) -> Array2<f64> {
    let points: Vec<f64> = (0..frames).flat_map(|t| at(t as f64)).collect();
    Array2::from_shape_vec((frames, 2), points).expect("two a frame")
}

fn curve(t: f64) -> [f64; 2] {
    [0.5 * (0.3 * t).sin(), 0.4 * (0.17 * t).cos()]
}

#[test]
fn a_keypoint_that_shakes_by_d_has_a_jitter_of_4_d() {
    let truth = path(30, curve);
    let shaking = path(30, |t| {
        let [x, y] = curve(t);
        let side = if t as i64 % 2 == 0 { 1.0 } else { -1.0 };
        [x + 0.03 * side, y + 0.04 * side]
    });
    let runs = [0..12, 12..30];
    let paths = |mapped| Paths {
        truth: truth.view(),
        mapped,
        runs: &runs,
    };
    // The distance vector goes from -d to d and back: its second difference is 4 d, d = 0.05.
    let jitter = acceleration_error(paths(shaking.view())).expect("frames in a row");
    assert!((jitter - 0.2).abs() < 1e-14, "{jitter}");
    // An offset that grows evenly bends nothing.
    let drifting = path(30, |t| {
        let [x, y] = curve(t);
        [x + 0.01 * t, y - 0.02 * t]
    });
    let jitter = acceleration_error(paths(drifting.view())).expect("frames in a row");
    assert!(jitter < 1e-14, "{jitter}");
    let short = [0..2, 2..4];
    let none = Paths {
        runs: &short,
        ..paths(shaking.view())
    };
    assert_eq!(acceleration_error(none), None);
}

#[test]
fn a_keypoint_that_comes_three_frames_later_has_a_lag_of_3() {
    let truth = path(60, curve);
    for late in [-7, -1, 0, 3, 10] {
        let mapped = path(60, |t| curve(t - f64::from(late)));
        let paths = Paths {
            truth: truth.view(),
            mapped: mapped.view(),
            runs: std::slice::from_ref(&(0..60)),
        };
        assert_eq!(lag(paths), Some(i64::from(late)));
        let same = velocity_correlation(paths, i64::from(late)).expect("motion");
        assert!((same - 1.0).abs() < 1e-12, "{same}");
    }
    // The opposite motion, one at right angles, and none.
    for (turn, expected) in [
        ([-2.0, 0.0], Some(-1.0)),
        ([0.0, 3.0], Some(0.0)),
        ([0.0; 2], None),
    ] {
        let mapped = path(60, |t| {
            let [x, y] = curve(t);
            [turn[0] * x - turn[1] * y, turn[1] * x + turn[0] * y]
        });
        let found = velocity_correlation(
            Paths {
                truth: truth.view(),
                mapped: mapped.view(),
                runs: std::slice::from_ref(&(0..60)),
            },
            0,
        );
        match (found, expected) {
            (Some(found), Some(expected)) => assert!((found - expected).abs() < 1e-12),
            (found, expected) => assert_eq!(found, expected),
        }
    }
}

#[test]
fn an_object_that_another_keypoint_has_in_a_tenth_of_the_frames_is_handed_over_there() {
    // Keypoint 0 follows in 90 frames of 100 and rests in ten, in which keypoint 1 follows.
    let (mut keypoints, mut truth) = (Array3::zeros((100, 2, 2)), Array3::zeros((100, 1, 2)));
    for t in 0..100 {
        let [x, y] = curve(t as f64);
        (truth[[t, 0, 0]], truth[[t, 0, 1]]) = (x, y);
        let (here, there) = if (40..50).contains(&t) {
            (1, 0)
        } else {
            (0, 1)
        };
        (keypoints[[t, here, 0]], keypoints[[t, here, 1]]) = (x, y);
        (keypoints[[t, there, 0]], keypoints[[t, there, 1]]) = (2.0, 2.0);
    }
    // A keypoint that is away is not there, rather than an outlier that bends its map.
    let gone = keypoints.mapv(|v| if v == 2.0 { f64::NAN } else { v });
    let found = measured(gone, truth.clone(), 100, 1e-6, None);
    assert_eq!(found.objects[0].keypoint, Some(0));
    assert_eq!(found.objects[0].handed_over, Some(0.1));
    let alone = measured(truth.clone(), truth, 100, 1e-6, None);
    assert_eq!(alone.objects[0].handed_over, Some(0.0));
}

/// Two sequences of an object that a keypoint follows under `of`, with a second keypoint.
fn two_sequences(of: impl Fn(f64) -> [[f64; 2]; 3]) -> Temporal {
    let (mut keypoints, mut truth) = (Array3::zeros((80, 2, 2)), Array3::zeros((80, 1, 2)));
    for t in 0..80 {
        let [z, m, x] = of(t as f64 * 1.3);
        for axis in 0..2 {
            keypoints[[t, 0, axis]] = z[axis];
            keypoints[[t, 1, axis]] = m[axis];
            truth[[t, 0, axis]] = x[axis];
        }
    }
    measured(keypoints, truth, 40, 0.01, Some(2))
}

#[test]
fn each_map_has_no_held_out_error_where_it_is_the_right_one() {
    // A point that is carried around the keypoint: 0.2 from it, where the second keypoint is 0.3 away.
    let carried = two_sequences(|t| {
        let ([x, y], turn) = (curve(t), 0.7 * t);
        let at = |r: f64| [x + r * turn.cos(), y + r * turn.sin()];
        [[x, y], at(0.3), at(0.2)]
    });
    let maps = carried.objects[0].held_out;
    let is_zero = |error: Option<f64>| error.is_some_and(|error| error < 1e-24);
    assert!(is_zero(maps.orientation), "{maps:?}");
    // The nearer keypoint is the best: what turns around it at 0.1 is off by nearly that.
    assert!(
        maps.affine > Some(0.005) && maps.projective > Some(0.005),
        "{maps:?}"
    );

    // A plane that is seen from the side.
    let projected = two_sequences(|t| {
        let [x, y] = curve(t);
        let under = 1.0 + 0.6 * x - 0.3 * y;
        [
            [x, y],
            [y, x],
            [(0.8 * x - 0.1 * y) / under, (0.2 * x + y + 0.1) / under],
        ]
    });
    let maps = projected.objects[0].held_out;
    assert!(is_zero(maps.projective), "{maps:?}");
    assert!(maps.affine > Some(1e-4), "{maps:?}");

    let straight = two_sequences(|t| {
        let [x, y] = curve(t);
        [[x, y], [y, x], [0.5 * x - y, 0.3 * x + 0.2]]
    });
    let maps = straight.objects[0].held_out;
    assert!(is_zero(maps.affine) && is_zero(maps.projective), "{maps:?}");
}

#[test]
fn tap_vids_measures_are_those_of_a_count_by_hand() {
    // Half a pixel, 3 pixels and 100 pixels away, once missing, once there without an object, and
    // once both missing: pixels of 1/128 of ndc.
    let at = |pixels: f64| Some([pixels / 128.0, 0.0]);
    let origin = Some([0.0; 2]);
    let mut tracks = Tracks::default();
    for (truth, mapped) in [
        (origin, at(0.5)),
        (origin, at(3.0)),
        (origin, at(100.0)),
        (origin, None),
        (None, at(0.0)),
        (None, None),
    ] {
        tracks.push(truth, mapped);
    }
    let found = tracks.measures();
    // 4 of 6 frames agree. Within 1 and 2 pixels 1 of 4 positions, within 4, 8 and 16 2 of 4.
    let accuracy = (2.0 * 0.25 + 3.0 * 0.5) / 5.0;
    // Within 1 and 2 pixels 1 of 4 + 3, from 4 on 2 of 4 + 2.
    let jaccard = (2.0 / 7.0 + 3.0 * 2.0 / 6.0) / 5.0;
    for (found, expected) in [
        (found.occlusion_accuracy, 4.0 / 6.0),
        (found.position_accuracy, accuracy),
        (found.average_jaccard, jaccard),
    ] {
        assert!((found.expect("a measure") - expected).abs() < 1e-15);
    }
    assert_eq!(Tracks::default().measures().average_jaccard, None);
}

#[test]
fn oks_is_a_gaussian_of_the_distance_over_the_size_of_the_scene() {
    // A box of 1 x 0.5 around two objects; one keypoint is right, the other 0.1 away.
    let truth = ndarray::array![[[0.0, 0.0], [1.0, 0.5]], [[0.0, 0.0], [f64::NAN, 0.0]]];
    let mapped = ndarray::array![[[0.0, 0.0], [1.0, 0.4]], [[0.0, 0.0], [0.0, 0.0]]];
    let found = oks(mapped.view(), truth.view());
    // d² / (2 s² κ²) = 0.01 / (2 · 0.5 · 0.01) = 1; the second frame shows one object, and has no size.
    let away = (-1.0_f64).exp();
    let near = |a: Option<f64>, b: f64| a.is_some_and(|a| (a - b).abs() < 1e-12);
    assert!(
        near(found.objects[0], 1.0) && near(found.objects[1], away),
        "{found:?}"
    );
    assert!(near(found.all, (1.0 + away) / 2.0), "{found:?}");
}

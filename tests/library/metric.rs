//! The metric against the authors' code (`golden/metric`, computed by it in float32 with PyTorch)
//! and against properties it must have.

mod missing;
mod range;
mod sufficiency;

use ndarray::{Array2, Array3, ArrayView3, Axis, Slice};
use proptest::prelude::*;
use serde_json::Value;
use tracklens::metric::{
    Accumulator, Evaluation, Moments, NonFinite, Object, Rank, Settings, Transform, bootstrap,
    evaluate, held_out,
};

/// The reference rounds to float32: its own errors differ from float64 by up to 3.4e-7 on these
/// cases (each file records its own difference as `max_abs_diff_vs_numpy_f64`).
const TOLERANCE: f64 = 1e-6;

struct Golden {
    keypoints: Array3<f64>,
    truth: Array3<f64>,
    json: Value,
}

fn golden(case: &str) -> Golden {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/golden/metric");
    let read = |ending: &str| std::fs::read(format!("{folder}/{case}{ending}"));
    let json: Value = serde_json::from_slice(&read(".json").expect("a golden file")).expect("JSON");
    let count = |key: &str| json[key].as_u64().expect("a count") as usize;
    let points = |key: &str, n: usize| {
        let values: Vec<f64> = match json.get(key) {
            Some(nested) => flatten(nested),
            None => read(&format!(".{key}.f32"))
                .expect("a golden array")
                .chunks_exact(4)
                .map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])))
                .collect(),
        };
        // The reference speaks (y, x).
        let mut points = Array3::from_shape_vec((count("T"), n, 2), values).expect("T x n x 2");
        points.invert_axis(Axis(2));
        points
    };
    Golden {
        keypoints: points("keypoints", count("N")),
        truth: points("ground_truth", count("K")),
        json,
    }
}

fn flatten(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flatten).collect(),
        other => vec![other.as_f64().unwrap_or(f64::NAN)],
    }
}

fn objects(count: usize) -> Vec<Object> {
    (0..count)
        .map(|k| Object::new(format!("object {k}"), 0.015))
        .collect()
}

fn settings(transform: Transform, rank: Rank) -> Settings {
    Settings {
        transform,
        rank,
        ..Settings::default()
    }
}

fn score(keypoints: ArrayView3<f64>, truth: ArrayView3<f64>, settings: Settings) -> Evaluation {
    let objects = objects(truth.dim().1);
    evaluate(keypoints, truth, &objects, NonFinite::Error, &settings).expect("an evaluation")
}

const TRANSFORMS: [(&str, Transform); 3] = [
    ("identity", Transform::Identity),
    ("scale_translate", Transform::ScaleTranslate),
    ("affine", Transform::Affine),
];

fn equals_the_reference(case: &str) {
    let golden = golden(case);
    for (name, transform) in TRANSFORMS {
        let ours = score(
            golden.keypoints.view(),
            golden.truth.view(),
            settings(transform, Rank::Reference),
        );
        let reference = &golden.json["transforms"][name];
        let mut largest: f64 = 0.0;
        for (k, row) in reference["pairwise"]
            .as_array()
            .expect("K rows")
            .iter()
            .enumerate()
        {
            for (n, theirs) in flatten(row).into_iter().enumerate() {
                // An object with a NaN has no error in the reference; ours leaves the frame out.
                if theirs.is_nan() {
                    assert!(ours.errors[[k, n]].is_finite());
                    continue;
                }
                largest = largest.max((ours.errors[[k, n]] - theirs).abs());
            }
            if let Some(best) = reference["argmin_first"][k].as_u64() {
                let ours_best = ours.objects[k].best.expect("a best keypoint").keypoint;
                // Float32 decides between keypoints that are equally good to float64.
                let gap = (ours.errors[[k, ours_best]] - ours.errors[[k, best as usize]]).abs();
                assert!(
                    ours_best as u64 == best || gap < TOLERANCE,
                    "{case}, {name}, object {k}"
                );
            }
        }
        println!("{case}, {name}: largest difference {largest:.1e}");
        assert!(
            largest <= TOLERANCE,
            "{case}, {name}: {largest:e} > {TOLERANCE:e}"
        );
    }
}

macro_rules! reference_cases {
    ($($case:ident)*) => {$(
        #[test]
        fn $case() {
            equals_the_reference(stringify!($case));
        }
    )*};
}

/// Every case of the reference, each by its name.
mod equals_the_reference_on {
    use super::equals_the_reference;
    reference_cases! {
        constant_keypoints duplicated_points nan_in_ground_truth nearly_constant_keypoints perfect_keypoints
        t1_single_frame t2_underdetermined t2500_n32_k3 t3_exact t50_n4_k2 t7_n1_k1
    }
}

#[test]
fn the_maps_equal_the_reference() {
    let golden = golden("t50_n4_k2");
    for (name, transform) in &TRANSFORMS[1..] {
        let mut accumulator = Accumulator::new(4, 2, NonFinite::Error);
        push_all(
            &mut accumulator,
            golden.keypoints.view(),
            golden.truth.view(),
        );
        let moments = accumulator.finish();
        for k in 0..2 {
            for n in 0..4 {
                let fit = moments
                    .fit(n, k, &settings(*transform, Rank::Reference))
                    .expect("in range")
                    .expect("visible");
                // Row vectors (y, x, 1) times a matrix there, A times column vectors (x, y) here.
                let theirs = flatten(&golden.json["transforms"][name]["matrices"][k][n]);
                let at = |row: usize, column: usize| theirs[3 * row + column];
                let expected = [[at(1, 1), at(0, 1)], [at(1, 0), at(0, 0)]];
                for row in 0..2 {
                    for column in 0..2 {
                        // Float32 weights: 1e-5 is what its least squares leaves on this case.
                        assert!((fit.map.a[row][column] - expected[row][column]).abs() < 1e-5);
                    }
                    assert!((fit.map.b[row] - at(2, 1 - row)).abs() < 1e-5);
                }
            }
        }
    }
}

#[test]
fn a_frame_without_the_object_does_not_count_for_it() {
    let mut golden = golden("t50_n4_k2");
    for t in [0, 7, 49] {
        golden
            .truth
            .index_axis_mut(Axis(0), t)
            .row_mut(1)
            .fill(f64::NAN);
    }
    let with_gaps = score(
        golden.keypoints.view(),
        golden.truth.view(),
        Settings::default(),
    );
    let kept: Vec<usize> = (0..50).filter(|t| ![0, 7, 49].contains(t)).collect();
    let without = score(
        golden.keypoints.select(Axis(0), &kept).view(),
        golden.truth.select(Axis(0), &kept).view(),
        Settings::default(),
    );
    assert_eq!(with_gaps.objects[1].frames, 47);
    assert_eq!(with_gaps.objects[0].frames, 50);
    for n in 0..4 {
        assert!((with_gaps.errors[[1, n]] - without.errors[[1, n]]).abs() < 1e-14);
    }
}

#[test]
fn an_object_visible_nowhere_has_no_error_and_is_not_tracked() {
    let mut golden = golden("t50_n4_k2");
    golden.truth.index_axis_mut(Axis(1), 0).fill(f64::NAN);
    let evaluation = score(
        golden.keypoints.view(),
        golden.truth.view(),
        Settings::default(),
    );
    assert!(evaluation.objects[0].best.is_none() && !evaluation.objects[0].tracked);
    assert_eq!(evaluation.objects[0].frames, 0);
    assert!(evaluation.tracking_capability <= 0.5);
}

#[test]
fn a_keypoint_that_is_not_finite_is_an_error_or_a_counted_exclusion() {
    let mut golden = golden("t50_n4_k2");
    golden.keypoints[[3, 2, 0]] = f64::INFINITY;
    golden.keypoints[[4, 0, 1]] = f64::NAN;
    let (z, x) = (golden.keypoints.view(), golden.truth.view());
    let refused = evaluate(z, x, &objects(2), NonFinite::Error, &Settings::default());
    assert!(
        refused
            .expect_err("refused")
            .to_string()
            .contains("keypoint 2 is (")
    );
    let excluded = evaluate(
        z,
        x,
        &objects(2),
        NonFinite::ExcludeFrame,
        &Settings::default(),
    )
    .expect("scored");
    assert_eq!((excluded.frames, excluded.excluded), (48, 2));
    assert!(excluded.errors.iter().all(|e| e.is_finite()));
}

#[test]
fn the_centred_rule_is_right_far_from_the_origin() {
    let golden = golden("t2500_n32_k3");
    let near = score(
        golden.keypoints.view(),
        golden.truth.view(),
        settings(Transform::Affine, Rank::Centred),
    );
    let far = score(
        (&golden.keypoints + 1e6).view(),
        (&golden.truth - 1e6).view(),
        settings(Transform::Affine, Rank::Centred),
    );
    for (a, b) in near.errors.iter().zip(&far.errors) {
        assert!((a - b).abs() <= 1e-6 * a, "{a} and {b}");
    }
    assert_eq!(far.directions_dropped, 0);
}

#[test]
fn dropped_directions_are_counted() {
    let golden = golden("constant_keypoints");
    for rank in [Rank::Reference, Rank::Centred] {
        let evaluation = score(
            golden.keypoints.view(),
            golden.truth.view(),
            settings(Transform::Affine, rank),
        );
        assert!(evaluation.directions_dropped > 0, "{rank:?}");
    }
}

#[test]
fn a_line_of_keypoints_is_fitted_along_the_line() {
    // Along one line there is one direction; both rules leave the other out and explain all that
    // can be.
    let t = 100;
    let along = |i: usize| i as f64 / t as f64 - 0.5;
    let keypoints =
        Array3::from_shape_fn((t, 1, 2), |(i, _, axis)| along(i) * [0.3, 0.6][axis] + 0.1);
    let truth = Array3::from_shape_fn((t, 1, 2), |(i, _, axis)| along(i) * [1.0, -0.2][axis]);
    for rank in [Rank::Reference, Rank::Centred] {
        let evaluation = score(
            keypoints.view(),
            truth.view(),
            settings(Transform::Affine, rank),
        );
        // What is left is a difference of sums of squares (variance 0.09): a few roundings of f64.
        assert!(
            evaluation.errors[[0, 0]] < 1e-15,
            "{rank:?}: {}",
            evaluation.errors[[0, 0]]
        );
        assert_eq!(evaluation.directions_dropped, 1, "{rank:?}");
    }
}

#[test]
fn the_best_keypoint_is_the_first_on_ties() {
    let one = Array3::from_shape_fn((20, 1, 2), |(t, _, axis)| {
        ((t * (axis + 2)) % 7) as f64 / 7.0
    });
    let three = ndarray::concatenate![Axis(1), &one * 0.0, one, one];
    let evaluation = score(three.view(), one.view(), Settings::default());
    assert_eq!(evaluation.objects[0].best.expect("visible").keypoint, 1);
}

#[test]
fn pixels_follow_the_aspect_of_the_image() {
    let keypoints = Array3::from_shape_fn((2, 1, 2), |(t, _, _)| t as f64);
    let truth = Array3::from_shape_fn((2, 1, 2), |(t, _, axis)| t as f64 + [0.1, 0.2][axis]);
    let evaluation = score(
        keypoints.view(),
        truth.view(),
        settings(Transform::Identity, Rank::Reference),
    );
    let fit = evaluation.objects[0].best.expect("visible").fit;
    assert!((fit.error() - 0.05).abs() < 1e-12 && (fit.error_sum() - 0.1).abs() < 1e-12);
    // 0.1 of half of 200 px and 0.2 of half of 100 px.
    assert!((fit.rmse_px([200, 100]) - 10f64.hypot(10.0)).abs() < 1e-9);
}

#[test]
fn nothing_to_score_is_an_error() {
    let empty = Array3::<f64>::zeros((0, 2, 2));
    let scored = evaluate(
        empty.view(),
        empty.view(),
        &objects(2),
        NonFinite::Error,
        &Settings::default(),
    );
    assert!(
        scored
            .expect_err("no frame")
            .to_string()
            .contains("no frame is left")
    );
    let one = Array3::<f64>::zeros((1, 1, 2));
    let object = [Object::new("cube", 0.0)];
    let scored = evaluate(
        one.view(),
        one.view(),
        &object,
        NonFinite::Error,
        &Settings::default(),
    );
    assert!(
        scored
            .expect_err("a zero threshold")
            .to_string()
            .contains("threshold of object `cube` is 0")
    );
    let mut accumulator = Accumulator::new(2, 1, NonFinite::Error);
    let wrong = accumulator.push(Array2::zeros((3, 2)).view(), Array2::zeros((1, 2)).view());
    assert!(
        wrong
            .expect_err("another N")
            .to_string()
            .contains("expected (2, 2)")
    );
}

fn push_all(accumulator: &mut Accumulator, keypoints: ArrayView3<f64>, truth: ArrayView3<f64>) {
    for (z, x) in keypoints.outer_iter().zip(truth.outer_iter()) {
        accumulator.push(z, x).expect("a frame");
    }
}

fn moments(keypoints: ArrayView3<f64>, truth: ArrayView3<f64>) -> Moments {
    let mut accumulator = Accumulator::new(keypoints.dim().1, truth.dim().1, NonFinite::Error);
    push_all(&mut accumulator, keypoints, truth);
    accumulator.finish()
}

prop_compose! {
    /// T frames of 5 keypoints and 2 objects (one hidden now and then), unevenly spread in the
    /// image.
    fn recording()(t in 3usize..200, seed in any::<u64>()) -> (Array3<f64>, Array3<f64>) {
        let mut state = seed | 1;
        let mut uniform = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
        };
        let keypoints = Array3::from_shape_fn((t, 5, 2), |(_, n, _)| uniform() * (1.0 + n as f64) * 0.2);
        let mut truth = Array3::from_shape_fn((t, 2, 2), |(t, k, axis)| {
            0.7 * keypoints[[t, k, axis]] - 0.3 * keypoints[[t, k, 1 - axis]] + 0.1 * uniform()
        });
        for t in (0..t).filter(|t| t % 11 == 3) {
            truth[[t, 1, 0]] = f64::NAN;
        }
        (keypoints, truth)
    }
}

fn close(a: &Evaluation, b: &Evaluation, tolerance: f64) -> Result<(), TestCaseError> {
    for (a, b) in a.errors.iter().zip(&b.errors) {
        prop_assert!((a - b).abs() <= tolerance, "{} and {}", a, b);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    // The same sums in another order: float64 rounding of terms below 10 leaves less than 1e-12.
    #[test]
    fn the_order_of_frames_does_not_matter((keypoints, truth) in recording()) {
        let mut order: Vec<usize> = (0..keypoints.dim().0).collect();
        order.sort_by_key(|t| (t * 7919) % 211);
        let shuffled = |points: &Array3<f64>| points.select(Axis(0), &order);
        for (_, transform) in TRANSFORMS {
            let settings = settings(transform, Rank::Reference);
            let a = score(keypoints.view(), truth.view(), settings);
            let b = score(shuffled(&keypoints).view(), shuffled(&truth).view(), settings);
            close(&a, &b, 1e-12)?;
        }
    }

    #[test]
    fn merging_equals_a_single_pass((keypoints, truth) in recording(), cut in 0.0..1.0f64) {
        let t = keypoints.dim().0;
        let cut = (t as f64 * cut) as usize;
        let part = |points: &Array3<f64>, from: usize, to: usize| {
            points.slice_axis(Axis(0), Slice::from(from..to)).to_owned()
        };
        let mut first = Accumulator::new(5, 2, NonFinite::Error);
        push_all(&mut first, part(&keypoints, 0, cut).view(), part(&truth, 0, cut).view());
        let mut second = Accumulator::new(5, 2, NonFinite::Error);
        push_all(&mut second, part(&keypoints, cut, t).view(), part(&truth, cut, t).view());
        first.merge(second).expect("the same N and K");
        let merged = first.finish();
        let single = moments(keypoints.view(), truth.view());
        prop_assert_eq!(merged.frames(), single.frames());
        for (_, transform) in TRANSFORMS {
            let settings = settings(transform, Rank::Centred);
            let a = merged.evaluate(&objects(2), &settings).expect("scored");
            let b = single.evaluate(&objects(2), &settings).expect("scored");
            close(&a, &b, 1e-12)?;
        }
    }

    // The map can undo the change exactly; the condition of the change (up to about 40) scales the
    // rounding.
    #[test]
    fn the_affine_error_is_invariant_under_affine_changes_of_the_keypoints(
        (keypoints, truth) in recording(),
        angle in 0.0..6.0f64,
        stretch in 0.1..4.0f64,
        shift in -3.0..3.0f64,
    ) {
        let (s, c) = angle.sin_cos();
        let changed = Array3::from_shape_fn(keypoints.dim(), |(t, n, axis)| {
            let (x, y) = (keypoints[[t, n, 0]], stretch * keypoints[[t, n, 1]]);
            shift + if axis == 0 { c * x - s * y } else { s * x + c * y }
        });
        for rank in [Rank::Reference, Rank::Centred] {
            let a = score(keypoints.view(), truth.view(), settings(Transform::Affine, rank));
            let b = score(changed.view(), truth.view(), settings(Transform::Affine, rank));
            close(&a, &b, 1e-10)?;
        }
    }

    #[test]
    fn richer_maps_never_leave_more((keypoints, truth) in recording()) {
        let [identity, scale, affine] = TRANSFORMS.map(|(_, transform)| {
            score(keypoints.view(), truth.view(), settings(transform, Rank::Centred))
        });
        for ((i, s), a) in identity.errors.iter().zip(&scale.errors).zip(&affine.errors) {
            prop_assert!(s <= &(i + 1e-12) && a <= &(s + 1e-12));
        }
    }
}

/// Sequences of a keypoint that follows the object, with noise, and one that does not.
fn noisy_sequences(count: usize, length: usize) -> Vec<(Array3<f64>, Array3<f64>)> {
    let noise = |i: usize| ((i * 7919 + 13) % 10007) as f64 / 10007.0 - 0.5;
    (0..count)
        .map(|s| {
            let mut keypoints = Array3::zeros((length, 2, 2));
            let mut truth = Array3::zeros((length, 1, 2));
            let amplitude = 0.05 + 0.15 * (noise(31 * s) + 0.5);
            for t in 0..length {
                let i = s * length + t;
                for axis in 0..2 {
                    let at = noise(3 * i + axis) * 1.5;
                    truth[[t, 0, axis]] = at;
                    keypoints[[t, 0, axis]] = noise(11 * i + axis + 5);
                    keypoints[[t, 1, axis]] = 0.5 * at + amplitude * noise(17 * i + axis + 7) + 0.2;
                }
            }
            (keypoints, truth)
        })
        .collect()
}

fn moments_of(sequences: &[&(Array3<f64>, Array3<f64>)]) -> Moments {
    let mut accumulator = Accumulator::new(2, 1, NonFinite::Error);
    for (keypoints, truth) in sequences {
        for (z, x) in keypoints.outer_iter().zip(truth.outer_iter()) {
            accumulator.push(z, x).expect("a frame");
        }
    }
    accumulator.finish()
}

#[test]
fn held_out_errors_are_those_of_maps_from_the_other_folds() {
    let sequences = noisy_sequences(7, 9);
    let parts: Vec<Moments> = sequences.iter().map(|s| moments_of(&[s])).collect();
    let objects = [Object::new("a", 0.05)];
    let settings = Settings::default();
    // With a fold a sequence, the folds are known whatever the seed: fit on six, go frame by frame
    // over the seventh.
    let found = held_out(&parts, 7, 5, &objects, &settings).expect("held out");
    let (mut sum, mut frames) = (0.0, 0);
    for left_out in 0..7 {
        let others: Vec<_> = (0..7)
            .filter(|s| *s != left_out)
            .map(|s| &sequences[s])
            .collect();
        let evaluation = moments_of(&others)
            .evaluate(&objects, &settings)
            .expect("an evaluation");
        let best = evaluation.objects[0].best.expect("a best keypoint");
        assert_eq!(best.keypoint, 1);
        let (keypoints, truth) = &sequences[left_out];
        for (z, x) in keypoints.outer_iter().zip(truth.outer_iter()) {
            let mapped = best.fit.map.apply(&[z[[1, 0]], z[[1, 1]]]);
            sum += (mapped[0] - x[[0, 0]]).powi(2) + (mapped[1] - x[[0, 1]]).powi(2);
            frames += 1;
        }
    }
    let error = found.objects[0].error.expect("an error");
    // Both are sums of 63 squares in f64; moments lose a few digits of an error that is 1e-3 of the
    // variance.
    assert!(
        (error - sum / f64::from(frames)).abs() < 1e-12,
        "{error} {}",
        sum / f64::from(frames)
    );
    assert_eq!(found.objects[0].keypoints, [Some(1); 7]);
    assert_eq!(found.tracking_capability, 1.0);
    let same = moments_of(&sequences.iter().collect::<Vec<_>>());
    let same = same.evaluate(&objects, &settings).expect("an evaluation");
    assert!(
        error > same.objects[0].best.expect("best").fit.error(),
        "unseen frames are not easier"
    );

    let twice = [
        held_out(&parts, 3, 5, &objects, &settings),
        held_out(&parts, 3, 5, &objects, &settings),
    ];
    assert_eq!(
        twice[0].as_ref().expect("folds"),
        twice[1].as_ref().expect("folds")
    );
    for folds in [0, 1, 8] {
        let error = held_out(&parts, folds, 0, &objects, &settings).expect_err("no such folds");
        assert!(error.to_string().contains("at least 2 folds"), "{error}");
    }
}

#[test]
fn bootstrap_intervals_hold_the_spread_over_sequences() {
    let sequences = noisy_sequences(40, 9);
    let parts: Vec<Moments> = sequences.iter().map(|s| moments_of(&[s])).collect();
    let objects = [Object::new("a", 0.05)];
    let settings = Settings::default();
    let intervals = bootstrap(&parts, 2000, 0.95, 1, &objects, &settings).expect("intervals");
    let [low, high] = intervals.errors[0].expect("an interval");
    // The standard error of a mean over sequences, whose normal interval the bootstrap's comes to.
    // Fitting three numbers an axis on 360 frames takes 1 % of the error away, a tenth of the
    // interval's half; the sample is skewed, and the ends of 2000 resamples scatter by some percent
    // of it.
    let all = moments_of(&sequences.iter().collect::<Vec<_>>());
    let best = all
        .evaluate(&objects, &settings)
        .expect("an evaluation")
        .objects[0]
        .best
        .expect("best");
    let errors: Vec<f64> = sequences
        .iter()
        .map(|(keypoints, truth)| {
            let frames = keypoints.outer_iter().zip(truth.outer_iter());
            let left = frames.map(|(z, x)| {
                let mapped = best.fit.map.apply(&[z[[1, 0]], z[[1, 1]]]);
                (mapped[0] - x[[0, 0]]).powi(2) + (mapped[1] - x[[0, 1]]).powi(2)
            });
            left.sum::<f64>() / 9.0
        })
        .collect();
    let mean = errors.iter().sum::<f64>() / 40.0;
    let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / 39.0;
    let half = 1.96 * (variance / 40.0).sqrt();
    assert!(
        (low - (mean - half)).abs() < 0.3 * half && (high - (mean + half)).abs() < 0.3 * half,
        "{low} {high}"
    );
    assert!(low < best.fit.error() && best.fit.error() < high);
    assert_eq!(intervals.tracking_capability, [1.0, 1.0]);
    assert_eq!(
        bootstrap(&parts, 2000, 0.95, 1, &objects, &settings).expect("again"),
        intervals
    );
    assert!(bootstrap(&parts[..1], 10, 0.95, 1, &objects, &settings).is_err());
    assert!(bootstrap(&parts, 10, 1.0, 1, &objects, &settings).is_err());
}

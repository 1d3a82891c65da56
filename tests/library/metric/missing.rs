//! Keypoints that are missing in some frames.

use ndarray::{Array3, ArrayView3, Axis, s};
use proptest::prelude::*;
use tracklens::metric::{
    Accumulator, Evaluation, Moments, NonFinite, Object, Settings, Transform, evaluate, held_out,
};

fn objects() -> [Object; 2] {
    ["a", "b"].map(|name| Object::new(name, 0.015))
}

/// 4 keypoints, 2 objects; keypoint 0 follows object 0, with noise.
fn recording(frames: usize, seed: u64) -> (Array3<f64>, Array3<f64>) {
    let mut state = seed | 1;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let truth = Array3::from_shape_simple_fn((frames, 2, 2), &mut uniform);
    let keypoints = Array3::from_shape_fn((frames, 4, 2), |(t, n, axis)| {
        let own = if n == 0 {
            0.5 * truth[[t, 0, axis]]
        } else {
            0.0
        };
        own + 0.1 * (n + 1) as f64 * uniform()
    });
    (keypoints, truth)
}

fn score(keypoints: ArrayView3<f64>, truth: ArrayView3<f64>, settings: Settings) -> Evaluation {
    evaluate(
        keypoints,
        truth,
        &objects(),
        NonFinite::ExcludePoint,
        &settings,
    )
    .expect("scored")
}

fn moments(keypoints: ArrayView3<f64>, truth: ArrayView3<f64>) -> Moments {
    let mut accumulator = Accumulator::new(4, 2, NonFinite::ExcludePoint);
    for (z, x) in keypoints.outer_iter().zip(truth.outer_iter()) {
        accumulator.push(z, x).expect("a frame");
    }
    accumulator.finish()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    // The same frames in other blocks: rounding of sums of terms below 1.
    #[test]
    fn a_frame_does_not_count_for_the_keypoint_that_is_missing_in_it(
        frames in 10usize..200,
        seed in any::<u64>(),
        gaps in prop::collection::vec((0usize..200, 0usize..4), 0..40),
        hidden in 0usize..200,
        cut in 0.0..1.0f64,
    ) {
        let (mut keypoints, mut truth) = recording(frames, seed);
        truth[[hidden % frames, 1, 0]] = f64::NAN;
        for (t, n) in gaps {
            keypoints[[t % frames, n, t % 2]] = f64::NAN;
        }
        let settings = Settings { rare_keypoints: true, ..Settings::default() };
        let found = score(keypoints.view(), truth.view(), settings);
        for n in 0..4 {
            let shown: Vec<usize> =
                (0..frames).filter(|t| !keypoints.slice(s![*t, n, ..]).iter().any(|v| v.is_nan())).collect();
            prop_assert_eq!(found.missing[n], (frames - shown.len()) as u64);
            if shown.len() < 5 {
                continue;
            }
            let alone = score(
                keypoints.select(Axis(0), &shown).slice(s![.., n..=n, ..]),
                truth.select(Axis(0), &shown).view(),
                settings,
            );
            for k in 0..2 {
                let (a, b) = (found.errors[[k, n]], alone.errors[[k, 0]]);
                prop_assert!((a - b).abs() < 1e-13, "{} {}", a, b);
            }
        }
        // In parts, and held out.
        let cut = 1 + ((frames - 2) as f64 * cut) as usize;
        let parts = [
            moments(keypoints.slice(s![..cut, .., ..]), truth.slice(s![..cut, .., ..])),
            moments(keypoints.slice(s![cut.., .., ..]), truth.slice(s![cut.., .., ..])),
        ];
        let mut merged = parts[0].clone();
        merged.merge(&parts[1]).expect("the same shape");
        prop_assert_eq!(merged.missing(), &found.missing[..]);
        let merged = merged.evaluate(&objects(), &settings).expect("scored");
        for (a, b) in merged.errors.iter().zip(&found.errors) {
            prop_assert!((a - b).abs() < 1e-13 || a.is_nan() && b.is_nan(), "{} {}", a, b);
        }
        prop_assert!(held_out(&parts, 2, 0, &objects(), &settings).is_ok());
    }

    #[test]
    fn a_complete_table_gives_the_same_bits((keypoints, truth) in (1usize..200, any::<u64>())
        .prop_map(|(frames, seed)| recording(frames, seed)))
    {
        for transform in Transform::ALL {
            let settings = Settings { transform: *transform, ..Settings::default() };
            let (z, x) = (keypoints.view(), truth.view());
            let expected = evaluate(z, x, &objects(), NonFinite::Error, &settings).expect("scored");
            prop_assert_eq!(score(z, x, settings), expected);
        }
    }
}

#[test]
fn a_keypoint_seen_in_less_than_half_of_the_frames_is_not_the_best_unless_asked() {
    let (mut keypoints, truth) = recording(100, 3);
    keypoints.slice_mut(s![..50, 0, ..]).fill(f64::NAN);
    let best = |keypoints: &Array3<f64>, rare_keypoints: bool| {
        let settings = Settings {
            rare_keypoints,
            ..Settings::default()
        };
        score(keypoints.view(), truth.view(), settings).objects[0]
            .best
            .expect("a best keypoint")
    };
    let half = best(&keypoints, false);
    assert_eq!((half.keypoint, half.fit.frames), (0, 50));
    keypoints[[60, 0, 1]] = f64::NAN;
    assert_ne!(best(&keypoints, false).keypoint, 0);
    assert_eq!(best(&keypoints, true).keypoint, 0);

    keypoints.fill(f64::NAN);
    let nothing = score(keypoints.view(), truth.view(), Settings::default());
    assert!(nothing.objects[0].best.is_none() && !nothing.objects[0].tracked);
    assert!(nothing.errors.iter().all(|e| e.is_nan()) && nothing.missing == [100; 4]);
}

#[test]
fn an_infinite_keypoint_is_not_a_missing_one() {
    let (mut keypoints, truth) = recording(10, 4);
    keypoints[[3, 2, 0]] = f64::INFINITY;
    let (z, x) = (keypoints.view(), truth.view());
    let refused = evaluate(
        z,
        x,
        &objects(),
        NonFinite::ExcludePoint,
        &Settings::default(),
    );
    let text = refused.expect_err("refused").to_string();
    assert!(text.starts_with("frame 3: keypoint 2 is (inf"), "{text}");
    assert_eq!(
        "exclude-point".parse::<NonFinite>().expect("a policy"),
        NonFinite::default()
    );
}

//! The whole range of f64: what is given is right by exact rational arithmetic, or an error.

use ndarray::{Array3, ArrayView3, Axis};
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};
use proptest::prelude::*;
use tracklens::ErrorKind;
use tracklens::metric::context::{assignment, regression};
use tracklens::metric::stats::{Sample, quantile, smooth, trimmed_mean};
use tracklens::metric::{
    Accumulator, AffineMap, Moments, NonFinite, Object, Rank, Settings, Transform, evaluate,
    farthest_frame, held_out,
};

/// Sums of squares are differences of moments: rounding is relative to the squares, not to what is
/// left of them. 24 frames, and a condition of at most 1e3 of the keypoint's moments, leave 1e-12.
const OF_SQUARES: f64 = 1e-11;

fn exact(value: f64) -> BigRational {
    BigRational::from_float(value).expect("a finite value")
}

fn rounded(value: &BigRational) -> f64 {
    value.to_f64().expect("a value or an infinity")
}

/// 2^`exponent` times `value`, in two steps because the first alone may be out of range.
fn times_power(value: f64, exponent: i32) -> f64 {
    let half = exponent / 2;
    value * 2f64.powi(half) * 2f64.powi(exponent - half)
}

struct Uniform(u64);

impl Uniform {
    /// -1 to 1.
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    /// T x 1 x 2 of these powers of two an axis.
    fn points(&mut self, frames: usize, exponents: [i32; 2]) -> Array3<f64> {
        Array3::from_shape_fn((frames, 1, 2), |(_, _, axis)| {
            times_power(self.next(), exponents[axis])
        })
    }
}

/// The exact affine least squares of one keypoint.
struct Exact {
    a: [[BigRational; 2]; 2],
    b: [BigRational; 2],
    sum: BigRational,
    /// Centred sums of squares of the object along both axes.
    squares: [BigRational; 2],
}

fn column(points: &Array3<f64>, axis: usize) -> Vec<BigRational> {
    points
        .index_axis(Axis(2), axis)
        .iter()
        .map(|v| exact(*v))
        .collect()
}

fn mean(values: &[BigRational]) -> BigRational {
    let sum: BigRational = values.iter().sum();
    sum / BigInt::from(values.len())
}

fn product(a: &[BigRational], b: &[BigRational]) -> BigRational {
    let (mean_a, mean_b) = (mean(a), mean(b));
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - &mean_a) * (b - &mean_b))
        .sum()
}

/// `None` when the keypoint hardly moves along some direction: the rank rule decides then.
fn exact_fit(keypoint: &Array3<f64>, truth: &Array3<f64>) -> Option<Exact> {
    let z = [column(keypoint, 0), column(keypoint, 1)];
    let [xx, xy, yy] = [(0, 0), (0, 1), (1, 1)].map(|(i, j)| product(&z[i], &z[j]));
    let determinant = &xx * &yy - &xy * &xy;
    let trace = &xx + &yy;
    if determinant <= &trace * &trace / BigInt::from(1000) {
        return None;
    }
    let mut fit = Exact {
        a: Default::default(),
        b: Default::default(),
        sum: BigRational::zero(),
        squares: Default::default(),
    };
    for axis in 0..2 {
        let x = column(truth, axis);
        let cross = [product(&z[0], &x), product(&z[1], &x)];
        let a = [
            (&yy * &cross[0] - &xy * &cross[1]) / &determinant,
            (&xx * &cross[1] - &xy * &cross[0]) / &determinant,
        ];
        fit.squares[axis] = product(&x, &x);
        fit.sum += &fit.squares[axis] - (&a[0] * &cross[0] + &a[1] * &cross[1]);
        fit.b[axis] = mean(&x) - (&a[0] * mean(&z[0]) + &a[1] * mean(&z[1]));
        fit.a[axis] = a;
    }
    Some(fit)
}

fn one_object() -> [Object; 1] {
    [Object::new("a", 0.015)]
}

fn moments(keypoints: ArrayView3<f64>, truth: ArrayView3<f64>) -> Moments {
    let mut accumulator = Accumulator::new(keypoints.dim().1, truth.dim().1, NonFinite::Error);
    for (z, x) in keypoints.outer_iter().zip(truth.outer_iter()) {
        accumulator.push(z, x).expect("a frame");
    }
    accumulator.finish()
}

/// Whether an exact value has a float with all its digits, or is 0.
fn fits(value: &BigRational) -> bool {
    let rounded = rounded(value);
    rounded.is_finite() && (value.is_zero() || rounded.abs() >= f64::MIN_POSITIVE)
}

fn exponents() -> impl Strategy<Value = i32> {
    // Subnormal values and those next to infinity, too.
    prop_oneof![-1070..=1023i32, -3..=3i32, -520..=-500i32, 505..=515i32]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn affine_maps_and_errors_are_right_or_refused(
        frames in 5usize..24,
        seed in any::<u64>(),
        keypoint in exponents(),
        object in (exponents(), exponents()),
    ) {
        let mut uniform = Uniform(seed | 1);
        let z = uniform.points(frames, [keypoint; 2]);
        let x = uniform.points(frames, [object.0, object.1]);
        let Some(expected) = exact_fit(&z, &x) else { return Ok(()) };
        let settings = Settings { transform: Transform::Affine, rank: Rank::Centred, ..Settings::default() };
        let found = evaluate(z.view(), x.view(), &one_object(), NonFinite::Error, &settings);
        let rows_fit = expected.a.iter().all(|row| {
            row.iter().all(|v| rounded(v).is_finite()) && row.iter().any(fits)
        });
        let fits = rows_fit
            && expected.b.iter().all(|v| rounded(v).is_finite())
            && rounded(&expected.sum).is_finite();
        let found = match found {
            Ok(found) => found.objects[0].best.expect("visible").fit,
            Err(error) => {
                prop_assert_eq!(error.kind(), ErrorKind::Numeric);
                // Next to the ends of the range rounding decides.
                let near = expected.a.iter().flatten().chain(&expected.b).chain([&expected.sum]);
                let edge = near.clone().any(|v| {
                    let v = rounded(v).abs();
                    !(4.0 * f64::MIN_POSITIVE..=f64::MAX / 4.0).contains(&v)
                });
                prop_assert!(!fits || edge, "refused: {}", error);
                return Ok(());
            }
        };
        let error = rounded(&(&expected.sum / BigInt::from(frames)));
        let squares = &expected.squares[0] + &expected.squares[1];
        // Beside rounding, subnormal errors have fewer digits.
        let tolerance = OF_SQUARES * rounded(&(squares / BigInt::from(frames))) + 1e-322;
        prop_assert!((found.error() - error).abs() <= tolerance, "{} {}", found.error(), error);
        for axis in 0..2 {
            // Relative to the row: an entry may vanish by itself.
            let row = expected.a[axis].each_ref().map(rounded);
            let size = row[0].abs() + row[1].abs();
            for j in 0..2 {
                let off = (found.map.a[axis][j] - row[j]).abs();
                prop_assert!(off <= 1e-9 * size + 1e-322, "{:?} {:?}", found.map.a, row);
            }
        }
    }

    #[test]
    fn a_rank_rule_leaves_at_least_the_exact_error_and_at_most_the_squares(
        frames in 5usize..24,
        seed in any::<u64>(),
        keypoint in exponents(),
        object in (exponents(), exponents()),
        scale in any::<bool>(),
    ) {
        let mut uniform = Uniform(seed | 1);
        let z = uniform.points(frames, [keypoint; 2]);
        let x = uniform.points(frames, [object.0, object.1]);
        let Some(expected) = exact_fit(&z, &x) else { return Ok(()) };
        let transform = if scale { Transform::ScaleTranslate } else { Transform::Affine };
        let settings = Settings { transform, rank: Rank::Reference, ..Settings::default() };
        let found = evaluate(z.view(), x.view(), &one_object(), NonFinite::Error, &settings);
        let Ok(found) = found else { return Ok(()) };
        let all: BigRational = x.iter().map(|v| exact(*v) * exact(*v)).sum();
        let [least, most] = [&expected.sum, &all].map(|v| rounded(&(v / BigInt::from(frames))));
        let slack = OF_SQUARES * most + 1e-322;
        let error = found.errors[[0, 0]];
        prop_assert!(error >= least - slack && error <= most + slack, "{} {} {}", least, error, most);
        if keypoint.abs() <= 3 && !scale {
            prop_assert!((error - least).abs() <= slack, "{} {}", error, least);
        }
    }

    #[test]
    fn errors_without_a_map_are_right_or_refused(
        frames in 1usize..24,
        seed in any::<u64>(),
        keypoint in (exponents(), exponents()),
        object in (exponents(), exponents()),
        outlier in exponents(),
    ) {
        let mut uniform = Uniform(seed | 1);
        let mut z = uniform.points(frames, [keypoint.0, keypoint.1]);
        let x = uniform.points(frames, [object.0, object.1]);
        z[[frames / 2, 0, 1]] = times_power(uniform.next(), outlier);
        let settings = Settings { transform: Transform::Identity, rank: Rank::Reference, ..Settings::default() };
        let found = evaluate(z.view(), x.view(), &one_object(), NonFinite::Error, &settings);
        let squares = |points: &Array3<f64>| -> BigRational {
            points.iter().map(|v| exact(*v) * exact(*v)).sum()
        };
        let sum: BigRational = z.iter().zip(&x).map(|(z, x)| {
            let left = exact(*z) - exact(*x);
            &left * &left
        }).sum();
        match found {
            Ok(found) => {
                let count = BigInt::from(frames);
                let error = rounded(&(sum / &count));
                let tolerance =
                    OF_SQUARES * rounded(&((squares(&z) + squares(&x)) / count)) + 1e-322;
                prop_assert!((found.errors[[0, 0]] - error).abs() <= tolerance);
            }
            Err(error) => {
                prop_assert_eq!(error.kind(), ErrorKind::Numeric);
                prop_assert!(rounded(&sum) > f64::MAX / 4.0, "refused: {}", error);
            }
        }
    }

    #[test]
    fn held_out_errors_are_right_or_refused(
        frames in 5usize..24,
        seed in any::<u64>(),
        keypoint in exponents(),
        object in (exponents(), exponents()),
        outlier in exponents(),
    ) {
        let mut uniform = Uniform(seed | 1);
        let points: Vec<[Array3<f64>; 2]> = (0..2)
            .map(|_| [
                uniform.points(frames, [keypoint; 2]),
                uniform.points(frames, [object.0, object.1]),
            ])
            .collect();
        let mut points = points;
        points[1][0][[0, 0, 0]] = times_power(uniform.next(), outlier);
        let parts: Vec<Moments> =
            points.iter().map(|[z, x]| moments(z.view(), x.view())).collect();
        let settings = Settings { transform: Transform::Affine, rank: Rank::Centred, ..Settings::default() };
        let (mut sum, mut size) = (BigRational::zero(), BigRational::zero());
        for own in 0..2 {
            let Ok(others) = parts[1 - own].evaluate(&one_object(), &settings) else {
                let refused = held_out(&parts, 2, 0, &one_object(), &settings);
                prop_assert_eq!(refused.expect_err("no map").kind(), ErrorKind::Numeric);
                return Ok(());
            };
            let AffineMap { a, b } = others.objects[0].best.expect("visible").fit.map;
            let [z, x] = &points[own];
            for t in 0..frames {
                for axis in 0..2 {
                    let along = |j: usize| exact(a[axis][j]) * exact(z[[t, 0, j]]);
                    let (x, b) = (exact(x[[t, 0, axis]]), exact(b[axis]));
                    let left = along(0) + along(1) + &b - &x;
                    sum += &left * &left;
                    let most = along(0).abs() + along(1).abs() + b.abs() + x.abs();
                    size += &most * &most;
                }
            }
        }
        match held_out(&parts, 2, 0, &one_object(), &settings) {
            Ok(found) => {
                let count = BigInt::from(2 * frames);
                let found = found.objects[0].error.expect("visible");
                let tolerance = OF_SQUARES * rounded(&(size / &count)) + 1e-322;
                let error = rounded(&(sum / count));
                prop_assert!((found - error).abs() <= tolerance, "{} {}", found, error);
            }
            Err(error) => {
                prop_assert_eq!(error.kind(), ErrorKind::Numeric);
                prop_assert!(rounded(&size) > f64::MAX / 4.0, "refused: {}", error);
            }
        }
    }

    #[test]
    fn whatever_the_coordinates_every_result_is_finite_or_refused(
        values in prop::collection::vec(
            prop_oneof![prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
                        -1.0..1.0f64],
            6 * 9,
        ),
    ) {
        let z = Array3::from_shape_vec((9, 2, 2), values[..36].to_vec()).expect("the shape");
        let x = Array3::from_shape_vec((9, 1, 2), values[36..].to_vec()).expect("the shape");
        for transform in Transform::ALL {
            for rank in Rank::ALL {
                let settings = Settings { transform: *transform, rank: *rank, ..Settings::default() };
                let (z, x) = (z.view(), x.view());
                match evaluate(z, x, &one_object(), NonFinite::Error, &settings) {
                    Ok(found) => {
                        let fit = found.objects[0].best.expect("visible").fit;
                        prop_assert!(found.errors.iter().all(|e| e.is_finite()));
                        prop_assert!(fit.rmse_px([8192, 8192]).is_finite());
                    }
                    Err(error) => prop_assert_eq!(error.kind(), ErrorKind::Numeric),
                }
            }
        }
        match regression(z.view(), x.view(), None) {
            Ok(found) => prop_assert!(found[0].error.expect("frames").is_finite()),
            Err(error) => prop_assert_eq!(error.kind(), ErrorKind::Numeric),
        }
        if let Err(error) = assignment(z.view(), x.view(), std::iter::once(0..9)) {
            prop_assert_eq!(error.kind(), ErrorKind::Numeric);
            prop_assert!(farthest_frame(z.view(), x.view()).is_some());
        }
    }

    #[test]
    fn statistics_are_right_or_refused(
        values in prop::collection::vec(
            prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO, 1..20,
        ),
        share in 0.0..=1.0f64,
    ) {
        let all: Vec<BigRational> = values.iter().map(|v| exact(*v)).collect();
        let largest = values.iter().fold(0.0, |l: f64, v| if v.abs() > l { v.abs() } else { l });
        match Sample::of(&values) {
            Ok(sample) => {
                prop_assert!((sample.mean - rounded(&mean(&all))).abs() <= 1e-14 * largest + 1e-322);
                if values.len() > 1 {
                    let count = BigInt::from(values.len() - 1);
                    let variance = rounded(&(product(&all, &all) / count));
                    let tolerance = 1e-13 * largest * largest + 1e-322;
                    prop_assert!((sample.variance - variance).abs() <= tolerance);
                }
            }
            Err(error) => {
                prop_assert_eq!(error.kind(), ErrorKind::Numeric);
                prop_assert!(largest > 1e150, "refused: {}", error);
            }
        }
        let mut sorted = all.clone();
        sorted.sort();
        let place = share * (values.len() - 1) as f64;
        let (low, high) = (&sorted[place.floor() as usize], &sorted[place.ceil() as usize]);
        let expected = low + (high - low) * exact(place - place.floor());
        let found = quantile(&values, share).expect("a quantile");
        prop_assert!((found - rounded(&expected)).abs() <= 1e-15 * largest + 1e-322);
        let cut = values.len() / 4;
        let expected = rounded(&mean(&sorted[cut..values.len() - cut]));
        let found = trimmed_mean(&values).expect("a mean");
        prop_assert!((found - expected).abs() <= 1e-14 * largest + 1e-322);
        let smoothed = smooth(&values, 2.5).expect("a curve");
        let within = 1.0 + 1e-14;
        prop_assert!(smoothed.iter().all(|v| v.abs() / within <= largest));
    }
}

#[test]
fn one_coordinate_far_outside_is_refused_with_its_frame() {
    let mut uniform = Uniform(7);
    let z = uniform.points(40, [0; 2]);
    let x = uniform.points(40, [0; 2]);
    for transform in Transform::ALL {
        for (axes, is_truth) in [(0..2, true), (0..1, true), (0..2, false)] {
            let (mut z, mut x) = (z.clone(), x.clone());
            for axis in axes {
                let points = if is_truth { &mut x } else { &mut z };
                points[[17, 0, axis]] = 1e155;
            }
            let settings = Settings {
                transform: *transform,
                rank: Rank::Reference,
                ..Settings::default()
            };
            let found = evaluate(
                z.view(),
                x.view(),
                &one_object(),
                NonFinite::Error,
                &settings,
            );
            if !is_truth && *transform != Transform::Identity {
                // A map makes any keypoint small; the other frames are then as good as one point.
                assert!(found.expect("scored").errors[[0, 0]] > 0.1);
                continue;
            }
            let error = found.expect_err("1e310 is no f64");
            assert_eq!(error.kind(), ErrorKind::Numeric);
            let text = error.to_string();
            assert!(
                text.starts_with("frame 17 (coordinate 1e155): keypoint 0"),
                "{text}"
            );
        }
    }
}

//! Statistics over runs against numpy, SciPy and rliable (`tests/golden/make_stats.py`).
//!
//! `cargo test --test library stats -- --nocapture` prints how far they are apart.

use std::cell::RefCell;
use std::collections::BTreeMap;

use serde_json::Value;
use tracklens::metric::stats::{
    Sample, percentile_interval, performance_profile, probability_of_improvement, quantile,
    quantile_window_mean, rank_correlation, smooth, stratified_interval, trimmed_mean,
};

/// Both are sums of at most 101 values in f64, in different orders.
const TOLERANCE: f64 = 1e-13;

fn fixture() -> Value {
    serde_json::from_str(include_str!("../golden/stats.json")).expect("JSON")
}

fn numbers(value: &Value) -> Vec<f64> {
    let values = value.as_array().expect("numbers").iter();
    values.map(|v| v.as_f64().expect("a number")).collect()
}

/// The largest differences from the reference, relative to it where it is above 1, by the name of
/// the statistic.
#[derive(Default)]
struct Parity(RefCell<BTreeMap<&'static str, f64>>);

impl Parity {
    #[track_caller]
    fn close(&self, name: &'static str, found: f64, expected: &Value) {
        let expected = expected.as_f64().expect("a number");
        let off = (found - expected).abs() / expected.abs().max(1.0);
        assert!(off <= TOLERANCE, "{name}: {found} {expected}");
        let mut largest = self.0.borrow_mut();
        let largest = largest.entry(name).or_default();
        *largest = largest.max(off);
    }
}

impl Drop for Parity {
    fn drop(&mut self) {
        for (name, largest) in self.0.borrow().iter() {
            println!("{name}: largest difference {largest:.1e}, tolerance {TOLERANCE:.0e}");
        }
    }
}

#[test]
fn samples_equal_numpy_and_scipy() {
    let parity = Parity::default();
    for case in fixture()["samples"].as_array().expect("cases") {
        let values = numbers(&case["values"]);
        let sample = Sample::of(&values).expect("a sample");
        parity.close("mean (numpy)", sample.mean, &case["mean"]);
        match &case["variance"] {
            Value::Null => assert!(sample.variance.is_nan()),
            variance => parity.close("variance (numpy)", sample.variance, variance),
        }
        for (found, expected) in sample
            .quartiles
            .iter()
            .zip(case["quartiles"].as_array().expect("five"))
        {
            parity.close("quartiles (numpy)", *found, expected);
        }
        assert_eq!(sample.median(), quantile(&values, 0.5).expect("a median"));
        parity.close(
            "IQM, trimmed (SciPy)",
            trimmed_mean(&values).expect("a mean"),
            &case["trimmed_mean"],
        );
        parity.close(
            "IQM, between quartiles (numpy)",
            quantile_window_mean(&values).expect("a mean"),
            &case["quantile_window_mean"],
        );
        let profile = performance_profile(&values, &[0.005, 0.01, 0.015, 0.1]).expect("a profile");
        assert_eq!(profile, numbers(&case["profile"]));
    }
}

#[test]
fn improvement_equals_rliable() {
    let case = &fixture()["improvement"];
    let (a, b) = (numbers(&case["a"]), numbers(&case["b"]));
    let there = probability_of_improvement(&a, &b).expect("a probability");
    Parity::default().close(
        "probability of improvement (rliable)",
        there,
        &case["probability"],
    );
    let back = probability_of_improvement(&b, &a).expect("a probability");
    assert!((there + back - 1.0).abs() < 1e-15);
    assert_eq!(
        probability_of_improvement(&a, &a).expect("a probability"),
        0.5
    );
}

#[test]
fn rank_correlations_equal_scipy() {
    let parity = Parity::default();
    for case in fixture()["rank_correlation"].as_array().expect("cases") {
        let (a, b) = (numbers(&case["a"]), numbers(&case["b"]));
        let rho = rank_correlation(&a, &b).expect("ranks").expect("an order");
        parity.close("rank correlation (SciPy)", rho, &case["rho"]);
    }
    let rho = |a: &[f64], b: &[f64]| rank_correlation(a, b);
    assert_eq!(rho(&[1.0, 1.0], &[1.0, 2.0]).expect("ranks"), None);
    assert!(rho(&[1.0], &[1.0, 2.0]).is_err() && rho(&[f64::NAN], &[1.0]).is_err());
}

#[test]
fn stratified_intervals_are_those_of_rliable() {
    let case = &fixture()["rliable"];
    let strata: Vec<Vec<f64>> = case["strata"]
        .as_array()
        .expect("strata")
        .iter()
        .map(numbers)
        .collect();
    let expected = numbers(&case["interval"]);
    let statistic = |strata: &[Vec<f64>]| trimmed_mean(&strata.concat());
    let found = stratified_interval(&strata, 50_000, 0.95, 3, statistic).expect("an interval");
    // An end of the interval is a quantile of 50 000 replicates. Its standard error is sqrt(p (1 -
    // p) / n) over the density there, for a normal distribution of the width w: w / 3.92 *
    // sqrt(0.025 * 0.975 / 50 000) / 0.0584 = 0.0031 w, and both intervals have it: 4 standard
    // errors of the difference are 0.018 w.
    let width = expected[1] - expected[0];
    for (found, expected) in found.iter().zip(&expected) {
        let off = (found - expected).abs() / width;
        assert!(off < 0.018, "{found} {expected}");
        println!(
            "end of the stratified interval (rliable): {off:.1e} of its width, tolerance 1.8e-2"
        );
    }
    let again = stratified_interval(&strata, 50_000, 0.95, 3, statistic).expect("an interval");
    assert_eq!(found, again);
}

#[test]
fn smoothing_equals_scipy() {
    let parity = Parity::default();
    for case in fixture()["smooth"].as_array().expect("cases") {
        let found = smooth(
            &numbers(&case["values"]),
            case["sigma"].as_f64().expect("a sigma"),
        )
        .expect("a curve");
        for (found, expected) in found
            .iter()
            .zip(case["smoothed"].as_array().expect("a curve"))
        {
            parity.close("Gaussian smoothing (SciPy)", *found, expected);
        }
    }
    assert!(smooth(&[], 2.5).expect("nothing").is_empty());
}

#[test]
fn what_has_no_answer_is_an_error() {
    for values in [&[][..], &[1.0, f64::NAN]] {
        assert!(Sample::of(values).is_err());
        assert!(quantile(values, 0.5).is_err());
        assert!(trimmed_mean(values).is_err());
        assert!(quantile_window_mean(values).is_err());
        assert!(percentile_interval(values, 0.95).is_err());
        assert!(probability_of_improvement(values, &[1.0]).is_err());
        assert!(probability_of_improvement(&[1.0], values).is_err());
        assert!(performance_profile(values, &[0.1]).is_err());
        assert!(stratified_interval(&[values.to_vec()], 10, 0.95, 0, |_| Ok(0.0)).is_err());
    }
    assert!(quantile(&[1.0], 1.5).is_err());
    assert!(percentile_interval(&[1.0], 1.0).is_err());
    assert!(stratified_interval(&[], 10, 0.95, 0, |_| Ok(0.0)).is_err());
    assert!(stratified_interval(&[vec![1.0]], 0, 0.95, 0, |_| Ok(0.0)).is_err());
    assert!(smooth(&[1.0], 0.0).is_err());
    // An infinite error, of a keypoint that left the image for good, has a place in the order all
    // the same.
    assert_eq!(
        quantile(&[1.0, 2.0, f64::INFINITY], 0.5).expect("a median"),
        2.0
    );
}

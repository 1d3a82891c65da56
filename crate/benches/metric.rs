//! Time of the metric: all N x K affine fits of a recording, on one thread.
//!
//! `cargo bench -p tracklens --no-default-features --bench metric` prints a table; with `-- --json`
//! one line of JSON for the case that `peers/metric_numpy.py` times as well.

use std::hint::black_box;
use std::time::Instant;

use ndarray::Array3;
use tracklens::metric::{NonFinite, Object, Settings, evaluate};

const KEYPOINTS: usize = 32;
const OBJECTS: usize = 3;

fn recording(frames: usize) -> (Array3<f64>, Array3<f64>) {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    };
    let truth = Array3::from_shape_simple_fn((frames, OBJECTS, 2), &mut uniform);
    let keypoints = Array3::from_shape_fn((frames, KEYPOINTS, 2), |(t, n, axis)| {
        0.5 * truth[[t, n % OBJECTS, axis]] + 0.1 * uniform()
    });
    (keypoints, truth)
}

/// The median of 101 runs, in milliseconds.
fn median_ms(frames: usize) -> f64 {
    let (keypoints, truth) = recording(frames);
    let objects: Vec<Object> = (0..OBJECTS)
        .map(|k| Object::new(format!("object {k}"), 0.015))
        .collect();
    let mut times: Vec<f64> = (0..101)
        .map(|_| {
            let start = Instant::now();
            let scored = evaluate(
                black_box(keypoints.view()),
                black_box(truth.view()),
                &objects,
                NonFinite::Error,
                &Settings::default(),
            );
            black_box(scored.expect("a recording that can be scored"));
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() {
    if std::env::args().any(|a| a == "--json") {
        println!(
            "{{\"name\":\"metric_t2500_n32_k3\",\"median_ms\":{:.4}}}",
            median_ms(2500)
        );
        return;
    }
    println!("{:>8} {:>12} {:>16}", "frames", "median ms", "ns a frame");
    for frames in [250, 2500, 25_000, 250_000] {
        let ms = median_ms(frames);
        println!("{frames:>8} {ms:>12.3} {:>16.1}", ms * 1e6 / frames as f64);
    }
}

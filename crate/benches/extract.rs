//! Time of extraction with the paper's Basic encoder (N = 16) on the CPU engine, one thread, input as planes of f32.
//!
//! `cargo bench -p tracklens --no-default-features --features engine --bench extract`

mod random;

use std::time::Instant;

use tracklens::checkpoint::{Architecture, SaeConfig};
use tracklens::engine::{Encoder, Workspace};

fn main() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread");
    let encoder = Encoder::new(&random::checkpoint(SaeConfig::new(Architecture::BASIC))).expect("an encoder");
    println!("{:>6} {:>12} {:>10}", "px", "median ms", "GFLOP/s");
    for (side, multiplications) in [(64usize, 0.155e9), (128, 0.622e9), (256, 2.52e9)] {
        let input: Vec<f32> = (0..3 * side * side)
            .map(|i| (i * 31 % 97) as f32 / 97.0)
            .collect();
        let mut times: Vec<f64> = pool.install(|| {
            let mut workspace = Workspace::default();
            let mut one = || {
                let start = Instant::now();
                let points = encoder
                    .run(&mut workspace, &input, [side, side])
                    .expect("keypoints");
                assert_eq!(points.len(), 16);
                start.elapsed().as_secs_f64()
            };
            one();
            (0..21).map(|_| one()).collect()
        });
        times.sort_by(f64::total_cmp);
        let median = times[times.len() / 2];
        println!(
            "{side:>6} {:>12.2} {:>10.1}",
            median * 1e3,
            2.0 * multiplications / median * 1e-9
        );
    }
}

//! Time of extraction on the CPU engine: Basic, KeyNet and DSAE of the paper's sizes, input as
//! planes of f32.
//!
//! `cargo bench -p tracklens --no-default-features --features engine --bench extract` prints a
//! table; with `-- --json` lines of JSON, as the peers in `peers/extract_*.py` do. `--threads N`
//! deals frames to N threads, each of which runs one at a time. `--checkpoints DIR` only writes the
//! encoders, for `tracklens export`.

mod random;

use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::sync::Barrier;
use std::time::Instant;

use rten_simd::ops::{BitOps, NumOps};
use rten_simd::{Isa, SimdOp};
use tracklens::checkpoint::SaeConfig;
use tracklens::engine::{CpuEncoder, PlannedLayer, Workspace};

const ARCHITECTURES: [&str; 3] = ["basic", "keynet", "dsae"];
const SIDES: [usize; 2] = [128, 256];
/// Times that are taken, after two that are not counted.
const TIMES: usize = 15;

/// Median milliseconds a frame when every thread runs one frame after the other.
fn median_ms(encoder: &CpuEncoder, side: usize, threads: usize) -> f64 {
    let input: Vec<f32> = (0..3 * side * side)
        .map(|i| (i * 31 % 97) as f32 / 97.0)
        .collect();
    let start = Barrier::new(threads);
    let work = || {
        let mut workspace = Workspace::default();
        let mut one = || {
            let start = Instant::now();
            let points = encoder.run(&mut workspace, &input, [side, side]);
            black_box(points.expect("keypoints"));
            start.elapsed().as_secs_f64() * 1e3
        };
        start.wait();
        one();
        one();
        (0..TIMES).map(|_| one()).collect::<Vec<_>>()
    };
    let mut times: Vec<f64> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let times = handles
            .into_iter()
            .flat_map(|handle| handle.join().expect("times"));
        times.collect()
    });
    times.sort_by(f64::total_cmp);
    times[times.len() / 2] / threads as f64
}

/// Multiplications and additions a second of a loop that does nothing else, in GFLOP/s: what a core
/// can do at most.
struct Peak;

impl SimdOp for Peak {
    type Output = f64;

    #[inline(always)]
    fn eval<I: Isa>(self, isa: I) -> f64 {
        const SUMS: usize = 12;
        const STEPS: usize = 4_000_000;
        let ops = isa.f32();
        let mut best = 0.0f64;
        for _ in 0..5 {
            let [factor, term] = [black_box(0.999f32), black_box(0.001)].map(|v| ops.splat(v));
            let mut sums = [ops.splat(black_box(1.0)); SUMS];
            let start = Instant::now();
            for _ in 0..STEPS {
                for sum in &mut sums {
                    *sum = ops.mul_add(*sum, factor, term);
                }
            }
            let seconds = start.elapsed().as_secs_f64();
            sums.iter().for_each(|sum| {
                black_box(ops.sum(*sum));
            });
            best = best.max((2 * SUMS * STEPS * ops.len()) as f64 / seconds * 1e-9);
        }
        best
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1)
    };
    if let Some(folder) = value("--checkpoints") {
        for name in ARCHITECTURES {
            let bytes = random::checkpoint(SaeConfig::named(name)?).to_safetensors()?;
            std::fs::write(Path::new(folder).join(format!("{name}.safetensors")), bytes)?;
        }
        return Ok(());
    }
    let json = arguments.iter().any(|a| a == "--json");
    let threads: usize = value("--threads").map_or(Ok(1), |threads| threads.parse())?;
    let peak = Peak.dispatch();
    if json {
        println!("{{\"name\":\"peak\",\"gflops\":{peak:.1}}}");
    } else {
        println!("peak of a thread: {peak:.1} GFLOP/s");
        println!(
            "{:<8} {:>4} {:>10} {:>9} {:>9}",
            "", "px", "ms/frame", "GFLOP/s", "executed"
        );
    }
    for name in ARCHITECTURES {
        let encoder = CpuEncoder::new(&random::checkpoint(SaeConfig::named(name)?))?;
        for side in SIDES {
            let plan = encoder.plan([side, side])?;
            let mflop =
                |count: fn(&PlannedLayer) -> u64| 2e-6 * plan.iter().map(count).sum::<u64>() as f64;
            let (defined, done) = (mflop(|layer| layer.defined), mflop(|layer| layer.done));
            let time = median_ms(&encoder, side, threads);
            if json {
                println!(
                    "{{\"name\":\"{name} {side}\",\"median_ms\":{time:.3},\"mflop\":{defined:.1}}}"
                );
            } else {
                println!(
                    "{name:<8} {side:>4} {time:>10.2} {:>9.1} {:>9.1}",
                    defined / time,
                    done / time
                );
            }
        }
    }
    Ok(())
}

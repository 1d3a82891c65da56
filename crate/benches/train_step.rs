//! Time of a training step: forward, backward and Adam on 8 snippets of 3 frames, input 128 x 128, target 64 x 64.
//!
//! `cargo bench -p tracklens --bench train_step` prints a table; with `-- --json NAME` one line of JSON for the
//! architecture that `peers/train_step_torch.py` times as well. `--threads N` limits the threads, `--steps N` says
//! how many steps are timed.

use std::error::Error;
use std::time::Instant;

use tracklens::checkpoint::SaeConfig;
use tracklens::model::fresh_weights;
use tracklens::train::Trainer;

const IMAGES: usize = 8 * 3;
const INPUT: usize = 128;

/// What is timed.
const ARCHITECTURES: [&str; 2] = ["basic", "keynet-vel-std-bg"];

/// The median of `steps` steps after two that are not counted, in milliseconds.
fn median_ms(architecture: &str, steps: usize) -> Result<f64, Box<dyn Error>> {
    let config = SaeConfig::named(architecture)?;
    let mut trainer = Trainer::new(&fresh_weights(&config, 0), 1e-3)?;
    let [width, height] = config.target_size;
    let values = |len: usize| -> Vec<f32> { (0..len).map(|i| (i * 7919 % 1009) as f32 / 1009.0).collect() };
    let mut times = Vec::new();
    for step in 0..steps + 2 {
        let inputs = values(IMAGES * 3 * INPUT * INPUT);
        let targets = values(IMAGES * 3 * width * height);
        let start = Instant::now();
        trainer.step(inputs, targets, [INPUT; 2])?;
        if step >= 2 {
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).map(String::as_str)
    };
    let steps = value("--steps").map_or(Ok(7), str::parse)?;
    if let Some(threads) = value("--threads") {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.parse()?)
            .build_global()?;
    }
    if let Some(architecture) = value("--json") {
        let time = median_ms(architecture, steps)?;
        println!("{{\"name\":\"train_step_{architecture}\",\"median_ms\":{time:.2}}}");
        return Ok(());
    }
    println!("{:<20} {:>10}", "architecture", "median ms");
    for architecture in ARCHITECTURES {
        println!("{architecture:<20} {:>10.1}", median_ms(architecture, steps)?);
    }
    Ok(())
}

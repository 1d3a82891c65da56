//! Time of extraction in rten, of encoders that `tracklens export` wrote.
//!
//! `extract_rten FOLDER [--threads N]` prints a line of JSON for every encoder and size: the median
//! of 15 frames after two that are not counted, one frame at a time on N threads.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use rten::{Model, ModelOptions, RunOptions, ThreadPool};
use rten_tensor::NdTensor;
use rten_tensor::prelude::*;

const ENCODERS: [&str; 3] = ["basic", "keynet", "dsae"];
const SIDES: [usize; 2] = [128, 256];
const TIMES: usize = 15;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let folder = arguments.get(1).ok_or("expected a folder of encoders")?;
    let threads = match arguments.iter().position(|argument| argument == "--threads") {
        Some(at) => arguments
            .get(at + 1)
            .ok_or("expected a number of threads")?
            .parse()?,
        None => 1,
    };
    let pool = Arc::new(ThreadPool::with_num_threads(threads));
    for name in ENCODERS {
        let path = Path::new(folder).join(name).with_extension("onnx");
        let model: Model = ModelOptions::with_all_ops()
            .prepack_weights(true)
            .load_file(path)?;
        for side in SIDES {
            let values = (0..3 * side * side).map(|i| (i * 31 % 97) as f32 / 97.0);
            let image = NdTensor::from_data([1, 3, side, side], values.collect::<Vec<_>>());
            let mut times = Vec::new();
            for _ in 0..TIMES + 2 {
                let options = RunOptions::default().with_thread_pool(Some(pool.clone()));
                let start = Instant::now();
                model.run_one(image.view().into(), Some(options))?;
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
            let times = &mut times[2..];
            times.sort_by(f64::total_cmp);
            println!(
                "{{\"name\":\"{name} {side}\",\"median_ms\":{:.3}}}",
                times[TIMES / 2]
            );
        }
    }
    Ok(())
}

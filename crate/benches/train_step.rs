//! Time of a training step: forward, backward and Adam on 8 snippets of 3 frames, input 128 x 128,
//! target 64 x 64.
//!
//! `cargo bench -p tracklens --bench train_step` prints a table; with `-- --json NAME` one line of
//! JSON for the architecture that `peers/train_step_torch.py` times as well. `--threads N` limits
//! the threads, `--steps N` says how many steps are timed, `--snippets N` and `--input SIDE` make
//! them of another size, `--architectures A,B` of others, `--device gpu` times the GPU, with the
//! feature of that name. `--input 256 --snippets 4` is an eighth of a step of the paper.

use std::error::Error;
use std::time::Instant;

use burn::prelude::Device;
use tracklens::checkpoint::{Family, SaeConfig};
use tracklens::device::DeviceKind;
use tracklens::model::{fresh_weights, open};
use tracklens::train::Trainer;

/// A snippet: three frames in a row.
const FRAMES: usize = 3;

/// What is timed.
const ARCHITECTURES: &str = "basic,keynet-vel-std-bg";

/// What a step is made of.
#[derive(Clone, Copy)]
struct Step {
    /// Frames a step.
    images: usize,
    /// Side of the square input.
    input: usize,
}

/// Floating-point operations of a step, by the definition of the convolutions: forwards, and
/// backwards to the inputs and to the weights, which take as many each. Of the decoder of a DSAE,
/// too.
fn operations(config: &SaeConfig, step: Step) -> f64 {
    let mut macs = 0;
    for (layers, mut side) in [
        (config.encoder_layers(), step.input),
        (config.decoder_layers(), config.map_size()[0]),
    ] {
        for layer in layers {
            let Some((convolved, output)) = layer.convolved_side(side).zip(layer.output_side(side))
            else {
                break;
            };
            macs += layer.inputs * layer.outputs * layer.kernel.pow(2) * convolved.pow(2);
            side = output;
        }
    }
    if config.architecture.family == Family::Dsae {
        let [width, height] = config.target_size;
        macs += 2 * config.keypoints * 3 * width * height;
    }
    3.0 * 2.0 * (macs * step.images) as f64
}

/// The median of `steps` steps after two that are not counted, in milliseconds.
fn median_ms(
    config: &SaeConfig,
    step: Step,
    steps: usize,
    device: &Device,
) -> Result<f64, Box<dyn Error>> {
    let Step { images, input } = step;
    let mut trainer = Trainer::on(device, &fresh_weights(config, 0), 1e-3)?;
    let [width, height] = config.target_size;
    let values = |len: usize| -> Vec<f32> {
        (0..len)
            .map(|i| (i * 7919 % 1009) as f32 / 1009.0)
            .collect()
    };
    let mut times = Vec::new();
    for index in 0..steps + 2 {
        let inputs = values(images * 3 * input * input);
        let targets = values(images * 3 * width * height);
        let start = Instant::now();
        trainer.step(inputs, targets, [input; 2])?;
        if index >= 2 {
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
    let number = |name: &str, default: usize| value(name).map_or(Ok(default), str::parse);
    let steps = number("--steps", 7)?;
    let step = Step {
        images: FRAMES * number("--snippets", 8)?,
        input: number("--input", 128)?,
    };
    if let Some(threads) = value("--threads") {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.parse()?)
            .build_global()?;
    }
    let device = open(match value("--device").unwrap_or("cpu") {
        "cpu" => DeviceKind::Cpu,
        "gpu" => DeviceKind::Gpu,
        other => return Err(format!("unknown device {other}; expected cpu or gpu").into()),
    })?
    .device;
    if let Some(architecture) = value("--json") {
        let time = median_ms(&SaeConfig::named(architecture)?, step, steps, &device)?;
        println!("{{\"name\":\"train_step_{architecture}\",\"median_ms\":{time:.2}}}");
        return Ok(());
    }
    println!(
        "{:<20} {:>10} {:>12} {:>10}",
        "architecture", "median ms", "GFLOP a step", "GFLOP/s"
    );
    for architecture in value("--architectures").unwrap_or(ARCHITECTURES).split(',') {
        let config = SaeConfig::named(architecture)?;
        let time = median_ms(&config, step, steps, &device)?;
        let gflop = operations(&config, step) / 1e9;
        println!(
            "{architecture:<20} {time:>10.1} {gflop:>12.1} {:>10.1}",
            gflop / time * 1e3
        );
    }
    Ok(())
}

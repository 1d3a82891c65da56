//! The burn modules and one step of their training against the authors' modules (`golden/*.safetensors`).

mod shared;

use std::collections::BTreeMap;

use burn::prelude::{Device, Tensor, TensorData};
use safetensors::SafeTensors;
use shared::{golden, tensor};
use tracklens::checkpoint::{self, Checkpoint};
use tracklens::data::{Filter, Frame};
use tracklens::engine::{Encoder, Workspace};
use tracklens::model::{Sae, points_xy};
use tracklens::train::Trainer;

/// As in the engine's tests: float32 sums in another order, magnified by peaky attention; 1e-5 is measured.
const KEYPOINTS: f32 = 1e-4;

/// A blob of sigma 0.1 turns an error of a keypoint into one of the reconstruction that is tens of times larger: 3e-4 is
/// measured, 7e-4 is what PyTorch's own float32 differs from its float64 by.
const RECONSTRUCTION: f32 = 2e-3;

fn largest(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let difference = |(a, b): (&f32, &f32)| (a - b).abs();
    // A NaN must not pass for a small difference.
    a.iter().zip(b).map(difference).fold(
        0.0,
        |largest, d| if d > largest || d.is_nan() { d } else { largest },
    )
}

fn batch(shape: &[usize], values: Vec<f32>, device: &Device) -> Tensor<4> {
    let shape: [usize; 4] = shape.try_into().expect("four axes");
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("f32 values")
}

fn equals_the_reference(bytes: &[u8], sizes: &[&str]) {
    let device = Device::flex();
    let checkpoint = Checkpoint::from_safetensors(bytes).expect("a checkpoint");
    let sae = Sae::from_checkpoint(&checkpoint, &device).expect("an SAE");
    let file = SafeTensors::deserialize(bytes).expect("safetensors");
    for size in sizes {
        let (shape, input) = tensor(&file, &format!("golden.input{size}"));
        let output = sae.forward(batch(&shape, input, &device));
        let keypoints = largest(
            &values(output.latent),
            &tensor(&file, &format!("golden.keypoints{size}")).1,
        );
        let expected = tensor(&file, &format!("golden.reconstruction{size}")).1;
        let reconstruction = largest(&values(output.reconstruction), &expected);
        println!("{size} px: keypoints {keypoints:.1e}, reconstruction {reconstruction:.1e}");
        assert!(keypoints < KEYPOINTS && reconstruction < RECONSTRUCTION);
    }
}

#[test]
fn a_tiny_sae_equals_the_reference() {
    equals_the_reference(&golden("basic-vel-std-bg-tiny.safetensors"), &["64"]);
}

#[test]
fn the_basic_sae_equals_the_reference() {
    if let Some(bytes) = shared::large_golden("basic.safetensors") {
        equals_the_reference(&bytes, &["64", "256"]);
    }
}

#[test]
fn the_engine_computes_what_the_module_defines() {
    let checkpoint =
        Checkpoint::from_safetensors(&golden("basic-vel-std-bg-tiny.safetensors")).expect("valid");
    let device = Device::flex();
    let sae = Sae::from_checkpoint(&checkpoint, &device).expect("an SAE");
    let engine = Encoder::new(&checkpoint).expect("a plan");
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/data/panda_push/seq_0012/frame_003.png"
    );
    let frame = Frame::decode(&std::fs::read(path).expect("a frame")).expect("an image");
    for size in [[256usize, 256], [100, 76], [33, 257]] {
        let input = frame.to_planar(Some(size), Filter::BilinearAntialias);
        let [width, height] = size;
        let module = points_xy(
            sae.encoder
                .forward(batch(&[1, 3, height, width], input.clone(), &device)),
        );
        let module: Vec<f32> = module.expect("points").iter().map(|v| *v as f32).collect();
        let engine = engine
            .run(&mut Workspace::default(), &input, size)
            .expect("points");
        let difference = largest(&engine.concat(), &module);
        println!("{width} x {height}: {difference:.1e}");
        assert!(difference < KEYPOINTS);
    }
}

fn state(file: &SafeTensors, prefix: &str, like: &Checkpoint) -> BTreeMap<String, checkpoint::Tensor> {
    let read = |name: &String| {
        let (shape, data) = tensor(file, &format!("{prefix}.{name}"));
        (name.clone(), checkpoint::Tensor { shape, data })
    };
    like.config
        .tensor_shapes()
        .iter()
        .map(|(name, _)| read(name))
        .collect()
}

#[test]
fn three_steps_of_training_equal_the_reference() {
    // The same tiny model; its file tells the architecture, except -vel, which leaves no tensor.
    let mut start =
        Checkpoint::from_safetensors(&golden("basic-vel-std-bg-tiny.safetensors")).expect("valid");
    start.config.architecture = "basic-vel-std-bg".parse().expect("an architecture");
    let bytes = golden("train-basic-vel-std-bg-tiny.safetensors");
    let file = SafeTensors::deserialize(&bytes).expect("safetensors");
    start.tensors = state(&file, "init", &start);
    let mut trainer = Trainer::new(&start, 1e-3).expect("a trainer");
    let (_, inputs) = tensor(&file, "train.inputs");
    let (_, targets) = tensor(&file, "train.targets");
    let (_, losses) = tensor(&file, "train.losses");
    let device = Device::flex().autodiff();
    let training = Sae::from_checkpoint(&start, &device).expect("an SAE");
    let output = training.forward(batch(&[12, 3, 32, 32], inputs.clone(), &device));
    let keypoints = largest(&values(output.latent), &tensor(&file, "train.keypoints_step0").1);
    let reconstruction = largest(
        &values(output.reconstruction),
        &tensor(&file, "train.reconstruction_step0").1,
    );
    println!("batch statistics: keypoints {keypoints:.1e}, reconstruction {reconstruction:.1e}");
    assert!(keypoints < KEYPOINTS && reconstruction < RECONSTRUCTION);
    for (step, expected) in losses.chunks_exact(3).enumerate() {
        let ours = trainer
            .step(inputs.clone(), targets.clone(), [32, 32])
            .expect("a step");
        let ours = [ours.total, ours.reconstruction, 0.1 * ours.velocity];
        println!("step {step}: {ours:?}, expected {expected:?}");
        for (ours, expected) in ours.iter().zip(expected) {
            // Relative; the reference's float32 differs from its float64 by up to 1e-5 in the third step.
            assert!(
                (ours - f64::from(*expected)).abs() < 1e-4 * f64::from(*expected),
                "step {step}"
            );
        }
        let after = match step {
            0 => state(&file, "after1", &start),
            2 => state(&file, "after3", &start),
            _ => continue,
        };
        let found = trainer.checkpoint(BTreeMap::new()).expect("weights").tensors;
        for (name, expected) in after {
            // Its true gradient is 0 (the softmax does not see a shift): Adam makes steps of float noise.
            if name == "encoder.aggregate_conv.bias" {
                continue;
            }
            let difference = largest(&found[&name].data, &expected.data);
            // A step of Adam is 1e-3; a tenth of that tells a wrong gradient from rounding in this tiny model.
            assert!(difference < 1e-4, "after step {step}, {name}: {difference:e}");
        }
    }
    // The running statistics of batch norm count as well: with them the SAE infers.
    let output = trainer
        .valid()
        .forward(batch(&[12, 3, 32, 32], inputs, &Device::flex()));
    let reconstruction = largest(
        &values(output.reconstruction),
        &tensor(&file, "eval.reconstruction_after3").1,
    );
    println!("after three steps: reconstruction {reconstruction:.1e}");
    // Weights that differ by up to 1e-4 move it.
    assert!(reconstruction < 1e-2);
}

#[test]
fn a_checkpoint_survives_the_way_through_the_module() {
    let checkpoint =
        Checkpoint::from_safetensors(&golden("basic-vel-std-bg-tiny.safetensors")).expect("valid");
    let sae = Sae::from_checkpoint(&checkpoint, &Device::flex()).expect("an SAE");
    let again = sae
        .to_checkpoint(&checkpoint.config, BTreeMap::new())
        .expect("weights");
    for (name, _) in checkpoint.config.tensor_shapes() {
        assert_eq!(again.tensors[&name], checkpoint.tensors[&name], "{name}");
    }
    let mut encoder_only = checkpoint.clone();
    encoder_only
        .tensors
        .retain(|name, _| name.starts_with("encoder."));
    let error = Sae::from_checkpoint(&encoder_only, &Device::flex())
        .expect_err("no decoder")
        .to_string();
    assert!(error.contains("holds an encoder only"), "{error}");
}

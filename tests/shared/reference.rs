//! The SAEs and their training on any device against the authors' modules.
#![allow(dead_code, reason = "every test file uses its own part")]

use std::collections::BTreeMap;

use burn::prelude::{Device, Tensor, TensorData};
use safetensors::SafeTensors;
use tracklens::checkpoint::{self, Checkpoint};
use tracklens::model::Sae;
use tracklens::train::Trainer;

use crate::shared::{golden, tensor};

/// As in the engine's tests: float32 sums in another order, magnified by peaky attention; 1e-5 is
/// measured.
pub const KEYPOINTS: f32 = 1e-4;

/// A blob of sigma 0.1 turns an error of a keypoint into one of the reconstruction that is tens of
/// times larger: 3e-4 is measured, 7e-4 is what PyTorch's own float32 differs from its float64 by.
const RECONSTRUCTION: f32 = 2e-3;

pub fn largest(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let difference = |(a, b): (&f32, &f32)| (a - b).abs();
    // A NaN must not pass for a small difference.
    a.iter().zip(b).map(difference).fold(0.0, |largest, d| {
        if d > largest || d.is_nan() {
            d
        } else {
            largest
        }
    })
}

pub fn batch(shape: &[usize], values: Vec<f32>, device: &Device) -> Tensor<4> {
    let shape: [usize; 4] = shape.try_into().expect("four axes");
    Tensor::from_data(TensorData::new(values, shape), device)
}

pub fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("f32 values")
}

/// What the SAE of a golden file gives on a device is what PyTorch gave.
pub fn equals_the_reference(bytes: &[u8], sizes: &[&str], device: &Device) {
    let checkpoint = Checkpoint::from_safetensors(bytes).expect("a checkpoint");
    let sae = Sae::from_checkpoint(&checkpoint, device).expect("an SAE");
    let file = SafeTensors::deserialize(bytes).expect("safetensors");
    for size in sizes {
        let (shape, input) = tensor(&file, &format!("golden.input{size}"));
        let output = sae.forward(batch(&shape, input, device));
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

pub const TINY: [&str; 3] = [
    "basic-vel-std-bg-tiny",
    "dsae-tiny",
    "keynet-vel-std-bg-tiny",
];

fn state(
    file: &SafeTensors,
    prefix: &str,
    like: &Checkpoint,
) -> BTreeMap<String, checkpoint::Tensor> {
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

/// The true gradient of a bias before a softmax is 0 (it does not see a shift): what is left is
/// float noise, which Adam turns into whole steps.
fn is_noise(name: &str) -> bool {
    name == "encoder.aggregate_conv.bias"
}

/// |a - b| / |b| over all values.
fn relative_norm(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let square = |v: f64| v * v;
    let difference: f64 = a.iter().zip(b).map(|(a, b)| square(f64::from(a - b))).sum();
    let norm: f64 = b.iter().map(|b| square(f64::from(*b))).sum();
    (difference / norm).sqrt()
}

/// How far a training may be from the recorded one.
pub struct Tolerances {
    /// Of the losses in the first step and in the later ones, relative to the total.
    pub losses: [f64; 2],
    /// Of the gradients of all weights together, and of the single ones, by relative norm.
    pub gradients: [f64; 2],
    /// Of a weight after one and three steps, absolute; `None`: the whole update by relative norm
    /// alone.
    pub weights: Option<f32>,
    /// Of the whole update after one and three steps, by relative norm.
    pub update: f64,
}

/// Three steps on a device come to what PyTorch came to.
///
/// `like` has the sizes, `recorded` the weights and gradients.
pub fn training_equals_the_reference(
    architecture: &str,
    like: &Checkpoint,
    recorded: &[u8],
    tolerances: &Tolerances,
    device: &Device,
) {
    let file = SafeTensors::deserialize(recorded).expect("safetensors");
    let mut start = like.clone();
    // A file tells the architecture except -vel, which leaves no tensor.
    start.config.architecture = architecture.parse().expect("an architecture");
    start.tensors = state(&file, "init", &start);
    let (shape, inputs) = tensor(&file, "train.inputs");
    let (frames, side) = (shape[0] * shape[1], shape[3]);
    let (_, targets) = tensor(&file, "train.targets");
    let (_, losses) = tensor(&file, "train.losses");

    let autodiff = device.clone().autodiff();
    let sae = Sae::from_checkpoint(&start, &autodiff).expect("an SAE");
    let output = sae.forward(batch(&[frames, 3, side, side], inputs.clone(), &autodiff));
    let keypoints = largest(
        &values(output.latent),
        &tensor(&file, "train.keypoints_step0").1,
    );
    let reconstruction = largest(
        &values(output.reconstruction),
        &tensor(&file, "train.reconstruction_step0").1,
    );
    println!(
        "{}: with the batch's statistics, keypoints {keypoints:.1e}, reconstruction {reconstruction:.1e}",
        architecture
    );
    assert!(keypoints < KEYPOINTS && reconstruction < RECONSTRUCTION);

    let gradients = Trainer::on(device, &start, 1e-3)
        .expect("a trainer")
        .gradients(inputs.clone(), targets.clone(), [side, side])
        .expect("gradients");
    let (mut ours, mut expected, mut worst) = (Vec::new(), Vec::new(), (0.0, ""));
    for (name, gradient) in gradients.iter().filter(|(name, _)| !is_noise(name)) {
        let reference = tensor(&file, &format!("grad1.{name}")).1;
        worst = worst_of(worst, (relative_norm(&gradient.data, &reference), name));
        ours.extend_from_slice(&gradient.data);
        expected.extend(reference);
    }
    let all = relative_norm(&ours, &expected);
    println!(
        "gradients: {all:.1e}, the worst {:.1e} ({})",
        worst.0, worst.1
    );
    assert!(all < tolerances.gradients[0] && worst.0 < tolerances.gradients[1]);

    let mut trainer = Trainer::on(device, &start, 1e-3).expect("a trainer");
    for (step, expected) in losses.chunks_exact(3).enumerate() {
        let ours = trainer
            .step(inputs.clone(), targets.clone(), [side, side])
            .expect("a step");
        let ours = [ours.total, ours.reconstruction, 0.1 * ours.velocity];
        println!("step {step}: {ours:?}, expected {expected:?}");
        let total = f64::from(expected[0]);
        for (ours, expected) in ours.iter().zip(expected) {
            let difference = (ours - f64::from(*expected)).abs();
            assert!(
                difference < tolerances.losses[step.min(1)] * total,
                "step {step}"
            );
        }
        let prefix = ["after1", "", "after3"][step];
        if !file
            .names()
            .iter()
            .any(|name| name.starts_with(&format!("{prefix}.")))
            || prefix.is_empty()
        {
            continue;
        }
        let found = trainer
            .checkpoint(BTreeMap::new())
            .expect("weights")
            .tensors;
        let (mut ours, mut reference, mut worst) = (Vec::new(), Vec::new(), (0.0, ""));
        let after = state(&file, prefix, &start);
        for (name, after) in after.iter().filter(|(name, _)| !is_noise(name)) {
            worst = worst_of(
                worst,
                (f64::from(largest(&found[name].data, &after.data)), name),
            );
            let from = &start.tensors[name].data;
            ours.extend(found[name].data.iter().zip(from).map(|(a, b)| a - b));
            reference.extend(after.data.iter().zip(from).map(|(a, b)| a - b));
        }
        let update = relative_norm(&ours, &reference);
        println!(
            "{prefix}: update {update:.1e}, the worst weight {:.1e} ({})",
            worst.0, worst.1
        );
        assert!(update < tolerances.update, "{prefix}");
        if let Some(limit) = tolerances.weights {
            assert!(worst.0 < f64::from(limit), "{prefix}: {worst:?}");
        }
    }
    // The running statistics of batch norm count as well: with them the SAE infers.
    let input = batch(&[frames, 3, side, side], inputs, device);
    let output = trainer.valid().forward(input);
    let keypoints = largest(
        &values(output.latent),
        &tensor(&file, "eval.keypoints_after3").1,
    );
    println!("after three steps: keypoints {keypoints:.1e}");
    assert!(keypoints < 1e-2);
}

fn worst_of<'a>(a: (f64, &'a str), b: (f64, &'a str)) -> (f64, &'a str) {
    if b.0 > a.0 || b.0.is_nan() { b } else { a }
}

/// The recorded trainings of the tiny SAEs of every family.
pub fn tiny_training_equals_the_reference(tolerances: &Tolerances, device: &Device) {
    for architecture in ["basic-vel-std-bg", "dsae", "keynet-vel-std-bg"] {
        let like = golden(&format!("{architecture}-tiny.safetensors"));
        let like = Checkpoint::from_safetensors(&like).expect("valid");
        let recorded = golden(&format!("train-{architecture}-tiny.safetensors"));
        training_equals_the_reference(architecture, &like, &recorded, tolerances, device);
    }
}

//! The burn modules and one step of their training against the authors' modules (`golden/*.safetensors`).

mod shared;

use std::collections::BTreeMap;

use burn::prelude::{Device, Tensor, TensorData};
use safetensors::SafeTensors;
use shared::{golden, tensor};
use tracklens::checkpoint::{self, Checkpoint, SaeConfig};
use tracklens::data::{Filter, Frame};
use tracklens::engine::{Encoder, Workspace};
use tracklens::model::{Sae, fresh_weights, load_first_layer, points_xy};
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

const TINY: [&str; 3] = ["basic-vel-std-bg-tiny", "dsae-tiny", "keynet-vel-std-bg-tiny"];

#[test]
fn tiny_saes_equal_the_reference() {
    for name in TINY {
        println!("{name}");
        equals_the_reference(&golden(&format!("{name}.safetensors")), &["64"]);
    }
}

#[test]
fn the_papers_saes_equal_the_reference() {
    for name in ["basic", "dsae", "keynet-vel-std-bg"] {
        if let Some(bytes) = shared::large_golden(&format!("{name}.safetensors")) {
            println!("{name}");
            equals_the_reference(&bytes, &["64", "256"]);
        }
    }
}

#[test]
fn the_engine_computes_what_the_module_defines() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/data/panda_push/seq_0012/frame_003.png"
    );
    let frame = Frame::decode(&std::fs::read(path).expect("a frame")).expect("an image");
    let device = Device::flex();
    for name in TINY {
        let mut checkpoint =
            Checkpoint::from_safetensors(&golden(&format!("{name}.safetensors"))).expect("valid");
        if !checkpoint.config.trained_temperature {
            checkpoint.config.temperature = 0.7;
        }
        let sae = Sae::from_checkpoint(&checkpoint, &device).expect("an SAE");
        let engine = Encoder::new(&checkpoint).expect("a plan");
        for size in [[256usize, 256], [100, 76], [33, 257]] {
            let input = frame.to_planar(Some(size), Filter::BilinearAntialias);
            let [width, height] = size;
            let module = points_xy(sae.encoder.forward(batch(
                &[1, 3, height, width],
                input.clone(),
                &device,
            )));
            let module: Vec<f32> = module.expect("points").iter().map(|v| *v as f32).collect();
            let engine = engine
                .run(&mut Workspace::default(), &input, size)
                .expect("points");
            let difference = largest(&engine.concat(), &module);
            println!("{name}, {width} x {height}: {difference:.1e}");
            assert!(difference < KEYPOINTS);
        }
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

/// The true gradient of a bias before a softmax is 0 (it does not see a shift): what is left is float noise, which Adam
/// turns into whole steps.
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

struct Training {
    architecture: &'static str,
    bytes: Vec<u8>,
    /// Of the losses, relative to the total.
    losses: f64,
    /// Of the gradients of all weights together, and of the single ones, by relative norm.
    gradients: [f64; 2],
    /// Of a weight after one and three steps, absolute; `None`: the whole update by relative norm instead.
    weights: Option<f32>,
    update: f64,
}

fn training_equals_the_reference(training: &Training, like: &Checkpoint) {
    let file = SafeTensors::deserialize(&training.bytes).expect("safetensors");
    let mut start = like.clone();
    // A file tells the architecture except -vel, which leaves no tensor.
    start.config.architecture = training.architecture.parse().expect("an architecture");
    start.tensors = state(&file, "init", &start);
    let (shape, inputs) = tensor(&file, "train.inputs");
    let (frames, side) = (shape[0] * shape[1], shape[3]);
    let (_, targets) = tensor(&file, "train.targets");
    let (_, losses) = tensor(&file, "train.losses");

    let device = Device::flex().autodiff();
    let sae = Sae::from_checkpoint(&start, &device).expect("an SAE");
    let output = sae.forward(batch(&[frames, 3, side, side], inputs.clone(), &device));
    let keypoints = largest(&values(output.latent), &tensor(&file, "train.keypoints_step0").1);
    let reconstruction = largest(
        &values(output.reconstruction),
        &tensor(&file, "train.reconstruction_step0").1,
    );
    println!(
        "{}: with the batch's statistics, keypoints {keypoints:.1e}, reconstruction {reconstruction:.1e}",
        training.architecture
    );
    assert!(keypoints < KEYPOINTS && reconstruction < RECONSTRUCTION);

    let gradients = Trainer::new(&start, 1e-3)
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
    println!("gradients: {all:.1e}, the worst {:.1e} ({})", worst.0, worst.1);
    assert!(all < training.gradients[0] && worst.0 < training.gradients[1]);

    let mut trainer = Trainer::new(&start, 1e-3).expect("a trainer");
    for (step, expected) in losses.chunks_exact(3).enumerate() {
        let ours = trainer
            .step(inputs.clone(), targets.clone(), [side, side])
            .expect("a step");
        let ours = [ours.total, ours.reconstruction, 0.1 * ours.velocity];
        println!("step {step}: {ours:?}, expected {expected:?}");
        let total = f64::from(expected[0]);
        for (ours, expected) in ours.iter().zip(expected) {
            let difference = (ours - f64::from(*expected)).abs();
            assert!(difference < training.losses * total, "step {step}");
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
        let found = trainer.checkpoint(BTreeMap::new()).expect("weights").tensors;
        let (mut ours, mut reference, mut worst) = (Vec::new(), Vec::new(), (0.0, ""));
        let after = state(&file, prefix, &start);
        for (name, after) in after.iter().filter(|(name, _)| !is_noise(name)) {
            worst = worst_of(worst, (f64::from(largest(&found[name].data, &after.data)), name));
            let from = &start.tensors[name].data;
            ours.extend(found[name].data.iter().zip(from).map(|(a, b)| a - b));
            reference.extend(after.data.iter().zip(from).map(|(a, b)| a - b));
        }
        let update = relative_norm(&ours, &reference);
        println!(
            "{prefix}: update {update:.1e}, the worst weight {:.1e} ({})",
            worst.0, worst.1
        );
        assert!(update < training.update, "{prefix}");
        if let Some(limit) = training.weights {
            assert!(worst.0 < f64::from(limit), "{prefix}: {worst:?}");
        }
    }
    // The running statistics of batch norm count as well: with them the SAE infers.
    let input = batch(&[frames, 3, side, side], inputs, &Device::flex());
    let output = trainer.valid().forward(input);
    let keypoints = largest(&values(output.latent), &tensor(&file, "eval.keypoints_after3").1);
    println!("after three steps: keypoints {keypoints:.1e}");
    assert!(keypoints < 1e-2);
}

fn worst_of<'a>(a: (f64, &'a str), b: (f64, &'a str)) -> (f64, &'a str) {
    if b.0 > a.0 || b.0.is_nan() { b } else { a }
}

#[test]
fn three_steps_of_training_equal_the_reference() {
    for architecture in ["basic-vel-std-bg", "dsae", "keynet-vel-std-bg"] {
        let like = golden(&format!("{architecture}-tiny.safetensors"));
        let training = Training {
            architecture,
            bytes: golden(&format!("train-{architecture}-tiny.safetensors")),
            // Relative; the reference's float32 differs from its float64 by up to 1e-5 in the third step.
            losses: 1e-4,
            gradients: [1e-3, 1e-2],
            // A step of Adam is 1e-3; a tenth of that tells a wrong gradient from rounding in these tiny models.
            weights: Some(1e-4),
            update: 1e-2,
        };
        training_equals_the_reference(&training, &Checkpoint::from_safetensors(&like).expect("valid"));
    }
}

#[test]
fn three_steps_of_training_at_full_size_equal_the_reference() {
    let architecture = "basic-vel-std-bg";
    let Some(bytes) = shared::large_golden(&format!("train-{architecture}.safetensors")) else {
        return;
    };
    let config = SaeConfig::named(architecture).expect("an architecture");
    let training = Training {
        architecture,
        bytes,
        // ReLU and max-pool decisions flip in float32: losses agree to 2e-3, gradients as a whole and the first steps of
        // Adam, which see their signs, by norm only.
        losses: 2e-3,
        gradients: [5e-2, 2e-1],
        weights: None,
        update: 2e-1,
    };
    training_equals_the_reference(&training, &fresh_weights(&config, 0));
}

#[test]
fn a_checkpoint_survives_the_way_through_the_module() {
    for name in TINY {
        let mut checkpoint =
            Checkpoint::from_safetensors(&golden(&format!("{name}.safetensors"))).expect("valid");
        if checkpoint.config.architecture.trained_sigma {
            // A standard deviation for every keypoint has another shape.
            checkpoint.config.sigma_per_keypoint = true;
            let shape = vec![checkpoint.config.keypoints, 1, 1];
            let data = (0..shape[0]).map(|n| 0.1 + 0.01 * n as f32).collect();
            let sigma = checkpoint::Tensor { shape, data };
            checkpoint.tensors.insert(checkpoint::SIGMA.to_owned(), sigma);
        }
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
}

#[test]
fn every_named_architecture_has_the_papers_tensors() {
    // Parameters as PyTorch counts them in the authors' modules.
    for (name, parameters) in [
        ("basic", 322_051),
        ("basic-kp32", 333_331),
        ("basic-vel-std-bg", 334_340),
        ("dsae", 479_137),
        ("keynet", 2_398_657),
        ("keynet-vel-std-bg", 2_410_946),
    ] {
        let config = SaeConfig::named(name).expect("an architecture");
        assert_eq!(config.name(), name);
        let count: usize = config
            .tensor_shapes()
            .iter()
            .filter(|(name, _)| !name.contains("running_"))
            .map(|(_, shape)| shape.iter().product::<usize>())
            .sum();
        assert_eq!(count, parameters, "{name}");
    }
}

#[test]
fn the_maps_of_a_limited_sigma_end_at_the_limit() {
    let mut config = SaeConfig::named("basic-kp1").expect("an architecture");
    config.sigma_limit = Some(2.0);
    let device = Device::flex();
    let sae = Sae::init(&config, 0, &device).expect("an SAE");
    let centre = Tensor::from_data(TensorData::new(vec![0.0f32, 0.0], [1, 1, 2]), &device);
    let map = values(sae.decoder.gaussian_sampling.forward(centre));
    for (i, value) in map.iter().enumerate() {
        let [y, x] = [i / 64, i % 64].map(|k| 2.0 * k as f64 / 63.0 - 1.0);
        let expected = ((-(x * x + y * y) / 0.01).exp() - (-4.0f64).exp()).max(0.0);
        assert!(
            (f64::from(*value) - expected).abs() < 1e-6,
            "{value} at ({x}, {y})"
        );
    }
}

/// A `.safetensors` file of these tensors.
fn file(tensors: &[(&str, &checkpoint::Tensor)]) -> Vec<u8> {
    let bytes: Vec<Vec<u8>> = tensors
        .iter()
        .map(|(_, tensor)| tensor.data.iter().flat_map(|v| v.to_le_bytes()).collect())
        .collect();
    let views = tensors.iter().zip(&bytes).map(|((name, tensor), bytes)| {
        let view = safetensors::tensor::TensorView::new(safetensors::Dtype::F32, tensor.shape.clone(), bytes);
        (*name, view.expect("a tensor"))
    });
    safetensors::serialize(views, None).expect("a file")
}

#[test]
fn a_dsae_takes_its_first_layer_from_a_densenet() {
    let config = SaeConfig::named("dsae").expect("an architecture");
    let (mut weights, untouched) = (fresh_weights(&config, 0), fresh_weights(&config, 0));
    let filters = checkpoint::Tensor {
        shape: vec![64, 3, 7, 7],
        data: (0..64 * 3 * 49).map(|i| i as f32 * 1e-3).collect(),
    };
    let like_it = checkpoint::Tensor {
        data: vec![0.5; filters.data.len()],
        ..filters.clone()
    };
    let dense = checkpoint::Tensor {
        shape: vec![2],
        data: vec![0.0; 2],
    };

    let densenet = file(&[
        ("classifier.bias", &dense),
        ("features.conv0.weight", &filters),
        ("features.other.weight", &like_it),
    ]);
    let name = load_first_layer(&mut weights, &densenet).expect("a first layer");
    assert_eq!(name, "features.conv0.weight");
    for (name, tensor) in &weights.tensors {
        let expected = match name.as_str() {
            "encoder.conv1.weight" => &filters,
            other => &untouched.tensors[other],
        };
        assert_eq!(tensor, expected, "{name}");
    }
    let only = file(&[("conv1.weight", &like_it), ("fc.bias", &dense)]);
    assert_eq!(
        load_first_layer(&mut weights, &only).expect("the one"),
        "conv1.weight"
    );

    let message = |tensors: &[(&str, &checkpoint::Tensor)]| {
        let error = load_first_layer(&mut fresh_weights(&config, 0), &file(tensors));
        error.expect_err("not to be used").to_string()
    };
    assert!(message(&[("fc.bias", &dense)]).contains("none of its 1 tensors has the shape [64, 3, 7, 7]"));
    assert!(message(&[("a", &filters), ("b", &like_it)]).contains("2 of its tensors (a, …) have the shape"));
    let mut broken = filters.clone();
    broken.data[5] = f32::NAN;
    assert!(message(&[("a", &broken)]).contains("`a` holds NaN"));
}

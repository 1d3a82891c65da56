//! The burn modules against the authors' PyTorch modules.
//!
//! The golden files hold weights, inputs and outputs of the authors' own modules (PyTorch, CPU, f32). The one with
//! `-tiny` in its name are of the same classes with few filters. The full-size ones are read from the folder that the
//! environment variable `TRACKLENS_SHARED` names.

use std::collections::BTreeMap;
use std::path::PathBuf;

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::prelude::{Device, Tensor, TensorData};
use tracklens::checkpoint::{self, Architecture, Checkpoint, SaeConfig};
use tracklens::model::{Encoder, Sae, fresh_weights, points_xy};
use tracklens::train::{Batch, SnippetLoss, TrainConfig, Trainer};

type Tensors = BTreeMap<String, checkpoint::Tensor>;

/// Eight times what f32 PyTorch differs from f64 PyTorch at most.
const KEYPOINT_TOLERANCE: f32 = 1e-4;
/// f32 PyTorch differs from f64 PyTorch by up to 7e-4: with sigma = 0.1 a blob's slope magnifies an error of a keypoint
/// by almost ten, and three convolutions follow.
const RECONSTRUCTION_TOLERANCE: f32 = 2e-3;
/// Of weights after Adam steps of 1e-3: the tiny models are well conditioned, f32 and f64 PyTorch agree to 1e-4.
const WEIGHT_TOLERANCE: f32 = 1e-4;

fn tiny(name: &str) -> Vec<u8> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/golden").join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A full-size golden file, or `None` (said on stderr) where there are none.
fn shared(name: &str) -> Option<Vec<u8>> {
    let Some(folder) = std::env::var_os("TRACKLENS_SHARED") else {
        eprintln!("skipped {name}: TRACKLENS_SHARED does not name the folder with the full-size golden files");
        return None;
    };
    let path = PathBuf::from(folder).join("golden").join(name);
    Some(std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
}

fn read(bytes: &[u8]) -> Tensors {
    let file = safetensors::SafeTensors::deserialize(bytes).expect("a golden file");
    file.iter()
        .filter(|(_, view)| view.dtype() == safetensors::Dtype::F32)
        .map(|(name, view)| {
            let data = view.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
            (name.to_owned(), checkpoint::Tensor { shape: view.shape().to_vec(), data: data.collect() })
        })
        .collect()
}

/// The tensors whose names begin with `prefix`, without it.
fn under(tensors: &Tensors, prefix: &str) -> Tensors {
    tensors.iter().filter_map(|(n, t)| Some((n.strip_prefix(prefix)?.to_owned(), t.clone()))).collect()
}

fn on<const D: usize>(device: &Device, tensor: &checkpoint::Tensor) -> Tensor<D> {
    let shape: [usize; D] = tensor.shape.clone().try_into().expect("the rank");
    Tensor::from_data(TensorData::new(tensor.data.clone(), shape), device)
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("f32 values")
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn assert_close(what: &str, found: &[f32], expected: &[f32], tolerance: f32) {
    let difference = largest_difference(found, expected);
    eprintln!("{what}: largest difference {difference:e}");
    assert!(difference <= tolerance, "{what}: {difference:e} is more than {tolerance:e}");
}

fn assert_equals_golden(name: &str, bytes: &[u8]) {
    let device = Device::flex();
    let golden = read(bytes);
    let mut checkpoint = Checkpoint::from_safetensors(bytes).expect("a checkpoint");
    checkpoint.tensors.retain(|name, _| !name.starts_with("golden."));
    let sae = Sae::from_checkpoint(&checkpoint, &device).expect("the SAE");
    let mut inputs = 0;
    for size in ["64", "256"] {
        let Some(input) = golden.get(&format!("golden.input{size}")) else {
            continue;
        };
        let output = sae.forward(on(&device, input));
        let expected = |part: &str| &golden[&format!("golden.{part}{size}")].data;
        assert_close(&format!("{name}, keypoints {size}"), &values(output.latent), expected("keypoints"), KEYPOINT_TOLERANCE);
        assert_close(
            &format!("{name}, reconstruction {size}"),
            &values(output.reconstruction),
            expected("reconstruction"),
            RECONSTRUCTION_TOLERANCE,
        );
        inputs += 1;
    }
    assert!(inputs > 0, "{name} holds no input");
}

#[test]
fn a_tiny_sae_equals_the_authors() {
    assert_equals_golden("basic-vel-std-bg-tiny", &tiny("basic-vel-std-bg-tiny.safetensors"));
}

#[test]
fn a_full_size_sae_equals_the_authors() {
    if let Some(bytes) = shared("basic.safetensors") {
        assert_equals_golden("basic", &bytes);
    }
}

#[test]
fn weights_survive_the_way_through_the_modules() {
    for name in ["basic", "basic-std", "basic-vel-bg", "basic-vel-std-bg"] {
        let config = SaeConfig { target_size: [20, 12], ..small(name) };
        let checkpoint = fresh_weights(&config, 3);
        let sae = Sae::from_checkpoint(&checkpoint, &Device::flex()).expect("the SAE");
        let back = sae.to_checkpoint(&config, BTreeMap::new()).expect("the checkpoint");
        assert_eq!(back, checkpoint, "{name}");
        let read = Checkpoint::from_safetensors(&back.to_safetensors().expect("bytes")).expect("a checkpoint");
        assert_eq!(read, checkpoint, "{name}");
    }
}

#[test]
fn an_encoder_needs_no_decoder_and_an_sae_does() {
    let mut checkpoint = fresh_weights(&small("basic"), 0);
    checkpoint.tensors.retain(|name, _| name.starts_with("encoder."));
    let device = Device::flex();
    let encoder = Encoder::from_checkpoint(&checkpoint, &device).expect("the encoder");
    assert_eq!(encoder.forward(Tensor::zeros([2, 3, 16, 24], &device)).dims(), [2, 3, 2]);
    let error = Sae::from_checkpoint(&checkpoint, &device).expect_err("no decoder");
    assert!(error.to_string().contains("encoder only"), "{error}");
}

#[test]
fn points_leave_the_module_as_x_y() {
    let device = Device::flex();
    let latent = Tensor::<3>::from_data([[[0.25, -0.5], [1.0, 0.0]]], &device);
    let points = points_xy(latent).expect("points");
    assert_eq!(points.as_slice(), Some(&[-0.5, 0.25, 0.0, 1.0][..]));
}

#[test]
fn fresh_weights_follow_the_seed_and_the_fan_in() {
    let config = small("basic-vel-std-bg");
    let weights = fresh_weights(&config, 7);
    assert_eq!(weights, fresh_weights(&config, 7));
    assert_ne!(weights, fresh_weights(&config, 8));
    for (name, bound) in [
        ("encoder.block1.conv1.weight", 1.0 / 27f32.sqrt()),
        ("encoder.aggregate_conv.bias", 1.0 / 8f32.sqrt()),
    ] {
        let largest = weights.tensors[name].data.iter().fold(0f32, |a, v| a.max(v.abs()));
        assert!(largest <= bound && largest > bound / 4.0, "{name}: {largest} with bound {bound}");
    }
    assert_eq!(weights.tensors["decoder.gaussian_sampling.std"].data, [0.1]);
    assert!(weights.tensors["decoder.background_bias.bias"].data.iter().all(|v| *v == 0.0));
    assert!(weights.tensors["decoder.bn1.running_var"].data.iter().all(|v| *v == 1.0));
}

fn small(architecture: &str) -> SaeConfig {
    SaeConfig {
        keypoints: 3,
        encoder_channels: [4, 6, 8],
        decoder_channels: [5, 4, 3],
        target_size: [16, 16],
        ..SaeConfig::basic(architecture.parse::<Architecture>().expect("an architecture"))
    }
}

/// The training fixture: the SAE before the first step and the batch of all steps.
struct Training {
    tensors: Tensors,
    config: TrainConfig,
    device: Device,
}

impl Training {
    fn new() -> Self {
        let tensors = read(&tiny("train-basic-vel-std-bg-tiny.safetensors"));
        let sae = SaeConfig {
            keypoints: 4,
            encoder_channels: [4, 6, 8],
            decoder_channels: [8, 6, 4],
            target_size: [16, 16],
            ..SaeConfig::basic("basic-vel-std-bg".parse().expect("an architecture"))
        };
        Self { tensors, config: TrainConfig::new(sae), device: Device::flex().autodiff() }
    }

    fn sae(&self) -> Sae {
        let checkpoint = Checkpoint {
            config: self.config.sae.clone(),
            tensors: under(&self.tensors, "init."),
            metadata: BTreeMap::new(),
        };
        Sae::from_checkpoint(&checkpoint, &self.device).expect("the SAE")
    }

    /// Frames of `train.inputs` or `train.targets`: `[4, 3, 3, s, s]` is 4 snippets of 3 frames.
    fn frames(&self, name: &str) -> checkpoint::Tensor {
        let tensor = &self.tensors[name];
        let [snippets, length, channels, height, width] = tensor.shape[..] else {
            panic!("{name} has shape {:?}", tensor.shape);
        };
        checkpoint::Tensor { shape: vec![snippets * length, channels, height, width], data: tensor.data.clone() }
    }

    fn batch(&self) -> Batch {
        let (inputs, targets) = (self.frames("train.inputs"), self.frames("train.targets"));
        let size = |t: &checkpoint::Tensor| [t.shape[3], t.shape[2]];
        Batch {
            frames: inputs.shape[0],
            input_size: size(&inputs),
            target_size: size(&targets),
            inputs: inputs.data,
            targets: targets.data,
        }
    }
}

/// The encoder's last bias shifts a whole map, which the softmax does not see: its gradient is 0, and what Adam makes of
/// the rounding noise is ±1e-3 a step.
const NOT_COMPARED: &str = "encoder.aggregate_conv.bias";

#[test]
fn three_steps_of_training_equal_the_authors() {
    let training = Training::new();
    let mut trainer = Trainer::new(training.sae(), &training.config, &training.device);
    let expected = &training.tensors["train.losses"].data;
    for step in 0..3 {
        let losses = trainer.step(training.batch());
        let found = [losses.total, losses.reconstruction, 0.1 * losses.velocity].map(|v| v as f32);
        for (found, expected) in found.iter().zip(&expected[3 * step..]) {
            let relative = ((found - expected) / expected).abs();
            eprintln!("loss of step {}: relative difference {relative:e}", step + 1);
            assert!(relative <= 2e-3, "step {}: {found} instead of {expected}", step + 1);
        }
        let Some(prefix) = [Some("after1."), None, Some("after3.")][step] else {
            continue;
        };
        let found = trainer.sae().to_checkpoint(&training.config.sae, BTreeMap::new()).expect("weights").tensors;
        let expected = under(&training.tensors, prefix);
        assert!(found.keys().eq(expected.keys()), "the names of the state dict");
        let largest = expected
            .iter()
            .filter(|(name, _)| *name != NOT_COMPARED)
            .map(|(name, tensor)| (largest_difference(&found[name].data, &tensor.data), name))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .expect("weights");
        eprintln!("weights after step {}: largest difference {:e} in {}", step + 1, largest.0, largest.1);
        assert!(largest.0 <= WEIGHT_TOLERANCE, "{}: {:e}", largest.1, largest.0);
    }
    let device = Device::flex();
    let output = trainer.inference().forward(on(&device, &training.frames("train.inputs")));
    let expected = |name: &str| &training.tensors[name].data;
    assert_close("keypoints after step 3", &values(output.latent), expected("eval.keypoints_after3"), KEYPOINT_TOLERANCE);
    assert_close(
        "reconstruction after step 3",
        &values(output.reconstruction),
        expected("eval.reconstruction_after3"),
        RECONSTRUCTION_TOLERANCE,
    );
}

#[test]
fn gradients_of_the_first_step_equal_the_authors() {
    let training = Training::new();
    let sae = training.sae();
    let device = &training.device;
    let output = sae.forward(on(device, &training.frames("train.inputs")));
    let expected = |name: &str| &training.tensors[name].data;
    let train_mode = |what: &str, found: Vec<f32>, name: &str, tolerance| {
        assert_close(what, &found, expected(name), tolerance);
    };
    train_mode("keypoints in training", values(output.latent.clone()), "train.keypoints_step0", KEYPOINT_TOLERANCE);
    train_mode(
        "reconstruction in training",
        values(output.reconstruction.clone()),
        "train.reconstruction_step0",
        RECONSTRUCTION_TOLERANCE,
    );
    let loss = SnippetLoss::new(output, on(device, &training.frames("train.targets")), 0.1);
    let mut found = Gradients {
        gradients: GradientsParams::from_grads(loss.total.backward(), &sae),
        path: Vec::new(),
        tensors: BTreeMap::new(),
    };
    sae.visit(&mut found);
    let expected = under(&training.tensors, "grad1.");
    assert!(found.tensors.keys().eq(expected.keys()), "every parameter has a gradient, buffers have none");
    for (name, gradient) in expected.iter().filter(|(name, _)| *name != NOT_COMPARED) {
        let norm = |values: &mut dyn Iterator<Item = f32>| values.map(|v| v * v).sum::<f32>().sqrt();
        let found = &found.tensors[name];
        let difference = norm(&mut found.iter().zip(&gradient.data).map(|(a, b)| a - b));
        let relative = difference / norm(&mut gradient.data.iter().copied());
        eprintln!("gradient of {name}: relative difference {relative:e}");
        // Relative norm, because f32 may decide single ReLUs and pools another way than f64 does.
        assert!(relative <= 1e-2, "{name}: {relative:e}");
    }
}

/// Gathers the gradients of a module by path.
struct Gradients {
    gradients: GradientsParams,
    path: Vec<String>,
    tensors: BTreeMap<String, Vec<f32>>,
}

impl ModuleVisitor for Gradients {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(gradient) = self.gradients.get::<D>(param.id) {
            self.tensors.insert(self.path.join("."), values(gradient));
        }
    }

    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }
}

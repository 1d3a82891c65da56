//! The burn modules and one step of their training against the authors' modules
//! (`golden/*.safetensors`).

use std::collections::BTreeMap;

use crate::reference::{
    KEYPOINTS, TINY, Tolerances, batch, equals_the_reference, largest,
    tiny_training_equals_the_reference, training_equals_the_reference, values,
};
use crate::shared::golden;
use burn::prelude::{Device, Tensor, TensorData};
use tracklens::checkpoint::{self, Checkpoint, SaeConfig};
use tracklens::data::{Filter, Frame};
use tracklens::engine::{CpuEncoder, Workspace};
use tracklens::model::{Sae, fresh_weights, load_first_layer, points_xy, pointwise_encoder};

#[test]
fn tiny_saes_equal_the_reference() {
    for name in TINY {
        println!("{name}");
        equals_the_reference(
            &golden(&format!("{name}.safetensors")),
            &["64"],
            &Device::flex(),
        );
    }
}

#[test]
fn the_papers_saes_equal_the_reference() {
    for name in ["basic", "dsae", "keynet-vel-std-bg"] {
        if let Some(bytes) = crate::shared::large_golden(&format!("{name}.safetensors")) {
            println!("{name}");
            equals_the_reference(&bytes, &["64", "256"], &Device::flex());
        }
    }
}

/// On a real frame of several sizes.
fn the_engine_equals_the_module(name: &str, checkpoint: &Checkpoint) {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/data/panda_push/seq_0012/frame_003.png"
    );
    let frame = Frame::decode(&std::fs::read(path).expect("a frame")).expect("an image");
    let device = Device::flex();
    let sae = Sae::from_checkpoint(checkpoint, &device).expect("an SAE");
    let engine = CpuEncoder::new(checkpoint).expect("a plan");
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

#[test]
fn the_engine_computes_what_the_module_defines() {
    for name in TINY {
        let mut checkpoint =
            Checkpoint::from_safetensors(&golden(&format!("{name}.safetensors"))).expect("valid");
        if !checkpoint.config.trained_temperature {
            checkpoint.config.temperature = 0.7;
        }
        the_engine_equals_the_module(name, &checkpoint);
    }
}

/// Strides change no weight, so that one checkpoint serves for all.
#[test]
fn the_engine_follows_the_strides_of_a_keynet() {
    let golden = golden("keynet-vel-std-bg-tiny.safetensors");
    for strides in [[1, 1, 1, 1], [1, 2, 1, 1], [2, 1, 2, 1], [2, 2, 2, 2]] {
        let mut checkpoint = Checkpoint::from_safetensors(&golden).expect("valid");
        checkpoint.config.encoder_strides = strides.to_vec();
        the_engine_equals_the_module(&format!("strides {strides:?}"), &checkpoint);
    }
}

#[test]
fn three_steps_of_training_equal_the_reference() {
    let tolerances = Tolerances {
        // Relative; the reference's float32 differs from its float64 by up to 1e-5 in the third
        // step.
        losses: [1e-4; 2],
        gradients: [1e-3, 1e-2],
        // A step of Adam is 1e-3; a tenth of that tells a wrong gradient from rounding in these
        // tiny models.
        weights: Some(1e-4),
        update: 1e-2,
    };
    tiny_training_equals_the_reference(&tolerances, &Device::flex());
}

#[test]
fn three_steps_of_training_at_full_size_equal_the_reference() {
    let architecture = "basic-vel-std-bg";
    let Some(bytes) = crate::shared::large_golden(&format!("train-{architecture}.safetensors"))
    else {
        return;
    };
    let config = SaeConfig::named(architecture).expect("an architecture");
    let tolerances = Tolerances {
        // ReLU and max-pool decisions flip in float32: losses agree to 2e-3, gradients as a whole
        // and the first steps of Adam, which see their signs, by norm only.
        losses: [2e-3; 2],
        gradients: [5e-2, 2e-1],
        weights: None,
        update: 2e-1,
    };
    training_equals_the_reference(
        architecture,
        &fresh_weights(&config, 0),
        &bytes,
        &tolerances,
        &Device::flex(),
    );
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
            checkpoint
                .tensors
                .insert(checkpoint::SIGMA.to_owned(), sigma);
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
        let view = safetensors::tensor::TensorView::new(
            safetensors::Dtype::F32,
            tensor.shape.clone(),
            bytes,
        );
        (*name, view.expect("a tensor"))
    });
    safetensors::serialize(views, None).expect("a file")
}

#[test]
fn a_pointwise_encoder_is_orthogonal_in_the_middle_of_its_kernels() {
    for name in ["basic-vel-std-bg", "dsae", "keynet-vel-std-bg"] {
        let config = SaeConfig::named(name).expect("an architecture");
        let drawn = fresh_weights(&config, 3);
        let plain = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let pointwise = |seed: u64| {
            let mut weights = drawn.clone();
            pointwise_encoder(&mut weights, &plain, seed).expect("an encoder");
            weights.tensors
        };
        let tensors = pointwise(3);
        assert_eq!(tensors, pointwise(3), "{name}");
        for layer in config.encoder_layers() {
            let weight = format!("{}.weight", layer.name);
            // The identity is the same for every seed.
            let is_drawn = tensors[&weight] != pointwise(4)[&weight];
            assert_ne!(is_drawn, layer.is_second_in_block(), "{name} {weight}");
            let tensor = &tensors[&weight];
            assert_eq!(tensor.shape, drawn.tensors[&weight].shape);
            let taps = layer.kernel * layer.kernel;
            let mut filters = Vec::new();
            for kernel in tensor.data.chunks_exact(taps) {
                filters.push(f64::from(kernel[taps / 2]));
                let around = kernel.iter().enumerate().filter(|(i, _)| *i != taps / 2);
                assert!(around.map(|(_, value)| *value).all(|value| value == 0.0));
            }
            let (rows, columns) = (layer.outputs, layer.inputs);
            let at = |i: usize, k: usize| match rows <= columns {
                true => filters[i * columns + k],
                false => filters[k * columns + i],
            };
            if layer.name.ends_with("aggregate_conv") {
                let lengths: Vec<f64> = filters
                    .chunks_exact(columns)
                    .map(|filter| filter.iter().map(|v| v * v).sum::<f64>().sqrt())
                    .collect();
                let ratio = 10.0_f64.powf(1.0 / (rows - 1) as f64);
                for (n, length) in lengths.iter().enumerate() {
                    let expected = 0.5 * ratio.powi(n as i32);
                    assert!(
                        (length / expected - 1.0).abs() < 1e-6,
                        "{name} {n} {length}"
                    );
                }
                continue;
            }
            if layer.is_second_in_block() {
                let one =
                    |(i, value): (usize, &f64)| *value == f64::from(u8::from(i % (rows + 1) == 0));
                assert!(filters.iter().enumerate().all(one), "{name} {weight}");
            }
            for i in 0..rows.min(columns) {
                for j in 0..=i {
                    let dot: f64 = (0..rows.max(columns)).map(|k| at(i, k) * at(j, k)).sum();
                    let expected = f64::from(u8::from(i == j));
                    // Filters are f32: relative errors of 6e-8, in sums of products that are at
                    // most 1 in all.
                    assert!((dot - expected).abs() < 1e-6, "{name} {weight} {dot}");
                }
            }
            if layer.norm.is_none() {
                let bias = &tensors[&format!("{}.bias", layer.name)];
                assert!(bias.data.iter().all(|value| *value == 0.0));
            }
        }
        let convolutions = |name: &str| {
            name.starts_with("encoder.") && (name.contains("conv") && !name.contains("softmax"))
        };
        for (name, tensor) in drawn.tensors.iter().filter(|(n, _)| !convolutions(n)) {
            assert_eq!(&tensors[name], tensor, "{name}");
        }
    }
}

/// Colours that are multiplied before the first convolution are those that it multiplies itself.
#[test]
fn a_pointwise_encoder_takes_colors_as_the_matrix_has_them() {
    let config = SaeConfig::named("keynet").expect("an architecture");
    let drawn = fresh_weights(&config, 0);
    let first = |colors: &[[f64; 3]; 3]| {
        let mut weights = drawn.clone();
        pointwise_encoder(&mut weights, colors, 5).expect("an encoder");
        let data = &weights.tensors["encoder.block1.conv1.weight"].data;
        data.chunks_exact(49)
            .map(|kernel| f64::from(kernel[24]))
            .collect::<Vec<f64>>()
    };
    let plain = first(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let whitened = first(&COLORS);
    for (filter, plain) in whitened.chunks_exact(3).zip(plain.chunks_exact(3)) {
        for j in 0..3 {
            let expected: f64 = (0..3).map(|k| plain[k] * COLORS[k][j]).sum();
            // f32, of numbers that are at most 4.
            assert!((filter[j] - expected).abs() < 1e-6);
        }
    }
}

const COLORS: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [-2.0, 3.0, 0.0], [0.5, -1.0, 4.0]];

/// A pixel that changes is one cell that changes, where every stride has a cell for it.
#[test]
fn a_pointwise_encoder_sees_one_pixel_at_a_time() {
    let mut config = SaeConfig::named("keynet-vel-std-bg").expect("an architecture");
    config.encoder_channels = vec![8, 8, 8, 8];
    config.decoder_channels = vec![8, 8, 8];
    config.encoder_strides = vec![1, 2, 1, 1];
    let mut weights = fresh_weights(&config, 0);
    pointwise_encoder(&mut weights, &COLORS, 0).expect("an encoder");
    let device = Device::flex();
    let sae = Sae::from_checkpoint(&weights, &device).expect("an SAE");
    let maps = |pixel: f32| {
        let mut image = vec![0.5; 3 * 32 * 32];
        image[10 * 32 + 20] = pixel;
        let maps = sae.encoder.maps(batch(&[1, 3, 32, 32], image, &device));
        assert_eq!(maps.dims(), [1, 30, 16, 16]);
        values(maps)
    };
    let (before, after) = (maps(0.5), maps(1.0));
    let changed: Vec<usize> = (0..before.len())
        // Maps are of the size of 1; Winograd's transforms round what should stay the same.
        .filter(|i| (before[*i] - after[*i]).abs() > 1e-5)
        .map(|i| i % 256)
        .collect();
    assert!(!changed.is_empty());
    assert!(
        changed.iter().all(|cell| *cell == 5 * 16 + 10),
        "{changed:?}"
    );
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
    assert!(
        message(&[("fc.bias", &dense)])
            .contains("none of its 1 tensors has the shape [64, 3, 7, 7]")
    );
    assert!(
        message(&[("a", &filters), ("b", &like_it)])
            .contains("2 of its tensors (a, …) have the shape")
    );
    let mut broken = filters.clone();
    broken.data[5] = f32::NAN;
    assert!(message(&[("a", &broken)]).contains("`a` holds NaN"));
}

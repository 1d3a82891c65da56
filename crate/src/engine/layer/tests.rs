use std::collections::BTreeMap;

use super::*;
use crate::checkpoint::{Architecture, SaeConfig};
use crate::engine::gemm;

/// Numbers in -1 to 1.
fn noise(seed: u64, len: usize) -> Vec<f32> {
    let mut random = fastrand::Rng::with_seed(seed);
    (0..len).map(|_| 2.0 * random.f32() - 1.0).collect()
}

fn checkpoint(shape: &ConvLayer) -> Checkpoint {
    let taps = shape.outputs * shape.inputs * shape.kernel * shape.kernel;
    let tensor = |shape: Vec<usize>, data: Vec<f32>| Tensor { shape, data };
    let weight = vec![shape.outputs, shape.inputs, shape.kernel, shape.kernel];
    let mut tensors = BTreeMap::from([("conv.weight".to_owned(), tensor(weight, noise(1, taps)))]);
    match &shape.norm {
        None => {
            let bias = tensor(vec![shape.outputs], noise(2, shape.outputs));
            tensors.insert("conv.bias".to_owned(), bias);
        }
        Some(_) => {
            for (seed, part) in (3..).zip(["weight", "bias", "running_mean", "running_var"]) {
                let mut data = noise(seed, shape.outputs);
                if part == "running_var" {
                    data.iter_mut().for_each(|v| *v = v.abs() + 0.1);
                }
                tensors.insert(format!("bn.{part}"), tensor(vec![shape.outputs], data));
            }
        }
    }
    Checkpoint {
        config: SaeConfig::new(Architecture::BASIC),
        tensors,
        metadata: BTreeMap::new(),
    }
}

/// The layer by its definition, in f64: rows x columns x outputs.
fn naive(checkpoint: &Checkpoint, shape: &ConvLayer, sizes: &Sizes, input: &[f32]) -> Vec<f64> {
    let data = |name: &str| &checkpoint.tensors[name].data;
    let weight = data("conv.weight");
    let [width, height] = sizes.convolved;
    let mut sums = vec![0.0; width * height * shape.outputs];
    for (i, sum) in sums.iter_mut().enumerate() {
        let (cell, output) = (i / shape.outputs, i % shape.outputs);
        let (x, y) = (cell % width, cell / width);
        for ky in 0..shape.kernel {
            for kx in 0..shape.kernel {
                let column = (x * shape.stride + kx).wrapping_sub(shape.padding);
                let row = (y * shape.stride + ky).wrapping_sub(shape.padding);
                if column >= sizes.from[0] || row >= sizes.from[1] {
                    continue;
                }
                for channel in 0..shape.inputs {
                    let tap =
                        ((output * shape.inputs + channel) * shape.kernel + ky) * shape.kernel + kx;
                    let value = input[(row * sizes.from[0] + column) * shape.inputs + channel];
                    *sum += f64::from(weight[tap]) * f64::from(value);
                }
            }
        }
    }
    if shape.pool {
        let [to_width, to_height] = sizes.to;
        let mut pooled = vec![f64::NEG_INFINITY; to_width * to_height * shape.outputs];
        for (i, sum) in sums.iter().enumerate() {
            let (cell, output) = (i / shape.outputs, i % shape.outputs);
            let [x, y] = [cell % width, cell / width].map(|at| at.div_ceil(2));
            let place = &mut pooled[(y * to_width + x) * shape.outputs + output];
            *place = place.max(*sum);
        }
        sums = pooled;
    }
    for (i, sum) in sums.iter_mut().enumerate() {
        let part = |name: &str| f64::from(data(name)[i % shape.outputs]);
        *sum = match shape.norm {
            None => *sum + part("conv.bias"),
            Some(_) => {
                let deviation = (part("bn.running_var") + BATCH_NORM_EPSILON).sqrt();
                let normed = (*sum - part("bn.running_mean")) / deviation;
                (normed * part("bn.weight") + part("bn.bias")).max(0.0)
            }
        };
    }
    sums
}

/// The largest difference of a layer from its definition, relative to the largest result.
fn error(shape: &ConvLayer, size: [usize; 2]) -> f64 {
    let checkpoint = checkpoint(shape);
    let lanes = gemm::lanes();
    // Only the image comes in as it is.
    let channels = match shape.inputs {
        3 => 3,
        inputs => inputs.next_multiple_of(lanes),
    };
    let layer = Layer::new(&checkpoint, shape.clone(), lanes, channels).expect("a layer");
    let sizes = Sizes::new(shape, size).expect("large enough");
    let values = noise(9, size[0] * size[1] * shape.inputs);
    let (map, len) = layer.input(&sizes);
    let [mut input, mut output, mut scratch] = [(); 3].map(|()| Buffer::default());
    input.grow(len).expect("memory");
    // What a former frame left behind does not matter.
    input[map.len()..].fill(f32::NAN);
    for (cell, values) in values.chunks_exact(shape.inputs).enumerate() {
        let at = map.at(cell % size[0], cell / size[0]);
        input[at..at + shape.inputs].copy_from_slice(values);
    }
    let to = Map {
        size: sizes.to,
        channels: layer.outputs(),
        before: 2,
        after: [1, 3],
    };
    output.grow(to.len()).expect("memory");
    output.fill(7.0);
    to.clear_frame(&mut output);
    scratch.grow(layer.scratch(&sizes)).expect("memory");
    scratch.fill(f32::NAN);
    layer.run(&sizes, &input, &mut output, to, &mut scratch);
    let expected = naive(&checkpoint, shape, &sizes, &values);
    let largest = expected
        .iter()
        .fold(0.0f64, |largest, v| largest.max(v.abs()));
    let mut error = 0.0f64;
    for (cell, expected) in expected.chunks_exact(shape.outputs).enumerate() {
        let at = to.at(cell % sizes.to[0], cell / sizes.to[0]);
        for (ours, expected) in output[at..].iter().zip(expected) {
            assert!(ours.is_finite());
            error = error.max((f64::from(*ours) - expected).abs() / largest);
        }
        output[at..at + to.channels].fill(0.0);
    }
    assert!(
        output[..to.len()].iter().all(|v| *v == 0.0),
        "the frame stays 0"
    );
    error
}

fn shape(kernel: usize, stride: usize, inputs: usize, outputs: usize) -> ConvLayer {
    ConvLayer {
        name: "conv".to_owned(),
        norm: Some("bn".to_owned()),
        inputs,
        outputs,
        kernel,
        stride,
        padding: kernel / 2,
        upsample: false,
        pool: false,
    }
}

/// Sums of up to 800 products in f32 differ from f64 by 1e-6 of the largest result, and Winograd's
/// transforms magnify that: 7e-6 is measured.
const TOLERANCE: f64 = 2e-5;

#[test]
fn layers_equal_their_definition_at_any_size() {
    let mut largest = 0.0f64;
    for (kernel, inputs, outputs) in [
        (3, 3, 32),
        (3, 32, 32),
        (3, 16, 40),
        (3, 5, 7),
        (5, 32, 16),
        (5, 24, 30),
        (7, 3, 30),
        (7, 16, 16),
        (1, 32, 30),
        (9, 4, 3),
    ] {
        for size in [[16, 16], [17, 31], [33, 9], [7, 23], [8, 5], [1, 1]] {
            for (pool, stride, has_norm) in [
                (false, 1, true),
                (true, 1, true),
                (false, 1, false),
                (false, 2, true),
            ] {
                let mut layer = shape(kernel, stride, inputs, outputs);
                layer.pool = pool;
                layer.norm.take_if(|_| !has_norm);
                let error = error(&layer, size);
                assert!(error < TOLERANCE, "{error:.1e} for {layer:?} at {size:?}");
                largest = largest.max(error);
            }
        }
    }
    println!("largest difference {largest:.1e}");
}

#[test]
fn layers_without_padding_equal_their_definition() {
    for (kernel, stride, inputs, outputs) in [(7, 2, 3, 64), (5, 1, 64, 32), (3, 1, 32, 16)] {
        for size in [[16, 16], [17, 31], [33, 9], [7, 7]] {
            let layer = ConvLayer {
                padding: 0,
                ..shape(kernel, stride, inputs, outputs)
            };
            let error = error(&layer, size);
            assert!(error < TOLERANCE, "{error:.1e} for {layer:?} at {size:?}");
        }
    }
}

#[test]
fn the_plan_says_how_a_layer_is_computed() {
    let plan = |shape: ConvLayer| {
        let checkpoint = checkpoint(&shape);
        let layer =
            Layer::new(&checkpoint, shape.clone(), gemm::lanes(), shape.inputs).expect("a layer");
        layer.plan(&Sizes::new(&shape, [256, 256]).expect("large enough"))
    };
    let by_tiles = plan(ConvLayer {
        pool: true,
        ..shape(3, 1, 32, 32)
    });
    assert_eq!(by_tiles.kernel, "Winograd F(4x4, 3x3) + pool + ReLU");
    assert_eq!(by_tiles.size, [129, 129]);
    assert_eq!(by_tiles.defined, 256 * 256 * 32 * 32 * 9);
    assert_eq!(by_tiles.done, 65 * 65 * 36 * 32 * 32);
    let strided = plan(shape(3, 2, 32, 64));
    assert_eq!(strided.kernel, "Winograd F(4x4, 3x3), stride 2 + ReLU");
    assert_eq!(strided.defined, 128 * 128 * 32 * 64 * 9);
    assert_eq!(strided.done, 32 * 32 * 81 * 32 * 64);
    let first = plan(shape(7, 2, 3, 64));
    assert_eq!(first.kernel, "direct 7x7, stride 2 + ReLU");
    assert_eq!(first.done, first.defined);
    let along_rows = plan(shape(7, 1, 3, 32));
    assert_eq!(along_rows.kernel, "Winograd F(4, 7) along rows + ReLU");
    assert_eq!(along_rows.done, 64 * 256 * 70 * 3 * 32);
}

#[test]
fn weights_that_are_not_finite_are_named_by_their_layer() {
    let layer = shape(3, 1, 16, 16);
    for (tensor, value) in [
        ("conv.weight", f32::NAN),
        ("conv.weight", f32::INFINITY),
        ("bn.running_var", -1.0),
    ] {
        let mut damaged = checkpoint(&layer);
        damaged.tensors.get_mut(tensor).expect("a tensor").data[3] = value;
        let result = Layer::new(&damaged, layer.clone(), gemm::lanes(), 16);
        let error = result.err().expect("an error").to_string();
        assert!(error.contains("`conv`"), "{error}");
    }
}

#[test]
fn the_size_of_packed_weights_is_known_before_they_are_packed() {
    let lanes = gemm::lanes();
    for (kernel, stride, inputs, outputs) in [
        (3, 1, 32, 40),
        (3, 2, 32, 64),
        (5, 1, 16, 30),
        (7, 1, 3, 32),
        (7, 2, 3, 64),
        (1, 1, 32, 5),
    ] {
        let shape = shape(kernel, stride, inputs, outputs);
        let channels = if inputs == 3 {
            3
        } else {
            inputs.next_multiple_of(lanes)
        };
        let layer =
            Layer::new(&checkpoint(&shape), shape.clone(), lanes, channels).expect("a layer");
        let packed = match &layer.kernel {
            Kernel::Direct(panels) => panels.steps() * panels.columns(),
            Kernel::Rows(panels) | Kernel::Winograd(_, panels) => panels
                .iter()
                .map(|panels| panels.steps() * panels.columns())
                .sum(),
        };
        assert_eq!(
            Layer::weights(&shape, lanes, channels),
            packed as u64,
            "{shape:?}"
        );
    }
}

#[test]
fn what_does_not_fit_into_memory_is_an_error() {
    let error = Buffer::default()
        .grow(usize::MAX / 8)
        .expect_err("no memory");
    assert!(error.to_string().contains("no memory for"), "{error}");
}
